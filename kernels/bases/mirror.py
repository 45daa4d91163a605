"""The matrix of the mirror map J f(theta) = f(pi - theta) in a basis, and bases whose span J maps to itself."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from .assembly import overlaps
from .basis import Basis
from .bins import Bins
from .legendre import Legendre
from .panels import Panels
from .tensor import TensorBasis

# Edges x and pi - y closer than this count as equal; pi - x has a rounding error of at most one spacing of pi.
MIRROR_TOLERANCE = 8.0 * np.spacing(np.pi)


def is_mirror_symmetric(basis: Basis) -> bool:
    """Whether J maps the span of the basis to itself."""
    if isinstance(basis, Legendre):
        return True
    if isinstance(basis, TensorBasis):
        return all(is_mirror_symmetric(factor) for factor in basis.factors)
    edges = basis.edges
    return bool(np.all(np.abs(edges + edges[::-1] - np.pi) <= MIRROR_TOLERANCE))


def reflection_matrix(basis: Basis) -> Floats:
    """The matrix <e_i, J e_k>, orthogonal if `is_mirror_symmetric` holds; in a tensor basis J mirrors every angle.

    Examples
    --------
    >>> reflection_matrix(Legendre(3)).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    >>> reflection_matrix(Bins(2)).tolist()
    [[0.0, 1.0], [1.0, 0.0]]
    """
    if isinstance(basis, Legendre):
        return np.diag((-1.0) ** np.arange(basis.size))
    if isinstance(basis, TensorBasis):
        product: Floats = np.ones((1, 1))
        for factor in basis.factors:
            product = np.asarray(np.kron(product, reflection_matrix(factor)), dtype=np.float64)
        return product
    if isinstance(basis, Bins) and is_mirror_symmetric(basis):
        return np.ascontiguousarray(np.eye(basis.size)[::-1])
    edges = np.unique(np.concatenate((basis.edges, np.pi - basis.edges[::-1])))
    return overlaps(basis, lambda angle: basis.evaluate(np.pi - angle), edges)


def mirror_image(matrix: Floats, basis: Basis, *, rows: bool = True) -> Floats:
    """J S J, or S J without ``rows``, of a matrix in a basis; a view if the basis is a partition that J keeps."""
    if isinstance(basis, Bins) and is_mirror_symmetric(basis):
        return matrix[::-1, ::-1] if rows else matrix[:, ::-1]
    flip = reflection_matrix(basis)
    return flip @ matrix @ flip.T if rows else matrix @ flip


def mirror_refinement(basis: Basis) -> tuple[Basis, Floats]:
    """A basis with a J-invariant span that contains the span of ``basis``, and the coefficients of ``basis`` in it.

    The second value R has shape (coarse, fine). The Galerkin matrix S on the refinement gives R S R^T on ``basis``.
    """
    if is_mirror_symmetric(basis):
        return basis, np.eye(basis.size)
    joint = np.concatenate((basis.edges, np.pi - basis.edges[::-1]))
    lower = np.unique(joint[joint < 0.5 * np.pi])
    lower = lower[np.concatenate(([True], np.diff(lower) > MIRROR_TOLERANCE))]
    centre = [0.5 * np.pi] if np.any(joint == 0.5 * np.pi) else []
    edges = np.concatenate((lower, centre, np.pi - lower[::-1]))
    fine: Basis
    if isinstance(basis, Panels):
        fine = Panels(edges, basis.degree, basis.measure.name)
    elif isinstance(basis, Bins):
        fine = Bins(edges, basis.measure.name)
    else:
        raise InputError(f"{basis!r} is not kept by theta -> pi - theta; expected edges that are mirror images")
    return fine, overlaps(basis, fine.evaluate, np.unique(np.concatenate((edges, basis.edges))))
