"""The Hilbert-Schmidt norm of a law, or the reason why there is none; compactness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.checks import instance, positive_number
from ...core.estimates import ErrorKind, Estimate
from ...kernels import InvolutionLaw, Law, Legendre, discretise
from ...kernels.laws.structure import Rules, fold
from .compact import compact_matrix
from .edge import essential_edge

# Size of the polynomial basis in which a lower bound of the norm is taken.
SIZE = 16
# Ends of the essential spectrum below this are taken as 0 for laws with a density.
UNSEEN = 1e-3
# Largest error of a norm, as a fraction of it; a larger one shows that the kernel may not be square-integrable.
LARGEST_ERROR = 0.1


@dataclass(frozen=True, repr=False)
class HilbertSchmidtNorm(Estimate):
    r"""The Hilbert-Schmidt norm of a law in L^2(sin theta d theta): of a reversible law (sum_l lambda_l^2)^(1/2).

    The value is inf, with error 0, for a law that is not compact. An infinite error means that the norm is not known;
    then the value is a lower bound.

    Attributes
    ----------
    compact : bool or None
        Whether the law is a compact operator, so that its spectrum consists of eigenvalues that tend to 0; None if it
        is not known.
    reasons : tuple of str
        Sentences that say why.
    """

    compact: bool | None
    reasons: tuple[str, ...]


def hilbert_schmidt_norm(law: Law, tolerance: float = 1e-6) -> HilbertSchmidtNorm:
    r"""Compute the norm (int int k^2 nu nu)^(1/2) of a law with kernel k, or state why there is none.

    Parameters
    ----------
    law : Law
    tolerance : float
        Wanted error of the norm.

    Returns
    -------
    HilbertSchmidtNorm

    Raises
    ------
    InputError
        If an argument is not as described.

    Notes
    -----
    A law that contains an isometry theta' = +-theta + c with positive probability, on a set of positive measure, is not
    compact: let f_n be the indicator functions of sets that shrink to a point, divided by their norms. They tend weakly
    to 0, but the norms of P f_n do not, because all parts of P f_n are non-negative. This holds for flat tops, for
    straight pieces that rays can meet alone, and for every polygonal wall. A deterministic law preserves norms. Grazing
    rays are the second obstacle, see `essential_edge`. The norm of a density is that of a matrix, within the
    distance of both. For curved walls, whose kernels can have singularities that are not square-integrable, the
    norm of the largest matrix is given as a lower bound.

    Source: Rudzis 2022, section 1.2.6 (R. Feres and H.-K. Zhang, Commun. Math. Phys. 313, 2012).

    Examples
    --------
    Henyey-Greenstein scattering has the eigenvalues g^l, so the norm is (1 - g^2)^(-1/2):

    >>> from asperity import geometry as geo, kernels as ker, spectral as spec
    >>> norm = spec.hilbert_schmidt_norm(ker.henyey_greenstein(0.6))
    >>> round(float(norm), 9), norm.compact
    (1.25, True)
    >>> spec.hilbert_schmidt_norm(ker.WallLaw(geo.rectangular_teeth(0.7))).value
    inf
    """
    instance("law", law, Law, "ker.lambertian()")
    wanted = positive_number("tolerance", tolerance)
    if _contains_involution(law):
        return _none("bound", ("a part of the law is deterministic, f -> f o T, and preserves norms",))
    edge = essential_edge(law)
    if edge.low > 0.0:
        found = f"the law is not compact: its essential spectrum reaches {edge.low:.6g}"
        return _none(edge.kind, (found, *edge.reasons))
    matrix = compact_matrix(law) if edge.high <= UNSEEN else None
    norm = 0.0 if matrix is None else float(np.linalg.norm(matrix.symmetric))
    if matrix is not None and float(matrix.error) <= LARGEST_ERROR * norm:
        reasons = ("the law has a density, and its distance from a matrix is known, so it is compact",)
        return HilbertSchmidtNorm(norm, float(matrix.error), "estimate", matrix.error.method, True, reasons)
    norm = float(np.linalg.norm(discretise(law, Legendre(SIZE), tolerance=0.1 * wanted).symmetric))
    reason = f"no theorem decides; polynomials of degree below {SIZE} give a lower bound"
    compact = True if edge.high == 0.0 and edge.kind == "bound" else None
    return HilbertSchmidtNorm(norm, math.inf, "estimate", "Galerkin matrix", compact, (*edge.reasons, reason))


def _none(kind: ErrorKind, reasons: tuple[str, ...]) -> HilbertSchmidtNorm:
    return HilbertSchmidtNorm(math.inf, 0.0, kind, "structure of the law", False, reasons)


def _contains_involution(law: Law) -> bool:
    """Whether a term of the law is an involution, or a product of involutions."""

    def of_any(terms: Sequence[tuple[float, bool]]) -> bool:
        return any(fact for _, fact in terms)

    return fold(law, Rules(lambda leaf: isinstance(leaf, InvolutionLaw), of_any, all, lambda fact: fact))
