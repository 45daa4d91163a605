"""Draw the pictures that pages and README show: python docs/examples/gallery.py docs/gallery"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import exchange_hollow
import front_picture
import least_resistance
import numpy as np
import wall_for_a_law
import walls_converge

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.study.pictures import draw_gallery


def main(folder: Path) -> list[Path]:
    """Write the front page's picture, the named walls, and the pictures of the theory pages; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    front_picture.main(folder / "front.gif")
    moving_gas(folder / "gas.gif")
    draw_gallery(folder / "walls.png", overwrite=True)
    least_resistance.main(picture=folder / "least-resistance.png")
    wall_for_a_law.main(picture=folder / "wall-for-a-law.png")
    walls_converge.main(picture=folder / "walls-converge.png")
    exchange_hollow.main(picture=folder / "exchange-hollow.png")
    proved_gap(folder / "proved-gap.png")
    return sorted(folder.iterdir())


def proved_gap(path: Path) -> None:
    """Save the picture of the short example, whose window does not open."""
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    runpy.run_path(str(Path(__file__).parents[1] / "how-to" / "a_proved_gap.py"))["fig"].savefig(path, dpi=90)
    pyplot.close()


def moving_gas(path: Path, frames: int = 30) -> None:
    """Write an animation of no-slip disks in a box: those on the left move first, without spin."""
    from matplotlib import pyplot
    from PIL import Image, ImageSequence

    seats = np.stack(np.divmod(np.arange(24), 4), axis=-1) * 3.0 + 1.5
    velocity = np.random.default_rng(0).standard_normal((24, 3)) * (seats[:, :1] < 9.0) * [1.0, 1.0, 0.0]
    room = geo.Container.polygon([(0.0, 0.0), (18.0, 0.0), (18.0, 12.0), (0.0, 12.0)])
    record = ker.play_gas(room, ker.PairLaw(ker.retroreflection(), geo.Disk()), seats, velocity, 120)
    with pyplot.rc_context({"figure.figsize": (5.6, 4.0)}):
        animation = record.animate(frames)
    animation.save(path, writer="pillow", dpi=80)
    pyplot.close()
    with Image.open(path) as saved:
        pictures = [frame.convert("RGB") for frame in ImageSequence.Iterator(saved)]
    front_picture.store(pictures, path, 32, [100] * len(pictures))


if __name__ == "__main__":
    for path in main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/gallery")):
        print(path)
