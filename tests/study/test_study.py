"""A study gives the numbers that the library gives, and says what it does not know."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, FileExistsRefusal, InputError
from asperity.kernels import discretise
from asperity.study import DATA, PICTURES, check_tracer, pictures, study_wall
from asperity.study import study as study_module
from asperity.study.pictures import draw_study_wall
from wall_shapes import over_floor, square

TOLERANCE = 1e-2


@pytest.fixture(scope="module")
def arcs():
    return study_wall(geo.focusing_arcs(1.2), "arcs", tolerance=TOLERANCE, bins=32)


@pytest.fixture(scope="module")
def teeth():
    return study_wall(geo.rectangular_teeth(2.0), "teeth", bins=16)


def test_the_matrix_is_that_of_the_law(arcs):
    expected = ker.discretise(ker.WallLaw(geo.focusing_arcs(1.2)), ker.Bins(32), tolerance=TOLERANCE)
    assert np.array_equal(arcs.matrix.array, expected.array)
    # entries against the closed form of the arc, sampled: 5 standard errors of a million rays
    closed = ker.discretise(
        ker.CircularArcLaw(1.2), ker.Bins(32), method="monte-carlo", samples=2**20, rng=np.random.default_rng(1)
    )
    assert np.abs(arcs.matrix.array - closed.array).max() < 5.0 * np.sqrt(0.25 / 2**15)


def test_the_gaps_are_those_of_the_library_and_of_the_reference(arcs):
    law = ker.WallLaw(geo.focusing_arcs(1.2))
    # the second largest eigenvalue, known to 3e-10 from an independent computation
    assert abs(float(arcs.gap) - (1.0 - 0.3670253152)) <= arcs.gap.error
    assert float(arcs.gap) == pytest.approx(float(spec.spectral_gap(law, TOLERANCE)), abs=1e-12)
    specular = spec.spectral_gap(law.in_specular_frame(), TOLERANCE)
    assert float(arcs.specular_gap) == pytest.approx(float(specular), abs=1e-12)
    assert (arcs.gap.convention, arcs.specular_gap.convention) == ("paper", "specular")
    # the same wall's odd eigenvalues change sign: 1 - gap is the least one's modulus
    assert abs(1.0 - float(arcs.specular_gap) - 0.311346443) <= max(arcs.specular_gap.error, 1e-4)


def test_the_disk_feels_the_foreshortened_wall(arcs):
    deeper = geo.focusing_arcs(1.2).foreshorten(geo.Disk(1.0, 0.5))
    assert arcs.collision.law == ker.WallLaw(deeper)
    assert "1.732 times as deep" in arcs.summary()  # (1 + m/J)^(1/2)


def test_collisions_keep_energy_and_rolling_momentum(arcs):
    assert set(arcs.conservation) == {"energy_defect", "rolling_momentum_defect"}
    assert max(arcs.conservation.values()) < 64 * np.finfo(float).eps


def test_mean_collisions_agree_with_kac(arcs, teeth):
    assert arcs.tracer.expected_collisions == pytest.approx(1.2 / math.sin(1.2), rel=1e-14)
    assert teeth.tracer.expected_collisions == pytest.approx(5.0, rel=1e-14)  # two sides of height 1, a floor of 1/2
    for report in (arcs, teeth):
        assert abs(report.tracer.z_score) < 4.5
        assert "Kac's formula presumes" not in report.summary(verbose=True)
        assert sum(report.tracer.counts.values()) == report.tracer.counts["escaped"] == 2**16


def test_unreachable_rays_of_a_cap_are_no_defect_of_the_tracer(teeth):
    check = check_tracer(geo.mushrooms(0.2, 0.5), np.random.default_rng(0))
    assert check.z_score < -100.0
    text = replace(teeth, tracer=check).summary(verbose=True)
    assert "Kac's formula presumes that every ray inside can come from the opening" in text


def test_too_many_collisions_are_called_a_defect(teeth):
    check = replace(teeth.tracer, expected_collisions=0.5 * teeth.tracer.expected_collisions)
    assert "do not trust" in replace(teeth, tracer=check).summary(verbose=True)


def test_a_polygon_has_no_gap_and_the_summary_says_so(teeth):
    assert teeth.gap.verdict == teeth.specular_gap.verdict == teeth.collision_gap.verdict == "no gap"
    text = teeth.summary(verbose=True)
    assert text.count("0 no gap") == 3 and "they belong to the grid" in text


def test_a_study_makes_one_matrix_that_of_the_wall(monkeypatch):
    """That of the foreshortened wall, which no report has, took three quarters of a first study to compile."""
    made = []
    monkeypatch.setattr(
        study_module, "discretise", lambda law, *how, **more: made.append(law) or discretise(law, *how, **more)
    )
    found = study_wall(geo.focusing_arcs(1.2), bins=8, tolerance=0.1, progress=False)
    assert made == [ker.WallLaw(geo.focusing_arcs(1.2))]
    assert (
        found.as_dict()["collision"].keys() >= {"gap", "foreshortening"} and "law" not in found.as_dict()["collision"]
    )


def test_the_study_of_the_wall_is_told_before_the_collision_of_the_disk(monkeypatch):
    told = []
    monkeypatch.setattr(study_module, "_conservation", lambda *_: told.append("disk") or dict(study_module.UNKNOWN))
    whole = study_wall(geo.focusing_arcs(1.2), bins=8, tolerance=0.1, progress=False, first=told.append)
    part, after = told
    assert after == "disk" and part.collision_gap is None and whole.collision_gap is not None
    cut = part.summary().index("\ndisk ")
    assert whole.summary()[:cut] == part.summary()[:cut] and "gap " in part.summary()[:cut]


def test_the_summary_names_method_error_tolerance_and_both_conventions(arcs):
    text = arcs.summary(verbose=True)
    assert "Bins(32) by quadrature, Frobenius error" in text and text.count("tolerance 0.01 met") == 3
    assert all(line in text for gap in (arcs.gap, arcs.specular_gap) for line in (gap.method, *gap.evidence))


def test_the_consequences_are_those_of_the_library(arcs, teeth):
    found = arcs.consequences
    # the second largest modulus is the paper convention's 0.3670253152
    assert abs(float(found.slem) - 0.3670253152) <= found.slem.error
    assert abs(float(found.relaxation_time) + 1 / math.log(0.3670253152)) <= found.relaxation_time.error
    # a grazing ray leaves an arc at a finite angle: D is that of diffuse walls
    assert found.diffusion.eta == pytest.approx(1.0, abs=1e-5)
    assert f"slem {found.slem} " in arcs.summary(verbose=True) and "D = 1.27" in arcs.summary()
    for text in (arcs.summary(), arcs.summary(verbose=True)):
        assert "the slope of L^2/tau against ln(L/r) for L well above" in text
    assert not math.isfinite(teeth.consequences.relaxation_time.error)
    assert "relaxation infinite" in teeth.summary()


def test_the_eigenvalues_and_enclosures_can_be_quoted(arcs, teeth):
    """Value, error, kind, method and convention of each, in the text and in JSON; 0.3670253152 is the reference."""
    text, read = arcs.summary(verbose=True), arcs.as_dict()
    assert "paper convention, estimate: Panels(" in text and "completeness: the rest of the spectrum is within" in text
    listed = read["eigenvalues"]
    assert {"convention", "kind", "method", "values", "errors", "parity", "completeness"} <= set(listed)
    for place, value in ((1, 0.3670253152), (-1, -0.311346443)):
        assert abs(listed["values"][place] - value) <= listed["errors"][place]
    assert len(listed["values"]) == 10 and listed["parity"][:3] == ["even", "odd", "even"]
    enclosed = read["enclosures"]
    assert len(enclosed) == len(arcs.enclosures) == 3
    assert enclosed[1]["low"] <= 0.3670253152 <= enclosed[1]["high"]
    assert (enclosed[1]["convention"], enclosed[1]["kind"], enclosed[1]["parity"]) == ("paper", "estimate", "odd")
    assert all(str(item) in text for item in arcs.enclosures)
    assert teeth.enclosures is None and teeth.as_dict()["enclosures"] is None
    assert "no eigenvalue next to it is isolated" in teeth.summary(verbose=True)


def test_a_tolerance_that_was_not_met_is_said_loudly(teeth):
    missed = replace(teeth.matrix, error=replace(teeth.matrix.error, value=0.5, error=0.5))
    # 1e-3 for each of 16 bins
    assert "Frobenius error 0.5, tolerance 0.004 NOT met" in replace(teeth, matrix=missed).summary()


def test_a_gap_that_was_not_decided_is_not_rounded_away(arcs):
    open_question = replace(arcs.gap, value=0.71234, error=0.71234, verdict="undecided")
    text = replace(arcs, gap=open_question).summary(verbose=True)
    assert "0.7123 with error 0.71, tolerance 0.01 NOT met" in text


def test_a_law_without_mirror_axis_is_said_not_to_be_self_adjoint_and_contracts_by_the_slem():
    wall = geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (0.7, -0.1), (1, 0)])
    report = study_wall(wall, bins=8, tolerance=0.1)
    gap = report.as_dict()["gap"]["specular"]
    assert (gap["self_adjoint"], gap["value"], gap["verdict"]) == (False, 0.0, "no gap")
    assert "norm 1 on functions of mean 0, not self-adjoint" in report.summary()
    curved = geo.Wall([geo.Bezier([(0, 0), (0.1, -0.3), (0.7, -0.25), (1, 0)])])
    report = study_wall(curved, bins=8, tolerance=0.1)
    assert report.consequences.slem.value == 1.0 - report.specular_gap.value
    assert "norm 0.40" in report.summary() and "best constant for one step" in report.summary(verbose=True)


def test_the_summary_lists_all_eigenvalues_by_modulus(arcs):
    """The second largest modulus is that of the most negative one: facts 10."""
    line = next(line for line in arcs.summary(verbose=True).splitlines() if line.startswith("spectrum"))
    numbers = [float(part.split("(")[0].split()[0]) for part in line.split("modulus: ")[1].split(" (")[0].split(", ")]
    assert len(numbers) == 10 and "the 10 of largest modulus" in line
    assert np.all(np.diff(np.abs(numbers)) <= 0.0) and numbers[2] == pytest.approx(-0.311346443, abs=1e-3)


def test_facets_with_a_law_of_their_own_are_named_everywhere_and_have_their_numbers(tmp_path):
    wall, facets, name = geo.flat(), ker.maxwell(0.5), "0.5*lambertian() + 0.5*specular()"
    report = study_wall(wall, "plate", facets=facets, bins=8)
    assert np.array_equal(report.matrix.array, ker.discretise(facets, ker.Bins(8)).array)
    assert report.collision.law == ker.FacetedLaw(wall.foreshorten(geo.Disk()), facets)
    assert report.gap.value == 0.5 and abs(report.accommodation.tangential.value - 0.5) < 1e-12
    assert f"\nfacets     {name}" in report.summary()
    plain = json.loads(report.to_json())
    assert plain["wall"]["facets"] == name
    figure = Figure()
    draw_study_wall(report, figure.subplots())
    assert "facets 0.5" in figure.axes[0].get_title()
    assert report.title == f"plate, facets {name}"
    with pytest.raises(InputError, match=r"^facets: expected a Law"):
        study_wall(wall, facets=0.5)


def test_a_refused_gap_is_reported_and_the_rest_stands(monkeypatch, tmp_path):
    def refuse(*arguments, **keywords):
        raise AccuracyError("the counts speak against symmetry", 0.5)

    for name in ("spectral_gap", "spectrum", "enclosures"):
        monkeypatch.setattr(f"asperity.study.study.{name}", refuse)
    report = study_wall(geo.rectangular_teeth(1.0), bins=8)
    assert set(report.refusals) == {"gap", "specular_gap", "collision_gap", "spectrum", "enclosures"}
    assert report.summary(verbose=True).count("refused: the counts speak against symmetry") == 5
    assert json.loads(report.to_json())["gap"] == {"paper": None, "specular": None}
    assert "gap        refused: the counts speak against symmetry" in report.summary()
    assert len(report.save(tmp_path)) == len(PICTURES) + len(DATA)


def no_constants(name):
    raise AssertionError(f"{name} is not JSON")


@pytest.mark.parametrize("which", ["arcs", "teeth"])
def test_json_round_trips_and_every_gap_says_what_it_is(which, request):
    report = request.getfixturevalue(which)
    text = report.to_json()
    read = json.loads(text, parse_constant=no_constants)
    assert read == report.as_dict() and json.dumps(read, indent=2) == text
    gaps = {
        "gap": read["gap"]["paper"], "specular_gap": read["gap"]["specular"], "collision_gap": read["collision"]["gap"],
    }  # fmt: skip
    for name, gap in gaps.items():
        if gap is None:
            assert name in read["refusals"]
            continue
        found = getattr(report, name)
        assert (gap["value"], gap["error"]) == (found.value, found.error)
        assert gap["kind"] in ("bound", "estimate") and gap["method"] and gap["evidence"]
        assert gap["convention"] == ("specular" if name == "specular_gap" else "paper")


def test_a_saved_study_has_small_pictures_can_be_read_back_and_is_not_overwritten(teeth, tmp_path):
    paths = teeth.save(tmp_path / "deep" / "folder")
    assert [path.name for path in paths] == [*PICTURES, *DATA]
    assert all(path.stat().st_size > 500 for path in paths)
    drawn = [path.read_bytes() for path in paths[: len(PICTURES)]]
    assert all(picture.startswith(b"\x89PNG") and len(picture) < 150_000 for picture in drawn)
    matrix = ker.load_matrix(paths[-2])
    assert np.array_equal(matrix.array, teeth.matrix.array) and matrix.method == "exact"
    before = [path.read_bytes() for path in paths]
    with pytest.raises(FileExistsRefusal, match="--force"):
        teeth.save(tmp_path / "deep" / "folder")
    assert [path.read_bytes() for path in paths] == before
    teeth.save(tmp_path / "deep" / "folder", overwrite=True)


@pytest.mark.parametrize("which", ["arcs", "teeth"])
def test_the_summary_is_ten_short_lines_with_errors_in_brackets(which, request):
    report = request.getfixturevalue(which)
    lines = report.summary().splitlines()
    assert len(lines) == 10 and max(map(len, lines)) <= 130
    gap = "gap        0.63297(5) isolated" if which == "arcs" else "gap        0 no gap"
    assert sum(line.startswith(gap) for line in lines) == 1
    assert all(line[11:] in repr(report) for line in lines) and repr(report).startswith("Study of ")


def test_the_summary_of_a_profile_begins_with_momentum_and_any_with_a_disk_that_was_given(arcs, teeth):
    profile, of_disk = ["momentum", "resistance", "Maxwell"], ["disk", "collision", "conserved"]

    def titles(report, **options):
        return [line[:11].strip() for line in report.summary(**options).splitlines()]

    assert titles(teeth)[:5] == ["wall", *profile, "rays"] and "disk" not in titles(teeth)
    assert titles(arcs)[:2] == ["wall", "rays"] and titles(arcs)[-3:] == of_disk
    assert titles(replace(arcs, disk_given=True))[:5] == ["wall", *of_disk, "rays"]
    assert titles(replace(teeth, disk_given=True))[:5] == ["wall", *of_disk, "momentum"]
    smooth = geo.Wall([geo.Bezier([(k, 0), (k + 0.3, -0.1), (k + 0.7, -0.1), (k + 1, 0)]) for k in range(9)], 9.0)
    assert titles(replace(arcs, wall=smooth))[:4] == ["wall", *profile]
    assert titles(arcs, by_angle=True)[1:4] == profile and titles(arcs, by_angle=True)[-32] == "by angle"
    assert study_wall(geo.flat(), disk=geo.Disk(), bins=4).disk_given


def test_no_line_of_a_report_says_none(arcs, teeth):
    open_wall = study_wall(over_floor(square(0.4, -0.4, 0.2)), bins=4, tolerance=0.1)
    skew = study_wall(geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (0.7, -0.1), (1, 0)]), bins=8, tolerance=0.1)
    refused = replace(teeth, accommodation=None, refusals={**teeth.refusals, "accommodation": "too rough"})
    for report in (arcs, teeth, open_wall, skew, refused):
        for verbose in (False, True):
            assert not re.search("none", report.summary(verbose=verbose, by_angle=True), re.IGNORECASE)
    assert "momentum   refused: too rough" in refused.summary()


@pytest.mark.parametrize("which", ["arcs", "teeth"])
def test_momentum_and_resistance_are_those_of_the_library(which, request):
    report = request.getfixturevalue(which)
    law = ker.WallLaw(report.wall)
    found, drag = report.accommodation, ker.resistance(law, TOLERANCE)
    expected = spec.accommodation(law, 1e-10)
    for name in ("tangential", "normal", "maxwell_fraction", "misfit"):
        one, other = getattr(found, name), getattr(expected, name)
        assert abs(one.value - other.value) <= one.error + other.error
        assert report.as_dict()["accommodation"][name]["value"] == one.value
    # two different methods
    assert abs(report.resistance.value - drag.value) <= report.resistance.error + drag.error < 1e-6
    assert report.as_dict()["resistance"]["error"] == report.resistance.error


def test_pictures_are_titled_by_the_wall_and_its_parameters_without_the_options_of_a_reader(teeth):
    long = "line.txt:seam=step,units=um/nm,delimiter=semicolon,decimal=comma,usecols=0/2,skiprows=3,encoding=latin-1"
    for name, title in (
        (long, "line.txt"),
        ("koch:generations=2", "koch, generations = 2"),
        ("ratio 1:2", "ratio 1:2"),
    ):
        ax = Figure().subplots()
        draw_study_wall(replace(teeth, name=name), ax)
        assert ax.get_title().splitlines()[0] == title


@pytest.mark.parametrize(("kind", "start"), [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_pictures_are_written_in_the_format_that_is_asked_for(teeth, tmp_path, kind, start):
    paths = teeth.save(tmp_path, picture_format=kind, dpi=50)
    assert [path.name for path in paths[:4]] == [name.replace("png", kind) for name in PICTURES]
    assert all(path.read_bytes().startswith(start) for path in paths[:4])
    with pytest.raises(FileExistsRefusal, match=f"wall.{kind}"):
        teeth.save(tmp_path, picture_format=kind)


def test_an_unknown_format_and_resolution_are_refused_before_the_folder_is_made(teeth, tmp_path):
    for options in ({"picture_format": "gif"}, {"dpi": 0}):
        with pytest.raises(InputError, match=next(iter(options))):
            teeth.save(tmp_path / "new", **options)
    assert not (tmp_path / "new").exists()


HOSTILE = (r"$\frac{$", "$x$ $", r"\$y$", "$$", "100 %_#^&~{}", "half a pair: \ud800", r"$\alpha_{$")


@pytest.mark.parametrize("text", HOSTILE)
def test_every_picture_shows_the_texts_of_users_letter_by_letter(teeth, text, tmp_path):
    from matplotlib.figure import Figure

    from asperity.spectral.sweeps.points import SweepRow
    from asperity.spectral.sweeps.table import draw_curves

    wall = geo.Wall.from_vertices(teeth.wall.vertices, unit=text)
    points = [{f"b{text}": 0.1 * k, "wall": text} for k in range(3)]
    rows = [SweepRow(point, f"q{text}", 1.0, 0.1, "bound", "isolated", "m", 1.0, "1", "") for point in points]
    report = replace(teeth, name=text, wall=wall, spectrum=None, refusals={"spectrum": text})
    figures = [Figure() for _ in range(4)]
    geo.draw_wall(wall, ax=figures[0].subplots())
    draw_study_wall(report, figures[1].subplots())
    draw_curves(rows, [f"b{text}", "wall"], f"q{text}", f"f{text}", figures[2].subplots())
    work = spec.work_precision(
        spec.WorkProblem(text, spec.ReferenceValue(1.0, 0.0, "by hand")),
        [spec.WorkMethod(text, lambda n: 1.0 + 1.0 / n)], [1, 2], repeats=1, warm_up=False,
    )  # fmt: skip
    work.plot(figures[3].subplots())
    shown = text.replace("\ud800", "?")
    for figure in figures:
        figure.savefig(tmp_path / "a.svg")
        letters = [artist.get_text() for artist in figure.findobj(lambda one: hasattr(one, "get_text"))]
        # but for the numbers that matplotlib writes
        letters = [one for one in letters if one and "mathdefault" not in one]
        assert any(shown in one.replace(r"\$", "$") for one in letters), letters
        assert all("$" not in one.replace(r"\$", "") for one in letters), letters
    paths = report.save(tmp_path / "study")
    assert [path.name for path in paths] == [*PICTURES, *DATA]


def test_a_picture_that_fails_costs_the_picture_alone(teeth, tmp_path, monkeypatch):
    def fails(*_):
        raise ValueError("a\nbackend fails")

    teeth.save(tmp_path)
    monkeypatch.setattr(pictures, "_draw_kernel", fails)
    with pytest.warns(UserWarning, match=r"kernel\.png: this picture cannot be drawn \(ValueError: a backend fails\)"):
        paths = teeth.save(tmp_path, overwrite=True)
    assert [path.name for path in paths] == ["wall.png", "spectrum.png", "collision.png", *DATA]
    assert not (tmp_path / "kernel.png").exists()
    assert ker.load_matrix(tmp_path / "kernel.npz").method == "exact"
