"""Walls that approach a law
=========================

How fast do walls for a law approach it? Joint distance against moments and hollows, from the table of the page."""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/walls_converge.png"
from __future__ import annotations

import sys
from pathlib import Path

PAGE = Path(__file__).parents[1] / "theory" / "from-a-law-to-a-wall.md"


def table() -> dict[str, list[tuple[int, int, float, float]]]:
    """For each law moments, hollows, joint distance and its error, as ``campaigns.walls_for_laws`` measured them."""
    text = PAGE.read_text(encoding="utf-8").split("<!-- measured -->")[1].split("<!-- end -->")[0]
    found: dict[str, list[tuple[int, int, float, float]]] = {}
    # below the heads and the line under them
    for line in text.strip().splitlines()[2:]:
        name, moments, hollows, _, _, _, measured, _ = (cell.strip() for cell in line.strip("|").split("|"))
        distance, error = (float(number) for number in measured.split("±"))
        found.setdefault(name, []).append((int(moments), int(hollows), distance, error))
    return found


def main(picture: str | Path | None = None) -> dict[str, list[tuple[int, int, float, float]]]:
    """The table; drawn to ``picture`` if that is given."""
    found = table()
    if picture is not None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 4.4), layout="constrained")
        for axes, column, label in zip(figure.subplots(1, 2, sharey=True), (0, 1), ("moments", "hollows"), strict=True):
            for name, rows in found.items():
                steps = sorted((row[column], row[2], row[3]) for row in rows)
                across, distance, error = zip(*steps, strict=True)
                axes.errorbar(across, distance, error, marker="o", markersize=3, label=name)
            axes.set(xscale="log", yscale="log", xlabel=label)
            axes.grid(alpha=0.3)
            if column == 0:
                axes.set_ylabel("joint distance")
                axes.set_xticks([4, 6, 8, 10, 14], ["4", "6", "8", "10", "14"])
                axes.minorticks_off()
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
        figure.savefig(picture, dpi=100)
    return found


if __name__ == "__main__":
    for name, rows in main(picture=sys.argv[1] if len(sys.argv) > 1 else None).items():
        print(f"{name}: joint distance {rows[0][2]} with {rows[0][1]} hollows, {rows[-1][2]} with {rows[-1][1]}")
