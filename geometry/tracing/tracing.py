"""Tracing rays through the cell of a periodic wall: the map (x, theta) -> (x', theta') of Rudzis 2022, eq. 1.4."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    angles,
    common_shape,
    finite_array,
    finite_number,
    instance,
    number_between,
    numbers,
    read_only,
    whole_number,
)
from ...core.estimates import Summary
from ...core.long_runs import reported
from ..curves import columns as c
from ..curves.curve import Curve
from ..walls.wall import Wall
from .threads import in_blocks, interruptibly, new_flag

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Rays times pieces up to which rays are traced on the caller's thread. With 10^6 segments per ray, at about 10 ns a
# piece, this takes a fraction of a second. Another thread costs 0.1 ms, as much as a few hundred segments.
LITTLE_WORK = 16
# Rows of the trees of boxes, 0.3 kB each, from which on they exceed a core's cache: rays are then traced in the order
# of their entries, so that neighbours meet the same boxes.
LARGE_TREE = 2**10
# Rays of a trace from which on waves are considered; and rays of a process from which on it compiles the function for
# waves, because hit by hit they take as long as the compilation. If it is stored on disk, it is used at once.
MANY_RAYS, COMPILING_PAYS = 2**12, 2**23
# Part of the rays that waves may leave to the loop. Above it, as in walls full of runs of hits, the loop alone is as
# fast or faster, and takes the rays that follow.
MOST_LEFT = 0.4
# Angle (radians) below which, and number of periods above which, the distance in x between y = 0 and a wall's highest
# points is reduced by whole periods before rounding; its rounding error would grow with the distance.
FLAT, FAR = 2.0**-6, 2.0**6
# pi to 65 digits.
PI = Fraction(31415926535897932384626433832795028841971693993751058209749445923, 10**64)
# Bytes of results a ray; and the largest block of memory, in bytes, whose size glibc keeps in mind when it is freed.
RESULT_BYTES, LARGEST_KEPT = 25, 2**25 - 2**16
# Rays of a block that waves trace in one call, after the first ones, which tell whether they pay.
LONG_PART = 2**14
# No limit in effect: a ray ends after MOST_STEPS segments (`compiled/rays`), for any number of hits.
MAX_COLLISIONS = 2**62


class Status(IntEnum):
    """The outcome of tracing a ray.

    ``ESCAPED``: the ray left through y = 0. ``CORNER``: the ray met a corner within rounding. ``GRAZING``: the ray was
    so nearly tangent to a piece that double precision does not distinguish a hit from a miss. ``BOUNCE_LIMIT``: the
    ray was still inside after ``max_collisions`` collisions or after 10^6 ray segments.
    """

    ESCAPED = 0
    CORNER = 1
    GRAZING = 2
    BOUNCE_LIMIT = 3


class StatusCounts(Summary):
    """Mask and counts of a result's array ``status``, of rays or of disks."""

    status: NDArray[np.uint8]

    def _facts(self) -> dict[str, object]:
        return {**super()._facts(), "status": {name: number for name, number in self.counts().items() if number}}

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Mask of the rays that left through y = 0, or of the disks that returned to it."""
        return np.asarray(self.status == Status.ESCAPED)

    def counts(self) -> dict[str, int]:
        """Return the number of entries with every `Status`, by name in lower case.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.trace(geo.flat(), [0.2, 0.7], 1.0).counts()
        {'escaped': 2, 'corner': 0, 'grazing': 0, 'bounce_limit': 0}
        """
        return numbers_of(self.status, Status)


def numbers_of(status: NDArray[np.uint8], outcomes: type[IntEnum]) -> dict[str, int]:
    """Return how often each of the outcomes is in an array of their values, by name in lower case."""
    numbers = np.bincount(np.ravel(status), minlength=len(outcomes))
    return {outcome.name.lower(): int(numbers[outcome]) for outcome in outcomes}


@dataclass(frozen=True, repr=False)
class Trace(StatusCounts):
    """The outgoing rays, each array in the broadcast shape of ``x`` and ``theta``.

    Attributes
    ----------
    x : array of float
        Exit point on y = 0 of a ray that escaped, else the last position; unfolded (not reduced to one period).
    theta : array of float
        Outgoing angle in (0, pi) of a ray that escaped; an angle that rounds to pi becomes the largest double below
        pi. For other rays the angle in [-pi, pi] of the last finite velocity.
    collisions : array of int
        Number of collisions; a flat top counts as one.
    status : array of int
        Values of `Status`.
    """

    x: Floats
    theta: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    _unit = "radians, and the wall's unit of length"

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Mask of the unresolved rays: those that met a corner or grazed a piece.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.trace(geo.triangular_teeth(1.5), [0.25, 0.5], np.pi / 2).flagged.tolist()
        [False, True]
        """
        return np.asarray((self.status == Status.CORNER) | (self.status == Status.GRAZING))


def trace(
    wall: Wall,
    x: ArrayLike,
    theta: ArrayLike,
    *,
    max_collisions: int = MAX_COLLISIONS,
    threads: int | None = None,
) -> Trace:
    r"""Reflect rays from a wall until they leave it through y = 0.

    A ray enters at (x, 0) with velocity -(cos theta, sin theta) and leaves at (x', 0) with (cos theta', sin theta').
    The map is an involution and preserves sin(theta) dx d theta (Rudzis 2022, section 1.2.2).

    Parameters
    ----------
    wall : Wall
    x : array_like
        Entry points, finite; the wall is periodic.
    theta : array_like
        Incoming angles in (0, pi), radians.
    max_collisions : int
        Rays still inside after ``max_collisions`` collisions end with ``Status.BOUNCE_LIMIT``, as do rays of more than
        10^6 segments. A run of hits on one circular arc, between two facing parallel lines or in a wedge counts as one
        segment of any length, but as all of its collisions.
    threads : int, optional
        Number of threads, by default one for each processor that the process may use. The result does not depend on
        it.

    Returns
    -------
    Trace

    Raises
    ------
    InputError
        If an angle is not in (0, pi) or a number is not finite.

    Notes
    -----
    Cost per bounce: 10 to 20 ns in hollows that ``wall.plan()`` counts as closed forms. From 4,096 rays on, 30 to 80 ns
    for a wall of few lines, circles and Bezier pieces, and 0.2 us for a profile of 300 points or 32 Bezier pieces; up
    to four times as much for few rays. About 0.6 us for 10^5 lines; 70 ns and more for ellipses.
    The first call in a process loads the compiled functions (about 1 s); the first call on a machine compiles them
    once for all walls (about 5 s of processor time, then cached).

    Examples
    --------
    A rectangular notch retroreflects this ray after two hits:

    >>> from math import pi
    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> ray = geo.trace(notch, 0.25, pi / 4)
    >>> print(f"{ray.x:.12f} {ray.theta / pi:.12f} {ray.collisions}")
    0.750000000000 0.250000000000 2
    """
    _check_wall(wall)
    rays = numbers("x", x), numbers("theta", theta)
    shape = common_shape(x=rays[0], theta=rays[1])
    whole_number("max_collisions", max_collisions, 1)
    # the compiled functions take arrays of one kind: aligned, contiguous and writable
    # (of a broadcast array without entries numpy warns)
    full = (array if array.shape == shape and array.size else np.broadcast_to(array, shape).copy() for array in rays)
    given, incoming = (np.require(array, requirements=["A", "C", "W"]).reshape(-1) for array in full)
    starts = given if wall.origin == (0.0, 0.0) else np.empty_like(given)
    _keep_freed_memory(len(starts))
    out_x, out_theta = np.empty_like(starts), np.empty_like(starts)
    collisions, status = np.empty(starts.shape, np.int64), np.empty(starts.shape, np.uint8)
    scene = wall.scene
    stop = new_flag()
    trace_block = _block_tracer(scene, max_collisions, stop, _goes_in_waves(scene, len(starts)))

    unresolved = []

    def run(block: slice) -> None:
        # block by block, because each thread checks its own
        _check_rays(given[block], incoming[block])
        if starts is not given:
            starts[block] = entries(wall, given[block], incoming[block])
        found = status[block]
        trace_block(starts[block], incoming[block], out_x[block], out_theta[block], collisions[block], found)
        unresolved.append(found.any() and np.any((found == Status.CORNER) | (found == Status.GRAZING)))

    interrupt = None if len(starts) * _work(scene) <= LITTLE_WORK else stop
    try:
        with reported("trace") if len(starts) >= MANY_RAYS else nullcontext():
            in_blocks(run, len(starts), threads, stop=interrupt)
    except InvalidRays:
        # the message names the place among all rays
        finite_array("x", x)
        angles("theta", theta)
        raise
    if any(unresolved):
        from .refinement import retrace

        interruptibly(lambda: retrace(scene, starts, incoming, max_collisions, out_x, out_theta, collisions, status))

    def move_back(block: slice) -> None:
        climbs = _climbs(wall, incoming[block], out_theta[block], status[block] == Status.ESCAPED)
        out_x[block] = given[block] + (out_x[block] - starts[block]) + climbs

    if starts is not given:
        in_blocks(move_back, len(starts), threads)
    results = (out_x.reshape(shape), out_theta.reshape(shape), collisions.reshape(shape), status.reshape(shape))
    return Trace(*map(read_only, results))


class InvalidRays(Exception):
    """Some rays of a block have an angle outside (0, pi) or an entry that is not finite."""


def _check_rays(x: Floats, theta: Floats) -> None:
    """Raise `InvalidRays` if an entry is not finite or an angle not in (0, pi)."""
    # NaN is the least and the largest number of an array that has it
    if len(x) and not (theta.min() > 0.0 and theta.max() < np.pi and np.isfinite(x).all()):
        raise InvalidRays


def _keep_freed_memory(rays: int) -> None:
    """Let the allocator keep the memory of the results of a call, once freed, for those of the next one.

    glibc returns free memory at the end of its heap to the system where this is more than twice the largest block that
    was freed, at most 64 MB: with four arrays, of which none is half of all, at every second call. New pages cost up to
    5 ns a ray. A block as long as all results together, never touched, is enough; see M_MMAP_THRESHOLD in mallopt(3).
    """
    if rays >= MANY_RAYS:
        np.empty(min(RESULT_BYTES * rays, LARGEST_KEPT), np.uint8)


def _work(scene: Scene) -> int:
    """Return the cost of a ray segment in pieces; a Bezier piece counts as ten."""
    return len(scene.joints) + 10 * len(scene.beziers)


def _goes_in_waves(scene: Scene, rays: int) -> bool:
    """Whether rays are traced in waves, which needs a function that takes a second to compile once on a machine."""
    if rays < MANY_RAYS or scene.is_open or len(scene.boxes):
        return False
    if not all(cls.goes_in_waves(rows) for cls, rows in zip(Curve.traced(), scene.curves, strict=True) if len(rows)):
        return False
    if np.all(scene.hollows[:, c.FORM] != c.NO_FORM):
        return False
    from .compiled.blocks import SIMPLE

    return SIMPLE.is_worth(rays, COMPILING_PAYS)


def _block_tracer(scene: Scene, max_collisions: int, stop: NDArray[np.int64], in_waves: bool) -> Callable[..., None]:
    """Return a function of x, theta and four arrays to fill, which traces by closed forms where possible."""

    def follow(x: Floats, theta: Floats, *results: NDArray[Any]) -> None:
        from .compiled.pieces.records import Rays
        from .compiled.rays import trace_into

        trace_into(Rays._make((x, theta, *results, stop)), scene.tables, max_collisions)

    rooms: list[Any] = []

    def close(x: Floats, theta: Floats, *results: NDArray[Any]) -> None:
        from ..scene.compiled.compiling import checked
        from .compiled.blocks import CROSSINGS, RAYS, UNDECIDED, room_for, trace_hollows

        tables = scene.tables.address
        # of an earlier block, if another thread does not use it
        room = rooms.pop() if rooms else room_for(scene.hollows, MANY_RAYS if in_waves else RAYS)
        crossings = CROSSINGS if in_waves else (*CROSSINGS[:2], 0)
        first, size = 0, MANY_RAYS if in_waves else len(x)
        while first < len(x) and not stop[0]:
            part = slice(first, first + size)
            entry, angle, found = x[part], theta[part], tuple(result[part] for result in results)
            checked(partial(trace_hollows, entry, angle, tables, max_collisions, found, room, crossings))
            if in_waves and np.count_nonzero(found[-1] == UNDECIDED) > MOST_LEFT * len(entry):
                crossings = (*CROSSINGS[:2], 0)
            first += size
            size = LONG_PART
        rooms.append(room)
        rest = np.flatnonzero(results[-1][:first] == UNDECIDED)
        if len(rest):
            followed = tuple(np.empty(len(rest), result.dtype) for result in results)
            follow(x[rest], theta[rest], *followed)
            for result, some in zip(results, followed, strict=True):
                result[rest] = some

    trace_block = close if in_waves or np.any(scene.hollows[:, c.FORM] != c.NO_FORM) else follow

    def in_order(x: Floats, theta: Floats, *results: NDArray[Any]) -> None:
        order = np.argsort(x % scene.cell)
        trace_block(x[order], theta[order], *results)
        for result in results:
            result[order] = result.copy()

    return in_order if len(scene.boxes) >= LARGE_TREE else trace_block


def trajectory(wall: Wall, x: float, theta: float, *, max_collisions: int = 10_000) -> Floats:
    """Return the points of one ray: its entry at y = 0, every hit, and its exit.

    Parameters
    ----------
    wall : Wall
    x : float
        Entry point.
    theta : float
        Incoming angle in (0, pi), radians.
    max_collisions : int
        The trajectory ends after at most this number of hits.

    Returns
    -------
    array of shape (n, 2)
        Unfolded: x increases or decreases beyond the cell. The last point is at y = 0 exactly if the ray escapes.

    Raises
    ------
    InputError
        If ``wall`` is not a Wall, ``x`` not finite, ``theta`` not in (0, pi) or ``max_collisions`` below 1.

    Examples
    --------
    >>> from math import pi
    >>> from asperity import geometry as geo
    >>> geo.trajectory(geo.flat(), 0.5, pi / 2).tolist()
    [[0.5, 0.0], [0.5, 0.0], [0.5, 0.0]]
    """
    from .compiled.pieces.records import Rays, details_for, results_for
    from .compiled.rays import trace_into

    _check_wall(wall)
    position = finite_number("x", x)
    incoming = number_between("theta", theta, 0.0, np.pi)
    limit = whole_number("max_collisions", max_collisions, 1)
    scene = wall.scene
    entry = position
    if wall.origin != (0.0, 0.0):
        entry = float(entries(wall, np.array([position]), np.array([incoming]))[0])
    base = np.floor(entry / scene.cell) * scene.cell
    left, right = scene.hollows[:, c.LEFT], scene.hollows[:, c.RIGHT]
    inside = np.flatnonzero((left < entry - base) & (entry - base < right) | scene.is_open)
    if len(inside) == 0:
        # a flat top: entry, hit and exit are one point
        points = np.array([[entry, 0.0]] * 3)
    else:
        start, angle = np.array([entry - base]), np.array([incoming])
        details, rays = details_for(path=limit + 2), Rays(start, angle, *results_for(1), new_flag())
        interruptibly(lambda: trace_into(rays, scene.tables, limit, details))
        path = details.values.path
        points = path[np.isfinite(path[:, 0])]
        points[:, 0] += base
    return points if wall.origin == (0.0, 0.0) else _in_coordinates_of(wall, points, position, incoming, limit)


def _in_coordinates_of(wall: Wall, points: Floats, x: float, theta: float, limit: int) -> Floats:
    """Return a trajectory in ``wall.cell`` in the wall's coordinates, from the entry to the exit at y = 0."""
    level = wall.origin[1]
    ray = trace(wall, x, theta, max_collisions=limit)
    moved = points + np.array([x - points[0, 0] + (level / np.tan(theta) if level else 0.0), level])
    moved[0] = x, 0.0
    if ray.escaped:
        moved[-1] = float(ray.x), 0.0
    return np.asarray(moved)


def entries(wall: Wall, x: Floats, theta: Floats) -> Floats:
    """Return where rays from y = 0 reach the level of the highest points, in the coordinates of ``wall.cell``.

    If the ray travels far, the position is reduced by whole periods, exactly and before rounding.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> low = geo.Wall.from_vertices([(0, -2), (0.5, -1), (1, -2)])
    >>> entries(low, np.array([0.75, 0.75]), np.array([np.pi / 2, np.pi / 4])).round(12).tolist()
    [0.25, -0.75]
    """
    left, level = wall.origin
    if level == 0.0:
        return np.asarray(x - left)
    travel = -level / np.tan(theta)
    small = np.minimum(theta, np.pi - theta)
    far = np.flatnonzero((small < FLAT) & (np.abs(travel) > FAR * wall.period))
    for k in far.tolist():
        travel[k] = _reduced_travel(-level, float(theta[k]), wall.period)
    return np.asarray(x - travel - left)


def _reduced_travel(height: float, theta: float, period: float) -> float:
    """Return height cot(theta) up to whole periods for theta near 0 or pi, with 1/theta as an exact fraction."""
    exact = Fraction(theta) if theta < 1.0 else PI - Fraction(theta)
    small = float(exact)
    # cot(t) = 1/t - t/3 - t^3/45 - 2 t^5/945 - ...; the next term is below 5e-17 for t < FLAT
    square = small * small
    rest = small * (1.0 / 3.0 + square * (1.0 / 45.0 + square * (2.0 / 945.0)))
    travel = float(Fraction(height) / exact % Fraction(period)) - height * rest
    return travel if theta < 1.0 else -travel


def _climbs(wall: Wall, incoming: Floats, outgoing: Floats, escaped: NDArray[np.bool_]) -> Floats:
    """Return the sum of the distances in x between y = 0 and the level of the highest points, before and after.

    For rays that do not escape it is the distance before only, because they end below that level.
    """
    level = wall.origin[1]
    if level == 0.0:
        return np.zeros_like(incoming)
    with np.errstate(over="ignore", invalid="ignore"):
        before = level / np.tan(incoming)
        after = -level / np.tan(outgoing)
        both = before + after
        # distances of opposite signs cancel, for example those of a retroreflected ray
        opposite = before * after < 0.0
        here, there = incoming[opposite], outgoing[opposite]
        both[opposite] = -level * (np.sin(here - there) / np.sin(here)) / np.sin(there)
    return np.asarray(np.where(escaped, both, before))


def _check_wall(wall: Wall) -> None:
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
