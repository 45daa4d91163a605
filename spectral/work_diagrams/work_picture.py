"""The picture of error against run time."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .report import WorkReport

MARKERS = "osv^D<>Ph*X"
# An axis covers a power of ten at least, so that one is labelled.
DECADE = 10.0


def draw_work(report: WorkReport, ax: Axes | None = None) -> Axes:
    """Draw the errors (see `WorkReport.level`) over the least times, the front in grey and the chosen one in black."""
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(6.0, 4.5), layout="constrained").add_subplot()
    front = [(row.least, report.level(row)) for row in report.front()]
    if len(front) > 1:
        ax.plot(*zip(*front, strict=True), color="0.8", linewidth=6.0, solid_capstyle="round", zorder=0)
    floors = {facts.floor for facts in report.methods.values()}
    for number, name in enumerate(report.methods):
        rows = sorted((row for row in report.rows if row.is_done and row.method == name), key=lambda row: row.least)
        if not rows:
            continue
        chosen = name == report.auto
        ax.plot(
            [row.least for row in rows], [report.level(row) for row in rows],
            marker=MARKERS[number % len(MARKERS)], markersize=8.0 if chosen else 5.0, linewidth=1.2,
            color="black" if chosen else f"C{number}", fillstyle="none" if chosen else "full", label=name,
        )  # fmt: skip
    ax.axhline(max(floors), color="0.5", linestyle=":", linewidth=1.0, label="reference known to")
    ax.set(xscale="log", yscale="log", xlabel="seconds", ylabel=f"{report.norms[0]} error", title=report.problem)
    from matplotlib.ticker import NullFormatter

    for axis, (low, high), limit in ((ax.xaxis, ax.get_xlim(), ax.set_xlim), (ax.yaxis, ax.get_ylim(), ax.set_ylim)):
        middle, reach = sqrt(low * high), sqrt(max(high / low, DECADE))
        limit(middle / reach, middle * reach)
        # matplotlib labels minor ticks of a few decades, too, and they overlap
        axis.set_minor_formatter(NullFormatter())
    ax.legend(fontsize="x-small", framealpha=0.6)
    return ax
