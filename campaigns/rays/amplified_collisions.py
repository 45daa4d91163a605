"""Collisions that amplify rounding: masses over inertias from 1e-4 to 1e6, judged in 50 digits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpmath import mp, mpf

from asperity import geometry as geo
from asperity.geometry.disk.satellites import Satellites
from campaigns.engine import Campaign, Judged
from campaigns.judges.precise_collision import DIGITS, PreciseCollision

WALLS = {
    "triangular teeth": geo.triangular_teeth(0.7),
    "rectangular teeth": geo.rectangular_teeth(0.5),
    "deep notch": geo.Wall.from_vertices([(0, 0), (0, -1.5), (1, -1.5), (1, 0)]),
    "focusing arcs": geo.focusing_arcs(1.2),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "islands": geo.Wall([geo.Segment((0, -0.5), (1, -0.5))], islands=[[geo.Arc((0.4, -0.2), 0.1, 0.0, -2 * math.pi)]]),
}
# Bound on the errors of a disk that is not amplified.
ACCURACY = 1e-6
# Mass over inertia and scales, log-uniform between these.
RATIOS, SCALES = (1e-4, 1e6), (1e-4, 1e-1)
# Disks over islands whose masses are 10^3 to 2 10^4 times their inertias; rounding decides the last.
SMALL = (89, 185, 203, 221, 449, 509)


@dataclass(frozen=True)
class FallingDisk:
    """A disk of mass 1 on its way to a wall; ``ratio`` is its mass over its inertia."""

    name: str
    scale: float
    ratio: float
    position: np.ndarray
    velocity: np.ndarray


def draw(number: int) -> FallingDisk:
    """The walls in turn."""
    rng, name = np.random.default_rng([1, number]), list(WALLS)[number % len(WALLS)]
    ratio, scale = (math.exp(rng.uniform(*np.log(bounds))) for bounds in (RATIOS, SCALES))
    spacing = Satellites.around(scale, scale * WALLS[name].depth).spacing
    position = np.array([rng.random() * scale * WALLS[name].period, (rng.random() - 0.5) * spacing])
    angles = np.arccos(1.0 - 2.0 * rng.random(2))
    return FallingDisk(name, scale, ratio, position, -geo.Disk(1.0, 1.0 / ratio).from_angles(*angles))


def judge(case: FallingDisk) -> Iterator[Judged]:
    """Whether the outgoing state is right or has the status."""
    wall, disk, scale = WALLS[case.name], geo.Disk(1.0, 1.0 / case.ratio), case.scale
    decade = 2 * math.floor(0.5 * math.log10(case.ratio))
    kind = f"m/J 1e{decade} to 1e{decade + 2}"
    hit = geo.collide(disk, wall, scale, case.position[None], case.velocity[None])
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    with mp.workdps(DIGITS):
        try:
            end = PreciseCollision(disk, wall, scale, spacing, case.position, case.velocity).collide()
        except ArithmeticError as reason:
            yield Judged(kind, outcome=f"not judged: {reason}")
            return
        found = [mpf(float(a)) - mpf(float(b)) for a, b in zip(hit.position[0], case.position, strict=True)]
        found += map(mpf, map(float, hit.velocity[0]))
        apart = np.array([float(a - b) for a, b in zip(found, end, strict=True)])
    speeds = math.sqrt(float(disk.inner(case.velocity, case.velocity))) / np.sqrt([disk.mass, disk.mass, disk.rim_mass])
    error = float(np.abs(np.concatenate([apart[:2], apart[2:] / speeds])).max())
    if hit.status[0] == geo.DiskStatus.AMPLIFIED:
        yield Judged(kind, outcome="amplified" if error > ACCURACY else "amplified needlessly")
    elif hit.escaped[0]:
        yield Judged(kind, ACCURACY, error)
    else:
        yield Judged(kind, outcome="not escaped")


CAMPAIGNS = (
    Campaign("amplified-collisions", "Does the status show which disks rounding has changed?", draw, judge, 800,
             SMALL),
)  # fmt: skip
