"""A disk in a strip and in a wedge
================================

A disk between two plates: no-slip plates hold it in a bounded part of the strip, really rough ones let it go.

Between no-slip plates at distance 1 (for the disk's centre) the motion along them stays within the full width
l sqrt(1 + m/J), l = sqrt(1/v2^2 - 1) with v2 the normal fraction of the kinetic speed. In a no-slip wedge whose angle
fits, every orbit that does not leave is periodic. Plates with a real roughness have a random law, and both effects are
gone.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/disk_in_a_strip.png"

from __future__ import annotations

import math

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# arctan(sqrt(m/J))/pi is 1/6, 1/4, 1/3, 1/5 and 2/5 for the last five
TURNS = ((1, 6), (1, 4), (1, 3), (1, 5), (2, 5))
RATIOS = (0.1, 0.5, 0.9, 2.0, 10.0, *(math.tan(math.pi * p / q) ** 2 for p, q in TURNS))


def no_slip(disk: geo.Disk) -> ker.CollisionLaw:
    """The law of a no-slip wall."""
    return ker.CollisionLaw(ker.retroreflection(), disk)


def main(disks: int = 20, collisions: int = 1000) -> dict[str, float]:
    """Greatest and least widths as fractions of the bound, by m/J; then the strip and the wedge with rough walls."""
    rng = np.random.default_rng(0)
    found = {}
    for ratio in RATIOS:
        widths = strip_widths(geo.Disk(ratio, 1.0 / ratio), None, disks, collisions, rng)
        found[f"m/J = {ratio:.4g}, greatest width/bound"] = float(widths.max())
        found[f"m/J = {ratio:.4g}, least width/bound"] = float(widths.min())
    disk = geo.Disk(1.0, 0.5)
    rough = ker.CollisionLaw.from_wall(geo.focusing_arcs(1.2), disk)
    found["focusing arcs, median width/bound"] = float(np.median(strip_widths(disk, rough, disks, collisions, rng)))
    found |= wedge_orbits(disks, collisions, rng)
    return found


def strip_widths(
    disk: geo.Disk, law: ker.CollisionLaw | None, disks: int, collisions: int, rng: np.random.Generator
) -> np.ndarray:
    """Widths of the positions of collision in a strip, as fractions of the no-slip bound of the initial velocity."""
    velocity = disk.from_angles(rng.uniform(0.3, 2.8, disks), rng.uniform(0.3, 2.8, disks))
    walls = no_slip(disk) if law is None else law
    record = ker.play(geo.Container.strip(), walls, np.zeros((disks, 2)), velocity, collisions, rng)
    bound = np.sqrt(1.0 / (disk.mass * velocity[:, 1] ** 2) - 1.0) * math.sqrt(1.0 + 1.0 / disk.inertia_ratio)
    return np.asarray(record.extent() / bound)


def wedge_orbits(disks: int, collisions: int, rng: np.random.Generator) -> dict[str, float]:
    """A wedge in which no-slip velocities have period 10: fractions of disks that stay, and how well they come back."""
    disk, order = geo.Disk(1.0, 1.0), 5
    opening = math.acos(1.0 - 2.0 * math.cos(2.0 * math.pi / order))
    start = np.tile([math.cos(opening / 2), math.sin(opening / 2)], (10 * disks, 1))
    velocity = disk.from_angles(rng.uniform(0.1, 3.0, 10 * disks), rng.uniform(0.1, 3.0, 10 * disks))
    found = {}
    walls = {"no-slip": no_slip(disk), "rough": ker.CollisionLaw.from_wall(geo.focusing_arcs(1.2), disk)}
    for name, law in walls.items():
        record = ker.play(geo.Container.wedge(opening), law, start, velocity, collisions, rng)
        stay = record.collisions == collisions
        found[f"{name} wedge, fraction that stays"] = float(stay.mean())
        if stay.any():
            moved = record.position[1 + 2 * order, stay] - record.position[1, stay]
            found[f"{name} wedge, displacement in ten collisions"] = float(np.median(np.abs(moved)))
    return found


if __name__ == "__main__":
    for what, value in main().items():
        print(f"{what:44} {value:.6g}")
