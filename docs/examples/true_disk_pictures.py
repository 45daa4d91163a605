"""Draw the pictures of docs/theory/true-disk.md: python docs/examples/true_disk_pictures.py docs/theory/true-disk"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

DPI = 110


def main(folder: Path, samples: int = 20_000) -> dict[str, float]:
    """Write the three pictures; returns the kinetic energy gained and the contacts of the collision drawn."""
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    disk, teeth = geo.Disk(1.0, 1.0), geo.triangular_teeth(1.2)
    scale, rng = 0.05, np.random.default_rng(3)
    spacing = geo.ConfigurationSpace(teeth, disk, scale).spacing
    position = np.stack([rng.random(3000) * scale, (rng.random(3000) - 0.5) * spacing], axis=1)
    velocity = -disk.from_angles(rng.uniform(0.8, 2.3, 3000), rng.uniform(0.8, 2.3, 3000))
    hit = geo.collide(disk, teeth, scale, position, velocity)
    chosen = int(np.flatnonzero(hit.two_satellites & (hit.contacts == 4))[0])

    figure = Figure(figsize=(9, 2.6), layout="constrained")
    geo.ConfigurationSpace(teeth, disk, scale).draw_collision(position[chosen], velocity[chosen], figure.subplots())
    figure.savefig(folder / "collision.png", dpi=DPI)

    # a spacing that is not a multiple of the wall's period, so that the cylinders of two satellites cross in the gaps
    spacing = 2 * math.pi / 24
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    geo.ConfigurationSpace(teeth, disk, spacing / 7.5, spacing).draw_section(-0.6, figure.subplots())
    figure.savefig(folder / "configurations.png", dpi=DPI)

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    law = ker.SatelliteLaw(geo.focusing_arcs(1.2), disk, 1e-2)
    law.draw_limit((1.0, 1.2), rng, scales=(1e-2, 1e-3, 1e-5), samples=samples, ax=figure.subplots())
    figure.savefig(folder / "limit.png", dpi=DPI)
    energies = disk.inner(hit.velocity[chosen], hit.velocity[chosen]), disk.inner(velocity[chosen], velocity[chosen])
    return {"energy gained": float(energies[0] - energies[1]), "contacts": float(hit.contacts[chosen])}


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/theory/true-disk"))
