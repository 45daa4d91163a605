"""Relaxation and mixing times of a chain of reflections, Cheeger's bounds, and the billiard Laplacian as a limit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ...core.checks import Floats, choice, frozen, instance, number_between, shortened, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...core.rounding import EPS
from ...geometry import Wall
from ...kernels import KernelMatrix, Law, Legendre, discretise
from ...kernels.laws.law import in_frame
from ...kernels.laws.matrix_law import check_law, finite_matrix
from ..eigenvalues.spectra import Spectrum, matrix_spectrum
from ..gap.gap import modulus_gap

Distance = Literal["L2", "total variation", "chi-square"]
Start = Literal["density", "worst"]
# Number of eigenvalues computed for a matrix, and wanted error of the gap of a law.
SOUGHT, TOLERANCE = 6, 1e-4
# Limit on the squarings of a matrix: the numbers of steps beyond are no integers in float64.
MOST_SQUARINGS = 53


@dataclass(frozen=True, repr=False)
class MixingTime(Summary):
    """The number of steps after which a chain is near its invariant distribution.

    Attributes
    ----------
    steps : int
        Sufficient number of steps for every initial density f with ||f - 1|| = ``initial``, or with ``start="worst"``
        for every initial angle.
    earliest : int
        For ``distance="L2"`` and ``"chi-square"`` fewer steps are not sufficient for the worst such density, and with
        ``start="worst"`` for the worst angle. It is 0 for ``"total variation"`` of densities, which has no such bound.
    relaxation_time : Estimate
        -1/ln(slem), in steps.
    slem : Estimate
        The largest modulus in the spectrum off the constants.
    distance : {"L2", "total variation", "chi-square"}
    initial : float
        ||f - 1|| in L^2 of the invariant probability measure; inf for ``start="worst"``.
    kind : {"bound", "estimate"}
        Kind of ``steps``, the same as for ``slem``, whose upper end is used. From the worst start ``steps`` are those
        of the transition probabilities as they are, to rounding.
    start : {"density", "worst"}
        Where the chain begins: in a density of this norm, or at the worst angle.
    """

    steps: int
    earliest: int
    relaxation_time: Estimate
    slem: Estimate
    distance: Distance
    initial: float
    kind: ErrorKind
    start: Start = "density"
    _show = "distance start initial earliest relaxation_time slem kind"
    _unit = "times in steps"
    _more = ".relaxation_time.method, .slem.method"

    def __float__(self) -> float:
        return float(self.steps)

    def _headline(self) -> str:
        return f"{self.steps} steps"


def mixing_time(
    kernel: Law | KernelMatrix | Spectrum,
    within: float = 0.25,
    distance: Distance = "total variation",
    *,
    initial: float = 1.0,
    start: Start = "density",
) -> MixingTime:
    r"""The number of steps until a distribution is close to the invariant distribution.

    By default the chain begins with a density at the distance ``initial`` from the invariant one, not at the worst
    start: a particle at one angle has no density, and after a reflection one that may be far larger.

    Parameters
    ----------
    kernel : Law, KernelMatrix or Spectrum
        A reversible kernel, or its spectrum.
    within : float
        The allowed distance from the invariant distribution.
    distance : {"L2", "total variation", "chi-square"}
        ||f_n - 1||, half of the L^1 norm of f_n - 1, or ||f_n - 1||^2.
    initial : float
        ||f - 1|| of the initial density f with respect to sin(theta)/2 d theta. A particle that starts at one angle has
        a density after the first reflection by a law that has one.
    start : {"density", "worst"}
        ``"worst"``: at the worst angle, as mixing times of finite chains are defined. For laws of finitely many states,
        such as `MatrixLaw`, and for matrices on bins, of which it is the time of their own chain.

    Returns
    -------
    MixingTime

    Raises
    ------
    AccuracyError
        If the law has no gap, or its slem is not known to be less than 1; if rounding hides the worst start.
    InputError
        If an argument is not as described, or the worst start is asked for of another kernel.

    Notes
    -----
    With f_n = P^n f, ||f_n - 1|| <= slem^n ||f - 1||, and a sequence of densities f attains this bound in the limit.
    The total variation distance is at most half of the bound, the chi-square distance at most its square.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = mixing_time(ker.maxwell(0.5), 0.01, "L2")
    >>> found.steps, found.earliest, round(float(found.relaxation_time), 4)
    (7, 7, 1.4427)

    A chain of two states with the eigenvalue .8 has the distance .8^n/2 from either state:

    >>> mixing_time(ker.MatrixLaw([[0.9, 0.1], [0.1, 0.9]]), 0.1, start="worst").steps
    8
    """
    within = number_between("within", within, 0.0, np.inf)
    choice("distance", distance, get_args(Distance))
    choice("start", start, get_args(Start))
    check_law("kernel", kernel, "a Law, a KernelMatrix or a Spectrum", KernelMatrix, Spectrum)
    size = number_between("initial", initial, 0.0, np.inf, closed="low")
    gap = _modulus_gap(kernel)
    slem = slem_from_gap(gap)
    # in terms of the gap, because 1 - slem loses digits for a slem near 1
    least, most = gap.value - gap.error, min(gap.value + gap.error, 1.0)
    if least <= 0.0:
        raise AccuracyError(
            f"the law is not known to have a gap: 1 - slem = {gap}, so no mixing time can be given", 1.0 - least
        )
    if start == "worst":
        steps = _from_worst(kernel, within, distance)
        return MixingTime(steps, steps, relaxation_time(gap), slem, distance, math.inf, slem.kind, start)
    norm = {"L2": within, "total variation": 2.0 * within, "chi-square": float(np.sqrt(within))}[distance]
    target = norm / size if size else np.inf
    earliest = 0 if distance == "total variation" else _steps(most, target)
    return MixingTime(_steps(least, target), earliest, relaxation_time(gap), slem, distance, size, slem.kind)


def _from_worst(kernel: Law | KernelMatrix | Spectrum, within: float, distance: Distance) -> int:
    """The least number of steps, at least 1, from the worst state of a finite chain, by powers of its matrix."""
    matrix = finite_matrix(kernel) if isinstance(kernel, Law) else kernel
    is_chain = isinstance(matrix, KernelMatrix) and matrix.basis.is_partition
    if not isinstance(matrix, KernelMatrix) or not is_chain or (isinstance(kernel, Law) and any(matrix.beyond or ())):
        raise InputError(
            f"start: expected 'density' of {shortened(kernel)}, no chain of finitely many states; for one of a "
            "matrix on bins pass ker.discretise(law, ker.Bins(64))"
        )
    weights = np.asarray(matrix.weights)

    def is_far(array: Floats) -> bool:
        rest = np.abs(array / weights - 1.0)
        norm = 0.5 * rest @ weights if distance == "total variation" else rest**2 @ weights
        return bool(norm.max() > (within**2 if distance == "L2" else within))

    powers = [np.asarray(matrix.array)]
    while is_far(powers[-1]):
        if len(powers) > MOST_SQUARINGS:
            raise AccuracyError("start: rounding hides when the chain is so near its invariant distribution", within)
        square = powers[-1] @ powers[-1]
        powers.append(square / square.sum(axis=1, keepdims=True))
    reached, steps = np.eye(len(weights)), 1
    for exponent in reversed(range(len(powers) - 1)):
        further = reached @ powers[exponent]
        if is_far(further):
            reached, steps = further, steps + 2**exponent
    return steps


def slem_from_gap(gap: Estimate) -> Estimate:
    """The slem 1 - gap, with the rounding of this difference added to the error."""
    value = 1.0 - gap.value
    return Estimate(value, gap.error + (EPS if 1.0 - value != gap.value else 0.0), gap.kind, gap.method)


def relaxation_time(gap: Estimate) -> Estimate:
    """The relaxation time -1/ln(1 - gap), with an infinite error if the gap may be 0.

    Examples
    --------
    >>> f"{float(relaxation_time(Estimate(1e-18, 0.0, 'bound', ''))):.12g}"
    '1e+18'
    """
    slower, value, faster = (_time_scale(one) for one in (gap.value - gap.error, gap.value, gap.value + gap.error))
    if not np.isfinite(slower):
        return Estimate(value if np.isfinite(value) else 0.0, np.inf, gap.kind, "-1/ln(slem)")
    error = max(slower - value, value - faster) + 4.0 * EPS * value
    return Estimate(value, error, gap.kind, "-1/ln(slem)")


def _modulus_gap(kernel: Law | KernelMatrix | Spectrum) -> Estimate:
    """1 - slem with its error."""
    if isinstance(kernel, Law):
        return modulus_gap(kernel, TOLERANCE)
    listed = kernel if isinstance(kernel, Spectrum) else matrix_spectrum(kernel, SOUGHT)
    modulus, width = np.abs(listed.values[1:]), listed.errors.total()[1:]
    method = f"{listed.basis!r}, {listed.method}"
    if not modulus.size:
        return Estimate(1.0, np.inf, "estimate", method)
    largest = int(np.argmax(modulus))
    if listed.slem > modulus[largest]:
        # the slem is the edge of the essential spectrum of a law
        return Estimate(1.0 - listed.slem, listed.gap_error, "estimate", f"{listed.verdict}: {listed.method}")
    return Estimate(1.0 - float(modulus[largest]), float(width[largest]), "estimate", method)


def _steps(gap: float, target: float) -> int:
    """The least n with (1 - gap)^n <= target."""
    if target >= 1.0:
        return 0
    if gap >= 1.0:
        return 1
    return int(np.ceil(np.log(target) / np.log1p(-gap) * (1.0 - 4.0 * EPS)))


def _time_scale(gap: float) -> float:
    return float(-1.0 / np.log1p(-gap)) if 0.0 < gap < 1.0 else (np.inf if gap <= 0.0 else 0.0)


@dataclass(frozen=True, repr=False)
class Conductance(Summary):
    """The best cut by a level of the second eigenfunction, and its bounds for the gap.

    Attributes
    ----------
    value : float
        Flux from the set to its complement over the smaller of the two measures.
    cells : array of shape (n,)
        1 for the bins of the set, 0 for the others.
    gap_above : float
        Upper bound of the gap, flux / (measure times measure of the complement). It holds for the matrix and for the
        law, whose Rayleigh quotient of the set is the same. For a sampled matrix it has a sampling error.
    gap_below : float
        Lower bound value^2 / 2 of the gap of the matrix. It does not hold for the law.
    error : float
        Error of ``gap_above``, from the Frobenius error of the matrix.
    """

    value: float
    cells: Floats
    gap_above: float
    gap_below: float
    error: float


def conductance(matrix: KernelMatrix) -> Conductance:
    """Cheeger's bounds for a reversible matrix on bins, from the level sets of its second eigenfunction.

    Parameters
    ----------
    matrix : KernelMatrix
        A reversible matrix on `Bins`.

    Raises
    ------
    InputError
        If the basis has no cells, or only one.

    Notes
    -----
    Some level set of the second eigenfunction has a conductance of at most sqrt(2 gap), so gap >= value^2 / 2.
    Source: D. A. Levin and Y. Peres, *Markov Chains and Mixing Times* (2017), theorem 13.10.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = conductance(ker.discretise(ker.MatrixLaw([[0.9, 0.1], [0.1, 0.9]]), ker.Bins(2)))
    >>> round(found.value, 12), round(found.gap_above, 12), round(found.gap_below, 12)
    (0.1, 0.2, 0.005)
    """
    instance("matrix", matrix, KernelMatrix, "ker.discretise(law, ker.Bins(64))")
    if not matrix.basis.is_partition or matrix.size < 2:
        raise InputError(f"matrix: expected one in at least two bins, got {matrix.basis!r}")
    found = matrix_spectrum(matrix, matrix.size)
    weights = np.asarray(matrix.weights)
    flux = 0.5 * (matrix.flux + matrix.flux.T)
    second = found.vectors[:, 1] / np.sqrt(weights)
    order = np.argsort(second, kind="stable")
    sorted_flux, mass = flux[np.ix_(order, order)], np.cumsum(weights[order])[:-1]
    # the flux out of the first m cells: their total flux minus the flux among them
    within = np.cumsum(np.cumsum(sorted_flux, axis=0), axis=1).diagonal()[:-1]
    out = np.maximum(np.cumsum(sorted_flux.sum(axis=1))[:-1] - within, 0.0)
    ratio = out / np.minimum(mass, 1.0 - mass)
    best = int(np.argmin(ratio))
    cells = np.zeros(matrix.size)
    cells[order[: best + 1]] = 1.0
    above = float(out[best] / (mass[best] * (1.0 - mass[best])))
    value = float(ratio[best])
    return Conductance(value, frozen(cells), above, 0.5 * value**2, float(matrix.error))


# Chords of a wall's pieces and twice as many, whose difference tells the error of the mean squared slope.
CHORDS = 4096
# Ratio of the steepest slopes of the two levels that indicates a vertical tangent. There the steepest slope grows like
# the root of the number of chords.
STEEPENING = 1.2


@dataclass(frozen=True, repr=False)
class LaplacianComparison(Summary):
    r"""Comparison of a law in Feres' convention with 1 + 2 h d/dz (1 - z^2) d/dz, z = cos(theta).

    Attributes
    ----------
    flatness : float
        h, computed as (1 - <e_1, P_F e_1>)/4 with e_1 = sqrt(3) cos(theta).
    degrees : array of int, shape (n,)
        1, ..., n.
    deficits : array of shape (n,)
        1 - <e_l, P_F e_l> for the normalised Legendre polynomials e_l.
    ratios : array of shape (n,)
        deficits / (2 h l (l + 1)), which is 1 if the Laplacian describes the law.
    error : float
        Frobenius error of the matrix.
    """

    flatness: float
    degrees: Floats
    deficits: Floats
    ratios: Floats
    error: float


def laplacian_comparison(law: Law, degrees: int = 6, tolerance: float = 1e-8) -> LaplacianComparison:
    """Compare the diagonal of a law in Legendre polynomials with the eigenvalues of the billiard Laplacian.

    Parameters
    ----------
    law : Law
        The law, in either convention; it is compared in Feres'.
    degrees : int
        Number of Legendre polynomials.
    tolerance : float
        Wanted Frobenius error of the matrix.

    Notes
    -----
    Source: R. Feres and H.-K. Zhang, J. Stat. Phys. 141 (2010) 1039: P_F - 1 is about 2 h times the Legendre operator
    for walls of mean squared slope h, so 1 - lambda_l is about 2 h l (l + 1), and the gap 4 h.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = laplacian_comparison(ker.CircularArcLaw(0.1), 2)
    >>> [round(float(ratio), 2) for ratio in found.ratios]
    [1.0, 0.99]
    """
    whole_number("degrees", degrees, 1)
    instance("law", law, Law, "ker.WallLaw(wall)")
    specular = in_frame(law, "specular")
    matrix = discretise(specular, Legendre(2 * degrees + 2), tolerance=tolerance)
    order = np.arange(1, degrees + 1)
    diagonal = np.diagonal(matrix.symmetric)[order]
    deficits = 1.0 - diagonal
    flatness = float(deficits[0]) / 4.0
    ratios = deficits / (2.0 * flatness * order * (order + 1)) if flatness > 0.0 else np.full(degrees, np.nan)
    return LaplacianComparison(flatness, frozen(order), frozen(deficits), frozen(ratios), float(matrix.error))


def mean_squared_slope(wall: Wall) -> float:
    """The mean squared slope h of a wall over a period; ``inf`` if a piece is vertical or overhangs.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> round(mean_squared_slope(geo.triangular_teeth(np.pi / 2)), 12)
    1.0
    """
    instance("wall", wall, Wall, "geo.koch(2)")
    coarse, fine = (_slope_sum(wall, chords) for chords in (CHORDS, 2 * CHORDS))
    if not np.isfinite(fine[0]) or fine[1] > STEEPENING * coarse[1]:
        # a vertical tangent, where the integral diverges
        return float("inf")
    # chords have the error 1/chords^2
    return float((fine[0] + (fine[0] - coarse[0]) / 3.0) / wall.period)


def _slope_sum(wall: Wall, chords: int) -> tuple[float, float]:
    """The integral of the squared slope of the chords of a wall's pieces, and the largest slope."""
    total, steepest = 0.0, 0.0
    for piece in wall.pieces:
        points = piece.point(np.linspace(0.0, 1.0, chords + 1))
        run, rise = np.diff(points, axis=0).T
        if np.any(run <= 0.0):
            return np.inf, np.inf
        total += float(np.sum(rise**2 / run))
        steepest = max(steepest, float(np.max(np.abs(rise / run))))
    return total, steepest
