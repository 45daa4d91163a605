"""The law of the true disk
========================

The collision law of a disk with satellites tends to K = delta (x) P~ (x) delta_{pi - psi}.

P~ is the law of the foreshortened wall. The study measures, at several scales eps and ratios m/J, how far the law of
the true disk is from that limit, and shows both cases of the dichotomy: a constant sequence of cells has a limit, an
alternating one has none.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/true_disk.png"

from __future__ import annotations

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker


def correlation(wall: geo.Wall) -> float:
    """<u, P~ u>/<u, u> of a wall, u = -cos theta."""
    return float(ker.discretise(ker.WallLaw(wall), ker.Legendre(2)).array[1, 1])


def main(
    ratios: tuple[float, ...] = (0.1, 1.0, 2.0, 10.0),
    scales: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6),
    samples: tuple[int, int, int] = (32, 32, 16),
) -> dict[str, dict[str, float]]:
    """Figures by m/J: orders of convergence, and the correlation of the true disk beside those of both walls."""
    found = {}
    wall = geo.triangular_teeth(1.2)
    for ratio in ratios:
        disk = geo.Disk(ratio, 1.0 / ratio)
        study = ker.limit_study(disk, wall, scales, np.random.default_rng(0), samples=samples)
        foreshortened = correlation(wall.foreshorten(disk))
        found[f"m/J = {ratio:g}"] = {
            "distance at the least scale": float(study.distance[-1]),
            "of which sampling": float(study.floor[-1]),
            "order of psi' in rho": float(study.order("psi_defect", "spacings")),
            "its half width of 95 %": study.order("psi_defect", "spacings").error,
            "psi' defect/rho": float(study.psi_defect[-1] / study.spacings[-1]),
            "two satellites/(eps/rho^2)": float(study.two_satellites[-1] * study.spacings[-1] ** 2 / scales[-1]),
            "correlation": foreshortened + float(study.shift[-1]),
            "its error": float(study.errors["shift"][-1]),
            "foreshortened wall": foreshortened,
            "unforeshortened wall": correlation(wall),
        }
    found["dichotomy"] = dichotomy(scales, samples)
    return found


def dichotomy(scales: tuple[float, ...], samples: tuple[int, int, int]) -> dict[str, float]:
    """Distances from the limit law of triangular teeth of a constant and of an alternating sequence of cells."""
    disk, teeth, arcs = geo.Disk(1.0, 1.0), geo.triangular_teeth(1.2), geo.focusing_arcs(1.2)
    rng = np.random.default_rng(1)
    same = ker.limit_study(disk, teeth, scales, rng, samples=samples).distance
    other = ker.limit_study(disk, arcs, scales, rng, samples=samples, limit=teeth).distance
    alternating = np.where(np.arange(len(scales)) % 2 == 0, same, other)
    return {
        "constant sequence, last": float(same[-1]),
        "alternating sequence, least of the last two": float(alternating[-2:].min()),
        "alternating sequence, greatest of the last two": float(alternating[-2:].max()),
    }


if __name__ == "__main__":
    for case, figures in main().items():
        print(case)
        for name, value in figures.items():
            print(f"  {name:46} {value:.4g}")
