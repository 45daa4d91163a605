"""The four figures of the page: wall with rays, kernel, spectrum, collision."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.checks import Floats
from ..core.errors import InputError
from ..geometry import Wall
from ..geometry.plotting.walls import MARGIN, RAY_COLOURS, RayPath, axis_labels, heights, vertical_stretch
from ..study.pictures import chosen_rays
from .answers import Answer, Question, answers_to

# What is grey is seen on white and on black.
KNOWN, SOLID, GREY = "#0072B2", "#d1d1d1", "#808080"
# Pixels a side of the kernel, and the power of its colour scale.
PIXELS, COLOUR_POWER = 240, 0.5
# Tolerance of curves relative to the period.
OUTLINE = 2e-4
# Pieces of a wall that is shown: the first answer takes a second or two, of twice as many a quarter of a minute.
MOST_PIECES = 50_000
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
    """What `WallFigure` shows of a question."""

    question: Question
    solids: list[Floats]
    rays: list[Floats]


def pictured_and_answered(wall: Wall | Callable[[], Wall], *about: Any) -> Iterator[Picture | Answer]:
    """Make the wall, then the picture and the answers of its `Question`, of which ``about`` is all but the wall.

    Raises
    ------
    InputError
        If the wall cannot be made or has more than `MOST_PIECES` pieces.

    Examples
    --------
    >>> from asperity.geometry import triangular_teeth
    >>> len(next(pictured_and_answered(triangular_teeth, "teeth")).question.handles)
    3
    """
    question = Question(wall() if callable(wall) else wall, *about)
    number = len(question.wall.pieces)
    if number > MOST_PIECES:
        raise InputError(
            f"{question.name}: expected a wall of at most {MOST_PIECES} pieces, got {number}; thin it out, or use the "
            "command `asperity study`, which has no limit"
        )
    yield pictured(question)
    yield from answers_to(question)


def pictured(question: Question) -> Picture:
    """The picture of a question."""
    wall, (free, floor) = question.seen, heights(question.seen)
    rays = [RayPath(wall, float(x), float(theta), free).path for x, theta in zip(*chosen_rays(wall), strict=True)]
    return Picture(question, solids(wall, floor), rays)


def _empty(*columns: str) -> Any:
    """A source of these columns, whose lines are shown as soon as it has some."""
    from bokeh.models import ColumnDataSource

    return ColumnDataSource({name: [] for name in columns})


def _clear(source: Any) -> None:
    source.data = {name: [] for name in source.data}


def _both(paths: list[Floats]) -> dict[str, Any]:
    """Columns of a source of many lines, as arrays, which are sent as bytes."""
    return {"xs": [path[:, 0].copy() for path in paths], "ys": [path[:, 1].copy() for path in paths]}


def _figure(title: str, **options: Any) -> Any:
    from bokeh.plotting import figure

    plot: Any = figure(title=title, height=380, min_width=200, sizing_mode="stretch_width", toolbar_location="below",
                  frame_align=False, **options)  # fmt: skip
    plot.toolbar.logo = None
    # a finger that is moved over the figure scrolls the page
    plot.toolbar.active_drag = plot.toolbar.active_tap = None
    plot.title.text_font_size = "11pt"
    plot.grid.grid_line_alpha = 0.4
    return plot


class WallFigure:
    """The wall, its rays, and the vertices that can be dragged (`vertices`, a source with columns x and y)."""

    def __init__(self) -> None:
        from bokeh.models import CustomJS, DataRange1d, PanTool, PointDrawTool, ResetTool, WheelZoomTool
        from bokeh.models.annotations import Title

        self._picture: Picture | None = None
        self.vertices, self._view, self._solid = _empty("x", "y"), _empty("x", "y"), _empty("xs", "ys")
        self._rays, self._ends = _empty("xs", "ys", "colour"), _empty("x", "y", "fill", "colour")
        self.plot = plot = _figure("Wall", tools="", match_aspect=True, x_range=DataRange1d(range_padding=0.0),
                                   y_range=DataRange1d(range_padding=0.0))  # fmt: skip
        self._hint = Title(text="", text_font_style="normal", text_font_size="9pt")
        plot.add_layout(self._hint, "above")
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
        self._tool = PointDrawTool(renderers=[handles], drag=True, add=True, description=HOW_TO_DRAW)
        plot.add_tools(self._tool, PanTool(), WheelZoomTool(), ResetTool())
        send = CustomJS(args={"vertices": self.vertices, "interval": DRAG_INTERVAL}, code=SEND_WHILE_DRAGGING)
        plot.js_on_event("pan", send)

    def show(self, picture: Picture, *, dragged: bool) -> None:
        """Draw a wall; while a vertex is being dragged the vertices and the view are left alone."""
        if picture is not self._picture:
            self._picture = picture
            self._draw(picture)
        if not dragged:
            self._settle(picture)

    def _draw(self, picture: Picture) -> None:
        from bokeh.models.text import PlainText

        wall, handles, name = picture.question.seen, picture.question.handles, picture.question.name
        stretch, (across, upwards) = vertical_stretch(wall), axis_labels(wall)
        felt = ", as the disk feels it" if picture.question.foreshortened else ""
        hints = ["drag a vertex, tap to add one"] * bool(handles) + ["angles not to scale"] * (stretch != 1.0)
        # in other text bokeh reads formulas
        self.plot.title.text = PlainText(text=f"{name}, depth {wall.depth:.4g}{felt}")
        self._hint.text = "; ".join(hints)
        self.plot.xaxis.axis_label, self.plot.yaxis.axis_label = PlainText(text=across), PlainText(text=upwards)
        self._solid.data = _both(picture.solids)
        colours = [RAY_COLOURS[k % len(RAY_COLOURS)] for k in range(len(picture.rays))]
        self._rays.data = {**_both(picture.rays), "colour": colours}
        # a dot where a ray enters, a ring where it leaves
        ends = [line[k].tolist() for line in picture.rays for k in (1, -2)]
        self._ends.data = {
            "x": [x for x, _ in ends], "y": [y for _, y in ends],
            "fill": [fill for colour in colours for fill in (colour, "white")],
            "colour": [colour for colour in colours for _ in range(2)],
        }  # fmt: skip

    def _settle(self, picture: Picture) -> None:
        """Set vertices and view."""
        wall, handles = picture.question.seen, picture.question.handles
        left, right = -MARGIN * wall.period, (1.0 + MARGIN) * wall.period
        vertices = {"x": [x for x, _ in handles], "y": [y for _, y in handles]}
        for source, data in (self.vertices, vertices), (self._view, {"x": [left, right], "y": list(heights(wall))}):
            if data != {name: list(source.data[name]) for name in data}:
                source.data = data
        self.plot.toolbar.active_multi = self._tool if handles else None
        # the width over the height of a square
        self.plot.aspect_scale = 1.0 / vertical_stretch(wall)


def solids(wall: Wall, floor: float) -> list[Floats]:
    """The solid below three periods of the wall, down to ``floor``, and its islands, as closed polygons."""
    outline, shift = wall.outline(OUTLINE * wall.period), np.array([wall.period, 0.0])
    path = np.concatenate([outline[:-1] - shift, outline[:-1], outline + shift])
    # below the figure, so that the line around the solid is not seen there
    low = 2.0 * floor - wall.period
    loops = [np.vstack([piece.flattened(OUTLINE * wall.period) for piece in island]) for island in wall.islands]
    return [
        np.vstack([path, [[path[-1, 0], low], [path[0, 0], low]]]),
        *(loop + k * shift for loop in loops for k in (-1, 0, 1)),
    ]


class KernelFigure:
    """The density of the law with respect to the invariant measure."""

    def __init__(self) -> None:
        from bokeh.models import BasicTicker, HoverTool, LinearColorMapper
        from bokeh.models.annotations import ColorBar
        from bokeh.palettes import Viridis256

        self._image, self._lines = _empty("root", "density"), _empty("x", "retro", "specular")
        self.plot = plot = _figure("Kernel", tools="pan,wheel_zoom,reset", x_range=(0.0, np.pi), y_range=(0.0, np.pi))
        self._mapper = LinearColorMapper(palette=Viridis256, low=0.0, high=1.0)
        image = plot.image("root", x=0.0, y=0.0, dw=np.pi, dh=np.pi, source=self._image, color_mapper=self._mapper)
        for column, dash in (("retro", "dashed"), ("specular", "dotted")):
            plot.line("x", column, source=self._lines, line_color="white", line_alpha=0.7, line_dash=dash)
        bar = ColorBar(color_mapper=self._mapper, width=10, title="√density", ticker=BasicTicker(desired_num_ticks=5),
                       title_text_color=GREY, major_label_text_color=GREY, background_fill_alpha=0.0)  # fmt: skip
        plot.add_layout(bar, "right")
        plot.add_tools(HoverTool(renderers=[image], tooltips=[("θ, θ'", "$x, $y"), ("density", "@density{0.000}")]))
        for axis, label in ((plot.xaxis, "incoming angle θ (rad)"), (plot.yaxis, "outgoing angle θ' (rad)")):
            axis.axis_label = label
            axis.ticker = list(ANGLES)
            axis.major_label_overrides = ANGLES

    def show(self, answer: Answer) -> None:
        """Draw the matrix with its error in the title; nothing where it is missing."""
        matrix = answer.kernel
        if matrix is None:
            _clear(self._image)
            self.plot.title.text = f"Kernel: {answer.missing('kernel')}"
            return
        # uniform angles, and the cell in which each is
        angle = np.pi * (np.arange(PIXELS) + 0.5) / PIXELS
        cell = np.searchsorted(matrix.basis.edges, angle) - 1
        density = (matrix.array * matrix.basis.size)[np.ix_(cell, cell)].T
        root = np.maximum(density, 0.0) ** COLOUR_POWER
        self._mapper.high = float(root.max())
        self._image.data = {"root": [root.astype(np.float32)], "density": [density.astype(np.float32)]}
        retro = [0.0, np.pi] if matrix.frame == "paper" else [np.pi, 0.0]
        self._lines.data = {"x": [0.0, np.pi], "retro": retro, "specular": retro[::-1]}
        self.plot.title.text = f"Kernel in {matrix.basis!r} ± {float(matrix.error):.0e}"


class SpectrumFigure:
    """Eigenvalues with their errors; hollow if they are those of a matrix. The gap is shaded."""

    def __init__(self) -> None:
        from bokeh.models.annotations import BoxAnnotation, Whisker

        self._values = _empty("rank", "value", "low", "high", "fill")
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
        """Draw eigenvalues and gap; nothing where they are missing."""
        found, gap = answer.spectrum, answer.gap
        if found is None:
            _clear(self._values)
            self.plot.title.text = f"Eigenvalues: {answer.missing('spectrum')}"
        else:
            error = np.where(np.isfinite(found.errors), found.errors, 2.0)
            low, high = np.clip(found.values - error, -1.0, 1.0), np.clip(found.values + error, -1.0, 1.0)
            fill = KNOWN if found.of == "the law" else "white"
            self._values.data = {
                "rank": list(range(len(found.values))), "value": found.values.tolist(), "low": low.tolist(),
                "high": high.tolist(), "fill": [fill] * len(found.values),
            }  # fmt: skip
            self.plot.y_range.start = -1.1 if low.min() < -0.5 else min(-0.2, float(low.min()) - 0.1)
            self.plot.title.text = f"Eigenvalues of {found.of} ± {float(np.max(found.errors)):.0e}"
        shaded = gap is not None and gap.verdict != "no gap"
        self._sure.visible = self._open.visible = shaded
        if gap is not None and shaded:
            self._sure.bottom = self._open.top = 1.0 - max(gap.value - gap.error, 0.0)
            self._open.bottom = 1.0 - min(gap.value + gap.error, 2.0)


class CollisionFigure:
    """The outgoing velocity v1 of a disk that comes in at 45 degrees without spin."""

    def __init__(self) -> None:
        from bokeh.models.annotations import Span, TeeHead, Whisker

        self._bins = _empty("left", "right", "middle", "top", "low", "high")
        self.plot = plot = _figure("Collision", tools="pan,wheel_zoom,reset")
        plot.quad(left="left", right="right", top="top", bottom=0.0, source=self._bins, fill_color="#8c8c8c",
                  line_color="white", line_width=0.5)  # fmt: skip
        upper, lower = (TeeHead(size=4, line_color=GREY) for _ in range(2))
        plot.add_layout(Whisker(base="middle", lower="low", upper="high", source=self._bins, line_color=GREY,
                                upper_head=upper, lower_head=lower))  # fmt: skip
        self._marks = {}
        for name, colour, dash in (("smooth", "#0072B2", "solid"), ("no-slip", "#D55E00", "dashed")):
            mark = Span(dimension="height", line_color=colour, line_width=2, line_dash=dash, visible=False)
            plot.add_layout(mark)
            # a span has no entry in the legend; a line without points has
            plot.line([np.nan], [np.nan], line_color=colour, line_width=2, line_dash=dash, legend_label=f"{name} disk")
            self._marks[name] = mark
        # beside the bars, not over them
        plot.add_layout(plot.legend[0], "above")
        plot.legend.orientation, plot.legend.label_text_color = "horizontal", GREY
        plot.legend.background_fill_alpha = plot.legend.border_line_alpha = plot.legend.padding = 0
        plot.xaxis.axis_label = "outgoing v1 (radius / time)"
        plot.yaxis.axis_label = "probability per bin"
        plot.y_range.start = 0.0

    def show(self, answer: Answer) -> None:
        """Draw the histogram with intervals of 95 %; nothing where it is missing."""
        found = answer.collision
        if found is None:
            _clear(self._bins)
            self.plot.title.text = f"Collision: {answer.missing('collision')}"
            return
        self._bins.data = {
            "left": found.edges[:-1].tolist(), "right": found.edges[1:].tolist(), "top": found.fractions.tolist(),
            "middle": (0.5 * (found.edges[:-1] + found.edges[1:])).tolist(), "low": found.low.tolist(),
            "high": found.high.tolist(),
        }  # fmt: skip
        for name, velocity in (("smooth", found.smooth), ("no-slip", found.no_slip)):
            self._marks[name].location, self._marks[name].visible = velocity, True
        self.plot.title.text = "Disk in with v = (1, -1), no spin"
