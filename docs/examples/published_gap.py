"""A published gap
===============

A published gap: bumps of arc radius 3 periods have the gap .0373 (Feres and Zhang 2010).

The gap of a shallow wall is four times its mean squared slope h, to leading order. This prints both for dispersing
bumps and for focusing arcs as they get shallower.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/published_gap.png"

from __future__ import annotations

from math import cos, log, sin, tan

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec


def main(curvature: float = 1 / 3, half_angles: tuple[float, ...] = (0.4, 0.2, 0.1)) -> dict[str, float]:
    """Gap of dispersing bumps, and gap/(4 h) of focusing arcs, in the convention where specular is the identity."""
    bumps = ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()
    found = {"dispersing": float(spec.spectral_gap(bumps, tolerance=1e-5))}
    for xi in half_angles:
        flatness = (log(1 / cos(xi) + tan(xi)) - sin(xi)) / sin(xi)
        arcs = ker.WallLaw(geo.focusing_arcs(xi)).in_specular_frame()
        found[f"focusing {xi:g}, gap/(4h)"] = float(spec.spectral_gap(arcs, tolerance=1e-6)) / (4 * flatness)
    return found


if __name__ == "__main__":
    for name, value in main().items():
        print(f"{name:28s} {value:.6f}")
