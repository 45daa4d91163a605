"""The cell of a periodic wall: its pieces over one period, its islands, its origin, and its geometric properties.

The origin is one of the wall's highest points (condition B5'; Rudzis 2022, section 1.3.1). A wall without islands
closes if its period begins at any of them. So the law of the wall is that of the cell that begins there, for any given
start of the period and any height of the wall below y = 0. Nor do rays depend on where a curve was cut in pieces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, frozen, positive_number
from ...core.estimates import Estimate
from ...core.rounding import EPS
from ..curves.crossings import directions_of, straight_in
from ..curves.curve import Curve, Point, point_array
from ..curves.segment import Segment


@dataclass(frozen=True, repr=False)
class Cell:
    """The pieces of a wall over one period and its islands; `Wall` adds validation, files and rays.

    Attributes
    ----------
    pieces : tuple of Curve
        Each piece starts exactly at the end of the piece before.
    period : float
    islands : tuple of tuples of Curve
    unit : str
        Of lengths, for the axes of pictures; empty where none was given. It does not count when walls are compared.
    """

    pieces: tuple[Curve, ...]
    period: float = 1.0
    islands: tuple[tuple[Curve, ...], ...] = ()
    unit: str = field(default="", compare=False)

    def _fill(
        self, pieces: tuple[Curve, ...], period: float, islands: tuple[tuple[Curve, ...], ...], unit: str = ""
    ) -> None:
        object.__setattr__(self, "unit", unit)
        object.__setattr__(self, "pieces", pieces)
        object.__setattr__(self, "period", period)
        object.__setattr__(self, "islands", islands)

    def _image(self, x_factor: float, y_factor: float, period: float) -> Self:
        """Return the image under scaling of x and y, which needs no new validation."""
        image = object.__new__(type(self))
        paths = [tuple(p.stretched(x_factor, y_factor) for p in path) for path in (self.pieces, *self.islands)]
        image._fill(paths[0], period, tuple(paths[1:]), self.unit)
        return image

    @cached_property
    def vertices(self) -> Floats:
        """The joints, shape (n + 1, 2), read-only: piece i goes from ``vertices[i]`` to ``vertices[i + 1]``."""
        return _vertices(self.pieces)

    @cached_property
    def island_vertices(self) -> tuple[Floats, ...]:
        """The joints of every island, each (n + 1, 2) and read-only; the last equals the first."""
        return tuple(_vertices(loop) for loop in self.islands)

    @cached_property
    def depth(self) -> float:
        """The depth of the wall below y = 0."""
        lowest = [float(self.vertices[:, 1].min())]
        lowest += [p.box[1] for path in (self.pieces, *self.islands) for p in path if not p.is_straight]
        return max(0.0, -min(lowest + [float(v[:, 1].min()) for v in self.island_vertices]))

    @cached_property
    def arc_length(self) -> float:
        """The total length of all pieces, islands included."""
        return math.fsum(p.length for path in (self.pieces, *self.islands) for p in path)

    @cached_property
    def singular_points(self) -> Floats:
        """The points of one period where the wall is not C^2, shape (n, 2), read-only: corners and jumps of curvature.

        Elsewhere the collision of rays and of disks is smooth (Rudzis 2022, sections 1.2.1 and 6.1).

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.triangular_teeth(1.5707963267948966).singular_points.round(15).tolist()
        [[0.0, 0.0], [0.5, -0.5]]
        """
        return singular_points_of((self.pieces, *self.islands))

    @cached_property
    def largest_curvature(self) -> Estimate:
        """kappa_max, the largest curvature of the wall off its singular points, with a bound on the error.

        The lemmas of Rudzis 2022, section 5.3.4, use it. It is infinite if the tangent vector of a Bezier piece
        vanishes.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> float(geo.dispersing_arcs(0.5).largest_curvature), float(geo.koch(1).largest_curvature)
        (0.5, 0.0)
        """
        return largest_curvature_of((self.pieces, *self.islands))

    @cached_property
    def is_polygonal(self) -> bool:
        """Whether every piece is a Segment, or straight to rounding."""
        return all(p.is_straight for path in (self.cell.pieces, *self.cell.islands) for p in path)

    @cached_property
    def _highest(self) -> HighestPoint | None:
        return None if self.islands else highest_point_of(self.pieces, self.vertices, self.period)

    @cached_property
    def closes(self) -> bool:
        """Whether no ray passes from cell to cell below the wall's highest points (conditions B5, B5').

        True for every wall without islands, unless ``cell`` would lose a piece by rounding.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).closes
        True
        """
        return self._highest is not None

    @cached_property
    def cell(self) -> Self:
        """The wall of all computations: moved so that a highest point is the origin if it closes, and of fewest pieces.

        Consecutive parts of one straight side, arc or Bezier curve are joined to one piece if their joints are on it to
        rounding, also at the ends of the period. Otherwise it is the wall itself.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).cell.vertices.tolist()
        [[0.0, 0.0], [0.5, -1.0], [1.0, 0.0]]
        """
        pieces = merged(self.pieces if self._highest is None else self._highest.pieces)
        islands = tuple(merged(loop, is_loop=True) for loop in self.islands)
        if pieces is self.pieces and all(one is loop for one, loop in zip(islands, self.islands, strict=True)):
            return self
        cell = object.__new__(type(self))
        cell._fill(pieces, self.period, islands, self.unit)
        vars(cell)["cell"] = cell
        return cell

    @property
    def origin(self) -> Point:
        """The origin of ``cell`` in the coordinates of this wall.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).origin
        (0.5, -0.2)
        """
        return (0.0, 0.0) if self._highest is None else self._highest.origin

    @cached_property
    def flat_top(self) -> float:
        """The total length of the pieces that run rightward along the level of the highest points."""
        cell = self.cell
        return math.fsum(cell.pieces[i].length for i in flat_tops(cell.pieces, cell.vertices))

    @cached_property
    def hollows(self) -> tuple[Hollow, ...]:
        """The hollows of one period: each opening at the level of the highest points, with its pieces of ``cell``.

        Left and right are in the coordinates of this wall and may exceed the period. Empty for a wall that does not
        close.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.Wall.from_vertices([(0, -1), (0.5, 0), (1, -1)]).hollows
        (Hollow(left=0.5, right=1.5, first=0, last=2),)
        """
        if self.cell is not self:
            x = self.origin[0]
            return tuple(replace(h, left=h.left + x, right=h.right + x) for h in self.cell.hollows)
        return hollows_between(flat_tops(self.pieces, self.vertices), self.vertices) if self.closes else ()

    def scaled(self, factor: float) -> Self:
        """Return the wall enlarged by ``factor`` > 0, its period included."""
        c = positive_number("factor", factor)
        return self._image(c, c, c * self.period)

    def mirrored(self) -> Self:
        """Return the mirror image of the cell in x = period/2."""
        image = self._image(-1.0, 1.0, self.period)
        paths = [
            tuple(p.moved(self.period, 0.0).reversed() for p in reversed(path))
            for path in (image.pieces, *image.islands)
        ]
        image._fill(paths[0], self.period, tuple(paths[1:]), self.unit)
        return image

    def __repr__(self) -> str:
        names = [type(p).__name__.lower() for path in (self.pieces, *self.islands) for p in path]
        counts = [f"{names.count(n)} {n}{'s' * (names.count(n) > 1)}" for n in dict.fromkeys(names)]
        if self.islands:
            counts.append(f"{len(self.islands)} island{'s' * (len(self.islands) > 1)}")
        state = "closes" if self.closes else "open"
        return f"{type(self).__name__}({', '.join(counts)}, period {self.period:g}, depth {self.depth:.6g}, {state})"

    def __getstate__(self) -> dict[str, Any]:
        # cached arrays stay behind: an unpickled array would be writable
        return {"pieces": self.pieces, "period": self.period, "islands": self.islands, "unit": self.unit}


def _vertices(path: Sequence[Curve]) -> Floats:
    return frozen(point_array([*[p.start for p in path], path[-1].end]))


@dataclass(frozen=True)
class HighestPoint:
    """The pieces of a wall over one period, starting from one of its highest points as the origin.

    Parameters
    ----------
    pieces : tuple of Curve
        From (0, 0) to (period, 0).
    origin : (float, float)
        The position of (0, 0) in the coordinates of the wall.
    numbers : tuple of int
        For every piece its index in the wall.
    """

    pieces: tuple[Curve, ...]
    origin: Point
    numbers: tuple[int, ...]


def highest_point_of(path: tuple[Curve, ...], joints: Floats, period: float) -> HighestPoint | None:
    """Return the cell of a wall without islands; None without a first top or if rounding would remove a piece."""
    first = first_top(joints, period)
    if first is None:
        return None
    first = _above_a_plate(path, joints, first)
    x, y = (float(c) for c in joints[first])
    count = len(path)
    if first == 0 and y == 0.0:
        return HighestPoint(path, (0.0, 0.0), tuple(range(count)))
    order = [*range(first, count), *range(first)]
    shifts = np.where(np.array(order) >= first, -x, period - x)
    starts = joints[order] + np.column_stack([shifts, np.full(count, -y)])
    vertices = np.concatenate([starts, [(period, 0.0)]])
    given = joints[1:][order] - joints[:-1][order]
    if np.any(np.all(vertices[1:] == vertices[:-1], axis=1) & np.any(given != 0.0, axis=1)):
        return None
    points = [(px, py) for px, py in vertices.tolist()]
    pieces = tuple(
        Segment(start, end) if path[k].is_straight else path[k].moved(float(shift), -y).pinned(start, end)
        for k, shift, (start, end) in zip(order, shifts, pairwise(points), strict=True)
    )
    return HighestPoint(pieces, (x, y), tuple(order))


def _above_a_plate(path: tuple[Curve, ...], joints: Floats, top: int) -> int:
    """Return the first joint at the point of a top with the sky on its left: on a plate there is one below it, too."""
    same = np.flatnonzero(np.all(joints[:-1] == joints[top], axis=1))
    if len(same) > 1:
        into, out = directions_of(path)
        # angles from straight down, from -pi/2 on the left to pi/2 on the right
        back, on = (np.arctan2(x, -y) for x, y in (-into[same - 1].T, out[same].T))
        above = same[on >= back]
        top = int(above[0]) if len(above) else top
    return top


def first_top(vertices: Floats, period: float) -> int | None:
    """Return the first joint of greatest height with all others of that height at most one period to its right.

    Only joints on plates of zero thickness, which run back below a flat top, lack this property.

    Examples
    --------
    >>> first_top(np.array([(0, -1), (0.2, 0), (0.5, 0), (0.3, 0), (1, -1)]), 1.0)
    1
    """
    height = vertices[:-1, 1]
    tops = np.flatnonzero(height == height.max())
    x = vertices[tops, 0]
    # extremal x of this joint and the later ones, and of the earlier ones shifted by one period
    least = np.minimum.accumulate(x[::-1])[::-1]
    most = np.maximum.accumulate(x[::-1])[::-1]
    least[1:] = np.minimum(least[1:], np.minimum.accumulate(x)[:-1] + period)
    most[1:] = np.maximum(most[1:], np.maximum.accumulate(x)[:-1] + period)
    found = tops[(least >= x) & (most <= x + period)]
    return int(found[0]) if len(found) else None


# Two pieces are parts of one curve if it passes within this distance, relative to the wall's size, of their joint and
# of points of both. The joint is computed by a few dozen operations, and shifting the cell rounds once more.
SAME_PIECE = 64.0 * EPS
# Joints lie on one side within this distance, relative to the largest x and the largest y: a point of a side is
# computed by three operations, and a wall is moved and stretched after that.
ON_SIDE = 8.0 * EPS
# No part is shorter than this, relative to the wall's size: the end of a plate that is thinner has no direction.
SHORTEST = 1e-12


def merged(path: tuple[Curve, ...], is_loop: bool = False) -> tuple[Curve, ...]:
    """Return the path without the joints at which nothing changes; the path itself if there are none.

    Joints at height 0 stay, because hollows end there, except between level segments. A curve that is straight to
    rounding becomes a segment.

    Examples
    --------
    >>> merged((Segment((0, 0), (1, -1)), Segment((1, -1), (3, -3)), Segment((3, -3), (4, 0))))
    (Segment(start=(0.0, 0.0), end=(3.0, -3.0)), Segment(start=(3.0, -3.0), end=(4.0, 0.0)))
    """
    starts, ends = point_array([piece.start for piece in path]), point_array([piece.end for piece in path])
    size = np.maximum(np.abs(starts).max(axis=0), np.abs(ends[-1]))
    chords = [k for k, piece in enumerate(path) if not piece.is_straight and _is_chord(piece, size)]
    if chords:
        path = tuple(Segment(piece.start, piece.end) if k in chords else piece for k, piece in enumerate(path))
    straight, before = straight_in(path), np.arange(-1, len(path) - 1)
    level = straight & (starts[before, 1] == 0.0) & (ends[:, 1] == 0.0)
    able = (straight == straight[before]) & (level | (starts[:, 1] != 0.0))
    able[0] &= is_loop
    able &= ~straight | _between(starts[before], starts, ends, size)
    for k in np.flatnonzero(able & ~straight).tolist():
        able[k] = bool(_whole((path[k - 1], path[k]), size))
    if not able.any():
        return path
    first = int(np.argmin(able))
    path, firsts = path[first:] + path[:first], np.flatnonzero(~np.roll(able, -first)).tolist() or [0]
    groups = [path[low:high] for low, high in pairwise([*firsts, len(path)])]
    return tuple(piece for group in groups for piece in _whole(group, size) or group)


def _is_chord(piece: Curve, size: Floats) -> bool:
    """Return whether a curve is the straight line between its ends, to rounding."""
    hull = point_array(piece.hull(piece.start, piece.end))
    return bool(_between(np.array([piece.start]), hull, np.array([piece.end]), size, -SHORTEST).all())


def _between(start: Floats, points: Floats, end: Floats, size: Floats, inside: float = SHORTEST) -> NDArray[np.bool_]:
    """Return whether points lie between two others on the straight line, to rounding; all of shape (n, 2).

    They are so far from both, relative to the wall's size; a negative distance admits both.
    """
    step, whole = points - start, end - start
    along, across = np.sum(step * whole, axis=1), step[:, 0] * whole[:, 1] - step[:, 1] * whole[:, 0]
    near = np.abs(across) <= ON_SIDE * (np.abs(whole) @ size[::-1])
    length = np.hypot(*whole.T)
    least = inside * size.max() * length
    return np.asarray(near & (along > least) & (along < length**2 - least))


def _whole(parts: tuple[Curve, ...], size: Floats) -> list[Curve]:
    """Return the curve whose consecutive parts are the given pieces of one kind; an empty list if there is none."""
    start, end = parts[0].start, parts[-1].end
    if parts[0].is_straight:
        joints = point_array([piece.start for piece in parts[1:]])
        return [Segment(start, end)] if _between(np.array([start]), joints, np.array([end]), size).all() else []
    if end < start:
        # in one direction of the two, so that coincident faces stay coincident
        return [p.reversed() for p in _whole(tuple(part.reversed() for part in reversed(parts)), size)]
    whole: Curve | None = parts[0]
    for part in parts[1:]:
        whole = whole and whole.joined(part, SAME_PIECE * float(size.max()))
    return [whole] if whole else []


# Largest angle between tangents, radians, and relative jump of the curvature, at a joint that counts as smooth. They
# agree to a few rounding errors where a curve was cut in two.
SMOOTH_ANGLE, SMOOTH_JUMP = 1e-9, 1e-9


def singular_points_of(paths: Sequence[Sequence[Curve]]) -> Floats:
    """Return the joints, shape (n, 2), of cycles of pieces at which the tangent or the curvature jumps."""
    found = [after.start for path in paths for before, after in _neighbours(path) if not _is_smooth(before, after)]
    return frozen(np.array(found, dtype=np.float64).reshape(-1, 2))


def _neighbours(path: Sequence[Curve]) -> list[tuple[Curve, Curve]]:
    return [(path[i - 1], path[i]) for i in range(len(path))]


def _is_smooth(before: Curve, after: Curve) -> bool:
    (tx, ty), (ux, uy) = before.tangent(1.0), after.tangent(0.0)
    if abs(tx * uy - ty * ux) > SMOOTH_ANGLE or tx * ux + ty * uy < 0.0:
        return False
    left, right = before.curvature(1.0), after.curvature(0.0)
    if not (math.isfinite(left) and math.isfinite(right)):
        return False
    return abs(left - right) <= SMOOTH_JUMP * max(abs(left), abs(right))


def largest_curvature_of(paths: Sequence[Sequence[Curve]]) -> Estimate:
    """Return the largest curvature of all pieces with a bound on its error."""
    found = [piece.largest_curvature() for path in paths for piece in path]
    value = max(v for v, _ in found)
    error = 0.0 if value == math.inf else max(v + e for v, e in found) - value
    method = "critical points of the pieces, checked in floating point by Bernstein coefficients"
    return Estimate(value, max(0.0, error), "bound", method)


@dataclass(frozen=True)
class Hollow:
    """One opening of a wall with the pieces below it.

    Parameters
    ----------
    left, right : float
        The opening is left < x < right at the level of the wall's highest points.
    first, last : int
        ``wall.cell.pieces[first:last]`` is the boundary of the hollow from its left end to its right end. A wall that
        begins at (0, 0), and no side or curve of which is cut in parts, is its own ``cell``.
    """

    left: float
    right: float
    first: int
    last: int

    @property
    def width(self) -> float:
        """The width of the opening."""
        return self.right - self.left


def flat_tops(pieces: Sequence[Curve], vertices: Floats) -> list[int]:
    """Return the indices of the pieces that run rightward along y = 0."""
    level = (vertices[:-1, 1] == 0.0) & (vertices[1:, 1] == 0.0) & (vertices[1:, 0] > vertices[:-1, 0])
    return [i for i in level.nonzero()[0].tolist() if pieces[i].is_straight]


def hollows_between(tops: Sequence[int], vertices: Floats) -> tuple[Hollow, ...]:
    """Return the hollows of a closed wall: the chains of pieces between flat tops, cut at joints at height 0.

    Only joints with x strictly between the ends of a chain cut it. The other joints at height 0 belong to pieces that
    run back below a flat top (a plate of zero thickness).
    """
    found: list[Hollow] = []
    count = len(vertices) - 1
    edges = [-1, *tops, count]
    touching = vertices[:, 1] == 0.0
    for before, after in pairwise(edges):
        first, last = before + 1, after
        if first == last:
            continue
        left, right = float(vertices[first, 0]), float(vertices[last, 0])
        for joint in (first + 1 + touching[first + 1 : last].nonzero()[0]).tolist():
            x = float(vertices[joint, 0])
            if left < x < right:
                found.append(Hollow(left, x, first, joint))
                left, first = x, joint
        if left < right:
            found.append(Hollow(left, right, first, last))
    return tuple(found)
