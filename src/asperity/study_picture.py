"""Pictures of the command line: where a disk goes, and the gallery of the named walls."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .errors import FileExistsRefusal, InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .kernels import CollisionLaw

SAMPLES = 20_000
# A disk that comes in at 45 degrees without spin.
INCOMING = (1.0, -1.0, 0.0)
GALLERY_COLUMNS = 3


def draw_outgoing_velocities(collision: CollisionLaw, ax: Axes) -> None:
    """Sampled outgoing (v1, v2) of one incoming velocity, coloured by the outgoing spin; smooth and no-slip marked."""
    from .kernels import no_slip_matrix, smooth_matrix

    incoming = np.array(INCOMING)
    outgoing = collision.sample(np.tile(incoming, (SAMPLES, 1)), np.random.default_rng(0))
    points = ax.scatter(outgoing[:, 0], outgoing[:, 1], c=outgoing[:, 2], s=4, cmap="cividis", linewidths=0)
    ax.figure.colorbar(points, ax=ax, label="outgoing spin omega (rad / time)")
    for matrix, label, marker in (
        (smooth_matrix(collision.disk), "smooth", "o"),
        (no_slip_matrix(collision.disk), "no-slip", "s"),
    ):
        v1, v2, _ = matrix @ incoming
        ax.plot(v1, v2, marker, markersize=10, mfc="none", mec="#D55E00", mew=1.8, label=label)
    ax.set_xlabel("outgoing v1 (radius / time)")
    ax.set_ylabel("outgoing v2")
    ax.set_ylim(bottom=0.0)
    ax.set_title("Disk in with (v1, v2, omega) = (1, -1, 0)")
    ax.legend(frameon=False)


def draw_gallery(path: Path, *, overwrite: bool) -> None:
    """Draw every named wall with its default parameters into one picture file."""
    from matplotlib.figure import Figure

    from .geometry import WALLS, draw_wall

    if path.exists() and not overwrite:
        raise FileExistsRefusal(f"{path} exists; use another name or --force to replace it")
    entries = list(WALLS.values())
    rows = -(-len(entries) // GALLERY_COLUMNS)
    figure = Figure(figsize=(3.4 * GALLERY_COLUMNS, 2.7 * rows), layout="constrained")
    axes = np.ravel(figure.subplots(rows, GALLERY_COLUMNS))
    for ax, entry in zip(axes, entries, strict=False):
        draw_wall(entry.build(), ax=ax)
        ax.set_title(entry.name, fontsize=10)
    for ax in axes[len(entries) :]:
        ax.set_axis_off()
    try:
        figure.savefig(path, dpi=150)
    except (OSError, ValueError) as reason:
        raise InputError(f"{path}: cannot write the picture ({reason}); use a .png, .pdf or .svg name") from reason
