"""Sweeps: the long table, its forms, checkpoints, extremes and chosen points."""

import csv
import io
import json
import sqlite3
import sys
from dataclasses import replace

import numpy as np
import pytest

from asperity import AsperityError, Estimate, FileExistsRefusal, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.sweeps.named_families import NamedFamily
from commands import parts_in, refused, run

GRID = {"diffuse_fraction": [0.25, 0.5, 1.0]}
EVERYTHING = ["gap", "gap_specular", "slem", "relaxation_time", "resistance", "eta", "accommodation"]


def without_seconds(table):
    return [replace(row, seconds=0.0) for row in table.rows]


def parabola(top, error, height=1.0):
    """A family of laws and a quantity with its maximum at ``top``, each value with this error."""

    def quantity(law):
        wobble = np.sin(1e6 * law.terms[0][0])
        return Estimate(height - (law.terms[0][0] - top) ** 2 + 0.9 * error * wobble, error, "estimate", "made up")

    return ker.maxwell, quantity


def test_maxwells_laws_have_their_closed_forms():
    table = spec.sweep(ker.maxwell, GRID, EVERYTHING)
    for row in table.rows:
        f = row.point["diffuse_fraction"]
        diffuse, smooth = 0.75 * (1 + np.pi**2 / 16), 1.0
        known = {
            "gap": f, "gap_specular": f, "slem": 1 - f, "resistance": f * diffuse + (1 - f) * smooth,
            "relaxation_time": -1 / np.log1p(-f) if f < 1 else 0.0, "eta": (2 - f) / f, "maxwell_misfit": 0.0,
        }  # fmt: skip
        assert row.error is not None and abs(row.value - known.get(row.quantity, f)) <= row.error + 1e-14, row


def test_the_table_is_long_and_in_the_order_of_the_grid():
    table = spec.sweep(
        lambda a, b: a * ker.lambertian() + (1.0 - a) * (ker.specular() if b == "level" else ker.retroreflection()),
        {"b": ["level", "back"], "a": [0.5, 1.0]},
        ["resistance", "gap"],
    )
    assert [(row.point["b"], row.point["a"], row.quantity) for row in table.rows] == [
        (b, a, q) for b in ("level", "back") for a in (0.5, 1.0) for q in ("resistance", "gap")
    ]
    assert table.quantities == ("resistance", "gap")
    assert all(row.version and row.seconds >= 0.0 and row.kind and row.method for row in table.rows)


def test_zipped_values_belong_together():
    table = spec.sweep(
        lambda a, b: a * ker.lambertian() + b * ker.specular(), {"a": [0.25, 0.5], "b": [0.75, 0.5]}, zipped=True
    )
    assert [row.value for row in table.rows] == [0.25, 0.5]
    data = table.to_xarray()
    assert dict(data.sizes) == {"point": 2}
    assert data["gap"].sel(point=1) == 0.5 and data["b"].values.tolist() == [0.75, 0.5]


@pytest.mark.parametrize("name", ["gap", "gap_specular"])
def test_gaps_are_in_the_convention_that_the_law_carries_and_in_the_specular_one(name):
    law = ker.CircularArcLaw(0.4)
    (row,) = spec.sweep(ker.CircularArcLaw, {"half_angle": [0.4]}, name, 1e-4).rows
    known = spec.spectral_gap(law if name == "gap" else law.in_specular_frame(), 1e-4)
    assert (row.value, row.error, row.verdict, row.kind) == (known.value, known.error, known.verdict, known.kind)
    (turned,) = spec.sweep(
        lambda half_angle: ker.CircularArcLaw(half_angle).in_specular_frame(), {"half_angle": [0.4]}, name, 1e-4
    ).rows
    assert (turned.value != row.value) == (name == "gap"), "gap_specular is the gap in that convention of any law"


def test_refusals_are_rows_and_stop_no_other_point():
    def fragile(law):
        raise ZeroDivisionError("a fault of the user's")

    def careless(law):
        return 0.5

    def unknown(law):
        return Estimate(np.nan, 1.0, "estimate", "made up")

    asked = ["gap", "eta", fragile, careless, unknown]
    table = spec.sweep(ker.maxwell, {"diffuse_fraction": [2.0, 0.0, 0.5]}, asked)
    found = {(row.point["diffuse_fraction"], row.quantity): row for row in table.rows}
    assert len(found) == 15
    assert "expected a number in [0, 1]" in found[2.0, "gap"].message and found[2.0, "gap"].value is None
    assert "the diffusivity is infinite" in found[0.0, "eta"].message and found[0.0, "gap"].verdict == "no gap"
    assert found[0.5, "fragile"].message == "ZeroDivisionError: a fault of the user's"
    assert "unknown: expected finite numbers, got nan" in found[0.5, "unknown"].message
    assert "expected an Estimate" in found[0.5, "careless"].message
    assert found[0.5, "eta"].value == pytest.approx(3.0) and found[0.5, "eta"].message == ""


def test_an_error_that_cannot_be_printed_or_written_is_a_row_too(tmp_path):
    class Silent(Exception):
        def __str__(self):
            raise ValueError("no words")

    def family(k):
        if k < 2:
            raise Silent if k else OSError(2, "no file", "\udcff")
        return ker.maxwell(0.5)

    table = spec.sweep(family, {"k": [0, 1, 2]}, checkpoint=tmp_path / "points.h5")
    assert [row.value for row in table.rows] == [None, None, 0.5]
    assert "no file" in table.rows[0].message and "Silent" in table.rows[1].message
    assert table.to_csv().encode() and spec.SweepTable.of_json(table.to_json()).rows == table.rows


# ---- the forms of a table ---------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def table():
    return spec.sweep(ker.maxwell, {"diffuse_fraction": [0.1, 0.3, 2.0]}, ["gap", "relaxation_time", "eta"])


def test_json_gives_the_table_back_to_the_bit_with_infinite_errors_too(table):
    certain = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.0]}, "relaxation_time")
    assert np.isinf(certain.rows[0].error)
    for one in (table, certain):
        assert spec.SweepTable.of_json(one.to_json()) == one


def test_csv_has_all_digits_and_empty_cells_for_what_was_refused(table):
    rows = list(csv.DictReader(io.StringIO(table.to_csv())))
    assert list(rows[0]) == [
        "diffuse_fraction", "quantity", "value", "error", "kind", "verdict", "method", "seconds", "version", "message"
    ]  # fmt: skip
    assert [float(row["value"]) if row["value"] else None for row in rows] == [row.value for row in table.rows]
    assert rows[-1]["value"] == rows[-1]["error"] == "" and rows[-1]["message"]


def test_frames_and_parquet_hold_the_same_columns(table, tmp_path):
    pandas = pytest.importorskip("pandas")
    frame = table.to_frame()
    assert frame["value"].dtype == frame["error"].dtype == np.float64
    assert frame[frame["value"].isna()]["diffuse_fraction"].tolist() == [2.0] * 3
    table.to_parquet(tmp_path / "table.parquet")
    pandas.testing.assert_frame_equal(pandas.read_parquet(tmp_path / "table.parquet"), frame)
    assert [path.name for path in tmp_path.iterdir()] == ["table.parquet"]


def test_a_data_set_has_dimensions_errors_and_units():
    table = spec.sweep(
        lambda a, b: a * ker.lambertian() + (1.0 - a) * (b * ker.specular() + (1.0 - b) * ker.lambertian()),
        {"a": [0.25, 0.75], "b": [0.0, 0.5, 1.0]},
        ["gap", "relaxation_time"],
    )
    data = table.to_xarray()
    assert dict(data.sizes) == {"a": 2, "b": 3}
    assert float(data["gap"].sel(a=0.25, b=0.5)) == pytest.approx(0.625)
    assert data["gap_error"].shape == (2, 3) and data["gap"].attrs["units"] == "1"
    assert data["relaxation_time"].attrs["units"] == "collisions"
    assert data["gap_verdict"].values.shape == (2, 3)


def test_without_pandas_csv_and_json_are_still_written(table, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert [path.name for path in table.save(tmp_path)] == ["table.csv", "table.json"]
    with pytest.raises(FileExistsRefusal, match=r"table\.csv"):
        table.save(tmp_path)


def test_the_picture_marks_verdicts_and_shades_where_there_is_no_gap():
    from matplotlib.figure import Figure

    table = spec.sweep(
        lambda fraction: ker.maxwell(max(fraction - 0.2, 0.0)), {"fraction": [0.0, 0.1, 0.2, 0.4, 1.0, 9.0]}
    )
    ax = table.plot(ax=Figure().subplots())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["no gap", "isolated"]
    (shaded,) = ax.patches
    assert (shaded.get_x(), shaded.get_x() + shaded.get_width()) == (0.0, 0.2)
    assert ax.get_xlabel() == "fraction"


def test_the_axes_of_a_picture_have_wall_and_unit():
    from matplotlib.figure import Figure

    for family, name in ((geo.focusing_arcs, "focusing_arcs"), (NamedFamily("focusing-arcs"), "focusing-arcs")):
        table = spec.sweep(family, {"half_angle": [1.0, 1.2]}, "relaxation_time", tolerance=1e-2)
        again = spec.SweepTable.of_json(table.to_json())
        assert again == table
        ax = again.plot(ax=Figure().subplots())
        assert ax.get_xlabel() == f"half angle of {name} (rad)" and ax.get_ylabel() == "relaxation time (collisions)"


# ---- checkpoints ------------------------------------------------------------------------------------------------


def test_checkpoints_hold_text_and_no_pickle(tmp_path):
    path = tmp_path / "arcs.sweep"
    spec.sweep(ker.maxwell, GRID, checkpoint=path)
    parts = parts_in(path)
    assert len(parts) == 3
    assert all(kind == "text" and json.loads(value) and json.loads(key) for key, value, kind in parts)
    assert [path.name for path in tmp_path.iterdir()] == ["arcs.sweep"]


def test_a_wall_in_the_middle_that_has_changed_is_noticed(tmp_path):
    names = [str(tmp_path / f"{k}.toml") for k in range(3)]
    for k, name in enumerate(names):
        geo.triangular_teeth(0.5 + 0.1 * k).save(name)
    asked = {"text": names}
    spec.sweep(geo.wall_from_text, asked, checkpoint=tmp_path / "a")
    geo.triangular_teeth(0.9).save(names[1], overwrite=True)
    with pytest.raises(InputError, match="Differences: walls: "):
        spec.sweep(geo.wall_from_text, asked, checkpoint=tmp_path / "a")


def test_the_checkpoint_of_another_version_is_refused(tmp_path, monkeypatch):
    spec.sweep(ker.maxwell, GRID, checkpoint=tmp_path / "a")
    monkeypatch.setattr("asperity.spectral.sweeps.running.__version__", "9.9")
    with pytest.raises(InputError, match=r"version: '.*' there, '9\.9' here"):
        spec.sweep(ker.maxwell, GRID, checkpoint=tmp_path / "a")


@pytest.mark.parametrize("content", [b"not a checkpoint, but somebody's notes" * 100, b"short", None])
def test_a_file_that_is_no_checkpoint_is_refused_and_unharmed(tmp_path, content):
    if content is None:
        with sqlite3.connect(tmp_path / "a") as file:
            file.execute("CREATE TABLE diary (day TEXT)")
        file.close()
    else:
        (tmp_path / "a").write_bytes(content)
    before = (tmp_path / "a").read_bytes()
    with pytest.raises(InputError, match="is not a checkpoint" if content else "a database of something else"):
        spec.sweep(ker.maxwell, GRID, checkpoint=tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == before


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot write there"):
        spec.sweep(ker.maxwell, GRID, checkpoint=tmp_path / "missing" / "a")


# ---- chosen points ----------------------------------------------------------------------------------------------
def kinked(law):
    """|p - 0.31|, smoothed at its corner."""
    return Estimate(np.hypot(law.terms[0][0] - 0.31, 0.01), 0.0, "bound", "made up")


def test_points_are_put_where_the_curve_bends(tmp_path):
    grid = {"diffuse_fraction": spec.Between(0.01, 0.99, points=30, resolution=1e-6)}
    table = spec.sweep(ker.maxwell, grid, kinked, checkpoint=tmp_path / "a")
    x = np.array([row.point["diffuse_fraction"] for row in table.rows])
    assert 30 <= x.size <= 33 and np.all(np.diff(x) > 0.0) and (x[0], x[-1]) == (0.01, 0.99)
    near = np.diff(x)[np.searchsorted(x, 0.31) - 1]
    assert near < 0.2 * np.median(np.diff(x)) or near < 0.01
    # gone on with, the points are the same, and so they are without a checkpoint
    assert spec.sweep(ker.maxwell, grid, kinked, checkpoint=tmp_path / "a") == table
    assert without_seconds(spec.sweep(ker.maxwell, grid, kinked)) == without_seconds(table)


def test_a_wanted_resolution_ends_the_choice_and_refused_points_do_not_stop_it():
    coarse, fine = (
        spec.sweep(ker.maxwell, {"diffuse_fraction": spec.Between(0.01, 1.5, 200, resolution)}, kinked)
        for resolution in (0.3, 0.05)
    )
    assert len(coarse.rows) < len(fine.rows) < 200
    assert any(row.value is None for row in fine.rows)


def test_each_value_of_the_other_parameters_has_its_own_curve():
    grid = {"b": [0.5, 1.0], "a": spec.Between(0.01, 0.99, points=6)}
    table = spec.sweep(lambda a, b: ker.maxwell(a * b), grid, "gap")
    assert [row.point["b"] for row in table.rows] == [0.5] * 6 + [1.0] * 6
    assert not table.zipped or table.to_xarray().sizes == {"point": 12}


# ---- extremes ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("evaluations", [0, 4, 12, 60])
@pytest.mark.parametrize("error", [1e-12, 1e-3])
@pytest.mark.parametrize("top", [0.3, 0.5123])
def test_an_extremum_has_errors_that_hold_and_that_evaluations_make_smaller(top, error, evaluations):
    family, quantity = parabola(top, error)
    table = spec.sweep(family, {"diffuse_fraction": np.linspace(0.1, 0.9, 7)}, quantity)
    found = table.extremum(evaluations=evaluations)
    assert abs(found.parameter.value - top) <= found.parameter.error
    assert abs(found.value.value - 1.0) <= found.value.error < 0.02
    assert not found.at_end and found.largest and found.evaluations <= evaluations
    if evaluations == 60:
        assert found.value.error < 10.0 * error + 1e-9 and found.parameter.error < 5.0 * np.sqrt(error) + 1e-4


def test_the_smallest_value_and_the_end_of_a_sweep():
    table = spec.sweep(ker.maxwell, {"diffuse_fraction": np.linspace(0.1, 0.9, 5)}, ["gap", kinked])
    least = table.extremum("kinked", largest=False)
    assert abs(least.parameter.value - 0.31) <= least.parameter.error < 0.01
    assert abs(least.value.value - 0.01) <= least.value.error
    most = table.extremum("gap")
    assert repr(most).startswith(f"Extremum largest gap {most.value} at ")
    assert most.at_end and most.value.value == 0.9 and abs(most.parameter.value - 0.9) <= most.parameter.error


# ---- the command line -------------------------------------------------------------------------------------------
def test_the_command_writes_its_folder_and_goes_on_there(tmp_path):
    asked = ["sweep", "focusing-arcs", "--over", "half_angle=0.2:1.7:3", "--quantity", "resistance,eta", "--out"]
    first = run(*asked, tmp_path / "arcs")
    assert first.exit_code == 0, first.output
    assert "2 of 6: half_angle" in first.stdout and "expected a number in (0, 1.5708], got 1.7" in first.stdout
    names = {"sweep.checkpoint", "table.csv", "table.json", "table.parquet", "table.png"}
    assert {path.name for path in (tmp_path / "arcs").iterdir()} == names
    before = (tmp_path / "arcs" / "table.csv").read_bytes()
    assert run(*asked, tmp_path / "arcs").exit_code == 0
    # the seconds too: nothing was computed again
    assert (tmp_path / "arcs" / "table.csv").read_bytes() == before
    other = run(*asked, tmp_path / "arcs", "--tolerance", "1e-3")
    assert other.exit_code == 1 and "tolerance: 1e-06 there, 0.001 here" in other.stderr
    assert run(*asked, tmp_path / "arcs", "--tolerance", "1e-3", "--force").exit_code == 0


def test_the_command_takes_several_walls_and_lists(tmp_path):
    geo.triangular_teeth(0.7).save(tmp_path / "teeth.toml")
    found = run("sweep", tmp_path / "teeth.toml", "flat", "--out", tmp_path / "a")
    assert found.exit_code == 0, found.output
    rows = list(csv.DictReader(io.StringIO((tmp_path / "a" / "table.csv").read_text())))
    assert [(row["wall"], row["verdict"]) for row in rows] == [
        (str(tmp_path / "teeth.toml"), "no gap"), ("flat", "no gap")
    ]  # fmt: skip
    listed = run(
        "sweep", "rectangular-teeth", "--over", "height-to-width=1,2", "--quantity", "resistance", "--out",
        tmp_path / "b",
    )  # fmt: skip
    assert listed.exit_code == 0 and len((tmp_path / "b" / "table.csv").read_text().splitlines()) == 3


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("focusing-arcs", "--over", "angle=0:1:2"), "has no parameter 'angle'"),
        (("focusing-arcs", "--over", "half_angle=0:1"), "LOW:HIGH:POINTS"),
        (("focusing-arcs", "flat", "--over", "half_angle=0:1:2"), "expected one named wall"),
        (("focusing-arcs", "--adaptive"), "--over"),
        (("nonsense", "--over", "half_angle=0:1:2"), "expected a named wall"),
        (("focusing-arcs", "--over", "half_angle=0:1:2", "--quantity", "gaps"), "expected one of gap"),
    ],
)
def test_the_command_refuses_nonsense_in_one_line(tmp_path, arguments, words):
    assert words in refused("sweep", *arguments, "--out", tmp_path / "a")


def test_tables_without_their_checkpoint_are_not_replaced(tmp_path):
    (tmp_path / "table.csv").write_text("mine")
    assert "--force" in refused("sweep", "flat", "--out", tmp_path)
    assert (tmp_path / "table.csv").read_text() == "mine"


def test_an_address_where_no_scheduler_is_gets_one_line():
    with pytest.raises(AsperityError, match="no scheduler answers"):
        spec.sweep(ker.maxwell, GRID, client="nonsense://127.0.0.1:1")
