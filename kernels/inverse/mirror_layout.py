"""Distances of mirrors from a focus at which no beam between two mirrors of a pair meets a mirror of another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...core.checks import Floats
from ..bases.measure import SINE
from .aplanats import Interval, MirrorPair

# Rays and points of a mirror that are compared, and how far a beam stays from other mirrors, relative to their
# distance from the focus. The thickness of mirrors is relative to that distance too.
SAMPLES, CLEARANCE, THICKNESS = 33, 0.05, 0.02
# Orders in which the mirrors are arranged, the first by the angle between those of a pair.
ORDERS = 400
# A beam that leaves its own mirror at grazing angles comes as near to it as rounding.
TOUCHING = 1e-9
# Halvings of a pair of intervals whose mirrors cannot stand side by side.
MOST_HALVINGS = 6


@dataclass(frozen=True, eq=False)
class MirrorGroup:
    """Mirrors whose distances from the focus are chosen together: the two of a pair, or an arc about the focus.

    Parameters
    ----------
    intervals : tuple of one or two pairs of float
        The angles that the mirrors occupy.
    pair : MirrorPair or None
        None for an arc, which has the distance 1.
    """

    intervals: tuple[Interval, ...]
    pair: MirrorPair | None

    @cached_property
    def points(self) -> tuple[tuple[Floats, Floats], ...]:
        """Angles, ascending, and distances of points of each mirror; the ends are among them."""
        if self.pair is None:
            angles = np.linspace(*self.intervals[0], SAMPLES)
            return ((angles, np.ones(SAMPLES)),)
        t = np.linspace(*self.pair.ends, SAMPLES)
        return tuple((self.pair.angles(t)[which], self.pair.distance(which, t)) for which in (0, 1))

    @property
    def reach(self) -> float:
        """The largest distance of a point."""
        return float(max(distance.max() for _, distance in self.points))

    @property
    def opens(self) -> float:
        """The largest angle between two points that a ray joins."""
        return float(np.max(self.points[-1][0] - self.points[0][0]))

    def chords(self, angles: Floats) -> Floats:
        """1/distance at which the rays from mirror to mirror pass the given angles, shape (rays, angles)."""
        (theta, near), (image, far) = self.points
        first = np.sin(image[:, None] - angles) / near[:, None]
        second = np.sin(angles - theta[:, None]) / far[:, None]
        return np.asarray((first + second) / np.sin(image - theta)[:, None])

    @property
    def shades_itself(self) -> bool:
        """Whether a ray from one mirror to the other meets one of them on its way."""
        if self.pair is None:
            return False
        theta, image = self.points[0][0], self.points[1][0]
        for angles, distance in self.points:
            between = (angles > theta[:, None]) & (angles < image[:, None])
            if np.any(between & (self.chords(angles) * distance < 1.0 - TOUCHING)):
                return True
        return False


def mirror_groups(
    intervals: Floats, partner: Sequence[int], least_angle: float, least_flux: float
) -> list[MirrorGroup]:
    """Mirrors for the exchange of the intervals between given angles; halves of those that stand in their own light.

    Parameters
    ----------
    intervals : ndarray, shape (n + 1,)
        Angles from 0 to pi.
    partner : sequence of int, shape (n,)
        With which interval each changes places.
    least_angle : float
        No mirror stands within this angle of 0 and pi.
    least_flux : float
        Intervals with a smaller fraction of the flux get no mirror.
    """
    found: list[MirrorGroup] = []
    every = [(float(a), float(b)) for a, b in pairwise(intervals)]
    for number, other in enumerate(partner):
        low, high = every[number]
        if other < number or SINE.mass(low, high) < least_flux:
            continue
        if other > number:
            found += _pairs(every[number], every[other], least_angle, MOST_HALVINGS)
            continue
        low, high = max(low, least_angle), min(high, np.pi - least_angle)
        if low < high:
            found.append(MirrorGroup(((low, high),), None))
    return found


def _pairs(first: Interval, second: Interval, least_angle: float, halvings: int) -> list[MirrorGroup]:
    pair = MirrorPair(first, second, least_angle=least_angle)
    if pair.ends[0] >= pair.ends[1]:
        return []
    group = MirrorGroup((first, second), pair)
    if halvings == 0 or (first[1] < second[0] and not group.shades_itself):
        return [group]
    theta, image = (float(angle) for angle in pair.angles(0.5))
    below = _pairs((first[0], theta), (second[0], image), least_angle, halvings - 1)
    return below + _pairs((theta, first[1]), (image, second[1]), least_angle, halvings - 1)


def arranged(groups: Sequence[MirrorGroup]) -> Floats:
    """Factors for the distances of the groups, the least 1, with the largest distance as small as was found.

    Only ratios of the factors matter for a beam and a mirror, and a beam passes a mirror before or behind it: the
    logarithms of the ratios avoid some intervals. In a given order each group takes the smallest factor that is left;
    the best of many orders is returned.
    """
    count = len(groups)
    avoided = [[_avoided(groups[p], groups[q]) for q in range(count)] for p in range(count)]
    reach = np.log([group.reach for group in groups])
    rng = np.random.default_rng(0)
    orders = [np.argsort([-group.opens for group in groups], kind="stable")]
    orders += [rng.permutation(count) for _ in range(ORDERS if count > 1 else 0)]
    best, smallest = np.zeros(count), np.inf
    for order in orders:
        logarithms = np.full(count, np.nan)
        for p in order:
            forbidden = [
                (logarithms[q] + low, logarithms[q] + high)
                for q in range(count)
                if not np.isnan(logarithms[q])
                for low, high in avoided[q][p]
            ]
            # from below: the end of each interval that holds the value is the next one to be tried
            value = 0.0
            for low, high in sorted(forbidden):
                if low < value < high or (low < value + TOUCHING < high):
                    value = high
            logarithms[p] = value
        logarithms -= logarithms.min()
        if (largest := float(np.max(logarithms + reach))) < smallest:
            best, smallest = logarithms, largest
    return np.exp(best)


def _avoided(one: MirrorGroup, other: MirrorGroup) -> list[tuple[float, float]]:
    """Intervals of log(factor of ``other`` / factor of ``one``) at which they stand in each other's light."""
    if one is other:
        return []
    found = _shaded(one, other) + [(-high, -low) for low, high in _shaded(other, one)]
    gap = np.log((1.0 + THICKNESS) * (1.0 + CLEARANCE))
    for interval, (_, near) in zip(one.intervals, one.points, strict=True):
        for neighbour, (_, far) in zip(other.intervals, other.points, strict=True):
            # mirrors at one ray from the focus, one behind the other
            if interval[1] == neighbour[0]:
                middle = float(np.log(near[-1] / far[0]))
            elif interval[0] == neighbour[1]:
                middle = float(np.log(near[0] / far[-1]))
            else:
                continue
            found.append((middle - gap, middle + gap))
    return found


def _shaded(beam: MirrorGroup, other: MirrorGroup) -> list[tuple[float, float]]:
    """Intervals of log(factor of the other / factor of the beam) at which a mirror stands in the beam."""
    if beam.pair is None:
        return []
    found = []
    for interval, (angles, distance) in zip(other.intervals, other.points, strict=True):
        if interval[0] >= beam.intervals[0][1] and interval[1] <= beam.intervals[1][0]:
            quotient = np.log(beam.chords(angles) * distance)
            room = np.log(1.0 + CLEARANCE)
            found.append((-float(quotient.max()) - np.log(1.0 + THICKNESS) - room, room - float(quotient.min())))
    return found
