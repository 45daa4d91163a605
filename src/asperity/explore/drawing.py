"""The four figures of the page: wall with rays, kernel, spectrum, collision."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.checks import Floats
from ..core.errors import InputError
from ..geometry import Disk, Wall, trace, trajectory
from ..geometry.plotting.walls import vertical_stretch
from ..kernels.bases.basis import Frame
from ..study.pictures import chosen_rays
from .answers import Answer, Eigenvalues, Histogram, answers_to
from .question import Question, editable

# Okabe and Ito's colours, as in the pictures of a study.
RAY_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
KNOWN, SOLID = "#0072B2", "#d1d1d1"
# Pixels a side of the kernel, and the power of its colour scale.
PIXELS, COLOUR_POWER = 240, 0.5
# Tolerance of curves relative to the period; parts of a period beside the cell, and free space above it.
OUTLINE, MARGIN, FREE = 2e-4, 0.12, 0.3
# More vertices are not drawn as handles.
MOST_HANDLES = 400
# Pieces of a wall that is shown: to draw its rays takes three seconds.
MOST_PIECES = 10_000
# Milliseconds between two messages of a vertex that is being dragged.
DRAG_INTERVAL = 100
ANGLES = {0.0: "0", 0.5 * np.pi: "π/2", np.pi: "π"}
HOW_TO_DRAW = "Drag a vertex; tap to add one; select one and press Backspace to remove it"
SEND_WHILE_DRAGGING = """
const now = Date.now()
if (now - (window.asperity_sent ?? 0) > interval) {
    window.asperity_sent = now
    vertices.setv({data: vertices.data}, {check_eq: false})
}
"""


@dataclass(frozen=True)
class Picture:
    """What `WallFigure` shows of a question, and whether its wall is of the catalogue."""

    question: Question
    named: bool
    wall: Wall
    solids: list[Floats]
    rays: list[Floats]

    @property
    def handles(self) -> list[tuple[float, float]]:
        """The vertices that can be dragged: those of a polygon that is not foreshortened."""
        return [] if self.question.foreshortened else [(float(x), float(y)) for x, y in handles_of(self.wall)]


def pictured_and_answered(
    wall: Wall | Callable[[], Wall], name: str, disk: Disk, convention: Frame, foreshortened: bool, named: bool
) -> Iterator[Picture | Answer]:
    """Make the wall, then its picture and the answers to its question.

    Raises
    ------
    InputError
        If the wall cannot be made or has more than `MOST_PIECES` pieces.

    Examples
    --------
    >>> from asperity.geometry import triangular_teeth
    >>> len(next(pictured_and_answered(triangular_teeth, "teeth", Disk(), "paper", False, True)).handles)
    3
    """
    made = wall() if callable(wall) else wall
    if len(made.pieces) > MOST_PIECES:
        raise InputError(
            f"{name}: expected a wall of at most {MOST_PIECES} pieces, got {len(made.pieces)}; thin it out, or use the "
            "command `asperity study`, which has no limit"
        )
    question = Question(made, name, disk, convention, foreshortened)
    yield pictured(question, named)
    yield from answers_to(question)


def pictured(question: Question, named: bool = True) -> Picture:
    """The picture of a question."""
    wall = question.seen
    floor, free = _heights(wall)
    return Picture(question, named, wall, solids(wall, floor), ray_lines(wall, free))


def _figure(title: str, **options: Any) -> Any:
    from bokeh.plotting import figure

    plot: Any = figure(title=title, height=380, min_width=300, sizing_mode="stretch_width", toolbar_location="above",
                  **options)  # fmt: skip
    plot.toolbar.logo = None
    plot.title.text_font_size = "11pt"
    plot.grid.grid_line_alpha = 0.4
    return plot


class WallFigure:
    """The wall, its rays, and the vertices that can be dragged (`vertices`, a source with columns x and y)."""

    def __init__(self) -> None:
        from bokeh.models import (
            ColumnDataSource,
            CustomJS,
            DataRange1d,
            PanTool,
            PointDrawTool,
            ResetTool,
            WheelZoomTool,
        )

        self.vertices = ColumnDataSource({"x": [], "y": []})
        self._solid = ColumnDataSource({"xs": [], "ys": []})
        self._rays = ColumnDataSource({"xs": [], "ys": [], "colour": []})
        self._ends = ColumnDataSource({"x": [], "y": [], "fill": [], "colour": []})
        self._view = ColumnDataSource({"x": [], "y": []})
        self.plot = plot = _figure("Wall", tools="", match_aspect=True, x_range=DataRange1d(range_padding=0.0),
                                   y_range=DataRange1d(range_padding=0.0))  # fmt: skip
        plot.patches("xs", "ys", source=self._solid, fill_color=SOLID, line_color="#333333", line_width=1.2)
        plot.multi_line("xs", "ys", source=self._rays, line_color="colour", line_width=1.6)
        plot.scatter("x", "y", source=self._ends, size=7, fill_color="fill", line_color="colour", line_width=1.5)
        plot.line("x", "y", source=self.vertices, line_color="black", line_width=2.2,
                  nonselection_line_alpha=1.0)  # fmt: skip
        handles = plot.scatter("x", "y", source=self.vertices, size=11, fill_color="white", line_color="black",
                               line_width=2, hover_fill_color="#F0E442", selection_fill_color="#F0E442",
                               nonselection_fill_alpha=1.0, nonselection_line_alpha=1.0)  # fmt: skip
        view = plot.scatter("x", "y", source=self._view, alpha=0.0)
        plot.x_range.renderers = plot.y_range.renderers = [view]
        draw = PointDrawTool(renderers=[handles], drag=True, add=True, description=HOW_TO_DRAW)
        plot.add_tools(draw, PanTool(), WheelZoomTool(), ResetTool())
        plot.toolbar.active_drag = plot.toolbar.active_tap = draw
        send = CustomJS(args={"vertices": self.vertices, "interval": DRAG_INTERVAL}, code=SEND_WHILE_DRAGGING)
        plot.js_on_event("pan", send)

    def show(self, picture: Picture, title: str, *, dragged: bool) -> None:
        """Draw a wall; while a vertex is being dragged the vertices and the view are left alone."""
        from bokeh.models.text import PlainText

        # in other text bokeh reads formulas
        self.plot.title.text = PlainText(text=title)
        paths, wall = picture.solids, picture.wall
        self._solid.data = {
            "xs": [path[:, 0].tolist() for path in paths], "ys": [path[:, 1].tolist() for path in paths],
        }  # fmt: skip
        self._show_rays(picture.rays)
        if dragged:
            return
        self.show_vertices(picture.handles)
        left, right = -MARGIN * wall.period, (1.0 + MARGIN) * wall.period
        self._view.data = {"x": [left, right], "y": list(_heights(wall))}
        self.plot.aspect_scale = vertical_stretch(wall)
        self.plot.xaxis.axis_label = PlainText(text=f"x ({wall.unit or 'length units of the wall'})")
        self.plot.yaxis.axis_label = PlainText(text=f"y ({wall.unit})" if wall.unit else "y")

    def show_vertices(self, points: list[tuple[float, float]]) -> None:
        """Show handles at these points; none for a wall that is not `editable`."""
        x, y = zip(*points, strict=True) if points else ((), ())
        if list(x) != list(self.vertices.data["x"]) or list(y) != list(self.vertices.data["y"]):
            self.vertices.data = {"x": list(x), "y": list(y)}

    def _show_rays(self, lines: list[Floats]) -> None:
        colours = [RAY_COLOURS[k % len(RAY_COLOURS)] for k in range(len(lines))]
        self._rays.data = {
            "xs": [line[:, 0].tolist() for line in lines], "ys": [line[:, 1].tolist() for line in lines],
            "colour": colours,
        }  # fmt: skip
        # a dot where a ray enters, a ring where it leaves
        ends = [line[k] for line in lines for k in (1, -2)]
        self._ends.data = {
            "x": [float(point[0]) for point in ends], "y": [float(point[1]) for point in ends],
            "fill": [fill for colour in colours for fill in (colour, "white")],
            "colour": [colour for colour in colours for _ in range(2)],
        }  # fmt: skip


def handles_of(wall: Wall) -> Any:
    """The vertices of a wall that can be dragged, or none."""
    return wall.vertices if editable(wall) and len(wall.vertices) <= MOST_HANDLES else []


def _heights(wall: Wall) -> tuple[float, float]:
    """y at the bottom and at the top of the figure."""
    size = max(wall.depth, 0.02 * wall.period)
    free = FREE * max(wall.depth, min(wall.period, 20.0 * size))
    return -size - 0.35 * free, free


def solids(wall: Wall, floor: float) -> list[Floats]:
    """The solid below three periods of the wall, down to ``floor``, and its islands, as closed polygons."""
    outline = wall.outline(OUTLINE * wall.period)
    shift = np.array([wall.period, 0.0])
    path = np.concatenate([outline[:-1] - shift, outline[:-1], outline + shift])
    # below the figure, so that the line around the solid is not seen there
    low = 2.0 * floor - wall.period
    below = [path, np.array([[path[-1, 0], low], [path[0, 0], low]])]
    islands = [
        np.vstack([piece.flattened(OUTLINE * wall.period) for piece in island]) + k * shift
        for island in wall.islands
        for k in (-1, 0, 1)
    ]
    return [np.vstack(below), *islands]


def ray_lines(wall: Wall, free: float) -> list[Floats]:
    """The paths of a few rays, from above the wall through its hollows and out again, each (n, 2)."""
    x, theta = chosen_rays(wall)
    lines = []
    for place, angle in zip(x, theta, strict=True):
        result = trace(wall, float(place), float(angle))
        inside = np.asarray(trajectory(wall, float(place), float(angle)))
        leaves = np.array([np.cos(float(result.theta)), np.sin(float(result.theta))])
        comes = np.array([np.cos(float(angle)), np.sin(float(angle))])
        last = np.array([float(result.x), inside[0, 1]])
        points = [inside[0] + free * comes / comes[1], *inside[:-1], last]
        lines.append(np.array([*points, last + free * leaves / max(leaves[1], 0.2 * abs(leaves[0]))]))
    return lines


class KernelFigure:
    """The density of the law with respect to the invariant measure."""

    def __init__(self) -> None:
        from bokeh.models import BasicTicker, ColumnDataSource, HoverTool, LinearColorMapper
        from bokeh.models.annotations import ColorBar
        from bokeh.palettes import Viridis256

        self._image = ColumnDataSource({"root": [], "density": []})
        self._lines = ColumnDataSource({"x": [0.0, np.pi], "retro": [0.0, np.pi], "specular": [np.pi, 0.0]})
        self.plot = plot = _figure("Kernel", tools="pan,wheel_zoom,reset", x_range=(0.0, np.pi), y_range=(0.0, np.pi))
        self._mapper = LinearColorMapper(palette=Viridis256, low=0.0, high=1.0)
        image = plot.image("root", x=0.0, y=0.0, dw=np.pi, dh=np.pi, source=self._image, color_mapper=self._mapper)
        for column, dash in (("retro", "dashed"), ("specular", "dotted")):
            plot.line("x", column, source=self._lines, line_color="white", line_alpha=0.7, line_dash=dash)
        bar = ColorBar(color_mapper=self._mapper, width=10, title="√density", ticker=BasicTicker(desired_num_ticks=5))
        plot.add_layout(bar, "right")
        plot.add_tools(HoverTool(renderers=[image], tooltips=[("θ, θ'", "$x, $y"), ("density", "@density{0.000}")]))
        for axis, label in ((plot.xaxis, "incoming angle θ (rad)"), (plot.yaxis, "outgoing angle θ' (rad)")):
            axis.axis_label = label
            axis.ticker = list(ANGLES)
            axis.major_label_overrides = ANGLES

    def show(self, answer: Answer) -> None:
        """Draw the matrix with its error in the title; nothing where it is refused."""
        matrix = answer.matrix
        if matrix is None:
            self._image.data = {"root": [], "density": []}
            self.plot.title.text = "Kernel: refused"
            return
        # uniform angles, and the cell in which each is
        angle = np.pi * (np.arange(PIXELS) + 0.5) / PIXELS
        cell = np.searchsorted(matrix.basis.edges, angle) - 1
        density = (matrix.array * matrix.basis.size)[np.ix_(cell, cell)].T
        root = np.maximum(density, 0.0) ** COLOUR_POWER
        self._mapper.high = float(root.max())
        self._image.data = {"root": [root.astype(np.float32)], "density": [density.astype(np.float32)]}
        retro, specular = [0.0, np.pi], [np.pi, 0.0]
        both = (retro, specular) if matrix.frame == "paper" else (specular, retro)
        self._lines.data = {"x": [0.0, np.pi], "retro": both[0], "specular": both[1]}
        self.plot.title.text = f"Kernel in {matrix.basis!r}, Frobenius error {float(matrix.error):.1e}"


class SpectrumFigure:
    """Eigenvalues with their errors; hollow if they are those of a matrix. The gap is shaded."""

    def __init__(self) -> None:
        from bokeh.models import ColumnDataSource
        from bokeh.models.annotations import BoxAnnotation, Whisker

        self._values = ColumnDataSource({"rank": [], "value": [], "low": [], "high": [], "fill": []})
        self.plot = plot = _figure("Spectrum", tools="pan,wheel_zoom,reset", y_range=(-0.2, 1.1), x_range=(-0.7, 9.7))
        # the surest part of the gap, and what its error leaves open
        self._sure = BoxAnnotation(top=1.0, fill_color="#999999", fill_alpha=0.35, line_color=None, level="underlay")
        self._open = BoxAnnotation(fill_color="#E69F00", fill_alpha=0.3, line_color=None, level="underlay")
        plot.add_layout(self._sure)
        plot.add_layout(self._open)
        plot.add_layout(Whisker(base="rank", lower="low", upper="high", source=self._values, line_color=KNOWN))
        plot.scatter("rank", "value", source=self._values, size=8, fill_color="fill", line_color=KNOWN, line_width=1.5)
        plot.xaxis.axis_label = "rank among the largest moduli"
        plot.xaxis.ticker = list(range(10))
        plot.yaxis.axis_label = "eigenvalue"

    def show(self, answer: Answer) -> None:
        """Draw eigenvalues and gap; nothing where they are refused."""
        found = answer.eigenvalues
        if found is None:
            self._values.data = {name: [] for name in ("rank", "value", "low", "high", "fill")}
            self.plot.title.text = "Spectrum: not known"
        else:
            self._show_values(found)
        gap = answer.gap
        shaded = gap is not None and gap.verdict != "no gap"
        self._sure.visible = self._open.visible = shaded
        if gap is not None and shaded:
            low, high = max(gap.value - gap.error, 0.0), min(gap.value + gap.error, 2.0)
            self._sure.bottom = 1.0 - low
            self._open.top, self._open.bottom = 1.0 - low, 1.0 - high

    def _show_values(self, found: Eigenvalues) -> None:
        error = np.where(np.isfinite(found.errors), found.errors, 2.0)
        low, high = np.clip(found.values - error, -1.0, 1.0), np.clip(found.values + error, -1.0, 1.0)
        of_law = found.of == "the law"
        self._values.data = {
            "rank": list(range(len(found.values))), "value": found.values.tolist(), "low": low.tolist(),
            "high": high.tolist(), "fill": [KNOWN if of_law else "white"] * len(found.values),
        }  # fmt: skip
        self.plot.y_range.start = -1.1 if low.min() < -0.5 else min(-0.2, float(low.min()) - 0.1)
        largest = float(np.max(found.errors))
        self.plot.title.text = f"Eigenvalues of {found.of} ± {largest:.0e}"


class CollisionFigure:
    """The outgoing velocity v1 of a disk that comes in at 45 degrees without spin."""

    def __init__(self) -> None:
        from bokeh.models import ColumnDataSource
        from bokeh.models.annotations import Span, TeeHead, Whisker

        self._bins = ColumnDataSource({"left": [], "right": [], "middle": [], "top": [], "low": [], "high": []})
        self.plot = plot = _figure("Collision", tools="pan,wheel_zoom,reset")
        plot.quad(left="left", right="right", top="top", bottom=0.0, source=self._bins, fill_color="#8c8c8c",
                  line_color="white", line_width=0.5)  # fmt: skip
        upper, lower = TeeHead(size=4), TeeHead(size=4)
        plot.add_layout(
            Whisker(base="middle", lower="low", upper="high", source=self._bins, upper_head=upper, lower_head=lower)
        )
        self._marks = {}
        for name, colour, dash in (("smooth", "#0072B2", "solid"), ("no-slip", "#D55E00", "dashed")):
            mark = Span(dimension="height", line_color=colour, line_width=2, line_dash=dash, visible=False)
            plot.add_layout(mark)
            # a span has no entry in the legend; a line without points has
            plot.line([np.nan], [np.nan], line_color=colour, line_width=2, line_dash=dash, legend_label=f"{name} disk")
            self._marks[name] = mark
        # beside the bars, not over them
        plot.add_layout(plot.legend[0], "above")
        plot.legend.orientation = "horizontal"
        plot.xaxis.axis_label = "outgoing v1 (radius / time)"
        plot.yaxis.axis_label = "probability per bin"
        plot.y_range.start = 0.0

    def show(self, found: Histogram | None) -> None:
        """Draw the histogram with intervals of 95 %; nothing where it is refused."""
        if found is None:
            self._bins.data = {name: [] for name in self._bins.data}
            self.plot.title.text = "Collision: refused"
            return
        self._bins.data = {
            "left": found.edges[:-1].tolist(), "right": found.edges[1:].tolist(), "top": found.fractions.tolist(),
            "middle": (0.5 * (found.edges[:-1] + found.edges[1:])).tolist(), "low": found.low.tolist(),
            "high": found.high.tolist(),
        }  # fmt: skip
        for name, velocity in (("smooth", found.smooth), ("no-slip", found.no_slip)):
            self._marks[name].location, self._marks[name].visible = velocity, True
        self.plot.title.text = "Disk in with v = (1, -1), no spin: mean v1"
