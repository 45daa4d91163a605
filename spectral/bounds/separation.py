"""A bound of the modulus of the spectrum beyond the enclosed eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats
from ...core.estimates import ErrorKind
from ...core.rounding import EPS
from ...kernels import Law
from ...kernels.laws.matrix_law import finite_matrix
from ...kernels.laws.structure import Rules, fold
from ..eigenvalues.dense import symmetric_half
from ..essential.compact import compact_matrix
from ..essential.edge import essential_edge
from .images import is_traced
from .oscillations import fast_top
from .rays_on_panels import show_another, suits_rays

# For a law with eigenvalues g^l the power P^p is chosen with x = g^p near this value. Then the sum of the omitted
# squares, x^(2 m)/(1 - x^2), is below the last listed square, x^(2 m - 2), and above rounding.
POWER_TARGET = 0.6


@dataclass(frozen=True)
class Separation:
    """A bound ``radius`` of the modulus of the spectrum without m listed eigenvalues.

    Attributes
    ----------
    radius : float
        ``inf`` if no bound is known.
    kind : {"bound", "estimate"}
    reason : str
    """

    radius: float
    kind: ErrorKind
    reason: str


def rest_of_spectrum(law: Law, values: Floats, width: float, next_value: float, by_value: bool = False) -> Separation:
    """A bound of the spectrum beyond the listed eigenvalues.

    Parameters
    ----------
    law : Law
    values : array of shape (m,)
        The listed eigenvalues, including the 1 of the constants.
    width : float
        Distance within which each listed value has its own eigenvalue.
    next_value : float
        Modulus plus residual of the next eigenvalue in the basis, for laws without a better bound.
    by_value : bool
        Whether the values listed are the largest ones, and the spectrum is bounded from above only.
    """
    found = _of_series(law, values, width) or _of_matrix(law, len(values))
    if found is not None:
        return found
    fraction = lambertian_fraction(law)
    if fraction > 0.0 and len(values) == 1:
        return Separation(
            1.0 - fraction, "bound", f"a Lambertian fraction a = {fraction:.6g}: 1 - a beyond the constants"
        )
    edge = essential_edge(law)
    if edge.high >= next_value:
        reason = f"norm of the essential part, {edge.high:.6g}: " + "; ".join(edge.reasons)
        return Separation(edge.high, edge.kind, reason)
    # a law that nearly preserves fast oscillations may have spectrum above the next value of slow functions
    fast = fast_top(law)
    if fast is not None and fast[0] > next_value:
        return Separation(1.0, "estimate", f"fast oscillations show spectrum near 1, how much is not known: {fast[1]}")
    # rays see eigenfunctions in narrow intervals of angles, between the nodes of panels
    another = None
    if is_traced(law) and suits_rays(law):
        another = show_another(law, len(values) - 1, next_value, by_value)
    if another is not None:
        shown = f"rays show another eigenvalue, of at least {another:.3g}"
        return Separation(1.0, "estimate", f"{shown}, between the nodes of the basis")
    reason = f"next eigenvalue in the basis, with its residual; essential part at most {edge.high:.3g}"
    return Separation(next_value, "estimate", reason)


def lambertian_fraction(law: Law) -> float:
    r"""The fraction a in P = a L + (1 - a) R with L Lambertian and R Markov; beyond the constants ||P|| <= 1 - a.

    It is computed from the parts of sums and products: a product has 1 - (1 - a)(1 - b).

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> round(lambertian_fraction(ker.maxwell(0.25) ** 2), 12)
    0.4375
    """
    rules: Rules[float] = Rules(
        lambda leaf: leaf.lambertian_fraction,
        lambda terms: sum(weight * fraction for weight, fraction in terms),
        lambda fractions: 1.0 - float(np.prod([1.0 - fraction for fraction in fractions])),
        lambda fraction: fraction,
    )
    return min(fold(law, rules), 1.0)


def _of_series(law: Law, values: Floats, width: float) -> Separation | None:
    """The bound of a law with eigenvalues g^l: the sum of all squares of those of P^p, minus the listed terms."""
    g = law.eigenvalue_ratio
    if not g:
        return None if g is None else Separation(0.0, "bound", "the law is Lambertian: of rank 1")
    power = max(1, round(np.log(POWER_TARGET) / np.log(abs(g))))
    total = 1.0 / -np.expm1(2 * power * np.log(abs(g)))
    listed = float(np.sum(np.maximum(np.abs(values) - width, 0.0) ** (2 * power)))
    radius = float((max(total - listed, 0.0) + 16.0 * EPS * total) ** (0.5 / power))
    what = "P" if power == 1 else f"P^{power}"
    reason = (
        f"Hilbert-Schmidt remainder of {what}: {total:.6g} less the squares of the {len(values)} listed eigenvalues"
    )
    return Separation(radius, "bound", reason)


def _of_matrix(law: Law, listed: int) -> Separation | None:
    """The next modulus of a matrix that is near the law in norm, plus its distance."""
    exact = finite_matrix(law)
    matrix = compact_matrix(law) if exact is None else exact if law.is_compact else None
    if matrix is None or matrix.beyond is None:
        return None
    moduli = np.sort(np.abs(np.linalg.eigvalsh(symmetric_half(matrix.symmetric))))[::-1]
    skew = float(np.linalg.norm(matrix.symmetric - matrix.symmetric.T))
    radius = max(*np.abs(matrix.beyond), *moduli[listed : listed + 1]) + float(matrix.error) + skew
    reason = (
        f"next eigenvalue of a matrix at the distance {float(matrix.error):.3g} from the law: {matrix.error.method}"
    )
    return Separation(float(radius), matrix.error.kind, reason)
