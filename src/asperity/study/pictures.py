"""The pictures of a study, and the gallery of the named walls."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ..core.checks import Floats
from ..core.errors import FileExistsRefusal, InputError
from ..core.files import draw_whole, write_whole
from ..core.tables import verbatim
from ..geometry import WALLS, Disk, Wall, draw_wall, trace
from ..geometry.plotting.walls import vertical_stretch
from ..kernels import CollisionLaw, no_slip_matrix, smooth_matrix
from ..spectral.gap.verdict import draw_spectrum
from .result import StudyResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Dots per inch: pictures stay below 150 kB and are legible at the width of a page.
RESOLUTION = 100
# Larger pictures are written with 256 colours.
LARGEST_PNG = 150_000
TITLE_WIDTH = 64
RAYS, MOST_BOUNCES = 5, 12
# Tried in this order for every ray until one leaves after few enough bounces, and so that both sides are lit.
INCOMING_ANGLES = (2.3, 0.95, 1.9, 1.25, 1.7, 1.45, np.pi / 2)
SAMPLES, VELOCITY_BINS = 20_000, 80
# A disk that comes in at 45 degrees without spin.
INCOMING = (1.0, -1.0, 0.0)
GALLERY_COLUMNS = 3
SMOOTH, NO_SLIP = "#0072B2", "#D55E00"


# What draws on axes, with width and height of the picture in inches.
Drawings: TypeAlias = Sequence[tuple[Callable[[Any], object], tuple[float, float]]]


def drawings_of(study: StudyResult) -> Drawings:
    """Wall, kernel, spectrum and collision."""
    return (
        (partial(draw_study_wall, study), (7.0, 5.0)), (partial(_draw_kernel, study), (6.4, 5.0)),
        (partial(_draw_spectrum, study), (7.0, 5.0)), (partial(_draw_collision, study), (7.0, 6.0)),
    )  # fmt: skip


def save_pictures(drawings: Drawings, paths: Sequence[Path], dpi: float = RESOLUTION) -> list[Path]:
    """Write the pictures; returns the paths of those that could be drawn."""
    from matplotlib.figure import Figure

    def write(path: Path, draw: Callable[..., object], size: tuple[float, float], stream: IO[bytes]) -> None:
        figure = Figure(figsize=size)
        draw(figure.subplots())
        drawn, kind = BytesIO(), path.suffix[1:]
        figure.savefig(drawn, dpi=dpi, format=kind, bbox_inches="tight")
        if kind == "png" and drawn.tell() > LARGEST_PNG:
            from PIL import Image

            # a relief has more colours than eyes tell apart; those of the few points on rays stay
            few = Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
            few.save(stream, format="png", optimize=True, dpi=(dpi, dpi))
        else:
            stream.write(drawn.getvalue())

    return [
        path for path, drawing in zip(paths, drawings, strict=True) if draw_whole(path, partial(write, path, *drawing))
    ]


def draw_study_wall(study: StudyResult, ax: Axes) -> None:
    """The wall with some rays in its widest hollow."""
    x, theta = chosen_rays(study.wall)
    draw_wall(study.wall, x, theta, ax=ax)
    key = "dot: a ray enters, ring: it leaves" if len(x) else f"no ray leaves within {MOST_BOUNCES} collisions"
    key += "; facets drawn as mirrors" if study.facets is not None and len(x) else ""
    ax.set_title(f"{_title(study.title)}\n{key}", fontsize=11)


def chosen_rays(wall: Wall) -> tuple[Floats, Floats]:
    """Entry points and angles of rays, spread over the widest hollow, that leave after few bounces."""
    low, high = 0.0, wall.period
    if wall.hollows:
        widest = max(wall.hollows, key=lambda hollow: hollow.width)
        low, high = widest.left, widest.right
    x = low + (high - low) * (np.arange(RAYS) + 0.5) / RAYS
    # every ray begins its search elsewhere in the list, so that they come from different directions
    drawn = np.array([np.roll(INCOMING_ANGLES, -k) for k in range(RAYS)])
    # the angles are those in the picture, also where its vertical scale is another
    order = np.arctan2(np.sin(drawn), vertical_stretch(wall) * np.cos(drawn))
    ray = trace(wall, x[:, None], order)
    good = ray.escaped & (ray.collisions <= MOST_BOUNCES)
    shown = good.any(axis=1)
    return x[shown], order[np.arange(RAYS), good.argmax(axis=1)][shown]


def _draw_kernel(study: StudyResult, ax: Axes) -> None:
    study.matrix.plot(ax)
    ax.set_title(_title(f"Reflection law of {study.title}"), fontsize=11)


def _draw_spectrum(study: StudyResult, ax: Axes) -> None:
    if study.spectrum is None:
        ax.set_axis_off()
        reason = verbatim(textwrap.fill(study.refusals["spectrum"], TITLE_WIDTH))
        ax.text(0.5, 0.5, f"No spectrum:\n{reason}", ha="center", va="center", transform=ax.transAxes)
        return
    if study.gap is None:
        study.spectrum.plot(ax)
    else:
        draw_spectrum(study.spectrum, study.gap, ax)
    if study.facets is not None:
        ax.set_title(f"{_title(study.title)}\n{ax.get_title()}", fontsize=11)


def _draw_collision(study: StudyResult, ax: Axes) -> None:
    figure: Any = ax.figure
    figure.clear()
    figure.set_layout_engine("constrained")
    draw_outgoing_velocities(study.collision, figure)
    if study.facets is not None:
        figure.suptitle(_title(study.title), fontsize=11)


def draw_outgoing_velocities(collision: CollisionLaw, figure: Figure) -> None:
    """Where a disk goes that comes in with (1, -1, 0).

    Above, the velocities that energy and rolling momentum allow, a half ellipse, and the outgoing ones on it; below,
    how likely they are. The spin is an affine function of v1, hence the second axis. Smooth and no-slip are marked.
    """
    disk, incoming = collision.disk, np.array(INCOMING)
    rolling = float(disk.rolling_momentum(incoming))
    outgoing = collision.sample(np.tile(incoming, (SAMPLES, 1)), np.random.default_rng(0))
    allowed = allowed_velocities(disk)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.0))
    above.plot(allowed[:, 0], allowed[:, 1], color="0.75", linewidth=5.0, solid_capstyle="butt",
               label="same energy and rolling momentum")  # fmt: skip
    above.plot(outgoing[:, 0], outgoing[:, 1], ".", color="black", markersize=2.5, rasterized=True,
               label=f"{SAMPLES} samples")  # fmt: skip
    edges = np.linspace(allowed[:, 0].min(), allowed[:, 0].max(), VELOCITY_BINS + 1)
    fraction = np.histogram(outgoing[:, 0], edges)[0] / SAMPLES
    below.stairs(fraction, edges, fill=True, color="0.55")
    for matrix, label, marker, colour in (
        (smooth_matrix(disk), "smooth disk", "o", SMOOTH), (no_slip_matrix(disk), "no-slip disk", "s", NO_SLIP),
    ):  # fmt: skip
        v1, v2, _ = matrix @ incoming
        above.plot(v1, v2, marker, markersize=9, mfc="none", mec=colour, mew=1.8, label=label)
        below.axvline(v1, color=colour, linewidth=1.4, linestyle="--" if marker == "s" else "-")
    above.set_ylim(0.0, 1.15 * float(allowed[:, 1].max()))
    above.set_ylabel("outgoing v2 (radius / time)")
    above.legend(frameon=False, fontsize=8, loc="lower center", ncols=2)
    above.set_title("Disk in with v1 = 1, v2 = -1 (radius / time) and no spin", fontsize=11)
    below.set_ylim(0.0, 1.08 * float(fraction.max()))
    below.set_ylabel("probability per bin")
    below.set_xlabel("outgoing v1 (radius / time)")
    spin = above.secondary_xaxis(
        "top", functions=(lambda v1: (rolling + disk.mass * v1) / disk.rim_mass,
                          lambda spin: (disk.rim_mass * spin - rolling) / disk.mass),
    )  # fmt: skip
    spin.set_xlabel("outgoing r omega (radius / time)", fontsize=9)
    spin.tick_params(labelsize=9)


def allowed_velocities(disk: Disk) -> Floats:
    """The half ellipse of outgoing velocities with the kinetic energy and the rolling momentum of `INCOMING`."""
    frame = np.asarray(disk.frame)
    along, up, roll = (float(disk.inner(np.array(INCOMING), direction)) for direction in frame)
    theta = np.linspace(0.0, np.pi, 181)
    size = np.hypot(along, up)
    return np.asarray(size * (np.cos(theta)[:, None] * frame[0] + np.sin(theta)[:, None] * frame[1]) + roll * frame[2])


def draw_gallery(path: Path, *, overwrite: bool) -> None:
    """Draw every named wall with its default parameters into one picture file.

    Raises
    ------
    FileExistsRefusal
        If the file exists and ``overwrite`` is False.
    InputError
        If it cannot be written.
    """
    if os.path.exists(path) and not overwrite:
        raise FileExistsRefusal(f"{path} exists; use another name or --force to replace it")
    figure, kind = gallery(), path.suffix[1:] or "png"
    try:
        write_whole(path, lambda stream: figure.savefig(stream, dpi=RESOLUTION, format=kind), overwrite=True)
    except InputError as reason:
        raise InputError(f"cannot write the picture: {reason}") from reason
    except ValueError as reason:
        raise InputError(f"{path}: cannot write the picture ({reason}); use a .png, .pdf or .svg name") from reason


def gallery() -> Figure:
    """Every named wall with its default parameters."""
    from matplotlib.figure import Figure

    entries = list(WALLS.values())
    rows = -(-len(entries) // GALLERY_COLUMNS)
    figure = Figure(figsize=(3.4 * GALLERY_COLUMNS, 2.9 * rows), layout="constrained")
    axes = np.ravel(figure.subplots(rows, GALLERY_COLUMNS))
    for ax, entry in zip(axes, entries, strict=False):
        draw_wall(entry.build(), ax=ax)
        parameters = ", ".join(f"{key}={value:g}" for key, value in entry.defaults.items())
        ax.set_title("\n".join([entry.name, *textwrap.wrap(parameters, 40)]), fontsize=9)
        ax.set(xlabel="", ylabel="")
        ax.tick_params(labelsize=8)
        ax.locator_params(axis="both", nbins=5)
    for ax in axes[len(entries) :]:
        ax.set_axis_off()
    figure.supxlabel("x / period", fontsize=10)
    figure.supylabel("y / period", fontsize=10)
    return figure


def _title(text: str) -> str:
    return verbatim("\n".join(textwrap.wrap(text, TITLE_WIDTH)))
