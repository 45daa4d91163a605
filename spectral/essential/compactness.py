"""The Hilbert-Schmidt norm of a law, or the reason why there is none; compactness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.checks import instance, positive_number
from ...core.estimates import ErrorKind, Estimate
from ...kernels import DensityLaw, InvolutionLaw, Law, Legendre, discretise
from ...kernels.laws.structure import Rules, fold
from .edge import essential_edge

# Sizes of polynomial bases in which the norm of the matrix is taken.
SIZES = (16, 32, 64, 128, 256, 512)
# Ends of the essential spectrum below this are taken as 0 for laws with a density.
UNSEEN = 1e-3
# Increments that fall by less than this factor from size to size do not show a limit.
FALLING = 0.7


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
    rays are the second obstacle, see `essential_edge`. For a density the norms of growing Galerkin matrices increase to
    the norm of the law. For curved walls, whose kernels can have singularities that are not square-integrable, the
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
    known = _contains_only_densities(law) and edge.high <= UNSEEN
    norms: list[float] = []
    for size in SIZES:
        matrix = discretise(law, Legendre(size), tolerance=0.1 * wanted)
        norms.append(float(np.linalg.norm(matrix.symmetric)))
        rest = _rest(norms)
        error = rest + float(matrix.error)
        if error <= wanted or not known:
            break
    if not known or not math.isfinite(rest):
        reason = f"no theorem decides; polynomials of degree below {size} give a lower bound"
        compact = True if edge.high == 0.0 and edge.kind == "bound" else None
        return HilbertSchmidtNorm(norms[-1], math.inf, "estimate", "Galerkin matrix", compact, (*edge.reasons, reason))
    how = f"Galerkin matrices of up to {size} polynomials"
    reasons = ("the law has a density, and the norms of growing matrices have a limit, so it is compact",)
    return HilbertSchmidtNorm(norms[-1], error, "estimate", how, True, reasons)


def _rest(norms: list[float]) -> float:
    """An estimate of what larger matrices add; inf if the norms do not show a limit yet."""
    if len(norms) < 3:
        return math.inf
    before, last = norms[-2] - norms[-3], norms[-1] - norms[-2]
    noise = 1e-13 * norms[-1]
    if last <= noise:
        return noise
    factor = last / before if before > 0.0 else math.inf
    return last * factor / (1.0 - factor) + last if factor < FALLING else math.inf


def _none(kind: ErrorKind, reasons: tuple[str, ...]) -> HilbertSchmidtNorm:
    return HilbertSchmidtNorm(math.inf, 0.0, kind, "structure of the law", False, reasons)


def _contains_involution(law: Law) -> bool:
    """Whether a term of the law is an involution, or a product of involutions."""

    def of_any(terms: Sequence[tuple[float, bool]]) -> bool:
        return any(fact for _, fact in terms)

    return fold(law, Rules(lambda leaf: isinstance(leaf, InvolutionLaw), of_any, all, lambda fact: fact))


def _contains_only_densities(law: Law) -> bool:
    """Whether the law is compact by its parts: sums of densities, and products with at least one."""

    def of_all(terms: Sequence[tuple[float, bool]]) -> bool:
        return all(fact for _, fact in terms)

    return fold(law, Rules(lambda leaf: isinstance(leaf, DensityLaw), of_all, any, lambda fact: fact))
