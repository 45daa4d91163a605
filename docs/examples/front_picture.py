"""The moving picture of the front page: rays enter a wall, and the histogram of the outgoing angle becomes the law."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity import kernels as ker

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

# Steps of a ray that is followed by itself, and so many rays; then this number of rays arrives with each frame.
STEPS, FOLLOWED = 9, 3
BURSTS = (1, 1, 2, 2, 4, 4, 8, 8, 16, 16, 32, 32, 64, 64, 128, 128, 256, 256, 512, 512, 1024, 1024, 2048, 2048)
SHOWN, BINS, COLOURS = 12, 48, 64
MILLISECONDS, LAST = 90, 4000


def main(path: Path, theta: float = 1.1) -> dict[str, float]:
    """Write the picture, a GIF; returns its number of frames and the largest difference of histogram and law."""
    from matplotlib.figure import Figure

    wall = geo.focusing_arcs(half_angle=1.2)
    x = np.random.default_rng(4).random(FOLLOWED + sum(BURSTS))
    outgoing = geo.trace(wall, x, theta).theta
    edges, fine = np.linspace(0.0, np.pi, BINS + 1), np.linspace(0.0, np.pi, 4 * BINS + 1)
    masses = ker.WallLaw(wall).conditionals([theta], degree=0, edges=fine[1:-1]).masses(fine)[0]
    figure = Figure(figsize=(9.0, 3.2), dpi=100, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    geo.draw_wall(wall, ax=left).set(xlim=(-0.5, 1.5), ylim=(-0.4, 0.6))
    left.set_title(f"rays meet a wall of arcs at the angle {theta:g}")
    right.stairs(masses / np.diff(fine), fine, color="#D55E00", linewidth=1.4, label="law of the wall")
    right.set(title="and leave at random angles", xlabel="outgoing angle (rad)", ylabel="probability density")
    right.legend(loc="upper left", frameon=False)
    highest = 1.3 * float((masses / np.diff(fine)).max())
    right.set(xlim=(0.0, np.pi), ylim=(0.0, 1.2 * highest))
    frames, done = [], 0
    for burst in (*(1,) * FOLLOWED, *BURSTS):
        paths = [path_of(wall, place, theta) for place in x[done : done + min(burst, SHOWN)]]
        is_followed = done < FOLLOWED
        done += burst
        for step in range(1, STEPS + 1) if is_followed else (STEPS,):
            counted = done if step == STEPS else done - 1
            density = np.histogram(outgoing[:counted], edges)[0] / (max(counted, 1) * np.diff(edges))
            drawn = [right.stairs(np.minimum(density, highest), edges, fill=True, color="#0072B2", alpha=0.55)]
            drawn += [line for one in paths for line in left.plot(*beginning(one, step / STEPS).T, color="#0072B2",
                      linewidth=1.6 if is_followed else 0.8, alpha=1.0 if is_followed else 0.6)]  # fmt: skip
            drawn += [right.text(0.97, 0.93, f"{counted} rays", transform=right.transAxes, ha="right")]
            frames.append(image_of(figure))
            for artist in drawn:
                artist.remove()
    store(frames, path, COLOURS, [MILLISECONDS] * (len(frames) - 1) + [LAST])
    law = masses.reshape(BINS, -1).sum(axis=1) / np.diff(edges)
    return {"frames": len(frames), "difference": float(abs(density - law).max())}


def store(frames: list[Image], path: Path, colours: int, milliseconds: list[int]) -> None:
    """Write a GIF with one palette for all frames: what does not move is not stored again."""
    palette = frames[-1].quantize(colours)
    palette.putpalette([255 if level > 245 else level for level in palette.getpalette()])
    stored = [frame.quantize(palette=palette, dither=0) for frame in frames]
    stored[0].save(path, save_all=True, append_images=stored[1:], loop=0, optimize=True, duration=milliseconds)


def path_of(wall: geo.Wall, x: float, theta: float) -> NDArray[np.float64]:
    """The points of a ray from far above, through the wall, to far above."""
    result = geo.trace(wall, x, theta)
    inside = geo.trajectory(wall, x, theta)
    out = float(result.theta)
    start = inside[0] + 0.75 * np.array([np.cos(theta), np.sin(theta)])
    return np.vstack([start, inside, inside[-1] + 1.2 * np.array([np.cos(out), np.sin(out)])])


def beginning(path: NDArray[np.float64], part: float) -> NDArray[np.float64]:
    """The points of a polygonal path up to a part of its length."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    end = part * length[-1]
    last = [np.interp(end, length, coordinate) for coordinate in path.T]
    return np.vstack([path[length < end], last])


def image_of(figure: Figure) -> Image:
    """The figure as an image of Pillow."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL.Image import fromarray

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


if __name__ == "__main__":
    print(main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/gallery/front.gif")))
