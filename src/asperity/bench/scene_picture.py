"""Error against run time of all quantities of one scene, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..spectral import WorkReport

COLUMNS, WIDTH, HEIGHT = 3, 4.6, 3.8


def draw_scene(reports: Sequence[WorkReport]) -> Figure:
    """One panel a report, in rows of three."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(reports))
    rows = -(-len(reports) // columns)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, report in zip(panels, reports, strict=False):
        report.plot(panel)
    for panel in panels[len(reports) :]:
        panel.remove()
    return figure
