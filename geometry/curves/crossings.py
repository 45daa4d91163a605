"""Test whether the pieces of a wall cross; touching, cusps and plates of zero thickness are allowed.

A path above y = 0 closes the wall over one period. The closed path divides the plane into faces, each with a winding
number. Around a crossing the winding number takes three consecutive values, around a touching point two. So pieces
cross if and only if some face has a winding number other than 0 and 1. Faces thinner than the tolerance come from
rounding and from flattening curves; they are ignored.

A path that turns back along itself is a plate of zero thickness if free space lies beside it. Otherwise it is a slit
of zero width in the solid: no free space lies on the left of the path, and no ray meets the slit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import WallError
from ...core.rounding import EPS
from .curve import Curve, point_array

# Tolerance of the polylines that replace curves, in coordinates where the wall is 1 wide and 1 deep. Polylines of
# curves that only touch overlap by at most twice the tolerance; a face of thickness d has 2 area / perimeter <= d.
FLATTENING = 1e-5
CURVED_THICKNESS = 4.0 * FLATTENING

# Thickness up to which a face between segments is ignored. Noding rounds by a few eps only, but on both sides of a
# touching point joints may have been moved by 1e-9 (JOIN_TOLERANCE in cells/validity.py).
STRAIGHT_THICKNESS = 4e-9

# Distance up to which coordinates are equal, relative to the wall's size (SNAP_TOLERANCE in cells/validity.py).
SAME_POINT = 64.0 * EPS

# Distance from a crossing up to which a piece is named in the message.
NEARBY = 1e-7

# Sine of the angle up to which the directions before and after a joint are opposite, so that the path turns back. Two
# segments must also be no further apart than the rounding of coordinates.
REVERSED = 1e-9
# Parameters on the shorter of two coinciding pieces at which free space beside them is tested.
ASKED = np.array([0.125, 0.5, 0.875])

# Copies are tried in these numbers: 3, 9, 27, ...
FEW = 3
# Overlapping pairs of edges beyond which the test for crossings would take more than some seconds.
MOST_PAIRS = 2e8

# Edges times faces in one block of winding numbers: the largest temporary array has 32 MB.
WINDING_BLOCK = 4_000_000


@dataclass(frozen=True)
class Crossing:
    """A crossing or a slit: its point in the coordinates of the wall and the labels of the pieces there."""

    point: tuple[float, float]
    labels: tuple[str, ...]
    is_slit: bool = False


@dataclass(frozen=True)
class _Loop:
    """A closed polyline: points, shape (n + 1, 2), and the label index of each edge (-1 on the closing path)."""

    points: Floats
    labels: NDArray[np.int64]


def find_crossing(
    pieces: Sequence[Curve],
    period: float,
    depth: float,
    islands: Sequence[Sequence[Curve]],
    numbers: Sequence[int],
) -> Crossing | None:
    """Return the crossing with the thickest face, else a slit, else None; ``numbers`` label the pieces of the wall."""
    import shapely

    size = (period, depth if depth > 0.0 else period)
    labels = [f"piece {i}" for i in numbers]
    labels += [f"piece {i} of island {k}" for k, loop in enumerate(islands) for i in range(len(loop))]
    path = _flatten(pieces, size, 0)
    copies = _copies(path.points)
    loops = [_close(path, copies)]
    first = len(pieces)
    for island in islands:
        loops.append(_flatten(island, size, first))
        first += len(island)
    turns = _turns((pieces, *islands), labels, size)
    if len(loops) == 1 and not turns and shapely.LinearRing(_without_repeats(loops[0].points)).is_simple:
        return None
    straight = np.concatenate([straight_in(loop) for loop in (pieces, *islands)])
    # a crossing among few periods is one among all, and costs less to find: crossings grow like the square of copies
    for few in [*itertools.takewhile(lambda n: n < copies, (FEW**k for k in itertools.count(1))), copies]:
        some = [_close(path, few), *loops[1:]]
        face = _worst_face(some, straight)
        if face is not None:
            return _describe(face, some, labels, size)
    for slit, beside in turns:
        winding = np.sum([_winding_numbers(loop.points, beside) for loop in loops], axis=0)
        if np.any(winding.reshape(2, -1).max(axis=0) < 1):
            return slit
    return None


def _worst_face(loops: Sequence[_Loop], straight: NDArray[np.bool_]) -> object | None:
    """The thickest face with a winding number other than 0 and 1; None if there is none."""
    import shapely

    faces, thickness = _faces(loops)
    if not len(faces):
        return None
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    winding = np.sum([_winding_numbers(loop.points, inside) for loop in loops], axis=0)
    bad = (winding < 0) | (winding > 1)
    order = np.argsort(-thickness)
    for i in order[bad[order]]:
        if thickness[i] > CURVED_THICKNESS or _is_among_segments(faces[i], loops, straight):
            face: object = faces[i]
            return face
    return None


def _turns(
    paths: Sequence[Sequence[Curve]], labels: Sequence[str], size: tuple[float, float]
) -> list[tuple[Crossing, Floats]]:
    """Return the joints at which paths turn back along themselves, as slits; the first path is open, others are closed.

    Each with points on the left of the two pieces, then on their right.
    """
    found, first = [], 0
    for number, path in enumerate(paths):
        into, out = directions_of(path)
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
                names = labels[first + k], labels[first + (k + 1) % len(path)]
                found.append((Crossing(before.end, names, is_slit=True), beside))
        first += len(path)
    return found


def directions_of(path: Sequence[Curve]) -> tuple[Floats, Floats]:
    """Return the unit tangents of every piece at its end and at its start."""
    chords = np.diff(point_array([*[piece.start for piece in path], path[-1].end]), axis=0)
    straight = straight_in(path)
    chords[straight] /= np.hypot(chords[straight, 0], chords[straight, 1])[:, np.newaxis]
    into, out = chords, chords.copy()
    for k in np.flatnonzero(~straight).tolist():
        into[k], out[k] = path[k].tangent(1.0), path[k].tangent(0.0)
    return into, out


def straight_in(path: Sequence[Curve]) -> NDArray[np.bool_]:
    """Return whether each piece is a segment."""
    return np.array([piece.is_straight for piece in path])


def _coincidence(before: Curve, after: Curve, across: float, size: tuple[float, float]) -> float:
    """Return the tolerance within which two pieces coincide from their joint on; 0 if they do not coincide."""
    if before.is_straight and after.is_straight:
        apart = across * min(before.length, after.length)
        return STRAIGHT_THICKNESS if apart <= SAME_POINT * max(size) else 0.0
    import shapely

    short, long = sorted((before, after), key=lambda piece: piece.length)
    outline = long.stretched(1.0 / size[0], 1.0 / size[1]).flattened(FLATTENING)
    middle = shapely.Point(short.point(0.5) / size)
    return CURVED_THICKNESS if shapely.LineString(outline).distance(middle) <= CURVED_THICKNESS else 0.0


def _without_repeats(points: Floats) -> Floats:
    """Drop points equal to their predecessor."""
    keep = np.ones(len(points), dtype=bool)
    keep[1:] = np.any(points[1:] != points[:-1], axis=1)
    return points[keep]


def _flatten(pieces: Sequence[Curve], size: tuple[float, float], first_label: int) -> _Loop:
    if straight_in(pieces).all():
        points = point_array([*[piece.start for piece in pieces], pieces[-1].end]) / size
        return _Loop(points, np.arange(first_label, first_label + len(pieces)))
    chunks, labels = [], []
    for i, piece in enumerate(pieces):
        if piece.is_straight:
            points = np.array([piece.start, piece.end]) / size
        else:
            points = piece.stretched(1.0 / size[0], 1.0 / size[1]).flattened(FLATTENING)
            points[0], points[-1] = np.array(piece.start) / size, np.array(piece.end) / size
        chunks.append(points[:-1])
        labels += [first_label + i] * (len(points) - 1)
    chunks.append(points[-1:])
    return _Loop(np.concatenate(chunks), np.array(labels, dtype=np.int64))


def _copies(points: Floats) -> int:
    """Return the number of adjacent periods that contains every pair of pieces that can meet."""
    reach = max(-float(points[:, 0].min()), float(points[:, 0].max()) - 1.0)
    if reach <= STRAIGHT_THICKNESS:
        return 1
    # of so many pairs of edges, in all copies, the extents along x overlap
    pairs = (1.0 + 2.0 * reach) * len(points) * float(np.abs(np.diff(points[:, 0])).sum())
    if pairs > MOST_PAIRS:
        raise WallError(
            f"the pieces reach {reach:.3g} periods beyond the cell, too far to check that none of them cross; "
            "give the period of the whole wall, or shorten its overhangs"
        )
    return 1 + 2 * math.ceil(reach)


def _close(path: _Loop, copies: int) -> _Loop:
    """Repeat the path ``copies`` times and close it above: up on the right, leftward at y = 1, down on the left."""
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
    """Return the counterclockwise winding number of the closed polyline around each point."""
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
    """Whether no curved piece is near the face; flattening then cannot have produced the face."""
    import shapely

    for loop in loops:
        edges = shapely.linestrings(np.stack([loop.points[:-1], loop.points[1:]], axis=1))
        curved = (loop.labels >= 0) & ~straight[loop.labels]
        if curved.any() and shapely.dwithin(edges[curved], face, CURVED_THICKNESS).any():
            return False
    return True


def _describe(face: object, loops: Sequence[_Loop], labels: Sequence[str], size: tuple[float, float]) -> Crossing:
    """Return the corner of the face at which most edges meet, with the labels of their pieces."""
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
