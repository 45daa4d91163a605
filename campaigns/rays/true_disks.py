"""The true disk: its collisions reversed, and plates thinner than rounding against brute force."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from asperity import geometry as geo
from asperity.core.rounding import EPS
from asperity.geometry.disk.satellites import Satellites
from campaigns.engine import Campaign, Judged
from campaigns.judges.precise_collision import collide_precisely
from campaigns.speed.timing import least_time

COLLISIONS, REPEATS = 2**18, 5
STATES = 1000
DISK = geo.Disk(1.0, 0.6)
TIMED = (geo.triangular_teeth(1.2), geo.triangular_teeth(0.7), geo.focusing_arcs(1.2))
CHECKED = {
    "triangular teeth": geo.triangular_teeth(1.2),
    "rectangular teeth": geo.rectangular_teeth(0.5),
    "focusing arcs": geo.focusing_arcs(1.2),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "elliptical arcs": geo.elliptical_arcs(1.0, DISK),
}
SCALES = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)
REVERSED = tuple(product(CHECKED, SCALES))
# Random perturbations of the reversed path; the largest change estimates its conditioning. With six perturbations, two
# states in 10^6 seemed worse than their conditioning because their three coordinates happened to cancel.
SHAKES = 20
# Relative change of the energy; measured 1.1e-15.
ENERGY = 1e-14
# Disks for each plate and scale.
PLATE_STATES = 200


def random_states(wall: geo.Wall, scale: float, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Positions over one cell and one spacing, and velocities with independent uniform cosines."""
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    position = np.stack([rng.random(n) * scale * wall.period, (rng.random(n) - 0.5) * spacing], axis=1)
    return position, -DISK.from_angles(np.arccos(1 - 2 * rng.random(n)), np.arccos(1 - 2 * rng.random(n)))


def collisions_a_second() -> float:
    """The least over walls and scales, on one thread."""
    rng, found = np.random.default_rng(0), []
    for wall, scale in product(TIMED, (1e-2, 1e-4, 1e-6)):
        arguments = (DISK, wall, scale, *random_states(wall, scale, COLLISIONS, rng))
        found.append(COLLISIONS / least_time(lambda a=arguments: geo.collide(*a, threads=1), REPEATS)[1])
    return min(found)


def judge_reversed(number: int) -> Iterator[Judged]:
    """Whether each outcome, reversed, is the way back within its conditioning, which perturbations measure."""
    (name, scale), rng = REVERSED[number % len(REVERSED)], np.random.default_rng([1, number])
    wall = CHECKED[name]
    position, velocity = random_states(wall, scale, STATES, rng)
    out = geo.collide(DISK, wall, scale, position, velocity)
    good = out.escaped
    back = geo.collide(DISK, wall, scale, out.position[good], -out.velocity[good])
    error = np.abs(back.velocity + velocity[good]).max(axis=1)
    # positions are computed from angles up to the spacing and have the rounding error of that size
    size = np.array([1e-3 * scale, Satellites.around(scale, scale * wall.depth).spacing])
    shaken = np.zeros(len(error))
    for _ in range(SHAKES):
        place = np.maximum(np.abs(out.position[good]), size)
        moved = out.position[good] + 16 * EPS * place * rng.choice([-1, 1], place.shape)
        turned = -out.velocity[good] * (1 + 64 * EPS * rng.choice([-1, 1], (len(place), 3)))
        other = geo.collide(DISK, wall, scale, moved, turned)
        shaken = np.maximum(shaken, np.abs(other.velocity - back.velocity).max(axis=1))
    wrong = back.escaped & (error > 1e-12 + 8 * shaken)
    lost = int((~good).sum() + (~back.escaped).sum())
    kind = f"{name}, scale {scale:g}"
    for number, fault, outcome in ((int(wrong.sum()), "another way back", ""), (lost, "", "not settled"),
                                   (STATES - lost - int(wrong.sum()), "", "")):  # fmt: skip
        if number:
            yield Judged(kind, fault=fault, outcome=outcome, number=number)
    energy = np.abs(DISK.inner(out.velocity, out.velocity)[good] - 1.0).max()
    yield Judged(f"energy, {name}", ENERGY, float(energy))


def standing_plate(thickness: float, lean: float) -> geo.Wall:
    """A wall with a plate in a rectangular hollow."""
    foot = 0.5 - 0.5 * thickness
    points = [(foot, -0.9), (foot + lean, -0.2), (foot + lean + thickness, -0.2), (foot + thickness, -0.9)]
    points = [point for k, point in enumerate(points) if k == 0 or point != points[k - 1]]
    return geo.Wall.from_vertices([(0.0, 0.0), (0.0, -0.9), *points, (1.0, -0.9), (1.0, 0.0)])


def floating_plate(thickness: float, tilt: float) -> geo.Wall:
    """A wall with a plate over a floor."""
    along, down = (
        0.3 * np.array([math.cos(tilt), math.sin(tilt)]),
        thickness * np.array([math.sin(tilt), -math.cos(tilt)]),
    )
    middle = np.array([0.5, -0.5])
    corners = [tuple(p) for p in (middle - along, middle + along, middle + along + down, middle - along + down)]
    loop = [point for k, point in enumerate(corners) if point not in corners[:k]]
    island = [geo.Segment(a, b) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)]
    return geo.Wall([geo.Segment((0.0, -0.9), (1.0, -0.9))], period=1.0, islands=[island])


PLATES = (
    *((f"standing plate, {t:g} thick", standing_plate(t, 0.0)) for t in (0.0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-10)),
    *((f"leaning plate, {t:g} thick", standing_plate(t, 0.04)) for t in (0.0, 3e-16, 1e-14)),
    *((f"floating plate, {t:g} thick, tilted by {angle:g}", floating_plate(t, angle))
      for t, angle in product((0.0, 3e-16, 1e-13), (0.0, 0.3, 1.2))),
)  # fmt: skip


def judge_plates(number: int) -> Iterator[Judged]:
    """Compare with brute force the disks that it follows to the end."""
    (name, wall), scale = PLATES[number % len(PLATES)], (1e-1, 1e-3)[number // len(PLATES)]
    position, velocity = random_states(wall, scale, PLATE_STATES, np.random.default_rng(2))
    out = geo.collide(DISK, wall, scale, position, velocity)
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    _, expected, contacts = collide_precisely(DISK, wall, scale, spacing, position, velocity)
    judged = ~np.isnan(expected[:, 0])
    apart = np.abs(expected - out.velocity).max(axis=1) > 1e-9
    wrong = judged & (~out.escaped | apart | (contacts != out.contacts))
    for number, fault in ((int(wrong.sum()), "lost or wrong"), (int((judged & ~wrong).sum()), "")):
        if number:
            yield Judged(f"{name}, scale {scale:g}", fault=fault, number=number)


CAMPAIGNS = (
    Campaign("true-disks", "Is a reversed collision the way back?", int, judge_reversed, 1000, range(25)),
    Campaign("thin-plates", "Do disks meet plates thinner than rounding?", int, judge_plates, 36, [26]),
)
