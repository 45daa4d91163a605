"""The tables of a wall for the compiled functions: the pieces that a ray can meet, hollow by hollow.

Flat tops are not in the tables. The table of a primitive that the wall does not have is None. `columns` names the
columns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import asin, cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..cells.cell import Cell
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.curve import Curve, Point
from ..curves.segment import Segment
from .closed_forms import closed_form_of, closed_table
from .columns import (
    ARC_COLUMNS,
    BEZIER_COLUMNS,
    BEZIERS_END,
    CELL_HEIGHT,
    CELL_WIDTH,
    CHORD_X,
    CHORD_Y,
    CIRCLES_END,
    CORNER_EDGE,
    CURVATURE,
    EDGE_X,
    EDGE_Y,
    ELLIPSES_END,
    END_CORNER,
    END_X,
    END_Y,
    FIRST_BEZIER,
    FIRST_CIRCLE,
    FIRST_ELLIPSE,
    FIRST_JOINT,
    FIRST_PAIR,
    FORM,
    FORM_COLUMNS,
    GRID_COLUMNS,
    GRID_ROWS,
    GRID_START,
    GRID_X,
    GRID_Y,
    HOLLOW_COLUMNS,
    IS_CORNER,
    JOINT_COLUMNS,
    JOINT_X,
    JOINT_Y,
    JOINTS_END,
    LEFT,
    LEFT_EDGE,
    LENGTH,
    LINE_COLUMNS,
    LINE_NORMAL_X,
    LINE_NORMAL_Y,
    NO_EDGE,
    NO_FORM,
    NORMAL_X,
    NORMAL_Y,
    PAIR_COLUMNS,
    PAIRS_END,
    RIGHT,
    RIGHT_EDGE,
    RUN_SINE,
    SHORT_CHORD,
    SIZE,
    SMOOTH_EDGE,
    SPAN,
    START_CORNER,
    START_X,
    START_Y,
    STARTS_LINE,
    STRETCH,
    X1,
    X2,
    X3,
    Y1,
    Y2,
    Y3,
    row_of,
    table_of,
)
from .facing import facing_pairs

# Largest angle, radians, between the tangents at a smooth joint. Both pieces then reflect a ray at the joint alike,
# within twice this angle. Tangents at joints meant to be smooth agree to a few rounding errors.
SMOOTH_JOINT = 1e-9
# Half angle below which it is computed from the chord and the radius, more exactly than from two parameters.
SHALLOW_ARC = 0.5
# Largest span of an arc; longer arcs are cut in two, so that the side of the chord decides which points are on the arc.
LONGEST_ARC = 1.5 * pi
# Number of chords from which on a run along an arc pays for its two arctangents and one sincos.
RUN_CHORDS = 8.0
OUTLINE_POINTS = 64
# Number of lines in a hollow from which on it has a grid; not tuned (at 256 lines a grid saves a third of the time).
GRID_LINES = 96


def hull_of(piece: Curve, start: Point, end: Point) -> list[Point]:
    """Return four points whose convex hull contains the piece."""
    if isinstance(piece, Segment):
        return [start, end, start, end]
    if isinstance(piece, Bezier):
        return [start, *list(piece.control_points[1:-1])[:2], *[end] * (5 - len(piece.control_points))]
    x0, y0, x1, y1 = piece.box
    return [(x0, y0), (x0, y1), (x1, y0), (x1, y1)]


def corners_of(pieces: list[Curve]) -> list[bool]:
    """Return whether each joint of the cycle of pieces is a corner; the first joint is repeated at the end."""
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


def line_row(start: Point, end: Point) -> Floats:
    """Return a row of ``lines``; the columns of its pairs are set later."""
    x, y = end[0] - start[0], end[1] - start[1]
    length = hypot(x, y)
    row = {EDGE_X: x, EDGE_Y: y, LINE_NORMAL_X: -y / length, LINE_NORMAL_Y: x / length, LENGTH: length}
    return row_of(LINE_COLUMNS, row)


def arc_row(arc: Arc, ends: Mapping[int, float]) -> Floats:
    """Return a row of ``circles`` or ``ellipses`` from its first columns ``ends``; RUN_SINE is set later."""
    a, b = arc.semi_axes
    stretch = a / b
    turn = arc.end_angle - arc.start_angle
    # counterclockwise arcs have their centre on the left, the free side: they are focusing
    sign = 1.0 if turn > 0.0 else -1.0
    chord = (ends[END_X] - ends[START_X], stretch * (ends[END_Y] - ends[START_Y]))
    length = hypot(*chord)
    direction = (chord[0] / length, chord[1] / length)
    half = 0.5 * abs(turn)
    # sin(half) = kappa length / 2 puts both joints on the circle: the more accurate of half and kappa gives the other
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
    columns = {
        NORMAL_X: normal[0], NORMAL_Y: normal[1], CURVATURE: curvature, CHORD_X: direction[0], CHORD_Y: direction[1],
        SHORT_CHORD: short, SPAN: 2.0 * half, STRETCH: stretch,
    }  # fmt: skip
    return row_of(ARC_COLUMNS, {**ends, **columns})


def bezier_row(curve: Bezier, ends: Mapping[int, float]) -> Floats:
    """Return a row of ``beziers`` from its first columns ``ends``."""
    inner = list(curve.control_points[1:-1])
    start, end = (ends[START_X], ends[START_Y]), (ends[END_X], ends[END_Y])
    points = np.array([start, *inner, end], dtype=np.float64)
    if len(points) == 3:
        a1, a2 = 2.0 * (points[1] - points[0]), points[0] - 2.0 * points[1] + points[2]
        a3 = np.zeros(2)
    else:
        a1 = 3.0 * (points[1] - points[0])
        a2 = 3.0 * (points[0] - 2.0 * points[1] + points[2])
        a3 = points[3] - points[0] + 3.0 * (points[1] - points[2])
    columns = {X1: a1[0], Y1: a1[1], X2: a2[0], Y2: a2[1], X3: a3[0], Y3: a3[1]}
    return row_of(BEZIER_COLUMNS, {**ends, **columns})


class Tables(NamedTuple):
    """The tables of a scene as arguments of compiled functions; tables of absent primitives are empty."""

    hollows: Floats
    joints: Floats
    lines: Floats
    circles: Floats
    ellipses: Floats
    beziers: Floats
    pairs: Floats
    grid: NDArray[np.int64]
    cell: float
    is_open: bool


# Empty tables, with the types of all tables.
NO_TABLES = Tables(
    np.empty((0, HOLLOW_COLUMNS)),
    np.empty((0, JOINT_COLUMNS)),
    np.empty((0, LINE_COLUMNS)),
    np.empty((0, ARC_COLUMNS)),
    np.empty((0, ARC_COLUMNS)),
    np.empty((0, BEZIER_COLUMNS)),
    np.empty((0, PAIR_COLUMNS)),
    np.empty(0, np.int64),
    1.0,
    False,
)


@dataclass(frozen=True)
class Scene:
    """The tables of one wall; see the docstring of this module."""

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

    @cached_property
    def tables(self) -> Tables:
        """The tables with types equal for all walls, so that each function is compiled once."""
        return Tables(
            hollows=_filled(self.hollows, HOLLOW_COLUMNS),
            joints=_filled(self.joints, JOINT_COLUMNS),
            lines=np.zeros((len(self.joints), LINE_COLUMNS))
            if self.lines is None
            else _filled(self.lines, LINE_COLUMNS),
            circles=_filled(self.circles, ARC_COLUMNS),
            ellipses=_filled(self.ellipses, ARC_COLUMNS),
            beziers=_filled(self.beziers, BEZIER_COLUMNS),
            pairs=_filled(self.pairs, PAIR_COLUMNS),
            grid=np.empty(0, np.int64) if self.grid is None else self.grid,
            cell=float(self.cell),
            is_open=bool(self.is_open),
        )

    @property
    def primitives(self) -> tuple[str, ...]:
        """The names of the wall's primitives."""
        return tuple(name for name in ("lines", "circles", "ellipses", "beziers") if getattr(self, name) is not None)


def scene_of(wall: Cell) -> Scene:
    """Build the tables of a wall."""
    tables = _Tables()
    vertices = [(float(x), float(y)) for x, y in wall.vertices]
    corners = corners_of(list(wall.pieces))
    if wall.closes:
        for hollow in wall.hollows:
            chain = _Chain(
                list(wall.pieces[hollow.first : hollow.last]),
                vertices[hollow.first : hollow.last + 1],
                corners[hollow.first : hollow.last + 1],
            )
            tables.add_hollow(
                hollow.left, hollow.right, [chain], edges=(_edge(chain.corners[0]), _edge(chain.corners[-1]))
            )
    else:
        chains = [_Chain(list(wall.pieces), vertices, corners)]
        for island, island_vertices in zip(wall.islands, wall.island_vertices, strict=True):
            loop = [(float(x), float(y)) for x, y in island_vertices]
            chains.append(_Chain(list(island), loop, corners_of(list(island))))
        tables.add_hollow(0.0, wall.period, chains, edges=(NO_EDGE, NO_EDGE))
    return tables.scene(wall.period, not wall.closes)


def _edge(is_corner: bool) -> float:
    return CORNER_EDGE if is_corner else SMOOTH_EDGE


def scene_in_one(wall: Cell) -> Scene:
    """Build the tables of a closed wall with its whole cell, flat tops included, as one hollow."""
    tables = _Tables()
    vertices = [(float(x), float(y)) for x, y in wall.vertices]
    chain = _Chain(list(wall.pieces), vertices, corners_of(list(wall.pieces)))
    tables.add_hollow(0.0, wall.period, [chain], edges=(CORNER_EDGE, CORNER_EDGE))
    return tables.scene(wall.period, False)


@dataclass
class _Chain:
    """Connected pieces with their joints; ``vertices`` and ``corners`` have one entry more than ``pieces``."""

    pieces: list[Curve]
    vertices: list[Point]
    corners: list[bool]

    def without_long_arcs(self) -> _Chain:
        """Return the chain with every arc of more than LONGEST_ARC cut in two at a smooth joint."""
        pieces: list[Curve] = []
        vertices, corners = [self.vertices[0]], [self.corners[0]]
        for piece, vertex, corner in zip(self.pieces, self.vertices[1:], self.corners[1:], strict=True):
            if isinstance(piece, Arc) and abs(piece.end_angle - piece.start_angle) > LONGEST_ARC:
                middle = 0.5 * (piece.start_angle + piece.end_angle)
                first = Arc(piece.center, piece.semi_axes, piece.start_angle, middle)
                pieces += [first, Arc(piece.center, piece.semi_axes, middle, piece.end_angle)]
                vertices += [first.end, vertex]
                corners += [False, corner]
            else:
                pieces.append(piece)
                vertices.append(vertex)
                corners.append(corner)
        return _Chain(pieces, vertices, corners)


class _Tables:
    """The tables of a scene under construction."""

    def __init__(self) -> None:
        self.hollows: list[Floats] = []
        self.joints: list[Floats] = []
        self.lines: list[Floats] = []
        self.circles: list[Floats] = []
        self.ellipses: list[Floats] = []
        self.beziers: list[Floats] = []
        self.pairs: list[Floats] = []
        self.grids: list[NDArray[np.int64]] = []
        self.closed: list[Floats] = []

    def add_hollow(self, left: float, right: float, chains: list[_Chain], edges: tuple[float, float]) -> None:
        """Append one hollow, or the whole cell of an open wall."""
        is_closed = len(chains) == 1 and edges != (NO_EDGE, NO_EDGE)
        chains = [chain.without_long_arcs() for chain in chains]
        before = self._sizes()
        for chain in chains:
            self._add_chain(chain)
        after = self._sizes()
        joints = np.array([vertex for chain in chains for vertex in chain.vertices])
        size = float(np.max(np.ptp(joints, axis=0))) if len(joints) else right - left
        size = max(size, right - left)
        row = {LEFT: left, RIGHT: right, SIZE: size, LEFT_EDGE: edges[0], RIGHT_EDGE: edges[1]}
        row |= dict(zip((FIRST_JOINT, FIRST_CIRCLE, FIRST_ELLIPSE, FIRST_BEZIER), before, strict=True))
        row |= dict(zip((JOINTS_END, CIRCLES_END, ELLIPSES_END, BEZIERS_END), after, strict=True))
        self.hollows.append(row_of(HOLLOW_COLUMNS, row))
        self._mark_runs(before[1], after[1], chains)
        inside = bool(np.all((left <= joints[:, 0]) & (joints[:, 0] <= right)))
        if inside or edges != (NO_EDGE, NO_EDGE):
            self._mark_pairs(before[0], chains, size)
        self._add_grid(before[0])
        form = closed_form_of(chains[0].pieces, chains[0].vertices, size) if is_closed else None
        self.closed.append(row_of(FORM_COLUMNS, {FORM: NO_FORM}) if form is None else form)

    def _sizes(self) -> tuple[int, int, int, int]:
        return len(self.joints), len(self.circles), len(self.ellipses), len(self.beziers)

    def _add_chain(self, chain: _Chain) -> None:
        for i, piece in enumerate(chain.pieces):
            start, end = chain.vertices[i], chain.vertices[i + 1]
            is_line = isinstance(piece, Segment)
            self._add_joint(start, chain.corners[i], is_line)
            self.lines.append(line_row(start, end) if is_line else np.zeros(LINE_COLUMNS))
            ends = {
                START_X: start[0], START_Y: start[1], END_X: end[0], END_Y: end[1],
                START_CORNER: chain.corners[i], END_CORNER: chain.corners[i + 1],
            }  # fmt: skip
            if isinstance(piece, Arc):
                (self.circles if piece.is_circular else self.ellipses).append(arc_row(piece, ends))
            elif isinstance(piece, Bezier):
                self.beziers.append(bezier_row(piece, ends))
        self._add_joint(chain.vertices[-1], chain.corners[-1], False)
        self.lines.append(np.zeros(LINE_COLUMNS))

    def _add_joint(self, vertex: Point, is_corner: bool, starts_line: bool) -> None:
        row = {JOINT_X: vertex[0], JOINT_Y: vertex[1], IS_CORNER: is_corner, STARTS_LINE: starts_line}
        self.joints.append(row_of(JOINT_COLUMNS, row))

    def _mark_runs(self, first: int, last: int, chains: list[_Chain]) -> None:
        """Set RUN_SINE of the focusing circles whose circular segment contains no other piece of the hollow."""
        outlines = [
            np.array([vertex]) if isinstance(piece, Segment) else piece.point(np.linspace(0.0, 1.0, OUTLINE_POINTS))
            for chain in chains
            for piece, vertex in zip(chain.pieces, chain.vertices, strict=False)
        ]
        ends = [np.array([chain.vertices[-1]]) for chain in chains]
        points = np.concatenate(outlines + ends)
        for row in self.circles[first:last]:
            half, radius = 0.5 * row[SPAN], 1.0 / abs(row[CURVATURE])
            x, y = points[:, 0] - row[START_X], points[:, 1] - row[START_Y]
            own = abs(
                np.hypot(
                    points[:, 0] - row[START_X] - row[NORMAL_X] / row[CURVATURE],
                    points[:, 1] - row[START_Y] - row[NORMAL_Y] / row[CURVATURE],
                )
            )
            height = y * row[CHORD_X] - x * row[CHORD_Y]
            slack = 1e-12 * self.hollows[-1][SIZE]
            foreign = (height < -slack) & (np.abs(own - radius) > slack)
            if row[CURVATURE] > 0.0 and half <= 0.5 * pi + SMOOTH_JOINT and not foreign.any():
                row[RUN_SINE] = sin(half / RUN_CHORDS)

    def _add_grid(self, first: int) -> None:
        """Add a grid to the last hollow, whose lines start at joint ``first``, if it has at least GRID_LINES lines."""
        joints = np.array(self.joints[first:], dtype=np.float64)
        is_line = joints[:, STARTS_LINE] > 0.0
        if is_line.sum() < GRID_LINES:
            return
        from .grid import grid_of

        starts = np.ascontiguousarray(joints[:, [JOINT_X, JOINT_Y]])
        ends = np.roll(starts, -1, axis=0)
        ends[~is_line] = starts[~is_line]
        frame, table = grid_of(starts, ends, first, sum(map(len, self.grids)))
        columns = [GRID_X, GRID_Y, CELL_WIDTH, CELL_HEIGHT, GRID_COLUMNS, GRID_ROWS, GRID_START]
        self.hollows[-1][columns] = frame
        self.grids.append(table)

    def _mark_pairs(self, first: int, chains: list[_Chain], size: float) -> None:
        """Find the channels and wedges of the last hollow, whose lines start at joint ``first``."""
        numbers, starts, ends, hulls = [], [], [], []
        joint = first
        for chain in chains:
            for piece, start, end in zip(chain.pieces, chain.vertices, chain.vertices[1:], strict=False):
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
        for line, row in sorted(rows, key=lambda pair: (pair[0], *pair[1].values())):
            if self.lines[line][PAIRS_END] == 0.0:
                self.lines[line][[FIRST_PAIR, PAIRS_END]] = len(self.pairs)
            self.pairs.append(row_of(PAIR_COLUMNS, row))
            self.lines[line][PAIRS_END] += 1.0

    def scene(self, cell: float, is_open: bool) -> Scene:
        joints, lines = table_of(self.joints, JOINT_COLUMNS), table_of(self.lines, LINE_COLUMNS)
        return Scene(
            hollows=table_of(self.hollows, HOLLOW_COLUMNS),
            joints=joints,
            lines=lines if joints[:, STARTS_LINE].any() else None,
            circles=_table(self.circles),
            ellipses=_table(self.ellipses),
            beziers=_table(self.beziers),
            pairs=_table(self.pairs),
            grid=np.concatenate(self.grids) if self.grids else None,
            cell=cell,
            is_open=is_open,
            closed=closed_table(self.closed),
        )


def _filled(table: Floats | None, columns: int) -> Floats:
    return np.empty((0, columns)) if table is None else np.require(table, np.float64, ["C", "A", "W"])


def _table(rows: list[Floats]) -> Floats | None:
    return np.array(rows) if rows else None
