"""The modified law K~ = eta^(-1) K eta against the cylinder's law K_cyl, and as an involution, for decreasing scale.

A case draws states of the cylinder from the invariant measure over one period of the wall and one spacing of the
satellites. K~ must tend to K_cyl, and be its own inverse on the states where it is defined as in the paper.

The bound on the defect of the involution: let R be the exact K~ with the outgoing velocity reversed, so R(R(s)) = s.
The computed map takes s to R(s + a) + b, where a are the rounding errors before the last contact, as changes of the
start, and b those after it. Computed twice it takes s to R(R(s + a) + b + a') + b' = s + a + DR (b + a') + b', to first
order, with the derivative DR at the computed R(s). In the domain |alpha| <= rho/2. There eta takes the time
(1 - cos alpha)/|v2| and changes alpha by at most tan(rho/4), because |v2| > sin(rho/2)/J^(1/2) >= sin(rho/2) |omega|
for unit velocities, so no position exceeds rho. Each of eta, its inverse and the flights is at most 8 operations with
positions, each contact 8 with velocities of at most J^(-1/2). An error of the height moves the position at height 0 by
up to J^(-1/2)/|v2| as much, with v2 the smaller of the incoming and the outgoing one. So an error is at most dx = 4 eps
J^(-1/2) rho (contacts + 2)/|v2| in position and dv = 4 eps J^(-1/2) (contacts + 1) in velocity, and the defect in
velocity at most 2 |DR_x| dx + 2 (1 + |DR_v|) dv, where DR_x and DR_v, the derivatives of the outgoing velocity, are
divided differences.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity.core.checks import Floats
from asperity.core.rounding import EPS
from campaigns.engine import Campaign, Judged

WALLS = {
    "triangular teeth": geo.triangular_teeth(1.2),
    "rectangular teeth": geo.rectangular_teeth(1.0),
    "focusing arcs": geo.focusing_arcs(1.0),
    "dispersing arcs": geo.dispersing_arcs(1.0),
}
DISK = geo.Disk(mass=1.0, inertia_ratio=0.6)
# Each scale is a hundredth of the one before; the distance must halve at least, and be small at last.
SCALES, HALVED, LAST_DISTANCE = (1e-2, 1e-4, 1e-6), 0.5, 0.02
STATES, BLOCKS = 2000, 20
# A state does not return if K~ applied twice misses it by more than this, in unit velocity or in a cell.
MISMATCH = 1e-3
# Steps of the divided differences, of positions in units of the scale. ROUNDING is 8 operations, each of half an eps.
STEP, ROUNDING = 1e-6, 4.0 * EPS


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
    """Mean distance |w~' - w'| of unit velocities, and |K~(K~(s)) - s| beside its bound, where it is the largest."""
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
        by_position, by_velocity = _slopes(wall, scale, spacing, out.position[inside], -out.velocity[inside])
        rise = np.minimum(-velocity[inside, 1], out.velocity[inside, 1])
        steps = by_position * spacing / rise * (back.contacts + 2.0) + (1.0 + by_velocity) * (back.contacts + 1.0)
        bound = 2.0 * ROUNDING / math.sqrt(DISK.rim_mass) * steps
        worst = int(np.argmax(defect / bound))
        yield Judged(f"{name}, involution at {scale:g}", float(bound[worst]), float(defect[worst]), fault=fault)


def _slopes(wall: geo.Wall, scale: float, spacing: float, position: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """Return bounds on the derivatives of the outgoing velocity by the position and by the incoming velocity."""
    states, slopes = np.hstack([position, velocity]), []
    for axis, step in enumerate(STEP * np.array([scale, scale, 1.0, 1.0, 1.0])):
        ends = states + step * (np.arange(5) == axis)
        moved = [geo.collide_modified(DISK, wall, scale, s[:, :2], s[:, 2:], spacing).velocity for s in (states, ends)]
        slopes.append(np.abs(moved[1] - moved[0]).max(axis=1) / step)
    return np.sum(slopes[:2], axis=0), np.sum(slopes[2:], axis=0)


CAMPAIGNS = (
    Campaign(
        "modified-law", "Does lemma 5.2 (iii) of the paper hold?", draw, judge, BLOCKS * len(WALLS), range(len(WALLS))
    ),
)
