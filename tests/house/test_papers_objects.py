"""The table of the paper's objects: each name exists; and the figures of the paper: each is drawn by one call."""

import doctest
import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest
from docs.examples import paper_figures as figures
from matplotlib.backends.backend_agg import FigureCanvasAgg

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.cli import main as command

DOCS = Path(__file__).parents[2] / "docs"
ROOMS = {"geo": geo, "ker": ker, "spec": spec}
ROWS = [
    tuple(cell.strip() for cell in line.strip("|").split(" | "))
    for line in (DOCS / "papers-objects.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and not line.startswith(("|---", "| object"))
]
NAMES = sorted({name for row in ROWS for name in re.findall(r"`([^`]+)`", row[-1].strip(" |"))})


def test_every_row_has_an_object_a_section_and_a_name():
    assert len(ROWS) > 70
    for row in ROWS:
        assert len(row) == 3, row
        name = row[2].strip(" |")
        assert re.fullmatch(r"`[^`]+`(, `[^`]+`)*", name), row


def test_every_command_of_the_table_exists():
    assert {name.split()[1] for name in NAMES if name.startswith("asperity ")} <= set(command.commands)


TEETH, DISK = geo.triangular_teeth(math.pi / 2), geo.Disk(1.0, 1 / 3)
SPACE = geo.ConfigurationSpace(TEETH, DISK, 1e-9)
CHARTS = geo.RollingCharts(math.pi / 2)
TOUCHED = [[0.25, 0.5, 0.0]]


def passes_a_distant_body_in_straight_lines():
    small = ker.PolygonalBody([[(0.0, 0.0), (1e-6, 0.0), (0.0, 1e-6)]])
    before, after = small.scatter_in_circle(101, 0, radius=1.0)
    return abs(np.median(np.sin(after[:, 1]) - np.sin(before[:, 1]))) < 1e-12


# Of objects without example in their docstring: a computation whose answer is known.
WORKS = {
    "geo.ConfigurationSpace.contains": lambda: SPACE.contains([[0, 0, 0], [0, -1e-10, 0]]).tolist() == [True, False],
    "geo.ConfigurationSpace.cylinder_contains":
        lambda: SPACE.cylinder_contains([[0, 0, 0], [0, -1e-10, 0]]).tolist() == [True, False],
    "geo.ConfigurationSpace.gap_radius":
        lambda: math.isclose(2 * math.sin(SPACE.spacing / 2) * math.sin(SPACE.gap_radius), 0.5e-9),
    "geo.ConfigurationSpace.inner_disk": lambda: SPACE.inner_disk.is_clear,
    "geo.ConfigurationSpace.is_single": lambda: SPACE.is_single([0.0, SPACE.spacing / 2]).tolist() == [True, False],
    "geo.Disk.foreshortening": lambda: DISK.foreshortening == 0.5,
    "geo.Disk.frame": lambda: np.allclose(DISK.inner(DISK.frame[:, None], DISK.frame), np.eye(3)),
    "geo.Disk.inner": lambda: DISK.inner([1, 0, 3], [1, 0, 3]) == 4.0,
    "geo.Disk.rolling_momentum": lambda: DISK.rolling_momentum([1, 0, 3]) == 0.0,
    "geo.RollingCharts.bend": lambda: CHARTS.bend(TOUCHED).tolist() == TOUCHED,
    "geo.RollingCharts.contact": lambda: CHARTS.contact(TOUCHED).tolist() == [[0.25, 0.5]],
    "geo.RollingCharts.roll_linear": lambda: CHARTS.roll_linear([1.0, 0.5], 0.25).tolist() == [0.75, 0.5, 0.25],
    "geo.RollingCharts.straighten": lambda: CHARTS.straighten(TOUCHED).tolist() == TOUCHED,
    "geo.Status": lambda: geo.trace(geo.flat(), 0.5, 1.0).status == geo.Status.ESCAPED,
    "geo.Wall.islands": lambda: geo.flat().islands == (),
    "ker.PolygonalBody.scatter_in_circle": lambda: passes_a_distant_body_in_straight_lines(),
    "ker.KernelMatrix.symmetry_defect":
        lambda: ker.discretise(ker.lambertian(), ker.Bins(8)).symmetry_defect().value < 1e-14,
    "ker.SINE_SQUARED": lambda: math.isclose(ker.SINE_SQUARED.mass(0.0, math.pi / 2), 0.5),
    "ker.Law": lambda: isinstance(ker.specular() @ ker.specular(), ker.Law),
}  # fmt: skip


def documentation(name: str) -> str:
    """The docstring of an object of the table; of a property, its own."""
    room, *parts = name.split(".")
    found = ROOMS[room]
    for part in parts:
        found = inspect.getattr_static(found, part, None) if inspect.isclass(found) else getattr(found, part)
    return inspect.getdoc(found) or ""


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("asperity ")])
def test_every_object_of_the_table_works(name):
    # the examples of docstrings are run as tests of their modules
    if name in WORKS:
        assert WORKS[name]()
        return
    examples = doctest.DocTestParser().get_examples(documentation(name))
    assert name.split(".")[-1] in " ".join(example.source for example in examples), name


def test_objects_that_work_by_their_examples_have_no_second_check():
    assert set(WORKS) <= set(NAMES)


def test_the_paper_has_eighteen_figures_with_captions():
    names = [figure.__name__ for figure in figures.FIGURES]
    assert len(names) == len(set(names)) == 18
    assert all(re.search(r"\(section \d.*\)\.$", figure.__doc__) for figure in figures.FIGURES)
    assert figures.page().count("```{figure}") == 18


@pytest.mark.parametrize("figure", figures.FIGURES, ids=lambda figure: figure.__name__)
def test_every_figure_is_drawn_by_one_call(figure):
    drawn = figure()
    drawn.set_dpi(40)
    canvas = FigureCanvasAgg(drawn)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    # neither empty nor full
    assert 0.005 < np.mean(np.any(pixels < 250, axis=-1)) < 0.95


def test_all_figures_are_written_with_their_number(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "FIGURES", figures.FIGURES[2:4])
    assert figures.main(tmp_path / "figures") == {"figures": 2}
    assert all(path.stat().st_size > 2000 for path in (tmp_path / "figures").iterdir())
