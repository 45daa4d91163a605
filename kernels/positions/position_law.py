"""Laws P~(x, theta, d theta') that depend on the position, and the law of the displacement x' - x of rays."""

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
from ...core.estimates import NORMAL_95, Estimate, Summary, fraction_estimate
from ...geometry import Wall
from ..bases.given import Vectorised, seed_by_name
from ..bases.measure import SINE
from ..laws.law import Combination, Law, check_paper_frame

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
        object.__setattr__(self, "edges", frozen(edges))
        object.__setattr__(self, "laws", laws)

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
        where, outgoing = self.interval(at), np.empty(at.shape)
        for k, law in enumerate(self.laws):
            here = where == k
            if here.any():
                outgoing[here] = law.sample(incoming[here], source)
        return outgoing

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
    from ...geometry import trace

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
