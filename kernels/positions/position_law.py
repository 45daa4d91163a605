"""Laws P~(x, theta, d theta') that depend on the position, their distance, and the displacement x' - x of rays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    angles,
    broadcast,
    finite_array,
    frozen,
    generator,
    instance,
    number_between,
    positive_number,
    sequence,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, fraction_estimate, student_95
from ...core.given import Vectorised, seed_by_name
from ...geometry import Wall, trace
from ..bases.measure import SINE
from ..bases.polynomials import Legendre
from ..discretisation.discretisation import discretise
from ..distances.distances import flux_means
from ..laws.law import Combination, Law, check_paper_frame
from ..laws.sums import outcomes_of

PositionFunction = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False, repr=False)
class PositionLaw(Summary):
    r"""A law P(x, theta; dx' d theta') = delta_x(dx') P~(x, theta, d theta') whose P~ is constant on intervals of x.

    Laws of this form, each P~(x, .) symmetric for sin(theta) d theta, are exactly the limits of walls whose
    displacements x' - x tend to 0. A cell that changes with x in any measurable manner is a limit of such laws.

    Parameters
    ----------
    edges : array_like, shape (n + 1,)
        Increasing positions.
    laws : sequence of n Laws
        P~ on each interval, in the paper's convention.

    Raises
    ------
    InputError
        If the edges do not increase, the numbers do not match, or a law is in the specular frame.

    Source: Rudzis 2022, section 1.2.5 and Theorem 1.7.

    Examples
    --------
    A wall that is smooth on the left and a retroreflector on the right:

    >>> from asperity import kernels as ker
    >>> law = ker.PositionLaw([0.0, 1.0, 3.0], [ker.specular(), ker.retroreflection()])
    >>> law.sample([0.5, 2.0], 0.25).round(12).tolist()
    [2.89159265359, 0.25]
    >>> law.mean().terms[0]
    (0.3333333333333333, specular())
    """

    edges: Floats
    laws: tuple[Law, ...]

    def __post_init__(self) -> None:
        edges = np.atleast_1d(finite_array("edges", self.edges))
        laws = sequence("laws", self.laws, Law, "ker.lambertian()")
        if edges.ndim != 1 or len(edges) < 2 or not np.all(np.diff(edges) > 0.0):
            raise InputError(f"edges: expected at least two increasing positions, got {edges.tolist()}")
        if len(laws) != len(edges) - 1:
            raise InputError(f"laws: expected one for each of {len(edges) - 1} intervals, got {len(laws)}")
        for law in laws:
            check_paper_frame("laws", law)
        self._set(edges=frozen(edges), laws=laws)

    @property
    def weights(self) -> Floats:
        """The length of every interval divided by that of the piece."""
        return np.asarray(np.diff(self.edges) / (self.edges[-1] - self.edges[0]))

    @property
    def reversible(self) -> bool | None:
        """Whether P is symmetric with respect to dx sin(theta) d theta: every law is; None if unknown."""
        return True if all(law.reversible for law in self.laws) else None

    def at(self, x: float) -> Law:
        """P~(x, .)."""
        return self.laws[int(self.interval(finite_array("x", x)))]

    def mean(self) -> Combination:
        """The law for x uniform on the piece: the mixture of all laws by their lengths."""
        return Combination(tuple(zip(self.weights.tolist(), self.laws, strict=True)))

    @seed_by_name
    def sample(self, x: ArrayLike, theta: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing angle for every state (x, theta); the arrays broadcast. The position stays x."""
        at, incoming = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
        source = generator(rng)
        return outcomes_of(self.laws, self.interval(at), incoming, source)

    def apply(self, function: PositionFunction, x: ArrayLike, theta: ArrayLike, edges: ArrayLike = ()) -> Floats:
        """The expectation E[f(x', Theta') | x, theta] of a vectorised f(x, theta), with x' = x, as `Law.apply`."""
        at, incoming = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
        flat, value = at.ravel(), np.empty(at.size)
        where, directions = self.interval(flat), incoming.ravel()
        for position in np.unique(flat):
            here = flat == position
            law = self.laws[int(where[here][0])]
            value[here] = law.apply(Vectorised(partial(function, position), scalar=True), directions[here], edges)
        return value.reshape(at.shape)

    def interval(self, x: Floats) -> NDArray[np.intp]:
        """The index of the interval of every position; raises InputError outside of the piece."""
        x = finite_array("x", x)
        outside = (x < self.edges[0]) | (x > self.edges[-1])
        if np.any(outside):
            worst = float(np.atleast_1d(x)[np.atleast_1d(outside)][0])
            raise InputError(f"x: expected positions from {self.edges[0]:g} to {self.edges[-1]:g}, got {worst:g}")
        return np.asarray(np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.laws) - 1))


# Fewest of the largest displacements from which the exponent of the tail is estimated.
LEAST_TAIL = 20


@dataclass(frozen=True, repr=False)
class Displacements(Summary):
    """Displacements x' - x of random rays, x uniform in a period and theta with density sin(theta)/2.

    Attributes
    ----------
    values : array, shape (rays,)
        Increasing, in the wall's unit of length. A ray that does not escape is not among them.
    unresolved : float
        Fraction of the rays that did not escape.
    longest_possible : float
        The width of the widest hollow if the wall closes, which bounds every displacement; else inf.
    """

    values: Floats
    unresolved: float
    longest_possible: float

    @property
    def rays(self) -> int:
        """The number of rays that escaped."""
        return int(self.values.size)

    def exceeds(self, distance: float, scale: float = 1.0) -> Estimate:
        """The probability that abs(x' - x) exceeds a distance, for the wall scaled by ``scale``.

        That it tends to 0 with the scale for every distance is the condition under which laws of walls have the form
        delta_x (x) P~. The interval is that of Wilson, plus the fraction of unresolved rays.

        Raises
        ------
        InputError
            If the distance is negative or the scale is not greater than 0.
        """
        least = number_between("distance", distance, 0.0, math.inf, closed="low")
        factor = positive_number("scale", scale)
        found = float(np.mean(factor * np.abs(self.values) > least))
        if factor * self.longest_possible <= least:
            return Estimate(0.0, self.unresolved, "bound", "the wall closes")
        sampled = fraction_estimate(found, self.rays, f"{self.rays} random rays")
        return replace(sampled, error=sampled.error + self.unresolved)

    def tail_exponent(self) -> Estimate:
        """The exponent a of P(abs(x' - x) > d) ~ d^-a, by the estimator of Hill from the largest displacements.

        Of n rays they are n^(2/3)/4.

        Returns
        -------
        Estimate
            The error is a 95 % half width of the sampling error, plus the difference from the estimate with four times
            as many displacements, which shows how far the tail is from a power.

        Raises
        ------
        InputError
            If the wall closes, so that there is no tail, or there are too few rays.
        """
        if math.isfinite(self.longest_possible):
            raise InputError(f"tail: the wall closes; no displacement exceeds {self.longest_possible:g}")
        count = round(self.rays ** (2.0 / 3.0)) // 4
        if count < LEAST_TAIL:
            raise InputError(f"tail: expected more rays, got {self.rays}, too few for {LEAST_TAIL} long displacements")
        size = np.sort(np.abs(self.values))[::-1]
        near, far = _hill(size, 4 * count), _hill(size, count)
        error = NORMAL_95 * far / math.sqrt(count) + abs(far - near)
        return Estimate(far, error, "estimate", f"Hill's estimator from the {count} largest of {self.rays}")


def _hill(decreasing: Floats, count: int) -> float:
    """1 over the mean logarithm of the ``count`` largest values, divided by the next one."""
    return float(1.0 / np.mean(np.log(decreasing[:count] / decreasing[count])))


def displacements(wall: Wall, rays: int = 2**16, rng: Rng = None) -> Displacements:
    """Trace random rays and return their displacements x' - x along the wall.

    Parameters
    ----------
    wall : Wall
        Also one that does not close, with islands or without tops (the paper's conditions B1 to B4 without B5), on
        which displacements are unbounded.
    rays : int
        At least 100.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Displacements

    Raises
    ------
    InputError
        If an argument is not as described.

    Source: Rudzis 2022, section 1.2.2 (eq. 1.4) and the remarks on condition B5.

    Examples
    --------
    A floor at depth 1 displaces a ray by 2 cot(theta), so P(abs(x' - x) > d) = 1 - d/sqrt(4 + d^2), with tail
    exponent 2:

    >>> from asperity import geometry as geo, kernels as ker
    >>> floor = geo.Wall.from_vertices([(0, -1), (1, -1)])
    >>> found = ker.displacements(floor, 40_000, rng=1).exceeds(2.0)
    >>> abs(float(found) - (1 - 0.5**0.5)) < found.error < 0.005
    True

    Displacements of a wall that closes are at most as wide as its hollows:

    >>> float(ker.displacements(geo.triangular_teeth(0.7), 100, rng=0).exceeds(1.0))
    0.0
    """

    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
    number = whole_number("rays", rays, 100)
    source = generator(rng)
    x = wall.period * source.random(number)
    ray = trace(wall, x, SINE.sample(number, source))
    moved = (ray.x - x)[ray.escaped]
    if not moved.size:
        raise InputError("wall: no ray escaped from it")
    widest = max((hollow.width for hollow in wall.cell.hollows), default=0.0)
    # a flat level below y = 0 displaces rays on their way there and back
    closed = wall.closes and wall.origin[1] == 0.0
    lost = 1.0 - moved.size / number
    return Displacements(frozen(np.sort(moved)), lost, widest if closed else math.inf)


# Means of products of four cosines of orders up to this one at most are compared; the rest is less than 1.3e-4.
MOST_ORDERS = 17
# Independent sequences of rays.
REPETITIONS = 8


def position_distance(
    first: PositionLaw | Wall, second: PositionLaw | Wall, tolerance: float = 1e-2, *, rays: int = 2**12, rng: Rng = 0
) -> Estimate:
    r"""The pseudometric of laws of states (x, theta) -> (x', theta'), with test functions of all four variables.

    Parameters
    ----------
    first, second : PositionLaw or Wall
        On pieces of the same length. A wall stands for its deterministic law of rays that enter at x in (0, period),
        such as `geometry.join_walls`; for a PositionLaw x' = x.
    tolerance : float
        Wanted size of the omitted rest of the sum, at least 1e-3.
    rays : int
        Rays of one repetition for a wall, rounded up to a power of two; there are 8 repetitions.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Estimate
        Zero if and only if the laws are equal for almost every state. The value is a mean of absolute values: below its
        error it is sampling noise. The error is the sum of those of the means and of the rest.

    Raises
    ------
    InputError
        If the pieces have different lengths, or a number is out of range.

    Notes
    -----
    The sum over j, k, l, m >= 0 of 2^(-j - k - l - m - 4) times the absolute difference of the means of
    cos(j pi s) cos(k theta) cos(l theta') cos(m pi s'), with s = x/length, under dx sin(theta)/2 d theta. Displacements
    beyond the piece are reflected by the cosine. The products span a dense subspace of the continuous functions, so the
    distance tends to 0 exactly if the laws converge weakly: Theorem 1.7 of the paper measured.

    Source: Rudzis 2022, remarks 1.4 to 1.6, section 6.2.3 (corrected: f(y, x) G(y, dx) nu(dy)).

    Examples
    --------
    Exchanging both halves of a wall does not alter the mean law, only the law of states:

    >>> from asperity import kernels as ker
    >>> halves = ker.PositionLaw([0, 1, 2], [ker.specular(), ker.retroreflection()])
    >>> other = ker.PositionLaw([0, 1, 2], [ker.retroreflection(), ker.specular()])
    >>> round(float(ker.distance(halves.mean(), other.mean(), kind="pseudometric")), 9)
    0.0
    >>> float(ker.position_distance(halves, other)) > 0.01
    True
    """
    # cosines of each variable for which the rest is below the tolerance
    orders = min(max(math.ceil(math.log2(8.0 / positive_number("tolerance", tolerance))), 2), MOST_ORDERS)
    power = math.ceil(math.log2(whole_number("rays", rays, 1)))
    source = generator(rng)
    spans = [_span(one) for one in (first, second)]
    if abs(spans[0] - spans[1]) > 1e-9 * max(spans):
        raise InputError(f"second: expected a piece of length {spans[0]:g}, got one of {spans[1]:g}")
    tables, errors = zip(*(_means(one, orders, power, source) for one in (first, second)), strict=True)
    weight = 0.5 ** (np.arange(orders) + 1.0)
    joint = np.multiply.outer(np.multiply.outer(weight, weight), np.multiply.outer(weight, weight))
    value = float(np.sum(joint * np.abs(tables[0] - tables[1])))
    rest = 2.0 * (1.0 - (1.0 - 0.5**orders) ** 4)
    noise = float(np.sum(joint * (errors[0] + errors[1])))
    return Estimate(value, noise + rest, "estimate", f"cosines of order below {orders} in x, theta, theta', x'")


def _span(one: PositionLaw | Wall) -> float:
    if isinstance(one, PositionLaw):
        return float(one.edges[-1] - one.edges[0])
    if isinstance(one, Wall):
        return one.period
    raise InputError(f"first, second: expected a PositionLaw or a Wall, got {one!r}")


def _means(one: PositionLaw | Wall, orders: int, power: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Means of the products, shape (orders,) * 4 in the order s, theta, theta', s', and their errors."""
    if isinstance(one, PositionLaw):
        return _means_of_law(one, orders)
    found, unresolved = zip(*(_means_of_rays(one, orders, power, rng) for _ in range(REPETITIONS)), strict=True)
    runs = np.stack(found)
    error = student_95(REPETITIONS) * runs.std(axis=0, ddof=1) / math.sqrt(REPETITIONS)
    return runs.mean(axis=0), error + 2.0 * float(np.mean(unresolved))


def _means_of_law(law: PositionLaw, orders: int) -> tuple[Floats, Floats]:
    ends = (law.edges - law.edges[0]) / (law.edges[-1] - law.edges[0])
    in_space = _cosine_integrals(ends, orders)
    tables: dict[int, tuple[Floats, float]] = {}
    total, error = np.zeros((orders,) * 4), np.zeros((orders,) * 4)
    for k, part in enumerate(law.laws):
        if id(part) not in tables:
            matrix = discretise(part, Legendre(orders), tolerance=1e-6)
            tables[id(part)] = flux_means(matrix, orders - 1), float(matrix.error)
        means, uncertainty = tables[id(part)]
        total += np.einsum("jm,kl->jklm", in_space[k], means)
        error += np.abs(in_space[k])[:, None, None, :] * uncertainty
    return total, error


def _cosine_integrals(ends: Floats, orders: int) -> Floats:
    """The integrals of cos(j pi s) cos(m pi s) over every interval, shape (intervals, orders, orders)."""
    numbers = np.arange(orders)
    found = np.zeros((len(ends) - 1, orders, orders))
    for frequency in (numbers[:, None] + numbers, numbers[:, None] - numbers):
        # the integral of cos(f pi s) from 0 to s is s sinc(f s)
        up_to = ends[:, None, None] * np.sinc(frequency * ends[:, None, None])
        found += 0.5 * np.diff(up_to, axis=0)
    return found


def _means_of_rays(wall: Wall, orders: int, power: int, rng: np.random.Generator) -> tuple[Floats, float]:
    """The means over one scrambled Sobol sequence, and the fraction of rays that did not escape."""
    from scipy.stats.qmc import Sobol

    uniform = np.clip(Sobol(2, rng=rng).random_base2(power), 2.0**-54, 1.0 - 2.0**-53)
    s, theta = uniform[:, 0], SINE.quantile(uniform[:, 1])
    ray = trace(wall, s * wall.period, theta)
    # a ray that does not escape counts as retroreflected where it entered, as in `WallLaw`
    outgoing = np.where(ray.escaped, ray.theta, theta)
    after = np.where(ray.escaped, ray.x / wall.period, s)
    before = _cosines(np.pi * s, orders)[:, None, :] * _cosines(theta, orders)[None, :, :]
    behind = _cosines(outgoing, orders)[:, None, :] * _cosines(np.pi * after, orders)[None, :, :]
    size = len(s)
    table = before.reshape(-1, size) @ behind.reshape(-1, size).T / size
    return np.asarray(table.reshape((orders,) * 4)), 1.0 - float(ray.escaped.mean())


def _cosines(angle: Floats, orders: int) -> Floats:
    return np.asarray(np.cos(np.arange(orders)[:, None] * angle))
