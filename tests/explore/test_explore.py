"""The model of the page: questions, answers with errors, computations that are dropped, files. No browser is needed."""

import io
import os
import time
import zipfile
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from asperity import cli
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.explore.answers import (
    Answer,
    Question,
    answers_to,
    first_answer,
    histogram,
    largest_gap,
    pinned,
    with_new_vertex,
)
from asperity.explore.background import GONE, Background
from asperity.explore.drawing import pictured, pictured_and_answered
from asperity.explore.files import LARGEST, new_folder, opened, plain_name, studied, unpacked, wall_as_toml
from asperity.explore.server import _called
from asperity.study.result import resistance_from

pytestmark = pytest.mark.filterwarnings(
    "ignore:.* is deprecated and will be removed in version 2:PendingDeprecationWarning"
)

TEETH = geo.Wall.from_vertices([(0, 0), (0.3, -0.6), (0.5, -0.1), (0.7, -0.8), (1, 0)])
# Walls, and their gaps by `spectral_gap`, to 2e-4 of themselves.
CURVED = {
    "focusing arcs": (geo.focusing_arcs(1.2), 0.632975),
    "nearly semicircles": (geo.focusing_arcs(1.5), 0.386950),
    "dispersing arcs": (geo.dispersing_arcs(1.5), 0.7868),
    "mushrooms": (geo.mushrooms(0.5, 0.0, 1), 0.03790188),
    "thin mushrooms": (geo.mushrooms(0.05, 0.5, 1), 7.561507e-5),
    "two generations": (geo.mushrooms(0.2, 0.5, 2), 0.006704133),
    "parabolas": (geo.double_parabola(), 0.0),
}


def test_pinned_vertices_span_the_period_and_stay_below_the_top():
    points = pinned([(0.2, -0.3), (0.4, 0.1), (0.6, -0.5), (0.9, -0.2)], 2.0)
    assert points == [(0.0, 0.0), (0.4, 0.0), (0.6, -0.5), (2.0, 0.0)]
    assert pinned(points, 2.0) == points


@pytest.mark.parametrize("k", range(4))
def test_a_new_vertex_joins_the_side_that_it_lies_on(k):
    old = TEETH.vertices.tolist()
    middle = 0.5 * (TEETH.vertices[k] + TEETH.vertices[k + 1])
    joined = with_new_vertex([*old, middle])
    assert joined == [*map(tuple, old[: k + 1]), tuple(middle.tolist()), *map(tuple, old[k + 1 :])]
    assert geo.Wall.from_vertices(joined).arc_length == pytest.approx(TEETH.arc_length, rel=1e-15)


@pytest.mark.parametrize("name", CURVED)
def test_the_first_interval_of_the_gap_holds_the_gap_of_the_law(name):
    wall, known = CURVED[name]
    first = first_answer(Question(wall, name)).gap
    assert first.verdict == "undecided"
    assert abs(first.value - known) <= first.error + 2e-4 * known


def test_the_first_interval_holds_the_gap_for_95_of_100_generators():
    law = ker.WallLaw(geo.dispersing_arcs(1.0))
    known = 0.716163
    high = [
        2.0 * largest_gap(ker.discretise(law, ker.Bins(48), "qmc", samples=2**13, rng=seed)).value for seed in range(40)
    ]
    assert np.mean(np.array(high) >= known) >= 0.95


@pytest.mark.parametrize("convention", ["paper", "specular"])
@pytest.mark.parametrize("wall", [TEETH, geo.triangular_teeth(0.7), geo.flat()], ids=["skew", "symmetric", "flat"])
def test_polygons_are_answered_exactly_at_once(wall, convention):
    first = first_answer(Question(wall, "polygon", convention=convention))
    assert first.kernel.method == "exact"
    assert first.kernel.frame == convention
    assert float(first.kernel.error) < 1e-10
    assert (first.gap.value, first.gap.error, first.gap.verdict) == (0.0, 0.0, "no gap")


def test_answers_improve_and_agree_with_each_other():
    found = list(answers_to(Question(geo.focusing_arcs(0.4), "arcs")))
    errors = [answer.gap.error for answer in found]
    assert all(later <= earlier for earlier, later in pairwise(errors))
    assert errors[-1] <= 1e-6
    assert [answer.finished for answer in found] == [False] * (len(found) - 1) + [True]
    for earlier, later in pairwise(found):
        assert abs(earlier.gap.value - later.gap.value) <= earlier.gap.error + later.gap.error
        mine, yours = earlier.collision.mean, later.collision.mean
        assert abs(mine.value - yours.value) <= 2.0 * (mine.error + yours.error)
    assert found[-1].spectrum.of == "the law"
    assert found[-1].spectrum.values[1] == pytest.approx(1.0 - found[-1].gap.value, abs=1e-4)


def test_intervals_of_the_histogram_hold_the_probabilities():
    rng, disk = np.random.default_rng(5), geo.Disk()
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(1.2), disk)
    sample = lambda n: law.sample(np.tile([1.0, -1.0, 0.0], (n, 1)), rng)[:, 0]  # noqa: E731
    true = histogram(sample(2**18), disk).fractions
    held = [(h.low <= true) & (true <= h.high) for h in (histogram(sample(2**9), disk) for _ in range(40))]
    assert np.mean(held) >= 0.95
    assert histogram(sample(2**9), disk).fractions.sum() == pytest.approx(1.0)


def test_a_flat_wall_lets_the_smooth_disk_go_on():
    found = first_answer(Question(geo.flat(), "flat")).collision
    assert found.smooth == pytest.approx(1.0, abs=1e-15)
    assert abs(found.mean.value - 1.0) <= found.mean.error


def test_the_histogram_reaches_the_extreme_velocities_of_energy_and_rolling_momentum():
    disk = geo.Disk(2.0, 0.35)
    incoming = np.array([1.0, -1.0, 0.0])
    edges = histogram(np.array([0.5, 0.5]), disk).edges
    for velocity in edges[[0, -1]]:
        # the outgoing disk has no normal velocity then
        spin = (disk.rolling_momentum(incoming) + disk.mass * velocity) / disk.rim_mass
        outgoing = np.array([velocity, 0.0, spin])
        assert disk.rolling_momentum(outgoing) == pytest.approx(disk.rolling_momentum(incoming))
        assert disk.inner(outgoing, outgoing) == pytest.approx(disk.inner(incoming, incoming))


def test_foreshortening_shows_the_law_that_the_disk_feels():
    disk = geo.Disk(1.0, 0.5)
    first = first_answer(Question(TEETH, "teeth", disk, foreshortened=True))
    felt = ker.discretise(ker.WallLaw(TEETH.foreshorten(disk)), first.kernel.basis)
    assert np.abs(first.kernel.array - felt.array).max() < 1e-12
    plain = first_answer(Question(TEETH, "teeth", disk)).collision
    assert np.array_equal(first.collision.fractions, plain.fractions)


def test_a_diffuse_fraction_of_the_facets_changes_law_and_collision_and_teeth_gain_a_gap():
    disk, facets = geo.Disk(1.0, 0.5), ker.maxwell(0.5)
    question = Question(TEETH, "teeth", disk, diffuse_fraction=0.5)
    assert question.law == ker.FacetedLaw(TEETH, facets)
    assert question.collision.law == ker.FacetedLaw(TEETH.foreshorten(disk), facets)
    first = first_answer(question)
    assert first.kernel.method == "qmc" and first.gap.verdict == "undecided" and first.gap.value > 0.1
    mirrors = first_answer(replace(question, diffuse_fraction=0.0))
    assert mirrors.gap.verdict == "no gap" and mirrors.kernel.method == "exact"
    moved = first.collision.mean.value - mirrors.collision.mean.value
    assert abs(moved) > first.collision.mean.error + mirrors.collision.mean.error


def test_a_refusal_replaces_an_earlier_one():
    answer = Answer("coarse").refused("first", "gap", "spectrum").refused("second", "gap")
    assert answer.refusals == {"gap": "second", "spectrum": "first"}


# -- computations of other processes


def two_numbers():
    yield from (1, 2)


def never():
    time.sleep(600)
    yield 0


def one_and_never():
    yield 1
    yield from never()


def refuses():
    raise InputError("no such wall")
    yield


def dies():
    os._exit(9)
    yield


def one_and_dies():
    yield 1
    yield from dies()


def results(background, seconds=60.0):
    found, end = [], time.monotonic() + seconds
    while background.busy and time.monotonic() < end:
        found += background.collect()
        time.sleep(0.01)
    return found


@pytest.fixture
def background():
    made = Background()
    yield made
    made.drop()


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        (two_numbers, [(None, 1), (None, 2)]), (refuses, [("no such wall", None)]), (dies, [(GONE, None)]),
        (one_and_dies, [(None, 1), (GONE, None)]),
    ],
)  # fmt: skip
def test_answers_refusals_and_the_end_of_a_process_come_in_order(background, asked, found):
    background.ask(asked)
    assert results(background) == found


def test_a_new_question_ends_the_computation_of_the_old_one(background):
    background.ask(one_and_never)
    while not background.collect():
        time.sleep(0.01)
    old = background._process
    background.ask(two_numbers)
    assert results(background) == [(None, 1), (None, 2)]
    with pytest.raises(ValueError, match="closed"):
        old.is_alive()


def test_a_computation_without_first_answer_is_dropped_after_some_patience(background, monkeypatch):
    monkeypatch.setattr("asperity.explore.background.PATIENCE", 0.3)
    background.ask(never)
    background.ask(never)
    background.ask(two_numbers)
    assert results(background) == [(None, 1), (None, 2)]


# -- files


def test_saved_walls_and_profiles_with_their_options_are_opened():
    assert opened("wall.toml", wall_as_toml(geo.focusing_arcs(1.0))) == geo.focusing_arcs(1.0)
    text = b"x [um], height [nm]\n0, 0\n1, 100\n2, 50\n"
    wall = opened("profile.csv", text, "seam=step")
    assert (wall.unit, wall.period) == ("um", 2.0)
    assert wall.depth == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("wall.toml", b"period = [", "wall.toml"),
        ("wall.toml", b"period = 1.0\nvertices = [[0,0],[0.7,-1],[0.2,-0.1],[0.8,-0.2],[0.3,-1],[1,0]]", "cross"),
        ("../../etc/passwd", b"\x00\x01", "passwd"),
        ("profile.txt", b"", "profile.txt"),
    ],
)
def test_wrong_files_are_refused_by_name_and_leave_no_path(name, content, message):
    with pytest.raises(InputError, match=message) as refusal:
        opened(name, content)
    assert "asperity-" not in str(refusal.value)


def test_files_beyond_the_limit_are_refused():
    with pytest.raises(InputError, match="expected at most"):
        opened("wall.toml", bytes(LARGEST + 1))


def test_names_of_files_stay_in_their_folder():
    for name in ("../../a", "/etc/passwd", "..\\..\\a", "a/../..", "", "...", "\x00"):
        assert "/" not in plain_name(name)
        assert plain_name(name).strip(".")


def test_nothing_that_is_saved_replaces_anything(tmp_path):
    (tmp_path / "teeth").mkdir()
    (tmp_path / "teeth" / "wall.toml").write_text("mine")
    assert [new_folder(tmp_path, "teeth").name for _ in range(2)] == ["teeth-2", "teeth-3"]
    assert (tmp_path / "teeth" / "wall.toml").read_text() == "mine"


def test_the_study_holds_its_files_and_the_wall(tmp_path):
    (archive,) = studied(Question(geo.triangular_teeth(0.7), "teeth"))
    names = zipfile.ZipFile(io.BytesIO(archive)).namelist()
    assert set(names) == {
        "collision.png", "kernel.npz", "kernel.png", "spectrum.png", "study.json", "wall.png", "wall.toml",
    }  # fmt: skip
    folder = unpacked(archive, tmp_path, "teeth")
    assert geo.load_wall(folder / "wall.toml") == geo.triangular_teeth(0.7)
    assert ker.load_matrix(folder / "kernel.npz").method == "exact"


def test_an_out_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another --out"):
        new_folder(tmp_path / "file", "teeth")


# -- one tab does not stop the others

# Seconds of the processor of the server that a message of the browser may take.
MESSAGE = 1.0


@pytest.fixture
def page():
    pytest.importorskip("panel", reason="the page needs asperity[explore]")
    from asperity.explore.page import Page

    made = Page(geo.mushrooms(0.5, 0.5, 1), "mushrooms")
    yield made
    made.close()


def profile_of_60_megabytes():
    return b"".join(b"%d %.9f\n" % (k, -((k * 7919) % 1000) / 1000) for k in range(3_200_000))


@pytest.mark.usefixtures("uncollected")
def test_a_file_of_60_megabytes_is_read_in_a_process_that_is_ended_and_its_copy_removed(page, monkeypatch):
    content = profile_of_60_megabytes()
    assert len(content) > 55e6
    page.file.filename = "profile.txt"
    begun = time.process_time()
    page.file.value = content
    for _ in range(20):
        time.sleep(0.05)
        page.collect()
    assert time.process_time() - begun < 2.0 * MESSAGE
    folder = page._background._folder.name
    page.close()
    assert not page._background.busy
    assert not Path(folder).exists()


def waited(page, condition):
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
        page.collect()
    pytest.fail(f"still {page.message!r}")


def test_a_refused_file_is_read_again_when_its_options_change_or_it_is_sent_again(page, monkeypatch):
    cleared = []
    monkeypatch.setattr(page.file, "_send_event", cleared.append)
    page.options.value = "seam=nonsense"
    page.file.filename, page.file.value = "profile.txt", b"0 0\n1 -0.5\n2 -0.1\n3 -0.4\n"
    waited(page, lambda: "nonsense" in page.message)
    # a browser answers so, and sends the same file again only then
    assert [event.event_name for event in cleared] == ["clear_input"]
    page.file.value = None
    page.options.value = "seam=void"
    waited(page, lambda: "void" in page.message)
    page.options.value = "seam=step"
    waited(page, lambda: page.question.name == "profile" and not page.message)
    # another wall is chosen: options wait for the next file
    page.choice.value = "koch"
    page.options.value = "seam=mirror"
    waited(page, lambda: page.question.name == "koch" and not page._awaited)


def test_the_page_opens_on_a_wall_that_has_a_gap():
    (default,) = (one.default for one in cli.explore.params if one.name == "wall")
    assert spec.spectral_gap(ker.WallLaw(geo.wall_from_text(default)), 1e-2).verdict == "isolated"


def test_a_gap_of_which_no_digit_is_known_is_shown_as_an_interval():
    pytest.importorskip("panel", reason="the page needs asperity[explore]")
    from asperity.explore.page import answer_as_html

    coarse = first_answer(Question(geo.focusing_arcs(1.2), "arcs"))
    assert coarse.gap.verdict == "undecided" and coarse.gap.error >= coarse.gap.value
    assert f"<b>0 to {2.0 * coarse.gap.value:.2g}</b>, undecided" in answer_as_html(coarse)


def test_separator_decimal_sign_and_encoding_of_a_profile_are_fields(page):
    text = "x;höhe\n0;0,0\n1;-0,5\n2;-0,1\n3;-0,4\n"
    page.reading["decimal"].value = "."
    page.file.filename, page.file.value = "profile.txt", text.encode("latin-1")
    waited(page, lambda: page.message)
    for key, value in (("delimiter", "semicolon"), ("encoding", "latin-1"), ("decimal", "comma")):
        page.reading[key].value = value
    waited(page, lambda: page.question.name == "profile" and not page.message)
    assert page.question.wall.depth == pytest.approx(0.5)
    # they are none of a wall file
    page.file.filename, page.file.value = "wall.toml", wall_as_toml(TEETH)
    waited(page, lambda: page.question.name == "wall" and not page.message)


@pytest.mark.parametrize("name", geo.WALLS)
def test_every_named_wall_can_be_chosen_and_has_its_sliders(page, name):
    page.choice.value = name
    assert page.parameters.keys() == geo.WALLS[name].defaults.keys()


@pytest.mark.usefixtures("uncollected")
def test_vertices_and_numbers_beyond_the_limits_are_refused_before_any_work(page):
    x = np.linspace(0.0, 1.0, 100_000)
    vertices = {"x": x.tolist(), "y": (-x * (1.0 - x)).tolist()}
    for changed, name, value, words in (
        (page.wall_figure.vertices, "data", vertices, "expected at most 30 vertices"),
        (page.parameters["generations"], "value", 10, "generations: expected 1 to 4, got 10"),
    ):
        begun = time.process_time()
        setattr(changed, name, value)
        assert time.process_time() - begun < MESSAGE and words in page.message


def test_walls_of_too_many_pieces_are_refused_with_another_command():
    wall = lambda: geo.Wall.from_vertices(np.c_[np.linspace(0, 1, 50_002), np.r_[0, np.full(50_000, -0.1), 0]])  # noqa: E731
    with pytest.raises(InputError, match="at most 50000 pieces, got 50001; thin it out, or use the command"):
        next(pictured_and_answered(wall, "long"))


class Script:
    """A computation whose results the test chooses."""

    busy, outdated = True, False

    def __init__(self):
        self.results = []

    def ask(self, *_, **__):
        pass

    def collect(self):
        found, self.results = self.results, []
        return found

    drop = ask


def told(page, *results):
    """What the table, the status and the figures say after results, each a pair of an error or None and a result."""
    page._background.results = list(results)
    page.collect()
    figures = page.wall_figure, page.kernel, page.spectrum, page.collision
    titles = [getattr(figure.plot.title.text, "text", figure.plot.title.text) for figure in figures]
    return page.table.object, page.status.object, titles, len(page.kernel._image.data["root"])


def test_no_old_answer_stands_under_a_new_wall(page):
    page._background.drop()
    page._background = Script()
    teeth, arcs = (Question(wall, name) for wall, name in ((TEETH, "teeth"), (geo.focusing_arcs(1.0), "arcs")))
    of_teeth, of_arcs = first_answer(teeth), first_answer(arcs)
    assert told(page, (None, pictured(teeth)), (None, of_teeth))[0].count("computing") == 1
    page.ask(arcs.wall, "arcs")
    # for a moment the last wall stays, with its answers; then they go, also where the new wall has not been made
    table, status, titles, images = told(page)
    assert "no gap" in table and "computing" in status and titles[0].startswith("teeth") and images == 1
    page._due = 0.0
    table, _, titles, images = told(page)
    assert (table.count("computing"), "no gap" in table, images) == (4, False, 0)
    assert titles[1:] == ["Kernel: computing", "Eigenvalues: computing", "Collision: computing"]
    # of a wall that is refused the last answers come back
    table, _, titles, images = told(page, ("no such wall", None))
    assert "no gap" in table and titles[0].startswith("teeth") and images == 1
    page.ask(arcs.wall, "arcs")
    assert told(page, (None, pictured(arcs)))[2][0].startswith("teeth")
    page._due = 0.0
    table, _, titles, images = told(page)
    assert titles[0].startswith("arcs") and table.count("computing") == 4 and images == 0
    assert "undecided" in told(page, (None, of_arcs))[0]
    # the same wall, asked for again, keeps its answer
    page.ask(arcs.wall, "arcs")
    told(page, (None, pictured(arcs)))
    page._due = 0.0
    assert "undecided" in told(page)[0]
    # what ends without answer says so
    page.ask(TEETH, "teeth")
    table = told(page, (None, pictured(teeth)), (GONE, None))[0]
    assert "computing" not in table and table.count("want of memory") == 5


def test_accommodation_and_resistance_stand_beside_the_gap_with_their_errors():
    from asperity.explore.page import answer_as_html

    arcs = geo.dispersing_arcs(1.0)
    _, found = islice(answers_to(Question(arcs, "arcs", convention="specular")), 2)
    momentum, law, text = found.accommodation, ker.WallLaw(arcs), answer_as_html(found)
    known = spec.accommodation(law, 1e-4, 1.0, rng=1)
    for mine, yours in (
        (momentum.tangential, known.tangential), (momentum.normal, known.normal),
        (resistance_from(momentum), ker.resistance(law, 1e-4)),
    ):  # fmt: skip
        assert abs(mine.value - yours.value) <= mine.error + yours.error
        assert f"<b>{mine}</b>" in text
    assert text.index("<td>gap") < text.index("<td>accommodation") < text.index("<td>kernel")


@pytest.mark.parametrize(("number", "handles"), [(30, 30), (31, 0)])
def test_profiles_of_many_vertices_have_no_handles(number, handles):
    x = np.linspace(0.0, 1.0, number)
    wall = geo.Wall.from_vertices(np.c_[x, -0.3 * x * (1.0 - x)])
    assert len(Question(wall, "profile").handles) == handles


def test_a_shallow_wall_is_stretched_as_in_its_picture_and_says_so():
    from asperity.explore.drawing import WallFigure

    figure = WallFigure()
    for wall, hint in ((geo.dispersing_arcs(1e-3), "angles not to scale"), (TEETH, "drag a vertex, tap to add one")):
        figure.show(pictured(Question(wall, "wall")), dragged=False)
        picture = geo.draw_wall(wall, ax=Figure().subplots())
        # bokeh's number is the width of a square over its height, matplotlib's the height over the width
        assert figure.plot.aspect_scale == pytest.approx(1.0 / picture.get_aspect())
        labels = [axis.axis_label.text for axis in (figure.plot.xaxis[0], figure.plot.yaxis[0])]
        assert labels == [picture.get_xlabel(), picture.get_ylabel()]
        assert figure._hint.text == hint


def collected(page, until, seconds=300.0):
    """Collect answers until a condition holds."""
    end = time.monotonic() + seconds
    while not until() and time.monotonic() < end:
        page.collect()
        time.sleep(0.02)


def test_after_a_refused_wall_the_answers_of_the_last_one_go_on(page):
    collected(page, lambda: page.answer is not None)
    page.file.filename = "wrong.toml"
    page.file.value = b"period = ["
    collected(page, lambda: page.message)
    assert "wrong.toml" in page.message and page.question.name == "mushrooms" and page._background.busy
    collected(page, lambda: page.answer.stage != "coarse")
    assert "wrong.toml" in page.message


def test_another_convention_does_not_lose_the_wall_that_is_awaited(page):
    page.choice.value = "koch"
    page.convention.value = "specular"
    collected(page, lambda: page.question.convention == "specular")
    assert (page.question.name, page.question.convention) == ("koch", "specular")
    assert page.choice.value == "koch"


def test_the_slider_of_the_facets_asks_anew_and_refuses_fractions_above_1(page):
    page.diffuse.value = 0.5
    collected(page, lambda: page.question.diffuse_fraction == 0.5 and page.answer is not None)
    assert page.answer.gap.verdict == "undecided" and page.answer.kernel.method == "qmc"
    page.diffuse.value = 2.0
    assert "diffuse fraction: expected a number in [0, 1], got 2.0" in page.message
    assert page.question.diffuse_fraction == 0.5


# -- command line


def test_the_name_and_parameters_of_a_wall_are_told_apart(tmp_path):
    assert _called("focusing-arcs:half_angle=0.9") == ("focusing-arcs", {"half_angle": 0.9})
    assert _called(str(tmp_path / "mine.toml")) == ("mine", {})


@pytest.mark.parametrize("name", geo.WALLS)
def test_the_first_answer_takes_at_most_0_3_seconds_of_the_processor(name):
    question = Question(geo.WALLS[name].build(), name)
    seconds = []
    # the first run compiles
    for _ in range(3):
        start = time.process_time()
        first_answer(question)
        seconds.append(time.process_time() - start)
    assert min(seconds) <= 0.3


def test_the_legend_of_the_collision_is_above_the_bars():
    from asperity.explore.drawing import CollisionFigure

    figure = CollisionFigure()
    figure.show(first_answer(Question(geo.flat(), "flat")))
    assert [entry.label.value for entry in figure.plot.legend[0].items] == ["smooth disk", "no-slip disk"]
    assert figure.plot.legend[0] in figure.plot.above
