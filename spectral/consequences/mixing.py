"""Relaxation times and mixing times of a chain of reflections."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ...core.checks import Floats, choice, number_between, shortened
from ...core.errors import AccuracyError, InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...core.rounding import EPS
from ...kernels import KernelMatrix, Law
from ...kernels.laws.matrix_law import finite_matrix, not_a_law
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
    if not isinstance(kernel, Law | KernelMatrix | Spectrum):
        raise not_a_law("kernel", "a Law, a KernelMatrix or a Spectrum", kernel)
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
