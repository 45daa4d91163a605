"""Pairs of mirrors between which rays from a focus return to it and two intervals of angles change places."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from ...core.rounding import EPS

if TYPE_CHECKING:
    from ...geometry import Bezier

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
MOST_HALVINGS = 10

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
    from ...geometry import Bezier

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

    return piece(*ends, MOST_HALVINGS)


def _between(low: float, high: float, below: Floats, above: Floats, rise: float) -> Floats:
    """The angle in an interval with given fractions of its flux below and above it, to full accuracy at 0 and pi."""
    if low + high < np.pi:
        return np.asarray(2.0 * np.arcsin(np.sqrt(np.sin(0.5 * low) ** 2 + 0.5 * rise * below)))
    return np.asarray(np.pi - 2.0 * np.arcsin(np.sqrt(np.cos(0.5 * high) ** 2 + 0.5 * rise * above)))


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross products of vectors in the plane."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
