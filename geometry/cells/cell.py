"""The cell of a periodic wall: its pieces over one period, its islands, and its geometric properties."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

from ...core.checks import Floats, frozen, positive_number
from ...core.estimates import Estimate
from ..curves.curve import Curve, Point, point_array
from .hollow import Hollow, flat_tops, hollows_between
from .merging import merged
from .origin import HighestPoint, highest_point_of
from .regularity import largest_curvature_of, singular_points_of


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
        """Whether every piece is a Segment."""
        return all(p.is_straight for path in (self.pieces, *self.islands) for p in path)

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
    return frozen(point_array([*(p.start for p in path), path[-1].end]))
