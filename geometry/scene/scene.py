"""The tables of a wall for the compiled loops: the pieces that a ray can meet, hollow by hollow.

Flat tops have no place in the tables, and a table of a primitive that the wall does not have is None.

Columns. ``hollows``: left, right, size, first joint, joint after the last, then the ranges in ``circles``, ``ellipses``
and ``beziers`` (two columns each), then the kind of edge at the left and at the right end (0 none, 1 smooth, 2 corner),
then the frame of the grid over the lines of a hollow that has many: lower left corner (2), size of a cell (2), columns
(0: no grid), rows, place in ``grid``. ``grid`` (integers): see `grid.grid_of`.
``joints``: x, y, 1 if a corner, 1 if a segment starts here. ``lines`` (a row a joint): edge vector, left unit normal,
length, range of its rows in ``pairs``. ``pairs`` (a row for each line of a pair that faces another with nothing in
between): the partner, the ends of the part that faces it, first the one towards the apex (4), unit vector towards the
apex, gap at that end, sine of the angle between the lines, that angle. ``circles`` and ``ellipses``: first joint (2),
unit normal there (2), curvature, chord direction (2), chord length (0 beyond a half angle of pi/4), two unused, sine
below which a run of hops is skipped (0 never), span, stretch, both joints (4), corner flags (2); all in coordinates
whose y is multiplied by the stretch, but for the joints.
``beziers``: coefficients of 1, s, s^2, s^3 (x and y each), both joints (4), corner flags (2).
``closed``: a row for each hollow, see `closed_forms`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, cos, hypot, pi, sin

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..cells.cell import Cell
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.curve import Curve, Point
from ..curves.segment import Segment
from .closed_forms import NONE, closed_row, closed_table
from .facing import facing_pairs

# Tangents that agree to this angle make a smooth joint: a ray at the joint is then reflected alike by both pieces, up
# to this angle. Joints of arcs and splines that are meant to be smooth agree to a few rounding errors.
SMOOTH_JOINT = 1e-9
# Below this half angle the chord and the radius give it more exactly than the difference of two parameters does.
SHALLOW_ARC = 0.5
# An arc of more than this span is cut in two, so that the side of its chord decides what belongs to it.
LONGEST_ARC = 1.5 * pi
# A run along an arc is worth its two arctangents and one sincos where it has at least this many hops.
RUN_HOPS = 8.0
OUTLINE_POINTS = 64
# A grid pays from about so many lines a hollow: at 256 it was a third faster on a Koch curve; the place was not tuned.
GRID_LINES = 96


def hull_of(piece: Curve, start: Point, end: Point) -> list[Point]:
    """Four points whose convex hull contains the piece."""
    if isinstance(piece, Segment):
        return [start, end, start, end]
    if isinstance(piece, Bezier):
        return [start, *list(piece.control_points[1:-1])[:2], *[end] * (5 - len(piece.control_points))]
    x0, y0, x1, y1 = piece.box
    return [(x0, y0), (x0, y1), (x1, y0), (x1, y1)]


def corners_of(pieces: list[Curve]) -> list[bool]:
    """For every joint of the cycle of pieces (the first one again at the end): is it a corner?"""
    heads = np.array([_tangent(piece, 0.0) for piece in pieces])
    tails = np.roll(np.array([_tangent(piece, 1.0) for piece in pieces]), 1, axis=0)
    turn = np.abs(tails[:, 0] * heads[:, 1] - tails[:, 1] * heads[:, 0])
    corner = (turn > SMOOTH_JOINT) | (np.sum(tails * heads, axis=1) < 0.0)
    return [*map(bool, corner), bool(corner[0])]


def _tangent(piece: Curve, s: float) -> Point:
    if isinstance(piece, Segment):
        dx, dy = piece.end[0] - piece.start[0], piece.end[1] - piece.start[1]
        length = hypot(dx, dy)
        return dx / length, dy / length
    x, y = piece.tangent(s)
    return float(x), float(y)


def arc_row(arc: Arc, start: Point, end: Point) -> list[float]:
    """One row of ``circles`` or ``ellipses`` but for its flags."""
    a, b = arc.semi_axes
    stretch = a / b
    turn = arc.end_angle - arc.start_angle
    # anticlockwise arcs have their centre on the left, the free side: they focus
    sign = 1.0 if turn > 0.0 else -1.0
    chord = (end[0] - start[0], stretch * (end[1] - start[1]))
    length = hypot(*chord)
    direction = (chord[0] / length, chord[1] / length)
    half = 0.5 * abs(turn)
    # both joints lie on the circle exactly if sin(half) = kappa length / 2; the better known side gives the other
    if half < SHALLOW_ARC:
        half = asin(min(1.0, 0.5 * length / a))
        curvature = sign / a
    else:
        curvature = sign * 2.0 * sin(half) / length
    normal = (
        sign * sin(half) * direction[0] - cos(half) * direction[1],
        sign * sin(half) * direction[1] + cos(half) * direction[0],
    )
    short = length if half <= 0.25 * pi else 0.0
    row = [start[0], start[1], *normal, curvature, *direction, short, 0.0, 0.0, 0.0, 2.0 * half, stretch]
    return [*row, *start, *end]


def bezier_row(curve: Bezier, start: Point, end: Point) -> list[float]:
    """One row of ``beziers`` but for its flags."""
    inner = list(curve.control_points[1:-1])
    points = np.array([start, *inner, end], dtype=np.float64)
    if len(points) == 3:
        a0, a1, a2 = points[0], 2.0 * (points[1] - points[0]), points[0] - 2.0 * points[1] + points[2]
        a3 = np.zeros(2)
    else:
        a0, a1 = points[0], 3.0 * (points[1] - points[0])
        a2 = 3.0 * (points[0] - 2.0 * points[1] + points[2])
        a3 = points[3] - points[0] + 3.0 * (points[1] - points[2])
    return [*a0, *a1, *a2, *a3, *start, *end]


@dataclass(frozen=True)
class Scene:
    """The tables of one wall; see the head of this file."""

    hollows: Floats
    joints: Floats
    lines: Floats | None
    circles: Floats | None
    ellipses: Floats | None
    beziers: Floats | None
    pairs: Floats | None
    grid: NDArray[np.int64] | None
    cell: float
    is_open: bool
    closed: Floats | None = None

    @property
    def primitives(self) -> tuple[str, ...]:
        """Names of the primitives that the loop is compiled for."""
        return tuple(name for name in ("lines", "circles", "ellipses", "beziers") if getattr(self, name) is not None)


def scene_of(wall: Cell) -> Scene:
    """Build the tables of a wall."""
    tables = _Tables()
    places = [(float(x), float(y)) for x, y in wall.vertices]
    corners = corners_of(list(wall.pieces))
    if wall.closes:
        for hollow in wall.hollows:
            chain = _Chain(
                list(wall.pieces[hollow.first : hollow.last]),
                places[hollow.first : hollow.last + 1],
                corners[hollow.first : hollow.last + 1],
            )
            tables.add_hollow(hollow.left, hollow.right, [chain], edges=(1 + chain.corners[0], 1 + chain.corners[-1]))
    else:
        chains = [_Chain(list(wall.pieces), places, corners)]
        for island, island_places in zip(wall.islands, wall.island_vertices, strict=True):
            loop = [(float(x), float(y)) for x, y in island_places]
            chains.append(_Chain(list(island), loop, corners_of(list(island))))
        tables.add_hollow(0.0, wall.period, chains, edges=(0, 0))
    return tables.scene(wall.period, not wall.closes)


def scene_in_one(wall: Cell) -> Scene:
    """The tables of a wall that closes as if its cell were one hollow: one list of all pieces, the flat tops too."""
    tables = _Tables()
    places = [(float(x), float(y)) for x, y in wall.vertices]
    chain = _Chain(list(wall.pieces), places, corners_of(list(wall.pieces)))
    tables.add_hollow(0.0, wall.period, [chain], edges=(2, 2))
    return tables.scene(wall.period, False)


@dataclass
class _Chain:
    """Connected pieces with their joints; ``places`` and ``corners`` have one entry more than ``pieces``."""

    pieces: list[Curve]
    places: list[Point]
    corners: list[bool]

    def without_long_arcs(self) -> _Chain:
        """The same chain with every arc of more than LONGEST_ARC cut in two at a smooth joint."""
        pieces: list[Curve] = []
        places, corners = [self.places[0]], [self.corners[0]]
        for piece, place, corner in zip(self.pieces, self.places[1:], self.corners[1:], strict=True):
            if isinstance(piece, Arc) and abs(piece.end_angle - piece.start_angle) > LONGEST_ARC:
                middle = 0.5 * (piece.start_angle + piece.end_angle)
                first = Arc(piece.center, piece.semi_axes, piece.start_angle, middle)
                pieces += [first, Arc(piece.center, piece.semi_axes, middle, piece.end_angle)]
                places += [first.end, place]
                corners += [False, corner]
            else:
                pieces.append(piece)
                places.append(place)
                corners.append(corner)
        return _Chain(pieces, places, corners)


class _Tables:
    """The tables while they grow."""

    def __init__(self) -> None:
        self.hollows: list[list[float]] = []
        self.joints: list[list[float]] = []
        self.lines: list[list[float]] = []
        self.circles: list[list[float]] = []
        self.ellipses: list[list[float]] = []
        self.beziers: list[list[float]] = []
        self.pairs: list[list[float]] = []
        self.grids: list[NDArray[np.int64]] = []
        self.closed: list[list[float]] = []

    def add_hollow(self, left: float, right: float, chains: list[_Chain], edges: tuple[int, int]) -> None:
        """Append one hollow, or the whole cell of an open wall."""
        is_closed = len(chains) == 1 and edges != (0, 0)
        chains = [chain.without_long_arcs() for chain in chains]
        before = self._sizes()
        for chain in chains:
            self._add_chain(chain)
        after = self._sizes()
        joints = np.array([place for chain in chains for place in chain.places])
        size = float(np.max(np.ptp(joints, axis=0))) if len(joints) else right - left
        size = max(size, right - left)
        ranges = [value for pair in zip(before, after, strict=True) for value in pair]
        self.hollows.append([left, right, size, *map(float, ranges), *map(float, edges), *[0.0] * 7])
        self._mark_runs(before[1], after[1], chains)
        inside = bool(np.all((left <= joints[:, 0]) & (joints[:, 0] <= right)))
        if inside or edges != (0, 0):
            self._mark_pairs(before[0], chains, size)
        self._add_grid(before[0])
        self.closed.append(closed_row(chains[0].pieces, chains[0].places, size) if is_closed else [NONE])

    def _sizes(self) -> tuple[int, int, int, int]:
        return len(self.joints), len(self.circles), len(self.ellipses), len(self.beziers)

    def _add_chain(self, chain: _Chain) -> None:
        for i, piece in enumerate(chain.pieces):
            start, end = chain.places[i], chain.places[i + 1]
            flags = [float(chain.corners[i]), float(chain.corners[i + 1])]
            is_line = isinstance(piece, Segment)
            self.joints.append([*start, flags[0], float(is_line)])
            edge = (end[0] - start[0], end[1] - start[1])
            length = hypot(*edge)
            self.lines.append([*edge, -edge[1] / length, edge[0] / length, length, 0.0, 0.0] if is_line else [0.0] * 7)
            if isinstance(piece, Arc):
                (self.circles if piece.is_circular else self.ellipses).append(arc_row(piece, start, end) + flags)
            elif isinstance(piece, Bezier):
                self.beziers.append(bezier_row(piece, start, end) + flags)
        self.joints.append([*chain.places[-1], float(chain.corners[-1]), 0.0])
        self.lines.append([0.0] * 7)

    def _mark_runs(self, first: int, last: int, chains: list[_Chain]) -> None:
        """Allow runs on the focusing circles whose circular segment no other piece of the hollow enters."""
        outlines = [
            np.array([place]) if isinstance(piece, Segment) else piece.point(np.linspace(0.0, 1.0, OUTLINE_POINTS))
            for chain in chains
            for piece, place in zip(chain.pieces, chain.places, strict=False)
        ]
        ends = [np.array([chain.places[-1]]) for chain in chains]
        points = np.concatenate(outlines + ends)
        for row in self.circles[first:last]:
            half = 0.5 * row[11]
            own = abs(np.hypot(points[:, 0] - row[0] - row[2] / row[4], points[:, 1] - row[1] - row[3] / row[4]))
            height = (points[:, 1] - row[1]) * row[5] - (points[:, 0] - row[0]) * row[6]
            slack = 1e-12 * self.hollows[-1][2]
            foreign = (height < -slack) & (np.abs(own - 1.0 / abs(row[4])) > slack)
            if row[4] > 0.0 and half <= 0.5 * pi + SMOOTH_JOINT and not foreign.any():
                row[10] = sin(half / RUN_HOPS)

    def _add_grid(self, first: int) -> None:
        """Lay a grid over the lines of the last hollow, which start at the joint ``first``, if they are many."""
        joints = np.array(self.joints[first:], dtype=np.float64)
        is_line = joints[:, 3] > 0.0
        if is_line.sum() < GRID_LINES:
            return
        from .grid import grid_of

        ends = np.roll(joints[:, :2], -1, axis=0)
        ends[~is_line] = joints[~is_line, :2]
        frame, table = grid_of(np.ascontiguousarray(joints[:, :2]), ends, first, sum(map(len, self.grids)))
        self.hollows[-1][-7:] = frame
        self.grids.append(table)

    def _mark_pairs(self, first: int, chains: list[_Chain], size: float) -> None:
        """Find the channels and wedges of a hollow; its lines start at the joint ``first``."""
        numbers, starts, ends, hulls = [], [], [], []
        joint = first
        for chain in chains:
            for piece, start, end in zip(chain.pieces, chain.places, chain.places[1:], strict=False):
                if isinstance(piece, Segment):
                    numbers.append(joint)
                    starts.append(start)
                    ends.append(end)
                hulls.append(hull_of(piece, start, end))
                joint += 1
            joint += 1
        rows = facing_pairs(
            np.array(numbers, dtype=np.int64),
            np.array(starts, dtype=np.float64).reshape(-1, 2),
            np.array(ends, dtype=np.float64).reshape(-1, 2),
            np.array(hulls, dtype=np.float64).reshape(-1, 4, 2),
            size,
        )
        for line, row in sorted(rows):
            if self.lines[line][6] == 0.0:
                self.lines[line][5] = self.lines[line][6] = float(len(self.pairs))
            self.pairs.append(row)
            self.lines[line][6] += 1.0

    def scene(self, cell: float, is_open: bool) -> Scene:
        joints = np.array(self.joints, dtype=np.float64).reshape(-1, 4)
        lines = np.array(self.lines, dtype=np.float64).reshape(-1, 7)
        return Scene(
            hollows=np.array(self.hollows, dtype=np.float64).reshape(-1, 20),
            joints=joints,
            lines=lines if joints[:, 3].any() else None,
            circles=_table(self.circles),
            ellipses=_table(self.ellipses),
            beziers=_table(self.beziers),
            pairs=_table(self.pairs),
            grid=np.concatenate(self.grids) if self.grids else None,
            cell=cell,
            is_open=is_open,
            closed=closed_table(self.closed),
        )


def _table(rows: list[list[float]]) -> Floats | None:
    return np.array(rows, dtype=np.float64) if rows else None
