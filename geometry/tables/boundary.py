"""The boundary of a billiard table: closed loops of curves, and the flight to the next of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, shortened
from ...core.errors import InputError
from ...core.rounding import EPS
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.curve import Curve
from ..curves.segment import Segment
from . import splines

Piece = Segment | Arc | Bezier

# Distance, relative to the size of the table, up to which the end of one curve is the start of the next. Ends that are
# computed from angles and lengths have a few rounding errors.
JOIN_TOLERANCE = 1e-12
# Curves count as longer by this length at both ends, relative to the size of the table, and centres as inside up to
# it. It exceeds gaps at joints and the rounding of positions, so that no centre leaves through a joint.
SLACK = 4.0 * JOIN_TOLERANCE
# Sine of the angle between tangents from which a joint is a corner; those of smooth joints have rounding errors.
KINK = 1e-9
# How far ahead, in semi-axes, it is decided whether a path that is tangent to an arc from inside runs along the arc.
AHEAD = 1e-7
# Largest semi-axis, relative to the size of the table: positions on an arc have errors of its rounded semi-axes, and
# EPS * MOST_CURVED is far below SLACK.
MOST_CURVED = 1e3
# Tolerance of the polylines with which the loops are tested for crossings, relative to the size of the table.
FLATTENING = 1e-6
# Directions, radians, of the lines by which it is decided whether a point is inside; the majority counts.
LINES_OF_SIGHT = (0.7312, 2.8251, 4.9187)
FULL_CIRCLE = 2.0 * math.pi
# Rounding of the distance of a path from the centre of an arc, relative to the distance of its start.
TANGENT = 8.0 * EPS
TINIEST = float(np.finfo(np.float64).tiny)


class FlightStatus(IntEnum):
    """What a flight in a container comes to.

    ``FLYING``: a wall reflects the disk. ``CORNER``: the disk meets a corner within rounding, where the outcome depends
    on which wall it meets first. ``GRAZING``: it is so nearly tangent to a wall that bends towards its path that double
    precision does not resolve the reflections. ``FREE``: it rests, or no wall is ahead. ``UNREFLECTED``: the law of the
    wall found no outgoing velocity.
    """

    FLYING = 0
    CORNER = 1
    GRAZING = 2
    FREE = 3
    UNREFLECTED = 4


def size_of(curves: Sequence[Curve]) -> float:
    """Return the diagonal of the box around the curves."""
    boxes = np.array([curve.box for curve in curves])
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return float(np.hypot(*(high - low)))


def checked_curves(curves: Sequence[Curve]) -> tuple[Piece, ...]:
    """Return the curves as a tuple; raise an InputError if one is of another kind, or has a cusp between its ends."""
    pieces: list[Piece] = []
    for index, piece in enumerate(curves):
        if not isinstance(piece, (Segment, Arc, Bezier)):
            raise InputError(f"curves: expected Segments, Arcs and Beziers, got {shortened(piece)} at index {index}")
        if isinstance(piece, Bezier) and (cusp := splines.cusp_of(piece)) is not None:
            raise InputError(
                f"curves: expected Bezier curves without cusps between their ends, got {piece} at index {index}; "
                f"pass both parts of curve.split({cusp!r})"
            )
        pieces.append(piece)
    if not pieces:
        return ()
    longest = MOST_CURVED * size_of(pieces)
    for index, piece in enumerate(pieces):
        if isinstance(piece, Arc) and max(piece.semi_axes) > longest:
            raise InputError(
                f"curves: expected semi-axes of at most {longest:.3g}, {MOST_CURVED:g} times the size of the table, "
                f"got {max(piece.semi_axes):.3g} at index {index}; replace an arc that is almost straight by a Segment"
            )
    return tuple(pieces)


def loops_of(curves: Sequence[Piece]) -> list[list[int]]:
    """Return the closed loops of the curves, each as indices in the order of travel.

    Raises
    ------
    InputError
        If the end of some curve is not the start of exactly one curve.
    """
    size = size_of(curves)
    starts, ends = (np.array([getattr(curve, end) for curve in curves]) for end in ("start", "end"))
    gaps = np.hypot(*np.moveaxis(ends[:, None] - starts[None, :], -1, 0))
    joined = gaps <= JOIN_TOLERANCE * size
    # ends first, of which the message says the nearest start
    open_ends = [*np.flatnonzero(joined.sum(axis=1) != 1), *np.flatnonzero(joined.sum(axis=0) != 1)]
    if open_ends:
        index = int(open_ends[0])
        nearest = int(np.argmin(gaps[index]))
        raise InputError(
            "curves: expected closed loops, each curve ending where exactly one begins, and beginning where one ends; "
            f"not so curve {index}, from {curves[index].start} to {curves[index].end} (the nearest start, of curve "
            f"{nearest}, is {gaps[index, nearest]:.3g} from its end); the inside is on the left of all curves"
        )
    following = joined.argmax(axis=1)
    loops, seen = [], set()
    for first in range(len(curves)):
        loop = []
        index = first
        while index not in seen:
            seen.add(index)
            loop.append(index)
            index = int(following[index])
        if loop:
            loops.append(loop)
    return loops


def corners_of(curves: Sequence[Piece]) -> Floats:
    """Return the joints (c, 2) of the curves at which the tangent turns."""
    found = []
    for loop in loops_of(curves) if curves else ():
        for one, two in zip(loop, loop[1:] + loop[:1], strict=True):
            (x0, y0), (x1, y1) = curves[one].tangent(1.0), curves[two].tangent(0.0)
            if x0 * x1 + y0 * y1 < 0.0 or abs(x0 * y1 - y0 * x1) > KINK:
                found.append(curves[two].start)
    return np.array(found).reshape(-1, 2)


def signed_area(curve: Piece) -> float:
    """Return (1/2) of the integral of x dy - y dx along the curve."""
    if isinstance(curve, Segment):
        (x0, y0), (x1, y1) = curve.start, curve.end
        return 0.5 * (x0 * y1 - x1 * y0)
    if isinstance(curve, Bezier):
        return splines.signed_area(curve)
    (cx, cy), (a, b), (t0, t1) = curve.center, curve.semi_axes, (curve.start_angle, curve.end_angle)
    rise, run = math.sin(t1) - math.sin(t0), math.cos(t1) - math.cos(t0)
    return 0.5 * (a * b * (t1 - t0) + cx * b * rise - cy * a * run)


def check_nesting(curves: Sequence[Piece], loops: Sequence[Sequence[int]]) -> None:
    """Raise an InputError unless the loops bound one region, on the left of every curve."""
    from shapely import LinearRing, Polygon

    tolerance = FLATTENING * size_of(curves)
    rings: list[Polygon] = []
    outer: list[int] = []
    obstacles: list[int] = []
    for loop in loops:
        points = np.concatenate([curves[index].flattened(tolerance)[:-1] for index in loop])
        if len(points) < 3 or not LinearRing(points).is_simple:
            raise InputError(f"curves: expected loops that do not cross themselves, got one of curves {list(loop)}")
        area = math.fsum(signed_area(curves[index]) for index in loop)
        rings.append(Polygon(points))
        (outer if area > 0.0 else obstacles).append(len(rings) - 1)
    if len(outer) > 1:
        raise InputError(
            f"curves: expected one outer loop (counterclockwise), got {len(outer)}; the loops of obstacles run "
            "clockwise, with the inside of the table on their left"
        )
    for first, second in combinations(obstacles, 2):
        if rings[first].intersects(rings[second]):
            raise InputError(f"curves: expected separate obstacles, got loops {loops[first]} and {loops[second]} meet")
    for index in obstacles:
        if outer and not rings[outer[0]].contains(rings[index]):
            raise InputError(f"curves: expected obstacles inside the outer loop, got loop {list(loops[index])} outside")


@dataclass(frozen=True)
class Touch:
    """Points on one wall: corrected positions (n, 2), unit tangents (n, 2) in the direction of travel, curvatures (n,).

    The inside is on the left of the tangent. The curvature is the rate at which the tangent turns to the left, so it
    is positive on the inside of a circle (focusing) and negative on an obstacle (dispersing).
    """

    position: Floats
    tangent: Floats
    curvature: Floats

    @property
    def normal(self) -> Floats:
        """The unit normals (n, 2) into the table."""
        return np.stack([-self.tangent[:, 1], self.tangent[:, 0]], axis=1)

    def incoming(self, velocity: Floats) -> Floats:
        """Return (v1, v2, ...) along the tangents and normals of velocities (n, 2 or 3) that hit the wall: v2 < 0.

        That they hit the wall is decided by `arrival`; here rounding cannot decide otherwise.
        """
        plane = velocity[:, :2]
        along, up = np.sum(plane * self.tangent, axis=1), np.sum(plane * self.normal, axis=1)
        return np.column_stack([along, np.minimum(up, -TINIEST), velocity[:, 2:]])

    def outgoing(self, local: Floats) -> Floats:
        """Return, in fixed axes, velocities (n, 2 or 3) that are given along the tangents and normals."""
        return np.column_stack([local[:, :1] * self.tangent + local[:, 1:2] * self.normal, local[:, 2:]])


def arrival(
    curve: Piece, position: Floats, velocity: Floats, own: NDArray[np.bool_], slack: float, front: bool = True
) -> Floats:
    """Return the times (n,) at which moving points reach the curve from its left, inf where they do not.

    A point that is tangent to a curve flies on, except where the curve bends towards it: there it is reached.

    Parameters
    ----------
    own : array of bool, shape (n,)
        Whether the point begins on this curve.
    slack : float
        The length by which the curve is longer at both ends, and the depth up to which a point may be behind it.
    front : bool
        If False, arrivals from the right.
    """
    turn = 1.0 if front else -1.0
    if isinstance(curve, Segment):
        return _arrival_at_segment(curve, position, velocity, own, slack, turn)
    if isinstance(curve, Bezier):
        return splines.arrival(curve, position, velocity, own, slack, turn)
    return _arrival_at_arc(curve, position, velocity, own, slack, turn)


def _arrival_at_segment(
    curve: Segment, position: Floats, velocity: Floats, own: NDArray[np.bool_], slack: float, turn: float
) -> Floats:
    along = curve.tangent(0.0)
    normal = turn * np.array([-along[1], along[0]])
    relative = position - np.array(curve.start)
    distance, approach = np.sum(relative * normal, axis=1), -np.sum(velocity[:, :2] * normal, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        time = np.maximum(distance, 0.0) / approach
        at = np.sum((relative + velocity[:, :2] * time[:, None]) * along, axis=1)
    hit = (approach > 0.0) & (distance >= -slack) & (at >= -slack) & (at <= curve.length + slack) & ~own
    return np.where(hit & np.isfinite(time), time, np.inf)


def _arrival_at_arc(
    curve: Arc, position: Floats, velocity: Floats, own: NDArray[np.bool_], slack: float, turn: float
) -> Floats:
    # in units of the semi-axes the arc belongs to the circle |P| = 1, which is met where A t^2 + 2 B t + C = 0
    axes = np.array(curve.semi_axes)
    start, direction = (position - np.array(curve.center)) / axes, velocity[:, :2] / axes
    square = np.sum(direction**2, axis=1)
    along = np.sum(start * direction, axis=1)
    across = np.abs(start[:, 0] * direction[:, 1] - start[:, 1] * direction[:, 0])
    excess = np.where(own, 0.0, np.sum(start**2, axis=1) - 1.0)
    speed = np.sqrt(square)
    root = np.sqrt(np.maximum((speed - across) * (speed + across), 0.0))
    behind = slack / float(axes.min())
    tangent = np.zeros(len(position), dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if curve.direction * turn > 0:
            # the way out of the circle; from the circle itself C = 0
            time = np.where(along > 0.0, -excess / (along + root), (root - along) / square)
            time = np.where(own, -2.0 * along / square, time)
            # within rounding the path is tangent: it is reached unless it leaves the arc there
            tangent = ~own & (np.abs(across - speed) <= TANGENT * speed * (1.0 + np.hypot(start[:, 0], start[:, 1])))
            hit = own | ((tangent | (across < speed)) & (time * speed >= -behind))
        else:
            time = excess / (root - along)
            hit = ~own & (along < 0.0) & (across < speed) & (excess >= -behind)
        time = np.maximum(time, 0.0)
        met = start + direction * (time + np.where(tangent, AHEAD / speed, 0.0))[:, None]
    return np.where(hit & np.isfinite(time) & _within_span(curve, met, behind), time, np.inf)


def _within_span(curve: Arc, unit: Floats, slack: float) -> NDArray[np.bool_]:
    """Return whether points (n, 2) of the unit circle belong to the arc."""
    span = abs(curve.end_angle - curve.start_angle)
    if span + slack >= FULL_CIRCLE:
        return np.ones(len(unit), dtype=bool)
    with np.errstate(invalid="ignore"):
        swept = curve.direction * (np.arctan2(unit[:, 1], unit[:, 0]) - curve.start_angle) % FULL_CIRCLE
    return np.asarray((swept <= span + slack) | (swept >= FULL_CIRCLE - slack))


def touch(curve: Piece, position: Floats) -> Touch:
    """Return points (n, 2) that are on the curve up to rounding, moved onto it, with tangents and curvatures."""
    if isinstance(curve, Segment):
        tangent = np.broadcast_to(curve.tangent(0.0), position.shape)
        return Touch(position, tangent, np.zeros(len(position)))
    if isinstance(curve, Bezier):
        return Touch(*splines.touch(curve, position))
    a, b = curve.semi_axes
    axes, center = np.array([a, b]), np.array(curve.center)
    unit = (position - center) / axes
    unit /= np.hypot(unit[:, 0], unit[:, 1])[:, None]
    tangent = curve.direction * np.stack([-a * unit[:, 1], b * unit[:, 0]], axis=1)
    speed = np.hypot(tangent[:, 0], tangent[:, 1])
    return Touch(center + axes * unit, tangent / speed[:, None], curve.direction * a * b / speed**3)


def length_at(curve: Piece, position: Floats) -> Floats:
    """Return the arc lengths (n,) from the start of a curve to points (n, 2) on it."""
    if isinstance(curve, Segment):
        along = (position - np.array(curve.start)) @ curve.tangent(0.0)
        return np.asarray(np.clip(along, 0.0, curve.length))
    if isinstance(curve, Bezier):
        return splines.length_to(curve, splines.parameter_of(curve, position))
    unit = (position - np.array(curve.center)) / np.array(curve.semi_axes)
    span = abs(curve.end_angle - curve.start_angle)
    swept = curve.direction * (np.arctan2(unit[:, 1], unit[:, 0]) - curve.start_angle) % FULL_CIRCLE
    # rounding may put a point just before the start or behind the end: it belongs to the nearer one
    swept = np.where(swept > 0.5 * (span + FULL_CIRCLE), 0.0, np.minimum(swept, span))
    return _length_swept(curve, swept)


def point_at_length(curve: Piece, length: Floats) -> Floats:
    """Return the points (n, 2) at these arc lengths (n,) from the start of a curve."""
    if isinstance(curve, Bezier):
        return splines.point_at_length(curve, length)
    if isinstance(curve, Segment) or curve.is_circular:
        return curve.point(length / curve.length)
    span = abs(curve.end_angle - curve.start_angle)
    return curve.point(splines.inverted(lambda swept: _length_swept(curve, swept), length, span) / span)


def _length_swept(curve: Arc, swept: Floats) -> Floats:
    """Arc lengths from the start to where the parametric angle has grown or fallen by ``swept``."""
    a, b = curve.semi_axes
    if curve.is_circular:
        return a * swept
    from scipy.special import ellipeinc

    # the longer semi-axis in front, so that the parameter m is in (0, 1)
    shift, long, short = (0.0, b, a) if b > a else (0.5 * math.pi, a, b)
    m = (1.0 - short / long) * (1.0 + short / long)
    start = curve.start_angle - shift
    return np.asarray(long * np.abs(ellipeinc(start + curve.direction * swept, m) - ellipeinc(start, m)))


def is_on(curve: Piece, position: Floats, slack: float) -> NDArray[np.bool_]:
    """Return whether points (n, 2) are on the curve, up to ``slack``."""
    if isinstance(curve, Segment):
        along = curve.tangent(0.0)
        relative = position - np.array(curve.start)
        at = relative @ along
        near = np.abs(relative @ np.array([-along[1], along[0]])) <= slack
        return np.asarray(near & (at >= -slack) & (at <= curve.length + slack))
    if isinstance(curve, Bezier):
        return np.asarray(np.hypot(*(splines.touch(curve, position)[0] - position).T) <= slack)
    axes = np.array(curve.semi_axes)
    unit = (position - np.array(curve.center)) / axes
    near = np.abs(np.hypot(unit[:, 0], unit[:, 1]) - 1.0) * float(axes.min()) <= slack
    return np.asarray(near & _within_span(curve, unit, slack / float(axes.min())))


def begins_along(curve: Piece, position: Floats) -> NDArray[np.bool_]:
    """Return whether points (n, 2) are on the curve up to rounding, not at its ends, and it bends towards the table.

    Paths from there begin on the curve, whichever side of it rounding has put the points.
    """
    if isinstance(curve, Segment) or (isinstance(curve, Arc) and curve.direction < 0):
        return np.zeros(len(position), dtype=bool)
    size = size_of([curve]) + float(np.abs(position).max(initial=0.0))
    ends = np.array([curve.start, curve.end])[:, None] - position
    inner = is_whole(curve) | np.all(np.hypot(ends[..., 0], ends[..., 1]) > SLACK * size, axis=0)
    found = np.asarray(inner & is_on(curve, position, TANGENT * size))
    found[found] = touch(curve, position[found]).curvature > 0.0
    return found


def is_whole(curve: Piece) -> bool:
    """Whether the curve is a whole ellipse, which has no ends."""
    return isinstance(curve, Arc) and abs(curve.end_angle - curve.start_angle) + SLACK >= FULL_CIRCLE


def on_the_left(curves: Sequence[Piece], position: Floats, bounded: bool) -> NDArray[np.bool_]:
    """Return whether points (n, 2) are on the left of the loops: the first curve in sight is seen from its left.

    ``bounded`` tells that there is an outer loop, so that a point which sees no curve is outside.
    """
    slack = SLACK * size_of(curves)
    votes = np.zeros(len(position), dtype=np.int64)
    free = np.zeros(len(position), dtype=bool)
    for angle in LINES_OF_SIGHT:
        ray = np.broadcast_to([math.cos(angle), math.sin(angle)], position.shape)
        left, right = (
            np.min([arrival(curve, position, ray, free, EPS, front) for curve in curves], axis=0)
            for front in (True, False)
        )
        votes += np.where(left == right, not bounded, left < right)
    inside = votes > len(LINES_OF_SIGHT) // 2
    for curve in curves:
        inside |= is_on(curve, position, slack)
    return np.asarray(inside)
