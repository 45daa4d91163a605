"""Integrals of Legendre polynomials by given nodes: the moments of pieces of rows against functions on panels."""

from __future__ import annotations

import numpy as np

from ...checks import Floats


def legendre_moments(local: Floats, weight: Floats, degree: int) -> Floats:
    """Sums over the nodes of weights times L_0, ..., L_degree, shape (degree + 1, cells).

    ``local`` are the nodes in (-1, 1) and ``weight`` their weights, shapes (cells, nodes). By the three-term recurrence
    (k + 1) L_(k + 1) = (2 k + 1) t L_k - k L_(k - 1), so that only two polynomials are held at a time.

    Examples
    --------
    >>> legendre_moments(np.array([[-1.0, 0.5]]), np.array([[1.0, 2.0]]), 2).tolist()
    [[3.0], [0.0], [0.75]]
    """
    before, current = np.ones_like(local), local
    moments = np.empty((degree + 1, len(local)))
    for k in range(degree + 1):
        moments[k] = np.einsum("ij,ij->i", weight, before)
        before, current = current, ((2 * k + 3) * local * current - (k + 1) * before) / (k + 2)
    return moments
