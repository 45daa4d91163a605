"""Exact division of the rays into a polygonal hollow into beams of equal itinerary."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, number_between, read_only, whole_number
from ...core.rounding import EPS, UNIT_ROUNDOFF
from ..tracing.threads import in_blocks, interruptibly
from .compiled import columns as c
from .triangulation import Triangulation, checked_chain, triangulated

if TYPE_CHECKING:
    from .compiled.division import Store
    from .compiled.unfolding import Hollow

TOLERANCE = 1e-13
MAX_BEAMS = 200_000
# Limit on the triangles passed by all beams, per beam allowed: they then take about as long as the divisions.
STEPS_A_BEAM = 256
# Number of beams from which a round is cut into parts.
MANY, PARTS = 1024, 16
# Change of directions, radians times vertices, beyond which mirror images cost more accuracy than the time that they
# save is worth: rough profiles have 8e-11 and a few bounces a leaf, Koch curves 1e-12 and hundreds.
MOST_TURNED = 3e-11
# Factor between the thresholds of priority of two rounds: next to the tolerance, and at most.
LEAST_STEP, MOST_STEP = 1.1, 64.0
# Splits of a first call for chains of few vertices, which resolves most of them: of those allowed, this fraction at
# most, because it takes beams in no order.
FEW_VERTICES, FIRST_SPLITS, FIRST_FRACTION = 16, 512, 1.0 / 16.0
# Stands for a tolerance of 0.
TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class Beams:
    r"""The law of a polygonal hollow as a list of pieces, each with one formula.

    Piece k: for low < theta < high and X uniform over the hollow's opening, with probability
    sine + cosine cot(theta) the ray leaves at theta' = sign theta + offset after ``bounces`` bounces. A *leaf* is the
    set of all rays with one itinerary; it has one piece for every interval of theta between vertices of its polygon.

    Parameters
    ----------
    sign : array of int8
        +1 or -1.
    offset : array
        Radians; the offsets of equal isometries agree within one or two ulp.
    low, high : arrays
        The interval of theta of the piece, radians.
    sine, cosine : arrays
        The probability times sin(theta) is sine sin(theta) + cosine cos(theta).
    leaf, bounces : arrays of int
        The index of the leaf, and the number of reflections.
    unresolved : float
        Fraction of the opening's flux, sin(theta)/2 dtheta dx/width, without resolved outgoing angle.
    unresolved_low, unresolved_high, unresolved_sine, unresolved_cosine : arrays
        The pieces of the unresolved flux.
    defect : float
        Absolute difference between the total flux of all pieces and 1.
    rounding : float
        Bound on the fraction of the flux that double precision may have put into the wrong leaf, or a departure from
        mirror symmetry.
    offset_error : float
        Bound on the change of offsets, radians, by a departure from mirror symmetry; 0 if there is none.
    complete : bool
        Whether ``unresolved`` met the tolerance; if not, the limit of beams was reached.
    """

    sign: NDArray[np.int8]
    offset: Floats
    low: Floats
    high: Floats
    sine: Floats
    cosine: Floats
    leaf: NDArray[np.int64]
    bounces: NDArray[np.int64]
    unresolved: float
    unresolved_low: Floats
    unresolved_high: Floats
    unresolved_sine: Floats
    unresolved_cosine: Floats
    defect: float
    rounding: float
    offset_error: float
    complete: bool

    def flux(self) -> Floats:
        """Return the fraction of the opening's flux in each piece, shape (pieces,)."""
        return _flux(self.low, self.high, self.sine, self.cosine)

    def resolved(self) -> float:
        """Return the fraction of the opening's flux in all pieces together."""
        return float(self.flux().sum())


def beams_of(
    hollow_vertices: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    max_beams: int = MAX_BEAMS,
    mirror_symmetric: bool = False,
    threads: int | None = None,
) -> Beams:
    """Divide the rays into a polygonal hollow into beams of equal itinerary.

    The hollow is triangulated, and the triangles are unfolded along the rays. A beam is a convex polygon in the
    projective plane of lines; every triangle divides it by the line through its third vertex. The priority of a beam is
    its flux, divided by the number of slivers that it has lost in a row; beams of high priority are divided first.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0), with the hollow above it: ``wall.cell.vertices[h.first : h.last + 1]``.
    tolerance : float
        Largest unresolved fraction of the flux.
    max_beams : int
        Limit on the number of beams, and on the triangles that they pass, 256 for each; cavities with narrow necks
        never resolve completely.
    mirror_symmetric : bool
        Whether the hollow is its own mirror image, within rounding: then it is made so exactly, and only rays with
        theta < pi/2 are divided, and mirrored. ``rounding`` and ``offset_error`` bound what the change does. If it
        is more than the rounding of some vertices, as in a hollow that is narrow beside its coordinates, all rays are
        divided nevertheless.
    threads : int, optional
        By default one for each processor that this process may use. The result does not depend on it.

    Returns
    -------
    Beams

    Raises
    ------
    InputError
        If the chain is not a hollow, see `triangulated`.
    WallError
        If the chain crosses itself.

    Notes
    -----
    Cost: 2 to 4 microseconds a beam and thread, once compiled; about 500 bytes a beam.

    Examples
    --------
    A right-angled notch reflects once, or twice with retroreflection:

    >>> beams = beams_of([(0, 0), (0.5, -0.5), (1, 0)])
    >>> sorted({(int(n), int(s)) for n, s in zip(beams.bounces, beams.sign)})
    [(1, -1), (2, 1)]
    >>> beams.unresolved, bool(abs(beams.resolved() - 1.0) < 1e-15)
    (0.0, True)
    """
    number_between("tolerance", tolerance, 0.0, 1.0, closed="low")
    whole_number("max_beams", max_beams, 2)
    exact = symmetrised(checked_chain(hollow_vertices)) if mirror_symmetric else None
    if exact is not None and exact.turn * len(exact.vertices) > MOST_TURNED:
        exact = None
    entrances, images = (2, 1.0) if exact is None else (1, 2.0)
    triangulation = triangulated(hollow_vertices if exact is None else exact.vertices)
    beams = _divided(triangulation, tolerance, max_beams * entrances // 2, entrances, threads)
    parts = beams.leaving(), beams.rest()
    moved, offset_error = (0.0, 0.0) if exact is None else _changed(parts[0], exact)
    flux, unresolved = (images * float(_flux(part.low, part.high, part.sine, part.cosine).sum()) for part in parts)
    leaving, rest = (_Pieces._make(map(_fixed, part if exact is None else _mirrored(part))) for part in parts)
    return Beams(
        **leaving._asdict(),
        unresolved=unresolved,
        unresolved_low=rest.low,
        unresolved_high=rest.high,
        unresolved_sine=rest.sine,
        unresolved_cosine=rest.cosine,
        defect=abs(flux + unresolved - 1.0),
        rounding=0.5 * images * beams.rounding / triangulation.width + moved,
        offset_error=offset_error,
        complete=beams.left <= beams.wanted,
    )


class _Pieces(NamedTuple):
    """Pieces of beams; see `Beams`."""

    low: Floats
    high: Floats
    sine: Floats
    cosine: Floats
    offset: Floats
    leaf: NDArray[Any]
    sign: NDArray[Any]
    bounces: NDArray[Any]


class _Beams:
    """The beams of a hollow: a table of those that wait, and pieces of the others.

    Attributes
    ----------
    waiting : Store
    wanted : float
        The flux of the beams that may be left, in units of dp dtheta.
    leaves, steps : int
        Number of beams that have left the hollow, and of triangles passed.
    rounding : float
        See `Beams`, but in units of dp dtheta.
    """

    def __init__(self, hollow: Hollow, entrance: Store, tolerance: float) -> None:
        self._hollow, self.waiting = hollow, entrance
        self._rows: list[Floats] = []
        self._tags: list[NDArray[np.int64]] = []
        self.leaves, self.steps, self.rounding = 0, 0, 0.0
        self.wanted = tolerance * self.left

    @property
    def left(self) -> float:
        """The flux of all beams that wait."""
        return float(self.waiting.real[:, c.FLUX].sum())

    @property
    def priority(self) -> Floats:
        """The priorities of all beams that wait."""
        return np.asarray(self.waiting.real[:, c.FLUX] / self.waiting.real[:, c.DIVISOR])

    def divide(self, threshold: float, most_splits: int, most_steps: int, parts: int, threads: int | None) -> None:
        """Divide the beams above a threshold of priority, in parts.

        What becomes of a beam does not depend on other beams, so parts may run on any number of threads.
        """
        from .compiled.division import LEAVES, STEPS, divide

        is_chosen = self.priority > threshold
        chosen = np.flatnonzero(is_chosen)
        rule = threshold, most_splits // parts, max(most_steps // parts, 1)
        found: list[Any] = [None] * parts
        rounding = np.zeros((parts, 1))

        def run(part: slice) -> None:
            for k in range(part.start, part.stop):
                # the last beam is divided first
                own = _selected(self.waiting, chosen[k::parts][::-1])
                found[k] = list(divide(self._hollow, own, *rule, rounding[k]))

        in_blocks(run, parts, threads, block=1)
        waiting = [_selected(self.waiting, np.flatnonzero(~is_chosen))]
        for rest, rows, tags, counts in chain.from_iterable(found):
            waiting.append(rest)
            tags[:, c.TAG_LEAF] += self.leaves
            self._rows.append(rows)
            self._tags.append(tags)
            self.leaves, self.steps = self.leaves + counts[LEAVES], self.steps + counts[STEPS]
        for part in rounding.ravel().tolist():
            self.rounding += part
        self.waiting = _together(waiting)

    def leaving(self) -> _Pieces:
        """Return the pieces of the beams that have left the hollow."""
        return _columns(self._rows, self._tags)

    def rest(self) -> _Pieces:
        """Return the pieces of all beams that wait."""
        from .compiled.polygon import pieces_of

        rows, tags = pieces_of(self.waiting, self._hollow.width)
        return _columns([rows], [tags])


def _divided(
    triangulation: Triangulation, tolerance: float, max_beams: int, entrances: int, threads: int | None
) -> _Beams:
    """Divide all beams above a threshold of priority, lower the threshold, and so on.

    Of a chain of few vertices some beams are divided in no order before, in one short call. The number of the parts
    into which a round is cut depends on the number of beams alone.
    """
    hollow = _hollow(triangulation)
    beams = _Beams(hollow, _entrance(triangulation.entrance, hollow.width, entrances), tolerance)
    splits = min(FIRST_SPLITS, int(FIRST_FRACTION * max_beams))
    if splits and len(triangulation.vertices) <= FEW_VERTICES:
        beams.divide(beams.wanted / FIRST_SPLITS, splits, STEPS_A_BEAM * splits, 1, 1)
    if beams.left > beams.wanted:
        interruptibly(lambda: _in_rounds(beams, max_beams, threads))
    return beams


def _in_rounds(beams: _Beams, max_beams: int, threads: int | None) -> None:
    """Divide beams in rounds until the flux that is left is as wanted, or a limit is reached."""
    while True:
        left, priority = beams.left, beams.priority
        best, used = priority.max(initial=0.0), beams.leaves + priority.size
        room, spare = max_beams - used, STEPS_A_BEAM * max_beams - beams.steps
        if left <= beams.wanted or room <= 0 or spare <= 0 or best <= 0.0:
            return
        parts = PARTS if min(priority.size, room) >= MANY else 1
        threshold = best / _step(left / max(beams.wanted, TINY), 1.0 + room / used)
        beams.divide(threshold, room, spare, parts, threads)


def _step(excess: float, growth: float) -> float:
    """Return the factor by which the threshold falls.

    The flux that is left falls at most in proportion to the threshold, and the number of beams grows at most in inverse
    proportion. ``excess`` is the flux that is left as a multiple of the wanted flux, ``growth`` the factor by which the
    number of beams may still grow.
    """
    return min(MOST_STEP, max(excess, LEAST_STEP), max(0.5 * growth, 2.0))


def _hollow(triangulation: Triangulation) -> Hollow:
    """Return a triangulation as beams see it; the distance of a wall is computed at its end nearer to the origin."""
    from .compiled.unfolding import STEP_ULPS, Hollow

    (x, y), corners, beyond = triangulation.vertices.T, triangulation.corners, triangulation.beyond
    edge = np.arange(beyond.size)
    apex = corners[edge // 3, (edge + 2) % 3]
    exits = (3 * (edge // 3)[:, None] + (edge[:, None] + np.array([1, 2])) % 3).ravel()
    size = np.abs(x) + np.abs(y)
    near = np.arange(size.size - 1) + (size[:-1] > size[1:])
    turns = triangulation.turn_high.tolist()
    sine, cosine = np.array([math.sin(turn) for turn in turns]), np.array([math.cos(turn) for turn in turns])
    twice = 2.0 * (cosine * y[near] - sine * x[near])
    return Hollow(
        apex_x=x[apex],
        apex_y=y[apex],
        exits=exits,
        beyond=beyond.copy(),
        turn_high=triangulation.turn_high.copy(),
        turn_low=triangulation.turn_low.copy(),
        normal_x=-sine * twice,
        normal_y=cosine * twice,
        slack=STEP_ULPS * EPS * size[near],
        width=triangulation.width,
    )


def _entrance(edge: int, width: float, halves: int) -> Store:
    """Return the beams of rays with theta < pi/2, or, of two halves, of all rays."""
    from .compiled.division import Store

    vertices, real = np.zeros((6, c.VERTEX_COLUMNS)), np.zeros((2, c.REAL_COLUMNS))
    whole = np.zeros((2, c.WHOLE_COLUMNS), int)
    # the lines along the opening and, vertical, through its left and its right end; then these and those along it again
    vertices[[0, 4], c.LINE_C], vertices[[1, 2, 3, 5], c.LINE_S] = (1.0, -1.0), 1.0
    vertices[[2, 5], c.LINE_P] = vertices[[2, 4], c.CUT_X] = width
    real[:, c.FLUX], real[:, c.DIVISOR] = width, 1.0
    whole[:, c.FIRST], whole[:, c.COUNT], whole[:, c.EDGE], whole[:, c.SIGN] = (0, 3), 3, edge, 1
    return Store(vertices[: 3 * halves], real[:halves], whole[:halves])


def _selected(store: Store, beams: NDArray[np.int64]) -> Store:
    """Return the beams of these numbers."""
    whole = store.whole.take(beams, axis=0)
    count, given = whole[:, c.COUNT], whole[:, c.FIRST].copy()
    whole[:, c.FIRST] = np.cumsum(count) - count
    vertex = np.repeat(given - whole[:, c.FIRST], count) + np.arange(count.sum())
    return type(store)(store.vertices.take(vertex, axis=0), store.real.take(beams, axis=0), whole)


def _together(stores: list[Store]) -> Store:
    """Return the beams of several stores."""
    vertices, real, whole = (np.concatenate(table) for table in zip(*stores, strict=True))
    whole[:, c.FIRST] = np.cumsum(whole[:, c.COUNT]) - whole[:, c.COUNT]
    return type(stores[0])(vertices, real, whole)


def _columns(rows: list[Floats], tags: list[NDArray[np.int64]]) -> _Pieces:
    """Return the pieces of several tables, whose columns have the order of the fields."""
    real = np.concatenate([np.empty((0, c.PIECE_COLUMNS)), *rows])
    whole = np.concatenate([np.empty((0, c.TAG_COLUMNS), np.int64), *tags])
    leaf, sign, bounces = whole.T
    return _Pieces._make((*real.T, leaf, sign.astype(np.int8), bounces))


def _flux(low: Floats, high: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Return half the integral of sine sin(theta) + cosine cos(theta), without cancellation on short intervals."""
    middle, half = 0.5 * (low + high), np.sin(0.5 * (high - low))
    return np.asarray(half * (sine * np.sin(middle) + cosine * np.cos(middle)))


def _changed(leaving: _Pieces, exact: Symmetrised) -> tuple[float, float]:
    """Return bounds on the flux that leaves lose, and on the change of offsets, between a hollow and the symmetric one.

    ``leaving`` has half of the pieces. The polygon of a leaf has two chains of edges over its angles, and each edge
    moves by as much as a vertex.
    """
    if exact.shift == 0.0:
        return 0.0, 0.0
    bounces = leaving.bounces.astype(np.float64)
    lost = 2.0 * exact.moved(bounces) @ (leaving.high - leaving.low) / exact.vertices[-1, 0]
    return float(lost), float(exact.turned(bounces.max(initial=0.0)))


def _mirrored(pieces: _Pieces) -> _Pieces:
    """Return the pieces and their mirror images, with theta and theta' replaced by pi - theta."""
    low, high, sine, cosine, offset, leaf, sign, bounces = pieces
    turned = np.where(sign > 0, -offset, 2.0 * np.pi - offset)
    images = _Pieces(np.pi - high, np.pi - low, sine, -cosine, turned, leaf + leaf.max(initial=-1) + 1, sign, bounces)
    return _Pieces(*map(np.concatenate, zip(pieces, images, strict=True)))


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    return read_only(np.ascontiguousarray(array))


class Symmetrised(NamedTuple):
    """A hollow that is exactly its own mirror image, and its distance from the given one.

    Parameters
    ----------
    vertices : array of shape (n, 2)
        The chain from (0, 0) to (width, 0).
    shift : float
        The largest distance of a vertex from the given one.
    turn : float
        The largest change of the direction of a side, radians.
    size : float
        A bound on the distance of two points of the hollow.
    """

    vertices: Floats
    shift: float
    turn: float
    size: float

    def turned(self, bounces: float) -> float:
        """Return a bound on the change of outgoing angles after a number of bounces, radians.

        The angle of a product of reflections changes by twice the sum of the changes of their sides.
        """
        return 2.0 * self.turn * bounces

    def moved(self, bounces: Floats) -> Floats:
        """Return bounds on the distance by which the vertices that rays pass move, unfolded along so many bounces.

        Reflection j of n moves all that lies beyond by twice the shift, and turns it by twice the turn about the side,
        from which the unfolded vertex has a distance of at most n - j + 2 sizes.
        """
        return (2.0 * bounces + 1.0) * self.shift + bounces * (bounces + 3.0) * self.turn * self.size


def symmetrised(chain: Floats) -> Symmetrised:
    """Return the exactly symmetric hollow of a chain of different points, and its distance from the chain.

    Of two vertices that are each other's images the one farther to the right stays; by Sterbenz's lemma the other is
    exact up to twice the width.

    Examples
    --------
    >>> found = symmetrised(np.array([(0.0, 0.0), (0.5 + 2.0**-50, -0.5), (1.0, 0.0)]))
    >>> found.vertices.tolist(), found.shift == 2.0**-50
    ([[0.0, 0.0], [0.5, -0.5], [1.0, 0.0]], True)
    """
    relative = chain - chain[0]
    width, number = relative[-1, 0], len(relative)
    image = relative[::-1]
    # of two equal ones the later
    right = (relative[:, 0] > image[:, 0]) | ((relative[:, 0] == image[:, 0]) & (2 * np.arange(number) >= number))
    x = np.where(right, relative[:, 0], width - image[:, 0])
    if number % 2:
        x[number // 2] = 0.5 * width
    vertices = np.column_stack([x, np.where(right, relative[:, 1], image[:, 1])])
    change = vertices - relative
    size = float(np.hypot(*np.ptp(relative, axis=0)))
    rest = UNIT_ROUNDOFF * size if x.max() > 2.0 * width else 0.0
    shift = float(np.hypot(*change.T).max()) + rest
    lengths, changes = (np.hypot(*np.diff(points, axis=0).T) for points in (relative, change))
    turn = float(((changes + 2.0 * rest) / lengths).max())
    return Symmetrised(vertices, shift, turn, size)
