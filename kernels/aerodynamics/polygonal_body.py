"""Bodies of polygons: scattering of particles by tracing, resistance to a stream, bodies of zero resistance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    finite_array,
    finite_number,
    frozen,
    generator,
    instance,
    positive_number,
    shaped,
    whole_number,
)
from ...core.errors import AccuracyError, InputError
from ...core.estimates import Summary, mean_of_strata
from ...geometry import Arc, Container
from ..bases.measure import SINE
from .drag import StreamForce, scaled

# Reflections of a particle at most.
MOST_REFLECTIONS = 100_000
FEWEST_RAYS = 100
# Directions and offsets, relative to the body's width, that differ by less count as unchanged: a few roundings a hit.
UNCHANGED = 1e-9
# Fraction of the area in which polygons that touch overlap by rounding.
OVERLAP = 1e-12
# Points of a region's boundary at which its tangents are compared, to see that it is convex.
BOUNDARY_POINTS = 4096


@dataclass(frozen=True, repr=False)
class Scattering(Summary):
    """Particles after their reflections from a body; arrays with one entry per particle.

    Attributes
    ----------
    position : array, shape (n, 2)
        The last point of reflection; the start of a particle that met nothing.
    velocity : array, shape (n, 2)
        Unit vectors.
    reflections : array of int, shape (n,)
    """

    position: Floats
    velocity: Floats
    reflections: NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class PolygonalBody(Summary):
    """A body that consists of simple polygons with disjoint interiors, and reflects particles specularly.

    Parameters
    ----------
    polygons : sequence of array_like, each of shape (k, 2)
        Vertices, in either order.

    Raises
    ------
    InputError
        If there are no polygons, one has fewer than three vertices or no area, or two neighbouring vertices coincide;
        if a boundary meets itself, or polygons overlap.

    Source: Rudzis 2022, section 1.2.7; A. Plakhov, "Exterior Billiards" (2012).

    Examples
    --------
    A square in a stream along one of its axes returns the momentum of each particle twice:

    >>> square = PolygonalBody([[(0, 0), (1, 0), (1, 1), (0, 1)]])
    >>> square.force(0.0).along.value
    2.0
    """

    polygons: tuple[Floats, ...]
    _starts: Floats = field(init=False, repr=False)
    _sides: Floats = field(init=False, repr=False)
    _outline: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.polygons, Sequence) or not len(self.polygons):
            raise InputError("polygons: expected a list of polygons, each a list of points")
        from shapely import Polygon, union_all
        from shapely.validation import explain_validity

        found, outlines = [], []
        for number, polygon in enumerate(self.polygons):
            points = finite_array(f"polygons[{number}]", polygon)
            if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
                raise InputError(f"polygons[{number}]: expected at least three points, got shape {points.shape}")
            after = np.roll(points, -1, axis=0)
            area = 0.5 * float(np.sum(points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]))
            if area == 0.0 or np.any(np.all(points == after, axis=1)):
                raise InputError(f"polygons[{number}]: expected distinct neighbours and an area, got {points.tolist()}")
            if not (outline := Polygon(points)).is_valid:
                raise InputError(
                    f"polygons[{number}]: expected a boundary that meets itself nowhere, got "
                    f"{explain_validity(outline)}; cut the polygon there"
                )
            outlines.append(outline)
            found.append(frozen(points if area > 0.0 else points[::-1]))
        total, whole = sum(outline.area for outline in outlines), union_all(outlines)
        if total - whole.area > OVERLAP * total:
            raise InputError(
                f"polygons: expected disjoint interiors, got polygons that overlap in an area of "
                f"{total - whole.area:.3g}; replace those that overlap by their union"
            )
        sides = np.concatenate([np.roll(points, -1, axis=0) - points for points in found])
        starts = frozen(np.concatenate(found))
        self._set(_outline=whole, polygons=tuple(found), _starts=starts, _sides=frozen(sides))

    def scatter(self, position: ArrayLike, velocity: ArrayLike) -> Scattering:
        """Reflect particles until they fly free.

        Parameters
        ----------
        position, velocity : array_like, shape (n, 2)
            Starts outside of the body, and directions of motion.

        Raises
        ------
        InputError
            If a shape is wrong, a velocity is 0, or a start is inside the body.
        AccuracyError
            If a particle has not left after 10^5 reflections.
        """
        from shapely import contains_xy

        at = shaped("position", position, "n", 2).copy()
        moving = shaped("velocity", velocity, len(at), 2)
        size = np.hypot(moving[:, 0], moving[:, 1])
        if np.any(size == 0.0):
            raise InputError("velocity: expected vectors other than 0")
        if (within := contains_xy(self._outline, *at.T)).any():
            raise InputError(f"position: expected starts outside of the body, got {at[within][0].tolist()}")
        moving = moving / size[:, None]
        lengths = np.hypot(self._sides[:, 0], self._sides[:, 1])
        normals = np.stack([self._sides[:, 1], -self._sides[:, 0]], axis=1) / lengths[:, None]
        counts, last = np.zeros(len(at), dtype=np.int64), np.full(len(at), -1)
        inside = np.arange(len(at))
        for _ in range(MOST_REFLECTIONS):
            time, side = self._next(at[inside], moving[inside], last[inside])
            hit = np.isfinite(time)
            inside, time, side = inside[hit], time[hit], side[hit]
            if not inside.size:
                return Scattering(frozen(at), frozen(moving), counts)
            at[inside] += time[:, None] * moving[inside]
            normal = normals[side]
            moving[inside] -= 2.0 * np.sum(moving[inside] * normal, axis=1)[:, None] * normal
            moving[inside] /= np.hypot(*moving[inside].T)[:, None]
            counts[inside] += 1
            last[inside] = side
        raise AccuracyError(f"{inside.size} particles have not left the body", inside.size / len(at))

    def _next(self, at: Floats, moving: Floats, last: NDArray[np.int64]) -> tuple[Floats, NDArray[np.intp]]:
        """Times to the first side met from outside, and its number; inf if there is none. No side is met twice."""
        offset = self._starts[None] - at[:, None]
        turn = moving[:, None, 0] * self._sides[None, :, 1] - moving[:, None, 1] * self._sides[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            time = (offset[..., 0] * self._sides[:, 1] - offset[..., 1] * self._sides[:, 0]) / turn
            along = (offset[..., 0] * moving[:, None, 1] - offset[..., 1] * moving[:, None, 0]) / turn
        # sides run against the clock: a particle from outside crosses them with turn < 0
        met = (turn < 0.0) & (along >= 0.0) & (along <= 1.0) & (time >= 0.0)
        met[np.arange(len(at))[last >= 0], last[last >= 0]] = False
        time = np.where(met, time, np.inf)
        side = np.argmin(time, axis=1)
        return time[np.arange(len(at)), side], side

    def force(self, direction: float, rays: int = 4096, rng: Rng = 0) -> BodyForce:
        """The force of a parallel stream on the body, in units of its momentum flux.

        Parameters
        ----------
        direction : float
            The stream has the velocity -(cos, sin) of this angle, radians.
        rays : int
            Particles, one at a random offset in each of equal strips, at least 100.
        rng : None, int or numpy.random.Generator

        Examples
        --------
        A pair of triangles without resistance along its axis (A. Aleksenko and A. Plakhov, 2009):

        >>> zero_resistance_body().force(np.pi / 2).along.value < 1e-12
        True
        """
        angle, number = finite_number("direction", direction), whole_number("rays", rays, FEWEST_RAYS)
        source = generator(rng)
        stream = -np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-stream[1], stream[0]])
        offsets, depths = self._starts @ across, self._starts @ stream
        low, high = float(offsets.min()), float(offsets.max())
        before = float(depths.min()) - (high - low)
        strips = low + (high - low) * (np.arange(number) + source.random(number)) / number
        start = before * stream + strips[:, None] * across
        out = self.scatter(start, np.broadcast_to(stream, start.shape))
        push = stream - out.velocity
        width, how = high - low, f"{number} stratified rays"
        # means over the strips
        along, aside = (scaled(mean_of_strata(push @ axis, 2.0, how), width) for axis in (stream, across))
        # where the outgoing line passes, against the incoming one
        shift = np.abs((out.position - start) @ across)
        bent = np.hypot(push[:, 0], push[:, 1])
        unchanged = float(np.mean((bent < UNCHANGED) & (shift < UNCHANGED * max(width, 1.0))))
        return BodyForce(along, aside, width, unchanged)

    def scatter_in_circle(
        self, n: int, rng: Rng = None, centre: ArrayLike = (0.0, 0.0), radius: float | None = None
    ) -> tuple[Floats, Floats]:
        """Draw states from the scattering measure of the body B in a circle C around it: the law P^{B,C}.

        Parameters
        ----------
        n : int
        rng : None, int or numpy.random.Generator
        centre, radius : array_like, float
            The circle, by default the least one about the centre that contains the body.

        Returns
        -------
        (before, after)
            Shape (n, 2) each: the polar angle of the point where the particle enters or leaves the circle, and the
            angle in (0, pi) from the clockwise tangent there to *minus* the incoming, or to the outgoing, velocity.
            Particles enter with the density d phi sin(theta) d theta; the map is an involution and preserves it.

        Raises
        ------
        InputError
            If the circle does not contain the body.
        """
        middle = shaped("centre", centre, 2)
        reach = float(np.hypot(*(self._starts - middle).T).max())
        size = reach if radius is None else positive_number("radius", radius)
        if size < reach:
            raise InputError(f"radius: expected at least {reach:g}, to contain the body, got {size:g}")
        # a little outside, so that a corner on the circle is no obstacle
        size *= 1.0 + 1e-12
        circle = Container.from_curves([Arc(middle, size, 0.0, 2.0 * math.pi)])
        before, after = self.scatter_in(circle, n, rng)
        return before / [size, 1.0], after / [size, 1.0]

    def scatter_in(self, region: Container, n: int, rng: Rng = None) -> tuple[Floats, Floats]:
        """Draw states from the scattering measure of the body B in a convex set C around it: the law P^{B,C}.

        Parameters
        ----------
        region : Container
            The convex set C: a polygon, or a container whose curves make one loop.
        n : int
        rng : None, int or numpy.random.Generator

        Returns
        -------
        (before, after)
            Shape (n, 2) each: the arc length of the point where the particle enters or leaves C, against the clock, and
            the angle in (0, pi) from the clockwise tangent there to *minus* the incoming, or to the outgoing, velocity.
            Particles enter with the density ds sin(theta) dtheta; the map is an involution and preserves it.

        Raises
        ------
        InputError
            If the region is not convex, or does not contain the body.
        Examples
        --------
        The fraction of particles that meet a convex body is its perimeter over that of the region (Crofton):

        >>> from asperity import geometry as geo
        >>> square = PolygonalBody([[(-1, -1), (1, -1), (1, 1), (-1, 1)]])
        >>> before, after = square.scatter_in(geo.Container.polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]), 4000, rng=0)
        >>> undisturbed = np.isclose(np.sin(before[:, 1]), np.sin(after[:, 1]))
        >>> bool(0.4 < np.mean(undisturbed) < 1.0), before.shape
        (True, (4000, 2))
        """
        whole_number("n", n, 1)
        source, around = generator(rng), _convex(region)
        if not around.contains(self._starts).all():
            raise InputError(f"region: expected one that contains the body, got {region!r}")
        before, after = np.empty((n, 2)), np.full((n, 2), np.nan)
        # A particle that leaves through a corner of the region, a null set, is drawn again.
        while (drawn := np.isnan(after[:, 0])).any():
            number = int(np.count_nonzero(drawn))
            before[drawn] = np.stack([around.perimeter * source.random(number), SINE.sample(number, source)], axis=1)
            after[drawn] = self._through_region(before[drawn], around)
        return before, after

    def _through_region(self, before: Floats, region: Container) -> Floats:
        """Arc length and angle of exit of the particles that enter the region at an arc length and an angle.

        Both are NaN where a particle leaves through a corner, because no wall receives it.
        """
        start, wall = region.point_at(before[:, 0])
        tangent, normal = region.frames(start, wall)
        angle = before[:, 1, None]
        out = self.scatter(start, np.cos(angle) * tangent + np.sin(angle) * normal)
        time, wall, _ = region.next_wall(out.position, out.velocity, np.where(out.reflections > 0, -1, wall))
        left = np.full(before.shape, np.nan)
        found = wall >= 0
        velocity, wall = out.velocity[found], wall[found]
        ends = out.position[found] + time[found, None] * velocity
        tangent, normal = region.frames(ends, wall)
        angle = np.arctan2(-np.sum(velocity * normal, axis=1), -np.sum(velocity * tangent, axis=1))
        left[found] = np.stack([region.length_at(ends, wall), angle], axis=1)
        return left


def _convex(region: Container) -> Container:
    """The region as curves; an InputError if it is not one convex loop, by its tangents at points of the boundary."""
    instance("region", region, Container, "geo.Container.circle()")
    around = region.closed()
    point, wall = around.point_at(around.perimeter * (np.arange(BOUNDARY_POINTS) + 0.5) / BOUNDARY_POINTS)
    tangent, _ = around.frames(point, wall)
    ahead = np.roll(tangent, -1, axis=0)
    turn = np.arctan2(tangent[:, 0] * ahead[:, 1] - tangent[:, 1] * ahead[:, 0], np.sum(tangent * ahead, axis=1))
    if turn.min() < -UNCHANGED or abs(turn.sum() - 2.0 * math.pi) > UNCHANGED * BOUNDARY_POINTS:
        raise InputError(
            f"region: expected a convex region, got {region!r}, whose boundary turns to the right somewhere"
        )
    return around


@dataclass(frozen=True, repr=False)
class BodyForce(StreamForce):
    """The force of a parallel stream on a body, in units of the momentum flux.

    Attributes
    ----------
    along, across : Estimate
        Components along the stream (the resistance) and across it, positive to its left. A smooth convex body of
        width w has a resistance of at most 2 w.
    width : float
        The width of the body across the stream.
    unchanged : float
        Fraction of the particles within this width that leave on the line on which they came: 1 for an invisible body.
    """

    width: float
    unchanged: float


def zero_resistance_body() -> PolygonalBody:
    """Two isosceles triangles of angles 30, 30, 120 degrees that leave the velocity of a stream along y unchanged.

    They are cut from two equilateral triangles of side 2, of which each has a vertex in the middle of a side of the
    other. Each particle is reflected once by both triangles, and leaves in the direction in which it came.

    Source: A. Aleksenko and A. Plakhov, "Bodies of zero resistance and bodies invisible in one direction",
    Nonlinearity 22 (2009) 1247; Rudzis 2022, section 1.2.7.

    Examples
    --------
    >>> zero_resistance_body().polygons[0].round(3).tolist()
    [[-1.0, 0.0], [-0.5, 0.866], [-1.0, 1.732]]
    """
    top = math.sqrt(3.0)
    left = np.array([(-1.0, 0.0), (-0.5, 0.5 * top), (-1.0, top)])
    return PolygonalBody((left, left * [-1.0, 1.0]))


def invisible_body() -> PolygonalBody:
    """Four triangles that are invisible along y: `zero_resistance_body` and its mirror image below it.

    Every particle of a stream along y leaves on the line on which it came.

    Source: as for `zero_resistance_body`.

    Examples
    --------
    >>> force = invisible_body().force(np.pi / 2)
    >>> force.along.value < 1e-12, force.unchanged
    (True, 1.0)
    """
    upper = zero_resistance_body().polygons
    return PolygonalBody((*upper, *(polygon * [1.0, -1.0] for polygon in upper)))
