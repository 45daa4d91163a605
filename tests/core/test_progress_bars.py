"""Progress: bars on a terminal and in a notebook, and lines elsewhere."""

import io
import multiprocessing
import re
import sys
import time
from types import ModuleType

import numpy as np
import pytest
import tqdm.auto
import tqdm.std

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import long_runs
from asperity.core.long_runs import progress_bar
from asperity.kernels.discretisation import discretisation


class Terminal(io.StringIO):
    def isatty(self):
        return True


def written(monkeypatch, stream, seconds=0.0):
    """The stream, which takes the place of standard error; in a fixture pytest would take it away again."""
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.delenv(long_runs.QUIET, raising=False)
    monkeypatch.setattr(long_runs, "SLOW_SECONDS", seconds)
    monkeypatch.setattr(long_runs, "RENEWED_SECONDS", 0.0)
    return stream


def shown(count=3):
    """Whether the bar is not silent."""
    with progress_bar(count, "part", "work") as bar:
        for _ in range(count):
            bar.update()
        return bar.bar is not None and not bar.bar.disable


def test_a_bar_appears_on_a_terminal_after_two_seconds_and_nowhere_else(monkeypatch):
    terminal = written(monkeypatch, Terminal(), long_runs.SLOW_SECONDS)
    assert shown() and terminal.getvalue() == "" and long_runs.SLOW_SECONDS == 2.0
    terminal = written(monkeypatch, Terminal())
    assert shown() and "work" in terminal.getvalue() and "part" in terminal.getvalue()
    other = written(monkeypatch, io.StringIO())
    assert not shown() and other.getvalue() == ""
    # nor does a worker on the terminal of its parent
    monkeypatch.setattr(multiprocessing, "parent_process", object)
    terminal = written(monkeypatch, Terminal())
    assert not shown() and terminal.getvalue() == ""


def test_the_bar_of_an_ensemble_and_of_a_sweep_say_what_they_are(monkeypatch):
    def family(rng=1, fraction=0.5):
        return ker.maxwell(np.random.default_rng(rng).uniform() * fraction)

    terminal = written(monkeypatch, Terminal())
    spec.ensemble(family, 4, "gap", progress=True)
    assert "ensemble" in terminal.getvalue() and "sweep" not in terminal.getvalue()
    terminal = written(monkeypatch, Terminal())
    spec.sweep(family, {"fraction": [0.1, 0.2]}, "gap", progress=True)
    assert "sweep" in terminal.getvalue() and "ensemble" not in terminal.getvalue()


def test_in_a_notebook_a_bar_is_shown_although_standard_error_is_no_terminal(monkeypatch):
    stream = written(monkeypatch, io.StringIO())
    notebook = ModuleType("tqdm.notebook")
    notebook.tqdm_notebook = type("tqdm_notebook", (tqdm.std.tqdm,), {})
    monkeypatch.setitem(sys.modules, "tqdm.notebook", notebook)
    assert not shown()
    monkeypatch.setattr(tqdm.auto, "tqdm", type("tqdm", (notebook.tqdm_notebook,), {}))
    assert shown() and "work" in stream.getvalue()


def sampled():
    rng = np.random.default_rng(0)
    theta = [ker.SINE.sample(500, rng) for _ in range(4)]
    return [ker.estimate(*theta[k : k + 2], ker.Bins(4)) for k in (0, 2)]


def pocket():
    """A wall with straight sides and a curved bottom."""
    bottom = geo.Bezier([(0.3, -0.6), (0.5, -0.8), (0.7, -0.6)])
    return geo.Wall([geo.Segment((0.0, 0.0), (0.3, -0.6)), bottom, geo.Segment((0.7, -0.6), (1.0, 0.0))])


@pytest.mark.parametrize(
    ("work", "words"),
    [
        (
            lambda: spec.spectral_gap(0.5 * ker.CircularArcLaw(1.2) + 0.5 * ker.henyey_greenstein(0.3), 1e-2),
            ("gap", "step"),
        ),
        (lambda: ker.distance(ker.henyey_greenstein(0.3), ker.henyey_greenstein(0.5)), ("distance", "angle")),
        (lambda: ker.distance(*sampled(), kind="joint"), ("distance", "transport")),
        (lambda: ker.distance(*sampled()), ("distance: error", "sample")),
        (lambda: ker.difference_test(*sampled()), ("test", "permutation")),
        (lambda: spec.enclosures(ker.CircularArcLaw(1.2), 2, tolerance=1e-8), ("enclosures", "level", "residual")),
        (lambda: spec.essential_edge(ker.WallLaw(pocket())), ("essential edge", "layer")),
    ],
    ids=["gap", "distance", "transport", "error of a distance", "test", "enclosures", "essential edge"],
)
def test_long_computations_have_bars(monkeypatch, work, words):
    terminal = written(monkeypatch, Terminal())
    work()
    assert all(word in terminal.getvalue() for word in words)


@pytest.mark.parametrize("form", ["profile", "wall"])
def test_long_files_are_counted_by_a_bar_and_short_ones_are_not(monkeypatch, tmp_path, form):
    terminal = written(monkeypatch, Terminal())
    monkeypatch.setattr(long_runs, "MANY", 100)
    for count, shown in ((50, False), (201, True)):
        x = np.arange(count) / (count - 1.0)
        if form == "profile":
            (tmp_path / "long.txt").write_text("\n".join(f"{at} {at * (1.0 - at)}" for at in x))
            geo.read_profile(tmp_path / "long.txt")
        else:
            geo.Wall.from_vertices(np.column_stack([x, -x * (1.0 - x)])).save(tmp_path / "wall.toml", overwrite=True)
            geo.load_wall(tmp_path / "wall.toml")
        assert (("line" if form == "profile" else "piece") in terminal.getvalue()) is shown


def reports(monkeypatch, work, seconds=0.05):
    """The lines that a work writes where standard error is no terminal, with short intervals."""
    monkeypatch.setattr(long_runs, "REPORTED_SECONDS", 4.0 * seconds)
    monkeypatch.setattr(long_runs, "PREDICTED_SECONDS", seconds)
    stream = written(monkeypatch, io.StringIO())
    work()
    return stream.getvalue().splitlines()


def slow_parts(count=8, seconds=0.1):
    with long_runs.reported("study"), progress_bar(count, "part") as bar:
        for _ in range(count):
            time.sleep(seconds)
            bar.describe("error 0.1")
            bar.update()


def test_without_a_terminal_lines_say_what_is_done_and_left(monkeypatch):
    assert long_runs.REPORTED_SECONDS == 10.0 and long_runs.PREDICTED_SECONDS == 1.0
    found = reports(monkeypatch, slow_parts)
    assert 3 <= len(found) <= 6 and not long_runs.Progress.running
    # the first predicts, as soon as a part is done
    line = r"asperity: study: \d s, (\d) of 8 parts, error 0\.1, about \d s left"
    counts = [int(re.fullmatch(line, text)[1]) for text in found]
    assert counts == sorted(counts) and counts[0] <= 2


def test_what_its_size_predicts_to_be_long_is_said_before(monkeypatch):
    def work():
        with long_runs.reported("matrix", 40.0, 3e9), long_runs.reported("its part", 20.0, 1e9):
            pass

    assert reports(monkeypatch, work) == ["asperity: matrix: about 40 s and 3.0 GB of memory"]
    # time of an entry by the time of this matrix, of 2^22 entries
    assert 10.0 < discretisation.SECONDS * 8000**2 < 60.0


def test_short_work_and_a_quiet_process_report_nothing(monkeypatch):
    assert reports(monkeypatch, lambda: slow_parts(1), seconds=1.0) == []
    stream = written(monkeypatch, io.StringIO())
    monkeypatch.setenv("ASPERITY_QUIET", "1")
    with long_runs.reported("matrix", 40.0):
        slow_parts()
    assert stream.getvalue() == ""
