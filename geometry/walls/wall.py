"""A rough wall: a cell with its constructors, its foreshortened image, its tables for tracing and its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, positive_number
from ...core.errors import InputError, WallError
from ..cells.cell import Cell
from ..cells.mirror_symmetry import has_mirror_axis
from ..cells.profile import Seam, vertices_of_profile
from ..cells.toml import read_wall, save_wall
from ..cells.validity import canonical_island, canonical_path, check_crossings, check_open_wall, wall_size
from ..curves.curve import Curve
from ..curves.segment import Segment
from ..disk.disk import Disk
from ..scene.plan import TracePlan, plan_of
from ..scene.scene import Scene, scene_of


@dataclass(frozen=True, repr=False, init=False)
class Wall(Cell):
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
        message names the pieces and the position.

    Notes
    -----
    The conditions are those of Rudzis 2022, section 1.3.1, except that any depth is allowed. A wall without islands
    ``closes`` (conditions B5 and B5'): every excursion below the level of its highest points stays in one of its
    ``hollows``. Its period may begin anywhere and its highest points may lie below y = 0: all that depends on the law
    alone uses its ``cell``, which begins at one of them; positions and angles of rays, pictures and files are in the
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

    def __init__(self, pieces: Sequence[Curve], period: float = 1.0, islands: Sequence[Sequence[Curve]] = ()) -> None:
        width = positive_number("period", period)
        path = canonical_path(pieces, width)
        size = wall_size(path, width)
        loops = tuple(canonical_island(loop, width, size, k) for k, loop in enumerate(islands))
        self._fill(path, width, loops)
        if loops:
            check_open_wall(path, loops, width, size)
        numbers = range(len(path)) if self._highest is None else self._highest.numbers
        check_crossings(self.cell.pieces, loops, width, self.cell.depth, self.origin, numbers)
        if not self.closes:
            check_open_wall(path, loops, width, size)

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
    def is_mirror_symmetric(self) -> bool:
        """Whether the periodic wall has a mirror axis, to rounding; with islands only x = period/2 is tried."""
        return has_mirror_axis(self.cell)

    @cached_property
    def scene(self) -> Scene:
        """The tables that the tracer reads, of the ``cell`` and in its coordinates, made on first use."""
        return scene_of(self.cell)

    def plan(self) -> TracePlan:
        """What the tracer will do with this wall and what it leaves out.

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.5, 0), (0.5, -1), (1, -1), (1, 0)]).plan()  # doctest: +ELLIPSIS
        TracePlan(primitives=('lines',), hollows=1, pieces_traced=3, pieces_left_out=1, flat_fraction=0.5, ...)
        """
        return plan_of(self.cell, self.cell.scene, self.is_mirror_symmetric)

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
        save_wall(self, path, overwrite=overwrite)


def _checked(disk: Disk) -> Disk:
    if not isinstance(disk, Disk):
        raise InputError(f"disk: expected a Disk such as geo.Disk(mass=1.0, inertia=0.5), got {disk!r}")
    return disk


def load_wall(path: str | PathLike[str]) -> Wall:
    """Read a wall from a TOML file.

    Parameters
    ----------
    path : path
        A file that ``Wall.save`` wrote, or one written by hand: ``period``, then either ``vertices`` (a list of
        points) or ``[[pieces]]`` tables of ``kind`` "segment" (``start``, ``end``), "arc" (``center``,
        ``semi_axes``, ``angles`` and, where known exactly, ``start`` and ``end``) or "bezier" (``control_points``);
        islands are ``[[islands]]`` tables with ``pieces``.

    Returns
    -------
    Wall
        Equal to the saved one, to the bit.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or has a missing, unknown or unsuitable key.
    WallError
        If the wall breaks a condition.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "wall.toml"
    ...     _ = file.write_text("period = 1.0\\nvertices = [[0, 0], [0.2, -0.4], [1, 0]]")
    ...     load_wall(file) == Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)])
    True
    """
    pieces, period, islands = read_wall(path)
    try:
        return Wall(pieces, period, islands)
    except InputError as reason:
        raise type(reason)(f"{Path(path)}: {reason}") from reason
