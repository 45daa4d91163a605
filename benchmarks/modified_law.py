"""The modified law K~ = eta^(-1) K eta against the cylinder's law K_cyl, and against itself, as the scale tends to 0.

``python -m benchmarks.modified_law`` draws states of the cylinder from the invariant measure over one period of the
wall and one spacing of the satellites, and prints how far both laws are apart and whether K~ undoes itself.
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
# A state that comes back elsewhere by more than this, in a unit velocity or in a cell, does not come back.
MISMATCH = 1e-3


@dataclass(frozen=True)
class Measured:
    """What was found at one scale.

    Attributes
    ----------
    spacing : float
    inside : float
        The fraction of the states at which K~ is defined as in the paper.
    distance, distance_error : float
        The mean of |w~' - w'|, kinetic norm of unit velocities, over the states inside, and the half width of its 95 %
        interval.
    distance_of_all : float
        The same mean over all states that came back, those outside included.
    displacement : float
        The mean of |y~' - y'|, of the greater coordinate, in units of the scale.
    defect : float
        The median over the states inside of |K~(K~(s)) - s| in the velocity.
    mismatches, mismatches_outside : float
        The fractions of the states inside, and of those outside that escaped, which do not come back.
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
    """Draw states, collide them by both laws, and send those inside back by K~."""
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
