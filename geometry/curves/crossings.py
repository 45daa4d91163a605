"""Whether the pieces of a wall cross; touching, cusps and plates of zero thickness are allowed.

The wall over one period is closed by a path above y = 0 and the winding number of the closed path is taken on every
face that it cuts out of the plane. Around a crossing the winding number takes three consecutive values; around a
touching it takes two. So pieces cross if and only if some face has a winding number other than 0 and 1. Faces that
are thinner than the tolerance come from rounding and from flattening curves, and do not count.

A path that turns back along itself is a plate of zero thickness where free space lies beside it. Where none does it is
a slit of zero width in the solid: there is no free space on the left of the path, and no ray meets it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from .curve import Curve
from .segment import Segment

# Curves become polylines within this distance, in coordinates where the wall is 1 wide and 1 deep. Polylines of
# curves that only touch overlap by at most twice as much, and a face of thickness d has 2 area / perimeter <= d.
FLATTENING = 1e-5
CURVED_THICKNESS = 4.0 * FLATTENING

# Vertices of polygons are given and noding them rounds by a few eps, but joints may have been moved together by 1e-9
# (JOIN_TOLERANCE in conditions.py) on both sides of a touching.
STRAIGHT_THICKNESS = 4e-9

# Coordinates this close are the same, relative to the wall's size (SNAP_TOLERANCE in conditions.py).
SAME_POINT = 64.0 * EPS

# Pieces this close to a crossing are named in the message.
NEARBY = 1e-7

# A path turns back where its directions before and after a joint are opposite to this, and for segments if their ends
# are apart by no more than rounding of coordinates.
REVERSED = 1e-9
# Where on the shorter of two pieces that lie on each other it is asked whether free space is beside them.
ASKED = np.array([0.125, 0.5, 0.875])

# Edges times faces in one block of the winding count: 32 MB of booleans.
WINDING_BLOCK = 4_000_000


@dataclass(frozen=True)
class Crossing:
    """Where pieces cross, or make a slit: the point in the wall's coordinates and the labels of the pieces there."""

    point: tuple[float, float]
    labels: tuple[str, ...]
    is_slit: bool = False


@dataclass(frozen=True)
class _Turn:
    """Where a path turns back along itself: the point, the two pieces, and points beside both, left, then right."""

    point: tuple[float, float]
    pieces: tuple[int, int]
    beside: Floats


@dataclass(frozen=True)
class _Loop:
    """A closed polyline: points (n + 1, 2), and per edge the label's index (-1 for the closing path)."""

    points: Floats
    labels: NDArray[np.int64]


def find_crossing(
    pieces: Sequence[Curve],
    period: float,
    depth: float,
    islands: Sequence[Sequence[Curve]],
    numbers: Sequence[int],
) -> Crossing | None:
    """Return the worst crossing of the pieces of a canonical wall, which have these numbers, and its islands."""
    import shapely

    size = (period, depth if depth > 0.0 else period)
    labels = [f"piece {i}" for i in numbers]
    labels += [f"piece {i} of island {k}" for k, loop in enumerate(islands) for i in range(len(loop))]
    path = _flatten(pieces, size, 0)
    loops = [_close(path, _copies(path.points))]
    first = len(pieces)
    for island in islands:
        loops.append(_flatten(island, size, first))
        first += len(island)
    turns = _turns((pieces, *islands), size)
    if len(loops) == 1 and not turns and shapely.LinearRing(_without_repeats(loops[0].points)).is_simple:
        return None
    faces, thickness = _faces(loops)
    if not len(faces):
        return None
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    winding = np.sum([_winding_numbers(loop.points, inside) for loop in loops], axis=0)
    bad = (winding < 0) | (winding > 1)
    order = np.argsort(-thickness)
    straight = np.array([isinstance(p, Segment) for loop in (pieces, *islands) for p in loop])
    for i in order[bad[order]]:
        if thickness[i] > CURVED_THICKNESS or _is_among_segments(faces[i], loops, straight):
            return _describe(faces[i], loops, labels, size)
    for turn in turns:
        beside = np.sum([_winding_numbers(loop.points, turn.beside) for loop in loops], axis=0)
        if np.any(beside.reshape(2, -1).max(axis=0) < 1):
            return Crossing(turn.point, tuple(labels[k] for k in turn.pieces), True)
    return None


def _turns(paths: Sequence[Sequence[Curve]], size: tuple[float, float]) -> list[_Turn]:
    """Where paths turn back along themselves; the first path is open, the others are closed."""
    found, first = [], 0
    for number, path in enumerate(paths):
        into, out = _directions(path)
        follower = np.roll(out, -1, axis=0)
        across = into[:, 0] * follower[:, 1] - into[:, 1] * follower[:, 0]
        back = (np.sum(into * follower, axis=1) < 0.0) & (np.abs(across) <= REVERSED)
        back[-1] &= number > 0
        for k in np.flatnonzero(back).tolist():
            before, after = path[k], path[(k + 1) % len(path)]
            width = _coincidence(before, after, abs(float(across[k])), size)
            if width > 0.0:
                short = min((before, after), key=lambda piece: piece.length)
                points, along = short.point(ASKED) / size, short.tangent(ASKED) / size
                left = along[:, ::-1] * [-1.0, 1.0] / np.hypot(along[:, 0], along[:, 1])[:, np.newaxis]
                beside = np.concatenate([points + 2.0 * width * left, points - 2.0 * width * left])
                found.append(_Turn(before.end, (first + k, first + (k + 1) % len(path)), beside))
        first += len(path)
    return found


def _directions(path: Sequence[Curve]) -> tuple[Floats, Floats]:
    """The unit vectors in which every piece comes to its end, and in which it leaves its start."""
    chords = np.array([piece.end for piece in path]) - np.array([piece.start for piece in path])
    straight = np.array([isinstance(piece, Segment) for piece in path])
    chords[straight] /= np.hypot(chords[straight, 0], chords[straight, 1])[:, np.newaxis]
    into, out = chords, chords.copy()
    for k in np.flatnonzero(~straight).tolist():
        into[k], out[k] = path[k].tangent(1.0), path[k].tangent(0.0)
    return into, out


def _coincidence(before: Curve, after: Curve, across: float, size: tuple[float, float]) -> float:
    """How far apart two pieces may be that lie on each other from their joint on; 0 if they do not."""
    if isinstance(before, Segment) and isinstance(after, Segment):
        apart = across * min(before.length, after.length)
        return STRAIGHT_THICKNESS if apart <= SAME_POINT * max(size) else 0.0
    import shapely

    short, long = sorted((before, after), key=lambda piece: piece.length)
    outline = long.stretched(1.0 / size[0], 1.0 / size[1]).flattened(FLATTENING)
    middle = shapely.Point(short.point(0.5) / size)
    return CURVED_THICKNESS if shapely.LineString(outline).distance(middle) <= CURVED_THICKNESS else 0.0


def _without_repeats(points: Floats) -> Floats:
    """Drop points that equal the one before."""
    keep = np.ones(len(points), dtype=bool)
    keep[1:] = np.any(points[1:] != points[:-1], axis=1)
    return points[keep]


def _flatten(pieces: Sequence[Curve], size: tuple[float, float], first_label: int) -> _Loop:
    chunks, labels = [], []
    for i, piece in enumerate(pieces):
        if isinstance(piece, Segment):
            points = np.array([piece.start, piece.end]) / size
        else:
            points = piece.stretched(1.0 / size[0], 1.0 / size[1]).flattened(FLATTENING)
            points[0], points[-1] = np.array(piece.start) / size, np.array(piece.end) / size
        chunks.append(points[:-1])
        labels += [first_label + i] * (len(points) - 1)
    chunks.append(points[-1:])
    return _Loop(np.concatenate(chunks), np.array(labels, dtype=np.int64))


def _copies(points: Floats) -> int:
    """How many periods side by side hold every pair of pieces that can meet."""
    reach = max(-float(points[:, 0].min()), float(points[:, 0].max()) - 1.0)
    return 1 + 2 * (math.ceil(reach) if reach > STRAIGHT_THICKNESS else 0)


def _close(path: _Loop, copies: int) -> _Loop:
    """Lay copies side by side and close the path above: up on the right, leftward at y = 1, down on the left."""
    shifts = [path.points[:-1] + np.array([k, 0.0]) for k in range(copies)]
    roof = np.array([(copies, path.points[-1, 1]), (copies, 1.0), (0.0, 1.0), path.points[0]])
    labels = np.concatenate([np.tile(path.labels, copies), np.full(3, -1, dtype=np.int64)])
    return _Loop(np.concatenate([*shifts, roof]), labels)


def _faces(loops: Sequence[_Loop]) -> tuple[NDArray[np.object_], Floats]:
    import shapely

    lines = [shapely.LineString(loop.points) for loop in loops]
    noded = shapely.get_parts(shapely.unary_union(lines))
    faces = shapely.get_parts(shapely.polygonize(noded))
    thickness = 2.0 * shapely.area(faces) / shapely.length(faces)
    keep = thickness > STRAIGHT_THICKNESS
    return faces[keep], thickness[keep]


def _winding_numbers(points: Floats, points_tested: Floats) -> NDArray[np.int64]:
    """Count how often the closed polyline winds around each point, counterclockwise."""
    start, end = points[:-1], points[1:]
    winding = np.zeros(len(points_tested), dtype=np.int64)
    block = max(1, WINDING_BLOCK // len(start))
    for low in range(0, len(points_tested), block):
        x, y = points_tested[low : low + block, 0, np.newaxis], points_tested[low : low + block, 1, np.newaxis]
        up = (start[:, 1] <= y) & (end[:, 1] > y)
        down = (start[:, 1] > y) & (end[:, 1] <= y)
        side = (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (x - start[:, 0]) * (end[:, 1] - start[:, 1])
        winding[low : low + block] = np.sum(up & (side > 0.0), axis=1) - np.sum(down & (side < 0.0), axis=1)
    return winding


def _is_among_segments(face: object, loops: Sequence[_Loop], straight: NDArray[np.bool_]) -> bool:
    """Whether no curved piece comes near the face, so that flattening cannot have made it."""
    import shapely

    for loop in loops:
        edges = shapely.linestrings(np.stack([loop.points[:-1], loop.points[1:]], axis=1))
        curved = (loop.labels >= 0) & ~straight[loop.labels]
        if curved.any() and shapely.dwithin(edges[curved], face, CURVED_THICKNESS).any():
            return False
    return True


def _describe(face: object, loops: Sequence[_Loop], labels: Sequence[str], size: tuple[float, float]) -> Crossing:
    """Find the corner of the face where most pieces meet, and name them."""
    import shapely

    edges = np.concatenate([np.stack([loop.points[:-1], loop.points[1:]], axis=1) for loop in loops])
    owner = np.concatenate([loop.labels for loop in loops])
    corners = shapely.get_coordinates(shapely.get_exterior_ring(face))[:-1]
    tree = shapely.STRtree(shapely.linestrings(edges))
    corner_index, edge_index = tree.query(shapely.points(corners), predicate="dwithin", distance=NEARBY)
    most = int(np.argmax(np.bincount(corner_index, minlength=len(corners))))
    meeting = np.unique(owner[edge_index[corner_index == most]])
    x, y = (float(v) for v in corners[most] * size)
    point = (x if 0.0 <= x <= size[0] else x % size[0], y)
    return Crossing(point, tuple(labels[k] for k in meeting if k >= 0))
