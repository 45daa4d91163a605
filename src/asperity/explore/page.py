"""The page of one browser tab: controls, figures, and what happens when one of them changes."""

from __future__ import annotations

import html
import io
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import panel as pn
from bokeh.events import PanEnd, PanStart

from ..core.checks import number_between
from ..core.errors import AsperityError
from ..geometry import WALLS, Disk, Wall, wall_from_text
from ..geometry.cells.profile import ENCODINGS, SEPARATORS
from ..study.result import resistance_from
from . import drawing
from .answers import MOST_HANDLES, Answer, Question, draggable_vertices, pinned, with_new_vertex
from .background import Background
from .files import new_folder, opened, plain_name, studied, unpacked, wall_as_toml

# Milliseconds between two looks for better answers.
INTERVAL = 40
# Seconds that a new wall waits for its first answer, so that both are shown at once; then the old one goes.
GRACE = 0.4
# Ranges of the sliders of the named walls.
RANGES = {
    "angle": (0.05, 3.0), "height_to_width": (0.05, 6.0), "half_angle": (0.05, 1.55), "curvature": (0.02, 1.98),
    "mass": (0.1, 5.0), "inertia_ratio": (0.05, 5.0), "stem_to_cap": (0.02, 0.95), "stem_aspect": (0.0, 3.0),
    "generations": (1, 4), "amplitude": (0.02, 2.0), "diffuse_fraction": (0.0, 1.0),
}  # fmt: skip
DRAWN = "a polygon of your own"
# How a profile is read, by the parameters of `wall_from_text`: their titles and words.
READING: dict[str, tuple[str, dict[str, str]]] = {
    "delimiter": ("Separator", {word: word for word in SEPARATORS}),
    "decimal": ("Decimal sign", {"point": ".", "comma": "comma"}),
    "encoding": ("Encoding", {word: word for word in ENCODINGS}),
}
CONVENTIONS = {"retroreflection = identity": "paper", "specular = identity": "specular"}
STRETCH: dict[str, Any] = {"sizing_mode": "stretch_width"}
# As many columns of figures as fit.
GRID = {"display": "grid", "grid-template-columns": "repeat(auto-fit, minmax(min(400px, 100%), 1fr))"}

# Of the text of the page.
TEXT = """
:host { font-family: system-ui, sans-serif; }
.asperity-answers td { padding: 1px 10px 1px 0; vertical-align: top; overflow-wrap: anywhere; }
.asperity-answers td:first-child { opacity: 0.75; white-space: nowrap; }
"""


class Page:
    """One tab: it has its own wall, its own answers and its own computation.

    Parameters
    ----------
    wall : Wall
        Shown first.
    name : str
        A named wall, or what the wall is called.
    parameters : dict
        Of a named wall.
    out : Path, optional
        Folder into which walls and studies are written; otherwise the browser takes them.

    Attributes
    ----------
    question, answer
        Of the last valid wall: what is asked, and the best answer so far or None.
    message : str
        Why the last wall was refused; empty if it was not.
    """

    def __init__(
        self, wall: Wall, name: str, parameters: dict[str, float | int] | None = None, out: Path | None = None
    ) -> None:
        self.question = Question(wall, name, of_catalogue=name in WALLS)
        self.answer: Answer | None = None
        self.message = ""
        self._out = out
        self._background, self._saving = Background(), Background()
        self._dragging = self._filling = self._awaited = False
        self._picture: drawing.Picture | None = None
        # when the answer that is shown goes, if no other has come
        self._due: float | None = None
        self._sent: tuple[str, bytes] | None = None
        self._archive: bytes | None = None
        self._was_busy = False
        self._make_figures()
        self._make_controls(parameters or {})
        self.ask(wall, name, of_catalogue=self.question.of_catalogue)
        if pn.state.curdoc is not None and pn.state.curdoc.session_context is not None:
            pn.state.add_periodic_callback(self.collect, INTERVAL)

    def _make_figures(self) -> None:
        self.wall_figure, self.kernel = drawing.WallFigure(), drawing.KernelFigure()
        self.spectrum, self.collision = drawing.SpectrumFigure(), drawing.CollisionFigure()
        self.wall_figure.vertices.on_change("data", self._vertices_changed)
        self.wall_figure.plot.on_event(PanStart, self._drag_begins)
        self.wall_figure.plot.on_event(PanEnd, self._drag_ends)

    def _make_controls(self, parameters: dict[str, float | int]) -> None:
        name = self.question.name
        chosen = name if self.question.of_catalogue else DRAWN
        self.choice = pn.widgets.Select(name="Wall", options=[*WALLS, DRAWN], value=chosen, **STRETCH)
        self.sliders = pn.Column(margin=0, **STRETCH)
        self.parameters: dict[str, Any] = {}
        self.mass = _slider("mass of the disk", *RANGES["mass"], self.question.disk.mass)
        ratio = self.question.disk.inertia_ratio
        self.inertia_ratio = _slider("inertia ratio J/(m r²) of the disk", *RANGES["inertia_ratio"], ratio)
        self.diffuse = _slider("diffuse fraction of the facets", *RANGES["diffuse_fraction"], 0.0)
        self.convention = pn.widgets.RadioButtonGroup(
            name="Convention", options=CONVENTIONS, value="paper", orientation="vertical", **STRETCH
        )
        self.foreshortened = pn.widgets.Toggle(name="Foreshorten: the wall as the disk feels it", **STRETCH)
        self.file = pn.widgets.FileInput(name="Wall file or profile", **STRETCH)
        self.options = pn.widgets.TextInput(name="Options of a profile", placeholder="seam=step,units=um/nm", **STRETCH)
        self.reading = {
            key: pn.widgets.Select(name=f"{title} of a profile", options={"as found": "", **words}, value="", **STRETCH)
            for key, (title, words) in READING.items()
        }
        self.status, self.table, self.saved = (pn.pane.HTML("", stylesheets=[TEXT], **STRETCH) for _ in range(3))
        self._make_saving()
        self._make_sliders(parameters)
        self.choice.param.watch(lambda _: self._wall_chosen(), "value")
        self.file.param.watch(lambda _: self._file_sent(), "value")
        for field in (self.options, *self.reading.values()):
            field.param.watch(lambda _: self._open_file(), "value")
        for widget in (self.mass, self.inertia_ratio, self.diffuse, self.convention, self.foreshortened):
            widget.param.watch(lambda _: self._ask_again(), "value")

    def _make_saving(self) -> None:
        self.study = pn.widgets.Button(name="Make the study", button_type="primary", **STRETCH)
        self.study.on_click(lambda _: self._study())
        if self._out is None:
            self.save: Any = pn.widgets.FileDownload(
                callback=lambda: io.BytesIO(wall_as_toml(self.question.seen)), filename="wall.toml",
                label="Save the wall", **STRETCH,
            )  # fmt: skip
            self.take: Any = pn.widgets.FileDownload(
                callback=lambda: io.BytesIO(self._archive or b""), filename="study.zip", label="Take the study",
                visible=False, **STRETCH,
            )  # fmt: skip
        else:
            self.save = pn.widgets.Button(name="Save the wall", **STRETCH)
            self.save.on_click(lambda _: self._write_wall())
            self.take = pn.Spacer(height=0)

    def _make_sliders(self, parameters: dict[str, float | int]) -> None:
        entry = WALLS.get(self.choice.value)
        defaults = {**entry.defaults, **parameters} if entry else {}
        _forget(self.parameters.values())
        self.parameters = {key: _slider(key, *RANGES[key], value) for key, value in defaults.items()}
        for slider in self.parameters.values():
            slider.param.watch(lambda _: self._parameters_moved(), "value")
        self.sliders[:] = list(self.parameters.values())

    def view(self) -> Any:
        """Everything, in columns that wrap on narrow screens, the answers first."""
        figures = (self.wall_figure, self.kernel, self.spectrum, self.collision)
        panes = [pn.pane.Bokeh(figure.plot, margin=4, **STRETCH) for figure in figures]
        controls = pn.Column(
            self.choice, self.sliders, self.mass, self.inertia_ratio, self.diffuse, self.foreshortened, self.convention,
            self.file, *self.reading.values(), self.options, self.save, self.study, self.take, self.saved,
            styles={"flex": "1 1 240px", "min-width": "240px"}, margin=4,
        )  # fmt: skip
        title = pn.pane.HTML("<h2 style='margin: 4px 0'>asperity explore</h2>", stylesheets=[TEXT])
        plots = pn.Column(*panes, styles=GRID, margin=0, **STRETCH)
        shown = pn.Column(self.status, self.table, plots, styles={"flex": "5 1 300px", "min-width": "0"}, margin=4)
        both = pn.FlexBox(shown, controls, flex_direction="row-reverse", align_items="flex-start", **STRETCH)
        return pn.Column(title, both, **STRETCH)

    # -- what the user does

    def _wall_chosen(self) -> None:
        if self._filling:
            return
        self._sent = None
        self._make_sliders({})
        if self.choice.value in WALLS:
            self._parameters_moved()
        else:
            # the wall where it is a polygon that can be dragged already, or a plain one
            points = draggable_vertices(self.question.wall)
            self._ask_polygon(points or [(0, 0), (0.3, -0.5), (0.6, -0.2), (1, 0)])

    def _ask_polygon(self, points: Any) -> None:
        self._sent = None
        self.ask(partial(Wall.from_vertices, points, self.question.wall.unit), "polygon")

    def _parameters_moved(self) -> None:
        if self._filling:
            return
        for key, slider in self.parameters.items():
            # what is sent to the server need not come from the slider
            start, end = slider.start or 0, slider.end or 0
            if isinstance(slider, pn.widgets.IntSlider) and not start <= (slider.value or 0) <= end:
                self._refuse(f"{key}: expected {start} to {end}, got {slider.value}; use the slider")
                return
        name, values = self.choice.value, ",".join(f"{key}={one.value!r}" for key, one in self.parameters.items())
        self.ask(partial(wall_from_text, f"{name}:{values}"), name, of_catalogue=True)

    def _file_sent(self) -> None:
        if self.file.value:
            self._sent = str(self.file.filename), self.file.value
            self._open_file()

    def _open_file(self) -> None:
        """Ask for the file that came last with the options as they are now, unless another wall was chosen since."""
        if self._sent is not None:
            name, content = self._sent
            chosen = [f"{key}={field.value}" for key, field in self.reading.items() if field.value]
            options = "" if name.lower().endswith(".toml") else ",".join(filter(None, [self.options.value, *chosen]))
            self.ask(partial(opened, name, content, options), Path(name).stem)

    def _choose(self, choice: str) -> None:
        """Set the choice without asking for its wall."""
        self._filling = True
        self.choice.value = choice
        self._make_sliders({})
        self._filling = False

    def _drag_begins(self, _event: Any) -> None:
        self._dragging = True

    def _drag_ends(self, _event: Any) -> None:
        self._dragging = False
        if not self._awaited:
            self._show(self.answer)

    def _vertices_changed(self, _name: str, _old: Any, new: Any) -> None:
        number = len(new["x"])
        if number > MOST_HANDLES:
            self._refuse(f"expected at most {MOST_HANDLES} vertices to drag, got {number}; open a file instead")
            self._show(self.answer)
            return
        points = list(zip(new["x"], new["y"], strict=True))
        before = [] if self._picture is None else self._picture.question.handles
        if points == before and not self._awaited:
            return
        if len(points) == len(before) + 1 and not self._dragging:
            points = with_new_vertex(points)
        if len(points) < 2:
            # a curved wall has no vertices to add to, and one vertex is not a wall
            self._refuse(f"this wall has no vertices to drag; choose a polygon of at most {MOST_HANDLES}")
            self._show(self.answer)
            return
        self._ask_polygon(pinned(points, self.question.wall.period))

    # -- what it does

    def _refuse(self, reason: str) -> None:
        """Say why, and leave the last valid wall and its answer as they are."""
        self.message = reason
        self._show_status()

    def ask(self, wall: Wall | Callable[[], Wall], name: str, *, of_catalogue: bool = False) -> None:
        """Begin to make a wall and its answers in another process; the last wall stays until they come."""
        try:
            disk = Disk(float(self.mass.value), float(self.inertia_ratio.value))
            fraction = number_between("diffuse fraction", self.diffuse.value, 0.0, 1.0, closed="low high")
        except AsperityError as reason:
            self._refuse(str(reason))
            return
        self.message, self._awaited, self._asked = "", True, (wall, name, of_catalogue)
        self._due = self._due or time.monotonic() + GRACE
        # three results, so that a wall that is dragged has answers and not pictures alone
        self._background.ask(
            drawing.pictured_and_answered, wall, name, disk, self.convention.value, bool(self.foreshortened.value),
            of_catalogue, fraction, first=3,
        )  # fmt: skip
        self._show_status()

    def _ask_again(self) -> None:
        """Ask for the wall that is awaited, or else the last valid one, with the disk and convention chosen now."""
        last = self.question.wall, self.question.name, self.question.of_catalogue
        wall, name, of_catalogue = self._asked if self._awaited else last
        self.ask(wall, name, of_catalogue=of_catalogue)

    def _show(self, answer: Answer | None) -> None:
        """Show the last valid wall, with its vertices unless others are awaited, and an answer or "computing"."""
        self._due = None
        answer = answer or Answer("computing")
        self.table.object = answer_as_html(answer)
        for figure in (self.kernel, self.spectrum, self.collision):
            figure.show(answer)
        # last, so that no old answer is under a new wall even for a moment: messages arrive one by one
        if self._picture is not None:
            self.wall_figure.show(self._picture, dragged=self._dragging or self._awaited)

    def collect(self) -> None:
        """Show the results that have come."""
        outdated = self._background.outdated
        for error, result in self._background.collect():
            if error is not None:
                self._failed(error, outdated=outdated)
            elif isinstance(result, drawing.Picture):
                self._came(result, outdated=outdated)
            else:
                self.answer = result
                self._show(result)
                # an answer of the wall before the one that is awaited
                self._due = time.monotonic() + GRACE if self._awaited else None
            self._show_status()
        if self._due is not None and time.monotonic() > self._due:
            self._show(None if self._awaited else self.answer)
        for error, archive in self._saving.collect():
            self._study_came(error, archive)
        if self._was_busy != self._background.busy:
            self._was_busy = self._background.busy
            self._show_status()

    def _came(self, picture: drawing.Picture, *, outdated: bool) -> None:
        """Take a valid wall, which is shown with its first answer, or without when the time is over."""
        if self._picture is None or picture.question != self.question:
            self.answer = None
        self._picture, self.question, self._awaited = picture, picture.question, outdated
        if not self.question.of_catalogue and self.choice.value != DRAWN:
            self._choose(DRAWN)

    def _failed(self, error: str, *, outdated: bool) -> None:
        """Say why there is no wall or no answer; of a wall that has been replaced nothing is said."""
        if outdated:
            return
        refused, self._awaited = self._awaited, False
        if refused:
            # else a browser does not send the same file again
            self.file.clear()
            self._show(self.answer)
            if self._picture is not None and not (self.answer and self.answer.finished):
                # go on with the last valid wall
                self._ask_again()
                self._awaited = False
        else:
            self.answer = (self.answer or Answer("ended")).ended(error)
            self._show(self.answer)
        self.message = error

    def _show_status(self) -> None:
        if self.message:
            role, style = "alert", "background: #D55E0030; border-left: 4px solid #D55E00"
            text = f"{html.escape(self.message)}. The last valid answer stays."
        elif self._background.busy:
            role, style = "status", "border-left: 4px solid #56B4E9"
            known = "" if self._awaited or self.answer is None else self.answer.stage
            text = f"refining; known so far: {known}" if known else "computing"
        else:
            role, style, text = "status", "border-left: 4px solid #009E73", "done"
        self.status.object = f"<div role='{role}' style='{style}; padding: 6px'>{text}</div>"

    # -- saving

    def _write_wall(self) -> None:
        assert self._out is not None
        try:
            file = new_folder(self._out, self.question.name) / "wall.toml"
            self.question.seen.save(file)
        except AsperityError as reason:
            self._tell(str(reason))
        else:
            self._tell(f"wrote {file}")

    def _study(self) -> None:
        self._archive, self.study.disabled = None, True
        self._studied_name = plain_name(self.question.name)
        self._tell("the study is being made, some seconds to a minute")
        self._saving.ask(studied, self.question)

    def _study_came(self, error: str | None, archive: bytes | None) -> None:
        self.study.disabled = False
        if error is not None or archive is None:
            self._tell(f"no study: {error}")
        elif self._out is None:
            self._archive, self.take.visible = archive, True
            self.take.filename = f"{self._studied_name}.zip"
            self._tell("the study is ready")
        else:
            try:
                self._tell(f"wrote {unpacked(archive, self._out, self._studied_name)}")
            except AsperityError as reason:
                self._tell(str(reason))

    def _tell(self, text: str) -> None:
        self.saved.object = f"<div role='log'>{html.escape(text)}</div>"

    def close(self) -> None:
        """End the computations, and let go of the widgets."""
        self._background.drop()
        self._saving.drop()
        _forget([self.mass, self.inertia_ratio, self.diffuse, *self.parameters.values()])


def _slider(name: str, low: float, high: float, value: float) -> Any:
    if isinstance(low, int):
        return pn.widgets.IntSlider(name=name, start=low, end=max(int(high), int(value)), value=int(value), **STRETCH)
    span: dict[str, float] = {"start": min(low, value), "end": max(high, value), "value": float(value)}
    return pn.widgets.EditableFloatSlider(name=name, fixed_start=0.0, step=0.01, **span, **STRETCH)


def _forget(sliders: Iterable[Any]) -> None:
    """Remove sliders from panel's list of callbacks, in which each would hold itself and its page for ever."""
    for slider in sliders:
        for part in slider.select():
            pn.links.Callback.registry.pop(part, None)


def answer_as_html(answer: Answer) -> str:
    """The numbers of an answer with their errors, as a table.

    Examples
    --------
    >>> "computing" in answer_as_html(Answer("coarse"))
    True
    """
    gap, momentum, matrix = answer.gap, answer.accommodation, answer.kernel
    rows = dict.fromkeys(("gap", "accommodation", "kernel", "collision"), "computing")
    if gap is not None and gap.verdict == "no gap":
        rows["gap"] = f"<b>0</b>, no gap ({html.escape(gap.evidence[0])}); {gap.convention} convention"
    elif gap is not None:
        name = "" if gap.self_adjoint else "1 - norm on functions of mean 0: "
        # a value of which no digit is known is shown as the interval
        known = (
            str(gap) if gap.error < gap.value else f"{max(gap.value - gap.error, 0.0):g} to {gap.value + gap.error:.2g}"
        )
        value = f"{name}<b>{html.escape(known)}</b>"
        rows["gap"] = f"{value}, {gap.verdict}, error {gap.error:.1e} ({gap.kind}); {gap.convention} convention"
        rows["by"] = html.escape(gap.method)
    if momentum is not None:
        resistance = resistance_from(momentum)
        rows["accommodation"] = (
            f"of momentum: tangential <b>{momentum.tangential}</b>, normal <b>{momentum.normal}</b>; "
            f"resistance of a tumbling body <b>{resistance}</b>, of a smooth one 1 ({resistance.kind})"
        )
    if matrix is not None:
        kernel = f"{matrix.basis!r}, {matrix.method}, Frobenius error {float(matrix.error):.1e} ({matrix.error.kind})"
        rows["kernel"] = html.escape(kernel)
    if answer.collision is not None:
        mean = answer.collision.mean
        rows["collision"] = f"mean outgoing v1 <b>{html.escape(str(mean))}</b>, error {mean.error:.1e}, {mean.method}"
    rows |= {quantity: f"refused: {html.escape(reason)}" for quantity, reason in answer.refusals.items()}
    cells = "".join(f"<tr><td>{title}</td><td>{text}</td></tr>" for title, text in rows.items())
    return f"<table class='asperity-answers'>{cells}</table>"
