"""Draw the pictures that pages and README show: python docs/examples/gallery.py docs/gallery"""

from __future__ import annotations

import sys
from pathlib import Path

import exchange_hollow
import least_resistance
import wall_for_a_law
import walls_converge

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.study.pictures import draw_gallery


def main(folder: Path) -> list[Path]:
    """Write the front page's picture, the named walls, and the pictures of the theory pages; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_front(folder / "front.png")
    draw_gallery(folder / "walls.png", overwrite=True)
    least_resistance.main(picture=folder / "least-resistance.png")
    wall_for_a_law.main(picture=folder / "wall-for-a-law.png")
    walls_converge.main(picture=folder / "walls-converge.png")
    exchange_hollow.main(picture=folder / "exchange-hollow.png")
    return sorted(folder.glob("*.png"))


def draw_front(path: Path) -> None:
    """A wall with rays, and the density of its law."""
    from matplotlib.figure import Figure

    wall = geo.focusing_arcs(half_angle=1.2)
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    geo.draw_wall(wall, x=[0.15, 0.5, 0.7], theta=[0.8, 1.9, 1.2], ax=left)
    left.set_title("rays on a wall of arcs")
    ker.discretise(ker.WallLaw(wall), ker.Bins(96)).plot(right)
    right.set_title("density of the law of the outgoing angle")
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    for path in main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/gallery")):
        print(path)
