"""Checks of a wall's geometry: its pieces join, do not cross, and lie in y <= 0 over one period.

The conditions are B1-B5 of Rudzis 2022, section 1.3.1. This module also makes the joints exact. Neighbouring pieces
share their joint exactly, and the path runs from exactly (0, y0) to exactly (period, y0). Heights within rounding of
0 become 0, and heights within rounding of the greatest height become equal to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import WallError
from ...core.long_runs import counted
from ...core.rounding import EPS
from ..curves.crossings import find_crossing
from ..curves.curve import Curve, Point, point_array
from .cell import Cell

# Distance, relative to the wall's size, up to which the ends of two pieces join; enough for input of ten digits.
JOIN_TOLERANCE = 1e-9

# Distance, relative to the wall's size, up to which a coordinate is set to 0 or to the period. Coordinates are
# computed by a few dozen operations, each of which rounds by eps/2.
SNAP_TOLERANCE = 64.0 * EPS

# A piece touches the level of the tops inside, not at its end, if the parameter of its top is this far from 0 and 1.
# The height near a top is quadratic, so rounding an end point by eps moves the top by about sqrt(eps).
TOUCH_MARGIN = 1e-7

Pieces = tuple[Curve, ...]


def canonical_path(given: Sequence[Curve], period: float) -> Pieces:
    """Return the pieces with exact joints, cut at inner tops of greatest height, or raise a WallError."""
    pieces = _curves(given, "pieces")
    starts, ends = _end_points(pieces)
    size = _size(starts, ends, period)
    rounding = np.array([p.rounding for p in pieces])
    _check_left_and_right(starts, ends, rounding, period, size)
    joints, slack = _joints(starts[1:], ends[:-1], rounding[1:], rounding[:-1], size, "")
    base = starts[0, 1] if rounding[0] <= rounding[-1] else ends[-1, 1]
    base_slack = min(rounding[0], rounding[-1]) + abs(ends[-1, 1] - starts[0, 1])
    vertices = np.concatenate([[(0.0, base)], joints, [(period, base)]])
    slack = np.concatenate([[base_slack], slack, [base_slack]])
    vertices = _snapped(vertices, slack, period, size)
    pieces = _pinned(pieces, vertices, size, "")
    _check_heights(pieces, vertices, size, "")
    limit = SNAP_TOLERANCE * size[1]
    level, near = _level(pieces, vertices, limit + slack)
    if np.any(vertices[near, 1] != level):
        vertices[near, 1] = level
        pieces = _pinned(pieces, vertices, size, "")
    return tuple(part for piece in counted(pieces, "piece", "wall") for part in _cut_at_touching(piece, level, limit))


def canonical_island(given: Sequence[Curve], period: float, size: Floats, index: int) -> Pieces:
    """Return the pieces of an island with exact joints, clockwise: the free side is on the left."""
    label = f" of island {index}"
    pieces = _curves(given, f"islands[{index}]")
    starts, ends = _end_points(pieces)
    rounding = np.array([p.rounding for p in pieces])
    following = np.roll(starts, -1, axis=0)
    joints, slack = _joints(following, ends, np.roll(rounding, -1), rounding, size, label)
    vertices = _snapped(joints, slack, period, size)
    vertices = np.concatenate([vertices[-1:], vertices])
    pieces = _pinned(pieces, vertices, size, label)
    _check_heights(pieces, vertices, size, label)
    if _signed_area(pieces, size) > 0.0:
        pieces = tuple(piece.reversed() for piece in reversed(pieces))
    return pieces


def check_open_wall(pieces: Pieces, islands: Sequence[Pieces], period: float, size: Floats) -> None:
    """Raise a WallError if a piece of a wall that does not close leaves 0 <= x <= period."""
    slack = SNAP_TOLERANCE * size[0]
    for owner, loop in [("", pieces), *((f" of island {k}", loop) for k, loop in enumerate(islands))]:
        for i, piece in enumerate(loop):
            xmin, _, xmax, _ = piece.box
            if xmin < -slack or xmax > period + slack:
                raise WallError(
                    f"piece {i}{owner} leaves the cell 0 <= x <= {period:g} (it spans {xmin:g} <= x <= {xmax:g}); "
                    "in a wall with islands the pieces of a cell must stay in it: "
                    "roll the cell, that is, start it at another joint, or cut the piece at the cell's side"
                )


def check_crossings(cell: Cell, given: Sequence[Pieces], origin: Point, numbers: Sequence[int]) -> None:
    """Raise a WallError if pieces of a cell cross; touching is allowed.

    Its path and islands as they were ``given``, with ``numbers`` of the pieces of the path, and ``origin`` are for the
    message: they do not decide, because a part of a curve may be too short to tell a cusp from a slit.
    """
    found = find_crossing(cell.pieces, cell.period, cell.depth, cell.islands, range(len(cell.pieces)))
    if found is None:
        return
    found = find_crossing(given[0], cell.period, cell.depth, given[1:], numbers) or found
    x, y = (found.point[0] + origin[0]) % cell.period, found.point[1] + origin[1]
    point = f"({x:.6g}, {y:.6g})"
    if found.is_slit:
        raise WallError(
            f"{found.labels[0]} and {found.labels[1]} run back on each other from {point} inside the solid: no ray "
            "comes into a gap of zero width; end the path where it turns back, or give the gap a width (a plate of "
            "zero thickness has free space on both sides)"
        )
    if len(found.labels) < 2:
        one = found.labels[0] if found.labels else "a piece"
        raise WallError(f"{one} crosses itself or the neighbouring period near {point}; pieces may touch, not cross")
    names = f"{', '.join(found.labels[:-1])} and {found.labels[-1]}"
    raise WallError(
        f"{names} cross (or leave the free side on the wrong side) near {point}; pieces may touch, not cross, "
        "and the free side must be on the left of the path"
    )


def wall_size(pieces: Pieces, period: float) -> Floats:
    """Return the width and the height to which tolerances are relative."""
    starts, ends = _end_points(pieces)
    return _size(starts, ends, period)


def _curves(given: Sequence[Curve], name: str) -> Pieces:
    try:
        pieces = tuple(given)
    except TypeError as reason:
        raise WallError(f"{name}: expected a sequence of curves, got {given!r}") from reason
    if not all(issubclass(kind, Curve) for kind in set(map(type, pieces))):
        i, piece = next((i, piece) for i, piece in enumerate(pieces) if not isinstance(piece, Curve))
        raise WallError(f"{name}[{i}]: expected a curve such as a Segment, an Arc or a Bezier, got {piece!r}")
    if not pieces:
        raise WallError(f"{name}: expected at least one piece, got none")
    return pieces


def _end_points(pieces: Pieces) -> tuple[Floats, Floats]:
    return point_array([p.start for p in pieces]), point_array([p.end for p in pieces])


def _size(starts: Floats, ends: Floats, period: float) -> Floats:
    x = np.concatenate([starts[:, 0], ends[:, 0]])
    y = np.concatenate([starts[:, 1], ends[:, 1]])
    return np.array([max(period, float(np.ptp(x))), max(period, float(np.abs(y).max()))])


def _check_left_and_right(starts: Floats, ends: Floats, rounding: Floats, period: float, size: Floats) -> None:
    last = len(starts) - 1
    if abs(starts[0, 0]) > JOIN_TOLERANCE * size[0] + rounding[0]:
        backwards = abs(starts[0, 0] - period) <= JOIN_TOLERANCE * size[0] and abs(ends[-1, 0]) < 0.5 * period
        advice = "the pieces run from right to left: reverse them" if backwards else "move the wall to x = 0"
        raise WallError(f"piece 0: expected the wall to start at x = 0, got {_coordinates(starts[0])}; {advice}")
    if abs(ends[-1, 0] - period) > JOIN_TOLERANCE * size[0] + rounding[-1]:
        raise WallError(
            f"piece {last}: expected the wall to end at x = period = {period:g}, got {_coordinates(ends[-1])}; "
            "pass the period or complete the path"
        )
    if abs(ends[-1, 1] - starts[0, 1]) > JOIN_TOLERANCE * size[1] + rounding[0] + rounding[-1]:
        raise WallError(
            f"pieces 0 and {last}: expected the wall to start and end at the same height, "
            f"got {_coordinates(starts[0])} and {_coordinates(ends[-1])}; close the step with a vertical segment"
        )


def _joints(
    following: Floats, ends: Floats, later_rounding: Floats, rounding: Floats, size: Floats, label: str
) -> tuple[Floats, Floats]:
    """Return the joints, each the more accurate of the two ends that meet, and bounds on their errors."""
    gaps = np.abs(following - ends)
    excess = gaps - JOIN_TOLERANCE * size - (later_rounding + rounding)[:, np.newaxis]
    if len(gaps) and excess.max() > 0.0:
        i = int(np.argmax(excess.max(axis=1)))
        j = i + 1 if not label else (i + 1) % len(ends)
        raise WallError(
            f"pieces {i} and {j}{label} do not join: piece {i} ends at {_coordinates(ends[i])}, "
            f"piece {j} starts at {_coordinates(following[i])}"
        )
    joints = np.where((later_rounding < rounding)[:, np.newaxis], following, ends)
    return joints, np.minimum(later_rounding, rounding) + gaps.max(axis=1, initial=0.0)


def _snapped(vertices: Floats, slack: Floats, period: float, size: Floats) -> Floats:
    vertices = vertices.copy()
    x, y = vertices[:, 0], vertices[:, 1]
    x[np.abs(x) <= SNAP_TOLERANCE * size[0] + slack] = 0.0
    x[np.abs(x - period) <= SNAP_TOLERANCE * size[0] + slack] = period
    y[np.abs(y) <= SNAP_TOLERANCE * size[1] + slack] = 0.0
    return vertices


def _pinned(pieces: Pieces, vertices: Floats, size: Floats, label: str) -> Pieces:
    """Set the end points of every piece to its vertices; pieces with these end points are returned unchanged."""
    starts, ends = _end_points(pieces)
    moved = np.any((starts != vertices[:-1]) | (ends != vertices[1:]), axis=1)
    moved |= np.array([piece.rounding for piece in pieces]) != 0.0
    closed = np.all(vertices[1:] == vertices[:-1], axis=1)
    shortest = 4.0 * JOIN_TOLERANCE * float(size.max())
    result = list(pieces)
    for i in np.flatnonzero(moved | closed).tolist():
        (x0, y0), (x1, y1) = vertices[i : i + 2].tolist()
        if closed[i] and pieces[i].length <= shortest:
            raise WallError(f"piece {i}{label} has no length: it starts and ends at {(x0, y0)}; leave it out")
        if moved[i]:
            result[i] = pieces[i].pinned((x0, y0), (x1, y1))
    return tuple(result)


def _check_heights(pieces: Pieces, vertices: Floats, size: Floats, label: str) -> None:
    excess = np.maximum(vertices[1:, 1], vertices[:-1, 1])
    for i, piece in enumerate(pieces):
        if not piece.is_straight:
            _, bottom, _, top = piece.box
            if bottom == top == 0.0:
                raise WallError(f"piece {i}{label}: expected a Segment where the wall runs along y = 0, got {piece}")
            # pinning moves the inside of a curve by up to the tolerance of its ends
            excess[i] = max(excess[i], top - JOIN_TOLERANCE * size[1])
    worst = int(np.argmax(excess))
    if excess[worst] > 0.0:
        points = pieces[worst].point([0.0, *pieces[worst].turning_points(1), 1.0])
        x, y = points[np.argmax(points[:, 1])]
        raise WallError(
            f"piece {worst}{label} rises to y = {y:.6g} at x = {x:.6g}: expected y <= 0; "
            "move the wall down so that its highest points touch y = 0"
        )


def _level(pieces: Pieces, vertices: Floats, slack: Floats) -> tuple[float, NDArray[np.bool_]]:
    """Return the greatest height of the path, at most 0, and a mask of the vertices at that height within slack."""
    tops = [y for piece in pieces if not piece.is_straight for y in piece.turning_values(1)]
    highest = min(max([float(vertices[:, 1].max()), *tops]), 0.0)
    near = vertices[:, 1] >= highest - slack
    # the height of a vertex, which was given, is preferred to that of a curve's top, which was computed
    return float(vertices[near, 1].max(initial=-np.inf)) if near.any() else highest, near


def _cut_at_touching(piece: Curve, level: float, limit: float) -> list[Curve]:
    """Cut a curved piece at its tops of greatest height, because hollows end there."""
    if piece.end < piece.start:
        # in one direction of the two, so that coincident faces stay coincident
        return [part.reversed() for part in reversed(_cut_at_touching(piece.reversed(), level, limit))]
    parts, rest, done = [], piece, 0.0
    for top in [] if piece.is_straight else piece.turning_points(1):
        x, y = (float(v) for v in piece.point(top))
        if TOUCH_MARGIN < top < 1.0 - TOUCH_MARGIN and y >= level - limit:
            before, rest = rest.split((top - done) / (1.0 - done))
            parts.append(before.pinned(before.start, (x, level)))
            rest, done = rest.pinned((x, level), piece.end), top
    return [*parts, rest]


def _signed_area(pieces: Pieces, size: Floats) -> float:
    """Return twice the area inside a closed path, positive if it runs counterclockwise."""
    p = np.concatenate([piece.flattened(1e-5 * float(size.max()))[:-1] for piece in pieces])
    p = p - p[0]
    q = np.roll(p, -1, axis=0)
    return float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]))


def _coordinates(point: Floats) -> str:
    return f"({point[0]:.10g}, {point[1]:.10g})"
