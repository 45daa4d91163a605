"""Billiards
=========

Does roughness make billiards less chaotic? Lyapunov exponents of smooth and no-slip disks, and a gas of them.

In a stadium and in a Sinai table a smooth disk moves chaotically. No-slip walls exchange translation and spin, and keep
a momentum at every flat piece; the exponents are smaller, but not 0. In a circle both kinds of motion are regular. In
a gas of no-slip disks translation and spin come to equipartition: a third of the energy is in the spins.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/billiards.png"

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from asperity import Estimate
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.billiards.gas import GasRecord

DISK = geo.Disk(mass=1.0, inertia_ratio=0.5)
TABLES = {
    "circle": geo.Container.circle(1.0), "stadium": geo.Container.stadium(2.0, 1.0),
    "Sinai table": geo.Container.sinai(2.0, 0.5),
}  # fmt: skip
LAWS = {"smooth": ker.smooth(DISK), "no-slip": ker.no_slip(DISK)}


def main(
    collisions: int = 2000, trajectories: int = 400, events: int = 8000, picture: str | Path | None = None
) -> dict[str, Estimate]:
    """The exponents by table and law, and the fraction of a gas's energy in rotation; draws if ``picture`` is given."""
    found = {
        f"{table}, {law}": ker.lyapunov_exponent(TABLES[table], LAWS[law], collisions, trajectories, rng=0)
        for table in TABLES
        for law in LAWS
    }
    found["rotational fraction of a gas"] = gas(events).rotational_fraction()
    if picture is not None:
        draw(Path(picture), collisions)
    return found


def gas(events: int) -> GasRecord:
    """Twelve no-slip disks in a smooth room, at first without spin."""
    rng = np.random.default_rng(0)
    seats = np.array([(1.25 + 2.5 * i, 1.25 + 2.5 * j) for i in range(4) for j in range(3)])
    velocity = np.concatenate([rng.standard_normal((12, 2)), np.zeros((12, 1))], axis=1)
    room = geo.Container.polygon([(0.0, 0.0), (10.0, 0.0), (10.0, 7.5), (0.0, 7.5)])
    return ker.play_gas(room, ker.PairLaw(ker.retroreflection(), DISK), seats, velocity, events)


def draw(path: Path, collisions: int) -> None:
    """Paths in the stadium, and phase portraits, above of a smooth and below of a no-slip disk."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    axes = figure.subplots(2, 3)
    stadium = TABLES["stadium"]
    angles = np.linspace(0.15, 1.4, 6)
    velocity = np.stack([np.cos(angles), np.sin(angles), 0.8 * np.cos(3.0 * angles)], axis=1)
    for row, (name, law) in zip(axes, LAWS.items(), strict=True):
        start = velocity * [1.0, 1.0, name == "no-slip"]
        ker.play(stadium, law, [0.1, 0.2], start[:1], 40).draw_paths(row[0])
        row[0].set_title(f"stadium, {name}")
        ker.play(stadium, law, [0.1, 0.2], start, collisions).draw_phase_portrait(ax=row[1])
        ker.play(TABLES["circle"], law, [0.8, 0.2], start, collisions).draw_phase_portrait(ax=row[2])
        row[2].set_title(f"circle, {name}")
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    for name, value in main(picture=sys.argv[1] if len(sys.argv) > 1 else None).items():
        print(f"{name:32s} {value}")
