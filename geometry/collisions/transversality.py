"""How far a collision of the disk stays from its model on the cylinder (Rudzis 2022, sections 5.3.4 and 5.3.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, finite_array, frozen, generator, instance, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary, fraction_estimate
from ...core.tables import axes_or_new
from ..disk import rolling
from ..disk.disk import Disk
from ..plotting.walls import LEVEL, RAY_COLOURS, draw_solid
from ..tracing.tracing import trace, trajectory
from ..walls.wall import Wall
from .configuration_space import FLIGHT_POINTS, ConfigurationSpace, collision_path
from .rigid import at_the_tops, checked_states

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Distance, in periods, of the polylines that stand for curved pieces; it is taken off every distance to them.
FLATTENING = 1e-5
# Rounding error of a traced point, in periods; points closer than this to two pieces are in a corner.
ROUNDED = 1e-9
# Largest reach times curvature at which a piece is within curvature * reach^2 of its tangent, and arcs of it turn by at
# most ARC * curvature * reach.
BENT, ARC = 0.5, 1.05
# Length, in periods, of the level tops that stand for the further cells on either side.
FAR = 1e9
# Steps of the iteration that finds the reach of a contact, and the room left for the last one.
REACH_STEPS, ROOM = 60, 1.0 + 1e-6


@dataclass(frozen=True)
class CollisionConstants:
    """The constants of the paper's estimates of one reflection, for a disk and a wall of bounded curvature.

    Let two states, of the disk and of the cylinder, meet the wall at points that are at most ``s`` apart, at a piece
    of curvature at most kappa >= 1, and let the disk's angle from the contact be at most kappa s. Before the reflection
    the velocities differ by at most a twelfth of ``velocity * kappa * s``.

    Attributes
    ----------
    velocity : float
        After it they differ by at most ``velocity * kappa * s``: 24 5^(1/2) (1 + m/J)^(1/2), which is 24 10^(1/2) for
        m = J. The paper's s_3, Lemma 5.7.
    state : float
        The states, with positions, differ by at most ``state * kappa * s``: 1 + 12/5 + ``velocity``, at most 80 for
        m = J. Lemma 5.8, which also needs s <= 1.

    Source: Rudzis 2022, Lemmas 5.7 and 5.8, eqs. 3.119, 3.139 and 3.146; the factor (1 + m/J)^(1/2) of eq. 3.119 is
    printed for m = J.

    Examples
    --------
    >>> constants = CollisionConstants.of(Disk(1.0, 1.0))
    >>> constants.velocity == 24 * 10**0.5, 79 < constants.state < 80
    (True, True)
    """

    velocity: float
    state: float

    @classmethod
    def of(cls, disk: Disk) -> CollisionConstants:
        """Return the constants of a disk."""
        instance("disk", disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        velocity = 24.0 * math.sqrt(5.0 * (1.0 + 1.0 / disk.inertia_ratio))
        return cls(velocity, 1.0 + 2.4 + velocity)


@dataclass(frozen=True, repr=False)
class Shadow(Summary):
    """One collision on the cylinder with k contacts, and how far the collision of the true disk stays from it.

    Lengths are in units of the wall, velocities of the disk's speed (the kinetic norm). The flights are those of the
    contact point; the last one ends at the level of the tops.

    Attributes
    ----------
    space : ConfigurationSpace
    state : (array, array), shapes (2,) and (3,)
        Position (x1, alpha) at x2 = 0 and incoming velocity.
    points : array, shape (k + 2, 2)
        The path of the contact: start, contacts, end.
    sines : array, shape (k,)
        Sines of the angles between path and wall at the contacts.
    radii : array, shape (k + 1,)
        The radius of transversality of each flight: its distance from all pieces of the wall but the two on which it
        begins and ends, and the distance of its end from where that piece ends. More than a period beside the hollow
        the level of the tops counts as solid.
    reaches : array, shape (k,)
        The true disk has its contact within this distance of the contact on the cylinder; inf where no bound is found.
    velocity : array, shape (3,)
        (v1, v2, omega) after the collision on the cylinder.
    error : float
        Bound on the kinetic norm of the difference of the true outgoing velocity from ``velocity``; inf if none is
        found.
    reason : str
        Why no bound is found; empty if one is.
    """

    space: ConfigurationSpace
    state: tuple[Floats, Floats]
    points: Floats
    sines: Floats
    radii: Floats
    reaches: Floats
    velocity: Floats
    error: float
    reason: str

    @property
    def is_licit(self) -> bool:
        """Whether the bounds show the same contacts of the true disk, on the same pieces, with one satellite."""
        return not self.reason

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draw the contact's path on the cylinder with the radius of transversality, and the path of the true contact.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            By default the axes of a new figure.

        Returns
        -------
        matplotlib Axes
            Lengths are in units of the wall. Each flight on the cylinder has a band as wide as its radius on both
            sides. Rings have the bounds of the distances of the contacts as radii. The true path is that of the
            satellite that begins lowest.

        Raises
        ------
        InputError
            As in `collision_path`.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=1e-9)
        >>> geo.shadow(space, [0.2e-9, 0.0], [0.0, -1.0, 0.0]).draw().get_legend().get_texts()[0].get_text()
        'on the cylinder'
        """
        space = self.space
        path = collision_path(space.disk, space.wall, space.scale, *self.state, space.spacing) / space.scale
        ax = axes_or_new(ax)
        wall = space.wall
        # the hollow is drawn in the cell that begins at 0
        shift = np.array([np.floor(self.points[-2, 0] / wall.period) * wall.period, 0.0])
        points = self.points - shift + np.array(wall.origin)
        left, right = np.floor(points[1:, 0].min() / wall.period), np.ceil(points[1:, 0].max() / wall.period)
        floor = wall.origin[1] - 1.4 * wall.depth - 0.05 * wall.period
        draw_solid(ax, wall, range(int(left) - 1, int(right) + 1), floor)
        for (first, last), radius in zip(pairwise(points), self.radii, strict=True):
            along = (last - first) / max(float(np.hypot(*(last - first))), np.finfo(float).tiny)
            side = radius * np.array([-along[1], along[0]])
            corners = np.array([first + side, last + side, last - side, first - side])
            ax.fill(*corners.T, color=RAY_COLOURS[0], alpha=0.15, linewidth=0, zorder=0.9)
        ax.plot(*points.T, color=RAY_COLOURS[0], linewidth=1.2, zorder=3, label="on the cylinder")
        number = -space.charts.nearest(path[0, 2] * space.scale)
        fraction = np.linspace(0.0, 1.0, FLIGHT_POINTS)[:, np.newaxis]
        legs = [space.zoomed.satellite(a + fraction * (b - a), number) for a, b in pairwise(path)]
        ax.plot(*(np.concatenate(legs) - shift).T, color=RAY_COLOURS[2], linestyle="--", linewidth=1.4, zorder=3,
                label="of the true disk")  # fmt: skip
        turn = np.linspace(0.0, 2.0 * np.pi, 2 * FLIGHT_POINTS)
        for point, reach in zip(points[1:-1], self.reaches, strict=True):
            if np.isfinite(reach):
                ring = point + reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
                ax.plot(*ring.T, color="black", linewidth=0.8, zorder=3)
        ax.axhline(0.0, color=LEVEL, linewidth=0.8, linestyle=":")
        ax.set_xlim(points[1:, 0].min() - 0.5 * wall.period, points[1:, 0].max() + 0.5 * wall.period)
        ax.set_ylim(floor, wall.origin[1] + 0.6 * max(wall.depth, 0.5 * wall.period))
        ax.set_aspect("equal")
        ax.legend(loc="upper left", frameon=False)
        ax.set_xlabel("x (length units of the wall)")
        ax.set_ylabel("height above the tops")
        return ax


def shadow(space: ConfigurationSpace, position: ArrayLike, velocity: ArrayLike) -> Shadow:
    """Compare the collision of one disk with that on the cylinder which begins at the same contact and velocity.

    The lowest satellite of the true disk moves on a nearly straight path. The bounds follow it from contact to contact:
    how far it is from the path on the cylinder, how far from each other both contacts are, and by how much the
    velocities differ after the reflections. If every contact stays within the radius of transversality, and the disk's
    angle where one satellite is low, then both collisions have the same contacts. The pair of collisions is *licit*.

    Parameters
    ----------
    space : ConfigurationSpace
        Disk, wall, scale and spacing; the wall must close.
    position : array_like, shape (2,)
        (x1, alpha) at x2 = 0.
    velocity : array_like, shape (3,)
        Incoming (v1, v2, omega) with v2 < 0.

    Returns
    -------
    Shadow

    Raises
    ------
    InputError
        If a shape is wrong, v2 is not negative, or the wall has islands or hollows open at the side.

    Notes
    -----
    With X the largest angle of the satellite from the lowest point, velocities of unit norm and d their difference, the
    contact's velocity differs by at most e = J^(-1/2) X + (1/m + 1/J)^(1/2) d. After a flight of time t the paths are
    D <= D_0 + e t apart. With the speed U of the contact and its normal part nu they meet the piece, of curvature
    kappa, within r = D + U s of each other, s = (D + kappa r^2)/nu. The normals differ by at most the square root of
    a^2 + (m/J)(a + X)^2, a = 1.05 kappa r, and d grows by at most twice that. `CollisionConstants` has the paper's,
    larger, constants. The bounds are evaluated in floating point, with room for rounding but without interval
    arithmetic.

    Source: Rudzis 2022, section 5.3.4; the bounds here are of the same form, with the constants that each flight has.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=1e-9)
    >>> pair = geo.shadow(space, [0.2e-9, 0.0], [0.0, -1.0, 0.0])
    >>> pair.is_licit, len(pair.sines), pair.error < 1e-6, round(float(pair.radii[0]), 6)
    (True, 4, True, 0.2)
    """
    instance("space", space, ConfigurationSpace, "geo.ConfigurationSpace(wall, disk, 1e-6)")
    one = (finite_array("position", position)[np.newaxis], finite_array("velocity", velocity)[np.newaxis])
    at, moving = checked_states(*one)
    return _Pair(_Model(space), at[0], moving[0]).follow()


def good_fraction(space: ConfigurationSpace, samples: int = 1000, rng: Rng = None) -> Estimate:
    """Estimate for which part of all states at x2 = 0 bounds show a collision as on the cylinder: the good set.

    States are drawn from the invariant measure <w, e2> dx1 dalpha dw over one period and one spacing. The fraction
    tends to 1 as the scale tends to 0; that is why the collision law of the disk is that of the cylinder.

    Parameters
    ----------
    space : ConfigurationSpace
    samples : int
        Number of states, at least 10.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Estimate
        The fraction for which `shadow` is licit, a lower bound for the fraction that collides alike; the error is the
        half width of 95 % of the sample (Wilson).

    Raises
    ------
    InputError
        As in `shadow`, and if ``samples`` is less than 10.

    Source: Rudzis 2022, section 5.3.5 (the set is F n Xi there).

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> good_fraction(geo.ConfigurationSpace(geo.flat(), geo.Disk(), 1e-6), 50, rng=1).value > 0.8
    True
    """
    instance("space", space, ConfigurationSpace, "geo.ConfigurationSpace(wall, disk, 1e-6)")
    n = whole_number("samples", samples, 10)
    rng = generator(rng)
    position = rng.uniform([0.0, -0.5], [1.0, 0.5], (n, 2)) * [space.scale * space.wall.period, space.spacing]
    # the cosine law on the hemisphere of unit velocities
    upward, turn = np.sqrt(rng.uniform(0.0, 1.0, n)), rng.uniform(0.0, 2.0 * math.pi, n)
    side = np.sqrt(1.0 - upward**2)
    parts = np.stack([side * np.cos(turn), -np.maximum(upward, np.finfo(float).tiny), side * np.sin(turn)], axis=1)
    model, velocity = _Model(space), parts @ space.disk.frame
    good = sum(_Pair(model, x, w).follow().is_licit for x, w in zip(position, velocity, strict=True))
    return fraction_estimate(good / n, n, f"{n} states, 95 % of a binomial sample")


class _Flight(NamedTuple):
    """A flight on the cylinder: its ends, contact velocity, time, normal part of the velocity, and r, D, s and e."""

    first: Floats
    last: Floats
    velocity: Floats
    time: float
    normal: float
    reach: float
    drift: float
    late: float
    rate: float


class _Departure(NamedTuple):
    """The piece that the disk has left, and the time for which it surely does not come back to it."""

    piece: int
    time: float


class _Refused(Exception):
    """No bound is found, for the reason in the message."""


class _Model:
    """The cylinder over a wall: the foreshortened wall, and the pieces of three cells as polylines."""

    def __init__(self, space: ConfigurationSpace) -> None:
        if not space.wall.closes or space.wall.islands:
            raise InputError("space: expected a wall whose hollows are closed, without islands")
        self.space, self.wall = space, space.wall.cell
        self.plane = self.wall.foreshorten(space.disk)
        self.pieces = _polylines(self.wall)


class _Pair:
    """The bounds of one pair of collisions, from contact to contact."""

    def __init__(self, model: _Model, position: Floats, velocity: Floats) -> None:
        self.space, self.wall, self.plane = model.space, model.wall, model.plane
        self.state = position, velocity
        disk = self.space.disk
        start = at_the_tops(self.space.wall, self.space.scale, position[np.newaxis], velocity[np.newaxis])[0]
        self.disk, self.scale = disk, self.space.scale
        self.w = velocity / math.sqrt(float(disk.inner(velocity, velocity)))
        self.rolled = float(disk.rolling_momentum(self.w))
        self.fastest = math.sqrt(1.0 / disk.mass + 1.0 / disk.rim_mass)
        self.most_spin = disk.rim_mass**-0.5
        residual = float(self.space.charts.residual(start[1]))
        # the largest angle so far; the contact begins above the tops
        self.angle = abs(residual)
        self.begin = np.array(rolling.satellite(start[0] / self.scale, 0.0, residual / self.scale, self.scale))
        self.points, self.directions = self._path()
        base = math.floor(float(self.points[0, 0]) / self.wall.period) * self.wall.period
        self.slack = ROUNDED * self.wall.period
        self.pieces = [(line + np.array([base, 0.0]), bend) for line, bend in model.pieces]

    def _path(self) -> tuple[Floats, Floats]:
        """Return the points of the contact's path, from the tops to the tops, and its velocities (v1 + omega, v2)."""
        squeeze = self.disk.foreshortening
        u = self.contact_velocity(self.w)
        across = float(self.begin[0] + u[0] * self.begin[1] / -u[1])
        theta = math.atan2(-u[1] / squeeze, -u[0])
        path, ray = trajectory(self.plane, across, theta), trace(self.plane, across, theta)
        self.lost = not ray.escaped
        speed = math.hypot(u[0], u[1] / squeeze)
        steps = np.diff(path, axis=0)
        units = steps / np.maximum(np.hypot(*steps.T), np.finfo(float).tiny)[:, np.newaxis]
        # flights of length 0 at a flat top have no direction
        units[0] = -math.cos(theta), -math.sin(theta)
        units[-1] = math.cos(float(ray.theta)), math.sin(float(ray.theta))
        return path * [1.0, squeeze], speed * units * [1.0, squeeze]

    def contact_velocity(self, w: Floats) -> Floats:
        return np.array([w[0] + w[2], w[1]])

    def whole_velocity(self, u: Floats) -> Floats:
        """Return (v1, v2, omega) of the contact's velocity; the rolling momentum is kept."""
        spin = (self.rolled + self.disk.mass * u[0]) / (self.disk.mass + self.disk.rim_mass)
        return np.array([u[0] - spin, u[1], spin])

    def follow(self) -> Shadow:
        """Follow both collisions from contact to contact."""
        hits = len(self.points) - 2
        sines, radii = np.full(hits, math.nan), np.full(hits + 1, math.nan)
        reaches = np.full(hits, math.inf)
        error, reason = math.inf, ""
        on = [self._piece_at(point) for point in self.points[1:-1]]
        for k, u in enumerate(self.directions[:-1]):
            change = self.directions[k + 1] - u
            # the change of (v1 + omega, v2) is (k1 (1/m + 1/J), k2/m) up to a factor
            normal = change * [1.0 / self.fastest**2, self.disk.mass]
            sines[k] = abs(normal @ u) / (np.hypot(*normal) * np.hypot(*u))
        for k in range(hits + 1):
            radii[k] = self._radius(k, on)
        try:
            if self.lost or None in on:
                raise _Refused("the path on the cylinder meets a corner, or does not come back")
            error = self._bounds(on, sines, radii, reaches)
        except _Refused as why:
            reason = str(why)
        path, out = np.vstack([self.begin, self.points[1:]]), self.whole_velocity(self.directions[-1])
        state = frozen(self.state[0]), frozen(self.state[1])
        return Shadow(
            self.space, state, frozen(path), frozen(sines), frozen(radii), frozen(reaches), frozen(out), error, reason
        )

    def _bounds(self, on: list[int | None], sines: Floats, radii: Floats, reaches: Floats) -> float:
        """Fill the reaches and return the bound on the last velocity's difference."""
        apart = difference = before = 0.0
        leaving: _Departure | None = None
        for k, sine in enumerate(sines):
            piece = on[k]
            assert piece is not None
            flight = self._flight(k, float(sine), before, apart, difference, self.pieces[piece][1])
            if flight is None or flight.reach >= radii[k]:
                raise _Refused(f"contact {k + 1} may be beyond the radius of transversality")
            self._check_own_pieces(flight, leaving, piece)
            reaches[k] = flight.reach
            self.angle += self.scale * self.most_spin * (flight.time + flight.late + before)
            self._check_angle(0.5 * self.space.spacing - self.space.gap_radius)
            leaving, turned = self._departure(flight, piece)
            steeper = self.disk.inertia_ratio**-0.5
            difference += 2.0 * math.hypot(turned, steeper * (turned + self.angle))
            apart, before = flight.reach + self.fastest * flight.late, flight.late
        self._check_exit(apart, before, difference, float(radii[-1]), leaving)
        return difference

    def _departure(self, flight: _Flight, piece: int) -> tuple[_Departure, float]:
        """Return how long the disk surely does not come back to a piece, and how far its normal may have turned."""
        bend = self.pieces[piece][1]
        turned = ARC * bend * flight.reach
        rate = flight.normal - flight.rate - self.fastest * turned
        if rate <= 0.0:
            raise _Refused("a contact is too shallow")
        # the distance from the piece is at least rate t - bend (U t)^2 - swing t^2/2
        swing = self.scale / self.disk.rim_mass
        time = 0.99 * 2.0 * rate / (2.0 * bend * self.fastest**2 + swing)
        if bend > 0.0:
            time = min(time, BENT / (bend * self.fastest))
            self._check_connected(flight.last, self.fastest * time + flight.reach, piece)
        return _Departure(piece, max(0.0, time - 2.0 * flight.late)), turned

    def _flight(
        self, k: int, sine: float, before: float, apart: float, difference: float, bend: float
    ) -> _Flight | None:
        """Return flight k and its bounds, see `shadow`; None if the iteration for the reach does not end."""
        u, first, last = self.directions[k], self.begin if k == 0 else self.points[k], self.points[k + 1]
        speed = float(np.hypot(*u))
        time, normal = float(np.hypot(*(last - first))) / speed, speed * sine
        spin = min(self.most_spin, abs(float(self.whole_velocity(u)[2])) + difference * self.most_spin)
        reach = late = 0.0
        for _ in range(REACH_STEPS):
            duration = time + before + late
            rate = spin * (self.angle + self.scale * self.most_spin * duration) + self.fastest * difference
            drift = (apart + rate * duration + self.slack) * ROOM
            late = (drift + bend * reach * reach) / normal * ROOM
            wanted = drift + speed * late
            if not bend * wanted < BENT or not wanted < self.wall.period:
                return None
            if wanted <= reach:
                return _Flight(first, last, u, time, normal, reach, drift, late, rate)
            reach = wanted * ROOM
        return None

    def _check_own_pieces(self, flight: _Flight, leaving: _Departure | None, piece: int) -> None:
        """Raise unless the pieces on which the flight begins and ends are met at its end only."""
        first, last, u, time = flight.first, flight.last, flight.velocity, flight.time
        speed = float(np.hypot(*u))
        for number in {piece} if leaving is None else {piece, leaving.piece}:
            bend = self.pieces[number][1]
            begin, end = 0.0, time
            if leaving is not None and number == leaving.piece:
                begin = leaving.time
            if number == piece and bend > 0.0:
                # F = normal s - bend (speed s + drift)^2 is concave: at least the drift between ``late`` and s
                s = min(time, 0.25 * flight.normal / (bend * speed**2))
                away = speed * s + flight.drift
                if not (flight.late < s and bend * away <= BENT and flight.normal * s - bend * away**2 >= flight.drift):
                    raise _Refused("a contact with a curved piece is too shallow")
                self._check_connected(last, away, number)
                end = time - s
            elif number == piece:
                # a straight piece is met where the path is a drift from its line
                end = begin
            if begin < end and self._distance(first + begin * u, first + end * u, number) <= flight.drift:
                raise _Refused("the disk may meet a piece too early")

    def _check_connected(self, point: Floats, radius: float, number: int) -> None:
        """Raise unless the part of a curved piece near a point of it is connected."""
        line = self.pieces[number][0]
        near = np.hypot(*(line - point).T) <= radius + 2.0 * FLATTENING * self.wall.period
        if np.count_nonzero(np.diff(near.astype(int)) > 0) + near[0] > 1:
            raise _Refused("a piece comes back near a contact")

    def _check_exit(
        self, apart: float, before: float, difference: float, radius: float, leaving: _Departure | None
    ) -> None:
        """Raise unless the disk leaves the wall."""
        u, first = self.directions[-1], self.points[-2]
        up = float(u[1])
        rising = up - 2.0 * self._rate(difference)
        if rising <= 0.0:
            raise _Refused("the disk may not rise after the last contact")
        # until the lowest satellite is above the tops
        time = (float(-first[1]) + apart + self.slack) / rising + before
        self.angle += self.scale * self.most_spin * time
        self._check_angle(0.5 * self.space.spacing - self.space.gap_radius)
        rate = self._rate(difference)
        # then until the centre is at height 0
        self.angle += self.most_spin * float(rolling.rise(self.angle)) / (up - self.fastest * difference)
        self._check_angle(0.5 * self.space.spacing)
        if up - rate < rising or up <= self._rate(difference):
            raise _Refused("the disk may not rise after the last contact")
        drift = apart + rate * time + self.slack
        if drift >= radius:
            raise _Refused("the last flight may be beyond the radius of transversality")
        # up to where the drift no longer reaches the tops
        end = (float(-first[1]) + drift) / up
        for number in range(len(self.pieces)):
            begin = leaving.time if leaving is not None and number == leaving.piece else 0.0
            if begin < end and self._distance(first + begin * u, first + end * u, number) <= drift:
                raise _Refused("the disk may touch the wall on its last flight")

    def _rate(self, difference: float) -> float:
        """Return a bound on the difference of the contact's velocities, from that of the velocities and the angle."""
        return float(self.most_spin * self.angle + self.fastest * difference)

    def _check_angle(self, limit: float) -> None:
        if self.angle >= limit:
            raise _Refused("a second satellite may come below the tops")

    def _piece_at(self, point: Floats) -> int | None:
        """Return the number of the piece of a contact, None in a corner."""
        distances = np.array([_distance(point, point, line) for line, _ in self.pieces])
        near = np.flatnonzero(distances <= 2.0 * FLATTENING * self.wall.period)
        closest = int(np.argmin(distances))
        if len(near) > 1:
            return None
        return closest

    def _distance(self, first: Floats, last: Floats, number: int) -> float:
        line, bend = self.pieces[number]
        return _distance(first, last, line) - (FLATTENING * self.wall.period if bend else 0.0)

    def _radius(self, k: int, on: list[int | None]) -> float:
        """Return the radius of transversality of flight k."""
        first = self.begin if k == 0 else self.points[k]
        last = self.points[k + 1]
        own = {on[i] for i in (k - 1, k) if 0 <= i < len(on)}
        found = [self._distance(first, last, n) for n in range(len(self.pieces)) if n not in own]
        if k < len(on):
            piece = on[k]
            found += [self._distance(last, last, n) for n in own if n is not None and n != piece]
            if piece is not None:
                line = self.pieces[piece][0]
                found += [float(np.hypot(*(last - end))) for end in (line[0], line[-1])]
        return max(0.0, min(found, default=math.inf))


def _polylines(wall: Wall) -> list[tuple[Floats, float]]:
    """Return the pieces of three cells as polylines, each with its largest curvature, and level tops beyond."""
    tolerance = FLATTENING * wall.period
    found = []
    for piece in wall.pieces:
        value, error = piece.largest_curvature()
        line = np.array([piece.start, piece.end]) if piece.is_straight else piece.flattened(tolerance)
        found.append((line, value + error))
    shifts = [k * wall.period for k in (-1, 0, 1)]
    beyond = [(shifts[0] - FAR * wall.period, shifts[0]), (shifts[2] + wall.period, shifts[2] + FAR * wall.period)]
    tops = [(np.array([[left, 0.0], [right, 0.0]]), 0.0) for left, right in beyond]
    return [(line + np.array([shift, 0.0]), bend) for shift in shifts for line, bend in found] + tops


def _distance(first: Floats, last: Floats, line: Floats) -> float:
    """Return the distance of a segment from a polyline, 0 if they cross."""
    a, b = line[:-1], line[1:]
    ends = [_to_segments(first, a, b), _to_segments(last, a, b)]
    if np.array_equal(first, last):
        return float(ends[0].min())
    ends += [_to_segments(line, first[np.newaxis], last[np.newaxis])]
    sides = [_cross(last - first, line - first), _cross(b - a, first - a), _cross(b - a, last - a)]
    crossing = (sides[0][:-1] * sides[0][1:] < 0.0) & (sides[1] * sides[2] < 0.0)
    return 0.0 if np.any(crossing) else float(min(part.min() for part in ends))


def _cross(u: Floats, v: Floats) -> Floats:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _to_segments(point: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distances of points from segments."""
    along = b - a
    square = np.maximum(np.sum(along**2, axis=-1), np.finfo(float).tiny)
    part = np.clip(np.sum((point - a) * along, axis=-1) / square, 0.0, 1.0)
    away = point - a - part[..., np.newaxis] * along
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))
