"""Pictures of spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..estimates import rounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .eigenvalues.spectra import Spectrum
    from .gap.verdict import SpectralGap

# Okabe and Ito's blue and vermilion, which stay apart for colour-blind readers.
KNOWN, UNKNOWN = "#0072B2", "#D55E00"
# Angles of a curve, and curves that can be told apart.
ANGLES, SHOWN_FUNCTIONS = 400, 5
CONVENTIONS = {"paper": "retroreflection is the identity", "specular": "specular reflection is the identity"}


def draw_spectrum(found: Spectrum, ax: Axes | None = None, gap: SpectralGap | None = None) -> Axes:
    """Draw eigenvalues by rank, with their intervals.

    Parameters
    ----------
    found : Spectrum
    ax : matplotlib Axes, optional
        A new figure is made if there is none.
    gap : SpectralGap, optional
        What is known of the law behind the matrix. Without it the picture shows 1 - the second eigenvalue as the
        matrix's; with it the gap is shaded and named with its verdict. Where the law has no gap nothing is shaded.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    rank = np.arange(len(found.values))
    width = found.errors.total()
    known = np.isfinite(width)
    gapless = gap is not None and gap.verdict == "no gap"
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    if gapless:
        ax.axhline(1.0, color="0.3", linewidth=1.2, linestyle="--", zorder=1,
                   label="the law has no gap: 1 is in its essential spectrum")  # fmt: skip
    else:
        value, words = _described(found, gap)
        ax.axhspan(1.0 - value, 1.0, color="0.87", zorder=0, label=words)
    # where there is no gap the eigenvalues are those of the grid, so they are drawn hollow
    ax.errorbar(
        rank[known], found.values[known], yerr=width[known], fmt="o", markersize=5.5, capsize=3, color=KNOWN, zorder=3,
        mfc="white" if gapless else KNOWN,
        label=f"eigenvalue of the matrix in {found.basis!r}" if gapless else "eigenvalue with its total error",
    )  # fmt: skip
    if not known.all():
        ax.plot(rank[~known], found.values[~known], "s", mfc="none", color=UNKNOWN, zorder=3, label="error not known")
    ax.set_xticks(rank)
    ax.set_xlabel(f"rank among the {len(rank)} largest moduli, sorted descending")
    ax.set_ylabel("eigenvalue")
    # the error bars inside the picture, within [-1, 1] where the spectrum lies
    lowest = max(float(np.min(found.values - np.where(known, width, 0.0))), -1.0)
    ax.set_ylim(-1.1 if lowest < -0.5 else min(-0.15, lowest - 0.1), 1.1)
    ax.set_title(f"Spectrum, {found.convention} convention ({CONVENTIONS[found.convention]})", fontsize=11)
    # below the axes: a spectrum may fill any corner
    ax.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=1 if gapless else 2)
    return ax


def draw_eigenfunctions(found: Spectrum, ax: Axes | None = None) -> Axes:
    """Draw the eigenfunctions off the constants, of mean square 1 under the measure, with their eigenvalues."""
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    theta = np.linspace(0.0, np.pi, ANGLES + 2)[1:-1]
    for index in range(1, min(len(found.values), 1 + SHOWN_FUNCTIONS)):
        values = found.eigenfunction(index, theta)
        # the sign is arbitrary: positive at small angles
        label = f"{found.values[index]:.6g}"
        if found.parity and found.parity[index] != "none":
            label += f" ({found.parity[index]})"
        ax.plot(theta, np.sign(values[0] or 1.0) * values, label=label)
    ax.axhline(0.0, color="0.6", linewidth=0.8, zorder=1)
    ax.set_xlabel("incoming angle θ")
    ax.set_ylabel("eigenfunction")
    ax.set_title(f"Eigenfunctions, {found.convention} convention", fontsize=11)
    ax.legend(frameon=False, title="eigenvalue")
    return ax


def _described(found: Spectrum, gap: SpectralGap | None) -> tuple[float, str]:
    if gap is None:
        return found.gap, f"1 - second eigenvalue of this matrix: {found.gap:.4g}"
    return gap.value, f"gap {rounded(gap).replace('+-', '±')} ({gap.verdict})"
