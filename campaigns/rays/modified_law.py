"""The modified law K~ = eta^(-1) K eta against the cylinder's law K_cyl, and as an involution, for decreasing scale.

A case draws states of the cylinder from the invariant measure over one period of the wall and one spacing of the
satellites. K~ must tend to K_cyl, and be its own inverse on the states where it is defined as in the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity.core.checks import Floats
from campaigns.engine import Campaign, Judged

WALLS = {
    "triangular teeth": geo.triangular_teeth(1.2),
    "rectangular teeth": geo.rectangular_teeth(1.0),
    "focusing arcs": geo.focusing_arcs(1.0),
    "dispersing arcs": geo.dispersing_arcs(1.0),
}
DISK = geo.Disk(mass=1.0, inertia=0.6)
# Each scale is a hundredth of the one before; the distance must halve at least, and be small at last.
SCALES, HALVED, LAST_DISTANCE = (1e-2, 1e-4, 1e-6), 0.5, 0.02
STATES, BLOCKS = 2000, 20
# A state does not return if K~ applied twice misses it by more than this, in unit velocity or in a cell. Rounding of
# positions, times the radius, changes velocities on arcs; the median error is this over the root of the scale.
MISMATCH, DEFECT = 1e-3, 2.0 * float(np.finfo(float).eps)


def draw(number: int) -> tuple[str, np.random.Generator]:
    """A wall, and the generator of its states."""
    return list(WALLS)[number % len(WALLS)], np.random.default_rng([2022, number])


def states(wall: geo.Wall, scale: float, spacing: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Positions (x1, alpha) and incoming unit velocities from Lambda^2, alpha in (-rho/2, rho/2)."""
    position = rng.uniform([0.0, -0.5 * spacing], [scale * wall.period, 0.5 * spacing], (STATES, 2))
    # <w, e2> dw on the half sphere: uniform in the disk below it
    radius, turn = np.sqrt(rng.random(STATES)), rng.uniform(0, 2 * math.pi, STATES)
    across, along, up = radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)
    return position, -(np.stack([across, up, along], axis=-1) @ DISK.frame)


def judge(case: tuple[str, np.random.Generator]) -> Iterator[Judged]:
    """Mean distance |w~' - w'| of unit velocities, and median of |K~(K~(s)) - s|, over the states of the domain."""
    name, rng = case
    wall, before = WALLS[name], math.inf
    for scale in SCALES:
        spacing = geo.ConfigurationSpace(wall, DISK, scale).spacing
        position, velocity = states(wall, scale, spacing, rng)
        out = geo.collide_modified(DISK, wall, scale, position, velocity, spacing)
        straight = geo.collide_cylinder(DISK, wall, scale, position, velocity)
        inside = out.inside & out.escaped & straight.escaped
        change = out.velocity[inside] - straight.velocity[inside]
        distance = float(np.mean(np.sqrt(DISK.inner(change, change))))
        largest = LAST_DISTANCE if scale == SCALES[-1] else 2.0
        yield Judged(f"{name}, distance at {scale:g}", min(largest, HALVED * before), distance)
        before = distance
        back = geo.collide_modified(DISK, wall, scale, out.position[inside], -out.velocity[inside], spacing)
        defect = np.abs(back.velocity + velocity[inside]).max(axis=1)
        moved = np.abs(back.position - position[inside]).max(axis=1)
        missed = np.mean((defect > MISMATCH) | (moved > MISMATCH * scale))
        fault = f"{missed:.2g} of the states do not return" if missed else ""
        yield Judged(
            f"{name}, involution at {scale:g}", DEFECT / math.sqrt(scale), float(np.median(defect)), fault=fault
        )


CAMPAIGNS = (
    Campaign(
        "modified-law", "Does lemma 5.2 (iii) of the paper hold?", draw, judge, BLOCKS * len(WALLS), range(len(WALLS))
    ),
)
