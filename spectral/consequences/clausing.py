"""The probability that a particle passes a channel or a tube with rough walls (Clausing's problem)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from ...core.checks import Floats, Rng, choice, generator, instance, number_between, positive_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, RULE_OF_THREE, Estimate, student_95
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...kernels import KernelMatrix, Law, Legendre, discretise, specular
from ...kernels.hemisphere.hemisphere_law import DirectionLaw, HemisphereCombination, HemisphereLaw
from ...kernels.laws.structure import sum_of_words, words_of
from ...kernels.walls.rectangular import sum_rule
from .channel import LARGEST, in_paper_frame, laws_of_walls, reflected, sampled

Section = Literal["channel", "tube"]
Function: TypeAlias = Callable[[Floats], Floats]
# Directions of flight and numbers of walls, and the displacements along the axis, directions and walls that follow.
Reflections: TypeAlias = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]

# Gauss nodes of a panel in two resolutions, whose difference is the error of diffuse walls.
NODES = (8, 10)
# Longest diffuse channel, in the unit in which the kernel begins to fall; rounding of a diffuse reflection.
LONGEST, ROUNDING = 1e5, 64.0 * EPS
# Flights up to a diffuse reflection in units of the inverse diffuse fraction, beyond which the sum of probabilities is
# below rounding, and the Gauss nodes for those from 2^j to 2^(j+1) - 1: functions of the inverse number, analytic but
# for the imaginary axis, have the relative error 5.8^-24. Knots of the spline for each factor of e in length.
FLIGHTS, RULE, KNOTS = 50.0, 12, 50
# Other laws: polynomials of the cosine, with the nodes of a panel; those of the first matrix; the largest number of
# both that does not shorten the panels at the ends; limit on the unknowns, a few seconds.
LEVELS, FIRST_SIZE, FULL_PANELS, MOST_UNKNOWNS = ((8, 4), (16, 6), (32, 8), (64, 6)), 32, 16, 4000
# The factor by which a doubling of the polynomials is trusted to reduce their error.
GAIN, FEWEST_LEVELS = 8.0, 3
# Largest norm of a law between polynomials of degrees 16 to 31. For laws that smooth it is below 0.3; isometries, as of
# straight pieces, keep functions of all degrees, and the errors of their projections follow no rule.
MOST_KEPT = 0.5
# Tolerance of the matrix, in the Frobenius norm, of which the transmission shows little.
MATRIX_TOLERANCE = 0.1
# Particles at a time, the limit on their reflections, about ten seconds of a law with a closed form, and the particles
# of which one reflection takes as long as the calls that it needs. Batches within the limit at least.
TOGETHER, MOST_REFLECTIONS, LEAST_TOGETHER, BATCHES = 2**16, 5 * 10**7, 500, 8


@dataclass(frozen=True)
class _Geometry:
    """Fractions of diffuse particles by the distance z >= 0 along the axis; ``width`` is where they begin to fall.

    Attributes
    ----------
    kernel : callable
        From a place on the wall to the wall at the distance z, a density.
    beyond : callable
        From a place on the wall to the section at the distance z and through it: the integral of the kernel beyond z.
    passing : callable
        From an end through the section at the distance z without collision.
    """

    kernel: Function
    beyond: Function
    passing: Function
    width: float


def _beyond_in_tube(z: Floats) -> Floats:
    root = np.sqrt(z * z + 4.0)
    return np.asarray(4.0 / (root * (root + z) ** 2))


def _kernel_in_tube(z: Floats) -> Floats:
    root = np.sqrt(z * z + 4.0)
    return np.asarray(4.0 * (z + 2.0 * root) / (root**3 * (root + z) ** 2))


# In the channel of width 1 the fractions are those of the plane: the cosine law in space projects to that in the plane.
GEOMETRIES: dict[Section, _Geometry] = {
    "channel": _Geometry(
        lambda z: 0.5 * (1.0 + z * z) ** -1.5,
        lambda z: 0.5 / (np.sqrt(1.0 + z * z) * (np.sqrt(1.0 + z * z) + z)),
        lambda z: 1.0 / (np.sqrt(1.0 + z * z) + z),
        1.0,
    ),
    # radius 1
    "tube": _Geometry(
        _kernel_in_tube,
        _beyond_in_tube,
        lambda z: 4.0 / (np.sqrt(z * z + 4.0) + z) ** 2,
        2.0,
    ),
}


@reported("transmission")
def transmission(
    law: Law | DirectionLaw,
    length: float,
    section: Section = "channel",
    tolerance: float = 1e-4,
    rng: Rng = None,
    *,
    other: Law | DirectionLaw | None = None,
) -> Estimate:
    r"""The probability that a particle that enters a channel or a tube leaves it at the other end (Clausing).

    Particles enter at one end, uniformly over the opening and with the cosine law, as from a gas at rest.

    Parameters
    ----------
    law : Law or DirectionLaw
        The law of the walls, or of the floor of a channel: a planar one, in either convention, or one of directions in
        space such as a `HemisphereLaw`. The ceiling of a channel is the mirror image of a floor. The
        orientation of grooves is their angle with the axis: 0 for grooves along it, pi/2 for grooves across. In a tube
        ``lambertian()`` and ``maxwell(a)`` mean the diffuse law and its mixture in space; it takes no other planar law.
    length : float
        The length in widths of the channel, or in radii of the tube.
    section : {"channel", "tube"}
        Two parallel walls, or a round tube.
    tolerance : float
        The wanted error. Diffuse walls and mixtures with specular ones, of any fraction, reach 1e-8.
    rng : None, int or numpy.random.Generator
        The source of the rays of other laws.
    other : Law or DirectionLaw, optional
        The law of the ceiling of a channel, of the same kind and in the same convention as that of the floor.

    Returns
    -------
    Estimate
        The error is that reached. Laws that smooth, such as those of arcs, meet 1e-4 in seconds. For flights the error
        exceeds the tolerance where 5 x 10^7 reflections do not reach it (ten seconds to a minute): an error of 1e-4
        takes up to 10^8 particles, each with about as many reflections as the length has widths. Runs of specular
        reflections count as one: a law with the fraction a of others has a times as many. The interval is in [0, 1].

    Raises
    ------
    InputError
        If an argument is not as described, the tube has another planar law or a second one, or its length times
        diffuse fraction is more than 2 x 10^5 radii.

    Notes
    -----
    The cosine law of the half sphere projects to that of the plane, and walls with grooves across the channel keep the
    velocity along the grooves. So a channel in space and its section in the plane have one transmission.

    At walls that reflect diffusely with probability a, else specularly, the places x of diffuse reflections form a
    Markov chain. With the fraction S of particles that go from a place of the wall beyond a distance, S_a(z) = a sum_k
    (1 - a)^(k-1) S(z/k) is the fraction without a diffuse reflection before. The probability u of leaving at the far
    end solves u(x) = S_a(L - x) - int S_a'(d) u(y) dy with the distance d of x and y, by Gauss quadrature on panels
    whose lengths double from both ends to the middle. For other laws in a channel u depends on the angle too. In N
    polynomials of its cosine, 8 to 64, it solves N such equations, coupled by the matrix of the law; the error is the
    largest change from N to 2 N polynomials, with a discount for earlier ones, plus that by the error of the matrix.
    Where it misses the tolerance, for laws near isometries, such as those of straight pieces, and in tubes, particles
    are simulated from their first reflection on that is not specular; the fraction that has none is exact.

    With two laws there is a probability u for each wall. Flights lead to the other wall, so the equations are coupled
    crosswise. If both walls are diffuse with probabilities a and b, else specular, the number k of flights from one
    diffuse reflection to the next is even or odd as it leads to the same wall or to the other one: from the floor it is
    2 m + 1 with the probability r^m b, r = (1 - a)(1 - b), and 2 m + 2 with r^m (1 - b) a. A specular ceiling is a
    symmetry plane: the channel passes as many particles as one of half the length with the other law on both walls.

    Source: P. Clausing, Ann. Phys. 404 (1932) 961.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> print(f"{spec.transmission(ker.lambertian(), 10.0):.5f}")
    0.24056
    >>> print(f"{spec.transmission(ker.lambertian(), 10.0, 'tube'):.7f}")
    0.1909424

    A smooth ceiling doubles the width of the channel:

    >>> print(f"{spec.transmission(ker.lambertian(), 20.0, other=ker.specular()):.5f}")
    0.24056

    Grooves across a tube hold more particles back than grooves along it:

    >>> grooves = [ker.HemisphereLaw(ker.lambertian(), angle) for angle in (0.0, np.pi / 2)]
    >>> [f"{spec.transmission(law, 2.0, 'tube', tolerance=0.01, rng=0):.2f}" for law in grooves]
    ['1.00', '0.51']

    Retroreflecting walls pass what meets no wall:

    >>> print(f"{spec.transmission(ker.retroreflection(), 0.75, rng=0):.5f}")
    0.50000
    """
    far = number_between("length", length, 0.0, LARGEST)
    choice("section", section, get_args(Section))
    wanted, source = positive_number("tolerance", tolerance), generator(rng)
    laws = _laws_of_walls(law, other, section)
    split = [_without_specular(one) for one in laws]
    # a specular ceiling is a symmetry plane of a channel with twice the width
    rough = [(one, *parts) for one, parts in zip(laws, split, strict=True) if parts[0] > 0.0]
    far *= max(len(rough), 1) / len(laws)
    diffuse = max(fraction for fraction, _ in split)
    if diffuse * far <= EPS:
        return Estimate(1.0, diffuse * far, "bound", "no more particles are reflected otherwise than specularly")
    found = _found(rough, section, far, wanted, source)
    ends = found.value - found.error, found.value + found.error
    low, high = np.clip(ends, 0.0, 1.0).tolist()
    return found if (low, high) == ends else replace(found, value=0.5 * (low + high), error=0.5 * (high - low))


def _laws_of_walls(law: Law | DirectionLaw, other: Law | DirectionLaw | None, section: Section) -> tuple[Any, ...]:
    """The law of both walls or the laws of floor and ceiling, planar ones in the paper's convention."""
    if other is not None and section == "tube":
        raise InputError(f"other: a tube has one wall; expected no second law, got {other!r}; take section='channel'")
    if isinstance(law, DirectionLaw):
        if other is None:
            return (law,)
        instance("other", other, DirectionLaw, "ker.HemisphereLaw(law), in space as the first is")
        return tuple(dict.fromkeys((law, other)))
    second: Any = other
    return laws_of_walls(law, second)


def _found(
    walls: Sequence[tuple[Any, float, Any]], section: Section, length: float, tolerance: float, rng: np.random.Generator
) -> Estimate:
    """The transmission, from law, fraction of reflections not known to be specular, and law of these, for each wall."""
    laws, fractions, rests = zip(*walls, strict=True)
    longest, runs = LONGEST * GEOMETRIES[section].width, _Runs(fractions)
    largest = max(fractions)
    if isinstance(laws[0], DirectionLaw):
        enter, leave = partial(ENTRIES[section], runs=runs, rng=rng), partial(_leave, rests, section, runs, rng)
        return _by_flights(section, length, tolerance, runs, enter, leave)
    if all(rest.is_lambertian for rest in rests) and largest * length <= longest:
        return _by_integral_equation(GEOMETRIES[section], runs, length)
    if section == "channel":
        smooth = _by_polynomials(laws, length, tolerance, rng)
        if smooth.error <= tolerance:
            return smooth
        enter, turn = partial(_entered_in_plane, runs=runs, rng=rng), partial(_turn, rests, runs, rng)
        flown = _by_flights(section, length, tolerance, runs, enter, turn, least=2.0 * smooth.error)
        return min(smooth, flown, key=lambda found: found.error)
    if not rests[0].is_lambertian:
        raise InputError(
            "law: in a tube expected lambertian(), maxwell(a) or HemisphereLaw(law, orientation), because a planar law "
            f"does not tell the direction of its grooves, got {laws[0]!r}"
        )
    raise InputError(
        f"length: in a tube expected at most {longest:g} radii over the diffuse fraction, got {length:g}, {largest:g}"
    )


def _without_specular(law: Law | DirectionLaw) -> tuple[float, Any]:
    """The probability of reflections that are not known to be specular, and their law."""
    if isinstance(law, DirectionLaw):
        terms = []
        for weight, laws in law.parts:
            if len(laws) > 1 or not isinstance(laws[0], HemisphereLaw) or laws[0].redrawing is not None:
                terms.append((weight, laws))
                continue
            part, rest = _without_specular(in_paper_frame(laws[0].law))
            terms.append((weight * part, (replace(laws[0], law=rest),)))
        total = math.fsum(weight for weight, _ in terms)
        return total, HemisphereCombination(tuple((weight / (total or 1.0), laws) for weight, laws in terms))
    words = words_of(law)
    if words is None:
        return 1.0, law
    rest = {word: weight for word, weight in words.items() if set(word) != {specular()} or len(word) % 2 == 0}
    total = math.fsum(rest.values()) if len(rest) < len(words) else 1.0
    return total, sum_of_words((weight / total, word) for word, weight in rest.items()) if rest else law


# ---- the integral equation -----------------------------------------------------------------------------------------
def _by_integral_equation(geometry: _Geometry, runs: _Runs, length: float) -> Estimate:
    flights, matrix = _diffuse_flights(geometry, runs, length), runs.reflection
    (coarse, _), (fine, slope) = (_solved(flights, matrix, length, nodes) for nodes in NODES)
    error = abs(fine - coarse) + ROUNDING * (1.0 + float(np.sum(matrix * slope)))
    return Estimate(fine, error, "estimate", f"integral equation, {NODES[1]} nodes a panel; error from {NODES[0]}")


def _by_polynomials(laws: Sequence[Law], length: float, tolerance: float, rng: np.random.Generator) -> Estimate:
    """In polynomials of the cosine, of degrees that double until the tolerance is met or the work exceeds its limit."""
    levels = [
        one
        for one in LEVELS
        if (len(_panels(length, FULL_PANELS / one[0])) - 1) * math.prod(one) * len(laws) <= MOST_UNKNOWNS
    ]
    value, changes, error, size = math.nan, list[float](), math.inf, 0
    for accuracy in (MATRIX_TOLERANCE, 0.1 * tolerance):
        matrices = [discretise(law, Legendre(FIRST_SIZE), tolerance=accuracy, rng=rng) for law in laws]
        kept = [np.asarray(one.symmetric)[FIRST_SIZE // 2 :, FIRST_SIZE // 2 :] for one in matrices]
        if max(float(np.linalg.norm(one, 2)) for one in kept) > MOST_KEPT:
            levels = []
        if not levels or _in_polynomials(matrices, length, *levels[0])[1] <= 0.5 * tolerance:
            break
    for degree, nodes in levels:
        if degree > FIRST_SIZE:
            matrices = [discretise(law, Legendre(degree), tolerance=accuracy, rng=rng) for law in laws]
        finer, noise = _in_polynomials(matrices, length, degree, nodes)
        if noise > tolerance:
            break
        changes = [abs(finer - value), *(change / GAIN for change in changes)]
        value, size = finer, degree
        # one small change may be chance
        if len(changes) >= FEWEST_LEVELS:
            error = max(changes[:-1]) + noise
        if error <= tolerance:
            break
    methods = " and ".join(dict.fromkeys(one.method for one in matrices))
    method = f"integral equation in {size} polynomials of the cosine, by {methods}; error from {size // 2}"
    return Estimate(value, error, "estimate", method)


def _in_polynomials(matrices: Sequence[KernelMatrix], length: float, size: int, nodes: int) -> tuple[float, float]:
    """The transmission in so many polynomials, with its error by those of the matrices of the walls."""
    from scipy.linalg import block_diag

    whole = block_diag(*(matrix.symmetric[:size, :size].T for matrix in matrices))
    value, slope = _solved(_planar_flights(size, length, len(matrices)), whole, length, nodes)
    noise = 0.0
    for wall, matrix in enumerate(matrices):
        own = slope[wall * size :, wall * size :][:size, :size]
        # of a sum of matrices the spread shows only the error of rays
        if matrix.replicates and "+" not in matrix.method:
            parts = [float(np.sum(own.T * np.asarray(part)[:size, :size])) for part in matrix.replicates]
            noise += student_95(len(parts)) * float(np.std(parts, ddof=1)) / math.sqrt(len(parts))
        else:
            noise += float(matrix.error) * float(np.linalg.norm(own))
    return value, noise


@dataclass(frozen=True)
class _Flights:
    """Flights between reflections at W walls, with the directions expanded in N functions.

    Attributes
    ----------
    arriving : sequence of (array, callable)
        Matrices of shape (W, W) for flights from walls to walls. Functions from displacements along the axis to the
        functions of the directions times the density of the displacement, shape (..., N).
    leaving : callable
        From displacements to the functions of the directions, shape (..., N).
    beyond : callable
        From distances to the integrals of the leaving functions over larger displacements, shape (..., W N).
    signs : array, shape (N,)
        1 for functions that are even along the axis, -1 for odd ones.
    entering, direct : float
        Particles that enter, those towards one of two walls, in units of those that a wall sends to the end; the
        fraction that is never reflected.
    width, resolved : float
        The distance at which the density begins to fall; the length of the panels at the ends.
    """

    arriving: tuple[tuple[Floats, Function], ...]
    leaving: Function
    beyond: Function
    signs: Floats
    entering: float
    direct: float
    width: float
    resolved: float


def _runs(diffuse: float) -> tuple[Floats, Floats]:
    """Numbers of flights from one diffuse reflection to the next, and their probabilities, as a quadrature.

    Sums over k = 2^j, ..., 2^(j+1) - 1 by the Gauss rule for these numbers, from the discrete Chebyshev polynomials.
    """
    if diffuse == 1.0:
        return np.ones(1), np.ones(1)
    number, weight = [], []
    for size in 2.0 ** np.arange(math.log2(FLIGHTS / diffuse) + 1.0):
        node, mass = sum_rule(np.array([size]), int(min(size, RULE)))
        number.append(size + node[0])
        weight.append(mass[0])
    flights = np.concatenate(number)
    return flights, np.concatenate(weight) * diffuse * np.exp((flights - 1.0) * math.log1p(-diffuse))


@dataclass(frozen=True)
class _Runs:
    """Flights up to a diffuse reflection, which both walls or the one and the other have with these probabilities.

    Of two walls with probabilities a and b, else specular, the number of flights is odd if the last one leads to the
    other wall. A round of two flights has no diffuse reflection with the probability r = (1 - a)(1 - b).
    """

    fractions: tuple[float, ...]

    @property
    def stopped(self) -> float:
        """The probability of a diffuse reflection in a flight if both walls are alike, else in a round."""
        high, low = max(self.fractions), min(self.fractions)
        return high if len(self.fractions) == 1 else high + (1.0 - high) * low

    @property
    def reflection(self) -> Floats:
        """The matrix of reflection for particles that `terms` counts."""
        return np.diag(self.fractions) if len(self.fractions) > 1 else np.ones((1, 1))

    def terms(self) -> list[tuple[Floats, Floats, Floats]]:
        """Matrices from walls to walls, numbers of flights, and probabilities up to the factors of `reflection`."""
        number, chance = _runs(self.stopped)
        if len(self.fractions) == 1:
            return [(np.ones((1, 1)), number, chance)]
        a, b = self.fractions
        chance = chance / self.stopped
        return [(np.eye(2)[::-1], 2.0 * number - 1.0, chance), (np.diag([1.0 - b, 1.0 - a]), 2.0 * number, chance)]

    def direct(self, geometry: _Geometry, length: float) -> float:
        """The fraction of the entering particles that pass without a diffuse reflection."""
        # k passing(length/k) is the flux through an opening k times as wide; second differences of it in k pass
        if len(self.fractions) == 1:
            ((_, number, chance),) = self.terms()
            return float(chance * self.fractions[0] * number @ geometry.passing(length / number))
        (_, odd, chance), (_, even, _) = self.terms()
        a, b = self.fractions
        one = odd * geometry.passing(length / odd)
        both = even * geometry.passing(length / even)
        return float(chance @ (a * b * one + 0.5 * (a * a * (1.0 - b) + b * b * (1.0 - a)) * both))

    def after(self, wall: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Numbers of flights from a reflection at these walls to the next diffuse one, and its wall."""
        rounds = rng.geometric(self.stopped, wall.shape).astype(np.float64)
        if len(self.fractions) == 1:
            return rounds, wall
        odd = rng.random(wall.shape) * self.stopped < np.where(wall > 0, *self.fractions)
        return np.asarray(2.0 * rounds - odd), np.where(odd, 1.0 - wall, wall)

    def entering(self, number: int, rng: np.random.Generator, *, times: bool) -> tuple[Floats, Floats]:
        """Numbers k of flights to the first diffuse reflection, and its wall; with ``times`` k times as often.

        The place of this reflection is k times that of a first collision. Of two walls fewer numbers are returned.
        """
        rounds = rng.geometric(self.stopped, number).astype(np.float64)
        if times:
            rounds += rng.geometric(self.stopped, number) - 1.0
        if len(self.fractions) == 1:
            return rounds, np.zeros(number)
        a, b = self.fractions
        chance = np.array([a * b, a * b, a * a * (1.0 - b), b * b * (1.0 - a)])
        kind = rng.choice(4, number, p=chance / chance.sum())
        flights = 2.0 * rounds - (kind < 2)
        taken = rng.random(number) * 2.0 * rounds < flights if times else np.ones(number, dtype=bool)
        return np.asarray(flights[taken]), (kind[taken] % 2).astype(np.float64)


def _diffuse_flights(geometry: _Geometry, runs: _Runs, length: float) -> _Flights:
    """Flights from one diffuse reflection to the next."""
    terms = runs.terms()

    def averaged(function: Function, z: Floats, number: Floats, factor: Floats) -> Floats:
        return np.asarray(sum(one * function(z / k) for k, one in zip(number, factor, strict=True)))

    def density(number: Floats, chance: Floats) -> Function:
        kernel = partial(averaged, geometry.kernel, number=number, factor=chance / number)
        if number.size == 1:
            return lambda z: kernel(np.abs(z))[..., None]
        from scipy.interpolate import make_interp_spline

        # analytic in log(z) for large z: a spline of degree 7 is right to rounding
        grid = np.linspace(0.0, math.asinh(length / geometry.width), KNOTS * (1 + math.ceil(math.asinh(length))))
        spline = make_interp_spline(grid, kernel(geometry.width * np.sinh(grid)), k=7)
        return lambda z: spline(np.arcsinh(np.abs(z) / geometry.width))[..., None]

    def beyond(z: Floats) -> Floats:
        # from each wall to the others, the factors of their reflections included
        parts = (
            averaged(geometry.beyond, z, number, chance)[..., None] * (matrix @ runs.reflection).sum(axis=1)
            for matrix, number, chance in terms
        )
        return np.asarray(sum(parts))

    return _Flights(
        tuple((matrix, density(number, chance)) for matrix, number, chance in terms),
        lambda z: np.ones((*z.shape, 1)), beyond, np.ones(1),
        2.0 * runs.fractions[0] if len(runs.fractions) == 1 else 1.0, runs.direct(geometry, length), geometry.width,
        geometry.width,
    )  # fmt: skip


def _planar_flights(size: int, length: float, walls: int = 1) -> _Flights:
    """Flights across the channel between reflections of any law, in polynomials of the cosine of the angle."""
    basis, signs = Legendre(size), np.asarray((-1.0) ** np.arange(size), dtype=np.float64)
    unit, weight = np.polynomial.legendre.leggauss(size // 2 + 1)

    def leaving(z: Floats) -> Floats:
        return basis.evaluate(np.arctan2(1.0, z))

    def beyond(z: Floats) -> Floats:
        # half of the integral over the cosine, from z/sqrt(1 + z^2) to 1
        part = GEOMETRIES["channel"].beyond(z)[..., None]
        inner = basis.evaluate(np.arccos(1.0 - part * (1.0 + unit)))
        return np.tile(np.einsum("...qi,q->...i", inner, 0.5 * weight) * part, walls)

    def arriving(z: Floats) -> Floats:
        return leaving(z) * (signs * GEOMETRIES["channel"].kernel(z)[..., None])

    direct = float(GEOMETRIES["channel"].passing(np.array(length)))
    # each flight leads to the other wall
    across = ((np.eye(walls)[::-1], arriving),)
    return _Flights(across, leaving, beyond, signs, 2.0 / walls, direct, 1.0, min(FULL_PANELS / size, 1.0))


def _panels(length: float, width: float) -> Floats:
    """Edges of panels whose lengths double from both ends to the middle, since the solution is the smoother there."""
    half = 0.5 * length / width
    count = max(math.ceil(math.log2(half + 1.0)), 1)
    left = 0.5 * length * (2.0 ** np.arange(count + 1) - 1.0) / (2.0**count - 1.0)
    return np.concatenate((left, length - left[-2::-1]))


def _solved(flights: _Flights, matrix: Floats, length: float, nodes: int) -> tuple[float, Floats]:
    """The transmission with so many Gauss nodes on each panel, and its derivative by the matrix of reflection."""
    edges = _panels(length, flights.resolved)
    unit, weight = np.polynomial.legendre.leggauss(nodes)
    half = 0.5 * np.diff(edges)
    place = (edges[:-1] + half)[:, None] + half[:, None] * unit
    weight = (half[:, None] * weight).ravel()
    signs, walls = flights.signs, len(flights.arriving[0][0])
    flown: Floats = np.zeros(())
    for between, function in flights.arriving:
        rows = np.stack([_row(flights, function, edges, unit, x, nodes) for x in place[: len(half) // 2].ravel()])
        # the second half of the channel is the mirror image
        turned = (signs[:, None, None] * signs * rows)[::-1, :, ::-1]
        flown = flown + np.einsum("vw,xiyj->xviywj", between, np.concatenate((rows, turned)))
    signs = np.tile(signs, walls)
    flown = flown.reshape(place.size * signs.size, -1)
    place = place.ravel()

    first = flights.entering * signs * flights.beyond(place)
    sent = _reflected(matrix, first, flown)
    through = np.sum(weight[:, None] * flights.beyond(length - place) * sent.reshape(first.shape))
    arriving = first + (flown @ sent).reshape(first.shape)
    # the chances of particles that a wall sends, from the transposed equation: that of the flights is itself
    last = flights.beyond(length - place)
    chances = last + (flown @ _reflected(matrix.T, last, flown)).reshape(first.shape)
    return flights.direct + float(through), np.einsum("x,xi,xj->ij", weight, chances, arriving)


def _reflected(matrix: Floats, first: Floats, flown: Floats) -> Floats:
    """Particles that all places send, which the matrix gives of the first and of those flown there from all places."""
    equation = np.eye(len(flown)) - (matrix @ flown.reshape(*first.shape, -1)).reshape(flown.shape)
    return np.asarray(np.linalg.solve(equation, (first @ matrix.T).ravel()))


def _row(flights: _Flights, arriving: Function, edges: Floats, unit: Floats, x: float, nodes: int) -> Floats:
    """Moments of particles arriving at x from the Lagrange polynomials of all nodes, shape (N, nodes in all, N)."""
    size, length = flights.signs.size, edges[-1]
    # intervals that double from x on, in both directions
    steps = 0.5 * flights.width * (2.0 ** np.arange(math.log2(2.0 * length / flights.width + 1.0) + 1.0) - 1.0)
    cuts = np.unique(np.clip(np.concatenate((x - edges, steps, -steps)), x - length, x))
    inner, weight = np.polynomial.legendre.leggauss(NODES[1] + 4 + size // 4)
    half, middle = 0.5 * np.diff(cuts)[:, None], 0.5 * (cuts[1:] + cuts[:-1])[:, None]
    # displacements from the places y = x - z; y alone is not accurate enough in long channels
    z, panel = middle + half * inner, np.searchsorted(edges[1:-1], x - middle.ravel())
    local = 2.0 * (x - z - edges[panel, None]) / np.diff(edges)[panel, None] - 1.0
    vandermonde = np.polynomial.legendre.legvander
    lagrange = vandermonde(local, nodes - 1) @ np.linalg.inv(vandermonde(unit, nodes - 1))
    leaving = (lagrange[..., None] * flights.leaving(z)[:, :, None, :]).reshape(*z.shape, -1)
    part = np.swapaxes(arriving(z) * (half * weight)[..., None], 1, 2) @ leaving
    row = np.zeros((len(edges) - 1, size, nodes * size))
    np.add.at(row, panel, part)
    return row.reshape(-1, size, nodes, size).swapaxes(0, 1).reshape(size, -1, size)


# ---- flights -------------------------------------------------------------------------------------------------------
def _by_flights(
    section: Section,
    length: float,
    tolerance: float,
    runs: _Runs,
    enter: Callable[[int, float], tuple[Floats, Floats, Floats]],
    reflect: Reflections,
    *,
    least: float = math.inf,
) -> Estimate:
    """The fraction without a diffuse reflection, exactly, and of the others the fraction that passes, by rays.

    Flights end early if by their spread they would not come below the error ``least`` at the limit of their work.
    """
    direct, diffuse = runs.direct(GEOMETRIES[section], length), max(runs.fractions)
    # a particle has diffuse * length reflections on average: some are enough that all leave within the limit
    together = int(min(max(MOST_REFLECTIONS / (BATCHES * (1.0 + diffuse * length)), LEAST_TOGETHER), TOGETHER))
    through = particles = unresolved = work = 0
    value, error = math.nan, math.inf
    while error > tolerance and work < MOST_REFLECTIONS:
        entered = enter(together, length)
        particles += entered[0].size
        passed, left, done = _flown(length, *entered, reflect)
        through, unresolved, work = through + passed, unresolved + left, work + done + together
        count = max(particles, 1)
        fraction, half = through / count, 0.5 * unresolved / count
        spread = NORMAL_95 * math.sqrt(fraction * (1.0 - fraction) / count)
        # of particles that are still inside, none or all may leave at the far end
        value = direct + (1.0 - direct) * (fraction + half)
        error = (1.0 - direct) * (max(spread, RULE_OF_THREE / count) + half)
        if error * math.sqrt(work / MOST_REFLECTIONS) > least:
            break
    method = f"flights of {particles} particles" + f", {unresolved} of them still inside" * (unresolved > 0)
    return Estimate(value, error, "estimate", method)


def _flown(length: float, x: Floats, direction: Floats, wall: Floats, reflect: Reflections) -> tuple[int, int, int]:
    """Of particles that meet a wall the numbers that leave at the far end and that stay inside, and the work done.

    The work is the number of reflections, those of few particles at a time counted as `LEAST_TOGETHER`.
    """
    through = work = 0
    while x.size and work < MOST_REFLECTIONS:
        work += max(x.size, LEAST_TOGETHER)
        shift, direction, wall = reflect(direction, wall)
        x = x + shift
        through += int(np.count_nonzero(x >= length))
        inside = (x > 0.0) & (x < length)
        x, direction, wall = x[inside], direction[inside], wall[inside]
    return through, x.size, work


def _entered_in_plane(
    number: int, length: float, runs: _Runs, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Where particles are first reflected diffusely, of those that are, their angles to the wall, and the walls."""

    def stopped(distance: Floats) -> Floats:
        """The fraction that meets a wall within the distance."""
        return np.asarray(2.0 * distance / (1.0 + distance + np.sqrt(1.0 + distance**2)))

    # particles with k flights are k stopped(length/k) times as many as `entering` draws without the factor k; k is
    # drawn with the factor or without it, whichever leaves less to reject
    each = float(stopped(np.array(length)))
    times = runs.stopped * length >= each
    flights, wall = runs.entering(number, rng, times=times)
    chance = stopped(length / flights) / each if times else flights * stopped(length / flights) / length
    taken = rng.random(flights.size) < chance
    flights, wall = flights[taken], wall[taken]
    # the fraction that is stopped before x is uniform between 0 and its value at the end
    fraction = stopped(length / flights) * rng.random(flights.size)
    x = 0.5 * fraction * (2.0 - fraction) / (1.0 - fraction)
    # at x the cosine of the angle is uniform above that of the ray from the opposite corner
    return flights * x, 2.0 * np.arcsin(np.sqrt(rng.random(x.size) * GEOMETRIES["channel"].beyond(x))), wall


def _turn(
    laws: Sequence[Law], runs: _Runs, rng: np.random.Generator, angle: Floats, wall: Floats
) -> tuple[Floats, Floats, Floats]:
    outgoing = reflected(laws, np.pi - angle, wall, rng)
    flights, after = runs.after(wall, rng)
    return flights / np.tan(outgoing), outgoing, after


# Directions in space have components along the axis, across it in the wall, and along the normal into the interior.
def _entered_in_channel(
    number: int, length: float, runs: _Runs, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Where particles are first reflected diffusely, their directions, and the walls; of the others none."""
    along, across, normal, flights, wall = _entering(number, runs, rng)
    x = flights * along * rng.random(flights.size) / np.abs(normal)
    inside = x < length
    return x[inside], np.stack((along, across, -np.abs(normal)), axis=1)[inside], wall[inside]


def _entered_in_tube(
    number: int, length: float, runs: _Runs, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    along, y, z, flights, wall = _entering(number, runs, rng)
    # from the point (radius, 0) of the opening along (y, z) to the point (1 in length) of the wall
    radius, square = np.sqrt(rng.random(number)), y * y + z * z
    time = (np.sqrt(square * (1.0 - radius) * (1.0 + radius) + (radius * y) ** 2) - radius * y) / square
    x, at_y, at_z = flights * along * time, radius + time * y, time * z
    direction = np.stack((along, at_y * z - at_z * y, -(at_y * y + at_z * z)), axis=1)
    return x[x < length], direction[x < length], wall[x < length]


def _entering(number: int, runs: _Runs, rng: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Directions of the cosine law about the axis, the component along it and two others; numbers of flights; walls.

    The place of the first diffuse reflection is k times that of the first collision: of flights of equal length s both
    are uniform between multiples of s.
    """
    flights, wall = runs.entering(number, rng, times=True)
    square, turn = rng.random(flights.size), 2.0 * np.pi * rng.random(flights.size)
    return np.sqrt(1.0 - square), np.sqrt(square) * np.cos(turn), np.sqrt(square) * np.sin(turn), flights, wall


ENTRIES = {"channel": _entered_in_channel, "tube": _entered_in_tube}


def _leave(
    laws: Sequence[DirectionLaw], section: Section, runs: _Runs, rng: np.random.Generator, arriving: Floats,
    wall: Floats,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Displacements along the axis after a reflection, the directions in the frame of the next place, its wall."""
    outgoing = sampled(laws, arriving, wall, rng)
    along, across, normal = outgoing.T
    # the chord of a circle meets it at both ends with the same components, but for the sign of the normal one
    time = 1.0 / normal if section == "channel" else 2.0 * normal / (across**2 + normal**2)
    flights, after = runs.after(wall, rng)
    return flights * along * time, outgoing * [1.0, 1.0, -1.0], after
