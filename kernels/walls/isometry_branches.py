"""Sign and offset of the isometry theta' = sign theta + offset of each branch of a law."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, angles
from ..laws.law import Law

# Breakpoints asked for. Angles nearer to grazing are probed between the last breakpoint and 0 or pi.
BREAKPOINTS = 20_000


def isometries(law: Law, theta: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Probability, sign and offset of every branch of a law at the angles ``theta``.

    They are read from the law's table if it has one. Otherwise a second angle gives the sign: between two breakpoints
    every branch is one isometry.

    Parameters
    ----------
    law : Law
        A law made of isometries; other laws raise an InputError.
    theta : array_like
        Incoming angles in (0, pi), radians.

    Returns
    -------
    probability, sign, offset : arrays of shape ``theta.shape + (branches,)``
        theta' = sign theta + offset, sign = +1 or -1.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> probability, sign, offset = isometries(ker.specular(), 1.0)
    >>> probability.tolist(), sign.tolist(), (offset / np.pi).tolist()
    ([1.0], [-1.0], [1.0])
    """
    incoming = angles("theta", theta)
    table = law.isometry_table()
    if table is not None:
        return table.conditionals(incoming)
    edges = np.concatenate([[0.0], law.breakpoints(BREAKPOINTS)[0], [np.pi]])
    right = np.clip(np.searchsorted(edges, incoming, side="right"), 1, len(edges) - 1)
    low, high = edges[right - 1], edges[right]
    # the midpoint towards the farther end of the interval
    second = 0.5 * (incoming + np.where(incoming - low > high - incoming, low, high))
    # one call for both angles, so that the branches have the same order
    probability, outgoing = law.branches(np.stack([incoming, second]))
    rises = (outgoing[1] - outgoing[0]) * (second - incoming)[..., None] >= 0.0
    sign = np.where(rises, 1.0, -1.0)
    return probability[0], sign, outgoing[0] - sign * incoming[..., None]
