"""Results in notebooks, in format strings and as data frames."""

import math
import sys
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.estimates import Estimate
from asperity.study import study_wall
from commands import ended
from html_pages import Balanced

LAW = ker.henyey_greenstein(0.5)
ISLAND = geo.Wall([geo.Segment((0, -1), (1, -1))], islands=[[geo.Arc((0.3, -0.4), (0.1, 0.2), 0, 2 * math.pi)]])
GAP = Estimate(0.0373214, 0.00004, "estimate", "two <resolutions>")


def text_of(value) -> str:
    return "".join(Balanced(value._repr_html_()).text)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: LAW, ["henyey_greenstein(0.5)", "reversible"]),
        (lambda: ker.WallLaw(geo.flat()), ["WallLaw", "parts", "specular()"]),
        (lambda: ker.discretise(LAW, ker.Bins(4)), ["Bins(4)", "Frobenius error"]),
        (lambda: spec.spectrum(LAW, k=3), ["Spectrum gap 0.5", "0 even", "1 odd", "2 even", "isolated"]),
        (lambda: spec.spectral_gap(LAW), ["SpectralGap 0.5", "isolated", "paper", ".evidence"]),
        (lambda: spec.enclosures(LAW, 2), ["0 even", "1 odd", "0.5000"]),
        (lambda: GAP, ["0.03732(5)", "estimate", ".method"]),
        (lambda: study_wall(geo.flat(), "a & b", bins=4), ["Study of a & b", "diffusion"]),
    ],
    ids=["law", "wall law", "matrix", "spectrum", "gap", "enclosures", "estimate", "study"],
)
def test_a_notebook_shows_a_table_of_what_matters(make, words):
    text = text_of(make())
    assert all(word in text for word in words), text


@pytest.mark.parametrize("name", geo.WALLS)
def test_a_notebook_shows_a_small_picture_of_every_wall(name):
    wall = geo.WALLS[name].build()
    for one in (wall, wall.scaled(1e-6), geo.Wall.mirrored(wall)):
        page = one._repr_html_()
        assert page.count("<path") == 2 and len(page) < 60_000 and "nan" not in page
        assert "period" in text_of(one)


def test_the_picture_has_every_island():
    assert ISLAND._repr_html_().count("<path") == 4


def test_an_estimate_prints_its_error_in_units_of_the_last_digit():
    assert str(GAP) == f"{GAP}" == "0.03732(5)" and f"{GAP:.3f}" == "0.037"
    assert str(Estimate(0.03732, 0.00004, "bound", "")) == "0.03732(4)"
    assert str(spec.spectral_gap(LAW)).startswith("0.5")


@given(
    st.floats(-1e12, 1e12, allow_nan=False), st.floats(1e-14, 1e6, allow_nan=False, exclude_min=True),
)  # fmt: skip
def test_the_printed_interval_holds_the_interval_and_is_hardly_wider(value, error):
    text = str(Estimate(value, error, "bound", ""))
    mantissa, rest = text.split("(")
    units, exponent = rest.split(")")
    power = int(exponent[1:]) if exponent else 0
    decimals = len(mantissa.partition(".")[2])
    middle = Decimal(mantissa).scaleb(power)
    half = Decimal(units).scaleb(power - decimals)
    assert abs(Decimal(repr(value)) - middle) + Decimal(repr(error)) <= half
    least = max(Decimal(error), Decimal(abs(value)) * Decimal(2) ** -53)
    assert half <= Decimal("1.9") * least + Decimal(10) ** (power - decimals)


def test_an_estimate_has_no_arithmetic():
    for work in (lambda: GAP + GAP, lambda: 2 * GAP, lambda: -GAP, lambda: GAP / 2):
        with pytest.raises(TypeError):
            work()


@pytest.mark.parametrize(
    ("make", "columns", "rows"),
    [
        (lambda: spec.spectrum(LAW, k=3), ["value", "error", "parity", "algebraic", "discretisation", "sampling"], 3),
        (lambda: spec.enclosures(LAW, 2), ["value", "low", "high", "label", "index"], 2),
        (
            lambda: spec.work_precision(
                spec.WorkProblem("a", spec.ReferenceValue(0.0, 0.0, "by hand")), [spec.WorkMethod("b", float)], [1, 2],
                repeats=1,
            ),
            ["method", "budget", "status", "least", "error"], 2,
        ),
        (
            lambda: ker.limit_study(
                geo.Disk(), geo.triangular_teeth(1.0), [0.1, 0.05, 0.02], np.random.default_rng(0), samples=(4, 4, 4)
            ),
            ["scale", "spacing", "distance", "distance_error", "shift"], 3,
        ),
    ],
    ids=["spectrum", "enclosures", "work", "limit"],
)  # fmt: skip
def test_a_table_of_results_is_a_data_frame(make, columns, rows):
    pytest.importorskip("pandas")
    frame = make().to_frame()
    assert set(columns) <= set(frame.columns) and len(frame) == rows


SWEPT = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.5]})


@pytest.mark.parametrize(
    ("library", "call", "extra"),
    [
        ("pandas", lambda: spec.spectrum(LAW, k=2).to_frame(), "studies"),
        ("xarray", lambda: ker.discretise(LAW, ker.Bins(2)).to_xarray(), "studies"),
        ("pandas", SWEPT.to_frame, "studies"),
        ("xarray", SWEPT.to_xarray, "studies"),
        ("SurfaceTopography", lambda: geo.read_profile("scan.opd"), "profiles"),
        (
            "SurfaceTopography.Generation",
            lambda: geo.random_wall(geo.HeightCorrelation(1), 16, rms_slope=1),
            "profiles",
        ),
    ],
)
def test_without_a_library_the_message_names_the_extra(library, call, extra, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scan.opd").write_bytes(b"\xff\xfe\x00\x01" * 20)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=rf"asperity\[{extra}\]"):
        call()


@pytest.mark.parametrize("frame", ["paper", "specular"])
def test_a_matrix_as_a_table_has_its_bins_in_radians_and_its_error(frame):
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    edges = np.array([0.0, 0.5, 1.25, np.pi - 1.25, np.pi - 0.5, np.pi])
    P = ker.discretise(ker.henyey_greenstein(0.4), ker.Bins(edges))
    P = P if frame == "paper" else P.in_specular_frame()
    table, array = P.to_frame(), P.to_xarray()
    assert np.array_equal(table.to_numpy(), P.array) and np.array_equal(array.values, P.array)
    # the row is the incoming bin: rows sum to 1, columns do not
    assert np.allclose(table.sum(axis="columns"), 1.0, atol=1e-9) and not np.allclose(table.sum(axis="index"), 1.0)
    assert np.allclose(array.sum("outgoing"), 1.0, atol=1e-9)
    assert float(array.sel(incoming=0.3, outgoing=1.0, method="nearest")) == P.array[0, 1]
    assert table.loc[0.25, 0.875] == P.array[0, 1]
    for name in ("incoming", "outgoing"):
        assert array[f"{name}_low"].values.tolist() == edges[:-1].tolist() and array[name].attrs["units"] == "rad"
        assert array[f"{name}_high"].values.tolist() == edges[1:].tolist()
    assert np.allclose(array["weight"], -np.diff(np.cos(edges)) / 2, atol=1e-15)
    for attributes in (table.attrs, array.attrs):
        assert attributes["frobenius_error"] == float(P.error) and attributes["error_kind"] == P.error.kind
        assert attributes["convention"] == frame


def test_a_matrix_without_bins_of_one_angle_is_no_table():
    P = ker.discretise(LAW, ker.Legendre(4))
    pair = ker.discretise(LAW, ker.Bins(2))
    for matrix in (P, pair.tensor(pair)):
        for make in (matrix.to_frame, matrix.to_xarray):
            with pytest.raises(InputError, match=r"discretise in Bins\(64\)"):
                make()


def test_pandas_is_loaded_by_to_frame_alone():
    code = "import sys, asperity.spectral as s; s.Spectrum; assert 'pandas' not in sys.modules"
    assert ended("-c", code).returncode == 0
