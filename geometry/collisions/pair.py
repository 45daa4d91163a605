"""The deterministic collision of two disks with satellites or teeth on their rims."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, instance, read_only, whole_number
from ...core.errors import InputError
from ..disk.disk import Features, SatelliteDisk
from .encounter import MAX_CONTACTS, TOUCHING, Encounter, largest_bend_of
from .rigid import DiskCounts, DiskStatus, fewest_contacts, mark_amplified


@dataclass(frozen=True, repr=False)
class PairCollision(DiskCounts):
    """The results of `collide_pair` for n pairs.

    Attributes
    ----------
    position, velocity : arrays of shape (n, 2, 3)
        (x1, x2, alpha) and (v1, v2, r omega) of the first and of the second disk, at the last contact; the initial ones
        if there was none.
    time : array of shape (n,)
        The time of the last contact.
    contacts : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `DiskStatus`. ``ESCAPED``: the disks separate, or never meet. ``CORNER``: two contacts at once, whose
        order double precision does not resolve. ``BOUNCE_LIMIT``: more contacts, or more steps, than allowed.
        ``AMPLIFIED``: the disks separate, but rounding may have changed the final state by more than 1e-6.
    """

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    status: NDArray[np.uint8]


def collide_pair(
    first: SatelliteDisk,
    second: SatelliteDisk,
    position: ArrayLike,
    velocity: ArrayLike,
    max_contacts: int = MAX_CONTACTS,
) -> PairCollision:
    r"""Collide two disks with satellites: free flight, and elastic contacts without friction of their satellites.

    At a contact both disks receive opposite impulses along the line between the centres of the satellites, or along the
    normal of the edge that a satellite meets. This is the specular reflection in the kinetic metric of both bodies, and
    keeps the energy, the momentum and the angular momentum. If the satellites are small and close, the outgoing
    velocities are those of `PairLaw` of a wall of arcs: seen from the first disk, the satellites of the second have the
    radius s1 + s2.

    Parameters
    ----------
    first, second : SatelliteDisk
    position : array_like, shape (n, 2, 3)
        (x1, x2, alpha) of both disks, which must not touch.
    velocity : array_like, shape (n, 2, 3)
        (v1, v2, r omega) of both disks.
    max_contacts : int
        Pairs with more contacts end with ``DiskStatus.BOUNCE_LIMIT``.

    Returns
    -------
    PairCollision

    Raises
    ------
    InputError
        If a shape is wrong, or two disks overlap at the start.

    Notes
    -----
    The first contact of two satellites is found by steps that cannot pass it. The distance of their centres has a
    second derivative of at least -A, A = a1 omega1^2 + a2 omega2^2, so that the first root of g + g' t - A t^2/2, with
    the gap g, is a safe step; the height of a satellite over the line of an edge has such a bound, too. Near the
    contact the steps converge like Newton's method. Cost: a few milliseconds a pair.

    Source: Rudzis 2022, sections 1.1.2 and 3, Proposition 3.2; the total angular momentum is kept, not the sum of the
    spins (Proposition 3.3 corrected).

    Examples
    --------
    Two satellites meet head on, on the line between the centres:

    >>> from asperity import geometry as geo
    >>> one = geo.SatelliteDisk(geo.Disk(), 4, 0.25)
    >>> hit = geo.collide_pair(one, one, [[[0, 0, 0], [4, 0, 0]]], [[[1, 0, 0], [0, 0, 0]]])
    >>> hit.time.tolist(), (hit.velocity[0].round(12) + 0.0).tolist(), hit.contacts.tolist()
    ([1.5], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1])
    """
    for name, body in (("first", first), ("second", second)):
        instance(name, body, SatelliteDisk, "geo.SatelliteDisk(geo.Disk(), 100, 0.05)")
    if not (first.joined or second.joined or first.sizes.max() + second.sizes.max() > 0.0):
        raise InputError("first, second: expected satellites of size greater than 0 on one disk; points do not touch")
    whole_number("max_contacts", max_contacts, 1)
    at, moving = finite_array("position", position), finite_array("velocity", velocity)
    if at.ndim != 3 or at.shape[1:] != (2, 3) or moving.shape != at.shape:
        raise InputError(f"position, velocity: expected two arrays of shape (n, 2, 3), got {at.shape}, {moving.shape}")
    # lengths in radii of the first disk, and angular velocities
    unit, lengths, spins = first.disk.radius, np.ones(3), np.ones((2, 3))
    first, second = _in_units(first, unit), _in_units(second, unit)
    lengths[:2], spins[1, 2] = unit, second.disk.radius
    at, moving = at / lengths, moving / spins
    states = at.reshape(-1, 6).copy(), moving.reshape(-1, 6).copy()
    results = [_encounter(first, second, x, w).run(max_contacts) for x, w in zip(at, moving, strict=True)]
    columns = zip(range(3), (np.float64, np.int64, np.uint8), strict=True)
    time, contacts, status = (np.array([result[k] for result in results], kind) for k, kind in columns)

    def again(rows: NDArray[np.intp], x: Floats, w: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        x, w, escaped = x.reshape(-1, 2, 3), w.reshape(-1, 2, 3), np.zeros(len(rows), dtype=bool)
        for k, row in enumerate(rows):
            elapsed, _, outcome = _between(first, second, x[k], w[k]).run(max_contacts)
            # at the same time
            x[k] += (time[row] - elapsed) * w[k]
            escaped[k] = outcome == DiskStatus.ESCAPED
        return x.reshape(-1, 6), w.reshape(-1, 6), escaped

    spacing, ends = max(first.spacing, second.spacing), (at.reshape(-1, 6), moving.reshape(-1, 6))
    masses = np.array([m for body in (first, second) for m in (body.disk.mass, body.disk.mass, body.disk.inertia)])
    ratio = max(1.0 / body.disk.inertia_ratio for body in (first, second))
    uncertain = contacts >= fewest_contacts(spacing * (1.0 + largest_bend_of(first, second)), ratio)
    mark_amplified(again, states, ends, status, uncertain, (spacing, masses))
    return PairCollision(*map(read_only, (at * lengths, moving * spins, unit * time, contacts, status)))


def _in_units(body: SatelliteDisk, unit: float) -> SatelliteDisk:
    disk = replace(body.disk, radius=body.disk.radius / unit)
    return replace(body, disk=disk, size=body.sizes / unit, radius=body.radii / unit)


class _TwoRims:
    """The surroundings of two disks."""

    def __init__(self, first: SatelliteDisk, second: SatelliteDisk) -> None:
        self.bodies = first, second
        self.span = first.largest + second.largest
        reach = float(first.sizes.max() + second.sizes.max())
        self.margin = max(first.spacing, second.spacing, reach)

    def apart(self, here: Floats) -> float:
        """Return the distance of both circles around the disks."""
        return float(np.hypot(*(here[0, :2] - here[1, :2]))) - self.span

    def near(self, here: Floats) -> tuple[Features, Features]:
        """Return the satellites and edges near the circle around the other disk."""
        found = []
        for k, body in enumerate(self.bodies):
            centres = here[k, :2] + body.arms(here[k, 2]) - here[1 - k, :2]
            far = np.hypot(centres[:, 0], centres[:, 1]) - body.sizes - self.bodies[1 - k].largest
            found.append(body.features(here[k, 2], far < self.margin))
        return found[0], found[1]

    def is_over(self, here: Floats, velocity: Floats) -> bool:
        """Whether the disks are out of reach and do not come back, or miss each other."""
        offset, relative = here[0, :2] - here[1, :2], velocity[0, :2] - velocity[1, :2]
        if np.hypot(*offset) <= self.span:
            return False
        closing, speed = float(offset @ relative), float(np.hypot(*relative))
        across = abs(offset[0] * relative[1] - offset[1] * relative[0])
        return bool(closing >= 0.0 or across > self.span * speed)


def _between(first: SatelliteDisk, second: SatelliteDisk, position: Floats, velocity: Floats) -> Encounter:
    radii = first.largest, second.largest
    return Encounter((first.disk, second.disk), radii, _TwoRims(first, second), position, velocity)


def _encounter(first: SatelliteDisk, second: SatelliteDisk, position: Floats, velocity: Floats) -> Encounter:
    apart = float(np.hypot(*(position[0, :2] - position[1, :2])))
    # rims with edges must not even be within the reach of their tips, where points may be between edges
    least = sum(body.largest if body.joined else float(body.radii.max()) for body in (first, second))
    if apart < least:
        raise InputError(
            f"position: expected disks whose rims do not cross, got centres {apart:.6g} radii of the first apart"
        )
    encounter = _between(first, second, position, velocity)
    around = encounter.around
    one, two = around.near(position)
    between = (position[0, :2] - position[1, :2]) + one.arms[:, np.newaxis] - two.arms[np.newaxis, :]
    gaps = np.hypot(between[..., 0], between[..., 1]) - one.sizes[:, np.newaxis] - two.sizes[np.newaxis, :]
    if gaps.size and gaps.min() < -TOUCHING * around.span:
        raise InputError(
            f"position: expected disks that do not touch, got overlaps of {-gaps.min():.3g} radii of the first"
        )
    return encounter
