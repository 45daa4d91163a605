"""Pairs of mirrors that exchange intervals of angles, at distances from their focus at which none shades another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from ...core.rounding import EPS
from ...geometry import Bezier
from ..bases.measure import SINE

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


# Degrees of the Chebyshev series of the one integral: doubled until the last coefficients are rounding.
FIRST_DEGREE, LAST_DEGREE = 32, 2048
SERIES_TOLERANCE = 64.0 * EPS
# Steps for the two tangent lengths of a Bezier piece, and relative difference for their slopes. A piece that needs more
# is halved.
NEWTON_STEPS, NUDGE = 5, 1e-4
# First tangent lengths over the chord, at least and at most.
LENGTHS = 1e-3, 2.0 / 3.0
# Parameters at which a Bezier piece is compared with its curve, and halvings of the parameter at most.
COMPARED = np.array([0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98])
MOST_BISECTIONS = 10
Interval = tuple[float, float]


class CurvePoints(NamedTuple):
    """Points of a curve and its unit tangents there, both of shape (n, 2)."""

    position: Floats
    tangent: Floats


@dataclass(frozen=True, eq=False)
class MirrorPair:
    r"""Two mirrors by which every ray from the focus at theta returns to it at theta', cos theta' = cos theta + c.

    A ray at theta comes to the focus with velocity -(cos theta, sin theta) and leaves it with (cos theta', sin theta').

    Parameters
    ----------
    first, second : (float, float)
        Disjoint intervals of angles of equal flux, the first below the second, radians.
    ratio : float
        Distance of the first mirror over that of the second, in the middle of the intervals.
    least_angle : float
        Rays within this angle of 0 and pi have no mirror.

    Notes
    -----
    With theta' - theta = delta, distances r and r' of the mirrors from the focus and the constant length L of all
    paths, 2 r/L = g/(1 + g) and 2 r'/L = g'/(1 + g') where

        g g' sin(delta/2)^2 = 1,        d log g = cot(delta/2) d theta.

    Every solution reflects the given rays exactly. The prescribed map keeps sin(theta) d theta, which is Abbe's sine
    condition for the magnification -1: points beside the focus are imaged on points beside it to the first order too.
    Lengths are in units of the least distance of the mirrors from the focus. Source: derived here, after K.
    Schwarzschild's aplanatic mirrors (1905).

    Examples
    --------
    >>> pair = MirrorPair((0.5, 0.9), (1.5, float(np.arccos(np.cos(1.5) + np.cos(0.9) - np.cos(0.5)))))
    >>> there, back = pair.curve(0, [0.2, 0.7]).position, pair.curve(1, [0.2, 0.7]).position
    >>> lengths = np.linalg.norm(there, axis=1) + np.linalg.norm(there - back, axis=1) + np.linalg.norm(back, axis=1)
    >>> bool(abs(lengths[0] - lengths[1]) < 1e-14)
    True
    """

    first: Interval
    second: Interval
    ratio: float = 1.0
    least_angle: float = 0.0

    @cached_property
    def ends(self) -> Interval:
        """The parameters t at which the mirrors end; 0 and 1 unless an interval ends near 0 or pi."""
        low = max(self.parameter(which, self.least_angle) for which in (0, 1))
        high = min(self.parameter(which, np.pi - self.least_angle) for which in (0, 1))
        return float(low), float(high)

    @property
    def _rise(self) -> float:
        """cos theta' - cos theta', from end to end of an interval: twice its fraction of the flux."""
        return float(np.cos(self.first[0]) - np.cos(self.first[1]))

    def angles(self, t: ArrayLike) -> tuple[Floats, Floats]:
        """theta and theta' at t: a fraction sin(pi t/2)^2 of the flux of either interval lies below them."""
        turn = 0.5 * np.pi * np.asarray(t, dtype=np.float64)
        below, above = np.sin(turn) ** 2, np.cos(turn) ** 2
        found = [_between(*interval, below, above, self._rise) for interval in (self.first, self.second)]
        return found[0], found[1]

    def parameter(self, which: int, angle: ArrayLike) -> Floats:
        """The t at which theta (``which`` 0) or theta' (1) is a given angle; 0 and 1 beyond the interval."""
        low, high = (self.first, self.second)[which]
        given = np.asarray(angle, dtype=np.float64)
        # differences of cosines as products keep all digits
        below = np.sin(0.5 * (low + given)) * np.sin(np.maximum(0.5 * (given - low), 0.0))
        above = np.sin(0.5 * (high + given)) * np.sin(np.maximum(0.5 * (high - given), 0.0))
        return np.asarray(np.arctan2(np.sqrt(below), np.sqrt(above)) / (0.5 * np.pi))

    @cached_property
    def _series(self) -> Floats:
        """Chebyshev series over ``ends`` of the integral of cot(delta/2) d theta."""
        from numpy.polynomial import chebyshev

        low, high = self.ends

        def rate(z: Any) -> Any:
            t = low + 0.5 * (high - low) * (z + 1.0)
            theta, image = self.angles(t)
            return 0.5 * np.pi * self._rise * np.sin(np.pi * t) / (np.sin(theta) * np.tan(0.5 * (image - theta)))

        degree = FIRST_DEGREE
        while True:
            series: Floats = np.asarray(chebyshev.chebinterpolate(rate, degree), dtype=np.float64)
            if np.abs(series[-4:]).max() <= SERIES_TOLERANCE * np.abs(series).max() or degree >= LAST_DEGREE:
                break
            degree *= 2
        return np.asarray(chebyshev.chebint(0.5 * (high - low) * series, lbnd=0.0), dtype=np.float64)

    @cached_property
    def _factor(self) -> float:
        """g in the middle: the positive root of (g sin(delta/2))^2 + (1 - ratio) g = ratio."""
        theta, image = self.angles(0.5 * sum(self.ends))
        square, slope = float(np.sin(0.5 * (image - theta)) ** 2), 1.0 - self.ratio
        return float((-slope + np.sqrt(slope * slope + 4.0 * square * self.ratio)) / (2.0 * square))

    @cached_property
    def _half_length(self) -> float:
        """Half the length of the paths."""
        low, high = self.ends
        return 1.0 / min(float(self._polar(which, t)[1]) for which in (0, 1) for t in (low, high))

    def _polar(self, which: int, t: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Angle, distance over half the length of the path, and d log(distance)/d angle."""
        from numpy.polynomial import chebyshev

        t = np.asarray(t, dtype=np.float64)
        low, high = self.ends
        theta, image = self.angles(t)
        half = 0.5 * (image - theta)
        g = self._factor * np.exp(chebyshev.chebval((2.0 * t - low - high) / (high - low), self._series))
        if which == 0:
            return theta, g / (1.0 + g), 1.0 / (np.tan(half) * (1.0 + g))
        g = 1.0 / (g * np.sin(half) ** 2)
        return image, g / (1.0 + g), -1.0 / (np.tan(half) * (1.0 + g))

    def distance(self, which: int, t: ArrayLike) -> Floats:
        """Distance of the first (0) or second (1) mirror from the focus."""
        return self._half_length * self._polar(which, t)[1]

    def curve(self, which: int, t: ArrayLike) -> CurvePoints:
        """Points of the first (0) or second (1) mirror, the focus in the origin, the wall above."""
        angle, distance, slope = self._polar(which, np.atleast_1d(t))
        outwards = -np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        onwards = np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
        tangent = (onwards + slope[:, None] * outwards) / np.sqrt(1.0 + slope * slope)[:, None]
        return CurvePoints(self._half_length * distance[:, None] * outwards, tangent)

    def pieces(self, which: int, tolerance: float) -> list[Bezier]:
        """The first or second mirror by Bezier pieces whose tangents are within ``tolerance``, radians, of its own.

        Those at the parameters that are compared; between them 1.3 times as much was measured. A tolerance of 1e-8 or
        less is not met beside ends within 1e-5 of grazing, where points are as near to each other as their rounding.
        """

        def onto(position: Floats) -> CurvePoints:
            return self.curve(which, self.parameter(which, np.arctan2(-position[:, 1], -position[:, 0])))

        return bezier_pieces(lambda t: self.curve(which, t), onto, self.ends, tolerance)


def bezier_pieces(
    curve: Callable[[Floats], CurvePoints], onto: Callable[[Floats], CurvePoints], ends: Interval, tolerance: float
) -> list[Bezier]:
    """Cubic pieces with the tangents of a curve at their ends and, by Gauss and Newton's method, between them.

    Pieces that turn by more than ``tolerance`` from the curve are halved. ``onto`` returns the points of the curve that
    belong to points near it.
    """

    def piece(low: float, high: float, halvings: int) -> list[Bezier]:
        (start, end), (before, after) = curve(np.array([low, high]))

        def with_lengths(lengths: Floats) -> tuple[Bezier, Floats]:
            """The cubic with the tangents of the curve, of given lengths, and the angles by which it misses them."""
            found = Bezier([start, start + lengths[0] * before, end - lengths[1] * after, end])
            tangent, wanted = found.tangent(COMPARED), onto(found.point(COMPARED)).tangent
            return found, _cross(tangent, wanted)

        chord = end - start
        turns = np.array([_cross(before, chord), _cross(chord, after)])
        # a cubic near a circle has the first lengths, one near y^2 = x^3, as the curve is beside grazing, the second
        for fractions in (1.0 / 3.0, np.clip(4.0 / 3.0 - 2.0 * turns / turns.sum(), *LENGTHS)):
            lengths = np.hypot(*chord) * fractions * np.ones(2)
            found, misses = with_lengths(lengths)
            for _ in range(NEWTON_STEPS):
                if np.abs(misses).max() <= tolerance:
                    return [found]
                slopes = [(with_lengths(lengths * nudge)[1] - misses) / NUDGE for nudge in np.eye(2) * NUDGE + 1.0]
                step = np.linalg.lstsq(np.transpose(slopes), misses, rcond=None)[0]
                # a step too far is of a piece too long, which will be halved
                lengths = lengths * np.clip(1.0 - step, 0.5, 2.0)
                found, misses = with_lengths(lengths)
            if np.abs(misses).max() <= tolerance:
                return [found]
        if halvings == 0:
            return [found]
        middle = 0.5 * (low + high)
        return piece(low, middle, halvings - 1) + piece(middle, high, halvings - 1)

    return piece(*ends, MOST_BISECTIONS)


def _between(low: float, high: float, below: Floats, above: Floats, rise: float) -> Floats:
    """The angle in an interval with given fractions of its flux below and above it, to full accuracy at 0 and pi."""
    if low + high < np.pi:
        return np.asarray(2.0 * np.arcsin(np.sqrt(np.sin(0.5 * low) ** 2 + 0.5 * rise * below)))
    return np.asarray(np.pi - 2.0 * np.arcsin(np.sqrt(np.cos(0.5 * high) ** 2 + 0.5 * rise * above)))


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross products of vectors in the plane."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
