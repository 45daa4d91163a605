"""The billiard map of a container, and the reflection by a domain that is entered through openings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, finite_array, instance, read_only, whole_number
from ...core.errors import InputError
from ..tables.boundary import TINIEST, FlightStatus
from ..tables.container import Container
from .tracing import MAX_COLLISIONS, Status, StatusCounts

# The least and the largest angle in (0, pi).
ANGLES = (TINIEST, float(np.nextafter(np.pi, 0.0)))


@dataclass(frozen=True, repr=False)
class BoundaryStates(StatusCounts):
    """States of particles on the boundary of a container.

    Attributes
    ----------
    s : array, shape (n,)
        Arc length, as in `Container.point_at`.
    theta : array, shape (n,)
        Angle of the velocity from the tangent, in (0, pi), with the inside on the left of the tangent.
    wall : array of int, shape (n,)
    time : array, shape (n,)
        Length of the path.
    collisions : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `Status`: ``ESCAPED`` for particles that did what was asked, ``BOUNCE_LIMIT`` for those that came to
        no opening, ``CORNER`` and ``GRAZING`` as in `BilliardRecord`; the state is then the last one that is resolved.
    """

    s: Floats
    theta: Floats
    wall: NDArray[np.int64]
    time: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    _unit = "radians, and the container's unit of length"


def billiard_map(container: Container, s: ArrayLike, theta: ArrayLike, iterations: int = 1) -> BoundaryStates:
    r"""Apply the billiard map Phi: fly to the next wall, and reflect there.

    Phi maps (s, theta), a point of the boundary and an inward direction, to the next point and the direction after
    the specular reflection. It preserves sin(theta) ds dtheta. Its inverse is -R Phi -R, where -R reverses the particle
    after a reflection: (s, theta) -> (s, pi - theta).

    Parameters
    ----------
    container : Container
        From curves.
    s : array_like, shape (n,)
        Arc lengths, modulo the perimeter. At a corner the particle is at the start of the later curve.
    theta : array_like, shape (n,)
        Angles from the tangent, in (0, pi), radians.
    iterations : int
        How often Phi is applied, at least 0.

    Returns
    -------
    BoundaryStates

    Raises
    ------
    InputError
        If the container has no curves, a shape is wrong or an angle is outside of (0, pi).

    Notes
    -----
    Source: Rudzis 2022, section 6.1: Lemma 6.1 (inverse) and Lemma 6.2 (measure, with the letters as in section 6.1.3
    corrected to <p, n(q)> sigma_q(dp) tau_1(dq)).

    Examples
    --------
    In a circle the angle stays, and s grows by the chord's arc, 2 theta:

    >>> from asperity import geometry as geo
    >>> after = geo.billiard_map(geo.Container.circle(1.0), [0.0], [0.5])
    >>> after.s.round(14).tolist(), after.theta.round(14).tolist()
    ([1.0], [0.5])
    """
    whole_number("iterations", iterations, 0)
    flight = _Flight(container, s, theta)
    for _ in range(iterations):
        flight.advance(np.flatnonzero(flight.status == Status.ESCAPED))
    return flight.states()


def nested_reflection(
    container: Container,
    openings: Sequence[int],
    s: ArrayLike,
    theta: ArrayLike,
    max_collisions: int = MAX_COLLISIONS,
) -> BoundaryStates:
    r"""Reflect particles by a domain that they enter through openings: the map P of two nested domains.

    The inner domain is the free space outside of the container, the outer domain contains the container too: a particle
    passes through the openings, is reflected by the other walls, and leaves through an opening. As for walls, ``theta``
    is the angle of *minus* the incoming velocity, and the result is the angle of the outgoing one, both from the
    tangent that has the outside on its left, that is, against the direction of travel of the curves. Then P is an
    involution that preserves sin(theta) ds dtheta: theta' = theta is retroreflection.

    Parameters
    ----------
    container : Container
        From curves.
    openings : sequence of int
        The walls through which particles pass.
    s : array_like, shape (n,)
        Arc lengths on openings.
    theta : array_like, shape (n,)
        Angles in (0, pi), radians.
    max_collisions : int
        Particles that are inside after so many collisions end with ``Status.BOUNCE_LIMIT``.

    Returns
    -------
    BoundaryStates
        ``theta`` is the outgoing angle as described here; ``collisions`` does not count openings.

    Raises
    ------
    InputError
        If a wall does not exist, a particle does not begin on an opening, or the arguments are none of `billiard_map`.

    Notes
    -----
    P = R Phi^M(q, -p), where M is the first time on an opening.

    Source: Rudzis 2022, section 6.2.1, eq. 6.24 (U+ in the definition of M corrected to V-).

    Examples
    --------
    A well with a right angle at its bottom sends every particle back that it reflects twice:

    >>> from math import pi
    >>> from asperity import geometry as geo
    >>> well = geo.Container.from_curves(
    ...     [geo.Segment((0, 0), (1, -1)), geo.Segment((1, -1), (2, 0)), geo.Segment((2, 0), (0, 0))])
    >>> back = geo.nested_reflection(well, [2], [well.perimeter - 0.5], [pi / 2])
    >>> back.theta.round(12).tolist() == [round(pi / 2, 12)], back.collisions.tolist()
    (True, [2])
    """
    whole_number("max_collisions", max_collisions, 1)
    flight = _Flight(container, s, np.asarray(angles("theta", theta)))
    is_open = np.zeros(flight.container.wall_count, dtype=bool)
    for wall in openings:
        is_open[whole_number("openings", wall, 0, most=len(is_open) - 1)] = True
    if not np.all(is_open[flight.wall]):
        outside = int(np.argmin(is_open[flight.wall]))
        raise InputError(
            f"s: expected arc lengths on openings, got {flight.length[outside]!r} on wall {int(flight.wall[outside])}"
        )
    inside = np.arange(len(flight.wall))
    for _ in range(max_collisions + 1):
        flight.advance(inside)
        inside = inside[(flight.status[inside] == Status.ESCAPED) & ~is_open[flight.wall[inside]]]
        if not len(inside):
            break
    flight.status[inside] = Status.BOUNCE_LIMIT
    left = flight.status == Status.ESCAPED
    flight.made -= left
    flight.theta = np.where(left, np.pi - flight.theta, flight.theta)
    return flight.states()


class _Flight:
    """Particles on the boundary, moved from wall to wall."""

    def __init__(self, container: Container, s: ArrayLike, theta: ArrayLike) -> None:
        instance("container", container, Container, "geo.Container.circle()")
        length, self.theta = finite_array("s", s), angles("theta", theta).copy()
        if length.ndim != 1 or self.theta.shape != length.shape:
            raise InputError(f"s, theta: expected two arrays of shape (n,), got {length.shape}, {self.theta.shape}")
        self.container = container = container.closed()
        self.position, self.wall = container.point_at(length)
        self.length = container.length_at(self.position, self.wall)
        n = len(length)
        tangent, normal = container.frames(self.position, self.wall)
        angle = self.theta[:, None]
        self.velocity, self.time = np.cos(angle) * tangent + np.sin(angle) * normal, np.zeros(n)
        self.made = np.zeros(n, dtype=np.int64)
        self.status = np.full(n, Status.ESCAPED, dtype=np.uint8)

    def advance(self, moving: NDArray[np.int64]) -> None:
        """Move some particles to their next wall and reflect them."""
        flight, wall, status = self.container.next_wall(self.position[moving], self.velocity[moving], self.wall[moving])
        # corners and grazing paths have the same values in both; a wall is missed at corners only
        self.status[moving] = np.where(wall < 0, Status.CORNER, status)
        hit = status == FlightStatus.FLYING
        moving, flight, wall = moving[hit], flight[hit], wall[hit]
        self.time[moving] += flight
        self.position[moving] += self.velocity[moving] * flight[:, None]
        self.wall[moving] = wall
        self.made[moving] += 1
        for k in np.unique(wall):
            here = moving[wall == k]
            point = self.container.touch(int(k), self.position[here])
            mirrored = point.incoming(self.velocity[here]) * [1.0, -1.0]
            self.position[here] = point.position
            self.theta[here] = np.clip(np.arctan2(mirrored[:, 1], mirrored[:, 0]), *ANGLES)
            # without growth of the speed by rounding
            self.velocity[here] = point.outgoing(mirrored / np.hypot(mirrored[:, :1], mirrored[:, 1:]))

    def states(self) -> BoundaryStates:
        length = self.container.length_at(self.position, self.wall)
        arrays = (length, self.theta, self.wall, self.time, self.made, self.status)
        return BoundaryStates(*map(read_only, arrays))
