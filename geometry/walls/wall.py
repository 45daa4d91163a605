"""A rough wall: a cell with constructors, foreshortening, tables for tracing, and a file format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, instance, numbers, positive_number, sequence
from ...core.errors import InputError, WallError
from ...core.estimates import html_table
from ..cells.cell import Cell
from ..cells.hollow_shape import has_mirror_axis
from ..cells.measured import Profile
from ..cells.output import read_wall, save_wall, wall_miniature
from ..cells.profile import Seam, rolled, vertices_of_profile
from ..cells.validity import canonical_island, canonical_path, check_crossings, check_open_wall, wall_size
from ..curves.curve import LARGEST_COORDINATE, Curve
from ..curves.segment import Segment
from ..disk.disk import Disk
from ..scene.scene import Scene, TracePlan, plan_of, scene_of
from .formula import pieces_of_function


@dataclass(frozen=True, repr=False, init=False)
class Wall(Cell):
    """One period of a wall in y <= 0, with the free side above (on the left of the direction of travel).

    Parameters
    ----------
    pieces : sequence of Curve, such as Segment, Arc and Bezier
        A connected path from (0, y0) on the left to (period, y0) on the right, y0 <= 0. Pieces may overhang and may
        touch each other, also along plates of zero thickness, but must not cross.
    period : float
        Greater than 0.
    islands : sequence of sequences of pieces
        Closed loops that float above the path; loops that run counterclockwise are turned round.
    unit : str
        Of lengths, for the axes of pictures.

    Attributes
    ----------
    pieces : tuple of pieces
        Each piece starts exactly at the end of the piece before. A curve whose top touches the level of the wall's
        highest points is cut there, so there may be more pieces than were given. Computations use those of ``cell``,
        in which parts of one side or curve are joined.

    Raises
    ------
    WallError
        If pieces do not join, have no length, rise above y = 0 or cross, or if the path does not span the period. The
        message names the pieces and the position.

    Notes
    -----
    The conditions are those of Rudzis 2022, section 1.3.1, except that any depth is allowed. A wall without islands
    ``closes`` (conditions B5 and B5'): a ray below the level of the highest points stays in one of the ``hollows``.
    The period may begin anywhere, and the highest points may lie below y = 0. Results that depend on the law only use
    the ``cell``, which begins at a highest point. Positions and angles of rays, pictures and files are in the given
    coordinates.

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

    def __init__(
        self, pieces: Sequence[Curve], period: float = 1.0, islands: Sequence[Sequence[Curve]] = (), unit: str = ""
    ) -> None:
        width = positive_number("period", period)
        path = canonical_path(pieces, width)
        size = wall_size(path, width)
        loops = tuple(canonical_island(loop, width, size, k) for k, loop in enumerate(sequence("islands", islands)))
        instance("unit", unit, str, "'µm'")
        self._fill(path, width, loops, unit)
        if loops:
            check_open_wall(path, loops, width, size)
        top = self._highest
        given, numbers = (path, range(len(path))) if top is None else (top.pieces, top.numbers)
        check_crossings(self.cell, (given, *loops), self.origin, numbers)
        if not self.closes:
            check_open_wall(path, loops, width, size)

    @classmethod
    def from_vertices(cls, vertices: ArrayLike, unit: str = "") -> Self:
        """Return the polygonal wall through the given points, which span one period.

        Parameters
        ----------
        vertices : array_like, shape (n, 2)
            From (0, y0) to (period, y0), or the other way. If they begin elsewhere, the wall is moved so that it begins
            at a highest point, (0, 0).
        unit : str
            Of lengths, for the axes of pictures.

        Raises
        ------
        WallError
            If a vertex is not finite or equals its predecessor, or the wall violates a condition.

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)]).depth
        0.4
        """
        try:
            points = numbers("vertices", vertices)
        except InputError as reason:
            raise WallError(f"vertices: expected points (x, y), got {vertices!r}") from reason
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise WallError(f"vertices: expected an array of shape (n, 2) with n >= 2, got shape {points.shape}")
        bad = ~(np.abs(points) <= LARGEST_COORDINATE).all(axis=1)
        if bad.any():
            i = int(bad.argmax())
            most = f"of at most {LARGEST_COORDINATE:g}"
            raise WallError(
                f"vertices: expected finite coordinates {most}, got {tuple(points[i].tolist())} at vertex {i}"
            )
        same = np.all(points[1:] == points[:-1], axis=1)
        if same.any():
            i = int(same.argmax())
            raise WallError(f"vertices {i} and {i + 1} coincide at {tuple(points[i].tolist())}; leave one out")
        if points[-1, 0] < points[0, 0]:
            points = points[::-1]
        if points[0, 0] != 0.0:
            points = rolled(*points.T) if points[0, 1] == points[-1, 1] else points - [points[0, 0], 0.0]
        if not points[-1, 0] > 0.0:
            raise WallError(f"vertices: expected the last x to be one period from the first, got {points[-1, 0]:g}")
        return cls(Segment.path(points), float(points[-1, 0]), unit=unit)

    @classmethod
    def from_profile(
        cls, x: ArrayLike | Profile, height: ArrayLike | None = None, seam: Seam = "mirror", unit: str = ""
    ) -> Self:
        """Return the wall of a measured profile, in the profile's units.

        Parameters
        ----------
        x : array_like, shape (n,), or Profile
            Positions, strictly increasing, n >= 2; or a whole profile, as `read_profile` returns it.
        height : array_like, shape (n,)
            Heights above any level, in the same unit as ``x``; not given with a `Profile`.
        seam : {"mirror", "step", "wrap"}
            How the profile becomes periodic: followed by its mirror image (twice its length), or repeated as it is
            with a vertical step between its last and its first height; or, of a computed periodic profile with equal
            steps, its first point follows one step after its last.
        unit : str
            Of lengths, for the axes of pictures; a `Profile` has its own.

        Returns
        -------
        Wall
            The wall starts at the highest point of the profile, moved to (0, 0).

        Raises
        ------
        InputError
            If the arrays do not match, a height is undefined (masked, infinite or nan) or the positions do not
            increase; `Profile` has methods that mend the latter two.

        Warns
        -----
        UserWarning
            If the mean slope is above 100, as where heights are in nanometres and positions in millimetres.

        Examples
        --------
        >>> Wall.from_profile([0, 1, 3], [2, 5, 4]).vertices.tolist()
        [[0.0, 0.0], [2.0, -1.0], [4.0, 0.0], [5.0, -3.0], [6.0, 0.0]]
        """
        if not isinstance(x, Profile):
            if height is None:
                table = "; of a table of two columns pass Wall.from_profile(*numpy.asarray(table).T)"
                raise InputError(f"height: expected heights, one for every position, got None{table}")
            x = Profile(x, height, unit)  # type: ignore[arg-type]
        elif height is not None:
            raise InputError("height: a Profile has its heights; leave it out")
        return cls.from_vertices(vertices_of_profile(x, seam), x.unit)

    @classmethod
    def from_function(
        cls,
        height: Callable[[Floats], Floats],
        period: float = 1.0,
        tolerance: float = 1e-9,
        breakpoints: ArrayLike = (),
        unit: str = "",
    ) -> Self:
        r"""Return the wall y = f(x), made of segments and Bezier pieces within a tolerance of it.

        Parameters
        ----------
        height : callable
            The function f on [0, period], of arrays, in the unit of ``period``. The wall is moved so that its highest
            point is at y = 0. If f(0) and f(period) differ, there is a vertical step.
        period : float
            Greater than 0.
        tolerance : float
            From 1e-11 to 0.01, in periods. Below 1e-10 the rounding of the heights may not allow it, and is refused.
        breakpoints : array_like, shape (n,)
            Positions at which f or its first two derivatives jump; 0 and the period are breakpoints.
        unit : str
            Of lengths, for the axes of pictures.

        Returns
        -------
        Wall
            On each piece, of width h, the height differs from f by at most ``tolerance * period``, the slope from f'
            by 10 times this over h, and the second derivative from f'' by 100 times this over h^2. Intervals on which f
            is linear are segments, and where f jumps there are vertical segments.

        Raises
        ------
        WallError
            If a height is not finite, or f is not smooth between breakpoints; the message names the place.

        Notes
        -----
        Cubic curves with the slopes of f at their ends, and the two handles that fit best, approximate heights in order
        6. The function is seen at 1024 points of a period, and at more where it bends: breakpoints at both sides of
        a narrower detail make it seen.

        Examples
        --------
        >>> tooth = Wall.from_function(lambda x: -np.abs(x - 0.5), breakpoints=[0.5])
        >>> tooth.vertices.tolist()
        [[0.0, -0.5], [0.5, 0.0], [1.0, -0.5]]
        >>> Wall.from_function(lambda x: 0.1 * np.cos(2 * np.pi * x)).depth
        0.2
        """
        width = positive_number("period", period)
        return cls(pieces_of_function(height, width, tolerance, breakpoints), width, unit=unit)

    @cached_property
    def is_mirror_symmetric(self) -> bool:
        """Whether the periodic wall has a mirror axis, to rounding; with islands only x = period/2 is tested."""
        return has_mirror_axis(self.cell)

    @cached_property
    def scene(self) -> Scene:
        """The tracer's tables of ``cell``, in the coordinates of ``cell``; computed at first use."""
        return scene_of(self.cell)

    def plan(self) -> TracePlan:
        """Return the optimisations that the tracer applies to this wall.

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.5, 0), (0.5, -1), (1, -1), (1, 0)]).plan()  # doctest: +ELLIPSIS
        TracePlan
        primitives        lines
        hollows           1
        pieces_traced     3
        ...
        """
        return plan_of(self.cell, self.cell.scene, self.is_mirror_symmetric)

    def foreshorten(self, disk: Disk) -> Self:
        """Return the foreshortened wall of the disk: y divided by ``disk.foreshortening``, same period.

        Its law equals the law of the wall compressed along x by the foreshortening factor (Rudzis 2022, section 1.3.7).

        Examples
        --------
        >>> Wall.from_vertices([(0, 0), (0.5, -0.25), (1, 0)]).foreshorten(Disk(1.0, 1 / 3)).depth
        0.5
        """
        instance("disk", disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        return self._image(1.0, 1.0 / disk.foreshortening, self.period)

    def unforeshorten(self, disk: Disk) -> Self:
        """Return the wall whose foreshortened wall is this one: y multiplied by ``disk.foreshortening``."""
        instance("disk", disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        return self._image(1.0, disk.foreshortening, self.period)

    def _repr_html_(self) -> str:
        """The wall with a small picture, in a notebook."""
        lines = {
            "unit": self.unit, "period": f"{self.period:g}", "depth": f"{self.depth:.6g}",
            "length": f"{self.arc_length:.6g}",
            "mirror-symmetric": "yes" if self.is_mirror_symmetric else "no",
            "more": ".plan(), .foreshorten(disk), .save(path), geo.draw_wall(wall), ker.WallLaw(wall)",
        }  # fmt: skip
        return html_table(repr(self), lines, wall_miniature(self))

    def outline(self, tolerance: float) -> Floats:
        """Return the path of one period, without islands, as a polyline within ``tolerance``, shape (n, 2)."""
        wanted = positive_number("tolerance", tolerance)
        chunks = [p.flattened(wanted)[:-1] for p in self.pieces]
        return np.concatenate([*chunks, self.vertices[-1:]])

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the wall as a TOML file, from which ``load_wall`` restores it exactly.

        Raises
        ------
        FileExistsRefusal
            If the file exists and ``overwrite`` is false.
        InputError
            If the file cannot be written.
        """
        save_wall(self, path, overwrite=overwrite)


def load_wall(path: str | PathLike[str]) -> Wall:
    """Read a wall from a TOML file.

    Parameters
    ----------
    path : path
        A file that ``Wall.save`` wrote, or one written by hand: ``period``, then either ``vertices`` (a list of
        points) or ``[[pieces]]`` tables of ``kind`` "segment" (``start``, ``end``), "arc" (``center``,
        ``semi_axes``, ``angles`` and, where known exactly, ``start`` and ``end``) or "bezier" (``control_points``);
        islands are ``[[islands]]`` tables with ``pieces``. ``unit`` names the unit of lengths.

    Returns
    -------
    Wall
        Exactly equal to the saved wall.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or has a missing, unknown or unsuitable key.
    WallError
        If the wall violates a condition.

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
    return read_wall(path, Wall)
