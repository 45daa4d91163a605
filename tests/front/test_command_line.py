"""The command line: what it prints and writes, and how it refuses."""

import json
import os
import re

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.cli import main
from asperity.study import DATA, PICTURES
from commands import ended, refused, run
from wall_shapes import over_floor, square

FILES = sorted((*PICTURES, *DATA))


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "new"
    result = run("study", "rectangular-teeth:height_to_width=2", "--bins", 16, "--out", folder)
    assert result.exit_code == 0, result.output
    return folder, result


def test_a_study_prints_its_summary_and_writes_its_files(studied):
    folder, result = studied
    assert sorted(path.name for path in folder.iterdir()) == FILES
    assert result.stdout.startswith("wall       rectangular-teeth:height_to_width=2: period 1, depth 1,")
    assert result.stdout.count("wrote") == len(FILES)
    assert result.stderr == ""  # no progress bar where there is no terminal


def test_one_existing_file_is_enough_to_refuse_before_the_work_and_nothing_else_is_written(tmp_path, monkeypatch):
    (tmp_path / "study.json").write_text("mine")
    monkeypatch.setattr("asperity.study.study_wall", lambda *_, **__: pytest.fail("the work began"))
    message = refused("study", "flat", "--bins", 8, "--out", tmp_path)
    assert "--force" in message and "study.json" in message
    assert [path.name for path in tmp_path.iterdir()] == ["study.json"]
    assert (tmp_path / "study.json").read_text() == "mine"


def test_a_study_of_facets_with_a_law_of_their_own_names_it_and_refuses_others(tmp_path):
    options = ("--bins", 4, "--tolerance", 0.1, "--table", tmp_path / "law.csv")
    lines = run("study", "flat", "--facets", "maxwell:diffuse_fraction=0.25", *options).stdout.splitlines()
    assert "facets     0.25*lambertian() + 0.75*specular(), at each hit" in lines
    table = np.loadtxt(tmp_path / "law.csv", delimiter=",")
    assert np.allclose(table[1:, 1:], ker.maxwell(0.25).table(64, 65).quantile, rtol=0.0, atol=1e-9)
    plain = json.loads(run("study", "flat", "--facets", "flat", *options[:4], "--json").stdout)
    assert plain["wall"]["facets"].startswith("WallLaw(")
    for text, reason in (("maxwell:diffuse_fraction=2", "[0, 1], got 2.0"), ("maxwel:0.2", "finer wall")):
        assert reason in refused("study", "flat", "--facets", text)
        assert "facets: expected maxwell:NUMBER" in refused("study", "flat", "--facets", text)


def test_a_study_prints_accommodation_by_degrees_and_writes_a_table(tmp_path):
    options = ("--bins", 8, "--incidence", "0,30", "--table", tmp_path / "law.csv")
    lines = run("study", "triangular-teeth:angle=0.7", *options).stdout.splitlines()
    law = ker.WallLaw(geo.triangular_teeth(0.7))
    found = spec.accommodation(law, 1e-3, incidence_deg=[0, 30])
    at = next(line for line in lines if "at 30 degrees" in line)
    printed = [float(number) for number in re.findall(r" (\d\.\d+)\(", at)]
    assert printed == pytest.approx([found.tangential_at[1], found.normal_at[1]], rel=1e-9)
    assert any("at 0 degrees: tangential not defined, normal" in line for line in lines)
    table = np.loadtxt(tmp_path / "law.csv", delimiter=",")
    assert np.array_equal(table[1:, 1:], law.table(64, 65).quantile)
    assert f"wrote      {tmp_path / 'law.csv'}" in lines
    again = run("study", "triangular-teeth:angle=0.7", *options, "--force", "--json")
    plain = json.loads(again.stdout)["accommodation"]
    assert plain["tangential"]["value"] == found.tangential.value
    assert [row["incidence_deg"] for row in plain["at"]] == pytest.approx([0.0, 30.0])
    assert plain["at"][0]["tangential"] is None and plain["at"][1]["tangential"] == found.tangential_at[1]


def test_incidence_and_table_are_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr("asperity.study.study.discretise", lambda *_, **__: pytest.fail("the work began"))
    (tmp_path / "law.csv").write_text("mine")
    assert "joined by commas" in refused("study", "flat", "--incidence", "30 60")
    assert "(-90, 90)" in refused("study", "flat", "--incidence", "0,95")
    assert "exists" in refused("study", "flat", "--table", tmp_path / "law.csv")
    assert ".csv, .npz or .h5" in refused("study", "flat", "--table", tmp_path / "law.txt")
    assert (tmp_path / "law.csv").read_text() == "mine"


def test_force_replaces_an_earlier_study_and_json_goes_alone_to_standard_output(tmp_path):
    (tmp_path / "study.json").write_text("old")
    result = run("study", "flat", "--bins", 8, "--json", "--out", tmp_path, "--force")
    assert result.exit_code == 0 and "wrote" in result.stderr
    printed = json.loads(result.stdout)
    assert printed == json.loads((tmp_path / "study.json").read_text()) and printed["wall"]["name"] == "flat"


def test_mass_and_inertia_reach_the_disk():
    options = ("study", "flat", "--bins", 8, "--mass", 2, "--inertia-ratio", 0.125)
    assert run(*options).stdout.splitlines()[1].startswith("disk       mass 2, inertia ratio 0.125, radius 1: ")
    assert "disk" not in run(*options[:4]).stdout
    # J = 1 of a disk of radius 2
    for given in (options, (*options[:6], "--inertia", 1, "--radius", 2)):
        collision = json.loads(run(*given, "--json").stdout)["collision"]
        assert (collision["mass"], collision["inertia_ratio"]) == (2.0, 0.125)
        assert collision["foreshortening"] == pytest.approx(1 / 3, rel=1e-15)


@pytest.mark.parametrize("command", [("study", "flat"), ("realise", "lambertian")])
def test_an_inertia_needs_its_radius_and_no_ratio(command):
    alone = run(*command, "--mass", 2, "--inertia", 0.25)
    assert alone.exit_code == 2 and "if that is 1, write --inertia-ratio 0.125" in " ".join(alone.output.split())
    assert run(*command, "--inertia", 1, "--radius", 1, "--inertia-ratio", 1).exit_code == 2


def test_a_study_repeats_with_its_seed_and_changes_with_another():
    arguments = ("study", "koch:generations=1", "--bins", 8, "--json", "--seed")
    first, second, third = (json.loads(run(*arguments, seed).stdout)["tracer"] for seed in (3, 3, 4))
    assert first == second != third


def test_walls_of_every_kind_of_file_are_studied(tmp_path):
    geo.rectangular_teeth(2.0).save(tmp_path / "wall.toml")
    np.savetxt(tmp_path / "profile.txt", [[0.0, 0.0], [1.0, -0.5], [2.0, 0.1]])
    for text, period, mirror in (
        ("wall.toml", 1.0, True),
        ("profile.txt", 4.0, True),
        ("profile.txt:seam=step,units=um/um", 2.0, False),
    ):
        result = run("study", tmp_path / text, "--bins", 8, "--json")
        assert result.exit_code == 0, result.output
        wall = json.loads(result.stdout)["wall"]
        assert (wall["name"], wall["period"], wall["mirror_symmetric"]) == (text, period, mirror)


def test_an_open_wall_with_islands_has_no_check_by_kac(tmp_path):
    over_floor(square(0.4, -0.4, 0.2)).save(tmp_path / "open.toml")
    result = run("study", tmp_path / "open.toml", "--bins", 8, "--verbose", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "open: rays may pass from cell to cell, 1 island" in result.stdout and "Kac" not in result.stdout


@pytest.mark.parametrize("convention", ["paper", "specular"])
def test_a_gap_is_printed_with_its_evidence_and_as_json(convention):
    flags = ["--specular"] if convention == "specular" else []
    text = run("gap", "triangular-teeth", *flags).stdout
    assert "no gap" in text and f"{convention} convention" in text and text.count("\n") == 1
    assert "essential spectrum" in run("gap", "triangular-teeth", "--verbose", *flags).stdout
    assert text.startswith("spectral gap 0 (bound), no gap, ")
    gap = json.loads(run("gap", "triangular-teeth", "--json", *flags).stdout)
    assert gap["value"] == 0.0 and gap["error"] == 0.0 and gap["kind"] == "bound" and gap["convention"] == convention
    assert gap["verdict"] == "no gap" and len(gap["evidence"]) == 1


def test_the_named_walls_are_listed_and_drawn_and_no_picture_is_overwritten(tmp_path):
    picture = tmp_path / "walls.png"
    picture.write_text("mine")
    assert "--force" in refused("walls", "--out", picture) and picture.read_text() == "mine"
    result = run("walls", "--out", picture, "--force")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == [*geo.WALLS, "wrote"]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_gap_is_first_printed_with_fewer_digits():
    found = run("gap", "dispersing-arcs", "--tolerance", "1e-5")
    first, second, last = (*found.stderr.splitlines(), found.stdout)
    assert first.startswith("so far: spectral gap 0.7") and second.startswith("so far: spectral gap 0.716")
    assert last.startswith("spectral gap 0.71618") and "so far" not in run("gap", "dispersing-arcs", "--json").stderr


@pytest.mark.parametrize(("wall", "words"), [("focusing-arc", "Did you mean focusing-arcs"), ("flat:angle", "=value")])
@pytest.mark.parametrize("command", ["study", "gap"])
def test_a_wall_that_is_none_is_refused_in_one_line(command, wall, words):
    assert words in refused(command, wall)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--mass", -1),
        ("--mass", 0),
        ("--mass", "nan"),
        ("--inertia", "inf"),
        ("--inertia-ratio", 0),
        ("--radius", -1),
        ("--tolerance", 0),
        ("--bins", 0),
    ],
)
def test_a_number_out_of_range_is_refused_by_its_name(option, value):
    assert option.lstrip("-").replace("-", "_") in refused("study", "flat", option, value)


@pytest.mark.parametrize("place", ["file/folder", "file"])
def test_a_folder_that_cannot_be_made_is_refused(tmp_path, place):
    (tmp_path / "file").write_text("in the way")
    assert "cannot write there" in refused("study", "flat", "--out", tmp_path / place)
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.parametrize(
    ("place", "remedy"), [("file/walls.png", "folder"), ("nowhere/walls.png", "folder"), ("walls.unknown", ".png")]
)
def test_a_picture_that_cannot_be_written_is_refused(tmp_path, place, remedy):
    (tmp_path / "file").write_text("in the way")
    words = refused("walls", "--out", tmp_path / place).split("cannot write the picture")[1]
    assert remedy in words.split(";")[-1]


@pytest.mark.parametrize(
    "arguments",
    [
        ["study"],
        ["nosuch"],
        ["study", "flat", "--mass", "heavy"],
        ["study", "flat", "--nosuch"],
        ["study", "flat", "--seed", -1],
    ],
)
def test_wrong_usage_ends_with_exit_code_two(arguments):
    result = run(*arguments)
    assert result.exit_code == 2
    assert "Usage:" in result.stderr and result.stdout == ""


@pytest.mark.parametrize("command", [[], *([name] for name in main.commands)])
def test_every_command_has_help(command):
    result = run(*command, "--help")
    assert result.exit_code == 0 and "Usage:" in result.stdout


def test_the_module_runs_as_a_program(tmp_path):
    shown = ended("-m", "asperity", "study", "flat", "--bins", "8", "--json", cwd=tmp_path)
    assert shown.returncode == 0 and shown.stderr == ""
    assert json.loads(shown.stdout)["wall"]["name"] == "flat"
    failed = ended("-m", "asperity", "study", "nosuch", cwd=tmp_path)
    assert failed.returncode == 1 and failed.stdout == ""
    assert failed.stderr.startswith("asperity: 'nosuch' is neither") and failed.stderr.count("\n") == 1


def test_a_wall_is_realised_for_a_law_and_written(tmp_path):
    path = tmp_path / "wall.toml"
    result = run("realise", "maxwell:0.5", "--moments", "3", "--inertia-ratio", "0.5", "--out", str(path))
    assert result.exit_code == 0 and "defect" in result.output and path.exists()
    assert run("realise", "lambertian", "--out", str(path)).exit_code == 1
    assert "expected lambertian" in run("realise", "lambert").output
    assert "a number after" in run("realise", "maxwell:half").output


def test_quiet_prints_nothing_and_writes_the_files(tmp_path):
    result = run("study", "flat", "--bins", 8, "--quiet", "--out", tmp_path, "--format", "svg")
    assert (result.exit_code, result.output) == (0, "")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [*(name.replace(".png", ".svg") for name in PICTURES), *DATA]
    )
    assert run("study", "flat", "--quiet", "--json").exit_code == 2


def test_an_interrupted_study_leaves_no_folder_and_ends_with_130(tmp_path, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("asperity.study.study_wall", interrupt)
    result = run("study", "flat", "--out", tmp_path / "deep" / "new")
    assert result.exit_code == 130 and result.stderr == "asperity: interrupted\n"
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").mkdir()
    run("study", "flat", "--out", tmp_path / "old")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_a_study_that_is_refused_leaves_no_folder(tmp_path):
    refused("study", "flat", "--bins", 0, "--out", tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_a_file_whose_name_is_no_text_is_studied_and_named(tmp_path):
    name = os.fsdecode(b"wall-\xff.toml")
    geo.rectangular_teeth(2.0).save(tmp_path / name)
    for command in (["study", name, "--bins", "4", "--out", "found"], ["gap", name]):
        done = ended("-m", "asperity", *command, cwd=tmp_path, errors="replace")
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "found" / "wall.png").exists()
