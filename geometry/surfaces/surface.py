"""A wall that is rough in two directions: a periodic height map, triangulated, and the rays that it reflects."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    Value,
    check_memory,
    finite_array,
    frozen,
    generator,
    instance,
    positive_number,
    read_only,
    shaped,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import html_table
from ...core.files import ending_in, write_whole
from ..tracing.threads import in_blocks, new_flag
from ..tracing.tracing import MAX_COLLISIONS, StatusCounts
from ..walls.random_heights import HeightSpectrum, random_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Largest height, spacing, and ratio of the two: squares of slopes stay far from the largest double.
LARGEST = 1e100
# Points of a map along an axis that has quarters, and of a random one.
FEWEST, MOST_POINTS = 4, 2**15
# Hits of a ray that a trajectory has at most.
MOST_HITS = 10_000
# Arrays of the size of the map in memory at a time, by measurement: of a surface and its slopes, and of a random one.
COPIES, RANDOM_COPIES = 4, 10


@dataclass(frozen=True, repr=False)
class SurfaceTrace(StatusCounts):
    """The outgoing rays, in the broadcast shape of the points and velocities given.

    Attributes
    ----------
    points : array of float, shape (..., 2)
        Where a ray that escaped leaves the plane of the highest point, else below or above its last position; unfolded
        (not reduced to one period).
    velocities : array of float, shape (..., 3)
        The last velocities, of the same speed as those given; of rays that escaped the third component is positive.
    collisions : array of int
        Number of collisions.
    status : array of int
        Values of `Status`: ``ESCAPED``, ``GRAZING`` of a ray that a collision made exactly level at the height of the
        highest point, or ``BOUNCE_LIMIT``. Edges and vertices need none: a ray within rounding of one is that of a
        neighbour.
    """

    points: Floats
    velocities: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    _unit = "the surface's unit of length, and that of the given velocities"


@dataclass(frozen=True, eq=False, repr=False)
class Surface(Value):
    r"""A periodic height map z(x, y) on a rectangular grid, with straight facets between its points.

    Parameters
    ----------
    heights : array_like, shape (n, m)
        ``heights[i, j]`` is the height at (i dx, j dy), above any level; finite, n and m at least 1. The map repeats
        after n points along x and m along y. Each square is cut along its diagonal from (i, j) to (i + 1, j + 1).
    spacing : float or (float, float)
        The distances dx and dy of the points, in the unit of the heights.
    unit : str
        Of lengths, for the axes of pictures. It does not count when surfaces are compared.

    Raises
    ------
    InputError
        If the heights are no finite numbers in two dimensions, the spacing is not positive, or the map takes more
        memory than there is.

    Notes
    -----
    A ridge along the other diagonal, from (i + 1, j) to (i, j + 1), is cut into teeth of the size of the grid, so that
    pyramids need a fine map; heights f(x) + g(y), such as grooves and egg cartons, have none. `read_surface` makes a
    surface of a measured map, and `random` one with given statistics.

    Examples
    --------
    Grooves with the shape of a roof, whose faces have the slope 1:

    >>> from asperity import geometry as geo
    >>> roof = geo.Surface([[0.0], [1.0]], spacing=1.0)
    >>> roof, roof.rms_slope, roof.rms_height**2 * 12
    (Surface(2 x 1, periods 2 x 1, rms slope 1), 1.0, 1.0)
    >>> ray = roof.trace([1.5, 0.25], [0.0, 0.0, -1.0])
    >>> ray.points.tolist(), ray.velocities.tolist(), ray.collisions.tolist()
    ([2.5, 0.25], [0.0, 0.0, 1.0], 2)
    """

    heights: Floats
    spacing: Any = 1.0
    unit: str = field(default="")

    def __post_init__(self) -> None:
        # before a view of few numbers is copied
        if isinstance(self.heights, np.ndarray):
            check_memory("heights", "the map", COPIES * self.heights.size)
        heights = shaped("heights", self.heights, "n", "m")
        given = finite_array("spacing", self.spacing)
        if given.shape not in ((), (2,)) or not (given > 0.0).all():
            raise InputError(f"spacing: expected a positive number or a pair of such, got {self.spacing!r}")
        if not heights.size:
            raise InputError(f"heights: expected one at least, got shape {heights.shape}")
        largest = np.abs(heights).max()
        if max(largest, given.max(), largest / given.min()) > LARGEST:
            raise InputError(
                f"heights: expected at most {LARGEST:g}, in the unit of lengths and in spacings, got {largest:g} with "
                f"the spacing {self.spacing!r}"
            )
        instance("unit", self.unit, str, "'µm'")
        self._set(heights=frozen(heights), spacing=tuple(np.broadcast_to(given, 2).tolist()))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Surface):
            return NotImplemented
        return bool(self.spacing == other.spacing and np.array_equal(self.heights, other.heights))

    def __hash__(self) -> int:
        return hash((self.spacing, self.heights.shape, self.heights.tobytes()))

    @property
    def periods(self) -> tuple[float, float]:
        """The lengths along x and y after which the map repeats."""
        (n, m), (dx, dy) = self.heights.shape, self.spacing
        return n * dx, m * dy

    @property
    def _slopes(self) -> tuple[Floats, Floats]:
        """The slopes along the edges in x and in y; each edge belongs to a facet on either side."""
        x, y = (np.diff(self._padded, axis=axis) / self.spacing[axis] for axis in (0, 1))
        return x[:, :-1], y[:-1]

    def facet_slopes(self) -> Floats:
        """The slopes along x and y of all facets, shape (2, n, m, 2): those below the diagonals, then those above."""
        x, y = self._slopes
        return np.stack([np.stack([x, np.roll(y, -1, 0)], -1), np.stack([np.roll(x, -1, 1), y], -1)])

    @cached_property
    def rms_slope(self) -> float:
        """The root mean squared slope of the facets, by the area below them."""
        return float(np.sqrt(sum(np.mean(one**2) for one in self._slopes)))

    @cached_property
    def rms_height(self) -> float:
        """The root mean squared height about the mean, of the points on all facets."""
        z = self.heights - self.heights.mean()
        x, y, both = (np.mean(z * np.roll(z, shift, (0, 1))) for shift in ((1, 0), (0, 1), (1, 1)))
        return float(np.sqrt((3.0 * np.mean(z**2) + x + y + both) / 6.0))

    @cached_property
    def area(self) -> float:
        """The area of the facets of one period."""
        stretched = np.sqrt(1.0 + np.sum(self.facet_slopes() ** 2, axis=-1))
        return float(0.5 * np.prod(self.spacing) * stretched.sum())

    @cached_property
    def _padded(self) -> Floats:
        """The heights with the first row and column again at the ends."""
        return read_only(np.pad(self.heights, ((0, 1), (0, 1)), mode="wrap"))

    def trace(
        self,
        points: ArrayLike,
        velocities: ArrayLike,
        *,
        max_collisions: int = MAX_COLLISIONS,
        threads: int | None = None,
    ) -> SurfaceTrace:
        """Reflect rays until they leave the surface upwards.

        Parameters
        ----------
        points : array_like, shape (..., 2)
            Where the rays enter the plane of the highest point; the surface is periodic.
        velocities : array_like, shape (..., 3)
            In any unit, with a negative third component; their leading axes broadcast with those of the points.
        max_collisions : int
            Rays still inside after ``max_collisions`` collisions end with ``Status.BOUNCE_LIMIT``, as do rays that
            cross 10^6 half squares.
        threads : int, optional
            Number of threads, by default one for each processor that the process may use. The result does not depend
            on it.

        Returns
        -------
        SurfaceTrace

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite or a third component is not negative.

        Notes
        -----
        About 2 us a ray on a map of 256 x 256 points with slopes of .7, and less on smaller ones.

        Examples
        --------
        >>> flat = Surface([[0.0]])
        >>> flat.trace([[0.25, 0.5], [0.75, 0.5]], [3.0, 4.0, -2.0]).velocities.tolist()
        [[3.0, 4.0, 2.0], [3.0, 4.0, 2.0]]
        """
        shape, starts, incoming = _rays(points, velocities)
        most = whole_number("max_collisions", max_collisions, 0)
        at, moving, collisions, status = self._traced(starts, incoming, most, threads)
        found = at.reshape(*shape, 2), moving.reshape(*shape, 3), collisions.reshape(shape), status.reshape(shape)
        return SurfaceTrace(*map(read_only, found))

    def _traced(
        self, points: Floats, velocities: Floats, most: int, threads: int | None, path: Floats | None = None
    ) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.uint8]]:
        """`trace` for checked arrays of shape (n, 2) and (n, 3); a ``path`` is filled in squares and lengths."""
        from .compiled.facets import trace_facets

        spacing, top = np.array(self.spacing), float(self.heights.max())
        # by a power of two, which rounds nothing, to numbers whose squares are in range
        exponent = np.frexp(np.abs(velocities).max(axis=1, initial=0.0))[1][:, None]
        squares = np.append(1.0 / spacing, 1.0)
        moving = np.ldexp(velocities, -exponent) * squares
        start = np.mod(points / spacing, self.heights.shape)
        at, stop = start.copy(), new_flag()
        results = np.zeros(len(at), np.int64), np.zeros(len(at), np.uint8)
        scale, path = tuple((spacing**-2).tolist()), np.empty((0, 3)) if path is None else path

        def run(part: slice) -> None:
            own = tuple(one[part] for one in results)
            trace_facets(self._padded, top, scale, at[part], moving[part], most, path, own, stop)

        in_blocks(run, len(at), threads, stop=stop)
        return points + (at - start) * spacing, np.ldexp(moving / squares, exponent), *results

    def trajectory(self, point: ArrayLike, velocity: ArrayLike, *, max_collisions: int = MOST_HITS) -> Floats:
        """The points of one ray: its entry on the plane of the highest point, every hit, and its exit.

        Parameters
        ----------
        point : array_like, shape (2,)
        velocity : array_like, shape (3,)
            With a negative third component.
        max_collisions : int
            The trajectory ends after at most this number of hits.

        Returns
        -------
        array of shape (n, 3)
            Unfolded. The last point is on the plane of the highest point if the ray escapes.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite or the third component is not negative.

        Examples
        --------
        >>> Surface([[0.0], [1.0]]).trajectory([1.5, 0.25], [0.0, 0.0, -1.0]).tolist()
        [[1.5, 0.25, 1.0], [1.5, 0.25, 0.5], [2.5, 0.25, 0.5], [2.5, 0.25, 1.0]]
        """
        _, starts, incoming = _rays(shaped("point", point, 2), shaped("velocity", velocity, 3))
        start = starts[0]
        limit = whole_number("max_collisions", max_collisions, 0, most=MOST_HITS)
        path = np.empty((limit + 1, 3))
        at, _, collisions, status = self._traced(starts, incoming, limit, 1, path)
        squares = np.append(self.spacing, 1.0)
        base = np.append(start - np.mod(start / self.spacing, self.heights.shape) * self.spacing, 0.0)
        hits, top = path[1 : collisions[0] + 1] * squares + base, float(self.heights.max())
        ends = [np.append(at[0], top)] if status[0] == 0 else []
        return np.vstack([np.append(start, top), *hits, *ends])

    def plot(self, points: ArrayLike = (), velocities: ArrayLike = (), ax: Axes | None = None) -> Axes:
        """Draw the map from above, as shaded relief with contours, with the paths of the rays.

        Parameters
        ----------
        points : array_like, shape (..., 2)
        velocities : array_like, shape (..., 3)
            Of rays as `trace` takes them; both may be empty.
        ax : matplotlib Axes, optional
            By default the axes of a new figure.

        Returns
        -------
        matplotlib Axes
            One period, or those through which the rays pass, at most three beyond it. A dot marks the entry of a ray
            and a ring its exit; a ray that does not escape ends in a cross.

        Examples
        --------
        >>> Surface([[0.0], [1.0]], unit="µm").plot([1.5, 0.25], [0.0, 0.0, -1.0]).get_xlabel()
        'x (µm)'
        """
        from .pictures import draw_surface

        paths: list[tuple[Floats, bool]] = []
        if np.size(points) or np.size(velocities):
            for x, v in zip(*_rays(points, velocities)[1:], strict=True):
                paths.append((self.trajectory(x, v), bool(self.trace(x, v).escaped)))
        return draw_surface(self.heights, self.spacing, self.unit, paths, ax)

    @property
    def is_mirrored(self) -> bool:
        """Whether the map is a part and its mirror images in both directions, as measured maps are made periodic."""
        z = self.heights
        return min(z.shape) > 2 and all(np.array_equal(one[1:], one[:0:-1]) for one in (z, z.T))

    def quarters(self) -> tuple[Surface, Surface, Surface, Surface]:
        """The quarters of a measured map, each made periodic by its mirror image, for the spread of any quantity.

        Of a map that was mirrored the quarters are those of the part that was measured.

        Raises
        ------
        InputError
            If the map has fewer than four points along an axis.

        Examples
        --------
        >>> steps = Surface(np.add.outer([0.0, 1.0, 3.0, 7.0], [0.0, 0.0, 0.0, 0.0]))
        >>> [round(one.rms_slope, 12) for one in steps.quarters()]
        [1.0, 1.0, 4.0, 4.0]
        """
        z = self.heights
        if self.is_mirrored:
            z = z[: len(z) // 2 + 1, : z.shape[1] // 2 + 1]
        n, m = z.shape
        if min(n, m) < FEWEST:
            raise InputError(f"heights: expected {FEWEST} points or more along each axis, got a map of {n} x {m}")
        parts = (z[rows, columns] for rows in _halves(n) for columns in _halves(m))
        return tuple(Surface(mirrored(part), self.spacing, self.unit) for part in parts)  # type: ignore[return-value]

    @classmethod
    def random(
        cls,
        spectrum: HeightSpectrum,
        points: int | tuple[int, int],
        *,
        rms_slope: float | None = None,
        rms_height: float | None = None,
        period: float | tuple[float, float] = 1.0,
        rng: Rng = None,
    ) -> Surface:
        """A surface of random Gaussian heights with an isotropic spectrum, periodic by construction.

        Parameters
        ----------
        spectrum : HeightCorrelation, SelfAffine or callable
            As of `random_wall`, of the distance in the plane. `SelfAffine` has the power q^(-2 - 2 H). A callable takes
            wave numbers q = (q_x^2 + q_y^2)^(1/2) as an array and returns the power spectral density C(q) in two
            dimensions; the mean squared height is the sum of C(q)/(area of the period) over all waves.
        points : int or (int, int)
            Number of heights along x and y.
        rms_slope, rms_height : float, optional
            The root mean squared slope of the facets, or height on them about the mean, of which one is given: the
            squares are expected values over all random surfaces, a single one deviates. With a callable both may be
            left out.
        period : float or (float, float)
        rng : None, int or numpy.random.Generator

        Raises
        ------
        InputError
            If not one of ``rms_slope`` and ``rms_height`` is given, or a spectrum is negative somewhere or zero
            everywhere.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.Surface.random(geo.HeightCorrelation(0.1), 32, rms_slope=0.5, rng=1)
        Surface(32 x 32, periods 1 x 1, rms slope 0.486)
        """
        counts, lengths = _pair("points", points), _pair("period", period)
        sizes = [whole_number("points", one, 2, most=MOST_POINTS) for one in counts]
        widths = [positive_number("period", one) for one in lengths]
        check_memory("points", "a random map", RANDOM_COPIES * sizes[0] * sizes[1])
        heights = random_map(
            spectrum, (sizes[0], sizes[1]), (widths[0], widths[1]), rms_slope, rms_height, generator(rng)
        )
        return cls(heights, [width / size for width, size in zip(widths, sizes, strict=True)])

    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the heights, the spacing and the unit as a file of numpy, from which `read_surface` restores them.

        Raises
        ------
        FileExistsRefusal
            If the file exists and ``overwrite`` is false.
        InputError
            If the name promises another format than .npz, or the file cannot be written.
        """
        file = ending_in(".npz", path)
        spacing, unit = np.array(self.spacing), np.array(self.unit)
        write_whole(
            file, lambda stream: np.savez(stream, heights=self.heights, spacing=spacing, unit=unit), overwrite=overwrite
        )

    def _facts(self) -> dict[str, str]:
        (n, m), (width, length) = self.heights.shape, self.periods
        return {"": f"{n} x {m}", "periods": f"{width:.6g} x {length:.6g}", "rms slope": f"{self.rms_slope:.3g}"}

    def __repr__(self) -> str:
        return f"Surface({', '.join(f'{name} {value}'.strip() for name, value in self._facts().items())})"

    def _repr_html_(self) -> str:
        """The surface in a notebook."""
        lines = {
            "unit": self.unit, "rms height": f"{self.rms_height:.6g}", "area": f"{self.area:.6g}",
            "more": ".trace(points, velocities), .plot(), .save(path), ker.SurfaceLaw(surface)",
        }  # fmt: skip
        return html_table(repr(self), lines)


def mirrored(z: Floats) -> Floats:
    """A map followed by its mirror image along both axes, without the first and last rows twice."""
    z = np.concatenate([z, z[-2:0:-1]])
    return np.concatenate([z, z[:, -2:0:-1]], axis=1)


def _halves(count: int) -> tuple[slice, slice]:
    """The two halves of an axis, which share the middle point of an odd number."""
    return slice(0, (count + 1) // 2), slice(count // 2, count)


def _pair(name: str, value: Any) -> tuple[Any, Any]:
    """A number for both axes, or one for each."""
    is_many = isinstance(value, (tuple, list)) or (isinstance(value, np.ndarray) and value.ndim > 0)
    found = tuple(value) if is_many else (value, value)
    if len(found) != len("xy"):
        raise InputError(f"{name}: expected one number or one for each axis, got {shortened(value)}")
    return found


def _rays(points: ArrayLike, velocities: ArrayLike) -> tuple[tuple[int, ...], Floats, Floats]:
    """The shape of the rays, their entry points, shape (n, 2), and velocities, shape (n, 3), which must come down."""
    x, v = shaped("points", points, "...", 2), shaped("velocities", velocities, "...", 3)
    try:
        shape = np.broadcast_shapes(x.shape[:-1], v.shape[:-1])
    except ValueError as reason:
        raise InputError(
            f"points, velocities: expected leading axes that broadcast, got {x.shape} and {v.shape}; for all pairs "
            "pass points[:, None]"
        ) from reason
    bad = np.argwhere(~(v[..., 2] < 0.0))
    if len(bad):
        raise InputError(
            f"velocities: expected incoming ones, with a negative third component, got {v[tuple(bad[0])].tolist()} at "
            f"row {bad[0].tolist()} ({len(bad)} such)"
        )
    return shape, np.broadcast_to(x, (*shape, 2)).reshape(-1, 2), np.broadcast_to(v, (*shape, 3)).reshape(-1, 3)
