"""The examples run, and what they return is right."""

import importlib.util
import re
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from campaigns.spectra.small_gaps import SIGMAS, sampled_gap

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_example_has_a_test():
    # the figures of the paper are tested with its objects
    tested = {"paper_figures", *re.findall(r'load\("(\w+)"\)', Path(__file__).read_text(encoding="utf-8"))}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == tested


def test_a_measured_profile_is_studied_from_end_to_end(tmp_path):
    report = load("measured_profile").main(tolerance=1e-2, out=tmp_path)
    wall = report.wall
    assert wall.period == pytest.approx(2 * 402 * 111_200 / 1200 * np.cos(np.radians(36.733)), rel=1e-4)
    assert report.tracer is not None and report.tracer.counts["escaped"] == sum(report.tracer.counts.values())
    assert abs(report.tracer.z_score) < 4.5
    assert report.matrix.method == "exact" and float(report.matrix.symmetry_defect()) < 1e-11
    assert report.gap.verdict == "no gap"  # a measured profile is a polygon
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["wall.png", "kernel.png", "spectrum.png", "collision.png", "kernel.npz", "study.json"]
    )


def test_the_published_gap_is_found():
    found = load("published_gap").main(half_angles=(0.2,))
    assert found["dispersing"] == pytest.approx(0.0373, abs=5e-5)
    assert found["focusing 0.2, gap/(4h)"] == pytest.approx(0.9876, abs=2e-4)


def test_the_gap_of_the_best_wall_is_proved():
    table, best, proof = load("best_proved_gap").main((1.4, 1.5), width=0.05)
    gap, low, high = table.rows[0], *map(float, proof.interval)
    assert best == 1.4 and gap.value > table.rows[1].value
    assert low - gap.error < gap.value < high + gap.error


def test_the_gap_study_finds_what_is_published_and_goes_on(tmp_path):
    study = load("gap_study")
    found = study.main((0.1,), (0.1, 1 / 3), 1e-4, tmp_path)
    assert found == study.main((0.1,), (0.1, 1 / 3), 1e-4, tmp_path)
    ((_, gap, error, ratio, tangential),) = found["focusing"]
    # a Rayleigh quotient of the same operator, at a function that is nearly the slowest
    assert gap - error < tangential < 1.001 * gap
    assert ratio == pytest.approx(1.0, abs=4e-3) and 0.0 < error < 1e-4 and gap == pytest.approx(0.0133, abs=1e-4)
    shallow, published = found["dispersing"]
    assert shallow[3] == pytest.approx(1.0, abs=2e-3)
    assert abs(published[1] - 0.0373) < 5e-5 + published[2]
    ((name, curvature, *_, difference, error, source),) = study.beside_published(found)
    assert (name, curvature, source) == ("dispersing", 1 / 3, "Feres and Zhang 2010")
    assert difference == published[1] - 0.0373 and error == published[2]
    assert (tmp_path / "gap-study.png").stat().st_size > 10_000
    assert study.tables(found).count("\n| ") == 6


@pytest.mark.slow
def test_the_page_has_the_table_that_the_gap_study_prints():
    study = load("gap_study")
    found = study.main()
    page = (EXAMPLES.parent / "sweeps.md").read_text(encoding="utf-8")
    start = page.index("| wall | published")
    printed = study.tables(found).splitlines()
    shown = page[start:].splitlines()[: len(printed)]
    # of the numbers the last digits may differ from machine to machine, within the errors that stand beside them
    for ours, theirs in zip(printed, shown, strict=True):
        for one, other in zip(ours.split("|"), theirs.split("|"), strict=True):
            try:
                assert float(one) == pytest.approx(float(other), abs=3e-7, rel=0.5 if "e-" in one else 0.0)
            except ValueError:
                assert one == other


@pytest.mark.parametrize("curvature", [1 / 3, 1.0])
def test_the_gap_of_bumps_agrees_with_rays_of_a_textbook_and_a_form(curvature):
    law = ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()
    ours = spec.spectral_gap(law, 1e-6)
    for seed in (0, 1):
        # by more degrees the least value falls by less than a ten-thousandth; more rays would be needed for them
        value, error = sampled_gap(geo.dispersing_arcs(curvature), "specular", degrees=32, seed=seed)
        assert abs(value - ours.value) <= SIGMAS * error + ours.error + 1e-4 * ours.value


def test_the_gap_of_bumps_has_the_digits_of_an_independent_computation():
    law = ker.WallLaw(geo.dispersing_arcs(1 / 3)).in_specular_frame()
    ours = spec.spectral_gap(law, 1e-6)
    # sampled_gap with blocks=32, degrees=96, and the half width of 95 %
    value, error = 0.03732818, 3.8e-7
    assert error < 6e-7 and abs(ours.value - value) <= error + ours.error
    # a basis of 16 polynomials is not enough: its value is known to be too large
    assert 0.0373305 - ours.value > 3 * (error + ours.error)


def test_deep_teeth_toss_a_coin_between_smooth_and_no_slip():
    found = load("no_slip_or_smooth").main()
    # facts 1 with the foreshortened ratio r (1 + m/J)^(1/2)
    for ratio, fraction in found.items():
        d = 2 * ratio * np.sqrt(3) / np.tan(1.0)
        specular = 1 - (d % 1) / 2 if int(d) % 2 == 0 else 0.5 + (d % 1) / 2
        assert fraction == pytest.approx(1 - specular, abs=1e-12)


def test_a_rough_wall_mixes_with_maxwells_law_as_theory_says():
    found = load("maxwell_or_rough").main(half_angle=0.3, fraction=0.25)
    rough, maxwell = found["rough wall"], found["Maxwell's law"]
    # the gap of a shallow wall is four times its mean squared slope, less a few per cent at this depth
    xi = 0.3
    flatness = (np.log(1 / np.cos(xi) + np.tan(xi)) - np.sin(xi)) / np.sin(xi)
    assert 0.9 < rough / (4 * flatness) < 1.0
    assert maxwell == pytest.approx(0.25, abs=1e-12)
    # both laws have their gap at the even polynomials or above it; concavity, and squares of eigenvalues
    assert found["half and half"] >= 0.5 * (rough + maxwell) - 1e-12
    assert found["rough wall, twice"] == pytest.approx(1 - (1 - rough) ** 2, abs=1e-10)


def test_the_least_resistance_is_bracketed_and_no_triangle_is_as_good_as_retroreflection(tmp_path):
    found = load("least_resistance").main(points=3, picture=tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert 0.0 < found["least, upper bound"] - found["least, lower bound"] < 1e-5
    assert found["least, upper bound"] < found["involution near the least"] < 0.98785
    assert np.sqrt(2) < found["best triangle"] < found["greatest"] == 1.5


def test_the_moving_picture_ends_with_the_law_and_is_small(tmp_path):
    from PIL import Image

    example = load("front_picture")
    # as many rays as in the committed picture, in fewer frames: 3 rays by 2 steps, and 3 bursts
    example.STEPS, example.BURSTS = 2, (1, 29, sum(example.BURSTS) - 30)
    found = example.main(tmp_path / "front.gif")
    # 8193 rays in 48 bins: the largest of the normal deviations
    assert found["difference"] < 4 * np.sqrt(0.6 * 48 / np.pi / 8193)
    for path, least in ((tmp_path / "front.gif", 9), (EXAMPLES.parent / "gallery" / "front.gif", 41)):
        with Image.open(path) as picture:
            assert path.stat().st_size < 1_000_000 and picture.n_frames >= least and picture.info["loop"] == 0


def test_the_gallery_draws_what_pages_show(tmp_path, monkeypatch):
    from PIL import Image

    monkeypatch.syspath_prepend(EXAMPLES)
    gallery = load("gallery")
    # the studies, and the short example of a proof, are tested for themselves; here only what becomes of them
    studies = ("front_picture", "least_resistance", "wall_for_a_law", "walls_converge", "exchange_hollow")
    for name in studies:
        monkeypatch.setattr(getattr(gallery, name), "main", lambda picture: picture.touch())
        sys.modules.pop(name, None)
    monkeypatch.setattr(gallery, "moving_gas", partial(gallery.moving_gas, frames=3))
    monkeypatch.setattr(gallery, "proved_gap", lambda picture: picture.touch())
    drawn = {path.name for path in gallery.main(tmp_path / "gallery")}
    for path, frames in ((tmp_path / "gallery" / "gas.gif", 3), (EXAMPLES.parent / "gallery" / "gas.gif", 30)):
        with Image.open(path) as picture:
            assert picture.n_frames == frames and picture.info["loop"] == 0
    others = {"front.gif", "gas.gif", "walls.png", "proved-gap.png"}
    assert drawn == {*others, *(f"{name.replace('_', '-')}.png" for name in studies[1:])}
    docs = EXAMPLES.parent
    pages = [path.read_text(encoding="utf-8") for path in [docs.parent / "README.md", *docs.glob("**/*.md")]]
    # others too may have a picture there, if a page shows it
    committed = {path.name for path in (docs / "gallery").iterdir()}
    assert drawn <= committed
    for name in committed:
        assert any(f"gallery/{name}" in page for page in pages), name
        largest = {"front.gif": 1_000_000, "gas.gif": 400_000}.get(name, 150_000)
        assert (docs / "gallery" / name).stat().st_size < largest


def test_walls_are_found_for_laws(tmp_path):
    found = load("wall_for_a_law").main(moments=4, picture=tmp_path / "walls.png")
    assert len(found) == 3 and (tmp_path / "walls.png").stat().st_size > 10_000
    assert all(float(one.defect) < 1e-10 for one in found.values())


def test_the_joint_distance_falls_with_moments_and_hollows(tmp_path):
    found = load("walls_converge").main(tmp_path / "converge.png")
    assert (tmp_path / "converge.png").stat().st_size > 10_000
    diffuse = [found[name] for name in ("Lambert", "Maxwell, 1/2", "Henyey-Greenstein, 1/2", "Henyey-Greenstein, -1/2")]
    for rows in diffuse:
        assert [row[0] for row in rows] == [4, 6, 8, 10, 12, 14]
        (_, _, first, first_error), *_, (_, _, last, last_error) = rows
        assert last + last_error < 0.3 * (first - first_error)
        assert all(after[2] < before[2] for before, after in pairwise(rows))


def test_chambers_perform_exchanges(tmp_path):
    found = load("exchange_hollow").main(picture=tmp_path / "chambers.png")
    assert (tmp_path / "chambers.png").stat().st_size > 10_000
    assert all(float(hollow.loss(2**13)) < 0.06 for hollow in found.values())


def test_a_true_disk_finds_the_foreshortened_wall_and_both_cases_of_the_dichotomy():
    found = load("true_disk").main(ratios=(2.0,), scales=(1e-4, 1e-5, 1e-6), samples=(24, 16, 16))
    case = found["m/J = 2"]
    assert abs(case["correlation"] - case["foreshortened wall"]) < 5 * case["its error"] + 0.002
    assert abs(case["correlation"] - case["unforeshortened wall"]) > 0.3
    sequences = found["dichotomy"]
    assert sequences["constant sequence, last"] < 0.02
    assert sequences["alternating sequence, greatest of the last two"] > 0.3
    assert sequences["alternating sequence, least of the last two"] < 0.03


def test_the_pictures_of_the_page_on_true_disks_are_drawn(tmp_path):
    found = load("true_disk_pictures").main(tmp_path, samples=500)
    assert found["contacts"] == 4 and abs(found["energy gained"]) < 1e-13
    committed = EXAMPLES.parent / "theory" / "true-disk"
    page = (EXAMPLES.parent / "theory" / "true-disk.md").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in committed.iterdir()}
    for path in committed.iterdir():
        assert f"true-disk/{path.name}" in page and path.stat().st_size < 150_000


@pytest.mark.slow
def test_the_strip_is_bounded_and_the_wedge_periodic_until_the_walls_are_rough():
    found = load("disk_in_a_strip").main(disks=10, collisions=300)
    widths = [value for name, value in found.items() if "width/bound" in name and "arcs" not in name]
    assert len(widths) == 20 and max(widths) <= 1 + 1e-12
    assert found["focusing arcs, median width/bound"] > 1.0
    assert found["no-slip wedge, fraction that stays"] > 0.05
    assert found["no-slip wedge, displacement in ten collisions"] < 1e-10
    assert found["rough wedge, fraction that stays"] < found["no-slip wedge, fraction that stays"]


@pytest.mark.slow
def test_roughness_reduces_chaos_and_a_gas_comes_to_equipartition(tmp_path):
    found = load("billiards").main(200, 60, 900, tmp_path / "portraits.png")
    assert (tmp_path / "portraits.png").stat().st_size > 20_000
    for law in ("smooth", "no-slip"):
        assert abs(found[f"circle, {law}"].value) < found[f"circle, {law}"].error
    for table in ("stadium", "Sinai table"):
        smooth, rough = found[f"{table}, smooth"], found[f"{table}, no-slip"]
        assert smooth.value - smooth.error > rough.value + rough.error > 0.0
    gas = found["rotational fraction of a gas"]
    # 900 events are few for 12 disks that begin without spin
    assert abs(gas.value - 1 / 3) < 0.1
