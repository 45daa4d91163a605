"""The tables of a wall for the compiled functions: the pieces that a ray can meet, hollow by hollow.

Flat tops are not in the tables. The table of a primitive that the wall does not have is empty. `columns` names the
columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import frexp, hypot, ldexp, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.estimates import Summary
from ..cells.cell import Cell
from ..cells.hollow_shape import distinct_hollows
from ..curves import columns as c
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.columns import SMOOTH_JOINT, Struct, row_of, table_of
from ..curves.crossings import directions_of, straight_in
from ..curves.curve import Curve, Point
from .closed_forms import MOST_PIECES, TREE_COLUMNS, closed_form_of, escape_sectors, facing_pairs, tree_of

# Number of chords from which on a run along an arc pays for its two arctangents and one sincos.
RUN_CHORDS = 8.0
OUTLINE_POINTS = 64
# Number of lines in a hollow from which on it has a tree of boxes.
TREE_LINES = 48
# Binary digits of coordinates on the grid of coincident Bezier faces; their coefficients have three more.
GRID_DIGITS = 50
# Nominal time of a segment in seconds, and how many times as long it takes on Bezier curves.
SEGMENT_TIME, BEZIER_FACTOR = 1e-7, 1.5


def corners_of(pieces: Sequence[Curve]) -> NDArray[np.bool_]:
    """Return whether each joint of the cycle of pieces is a corner; the first joint is repeated at the end."""
    tails, heads = directions_of(pieces)
    tails = np.roll(tails, 1, axis=0)
    turn = np.abs(tails[:, 0] * heads[:, 1] - tails[:, 1] * heads[:, 0])
    corner = (turn > SMOOTH_JOINT) | (np.sum(tails * heads, axis=1) < 0.0)
    return np.append(corner, corner[0])


class Tables(NamedTuple):
    """The tables of a wall as arguments of compiled functions; tables of absent primitives are empty.

    ``curves`` has a table for each of `Curve.traced`, and ``closed`` has one column. Where ``curves_absorb``, the hit
    by hit tracer ends rays on curves; no wall's own tables do.
    """

    hollows: Floats
    joints: Floats
    lines: Floats
    curves: tuple[Floats, ...]
    pairs: Floats
    boxes: Floats
    closed: Floats
    hollow_count: int
    cell: float
    is_open: bool
    curves_absorb: bool


class Scene(Tables):
    """The tables of one wall; see the docstring of this module."""

    @cached_property
    def tables(self) -> Struct:
        """The tables in memory, with types equal for all walls, so that each function is compiled once."""
        return Struct(Tables(*self))

    @property
    def arcs(self) -> Floats:
        """The table of arcs."""
        return self.curves[Arc.table]

    @property
    def beziers(self) -> Floats:
        """The table of Bezier pieces."""
        return self.curves[Bezier.table]

    @property
    def segment_time(self) -> float:
        """Nominal time of a segment of a ray in adaptive quadrature, measured as .08 and .14 microseconds."""
        return BEZIER_FACTOR * SEGMENT_TIME if len(self.beziers) else SEGMENT_TIME

    @property
    def primitives(self) -> tuple[str, ...]:
        """The names of the wall's primitives."""
        is_circular = self.arcs[:, c.STRETCH] == 1.0
        present = {
            "lines": self.joints[:, c.STARTS_LINE].any(), "circles": is_circular.any(),
            "ellipses": not is_circular.all(),
        }  # fmt: skip
        present |= {f"{cls.kind}s": len(self.curves[cls.table]) > 0 for cls in Curve.traced() if cls is not Arc}
        return tuple(name for name, is_present in present.items() if is_present)


def scene_of(wall: Cell) -> Scene:
    """Build the tables of a wall."""
    tables = _Tables(wall.period, not wall.closes)
    chain = _chain_of(wall.pieces, wall.vertices)
    if wall.closes:
        for hollow in wall.hollows:
            part = chain.part(hollow.first, hollow.last)
            edges = (_edge(part.corners[0]), _edge(part.corners[-1]))
            tables.add_hollow(hollow.left, hollow.right, [part], edges)
    else:
        chains = [chain, *map(_chain_of, wall.islands, wall.island_vertices)]
        tables.add_hollow(0.0, wall.period, chains, edges=(c.NO_EDGE, c.NO_EDGE))
    return tables.scene()


def _edge(is_corner: bool) -> float:
    return c.CORNER_EDGE if is_corner else c.SMOOTH_EDGE


@dataclass(frozen=True)
class _Chain:
    """Connected pieces with their joints; ``vertices`` and ``corners`` have one row more than ``pieces``."""

    pieces: tuple[Curve, ...]
    vertices: Floats
    corners: NDArray[np.bool_]
    is_line: NDArray[np.bool_]

    def part(self, first: int, last: int) -> _Chain:
        """Return the pieces from ``first`` to before ``last``."""
        joints = slice(first, last + 1)
        return _Chain(self.pieces[first:last], self.vertices[joints], self.corners[joints], self.is_line[first:last])

    def curves(self) -> list[int]:
        """Return the numbers of the pieces that are no segments."""
        numbers: list[int] = np.flatnonzero(~self.is_line).tolist()
        return numbers

    def joint(self, number: int) -> Point:
        """Return the joint at which a piece starts."""
        x, y = self.vertices[number].tolist()
        return x, y

    def without_long_arcs(self) -> _Chain:
        """Return the chain with every arc of more than LONGEST_ARC cut in two at a smooth joint."""
        chain = self
        for k in reversed(self.curves()):
            parts = self.pieces[k].cut()
            if len(parts) == 2:
                first, second = parts
                chain = _Chain(
                    (*chain.pieces[:k], first, second, *chain.pieces[k + 1 :]),
                    np.insert(chain.vertices, k + 1, first.end, axis=0),
                    np.insert(chain.corners, k + 1, False),
                    np.insert(chain.is_line, k, False),
                )
        return chain


def _chain_of(pieces: tuple[Curve, ...], vertices: Floats) -> _Chain:
    return _Chain(pieces, vertices, corners_of(pieces), straight_in(pieces))


def _with_exact_faces(chains: list[_Chain]) -> list[_Chain]:
    """Return the chains with coincident Bezier faces on a grid, where the coefficients of both are exact.

    By rounded coefficients the faces would cross, and rays would be caught between them.
    """
    curves = {piece for chain in chains for piece in chain.pieces if isinstance(piece, Bezier)}
    faces = {face: np.array(face.control_points) for face in curves & {curve.reversed() for curve in curves}}
    if not faces:
        return chains
    grid = ldexp(1.0, frexp(max(float(np.abs(points).max()) for points in faces.values()))[1] - GRID_DIGITS)
    exact: dict[Curve, Curve] = {face: Bezier(list(grid * np.round(points / grid))) for face, points in faces.items()}
    ends = {face.start: piece.start for face, piece in exact.items()}
    return [
        replace(
            chain,
            pieces=tuple(exact.get(piece, piece) for piece in chain.pieces),
            vertices=np.array([ends.get((x, y), (x, y)) for x, y in chain.vertices.tolist()]),
        )
        for chain in chains
    ]


class _Tables:
    """The tables of a scene under construction; each hollow adds a block of rows to every one."""

    def __init__(self, cell: float, is_open: bool) -> None:
        self.cell, self.is_open = float(cell), bool(is_open)
        self.hollows: list[Floats] = []
        self.joints, self.lines = _Blocks(c.JOINT_COLUMNS), _Blocks(c.LINE_COLUMNS)
        self.curves = tuple(_Blocks(cls.columns) for cls in Curve.traced())
        self.pairs, self.boxes, self.closed = _Blocks(c.PAIR_COLUMNS), _Blocks(TREE_COLUMNS), _Blocks(1)

    def add_hollow(self, left: float, right: float, chains: list[_Chain], edges: tuple[float, float]) -> None:
        """Append one hollow, or the whole cell of an open wall."""
        is_closed = len(chains) == 1 and edges != (c.NO_EDGE, c.NO_EDGE)
        chains = _with_exact_faces([chain.without_long_arcs() for chain in chains])
        vertices = np.concatenate([chain.vertices for chain in chains])
        size = max(float(np.max(np.ptp(vertices, axis=0))), right - left)
        row = {c.LEFT: left, c.RIGHT: right, c.SIZE: size, c.LEFT_EDGE: edges[0], c.RIGHT_EDGE: edges[1]}
        row |= dict(zip((c.FIRST_JOINT, *self._curve_columns()), self._sizes(), strict=True))
        joints = np.concatenate([_joint_rows(chain) for chain in chains])
        lines = np.concatenate([_line_rows(chain) for chain in chains])
        self._add_curves(chains, size)
        self.hollows.append(row_of(self._width, row))
        inside = bool(np.all((left <= vertices[:, 0]) & (vertices[:, 0] <= right)))
        if inside or edges != (c.NO_EDGE, c.NO_EDGE):
            self._mark_pairs(joints, lines, chains, size)
        if np.count_nonzero(joints[:, c.STARTS_LINE]) >= TREE_LINES:
            self._add_tree(joints, size)
            if is_closed and chains[0].is_line.all():
                lines[:-1, [c.ESCAPE_RIGHT, c.ESCAPE_LEFT]] = escape_sectors(chains[0].vertices, size)
        self.joints.append(joints)
        self.lines.append(lines)
        self.hollows[-1][[c.JOINTS_END, *self._curve_columns(1)]] = self._sizes()
        if is_closed and len(chains[0].pieces) <= MOST_PIECES:
            points = list(map(chains[0].joint, range(len(chains[0].vertices))))
            kind, form = closed_form_of(chains[0].pieces, points, size)
            self.hollows[-1][[c.FORM, c.FORM_START]] = kind, self.closed.count
            self.closed.append(form[:, np.newaxis])

    @property
    def _width(self) -> int:
        return c.FIRST_CURVE + 2 * len(self.curves)

    def _curve_columns(self, end: int = 0) -> range:
        return range(c.FIRST_CURVE + end, self._width, 2)

    def _sizes(self) -> list[int]:
        return [block.count for block in (self.joints, *self.curves)]

    def _add_curves(self, chains: list[_Chain], size: float) -> None:
        """Append arcs and Bezier pieces."""
        rows: list[list[Floats]] = [[] for _ in self.curves]
        for chain in chains:
            for i in chain.curves():
                piece, start, end = chain.pieces[i], chain.joint(i), chain.joint(i + 1)
                ends = {
                    c.START_X: start[0], c.START_Y: start[1], c.END_X: end[0], c.END_Y: end[1],
                    c.START_CORNER: chain.corners[i], c.END_CORNER: chain.corners[i + 1],
                }  # fmt: skip
                if not isinstance(piece, Curve.traced()):
                    raise InputError(f"wall: expected pieces that rays meet, got {piece!r}; write it as Bezier curves")
                rows[piece.table].append(piece.row(ends))
        for cls, block, some in zip(Curve.traced(), self.curves, rows, strict=True):
            table = table_of(some, cls.columns)
            block.append(_with_runs(table, chains, size) if cls is Arc else table)

    def _add_tree(self, joints: Floats, size: float) -> None:
        """Add a tree over the lines of the last hollow."""
        starts = joints[:, [c.JOINT_X, c.JOINT_Y]]
        is_line = (joints[:, c.STARTS_LINE] > 0.0)[:, np.newaxis]
        ends = np.where(is_line, np.roll(starts, -1, axis=0), starts)
        tree, levels = tree_of(starts, ends, self.joints.count, self.boxes.count, size)
        self.hollows[-1][[c.TREE_ROOT, c.TREE_LEVELS]] = self.boxes.count, levels
        self.boxes.append(tree)

    def _mark_pairs(self, joints: Floats, lines: Floats, chains: list[_Chain], size: float) -> None:
        """Find the channels and wedges of the last hollow, whose joints and lines are given."""
        first, numbers = self.joints.count, np.flatnonzero(joints[:, c.STARTS_LINE] > 0.0)
        places = joints[:, [c.JOINT_X, c.JOINT_Y]]
        hulls = np.concatenate([_hulls(chain) for chain in chains])
        rows = facing_pairs(first + numbers, places[numbers], places[numbers + 1], hulls, size)
        table: list[Floats] = []
        for line, row in sorted(rows, key=lambda pair: (pair[0], *pair[1].values())):
            if lines[line - first, c.PAIRS_END] == 0.0:
                lines[line - first, [c.FIRST_PAIR, c.PAIRS_END]] = self.pairs.count + len(table)
            table.append(row_of(c.PAIR_COLUMNS, row))
            lines[line - first, c.PAIRS_END] += 1.0
        self.pairs.append(table_of(table, c.PAIR_COLUMNS))

    def scene(self) -> Scene:
        hollows, curves = table_of(self.hollows, self._width), tuple(block.whole() for block in self.curves)
        joints, lines, *rest = (b.whole() for b in (self.joints, self.lines, self.pairs, self.boxes, self.closed))
        return Scene._make((hollows, joints, lines, curves, *rest, len(hollows), self.cell, self.is_open, False))


class _Blocks:
    """A table that grows by blocks of rows."""

    def __init__(self, columns: int) -> None:
        self.count, self._blocks = 0, [np.empty((0, columns))]

    def append(self, block: Floats) -> None:
        self.count += len(block)
        self._blocks.append(block)

    def whole(self) -> Floats:
        return np.concatenate(self._blocks)


def _joint_rows(chain: _Chain) -> Floats:
    rows = np.zeros((len(chain.vertices), c.JOINT_COLUMNS))
    rows[:, [c.JOINT_X, c.JOINT_Y]] = chain.vertices
    rows[:, c.IS_CORNER], rows[:-1, c.STARTS_LINE] = chain.corners, chain.is_line
    return rows


def _line_rows(chain: _Chain) -> Floats:
    """Return a row of ``lines`` for every joint of a chain, zeros where no segment starts; pairs are set later."""
    rows, edges = np.zeros((len(chain.vertices), c.LINE_COLUMNS)), np.diff(chain.vertices, axis=0)
    numbers = np.flatnonzero(chain.is_line)
    x, y = edges[numbers].T
    length = np.array(list(map(hypot, x.tolist(), y.tolist())))
    rows[numbers, c.EDGE_X : c.LENGTH + 1] = np.column_stack([x, y, -y / length, x / length, length])
    return rows


def _hulls(chain: _Chain) -> Floats:
    """Return `hull_of` of every piece."""
    hulls = np.stack([chain.vertices[:-1], chain.vertices[1:]] * 2, axis=1)
    for k in chain.curves():
        hulls[k] = chain.pieces[k].hull(chain.joint(k), chain.joint(k + 1))
    return hulls


def _with_runs(arcs: Floats, chains: list[_Chain], size: float) -> Floats:
    """Return arcs with RUN_SINE of the focusing circular ones whose segment contains no other piece of the hollow."""
    if not len(arcs):
        return arcs
    outlines = [chain.vertices for chain in chains]
    at = np.linspace(0.0, 1.0, OUTLINE_POINTS)
    outlines += [chain.pieces[k].point(at) for chain in chains for k in chain.curves()]
    points = np.concatenate(outlines)
    for k in np.flatnonzero((arcs[:, c.CURVATURE] > 0.0) & (arcs[:, c.STRETCH] == 1.0)):
        row = arcs[k]
        half, radius = 0.5 * row[c.SPAN], 1.0 / abs(row[c.CURVATURE])
        x, y = points[:, 0] - row[c.START_X], points[:, 1] - row[c.START_Y]
        own = abs(
            np.hypot(
                points[:, 0] - row[c.START_X] - row[c.NORMAL_X] / row[c.CURVATURE],
                points[:, 1] - row[c.START_Y] - row[c.NORMAL_Y] / row[c.CURVATURE],
            )
        )
        height = y * row[c.CHORD_X] - x * row[c.CHORD_Y]
        slack = 1e-12 * size
        foreign = (height < -slack) & (np.abs(own - radius) > slack)
        if half <= 0.5 * pi + SMOOTH_JOINT and not foreign.any():
            row[c.RUN_SINE] = sin(half / RUN_CHORDS)
    return arcs


def no_tables() -> Struct:
    """Return empty tables, with the types of all tables."""
    return _Tables(1.0, True).scene().tables


@dataclass(frozen=True, repr=False)
class TracePlan(Summary):
    """The optimisations that `trace` applies to a wall; made by ``wall.plan()``.

    Attributes
    ----------
    primitives : tuple of str
        The kinds of pieces of the wall, from "lines", "circles", "ellipses" and "beziers".
    hollows : int
        Number of openings, each traced separately against its own pieces only; 1 for an open wall.
    pieces_traced, pieces_left_out : int
        Numbers of pieces that rays are tested against, and of flat tops, which need no tracing.
    flat_fraction : float
        Fraction of the period that is flat top.
    arcs_with_runs : int
        Number of circular arcs on which a run of hits is computed in one step.
    channels, wedges : int
        Numbers of parallel and of other pairs of lines that face each other with nothing in between. A run of hits
        between them is computed in one step. Wedges of more than 0.3 radians have no long runs and are not counted.
    closed_forms : int
        Number of hollows whose rays are computed by a formula from the opening to the exit: wedges (two lines that
        meet at more than 0.3 radians, apex below the opening) and circular hollows (one arc of half angle 0.05 to
        pi/2). Rays within 1e-9 of a corner are traced segment by segment.
    hollows_with_grid : int
        Number of hollows with so many lines that a tree of boxes selects the lines to test; elsewhere every piece is
        tested.
    distinct_hollows : int
        Number of hollows that differ by more than translation and scale, to 64 rounding errors. The law of the wall
        is a mixture of the laws of these hollows.
    mirror_symmetric : bool
        Whether the wall has a mirror axis; half of the angles then determine the other half.
    wraps : bool
        Whether rays pass from cell to cell because the wall does not close.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> plan = geo.rectangular_teeth(3.0).plan()
    >>> plan.pieces_left_out, plan.flat_fraction, plan.channels, plan.mirror_symmetric
    (1, 0.5, 1, True)
    >>> plan = geo.mushrooms(0.3, 0.5, 2).plan()
    >>> plan.hollows, plan.distinct_hollows, plan.arcs_with_runs
    (5, 1, 5)
    >>> geo.triangular_teeth(0.7).plan().closed_forms
    1
    """

    primitives: tuple[str, ...]
    hollows: int
    pieces_traced: int
    pieces_left_out: int
    flat_fraction: float
    arcs_with_runs: int
    wraps: bool
    channels: int
    wedges: int
    closed_forms: int
    hollows_with_grid: int
    distinct_hollows: int
    mirror_symmetric: bool


def plan_of(wall: Cell, scene: Scene, is_mirror_symmetric: bool) -> TracePlan:
    """Return the plan of a wall that is its own cell, read from the tables of the tracer."""
    pieces = len(wall.pieces) + sum(map(len, wall.islands))
    traced = sum(h.last - h.first for h in wall.hollows) if wall.closes else pieces
    runs = int((scene.arcs[:, c.RUN_SINE] > 0.0).sum())
    # every pair has two rows, one for each line
    parallel = int((scene.pairs[:, c.PAIR_ANGLE] == 0.0).sum()) // 2
    return TracePlan(
        primitives=scene.primitives,
        hollows=len(scene.hollows),
        pieces_traced=traced,
        pieces_left_out=pieces - traced,
        flat_fraction=wall.flat_top / wall.period if wall.closes else 0.0,
        arcs_with_runs=runs,
        wraps=scene.is_open,
        channels=parallel,
        wedges=len(scene.pairs) // 2 - parallel,
        closed_forms=int((scene.hollows[:, c.FORM] != c.NO_FORM).sum()),
        hollows_with_grid=int((scene.hollows[:, c.TREE_LEVELS] > 0.0).sum()),
        distinct_hollows=len(distinct_hollows(wall)) if wall.closes else 1,
        mirror_symmetric=is_mirror_symmetric,
    )
