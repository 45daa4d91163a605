"""The picture of a kernel matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import Floats
from ...errors import InputError
from ..bases.bins import Bins

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .matrix import KernelMatrix

# Cells a side when a kernel in polynomials is drawn.
GRID = 240
# Densities of atoms reach the number of bins: the square root keeps the rest visible.
COLOUR_POWER = 0.5
TICKS = ([0.0, 0.5 * np.pi, np.pi], ["0", "π/2", "π"])


def draw_matrix(matrix: KernelMatrix, ax: Axes | None = None) -> Axes:
    """Draw the density of P(theta, d theta') with respect to the invariant measure; see `KernelMatrix.plot`.

    Makes a figure of its own unless ``ax`` is given. The dashed line is retroreflection, the dotted one specular
    reflection.
    """
    from matplotlib.colors import PowerNorm

    edges, density = _density(matrix)
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.subplots(figsize=(5.2, 4.4), layout="constrained")[1]
    highest = float(density.max())
    norm = PowerNorm(COLOUR_POWER, vmin=0.0, vmax=highest if highest > 0.0 else 1.0)
    mesh = ax.pcolormesh(edges, edges, np.maximum(density, 0.0).T, cmap="viridis", norm=norm, rasterized=True)
    ends = np.array([0.0, np.pi])
    retro, specular = (ends, np.pi - ends) if matrix.frame == "paper" else (np.pi - ends, ends)
    ax.plot(ends, retro, color="white", alpha=0.6, linewidth=0.8, linestyle="--", label="retroreflection")
    ax.plot(ends, specular, color="white", alpha=0.6, linewidth=0.8, linestyle=":", label="specular")
    ax.set(xlim=(0.0, np.pi), ylim=(0.0, np.pi), aspect="equal")
    ax.set_xticks(*TICKS)
    ax.set_yticks(*TICKS)
    ax.set_xlabel("incoming angle θ (rad)")
    ax.set_ylabel("outgoing angle θ' (rad)")
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(mesh, ax=ax, label="density with respect to the invariant measure, sin θ' dθ'/2")
    return ax


def _density(matrix: KernelMatrix) -> tuple[Floats, Floats]:
    basis = matrix.basis
    try:
        edges = basis.edges
    except InputError as reason:
        raise InputError(f"plot: expected a kernel of one angle, got one in {basis!r}") from reason
    if isinstance(basis, Bins):
        return edges, matrix.array / basis.weights
    edges = np.linspace(0.0, np.pi, GRID + 1)
    values = basis.evaluate(0.5 * (edges[1:] + edges[:-1]))
    return edges, values @ matrix.symmetric @ values.T
