"""Draw the pictures that pages and README show: python docs/examples/gallery.py docs/gallery"""

from __future__ import annotations

import sys
from pathlib import Path

import exchange_hollow
import front_picture
import least_resistance
import wall_for_a_law
import walls_converge

from asperity.study.pictures import draw_gallery


def main(folder: Path) -> list[Path]:
    """Write the front page's picture, the named walls, and the pictures of the theory pages; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    front_picture.main(folder / "front.gif")
    draw_gallery(folder / "walls.png", overwrite=True)
    least_resistance.main(picture=folder / "least-resistance.png")
    wall_for_a_law.main(picture=folder / "wall-for-a-law.png")
    walls_converge.main(picture=folder / "walls-converge.png")
    exchange_hollow.main(picture=folder / "exchange-hollow.png")
    return sorted(folder.iterdir())


if __name__ == "__main__":
    for path in main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/gallery")):
        print(path)
