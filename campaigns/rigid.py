"""The true disk: collisions a second, and the involution for many random states (python -m campaigns.rigid)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity.core.tables import table
from asperity.geometry.disk.satellites import Satellites
from campaigns.judges.plain_collision import collide_plainly

from .pages import print_table
from .timing import least_time

COLLISIONS, REPEATS = 2**18, 5
STATES = 10**6
DISK = geo.Disk(1.0, 0.6)
TIMED = {
    "triangular teeth, 1.2 radians": geo.triangular_teeth(1.2),
    "triangular teeth, 0.7 radians": geo.triangular_teeth(0.7),
    "focusing arcs, 1.2 radians": geo.focusing_arcs(1.2),
}
CHECKED = {
    "triangular teeth": geo.triangular_teeth(1.2),
    "rectangular teeth": geo.rectangular_teeth(0.5),
    "focusing arcs": geo.focusing_arcs(1.2),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "elliptical arcs": geo.elliptical_arcs(1.0, DISK),
}
SCALES = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)
EPS = float(np.finfo(float).eps)
# Random perturbations of the reversed path; the largest change estimates its conditioning. With six perturbations, two
# states in 10^6 seemed worse than their conditioning because their three coordinates happened to cancel.
SHAKES = 20
# Disks for each plate and scale.
PLATE_STATES = 200


@dataclass(frozen=True)
class Speed:
    """Collisions a second of the true disk, on one thread and on two."""

    wall: str
    scale: float
    contacts: float
    one_thread: float
    two_threads: float


@dataclass(frozen=True)
class InvolutionCheck:
    """Worst and median errors of K(K(s)) = s, and the number of states beyond their conditioning."""

    wall: str
    scale: float
    states: int
    not_settled: int
    median: float
    worst: float
    mismatches: int
    energy: float


def random_states(wall: geo.Wall, scale: float, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Positions over one cell and one spacing, and velocities with independent uniform cosines."""
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    position = np.stack([rng.random(n) * scale * wall.period, (rng.random(n) - 0.5) * spacing], axis=1)
    return position, -DISK.from_angles(np.arccos(1 - 2 * rng.random(n)), np.arccos(1 - 2 * rng.random(n)))


def measure_rigid() -> list[Speed]:
    """One row for each wall and scale, with the least time of the repeats."""
    rng, rows = np.random.default_rng(0), []
    for what, wall in TIMED.items():
        for scale in (1e-2, 1e-4, 1e-6):
            position, velocity = random_states(wall, scale, COLLISIONS, rng)
            arguments = (DISK, wall, scale, position, velocity)
            (hit, one), (_, two) = (
                least_time(lambda a=arguments, k=threads: geo.collide(*a, threads=k), REPEATS) for threads in (1, 2)
            )
            rows.append(Speed(what, scale, float(hit.contacts.mean()), COLLISIONS / one, COLLISIONS / two))
    return rows


def check_involution() -> list[InvolutionCheck]:
    """Divide the states among walls and scales; perturb each reversed path to measure its conditioning."""
    rng, rows = np.random.default_rng(1), []
    n = STATES // (len(CHECKED) * len(SCALES))
    for what, wall in CHECKED.items():
        for scale in SCALES:
            position, velocity = random_states(wall, scale, n, rng)
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
            settled = back.escaped
            missed = settled & (error > 1e-12 + 8 * shaken)
            energy = float(np.abs(DISK.inner(out.velocity, out.velocity)[good] - 1.0).max())
            lost = int((~good).sum() + (~settled).sum())
            figures = float(np.median(error)), float(error[settled].max()), int(missed.sum()), energy
            rows.append(InvolutionCheck(what, scale, n, lost, *figures))
    return rows


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


def check_plates() -> Iterator[str]:
    """Rows for plates and sharp peaks, compared with the tests' brute force: counts of unresolved and wrong disks."""
    walls = {f"standing plate, {t:g} thick": standing_plate(t, 0.0) for t in (0.0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-10)}
    walls |= {f"leaning plate, {t:g} thick": standing_plate(t, 0.04) for t in (0.0, 3e-16, 1e-14)}
    walls |= {
        f"floating plate, {t:g} thick, tilted by {angle:g}": floating_plate(t, angle)
        for t in (0.0, 3e-16, 1e-13)
        for angle in (0.0, 0.3, 1.2)
    }
    for name, wall in walls.items():
        for scale in (1e-1, 1e-3):
            position, velocity = random_states(wall, scale, PLATE_STATES, np.random.default_rng(2))
            out = geo.collide(DISK, wall, scale, position, velocity)
            spacing = Satellites.around(scale, scale * wall.depth).spacing
            _, expected, contacts = collide_plainly(DISK, wall, scale, spacing, position, velocity)
            judged = ~np.isnan(expected[:, 0])
            apart = np.abs(expected - out.velocity).max(axis=1) > 1e-6
            wrong = int((judged & out.escaped & (apart | (contacts != out.contacts))).sum())
            lost = int((judged & ~out.escaped).sum())
            yield f"{name} | {scale:g} | {PLATE_STATES} | {int(judged.sum())} | {lost} | {wrong}"


def speed_table(measured: Iterable[Speed]) -> str:
    """A table of the speeds."""
    rows = (
        f"{speed.wall} | {speed.scale:.0e} | {speed.contacts:.2f} | {speed.one_thread / 1e6:.2f} "
        f"| {speed.two_threads / 1e6:.2f}"
        for speed in measured
    )
    return table("true disk | scale | contacts a collision | M collisions/s | two threads", rows)


def main() -> None:
    """Print the three tables."""
    print_table("wall | scale | disks | judged | lost | wrong", check_plates())
    rows = (
        f"{row.wall} | {row.scale:.0e} | {row.states} | {row.not_settled} | {row.median:.1e} | {row.worst:.1e} "
        f"| {row.mismatches} | {row.energy:.1e}"
        for row in check_involution()
    )
    print_table("wall | scale | states | not settled | median error | worst error | mismatches | energy", rows)
    print(speed_table(measure_rigid()))


if __name__ == "__main__":
    main()
