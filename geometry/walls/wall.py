"""A rough wall: one period of curves from left to right, and islands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats, frozen, positive_number
from ...errors import InputError, WallError
from ..cells.hollow import Hollow, flat_tops, hollows_between
from ..cells.origin import HighestPoint, highest_point_of
from ..cells.profile import Seam, vertices_of_profile
from ..cells.validity import canonical_island, canonical_path, check_crossings, check_open_wall, wall_size
from ..curves.curve import Curve, Point
from ..curves.segment import Segment
from ..disk.disk import Disk

if TYPE_CHECKING:
    from ..scene.plan import TracePlan
    from ..scene.scene import Scene


@dataclass(frozen=True, repr=False)
class Wall:
    """One period of a wall, in y <= 0, whose free side is above (on the left of the direction of travel).

    Parameters
    ----------
    pieces : sequence of Segment, Arc or Bezier
        From left to right a connected path from (0, y0) to (period, y0), y0 <= 0. Pieces may overhang and touch each
        other, also along plates of zero thickness, but not cross.
    period : float
        Greater than 0.
    islands : sequence of sequences of pieces
        Closed loops that float above the path; loops that run counterclockwise are turned round.

    Attributes
    ----------
    pieces : tuple of pieces
        With exact joints: each piece starts to the bit where the one before ends. A curve that touches the level of
        the wall's highest points with its top is cut there, so there may be more pieces than were given.

    Raises
    ------
    WallError
        If pieces do not join, have no length, rise above y = 0 or cross, or if the path does not span the period. The
        message names the pieces and the place.

    Notes
    -----
    The conditions are those of Rudzis 2022, section 1.3.1, except that any depth is allowed. A wall without islands
    ``closes`` (conditions B5 and B5'): every excursion below the level of its highest points stays in one of its
    ``hollows``. Its period may begin anywhere and its highest points may lie below y = 0: all that depends on the law
    alone uses its ``cell``, which begins at one of them; places and angles of rays, pictures and files are in the
    coordinates in which the wall was given.

    Examples
    --------
    >>> wall = Wall.from_vertices([(0, 0), (0.5, -1.2), (1, 0)])
    >>> wall
    Wall(2 segments, period 1, depth 1.2, closes)
    >>> wall.arc_length
    2.6
    >>> wall.hollows
    (Hollow(left=0.0, right=1.0, first=0, last=2),)
    """

    pieces: tuple[Curve, ...]
    period: float = 1.0
    islands: tuple[tuple[Curve, ...], ...] = ()

    def __init__(self, pieces: Sequence[Curve], period: float = 1.0, islands: Sequence[Sequence[Curve]] = ()) -> None:
        width = positive_number("period", period)
        path = canonical_path(pieces, width)
        size = wall_size(path, width)
        loops = tuple(canonical_island(loop, width, size, k) for k, loop in enumerate(islands))
        self._fill(path, width, loops)
        if loops:
            check_open_wall(path, loops, width, size)
        numbers = range(len(path)) if self._cell is None else self._cell.numbers
        check_crossings(self.cell.pieces, loops, width, self.cell.depth, self.origin, numbers)
        if not self.closes:
            check_open_wall(path, loops, width, size)

    def _fill(self, pieces: tuple[Curve, ...], period: float, islands: tuple[tuple[Curve, ...], ...]) -> None:
        object.__setattr__(self, "pieces", pieces)
        object.__setattr__(self, "period", period)
        object.__setattr__(self, "islands", islands)

    def _image(self, x_factor: float, y_factor: float, period: float) -> Self:
        """Return an upright affine image: it needs no new validation."""
        image = object.__new__(type(self))
        paths = [tuple(p.stretched(x_factor, y_factor) for p in path) for path in (self.pieces, *self.islands)]
        image._fill(paths[0], period, tuple(paths[1:]))
        return image

    @classmethod
    def from_vertices(cls, vertices: ArrayLike) -> Self:
        """Return the polygonal wall through the given points; its period is the last x.

        Parameters
        ----------
        vertices : array_like, shape (n, 2)
            From (0, y0) to (period, y0).

        Raises
        ------
        WallError
            If a vertex is not finite or equals the one before it, or the wall breaks a condition.

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)]).depth
        0.4
        """
        try:
            points = np.array(vertices, dtype=np.float64)
        except (TypeError, ValueError) as reason:
            raise WallError(f"vertices: expected points (x, y), got {vertices!r}") from reason
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise WallError(f"vertices: expected an array of shape (n, 2) with n >= 2, got shape {points.shape}")
        bad = ~np.isfinite(points).all(axis=1)
        if bad.any():
            i = int(bad.argmax())
            raise WallError(f"vertices: expected finite coordinates, got {tuple(points[i].tolist())} at vertex {i}")
        same = np.all(points[1:] == points[:-1], axis=1)
        if same.any():
            i = int(same.argmax())
            raise WallError(f"vertices {i} and {i + 1} coincide at {tuple(points[i].tolist())}; leave one out")
        if not points[-1, 0] > 0.0:
            raise WallError(f"vertices: expected the last x, the period, to be greater than 0, got {points[-1, 0]:g}")
        corners = [(x, y) for x, y in points.tolist()]
        pieces = [Segment(p, q) for p, q in pairwise(corners)]
        return cls(pieces, period=corners[-1][0])

    @classmethod
    def from_profile(cls, x: ArrayLike, height: ArrayLike, seam: Seam = "mirror") -> Self:
        """Return the wall of a measured profile, in the profile's units.

        Parameters
        ----------
        x : array_like, shape (n,)
            Positions, strictly increasing, n >= 2.
        height : array_like, shape (n,)
            Heights above any level, in the same unit as ``x``.
        seam : {"mirror", "step"}
            How the profile becomes periodic: followed by its mirror image (twice its length), or repeated as it is
            with a vertical step between its last and its first height.

        Returns
        -------
        Wall
            Rolled to start at the profile's highest point, which becomes (0, 0).

        Raises
        ------
        InputError
            If the arrays do not match, a number is not finite or the positions do not increase.

        Examples
        --------
        >>> Wall.from_profile([0, 1, 3], [2, 5, 4]).vertices.tolist()
        [[0.0, 0.0], [2.0, -1.0], [4.0, 0.0], [5.0, -3.0], [6.0, 0.0]]
        """
        return cls.from_vertices(vertices_of_profile(x, height, seam))

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
        """How far the wall reaches below y = 0."""
        lowest = [float(self.vertices[:, 1].min())]
        lowest += [p.box[1] for path in (self.pieces, *self.islands) for p in path if not isinstance(p, Segment)]
        return max(0.0, -min(lowest + [float(v[:, 1].min()) for v in self.island_vertices]))

    @cached_property
    def arc_length(self) -> float:
        """The total length of all pieces, islands included."""
        return math.fsum(p.length for path in (self.pieces, *self.islands) for p in path)

    @cached_property
    def is_polygonal(self) -> bool:
        """Whether every piece is a Segment."""
        return all(isinstance(p, Segment) for path in (self.pieces, *self.islands) for p in path)

    @cached_property
    def _cell(self) -> HighestPoint | None:
        return highest_point_of(self)

    @cached_property
    def closes(self) -> bool:
        """Conditions B5, B5': no ray passes from cell to cell below the level of the wall's highest points.

        It holds if there are no islands; it is not made use of where pieces would vanish by rounding in ``cell``.

        Examples
        --------
        >>> Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).closes
        True
        """
        return self._cell is not None

    @cached_property
    def cell(self) -> Wall:
        """The same wall begun at one of its highest points and raised to y = 0; itself if it does not close.

        Two pieces that are parts of one, which the given period cuts, are one piece here.

        Examples
        --------
        >>> Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).cell.vertices.tolist()
        [[0.0, 0.0], [0.5, -1.0], [1.0, 0.0]]
        """
        if self._cell is None or self._cell.pieces is self.pieces:
            return self
        wall = object.__new__(Wall)
        wall._fill(self._cell.pieces, self.period, ())
        return wall

    @property
    def origin(self) -> Point:
        """Where the origin of ``cell`` lies in the coordinates of this wall.

        Examples
        --------
        >>> Wall.from_vertices([(0, -1.2), (0.5, -0.2), (1, -1.2)]).origin
        (0.5, -0.2)
        """
        return (0.0, 0.0) if self._cell is None else self._cell.origin

    @cached_property
    def is_mirror_symmetric(self) -> bool:
        """Whether the periodic wall has a mirror axis, to rounding; with islands only x = period/2 is tried."""
        from ..cells.mirror_symmetry import has_mirror_axis

        return has_mirror_axis(self.cell)

    @cached_property
    def flat_top(self) -> float:
        """The total length of the pieces that run rightward along the level of the highest points."""
        cell = self.cell
        return math.fsum(cell.pieces[i].length for i in flat_tops(cell.pieces, cell.vertices))

    @cached_property
    def scene(self) -> Scene:
        """The tables that the tracer reads, of the ``cell`` and in its coordinates, made on first use."""
        from ..scene.scene import scene_of

        return scene_of(self.cell)

    def plan(self) -> TracePlan:
        """What the tracer will do with this wall and what it leaves out.

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.5, 0), (0.5, -1), (1, -1), (1, 0)]).plan()  # doctest: +ELLIPSIS
        TracePlan(primitives=('lines',), hollows=1, pieces_traced=3, pieces_left_out=1, flat_share=0.5, ...)
        """
        from ..scene.plan import plan_of

        return plan_of(self)

    @cached_property
    def hollows(self) -> tuple[Hollow, ...]:
        """The openings on the level of the highest points with the pieces of ``cell`` below each, from there on.

        Left and right are in the coordinates of this wall, unfolded. Empty for a wall that does not close.

        Examples
        --------
        >>> Wall.from_vertices([(0, -1), (0.5, 0), (1, -1)]).hollows
        (Hollow(left=0.5, right=1.5, first=0, last=2),)
        """
        if self.cell is not self:
            x = self.origin[0]
            return tuple(replace(h, left=h.left + x, right=h.right + x) for h in self.cell.hollows)
        return hollows_between(flat_tops(self.pieces, self.vertices), self.vertices) if self.closes else ()

    def foreshorten(self, disk: Disk) -> Self:
        """Return the wall that the disk feels: y divided by ``disk.foreshortening``, same period.

        The law is that of the wall compressed along x by the foreshortening factor (Rudzis 2022, section 1.3.7).

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.5, -0.25), (1, 0)]).foreshorten(Disk(1.0, 1 / 3)).depth
        0.5
        """
        return self._image(1.0, 1.0 / _checked(disk).foreshortening, self.period)

    def unforeshorten(self, disk: Disk) -> Self:
        """Return the wall whose foreshortened wall this is: y multiplied by ``disk.foreshortening``."""
        return self._image(1.0, _checked(disk).foreshortening, self.period)

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
        image._fill(paths[0], self.period, tuple(paths[1:]))
        return image

    def outline(self, tolerance: float) -> Floats:
        """Return the path of one period as a polyline within ``tolerance``, shape (n, 2); islands left out."""
        chunks = [p.flattened(tolerance)[:-1] for p in self.pieces]
        return np.concatenate([*chunks, self.vertices[-1:]])

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the wall as a TOML file from which ``load_wall`` reads the same wall to the bit.

        Raises
        ------
        FileExistsRefusal
            If the file exists and ``overwrite`` is false.
        InputError
            If the file cannot be written.
        """
        from ..cells.toml import save_wall

        save_wall(self, path, overwrite=overwrite)

    def __repr__(self) -> str:
        names = [type(p).__name__.lower() for path in (self.pieces, *self.islands) for p in path]
        counts = [f"{names.count(n)} {n}{'s' * (names.count(n) > 1)}" for n in dict.fromkeys(names)]
        if self.islands:
            counts.append(f"{len(self.islands)} island{'s' * (len(self.islands) > 1)}")
        state = "closes" if self.closes else "open"
        return f"Wall({', '.join(counts)}, period {self.period:g}, depth {self.depth:.6g}, {state})"

    def __getstate__(self) -> dict[str, Any]:
        # cached arrays stay behind: an unpickled array would be writable
        return {"pieces": self.pieces, "period": self.period, "islands": self.islands}


def _vertices(path: Sequence[Curve]) -> Floats:
    return frozen([*(p.start for p in path), path[-1].end])


def _checked(disk: Disk) -> Disk:
    if not isinstance(disk, Disk):
        raise InputError(f"disk: expected a Disk such as geo.Disk(mass=1.0, inertia=0.5), got {disk!r}")
    return disk
