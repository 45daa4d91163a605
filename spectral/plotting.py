"""Plots of eigenvalues and eigenfunctions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..core.checks import Floats
from ..core.tables import axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's blue and vermilion, which colour-blind readers can distinguish.
KNOWN, UNKNOWN = "#0072B2", "#D55E00"
CONVENTIONS = {"paper": "retroreflection is the identity", "specular": "specular reflection is the identity"}


def draw_eigenvalues(
    values: Floats, width: Floats, convention: str, label: str, gap: tuple[float, str] | None, ax: Axes | None = None
) -> Axes:
    """Draw eigenvalues by rank, with their intervals.

    Parameters
    ----------
    values, width : ndarray, shape (k,)
        Eigenvalues, sorted descending, and the half widths of their intervals; not finite if unknown.
    convention : {"paper", "specular"}
    label : str
        Legend of the eigenvalues.
    gap : (float, str) or None
        The gap, which is shaded, and its legend; None for a law without gap.
    ax : matplotlib Axes, optional
        By default axes of a new figure.
    """
    ax = axes_or_new(ax)
    rank = np.arange(len(values))
    known = np.isfinite(width)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    if gap is None:
        ax.axhline(1.0, color="0.3", linewidth=1.2, linestyle="--", zorder=1,
                   label="the law has no gap: 1 is in its essential spectrum")  # fmt: skip
    else:
        ax.axhspan(1.0 - gap[0], 1.0, color="0.87", zorder=0, label=gap[1])
    # without a gap the eigenvalues belong to the grid, so the markers are hollow
    ax.errorbar(
        rank[known], values[known], yerr=width[known], fmt="o", markersize=5.5, capsize=3, color=KNOWN, zorder=3,
        mfc="white" if gap is None else KNOWN, label=label,
    )  # fmt: skip
    if not known.all():
        ax.plot(rank[~known], values[~known], "s", mfc="none", color=UNKNOWN, zorder=3, label="error not known")
    ax.set_xticks(rank)
    ax.set_xlabel(f"rank among the {len(rank)} largest moduli, sorted descending")
    ax.set_ylabel("eigenvalue")
    # limits that contain the error bars, within [-1, 1] where the spectrum lies
    lowest = max(float(np.min(values - np.where(known, width, 0.0))), -1.0)
    ax.set_ylim(-1.1 if lowest < -0.5 else min(-0.15, lowest - 0.1), 1.1)
    ax.set_title(f"Spectrum, {convention} convention ({CONVENTIONS[convention]})", fontsize=11)
    # below the axes, because a spectrum may fill any corner
    ax.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=1 if gap is None else 2)
    return ax


def draw_eigenfunctions(
    theta: Floats, functions: Floats, labels: Sequence[str], convention: str, ax: Axes | None = None
) -> Axes:
    """Draw functions on angles, shape (functions, angles), each with its label."""
    ax = axes_or_new(ax)
    for values, label in zip(functions, labels, strict=True):
        # the sign is chosen positive at small angles
        ax.plot(theta, np.sign(values[0] or 1.0) * values, label=label)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    ax.set_xlabel("incoming angle θ (rad)")
    ax.set_ylabel("eigenfunction")
    ax.set_title(f"Eigenfunctions, {convention} convention", fontsize=11)
    ax.legend(frameon=False, title="eigenvalue")
    return ax
