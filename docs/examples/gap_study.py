"""Gaps of two families of walls
=============================

Gaps of focusing arcs and of dispersing bumps against their parameter: beside published values, and beside 4 h.

h is the mean squared slope, and 4 h the gap of shallow walls, beside which stands their tangential accommodation, the
Rayleigh quotient of cos theta. The gaps are those of the specular convention, which publications have.
``python docs/examples/gap_study.py FOLDER`` prints both tables and draws gaps against h.
"""

# sphinx_gallery_thumbnail_path = "gap-study.png"

from __future__ import annotations

import sys
from math import asin, atanh, sin
from pathlib import Path

from asperity import geometry as geo
from asperity import spectral as spec

HALF_ANGLES = (0.1, 0.2, 0.4, 0.8, 1.2)
CURVATURES = (0.1, 0.2, 1 / 3, 0.5, 1.0)
# Family and parameter, gap with all its digits, half a unit of the last of them, source.
PUBLISHED = (("dispersing", 1 / 3, 0.0373, 5e-5, "Feres and Zhang 2010"),)

# Parameter, gap, its error, gap/(4 h), and the tangential accommodation.
Rows = list[tuple[float, float, float, float, float]]


def main(
    half_angles: tuple[float, ...] = HALF_ANGLES, curvatures: tuple[float, ...] = CURVATURES, tolerance: float = 1e-6,
    folder: Path | None = None,
) -> dict[str, Rows]:  # fmt: skip
    """The rows by family; with a folder a study goes on where it was, and draws ``gap-study.png`` there."""
    families = {"focusing": (geo.focusing_arcs, "half_angle", half_angles),
                "dispersing": (geo.dispersing_arcs, "curvature", curvatures)}  # fmt: skip
    found = {}
    for name, (family, parameter, values) in families.items():
        checkpoint = None if folder is None else folder / f"{name}.sweep"
        table = spec.sweep(
            family, {parameter: values}, ["gap_specular", "accommodation"], tolerance, checkpoint=checkpoint,
            progress=True,
        )  # fmt: skip
        pairs = zip(table.of("gap_specular"), table.of("tangential_accommodation"), strict=True)
        found[name] = [
            (value := float(row.point[parameter]), row.value, row.error, row.value / (4.0 * flatness(name, value)),
             other.value)
            for row, other in pairs
        ]  # fmt: skip
    if folder is not None:
        draw(found, folder / "gap-study.png")
    return found


def flatness(name: str, parameter: float) -> float:
    """The mean squared slope of the family's wall, in closed form."""
    # the mean of tan^2 over the chord of an arc of half angle xi; ln(sec xi + tan xi) is artanh(sin xi)
    xi = parameter if name == "focusing" else asin(0.5 * parameter)
    return (atanh(sin(xi)) - sin(xi)) / sin(xi)


def beside_published(found: dict[str, Rows]) -> list[tuple[str, float, float, float, float, float, float, str]]:
    """Family, parameter, published gap and its rounding, ours, the difference, our error, and the source."""
    return [
        (name, parameter, published, rounding, gap, gap - published, error, source)
        for name, parameter, published, rounding, source in PUBLISHED
        for value, gap, error, *_ in found[name]
        if value == parameter
    ]


def draw(found: dict[str, Rows], picture: Path) -> None:
    """Gaps against the mean squared slope, with the law 4 h."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 3.8), layout="constrained")
    axes = figure.subplots()
    slopes = sorted(flatness(name, row[0]) for name, rows in found.items() for row in rows)
    axes.plot([slopes[0], 0.25], [4.0 * slopes[0], 1.0], "k--", linewidth=1.0, label="4 h")
    for (name, rows), marker in zip(found.items(), "os", strict=True):
        across = [flatness(name, row[0]) for row in rows]
        axes.errorbar(across, [row[1] for row in rows], [row[2] for row in rows], fmt=f"{marker}-", label=name)
    axes.set(xscale="log", yscale="log", xlabel="mean squared slope h", ylabel="spectral gap")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(picture, dpi=100)


def tables(found: dict[str, Rows]) -> str:
    """Both tables in Markdown."""
    lines = ["| wall | published | source | ours | difference | our error |", "|---|---|---|---|---|---|"]
    for name, parameter, published, rounding, gap, difference, error, source in beside_published(found):
        wall = f"{name}, {parameter:.4g}"
        lines.append(f"| {wall} | {published} ± {rounding:g} | {source} | {gap:.7f} | {difference:.1e} | {error:.1e} |")
    for name, rows in found.items():
        lines += ["", f"| {name} | h | gap | error | gap/(4h) | accommodation |", "|---|---|---|---|---|---|"]
        for parameter, gap, error, ratio, tangential in rows:
            slope = flatness(name, parameter)
            lines.append(
                f"| {parameter:.4g} | {slope:.6f} | {gap:.8f} | {error:.1e} | {ratio:.4f} | {tangential:.6f} |"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    print(tables(main(folder=Path(sys.argv[1]) if len(sys.argv) > 1 else None)))
