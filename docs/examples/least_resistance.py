"""Resistance of families of hollows
=================================

How much resistance can roughness add to a body, or take away from it?

Plakhov's problem: a convex body tumbles through a thin medium. Roughness changes its resistance by a factor between
0.98782 and 3/2. The lower end is that of the law on the left of the picture, which no wall has but walls come near; the
right side shows what simple hollows do. Among isosceles triangles the best are a little sharper than a right angle.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/least_resistance.png"
from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from asperity import kernels as ker

FAMILIES = {
    "triangles, by apex angle": (ker.TriangularTeethLaw, 0.15, 3.0),
    "circular arcs, by half angle": (ker.CircularArcLaw, 0.1, np.pi / 2),
    "half crevices, by depth / width": (ker.RectangularTeethLaw, 0.02, 3.0),
}


def main(points: int = 40, picture: str | Path | None = None) -> dict[str, float]:
    """The extremes, with their bounds, and the best isosceles triangle; draws to ``picture`` if that is given."""
    least, most = ker.extremal_resistance(1024), ker.extremal_resistance(1024, "max")
    triangle = ker.design_wall(ker.resistance, ker.TriangularTeethLaw, [(0.2, 3.0)], tolerance=1e-8)
    curves = {}
    for name, (family, low, high) in FAMILIES.items():
        parameters = np.linspace(low, high, points)
        curves[name] = parameters, [float(ker.resistance(family(float(p)), 1e-8)) for p in parameters]
    if picture is not None:
        _draw(Path(picture), least.law, curves, (least.lower, most.upper))
    return {
        "least, lower bound": least.lower,
        "least, upper bound": least.upper,
        "greatest": most.upper,
        "best triangle": float(triangle.value),
        "its apex angle": float(triangle.parameters[0]),
        "involution near the least": float(ker.resistance(ker.extremal_resistance(128).involution(), 1e-6)),
    }


def _draw(
    path: Path,
    law: ker.LeastResistanceLaw,
    curves: dict[str, tuple[np.ndarray, list[float]]],
    extremes: tuple[float, float],
) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    theta = np.linspace(1e-3, np.pi - 1e-3, 1201)
    probability, outgoing = law.images(theta)
    for slot in (0, 1):
        used = probability[:, slot] > 0.0
        left.scatter(
            theta[used], outgoing[used, slot], c=probability[used, slot], s=4, cmap="viridis_r", vmin=0, vmax=1
        )
    bar = figure.colorbar(left.collections[0], ax=left)
    bar.set_label("probability")
    left.set(xlabel="θ", ylabel="θ'", title="the law of least resistance", aspect="equal")
    for axis in (left.xaxis, left.yaxis):
        axis.set_ticks([0, np.pi / 2, np.pi], ["0", "π/2", "π"])
    for name, (parameters, values) in curves.items():
        right.plot(parameters, values, label=name)
    for level, name in ((extremes[0], "least, 0.98782"), (1.0, "smooth"), (extremes[1], "retroreflection, 3/2")):
        right.axhline(level, color="0.6", linewidth=0.8)
        below = level < 1.0
        right.annotate(name, (1.6, level), xytext=(0, -9 if below else 2), textcoords="offset points", size=8)
    right.set(xlabel="parameter", ylabel="R", title="resistance, as a fraction of the smooth body's")
    right.legend(loc="upper center", fontsize=7)
    right.set_ylim(0.93, 1.75)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    for label, value in main(picture=sys.argv[1] if len(sys.argv) > 1 else None).items():
        print(f"{label:28s} {value:.9f}")
