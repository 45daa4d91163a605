"""The modified law K~ = eta^(-1) K eta against the cylinder's law K_cyl, and as an involution, for decreasing scale.

``python -m campaigns.modified_law`` draws states of the cylinder from the invariant measure over one period of the
wall and one spacing of the satellites. It prints the distance of the two laws and how often K~ is its own inverse.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo

from .pages import print_table

Floats = NDArray[np.float64]
WALLS = {
    "triangular teeth": geo.triangular_teeth(1.2),
    "rectangular teeth": geo.rectangular_teeth(1.0),
    "focusing arcs": geo.focusing_arcs(1.0),
    "dispersing arcs": geo.dispersing_arcs(1.0),
}
DISK = geo.Disk(mass=1.0, inertia=0.6)
SCALES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
STATES = 20_000
# A state does not return if K~ applied twice misses it by more than this, in unit velocity or in a cell.
MISMATCH = 1e-3


@dataclass(frozen=True)
class Measured:
    """The results at one scale.

    Attributes
    ----------
    spacing : float
    inside : float
        Fraction of the states at which K~ is defined as in the paper.
    distance, distance_error : float
        Mean of |w~' - w'|, the kinetic norm for unit velocities, over the states inside, and the half width of its 95 %
        interval.
    distance_of_all : float
        The same mean over all states that escaped, including the states outside.
    displacement : float
        Mean of |y~' - y'|, the larger coordinate, in units of the scale.
    defect : float
        Median of |K~(K~(s)) - s| in the velocity, over the states inside.
    mismatches, mismatches_outside : float
        Fractions of the states inside, and of the escaped states outside, that do not return.
    """

    spacing: float
    inside: float
    distance: float
    distance_error: float
    distance_of_all: float
    displacement: float
    defect: float
    mismatches: float
    mismatches_outside: float


def states(
    wall: geo.Wall, disk: geo.Disk, scale: float, spacing: float, n: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Positions (x1, alpha) and incoming unit velocities from Lambda^2, alpha in (-rho/2, rho/2)."""
    position = np.stack([rng.uniform(0, scale * wall.period, n), rng.uniform(-0.5, 0.5, n) * spacing], axis=-1)
    # <w, e2> dw on the half sphere: uniform in the disk below it
    radius, turn = np.sqrt(rng.random(n)), rng.uniform(0, 2 * math.pi, n)
    across, along, up = radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)
    return position, -(np.stack([across, up, along], axis=-1) @ disk.frame)


def measured(wall: geo.Wall, disk: geo.Disk, scale: float, n: int, rng: np.random.Generator) -> Measured:
    """Draw states, apply both laws to them, and apply K~ twice to the states inside."""
    spacing = geo.ConfigurationSpace(wall, disk, scale).spacing
    position, velocity = states(wall, disk, scale, spacing, n, rng)
    out = geo.collide_modified(disk, wall, scale, position, velocity, spacing)
    straight = geo.collide_cylinder(disk, wall, scale, position, velocity)
    both = out.escaped & straight.escaped
    inside = out.inside & both
    change = out.velocity - straight.velocity
    apart = np.sqrt(disk.inner(change, change))
    moved = np.abs(out.position - straight.position)[inside].max(axis=1) / scale
    defect = np.full(n, np.inf)
    back = geo.collide_modified(disk, wall, scale, out.position[both], -out.velocity[both], spacing)
    defect[both] = np.abs(back.velocity + velocity[both]).max(axis=1)
    missed = np.ones(n, dtype=bool)
    missed[both] = np.abs(back.position - position[both]).max(axis=1) > MISMATCH * scale
    missed |= defect > MISMATCH
    outside = both & ~inside
    return Measured(
        spacing,
        float(inside.mean()),
        float(apart[inside].mean()),
        1.96 * float(apart[inside].std(ddof=1)) / math.sqrt(np.sum(inside)),
        float(apart[both].mean()),
        float(moved.mean()),
        float(np.median(defect[inside])),
        float(np.mean(missed[inside])),
        float(np.mean(missed[outside])),
    )


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--states", type=int, default=STATES)
    arguments = parser.parse_args(argv)
    rng = np.random.default_rng(2022)
    cases = product(WALLS.items(), SCALES)
    found = ((name, scale, measured(wall, DISK, scale, arguments.states, rng)) for (name, wall), scale in cases)
    rows = (
        f"{name} | {scale:.0e} | {m.spacing:.4f} | {m.inside:.4f} | {m.distance:.5f} ± {m.distance_error:.5f} "
        f"| {m.distance_of_all:.4f} | {m.displacement:.4f} | {m.defect:.1e} | {m.mismatches:.5f} "
        f"| {m.mismatches_outside:.3f}"
        for name, scale, m in found
    )
    heads = "wall | scale | spacing | inside | mean distance inside | of all | displacement/scale"
    print_table(f"{heads} | defect of the involution | mismatches inside | outside", rows)


if __name__ == "__main__":
    main()
