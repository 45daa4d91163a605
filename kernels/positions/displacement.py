"""The law of the displacement x' - x between entry and exit of rays, with its tail: for open walls and islands."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...core.checks import Floats, Rng, frozen, generator, instance, number_between, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, fraction_estimate
from ...geometry import Wall
from ..bases.measure import SINE

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
