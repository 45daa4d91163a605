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
from ..curves.arc import TANGENT, Arc
from ..curves.curve import Curve

# Distance, relative to the size of the table, up to which the end of one curve is the start of the next. Ends that are
# computed from angles and lengths have a few rounding errors.
JOIN_TOLERANCE = 1e-12
# Curves count as longer by this length at both ends, relative to the size of the table, and centres as inside up to
# it. It exceeds gaps at joints and the rounding of positions, so that no centre leaves through a joint.
SLACK = 4.0 * JOIN_TOLERANCE
# Sine of the angle between tangents from which a joint is a corner; those of smooth joints have rounding errors.
KINK = 1e-9
# Largest semi-axis, relative to the size of the table: positions on an arc have errors of its rounded semi-axes, and
# EPS * MOST_CURVED is far below SLACK.
MOST_CURVED = 1e3
# Tolerance of the polylines with which the loops are tested for crossings, relative to the size of the table.
FLATTENING = 1e-6
# Directions, radians, of the lines by which it is decided whether a point is inside; the majority counts.
LINES_OF_SIGHT = (0.7312, 2.8251, 4.9187)
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


def checked_curves(curves: Sequence[Curve]) -> tuple[Curve, ...]:
    """Return the curves as a tuple; raise an InputError if one is of another kind, or has a cusp between its ends."""
    pieces: list[Curve] = []
    for index, piece in enumerate(curves):
        if not isinstance(piece, Curve):
            raise InputError(f"curves: expected Segments, Arcs and Beziers, got {shortened(piece)} at index {index}")
        if (cusp := piece.cusp()) is not None:
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


def loops_of(curves: Sequence[Curve]) -> list[list[int]]:
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


def corners_of(curves: Sequence[Curve]) -> Floats:
    """Return the joints (c, 2) of the curves at which the tangent turns."""
    found = []
    for loop in loops_of(curves) if curves else ():
        for one, two in zip(loop, loop[1:] + loop[:1], strict=True):
            (x0, y0), (x1, y1) = curves[one].tangent(1.0), curves[two].tangent(0.0)
            if x0 * x1 + y0 * y1 < 0.0 or abs(x0 * y1 - y0 * x1) > KINK:
                found.append(curves[two].start)
    return np.array(found).reshape(-1, 2)


def check_nesting(curves: Sequence[Curve], loops: Sequence[Sequence[int]]) -> None:
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
        area = math.fsum(curves[index].signed_area for index in loop)
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


def begins_along(curve: Curve, position: Floats) -> NDArray[np.bool_]:
    """Return whether points (n, 2) are on the curve up to rounding, not at its ends, and it bends towards the table.

    Paths from there begin on the curve, whichever side of it rounding has put the points.
    """
    size = size_of([curve]) + float(np.abs(position).max(initial=0.0))
    ends = np.array([curve.start, curve.end])[:, None] - position
    inner = curve.is_whole | np.all(np.hypot(ends[..., 0], ends[..., 1]) > SLACK * size, axis=0)
    found = np.asarray(inner & curve.is_on(position, TANGENT * size))
    found[found] = curve.touch(position[found])[2] > 0.0
    return found


def arrivals_at(
    curve: Curve, position: Floats, velocity: Floats, own: NDArray[np.bool_], slack: float, front: bool
) -> Floats:
    """The times of `Curve.arrival`, of a curve of any kind."""
    if curve.wall_row is None:
        return curve.arrival(position, velocity, own, slack, front)
    from .compiled.flights import arrivals

    times, points = np.empty(len(position)), np.ascontiguousarray(position)
    arrivals(curve.wall_row[None], points, np.ascontiguousarray(velocity), own, slack, 1.0 if front else -1.0, times)
    return times


def on_the_left(curves: Sequence[Curve], position: Floats, bounded: bool) -> NDArray[np.bool_]:
    """Return whether points (n, 2) are on the left of the loops: the first curve in sight is seen from its left.

    ``bounded`` tells that there is an outer loop, so that a point which sees no curve is outside.
    """
    slack = SLACK * size_of(curves)
    votes = np.zeros(len(position), dtype=np.int64)
    free = np.zeros(len(position), dtype=bool)
    for angle in LINES_OF_SIGHT:
        ray = np.broadcast_to([math.cos(angle), math.sin(angle)], position.shape)
        left, right = (
            np.min([arrivals_at(curve, position, ray, free, EPS, front) for curve in curves], axis=0)
            for front in (True, False)
        )
        votes += np.where(left == right, not bounded, left < right)
    inside = votes > len(LINES_OF_SIGHT) // 2
    for curve in curves:
        inside |= curve.is_on(position, slack)
    return np.asarray(inside)
