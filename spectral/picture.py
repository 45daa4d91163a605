"""Pictures of spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .eigenvalues import Spectrum


def draw_spectrum(found: Spectrum, ax: Axes | None = None) -> Axes:
    """Eigenvalues by rank, with their intervals; the gap is shaded between 1 and the next eigenvalue."""
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    rank = np.arange(len(found.values))
    width = found.errors.total()
    known = np.isfinite(width)
    ax.axhspan(1.0 - found.gap, 1.0, color="0.85", zorder=0, label=f"gap {found.gap:.4g}")
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    ax.errorbar(
        rank[known], found.values[known], yerr=width[known], fmt="o", markersize=5, capsize=3, color="#0072B2",
        label="eigenvalue, with its total error",
    )  # fmt: skip
    if not known.all():
        ax.plot(rank[~known], found.values[~known], "s", mfc="none", color="#D55E00", label="error not known")
    ax.set_xticks(rank)
    ax.set_xlabel("rank (largest moduli, sorted descending)")
    ax.set_ylabel("eigenvalue")
    ax.set_ylim(min(-0.05, float(found.values.min()) - 0.1), 1.1)
    ax.set_title(f"Spectrum, {found.convention} convention")
    ax.legend(frameon=False)
    return ax
