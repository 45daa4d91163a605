"""The table of the paper's objects: each name exists; and the figures of the paper: each is drawn by one call."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import asperity
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.cli import main as command

DOCS = Path(__file__).parents[1] / "docs"
ROOMS = {"geo": geo, "ker": ker, "spec": spec}
ROWS = [
    tuple(cell.strip() for cell in line.strip("|").split(" | "))
    for line in (DOCS / "papers-objects.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and not line.startswith(("|---", "| object"))
]
NAMES = sorted({name for row in ROWS for name in re.findall(r"`([^`]+)`", row[-1].strip(" |"))})


def load_figures():
    spec_of = importlib.util.spec_from_file_location("paper_figures", DOCS / "examples" / "paper_figures.py")
    module = importlib.util.module_from_spec(spec_of)
    spec_of.loader.exec_module(module)
    return module


FIGURES = load_figures()


def test_every_row_has_an_object_a_section_and_a_name_or_the_words_not_yet():
    assert len(ROWS) > 70
    for row in ROWS:
        assert len(row) == 3, row
        name = row[2].strip(" |")
        assert name == "not yet" or re.fullmatch(r"`[^`]+`(, `[^`]+`)*", name), row


@pytest.mark.parametrize("name", NAMES)
def test_every_name_of_the_table_exists(name, capsys):
    if name.startswith("asperity "):
        with pytest.raises(SystemExit) as left:
            command([name.split()[1], "--help"])
        assert left.value.code == 0
        assert name.split()[1] in capsys.readouterr().out
        return
    room, *parts = name.split(".")
    assert parts[0] in ROOMS[room].__all__
    found = getattr(ROOMS[room], parts[0])
    for part in parts[1:]:
        # fields of dataclasses without default are no attributes of the class
        assert hasattr(found, part) or part in found.__dataclass_fields__, name


def test_a_name_that_does_not_exist_would_be_found():
    assert not hasattr(geo.Wall, "no_such_property")
    assert "no_such_name" not in geo.__all__ and asperity.__version__


def test_the_paper_has_eighteen_figures_with_captions():
    names = [figure.__name__ for figure in FIGURES.FIGURES]
    assert len(names) == len(set(names)) == 18
    assert all(re.search(r"\(section \d.*\)\.$", figure.__doc__) for figure in FIGURES.FIGURES)
    assert FIGURES.page().count("```{figure}") == 18


@pytest.mark.parametrize("figure", FIGURES.FIGURES, ids=lambda figure: figure.__name__)
def test_every_figure_is_drawn_by_one_call(figure):
    drawn = figure()
    drawn.set_dpi(40)
    canvas = FigureCanvasAgg(drawn)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    # neither empty nor full
    assert 0.005 < np.mean(np.any(pixels < 250, axis=-1)) < 0.95


def test_all_figures_are_written_with_their_number(tmp_path, monkeypatch):
    monkeypatch.setattr(FIGURES, "FIGURES", FIGURES.FIGURES[2:4])
    assert FIGURES.main(tmp_path / "figures") == {"figures": 2}
    assert all(path.stat().st_size > 2000 for path in (tmp_path / "figures").iterdir())
