"""Studies of height maps by the command: numbers, pictures, files and refusals."""

import json

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.study import DATA, SurfaceStudy, study_surface
from commands import refused, run

FIELD = geo.Surface.random(geo.HeightCorrelation(0.3), 10, rms_slope=0.6, period=5.0, rng=1).heights
FAST = ("--tolerance", 0.3, "--seed", 3)


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "map.txt"
    np.savetxt(path, 1000.0 * FIELD)
    return path


def test_the_command_prints_a_study_of_a_map_and_writes_its_files(map_file, tmp_path):
    text = f"{map_file}:units=um/nm,tiling=wrap,degree=0"
    options = ("--spacing", 0.5, *FAST, "--incidence", "0,30", "--table", tmp_path / "law.csv", "--out", tmp_path / "a")
    result = run("study", text, *options)
    assert result.exit_code == 0, result.output
    lines = {line[:11].strip(): line[11:] for line in result.stdout.splitlines()}
    assert lines["surface"] == "map.txt:units=um/nm,tiling=wrap,degree=0: 10 x 10 heights, periods 5 x 5 um, " \
        "random orientation"  # fmt: skip
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == sorted((*SurfaceStudy.pictures, *DATA))
    plain = json.loads((tmp_path / "a" / "study.json").read_text())
    surface = geo.read_surface(map_file, 0.5, ("um", "nm"), tiling="wrap", degree=0)
    assert plain["surface"]["rms_slope"] == surface.rms_slope and plain["surface"]["orientation"] == "random"
    assert plain["tracer"]["kac"] == pytest.approx(surface.area / 25.0) and abs(plain["tracer"]["z_score"]) < 4.5
    law = ker.SurfaceLaw(surface)
    found = spec.accommodation(law, 5e-3, rng=9, incidence_deg=[30])
    stated, at = plain["accommodation"]["tangential"], plain["accommodation"]["at"]
    assert abs(stated["value"] - found.tangential.value) < stated["error"] + found.tangential.error
    assert at[0]["tangential"] is None and at[0]["incidence_deg"] == 0.0
    assert abs(at[1]["tangential"] - found.tangential_at[0]) < 2 * (at[1]["tangential_error"] + 5e-3)
    assert len(plain["quarters"]) == 4 and plain["gap"]["convention"] == "specular"
    assert ker.load_matrix(tmp_path / "a" / "kernel.npz").basis == ker.Zernike(8)
    table = np.loadtxt(tmp_path / "law.csv", delimiter=",")
    assert table.shape == (1 + 16 * 16, 4 + 17) and "at 30, 0 degrees" in result.stdout
    assert "--force" in refused("study", text, *options[:-4], "--out", tmp_path / "a")


def test_a_study_says_that_a_map_was_mirrored_and_its_pictures_are_small(map_file, tmp_path):
    mirrored = geo.read_surface(map_file, 0.5, ("um", "nm"))
    report = study_surface(ker.SurfaceLaw(mirrored), "map.txt:units=um/nm,degree=0", tolerance=0.3, progress=False)
    words = "followed by its mirror images in both directions"
    assert words in report.summary(verbose=True) and words not in repr(geo.Surface(FIELD))
    assert mirrored.is_mirrored and not geo.Surface(FIELD).is_mirrored and not geo.Surface([[0.0, 1.0]]).is_mirrored
    picture = next(path for path in report.save(tmp_path) if path.name == "surface.png")
    assert 20_000 < picture.stat().st_size < 150_000


def test_grooves_at_a_fixed_orientation_have_no_gap_and_a_tensor_of_what_they_keep():
    law = ker.SurfaceLaw(geo.Surface([[0.0], [0.9], [0.3]]), orientation=0.0)
    report = study_surface(law, tolerance=0.1, incidence_deg=[40.0], progress=False)
    assert report.gap.verdict == "no gap" and "orientation 0\n" in report.summary()
    assert "all normals are in one plane" in report.summary(verbose=True)
    assert "at 40, 0 degrees" in report.summary(by_angle=True)
    (_, zero), (_, along) = report.as_dict()["accommodation"]["tensor"]
    assert along == pytest.approx(0.0, abs=0.02) and zero == pytest.approx(0.0, abs=0.02)
    assert not report.quarters and "quarters" not in report.summary()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--spacing", "a"), "--spacing: expected one or two distances joined by commas"),
        (("--spacing", "-1"), "spacing: expected a positive number or a pair of such"),
        (("--orientation", "random"), "pass spacing=1.0, or (dx, dy)"),
        (("--spacing", "1", "--orientation", "45"), "orientation: expected an angle in radians, at most 2 pi"),
        (("--spacing", "1", "--orientation", "north"), "--orientation: expected an angle"),
        (("--spacing", "1", "--incidence", "95"), "incidence_deg: expected degrees from the normal, in [0, 90)"),
        (("--spacing", "1", "--tolerance", "0"), "tolerance: expected a number greater than 0"),
    ],
)
def test_unsuitable_options_of_a_map_are_refused(map_file, options, words):
    assert words in refused("study", map_file, *options)


def test_unknown_files_and_parameters_are_refused_and_a_disk_is_wrong_usage(map_file):
    assert "is no file; expected a height map" in refused("study", "flat", "--spacing", 1)
    assert "a map takes degree, tiling" in refused("study", f"{map_file}:seam=step", "--spacing", 1)
    assert "cannot read 'two'" in refused("study", f"{map_file}:degree=two", "--spacing", 1)
    assert run("study", map_file, "--spacing", 1, "--mass", 2).exit_code == 2
