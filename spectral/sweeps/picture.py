"""The picture of a sweep: curves with error bands, verdicts as markers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...core.errors import InputError
from ...core.tables import verbatim
from ...geometry import WALLS
from .row import UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .row import SweepRow

MARKERS = {"isolated": "o", "essential edge": "s", "no gap": "x", "undecided": "^", "": "."}
NO_GAP = "0.9"
# Units of the parameters of named walls; the others are pure numbers.
UNITS_OF_PARAMETERS = {"angle": "rad", "half_angle": "rad", "curvature": "1 / period"}


def draw_curves(
    rows: Sequence[SweepRow], parameters: Sequence[str], quantity: str, family: str, ax: Axes | None = None
) -> Axes:
    """Draw the rows of one quantity against the first parameter that is a number, which is named with its family.

    Raises
    ------
    InputError
        If no parameter is a number.
    """
    numeric = [name for name in parameters if all(isinstance(row.point[name], (int, float)) for row in rows)]
    if not numeric:
        raise InputError(f"plot: expected a parameter that is a number, got {', '.join(parameters)}")
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    name = numeric[0]
    curves: dict[str, list[SweepRow]] = {}
    for row in sorted(rows, key=lambda row: float(row.point[name])):
        label = verbatim(", ".join(f"{key} = {value}" for key, value in row.point.items() if key != name))
        curves.setdefault(label, []).append(row)
    for number, (label, curve) in enumerate(curves.items()):
        _draw_curve(ax, curve, name, f"C{number}", label)
    verdicts = dict.fromkeys(row.verdict for row in rows if row.verdict and row.value is not None)
    for verdict in verdicts:
        ax.plot([], [], MARKERS[verdict], color="0.3", linestyle="none", label=verdict)
    for low, high in gapless(next(iter(curves.values())), name) if len(curves) == 1 else []:
        ax.axvspan(low, high, color=NO_GAP, zorder=0)
    is_named = family.partition(":")[0].replace("_", "-") in WALLS
    ax.set_xlabel(_label(name, UNITS_OF_PARAMETERS.get(name) if is_named else None, f" of {family}" if family else ""))
    ax.set_ylabel(_label(quantity, UNITS.get(quantity)))
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False)
    return ax


def _label(name: str, unit: str | None, owner: str = "") -> str:
    return verbatim(name.replace("_", " ") + owner + (f" ({unit})" if unit else ""))


def _draw_curve(ax: Axes, curve: Sequence[SweepRow], name: str, colour: str, label: str) -> None:
    """One line with its band, broken where points were refused, and a marker by verdict at each point."""
    x = np.array([float(row.point[name]) for row in curve])
    value = np.array([np.nan if row.value is None else row.value for row in curve])
    error = np.array([np.nan if row.error is None else row.error for row in curve])
    ax.plot(x, value, color=colour, linewidth=1.0, label=label or None)
    known = np.where(np.isfinite(error), error, np.nan)
    ax.fill_between(x, value - known, value + known, color=colour, alpha=0.3, linewidth=0.0)
    for verdict, marker in MARKERS.items():
        own = np.array([row.verdict == verdict for row in curve])
        if own.any():
            ax.plot(x[own], value[own], marker, color=colour, markersize=4.5, linestyle="none")


def gapless(curve: Sequence[SweepRow], name: str) -> list[tuple[float, float]]:
    """The intervals between neighbouring points of a sorted curve that both have no gap."""
    found: list[tuple[float, float]] = []
    for first, second in pairwise(curve):
        if first.verdict == second.verdict == "no gap":
            low, high = float(first.point[name]), float(second.point[name])
            if found and found[-1][1] == low:
                found[-1] = (found[-1][0], high)
            else:
                found.append((low, high))
    return found
