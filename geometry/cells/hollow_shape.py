"""The shape of a hollow: its copies along the wall, and its mirror symmetry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, frozen
from ...core.rounding import EPS
from ..curves.arc import Arc
from ..curves.curve import INNER, Curve
from ..curves.segment import Segment
from .cell import Cell, Hollow, flat_tops

# Relative tolerance for equal shapes and for level or vertical sides. Each coordinate is rounded once, and named walls
# compute it by about ten operations.
SHAPE_TOLERANCE = 64.0 * EPS
# The ends and these three inner points determine a piece: circles need three points, ellipses and cubics five.
# Flat top beside a hollow that is wider than its opening, as a fraction of what exceeds the opening.
BESIDE = 1.02
AnyCell = TypeVar("AnyCell", bound=Cell)


@dataclass(frozen=True, eq=False)
class HollowShape:
    """A hollow moved to x = 0 and scaled to an opening of width 1.

    Parameters
    ----------
    kinds : tuple of type
        The classes of its pieces from left to right.
    vertices : array, shape (pieces + 1, 2)
        From (0, 0) to (1, 0).
    inner : array, shape (curved pieces, 3, 2)
        Points inside the pieces that are not straight.
    rounding : float
        Bound on the error of a coordinate due to rounding of the wall's coordinates.
    """

    kinds: tuple[type[Curve], ...]
    vertices: Floats
    inner: Floats
    rounding: float

    @classmethod
    def of(cls, wall: Cell, hollow: Hollow) -> HollowShape:
        """Return the shape of one hollow of a wall that is its own ``cell``."""
        pieces = wall.pieces[hollow.first : hollow.last]
        corner = np.array([hollow.left, 0.0])
        vertices = (wall.vertices[hollow.first : hollow.last + 1] - corner) / hollow.width
        vertices[-1, 0] = 1.0
        curved = [piece.point(INNER) for piece in pieces if not piece.is_straight]
        inner = (np.reshape(curved, (-1, len(INNER), 2)) - corner) / hollow.width
        size = max(wall.period / hollow.width, float(np.abs(vertices).max()))
        kinds = tuple(map(type, pieces))
        return cls(kinds, frozen(vertices), frozen(inner), SHAPE_TOLERANCE * size)

    def mirrored(self) -> HollowShape:
        """Return the shape of the mirror image."""
        vertices, inner = self.vertices[::-1].copy(), self.inner[::-1, ::-1].copy()
        vertices[:, 0], inner[..., 0] = 1.0 - vertices[:, 0], 1.0 - inner[..., 0]
        return HollowShape(self.kinds[::-1], frozen(vertices), frozen(inner), self.rounding)

    def same_as(self, other: HollowShape) -> bool:
        """Whether two shapes are equal within the larger of their roundings."""
        if self.kinds != other.kinds:
            return False
        rounding = max(self.rounding, other.rounding)
        pairs = ((self.vertices, other.vertices), (self.inner, other.inner))
        return all(bool(np.all(np.abs(one - two) <= rounding)) for one, two in pairs)

    @property
    def apex_angle(self) -> float | None:
        """The angle at the bottom of an isosceles triangle, radians; None for every other shape."""
        if self.kinds != (Segment,) * 2 or abs(self.vertices[1, 0] - 0.5) > SHAPE_TOLERANCE:
            return None
        return 2.0 * math.atan2(0.5, -self.vertices[1, 1])

    @property
    def height_to_width(self) -> float | None:
        """Depth over width of a rectangle; None for every other shape."""
        if self.kinds != (Segment,) * 3:
            return None
        (left, depth), (right, other) = self.vertices[1:3].tolist()
        level = depth < 0.0 and abs(other - depth) <= SHAPE_TOLERANCE * abs(depth)
        return -depth if level and max(abs(left), abs(right - 1.0)) <= SHAPE_TOLERANCE else None


def distinct_hollows(wall: Cell) -> list[tuple[HollowShape, list[Hollow]]]:
    """Return the distinct shapes of a closed wall's hollows, each with the hollows of ``wall.cell`` of that shape.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> wall = geo.Wall.from_vertices([(0, 0), (0.1, -0.2), (0.2, 0), (0.6, -0.8), (1, 0)])
    >>> [(round(shape.apex_angle, 12), len(hollows)) for shape, hollows in distinct_hollows(wall)]
    [(0.927295218002, 2)]
    """
    found: dict[tuple[type[Curve], ...], list[tuple[HollowShape, list[Hollow]]]] = {}
    cell = wall.cell
    for hollow in cell.hollows:
        shape = HollowShape.of(cell, hollow)
        alike = found.setdefault(shape.kinds, [])
        for known, hollows in alike:
            if shape.same_as(known):
                hollows.append(hollow)
                break
        else:
            alike.append((shape, [hollow]))
    return [entry for alike in found.values() for entry in alike]


def side_by_side(cell: AnyCell, hollows: Sequence[Hollow]) -> AnyCell:
    """Return the cell of these hollows alone, with flat tops only where a hollow is wider than its opening.

    ``cell`` is its own ``cell``. The result needs no new validation, because its hollows do not overlap.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> wall = geo.Wall.from_vertices([(0, 0), (0.1, -0.2), (0.2, 0), (0.6, -0.8), (1, 0)])
    >>> side_by_side(wall, wall.hollows[:1]).vertices.tolist()
    [[0.0, 0.0], [0.1, -0.2], [0.2, 0.0]]
    """
    pieces: list[Curve] = []
    x = 0.0
    for hollow in hollows:
        path = cell.pieces[hollow.first : hollow.last]
        least, most = min(piece.box[0] for piece in path), max(piece.box[2] for piece in path)
        rounding = SHAPE_TOLERANCE * cell.period
        before, after = (
            BESIDE * beyond if beyond > rounding else 0.0 for beyond in (hollow.left - least, most - hollow.right)
        )
        pieces += [Segment((x, 0.0), (x + before, 0.0))] if before else []
        x, shift = x + before, x + before - hollow.left
        joints = (cell.vertices[hollow.first : hollow.last + 1] + np.array([shift, 0.0])).tolist()
        joints[0] = [x, 0.0]
        pieces += [
            piece.moved(shift, 0.0).pinned((a, b), (c, d))
            for piece, ((a, b), (c, d)) in zip(path, pairwise(joints), strict=True)
        ]
        x = joints[-1][0]
        pieces += [Segment((x, 0.0), (x + after, 0.0))] if after else []
        x += after
    found = object.__new__(type(cell))
    found._fill(tuple(pieces), x, (), cell.unit)
    return found


# Distance up to which points of mirror images agree, relative to the wall's size. A mirrored point rounds once, but
# the two halves of a wall may have been computed by formulas of about fifty operations.
MIRROR_TOLERANCE = 256.0 * EPS
# Parameters at which pieces are compared, besides 0; the set is symmetric under t -> 1 - t.
PARAMETERS = np.array([0.25, 0.5, 0.75, 1.0])
# Starts from which on a correlation excludes most of them at once: a comparison takes a time of order n for each start,
# and the heights of a measured profile repeat. Its error is below some ten roundings for each of the log2(n) stages of
# the transforms, in units of the sum of the squares.
MANY_STARTS, CORRELATION_ULPS = 16, 1024.0


def has_mirror_axis(wall: Cell) -> bool:
    """Whether the periodic wall has a mirror axis x = const; for a wall with islands only x = period/2 is tested.

    A wall without islands is compared with its mirror image as a cycle of pieces, starting from every piece at which
    the two may agree. So the result does not depend on the start of the cell.
    """
    tolerance = MIRROR_TOLERANCE * max(wall.period, float(np.abs(wall.vertices).max()), wall.depth)
    if wall.islands:
        image = wall.mirrored()
        islands, images = map(_with_bottom_starts, (wall.islands, image.islands))
        return _agree(wall.pieces, image.pieces, tolerance) and all(
            any(_agree(loop[k:] + loop[:k], other, tolerance) for other in images for k in range(len(loop)))
            for loop in islands
        )
    own = _steps(_closed_up(wall))
    other = _mirrored(own)
    starts = np.flatnonzero(np.abs(own - other[0]).max(axis=(1, 2)) <= tolerance)
    if len(starts) > MANY_STARTS:
        starts = starts[_may_agree(own[:, -1], other[:, -1], tolerance)[starts]]
    return any(np.abs(np.roll(own, -k, axis=0) - other).max() <= tolerance for k in starts.tolist())


def _may_agree(own: Floats, other: Floats, tolerance: float) -> NDArray[np.bool_]:
    """Return for each k whether the cycle of vectors ``own``, started at k, may agree with the cycle ``other``.

    The sum over j of |own[k + j] - other[j]|^2 follows for all k from one circular correlation. It is at most
    2 n tolerance^2 where the cycles agree.
    """
    own, other = own - own.mean(axis=0), other - other.mean(axis=0)
    product = np.fft.rfft(own, axis=0) * np.fft.rfft(other, axis=0).conj()
    correlation = np.fft.irfft(product.sum(axis=1), len(own))
    squares = float((own * own).sum() + (other * other).sum())
    return np.asarray(squares - 2.0 * correlation <= 2.0 * len(own) * tolerance**2 + CORRELATION_ULPS * EPS * squares)


def _closed_up(wall: Cell) -> Sequence[Curve]:
    """Return the pieces of a wall as a cycle; a flat top that the ends of the period cut is joined."""
    pieces, last = wall.pieces, len(wall.pieces) - 1
    if last < 1 or not {0, last} <= set(flat_tops(pieces, wall.vertices)):
        return pieces
    return (Segment(pieces[-1].start, (wall.period + pieces[0].end[0], 0.0)), *pieces[1:-1])


def _with_bottom_starts(islands: Sequence[Sequence[Curve]]) -> list[tuple[Curve, ...]]:
    """Return the islands with each whole ellipse starting at its lowest point, since its given start is arbitrary."""
    bottom = -0.5 * np.pi
    return [
        (Arc(loop[0].center, loop[0].semi_axes, bottom, bottom + 2.0 * np.pi * loop[0].direction),)
        if len(loop) == 1 and isinstance(loop[0], Arc)
        else tuple(loop)
        for loop in islands
    ]


def _steps(path: Sequence[Curve]) -> Floats:
    """Return the points of every piece at PARAMETERS relative to its start, shape (n, 4, 2)."""
    start, end = (np.array([getattr(piece, name) for piece in path]) for name in ("start", "end"))
    # the points of a segment follow from its ends
    steps = PARAMETERS[:, None] * (end - start)[:, None, :]
    for i, piece in enumerate(path):
        if not piece.is_straight:
            steps[i, :-1] = piece.point(PARAMETERS[:-1]) - start[i]
    return np.asarray(steps)


def _mirrored(steps: Floats) -> Floats:
    """Return the steps of the mirror image; its parameter at a point is 1 - t."""
    end = steps[:, -1:]
    points = np.concatenate([steps[:, -2::-1] - end, -end], axis=1)
    return np.asarray(points[::-1] * [-1.0, 1.0])


def _agree(path: Sequence[Curve], other: Sequence[Curve], tolerance: float) -> bool:
    """Whether two paths agree piece by piece within ``tolerance``."""
    if len(path) != len(other) or [type(p) for p in path] != [type(p) for p in other]:
        return False
    starts = np.array([p.start for p in path]) - np.array([p.start for p in other])
    return bool(np.abs(starts).max() <= tolerance and np.abs(_steps(path) - _steps(other)).max() <= tolerance)
