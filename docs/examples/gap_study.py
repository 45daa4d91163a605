"""Gaps of two families of walls
=============================

Gaps of focusing arcs and of dispersing bumps against their parameter, and beside the law 4 h of shallow walls.

h is the mean squared slope. The gap of bumps with curvature 1/3 is published as .0373 (Feres and Zhang 2010).
"""

from __future__ import annotations

import sys
from math import asin, atanh, sin
from pathlib import Path

from asperity import geometry as geo
from asperity import spectral as spec

HALF_ANGLES = (0.1, 0.2, 0.4, 0.8, 1.2)
CURVATURES = (0.1, 0.2, 1 / 3, 0.5, 1.0)


def main(
    half_angles: tuple[float, ...] = HALF_ANGLES, curvatures: tuple[float, ...] = CURVATURES, tolerance: float = 1e-6,
    folder: Path | None = None,
) -> dict[str, list[tuple[float, float, float, float]]]:  # fmt: skip
    """By family: parameter, gap in the convention where specular is the identity, its error, and gap/(4 h)."""
    families = {"focusing": (geo.focusing_arcs, "half_angle", half_angles),
                "dispersing": (geo.dispersing_arcs, "curvature", curvatures)}  # fmt: skip
    found = {}
    for name, (family, parameter, values) in families.items():
        checkpoint = None if folder is None else folder / f"{name}.sweep"
        table = spec.sweep(family, {parameter: values}, "gap_specular", tolerance, checkpoint=checkpoint, progress=True)
        found[name] = [
            (value := float(row.point[parameter]), row.value, row.error, row.value / (4.0 * flatness(name, value)))
            for row in table.rows
        ]
    return found


def flatness(name: str, parameter: float) -> float:
    """The mean squared slope of the family's wall, in closed form."""
    # the mean of tan^2 over the chord of an arc of half angle xi; ln(sec xi + tan xi) is artanh(sin xi)
    xi = parameter if name == "focusing" else asin(0.5 * parameter)
    return (atanh(sin(xi)) - sin(xi)) / sin(xi)


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    for name, rows in main(folder=folder).items():
        print(f"| {name} | gap | error | gap/(4 h) |\n|---|---|---|---|")
        for parameter, gap, error, ratio in rows:
            print(f"| {parameter:.4g} | {gap:.8f} | {error:.1e} | {ratio:.4f} |")
