"""Arcs of circles, and of ellipses with axes along x and y; scaling x and y maps such arcs to such arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, number_between, positive_number
from ...core.errors import WallError
from ...core.rounding import EPS
from . import columns as c
from .curve import (
    LARGEST_COORDINATE,
    ROUNDED,
    Bools,
    Curve,
    Point,
    Table,
    as_point,
    check_keys,
    inverted,
    pair_of,
    parameters,
    stretch_factors,
)

# Up to this span (radians) the points of an arc are computed from its chord and semi-axes. The difference of two
# angles near pi/2 has an error of eps, so the angles give a span of 1e-8 with 8 digits only, the chord with 16.
# Above CHORD_SPAN the points are computed from the angles, because the chord determines a span near pi poorly.
CHORD_SPAN = 1.0

# Relative difference up to which two semi-axes count as equal after a stretch. Two products and two quotients, each
# rounded by eps/2, separate equal semi-axes by at most 2 eps.
CIRCLE_TOLERANCE = 4.0 * EPS

SMALLEST_AXIS = 1.0 / LARGEST_COORDINATE

# Error of a computed end point, relative to |c| + a: c + a cos t rounds three times.
END_ROUNDING = 4.0 * EPS
# Half angle below which it is computed from the chord and the radius, more exactly than from two parameters.
SHALLOW_ARC = 0.5
# Largest span of an arc; longer arcs are cut in two, so that the side of the chord decides which points are on the arc.
LONGEST_ARC = 1.5 * math.pi
# Radians between the angles at which parts of one ellipse meet; what is tested here first is only whether they may be.
SAME_ANGLE = 1e-6
FULL_CIRCLE, WHOLE = 2.0 * math.pi, 4e-12
# How far ahead, in semi-axes, it is decided whether a path that is tangent to an arc from inside runs along the arc.
AHEAD = 1e-7
# Rounding of the distance of a path from the centre of an arc, relative to the distance of its start.
TANGENT = 8.0 * EPS


@dataclass(frozen=True, init=False, repr=False)
class Arc(Curve):
    """The arc (cx + a cos t, cy + b sin t), t from one angle to another, clockwise or counterclockwise.

    Parameters
    ----------
    center : (float, float)
        (cx, cy).
    semi_axes : float or (float, float)
        The radius, or (a, b); greater than 0.
    start, end : float
        The angles t of the two ends in radians; their difference is greater than 0 and at most 2 pi. For an ellipse
        t is the parametric (eccentric) angle. The arc is counterclockwise if ``end > start``.

    Attributes
    ----------
    start_angle, end_angle : float
        The two arguments ``start`` and ``end``.
    start, end : (float, float)
        The end *points*, as for every curve.
    is_circular : bool
        Whether the semi-axes are equal.
    half_span : float
        Half of the angle that the arc subtends, in (0, pi]; accurate also for nearly straight arcs.

    Raises
    ------
    WallError
        If a number is not finite, a semi-axis is not positive or the span is 0 or more than 2 pi.

    Notes
    -----
    The centre of a nearly straight arc is far away and gives its end points inaccurately. ``pinned`` sets the end
    points to exactly known values; the chord and the semi-axes then define the curve.

    Examples
    --------
    >>> from math import pi
    >>> Arc((0, 0), 1.0, start=-pi, end=0.0).length == pi
    True
    >>> Arc((0, 0), (2, 1), 0.0, pi / 2).is_circular
    False
    """

    kind = "arc"
    table, columns, meets_disks = 0, c.ARC_COLUMNS, True

    center: Point
    semi_axes: Point
    start_angle: float
    end_angle: float
    start: Point
    end: Point
    rounding: float = field(compare=False)

    def __init__(self, center: ArrayLike, semi_axes: ArrayLike, start: float, end: float) -> None:
        middle = as_point("Arc center", center)
        axes = as_point("Arc semi_axes", semi_axes if np.iterable(semi_axes) else (semi_axes, semi_axes))
        angles = as_point("Arc start and end", (start, end))
        if min(axes) < SMALLEST_AXIS:
            raise WallError(f"Arc semi_axes: expected numbers greater than 0, at least {SMALLEST_AXIS:g}, got {axes}")
        span = abs(angles[1] - angles[0])
        if not 0.0 < span <= 2.0 * math.pi * (1.0 + 2.0 * EPS):
            raise WallError(
                "Arc start and end: expected angles in radians that differ by more than 0 and at most 2 pi, "
                f"got {angles}"
            )
        points = [(middle[0] + axes[0] * math.cos(t), middle[1] + axes[1] * math.sin(t)) for t in angles]
        rounding = END_ROUNDING * max(abs(middle[0]) + axes[0], abs(middle[1]) + axes[1])
        values = (middle, axes, *angles, *points, rounding)
        vars(self).update(zip(self.__dataclass_fields__, values, strict=True))

    def _with(self, **changes: Any) -> Arc:
        arc = object.__new__(Arc)
        vars(arc).update(vars(self) | changes)
        return arc

    def __repr__(self) -> str:
        axes = self.semi_axes[0] if self.is_circular else self.semi_axes
        return f"Arc(center={self.center}, semi_axes={axes}, start={self.start_angle!r}, end={self.end_angle!r})"

    @property
    def is_circular(self) -> bool:
        """Whether the semi-axes are equal."""
        return self.semi_axes[0] == self.semi_axes[1]

    @property
    def direction(self) -> int:
        """1 for counterclockwise, -1 for clockwise."""
        return 1 if self.end_angle > self.start_angle else -1

    @property
    def _chord(self) -> tuple[float, float, float]:
        # In the coordinates (x, y a/b) the arc is circular with radius a.
        dx = self.end[0] - self.start[0]
        dy = (self.end[1] - self.start[1]) * (self.semi_axes[0] / self.semi_axes[1])
        return dx, dy, math.hypot(dx, dy)

    @property
    def half_span(self) -> float:
        """Half of the angle that the arc subtends, in (0, pi]."""
        span = abs(self.end_angle - self.start_angle)
        if span > CHORD_SPAN:
            return 0.5 * span
        return math.asin(min(1.0, self._chord[2] / (2.0 * self.semi_axes[0])))

    def point(self, s: ArrayLike) -> Floats:
        """Return the points at the parameters ``s`` in [0, 1] (uniform in t), shape ``s.shape + (2,)``."""
        s = parameters(s)
        if abs(self.end_angle - self.start_angle) > CHORD_SPAN:
            return self._point_by_angle(s)
        dx, dy, chord = self._chord
        half = self.half_span
        phi = (2.0 * s - 1.0) * half
        along = 0.5 * (1.0 + np.sin(phi) / math.sin(half))
        # R cos(half) - R cos(phi) as a product, so that flat arcs keep all digits of their depth
        across = self.direction * 2.0 * self.semi_axes[0] * np.sin(0.5 * (phi + half)) * np.sin(0.5 * (phi - half))
        x = self.start[0] + along * dx - across * (dy / chord)
        y = self.start[1] + (along * dy + across * (dx / chord)) * (self.semi_axes[1] / self.semi_axes[0])
        return self._with_exact_ends(s, np.stack([x, y], axis=-1))

    def _point_by_angle(self, s: Floats) -> Floats:
        """Return the nearer end point plus (a (cos t - cos t0), b (sin t - sin t0)), the differences as products."""
        first = (s <= 0.5)[..., np.newaxis]
        anchor = np.where(first, np.array(self.start), np.array(self.end))
        anchor_angle = np.where(s <= 0.5, self.start_angle, self.end_angle)
        turn = np.where(s <= 0.5, s, s - 1.0) * (self.end_angle - self.start_angle)
        a, b = self.semi_axes
        chord = 2.0 * np.sin(0.5 * turn)
        middle = anchor_angle + 0.5 * turn
        moved = anchor + np.stack([-a * chord * np.sin(middle), b * chord * np.cos(middle)], axis=-1)
        return self._with_exact_ends(s, moved)

    def _with_exact_ends(self, s: Floats, points: Floats) -> Floats:
        points[s == 0.0] = self.start
        points[s == 1.0] = self.end
        return points

    def tangent(self, s: ArrayLike) -> Floats:
        s = parameters(s)
        a, b = self.semi_axes
        if abs(self.end_angle - self.start_angle) > CHORD_SPAN:
            t = self.start_angle + s * (self.end_angle - self.start_angle)
            vx, vy = -self.direction * a * np.sin(t), self.direction * b * np.cos(t)
        else:
            dx, dy, chord = self._chord
            phi = (2.0 * s - 1.0) * self.half_span
            cos, sin = np.cos(phi), self.direction * np.sin(phi)
            vx, vy = (cos * dx - sin * dy) / chord, (cos * dy + sin * dx) / chord * (b / a)
        speed = np.hypot(vx, vy)
        return np.stack([vx / speed, vy / speed], axis=-1)

    @property
    def length(self) -> float:
        """The arc length: R times the span, or an incomplete elliptic integral of the second kind."""
        a, b = self.semi_axes
        half = self.half_span
        if self.is_circular:
            return 2.0 * a * half
        if half < 0.1 * min(a / b, b / a):  # branch points tan t = +-i b/a are far: Gauss quadrature is exact
            nodes, weights = np.polynomial.legendre.leggauss(20)
            t = 0.5 * (self.start_angle + self.end_angle) + half * nodes
            return float(half * np.sum(weights * np.hypot(a * np.sin(t), b * np.cos(t))))
        from scipy.special import ellipeinc

        # b int sqrt(1 - m sin^2 t) dt with the longer semi-axis in front, so that m is in (0, 1)
        shift, long, short = (0.0, b, a) if b > a else (0.5 * math.pi, a, b)
        m = (1.0 - short / long) * (1.0 + short / long)
        ends = ellipeinc(np.array([self.start_angle, self.end_angle]) - shift, m)
        return float(long * abs(ends[1] - ends[0]))

    def turning_points(self, axis: int) -> list[float]:
        """Return the parameters in (0, 1) where x (axis 0) or y (axis 1) is extremal, ascending."""
        offset = 0.0 if axis == 0 else 0.5 * math.pi
        low, high = sorted((self.start_angle, self.end_angle))
        first = math.ceil((low - offset) / math.pi)
        last = math.floor((high - offset) / math.pi)
        span = self.end_angle - self.start_angle
        turns = [(offset + k * math.pi - self.start_angle) / span for k in range(first, last + 1)]
        return sorted(s for s in turns if 0.0 < s < 1.0)

    def turning_values(self, axis: int) -> list[float]:
        """Return coordinate ``axis`` at its turning points: that of the centre plus or minus the semi-axis."""
        span = self.end_angle - self.start_angle
        if abs(span) <= CHORD_SPAN:
            return super().turning_values(axis)
        wave = math.cos if axis == 0 else math.sin
        angles = (self.start_angle + s * span for s in self.turning_points(axis))
        return [self.center[axis] + math.copysign(self.semi_axes[axis], wave(t)) for t in angles]

    def reversed(self) -> Arc:
        """Return the arc in the opposite direction."""
        return self._with(start_angle=self.end_angle, end_angle=self.start_angle, start=self.end, end=self.start)

    def stretched(self, x_factor: float, y_factor: float) -> Arc:
        """Return the image under (x, y) -> (x_factor x, y_factor y); semi-axes equal to rounding become equal."""
        fx, fy = stretch_factors(x_factor, y_factor)
        first, last = self.start_angle, self.end_angle
        if fx < 0.0:
            first, last = math.pi - first, math.pi - last
        if fy < 0.0:
            first, last = -first, -last
        axes = (self.semi_axes[0] * abs(fx), self.semi_axes[1] * abs(fy))
        if abs(axes[0] - axes[1]) <= CIRCLE_TOLERANCE * axes[0]:
            axes = (axes[0], axes[0])
        center, start, end = ((fx * x, fy * y) for x, y in (self.center, self.start, self.end))
        rounding = self.rounding * max(abs(fx), abs(fy))
        return self._with(
            center=center, semi_axes=axes, start_angle=first, end_angle=last, start=start, end=end, rounding=rounding
        )

    def moved(self, dx: float, dy: float) -> Arc:
        dx, dy = as_point("moved", (dx, dy))
        center, start, end = ((x + dx, y + dy) for x, y in (self.center, self.start, self.end))
        return self._with(center=center, start=start, end=end)

    def pinned(self, start: Point, end: Point) -> Arc:
        first, last = as_point("Arc start point", start), as_point("Arc end point", end)
        return self._with(start=first, end=last, rounding=0.0)

    def split(self, s: float) -> tuple[Arc, Arc]:
        s = number_between("s", s, 0.0, 1.0, closed="low high")
        angle = self.start_angle + s * (self.end_angle - self.start_angle)
        x, y = self.point(s)
        middle = (float(x), float(y))
        return self._with(end_angle=angle, end=middle), self._with(start_angle=angle, start=middle)

    def flattened(self, tolerance: float) -> Floats:
        """Return points on the arc, uniform in t, whose polyline is within ``tolerance``."""
        # A step of d radians has an error of at most max(a, b) (1 - cos(d/2)) = 2 max(a, b) sin^2(d/4).
        sine = math.sqrt(positive_number("tolerance", tolerance) / (2.0 * max(self.semi_axes)))
        step = 4.0 * math.asin(min(sine, 0.5)) or math.inf
        return self.point(self.steps(2.0 * self.half_span / step))

    def curvature(self, s: float) -> float:
        a, b = self.semi_axes
        t = self.start_angle + s * (self.end_angle - self.start_angle)
        turn = 1.0 if self.end_angle > self.start_angle else -1.0
        return turn / a if a == b else turn * a * b / math.hypot(a * math.sin(t), b * math.cos(t)) ** 3

    def largest_curvature(self) -> tuple[float, float]:
        """At an end or on an axis."""
        # monotone between multiples of pi/2
        a, b = self.semi_axes
        if a == b:
            return 1.0 / a, EPS / a
        low, high = sorted((self.start_angle, self.end_angle))
        quarters = range(math.ceil(low / (0.5 * math.pi)), math.floor(high / (0.5 * math.pi)) + 1)
        at_axes = [b / a**2 if k % 2 else a / b**2 for k in quarters]
        value = max(abs(self.curvature(0.0)), abs(self.curvature(1.0)), *at_axes, 0.0)
        # an angle is rounded, and the formula changes by at most this factor with it
        return value, ROUNDED * max(a / b, b / a) ** 2 * value

    def joined(self, after: Curve, tolerance: float) -> Arc | None:
        if not isinstance(after, Arc):
            return None
        span = 2.0 * (self.half_span + after.half_span)
        turn = math.remainder(after.start_angle - self.end_angle, 2.0 * math.pi)
        if self.direction != after.direction or span > 2.0 * math.pi + SAME_ANGLE or abs(turn) > SAME_ANGLE:
            return None
        end = self.start_angle + self.direction * min(span, 2.0 * math.pi)
        whole = Arc(self.center, self.semi_axes, self.start_angle, end).pinned(self.start, after.end)
        return whole if whole.has_parts(self, after, self.half_span / (0.5 * span), tolerance) else None

    def to_table(self) -> Table:
        form = {"center": list(self.center), "semi_axes": list(self.semi_axes)}
        angles = [self.start_angle, self.end_angle]
        return {"kind": self.kind, **form, "angles": angles, "start": list(self.start), "end": list(self.end)}

    @classmethod
    def from_table(cls, table: Table) -> Arc:
        check_keys(table, {"kind", "center", "semi_axes", "angles"}, {"start", "end"})
        axes = table["semi_axes"]
        start, end = pair_of("angles", table["angles"])
        semi_axes = pair_of("semi_axes", axes if isinstance(axes, list) else [axes, axes])
        arc = cls(pair_of("center", table["center"]), semi_axes, start, end)
        if "start" not in table and "end" not in table:
            return arc
        check_keys(table, {"kind", "center", "semi_axes", "angles", "start", "end"}, set())
        return arc.pinned(pair_of("start", table["start"]), pair_of("end", table["end"]))

    def row(self, ends: Mapping[int, float]) -> Floats:
        """The row of ``arcs``; RUN_SINE is set later."""
        a, b = self.semi_axes
        stretch = a / b
        turn = self.end_angle - self.start_angle
        # counterclockwise arcs have their centre on the left, the free side: they are focusing
        sign = 1.0 if turn > 0.0 else -1.0
        chord = (ends[c.END_X] - ends[c.START_X], stretch * (ends[c.END_Y] - ends[c.START_Y]))
        length = math.hypot(*chord)
        direction = (chord[0] / length, chord[1] / length)
        half = 0.5 * abs(turn)
        # sin(half) = kappa length / 2 puts both joints on the circle: the more accurate of the two gives the other
        if half < SHALLOW_ARC:
            half = math.asin(min(1.0, 0.5 * length / a))
            curvature = sign / a
        else:
            curvature = sign * 2.0 * math.sin(half) / length
        normal = (
            sign * math.sin(half) * direction[0] - math.cos(half) * direction[1],
            sign * math.sin(half) * direction[1] + math.cos(half) * direction[0],
        )
        short = length if half <= 0.25 * math.pi else 0.0
        columns = {
            c.NORMAL_X: normal[0], c.NORMAL_Y: normal[1], c.CURVATURE: curvature,
            c.CHORD_X: direction[0], c.CHORD_Y: direction[1], c.SHORT_CHORD: short, c.SPAN: 2.0 * half,
            c.STRETCH: stretch,
        }  # fmt: skip
        return c.row_of(c.ARC_COLUMNS, {**ends, **columns})

    @staticmethod
    def heights(rows: Floats) -> Floats:
        """Every point is within half of the arc length of an end."""
        half = 0.5 * rows[:, [c.SPAN]] / np.abs(rows[:, [c.CURVATURE]]) / rows[:, [c.STRETCH]]
        ends = rows[:, [c.START_Y, c.END_Y]]
        return np.hstack([ends.min(axis=1, keepdims=True) - half, ends.max(axis=1, keepdims=True) + half])

    @staticmethod
    def goes_in_waves(rows: Floats) -> bool:
        """If all are circular."""
        return bool(np.all(rows[:, c.STRETCH] == 1.0))

    def cut(self) -> tuple[Curve, ...]:
        """In two if it is longer than LONGEST_ARC, with a smooth joint."""
        if abs(self.end_angle - self.start_angle) <= LONGEST_ARC:
            return (self,)
        middle = 0.5 * (self.start_angle + self.end_angle)
        return (
            Arc(self.center, self.semi_axes, self.start_angle, middle),
            Arc(self.center, self.semi_axes, middle, self.end_angle),
        )

    @property
    def is_whole(self) -> bool:
        """Whether the curve is a whole ellipse, which has no ends."""
        return abs(self.end_angle - self.start_angle) + WHOLE >= FULL_CIRCLE

    @property
    def signed_area(self) -> float:
        (cx, cy), (a, b), (t0, t1) = self.center, self.semi_axes, (self.start_angle, self.end_angle)
        rise, run = math.sin(t1) - math.sin(t0), math.cos(t1) - math.cos(t0)
        return 0.5 * (a * b * (t1 - t0) + cx * b * rise - cy * a * run)

    @property
    def wall_row(self) -> Floats:
        (low_x, low_y, high_x, high_y), span = self.box, abs(self.end_angle - self.start_angle)
        columns = {
            c.WALL_KIND: c.ARC_WALL, c.WALL_X: self.center[0], c.WALL_Y: self.center[1],
            c.SEMI_X: self.semi_axes[0], c.SEMI_Y: self.semi_axes[1], c.DIRECTION: self.direction,
            c.FIRST_ANGLE: self.start_angle, c.WALL_SPAN: span, c.WALL_SIZE: math.hypot(high_x - low_x, high_y - low_y),
            c.FROM_X: self.start[0], c.FROM_Y: self.start[1], c.TO_X: self.end[0], c.TO_Y: self.end[1],
        }  # fmt: skip
        return c.row_of(c.WALL_COLUMNS, columns)

    def _within_span(self, unit: Floats, slack: float) -> Bools:
        """Return whether points (n, 2) of the unit circle belong to the arc."""
        span = abs(self.end_angle - self.start_angle)
        if span + slack >= FULL_CIRCLE:
            return np.ones(len(unit), dtype=bool)
        with np.errstate(invalid="ignore"):
            swept = self.direction * (np.arctan2(unit[:, 1], unit[:, 0]) - self.start_angle) % FULL_CIRCLE
        return np.asarray((swept <= span + slack) | (swept >= FULL_CIRCLE - slack))

    def touch(self, position: Floats) -> tuple[Floats, Floats, Floats]:
        a, b = self.semi_axes
        axes, center = np.array([a, b]), np.array(self.center)
        unit = (position - center) / axes
        unit /= np.hypot(unit[:, 0], unit[:, 1])[:, None]
        tangent = self.direction * np.stack([-a * unit[:, 1], b * unit[:, 0]], axis=1)
        speed = np.hypot(tangent[:, 0], tangent[:, 1])
        return (center + axes * unit, tangent / speed[:, None], self.direction * a * b / speed**3)

    def length_to(self, position: Floats) -> Floats:
        unit = (position - np.array(self.center)) / np.array(self.semi_axes)
        span = abs(self.end_angle - self.start_angle)
        swept = self.direction * (np.arctan2(unit[:, 1], unit[:, 0]) - self.start_angle) % FULL_CIRCLE
        # rounding may put a point just before the start or behind the end: it belongs to the nearer one
        swept = np.where(swept > 0.5 * (span + FULL_CIRCLE), 0.0, np.minimum(swept, span))
        return self._length_swept(swept)

    def point_at_length(self, length: Floats) -> Floats:
        if self.is_circular:
            return self.point(length / self.length)
        span = abs(self.end_angle - self.start_angle)
        return self.point(inverted(lambda swept: self._length_swept(swept), length, span) / span)

    def _length_swept(self, swept: Floats) -> Floats:
        """Arc lengths from the start to where the parametric angle has grown or fallen by ``swept``."""
        a, b = self.semi_axes
        if self.is_circular:
            return a * swept
        from scipy.special import ellipeinc

        # the longer semi-axis in front, so that the parameter m is in (0, 1)
        shift, long, short = (0.0, b, a) if b > a else (0.5 * math.pi, a, b)
        m = (1.0 - short / long) * (1.0 + short / long)
        start = self.start_angle - shift
        return np.asarray(long * np.abs(ellipeinc(start + self.direction * swept, m) - ellipeinc(start, m)))

    def is_on(self, position: Floats, slack: float) -> Bools:
        axes = np.array(self.semi_axes)
        unit = (position - np.array(self.center)) / axes
        near = np.abs(np.hypot(unit[:, 0], unit[:, 1]) - 1.0) * float(axes.min()) <= slack
        return np.asarray(near & self._within_span(unit, slack / float(axes.min())))
