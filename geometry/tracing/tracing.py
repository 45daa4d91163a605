"""Tracing rays through the cell of a periodic wall: the map (x, theta) -> (x', theta') of Rudzis 2022, eq. 1.4."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, finite_array, finite_number, instance, number_between, whole_number
from ..scene.columns import LEFT, RIGHT
from ..walls.wall import Wall
from .threads import in_blocks, interruptibly, new_flag

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Rays times pieces up to which rays are followed on the caller's own thread: with 10^6 flights each, of some 10 ns a
# piece, they take a fraction of a second. Another thread costs 0.1 ms, as much as a few hundred flights.
LITTLE_WORK = 16
# Below the first angle, and where it flies more than so many periods between y = 0 and the highest points of a wall, a
# ray's way there is reduced by whole periods before it is rounded: the rounding error else grows with it.
FLAT, FAR = 2.0**-6, 2.0**6
# pi to 65 digits.
PI = Fraction(31415926535897932384626433832795028841971693993751058209749445923, 10**64)
# No limit in effect: a ray ends after MOST_STEPS flights computed one by one (`compiled/rays`), however many hits.
MAX_COLLISIONS = 2**62


class Status(IntEnum):
    """How a ray ended.

    ``ESCAPED``: it left through y = 0. ``CORNER``: it met a corner within rounding. ``GRAZING``: it touched a piece
    so nearly tangentially that double precision does not tell a hit from a miss. ``BOUNCE_LIMIT``: it was still
    inside after the largest number of collisions asked for, or after 10^6 flights.
    """

    ESCAPED = 0
    CORNER = 1
    GRAZING = 2
    BOUNCE_LIMIT = 3


class StatusCounts:
    """What a result with an array ``status`` says of it: of rays, or of disks."""

    status: NDArray[np.uint8]

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Mask of the rays that left through y = 0, or of the disks that came back to it."""
        return np.asarray(self.status == Status.ESCAPED)

    def counts(self) -> dict[str, int]:
        """Number of entries for every `Status`, by its name in lower case.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> geo.trace(geo.flat(), [0.2, 0.7], 1.0).counts()
        {'escaped': 2, 'corner': 0, 'grazing': 0, 'bounce_limit': 0}
        """
        numbers = np.bincount(np.ravel(self.status), minlength=len(Status))
        return {outcome.name.lower(): int(numbers[outcome]) for outcome in Status}


@dataclass(frozen=True)
class Trace(StatusCounts):
    """What became of the rays, each array in the broadcast shape of ``x`` and ``theta``.

    Attributes
    ----------
    x : array of float
        Where the ray left through y = 0, unfolded (not reduced to one period); elsewhere its last position.
    theta : array of float
        Outgoing angle of rays that escaped, in (0, pi): an angle that rounds to pi is the largest double below it;
        elsewhere the direction (cos, sin) of the last finite
        velocity as an angle in [-pi, pi].
    collisions : array of int
        Number of collisions; a flat top counts as one.
    status : array of int
        Values of `Status`.
    """

    x: Floats
    theta: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Mask of the rays that double precision does not settle: those that met a corner or grazed a piece.

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
        Entry points, any finite numbers; the wall is periodic.
    theta : array_like
        Incoming angles in (0, pi), radians.
    max_collisions : int
        Rays still inside after so many collisions end with ``Status.BOUNCE_LIMIT``, as do those whose way takes more
        than 10^6 flights. A run of hits on one circular arc, between two facing parallel lines or in a wedge is
        computed in one flight, whatever its length, and counts in full.
    threads : int, optional
        Number of threads; by default one a processor that the process may use. The result does not depend on it.

    Returns
    -------
    Trace

    Raises
    ------
    InputError
        If an angle is not in (0, pi) or a number is not finite.

    Notes
    -----
    Cost: 10 to 20 ns a bounce where ``wall.plan()`` counts closed forms, else some 70 ns on a wall of few pieces, and
    below 1 us on one of 10^5 lines (a grid). The first call of a process loads the compiled loop (about a second); the
    first on a machine compiles it, once for all walls (some ten seconds, then cached).

    Examples
    --------
    A rectangular notch sends this ray back in the direction from which it came, after two hits:

    >>> from math import pi
    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> ray = geo.trace(notch, 0.25, pi / 4)
    >>> print(f"{ray.x:.12f} {ray.theta / pi:.12f} {ray.collisions}")
    0.750000000000 0.250000000000 2
    """
    _check_wall(wall)
    x_all, theta_all = np.broadcast_arrays(finite_array("x", x), angles("theta", theta))
    whole_number("max_collisions", max_collisions, 1)
    given, incoming = x_all.flatten(), theta_all.flatten()
    starts = given if wall.origin == (0.0, 0.0) else entries(wall, given, incoming)
    out_x, out_theta = np.empty_like(starts), np.empty_like(starts)
    collisions, status = np.empty(starts.shape, np.int64), np.empty(starts.shape, np.uint8)
    scene = wall.scene
    stop = new_flag()
    trace_block = _block_tracer(scene, max_collisions, stop)

    def run(block: slice) -> None:
        trace_block(starts[block], incoming[block], out_x[block], out_theta[block], collisions[block], status[block])

    in_blocks(run, len(starts), threads, stop=None if len(starts) * _work(scene) <= LITTLE_WORK else stop)
    if np.any((status == Status.CORNER) | (status == Status.GRAZING)):
        from .refinement import retrace

        interruptibly(lambda: retrace(scene, starts, incoming, max_collisions, out_x, out_theta, collisions, status))
    if starts is not given:
        out_x = given + (out_x - starts) + _climbs(wall, incoming, out_theta, status == Status.ESCAPED)
    shape = x_all.shape
    results = (out_x.reshape(shape), out_theta.reshape(shape), collisions.reshape(shape), status.reshape(shape))
    for array in results:
        array.setflags(write=False)
    return Trace(*results)


def _work(scene: Scene) -> int:
    """What a flight costs, in pieces; a Bezier piece counts for ten."""
    return len(scene.joints) + (0 if scene.beziers is None else 10 * len(scene.beziers))


def _block_tracer(scene: Scene, max_collisions: int, stop: NDArray[np.int64]) -> Callable[..., None]:
    """A function of x, theta and the four arrays to fill: closed forms where the scene has some, else the loop."""

    def follow(x: Floats, theta: Floats, *results: NDArray[Any]) -> None:
        from .compiled.rays import nearby_address, trace_rays
        from .compiled.records import NOT_WANTED, Results

        out_x, out_theta, collisions, status = results
        wanted = Results(out_x, out_theta, collisions, status, *NOT_WANTED)
        trace_rays(x, theta, scene.tables, max_collisions, stop, wanted, nearby_address())

    def close(x: Floats, theta: Floats, *results: NDArray[Any]) -> None:
        from .compiled.closed_forms import UNDECIDED, trace_closed

        trace_closed(x, theta, scene.hollows, scene.closed, scene.cell, max_collisions, results)
        rest = np.flatnonzero(results[-1] == UNDECIDED)
        if len(rest):
            followed = tuple(np.empty(len(rest), result.dtype) for result in results)
            follow(x[rest], theta[rest], *followed)
            for result, part in zip(results, followed, strict=True):
                result[rest] = part

    return follow if scene.closed is None else close


def trajectory(wall: Wall, x: float, theta: float, *, max_collisions: int = 10_000) -> Floats:
    """Points of one ray from its entry at y = 0 through every hit to its exit, shape (n, 2).

    Parameters
    ----------
    wall : Wall
    x : float
        Entry point.
    theta : float
        Incoming angle in (0, pi), radians.
    max_collisions : int
        The trajectory is cut after so many hits.

    Returns
    -------
    array of shape (n, 2)
        Unfolded: a ray that crosses into the next cell goes on there. It ends at y = 0 exactly if the ray escapes.

    Raises
    ------
    InputError
        If ``wall`` is no wall, ``x`` not finite, ``theta`` not in its range or ``max_collisions`` below 1.

    Examples
    --------
    >>> from math import pi
    >>> from asperity import geometry as geo
    >>> geo.trajectory(geo.flat(), 0.5, pi / 2).tolist()
    [[0.5, 0.0], [0.5, 0.0], [0.5, 0.0]]
    """
    from .compiled.rays import nearby_address, trace_rays
    from .compiled.records import results_for

    _check_wall(wall)
    position = finite_number("x", x)
    incoming = number_between("theta", theta, 0.0, np.pi)
    limit = whole_number("max_collisions", max_collisions, 1)
    scene = wall.scene
    entry = position
    if wall.origin != (0.0, 0.0):
        entry = float(entries(wall, np.array([position]), np.array([incoming]))[0])
    base = np.floor(entry / scene.cell) * scene.cell
    left, right = scene.hollows[:, LEFT], scene.hollows[:, RIGHT]
    inside = np.flatnonzero((left < entry - base) & (entry - base < right) | scene.is_open)
    if len(inside) == 0:
        # a flat top: entry, hit and exit are one point
        points = np.array([[entry, 0.0]] * 3)
    else:
        results = results_for(1, path=limit + 2)
        start, angle = np.array([entry - base]), np.array([incoming])
        stop = new_flag()
        interruptibly(lambda: trace_rays(start, angle, scene.tables, limit, stop, results, nearby_address()))
        points = results.path[np.isfinite(results.path[:, 0])]
        points[:, 0] += base
    return points if wall.origin == (0.0, 0.0) else _in_coordinates_of(wall, points, position, incoming, limit)


def _in_coordinates_of(wall: Wall, points: Floats, x: float, theta: float, limit: int) -> Floats:
    """A trajectory in ``wall.cell`` in the coordinates of the wall: from its entry at y = 0 on, and up to its exit."""
    level = wall.origin[1]
    ray = trace(wall, x, theta, max_collisions=limit)
    moved = points + np.array([x - points[0, 0] + (level / np.tan(theta) if level else 0.0), level])
    moved[0] = x, 0.0
    if ray.escaped:
        moved[-1] = float(ray.x), 0.0
    return np.asarray(moved)


def entries(wall: Wall, x: Floats, theta: Floats) -> Floats:
    """Where rays that enter through y = 0 come to the level of the highest points, in the coordinates of ``wall.cell``.

    Up to whole periods where a ray comes from far: there its way is reduced by them exactly, before it is rounded.

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
    """height cot(theta) up to whole periods, for theta near 0 or pi: 1/theta is a quotient of whole numbers."""
    exact = Fraction(theta) if theta < 1.0 else PI - Fraction(theta)
    small = float(exact)
    # cot(t) = 1/t - t/3 - t^3/45 - 2 t^5/945 - ..., the next term is below 1e-18 where t < FLAT
    square = small * small
    rest = small * (1.0 / 3.0 + square * (1.0 / 45.0 + square * (2.0 / 945.0)))
    travel = float(Fraction(height) / exact % Fraction(period)) - height * rest
    return travel if theta < 1.0 else -travel


def _climbs(wall: Wall, incoming: Floats, outgoing: Floats, escaped: NDArray[np.bool_]) -> Floats:
    """How far rays move in x between y = 0 and the level of the highest points, before and after, together.

    Rays that do not escape move before only: where they are last is below that level.
    """
    level = wall.origin[1]
    if level == 0.0:
        return np.zeros_like(incoming)
    with np.errstate(over="ignore", invalid="ignore"):
        before = level / np.tan(incoming)
        after = -level / np.tan(outgoing)
        # ways of opposite signs cancel, as those of a ray that goes back the way it came
        difference = -level * (np.sin(incoming - outgoing) / np.sin(incoming)) / np.sin(outgoing)
        both = np.where(before * after < 0.0, difference, before + after)
    return np.asarray(np.where(escaped, both, before))


def _check_wall(wall: Wall) -> None:
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
