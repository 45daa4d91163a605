"""A picture of a kernel matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ...core.tables import axes_or_new
from ..bases.basis import Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Atoms have densities up to the number of bins; with a square-root colour scale smaller densities remain visible.
COLOUR_POWER = 0.5
# Differences of the measures of bins below which they are equal to rounding.
EQUAL = 1e-12
TICKS = ([0.0, 0.5 * np.pi, np.pi], ["0", "π/2", "π"])


def draw_kernel(edges: Floats, density: Floats, frame: Frame, ax: Axes | None = None) -> Axes:
    """Draw the density of P(theta, d theta') with respect to the invariant measure on the cells between edges.

    A new figure is made unless ``ax`` is given. A dashed line shows retroreflection, a dotted line specular reflection.
    """
    from matplotlib.colors import PowerNorm

    ax = axes_or_new(ax, figsize=(5.6, 4.4))
    highest = float(density.max())
    norm = PowerNorm(COLOUR_POWER, vmin=0.0, vmax=highest if highest > 0.0 else 1.0)
    mesh = ax.pcolormesh(edges, edges, np.maximum(density, 0.0).T, cmap="viridis", norm=norm, rasterized=True)
    ends = np.array([0.0, np.pi])
    retro, specular = (ends, np.pi - ends) if frame == "paper" else (np.pi - ends, ends)
    ax.plot(ends, retro, color="white", alpha=0.6, linewidth=0.8, linestyle="--", label="retroreflection")
    ax.plot(ends, specular, color="white", alpha=0.6, linewidth=0.8, linestyle=":", label="specular")
    ax.set(xlim=(0.0, np.pi), ylim=(0.0, np.pi), aspect="equal")
    ax.set_xticks(*TICKS)
    ax.set_yticks(*TICKS)
    ax.set_xlabel("incoming angle θ (rad)")
    ax.set_ylabel("outgoing angle θ' (rad)")
    measure = -np.diff(np.cos(edges))
    bins = f" in {len(measure)} bins of equal measure" if np.ptp(measure) < EQUAL else ""
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(mesh, ax=ax, label=f"density{bins}\n(invariant measure sin θ' dθ'/2)")
    return ax
