"""Measured profiles: from positions and heights to the vertices of a wall, and from files to positions and heights."""

import re
import sys
import warnings
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity.errors import InputError
from asperity.geometry.cells import profile as profiles


def vertices_of_profile(x, height, seam="mirror"):
    return profiles.vertices_of_profile(geo.Profile(x, height), seam)


def profile_of(folder, text, **options):
    (folder / "scan.txt").write_text(text, encoding="utf-8")
    return geo.read_profile(folder / "scan.txt", **options)


# ---- from positions and heights to vertices ----------------------------------------------------------------------
EXACT = {
    "two rows, mirrored": ([2, 3], [0, 4], "mirror", [[0, 0], [1, -4], [2, 0]]),
    "two rows, a step": ([2, 3], [0, 4], "step", [[0, 0], [0, -4], [1, 0]]),
    "top in the middle, mirrored": ([10, 11, 13], [2, 5, 4], "mirror", [[0, 0], [2, -1], [4, 0], [5, -3], [6, 0]]),
    "top in the middle, a step": ([10, 11, 13], [2, 5, 4], "step", [[0, 0], [2, -1], [2, -3], [3, 0]]),
    "the ends are level": ([0, 1, 2], [1, 0, 1], "step", [[0, 0], [1, -1], [2, 0]]),
    "top at the end": ([0, 1, 3], [1, 0, 3], "step", [[0, 0], [0, -2], [1, -3], [3, 0]]),
    "joints of a flat top": ([0, 1, 2, 4, 5], [3, 3, 3, 0, 3], "step", [[0, 0], [2, 0], [4, -3], [5, 0]]),
    "joints of a flat top behind": ([0, 1, 2, 3, 4], [3, 0, 3, 3, 3], "step", [[0, 0], [1, -3], [2, 0], [4, 0]]),
    "joints below the top stay": (
        [0, 1, 2, 3, 4],
        [1, 0, 0, 0, 1],
        "step",
        [[0, 0], [1, -1], [2, -1], [3, -1], [4, 0]],
    ),
    "two tops": ([0, 1, 2, 3, 5], [0, 7, 1, 7, 0], "step", [[0, 0], [1, -6], [2, 0], [4, -7], [5, 0]]),
    "a height of -0": ([0, 1, 2, 3], [0.0, -0.0, -1, 0], "step", [[0, 0], [1, 0], [2, -1], [3, 0]]),
    "level": ([1, 2, 4], [7, 7, 7], "step", [[0, 0], [3, 0]]),
}


@pytest.mark.parametrize("case", EXACT)
def test_the_vertices_of_small_profiles_are_those_drawn_by_hand(case):
    x, height, seam, vertices = EXACT[case]
    found = vertices_of_profile(x, height, seam)
    assert found.tolist() == vertices
    assert not np.signbit(found[:, 0]).any() and not np.signbit(found[found[:, 1] == 0.0, 1]).any()


def test_the_seam_is_a_mirror_where_nothing_is_said():
    assert vertices_of_profile([0, 1], [0, 1]).tolist() == [[0, 0], [1, -1], [2, 0]]


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(-5, 5)), min_size=2, max_size=12))
def test_a_period_has_the_heights_of_the_profile_and_of_its_mirror_image(rows):
    """In whole numbers, so that nothing is rounded: the vertices without the flat joints, from any top on."""
    x, height = np.cumsum([step for step, _ in rows]), np.array([value for _, value in rows])
    vertices = vertices_of_profile(x, height, "mirror")
    period = 2 * (x[-1] - x[0])
    assert vertices[0].tolist() == [0, 0] and vertices[-1].tolist() == [period, 0]
    assert np.all(np.diff(vertices[:, 0]) > 0) and np.all(vertices[:, 1] <= 0)
    start = x[: len(x)][np.argmax(height)] if height.argmax() < len(x) else 0
    at = start + np.arange(2 * period) / 2
    folded = x[-1] - np.abs((at - x[0]) % period - (x[-1] - x[0]))
    assert np.interp(at - start, vertices[:, 0], vertices[:, 1]) == pytest.approx(
        np.interp(folded, x, height) - height.max(), abs=1e-12
    )


# ---- files of instruments ----------------------------------------------------------------------------------------
@pytest.fixture
def reads(monkeypatch, tmp_path):
    """Put a stand-in in the place of SurfaceTopography, which opens files by this function; and a file."""
    (tmp_path / "scan.opd").write_bytes(b"\xff\xfe\x00")

    def put(read_topography):
        package = ModuleType("SurfaceTopography")
        package.read_topography = read_topography
        monkeypatch.setitem(sys.modules, "SurfaceTopography", package)
        return tmp_path / "scan.opd"

    return put


@pytest.fixture
def instrument(reads):
    """A file of a stand-in, which holds what the test gives."""
    return lambda heights, positions: reads(
        lambda path: SimpleNamespace(heights=lambda: heights, positions=lambda: positions, unit=None)
    )


def test_line_scans_of_instruments_are_read_from_files_that_are_no_columns(instrument, tmp_path):
    scan = instrument(np.ma.array([1.0, 3.0, 2.0]), np.array([0.0, 0.5, 2.0]))
    (tmp_path / "scan.xyz").write_text("some words first\n1 2 3")
    for file in (scan, tmp_path / "scan.xyz"):
        x, height = geo.read_profile(file)
        assert x.tolist() == [0.0, 0.5, 2.0] and height.tolist() == [1.0, 3.0, 2.0]
        assert x.dtype == height.dtype == np.float64
    # whatever its suffix says, a file of columns with a fault is not given away
    (tmp_path / "scan.xyz").write_text("0 1\n1 2\n3")
    with pytest.raises(InputError, match=r"scan\.xyz, line 3"):
        geo.read_profile(tmp_path / "scan.xyz")
    (tmp_path / "map.TXT").write_text("1 2 3\n4 5 6\n")
    assert geo.read_profile(tmp_path / "map.TXT", row=0).height.tolist() == [1.0, 3.0, 2.0]


def test_of_a_map_one_row_along_x_is_taken(instrument):
    heights = np.array([[0.0, 1.0, 2.0, 8.0, 6.0], [3.0, 1.0, 0.0, 9.0, 7.0]])
    along = np.array([[0.0, 0.1, 0.2, 0.3, 0.4], [1.0, 1.1, 1.2, 1.3, 1.4]])
    file = instrument(heights, (along, -along))
    assert [part.tolist() for part in geo.read_profile(file)] == [[0.2, 1.2], [2.0, 0.0]]
    for row in range(5):
        x, height = geo.read_profile(file, row=row)
        assert x.tolist() == along[:, row].tolist() and height.tolist() == heights[:, row].tolist()
    for row in (-1, 5):
        with pytest.raises(InputError, match=f"row: expected a whole number from 0 to 4, got {row}"):
            geo.read_profile(file, row=row)


def test_undefined_heights_are_counted_refused_and_interpolated(instrument):
    file = instrument(np.ma.array([1.0, np.inf, 2.0, 4.0], mask=[True, False, False, False]), np.arange(4.0))
    profile = geo.read_profile(file)
    assert profile.undefined == 2
    with pytest.raises(InputError, match=r"2 of 4 .* the first at index \(0,\); use Profile\.interpolated"):
        geo.Wall.from_profile(profile)
    with pytest.raises(InputError, match=r"scan\.opd: height: 2 of 4 heights are undefined.*interpolate=yes"):
        geo.wall_from_text(str(file))
    assert profile.interpolated().height.tolist() == [2.0, 2.0, 2.0, 4.0]
    assert geo.wall_from_text(f"{file}:interpolate=yes").depth == 2.0


@pytest.mark.parametrize(
    ("failure", "words"), [(ValueError("first\nsecond"), r"\(first\)"), (ValueError(), r"\(ValueError\)")]
)
def test_what_a_reader_of_instruments_says_is_told_in_one_line(failure, words, reads):
    def fails(path):
        raise failure

    with pytest.raises(InputError, match=rf"scan\.opd: SurfaceTopography cannot read it {words}"):
        geo.read_profile(reads(fails))


def test_warnings_of_an_instruments_package_are_not_passed_on(reads):
    def warns(path):
        warnings.warn("old format", DeprecationWarning, stacklevel=1)
        return SimpleNamespace(heights=lambda: np.arange(3.0), positions=lambda: np.arange(3.0), unit=None)

    assert geo.read_profile(reads(warns)).height.tolist() == [0.0, 1.0, 2.0]


def test_instrument_files_are_read_with_the_extra(tmp_path):
    topography = pytest.importorskip("SurfaceTopography")
    heights = np.array([[0.0, 1.0, 2.0], [3.0, 1.0, 0.0], [2.0, 5.0, 1.0], [1.0, 0.0, 2.0]])
    topography.Topography(heights, (2.0, 1.5), unit="um").to_netcdf(str(tmp_path / "map.nc"))
    x, height = geo.read_profile(tmp_path / "map.nc")
    assert x == pytest.approx([0.0, 0.5, 1.0, 1.5]) and height == pytest.approx(heights[:, 1])
    assert geo.read_profile(tmp_path / "map.nc", row=2).height == pytest.approx(heights[:, 2])
    with pytest.raises(InputError, match="row"):
        geo.read_profile(tmp_path / "map.nc", row=3)
    (tmp_path / "broken.opd").write_bytes(b"\xff\xfe\x00\x01" * 20)
    with pytest.raises(InputError, match="SurfaceTopography cannot read it"):
        geo.read_profile(tmp_path / "broken.opd")


# ---- units -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "head",
    [
        "x [um], height [nm]", "x (µm); z (nm)", "# position [um]  height [nm]", "# a scan (of 2024)\nx [um] z [nm]",
        "# x [um]\tz [nm]\nx, z",
    ],
)  # fmt: skip
def test_units_in_the_header_are_honoured(head, tmp_path):
    profile = profile_of(tmp_path, f"{head}\n0 1000\n1 2000\n3 0\n")
    assert profile.x.tolist() == [0, 1, 3] and profile.height.tolist() == [1, 2, 0]
    assert profile.unit in ("um", "µm")


def test_units_that_are_given_count_more_than_the_header(tmp_path):
    text = "x [um], height [nm]\n0 1\n1 2\n"
    profile = profile_of(tmp_path, text, units=("mm", "um"))
    assert profile.unit == "mm" and profile.height == pytest.approx([1e-3, 2e-3], rel=1e-12)
    assert profile_of(tmp_path, text, units="um").height.tolist() == [1.0, 2.0]
    assert profile.in_unit("um").x.tolist() == [0.0, 1000.0]


def test_the_unit_reaches_the_axes_and_the_file_of_the_wall(tmp_path):
    (tmp_path / "scan.txt").write_text("x [um], height [nm]\n0 0\n1 -500\n2 0\n", encoding="utf-8")
    wall = geo.wall_from_text(str(tmp_path / "scan.txt"))
    disk = geo.Disk()
    for one in (wall, wall.scaled(2.0), wall.mirrored(), wall.foreshorten(disk), wall.cell):
        assert one.unit == "um"
    ax = geo.draw_wall(wall)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (um)", "y (um)")
    wall.save(tmp_path / "wall.toml")
    again = geo.load_wall(tmp_path / "wall.toml")
    assert again.unit == "um" and again == wall == geo.Wall.from_vertices(wall.vertices)


def test_a_slope_above_a_hundred_is_taken_for_mixed_units():
    x, height = np.arange(7.0, 12.0), np.array([0, 1, 0, 1, 0])
    with pytest.warns(UserWarning, match="mean slope is 100: are the heights in a smaller unit"):
        geo.Wall.from_profile(x, 100.1 * height)
    geo.Wall.from_profile(x, 100.0 * height)


# ---- how columns are written -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("0 1.5\n1 2.5\n", {}),
        ("x, height\n0, 1.5\n1, 2.5\n", {}),
        ("# a scan\n\n0\t1.5 # first\n1\t2.5", {}),
        ("\ufeff0;1.5\r\n1;2.5\r\n", {}),
        ("\n# 5 5\nposition height # of a scan\n\n0 1.5\n# between # two\n\n1 2.5\n\n", {}),
        ("0,0;1,5\n1,0;2,5\n", {"decimal": ","}),
        ("0,0 1,5\n1,0 2,5\n", {"decimal": ","}),
        ("0|1.5\n1|2.5\n", {"delimiter": "|"}),
        ("7 0 9 1.5\n7 1 9 2.5\n", {"usecols": (1, 3)}),
        ("7 1.5 9 0\n7 2.5 9 1\n", {"usecols": (3, 1)}),
        ("12 words\nof 3 metadata\n0 1.5\n1 2.5\n", {"skiprows": 2}),
        ("0\t1.5\n1\t2.5\n", {"delimiter": "\t"}),
        ("0,1.5\n1,2.5\n", {"delimiter": ","}),
    ],
)
def test_columns_are_read_as_the_options_say(text, options, tmp_path):
    x, height = profile_of(tmp_path, text, **options)
    assert x.tolist() == [0, 1] and height.tolist() == [1.5, 2.5]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_encoding_and_decimal_sign_are_found_and_told_where_one_reading_is_possible(tmp_path, encoding, decimal):
    file = tmp_path / "profil.txt"
    file.write_bytes("Länge [µm];Höhe [nm]\n0.0;1500.5\n1.0;2000.5\n".replace(".", decimal).encode(encoding))
    expected = {"encoding": encoding} if encoding != "utf-8" else {}
    expected |= {"decimal": ","} if decimal == "," else {}
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = geo.read_profile(file)
    assert found.x.tolist() == [0.0, 1.0] and found.height == pytest.approx([1.5005, 2.0005]) and found.unit == "µm"
    assert len(heard) == bool(expected)
    for one in heard:
        call, words = re.search(r"pass (.*?) \(on the command line (.*?)\)", str(one.message)).groups()
        assert eval(f"dict({call})") == expected
        assert geo.read_profile(file, **expected).height.tolist() == found.height.tolist()
        assert geo.wall_from_text(f"{file}:{words}") == geo.Wall.from_profile(found)


def test_commas_that_may_set_off_thousands_are_not_taken_for_decimal_signs(tmp_path):
    text = "1,500;1,250\n2,000;2,250\n"
    with pytest.raises(InputError, match="expected two numbers") as refused:
        profile_of(tmp_path, text)
    options, _ = advised(refused)
    assert options == {"decimal": ","} and profile_of(tmp_path, text, decimal=",").x.tolist() == [1.5, 2.0]


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ('"x [um]","z [nm]"\n"0","1,000.5"\n"1","2,000"\n', {}),
        ('"x [um]";"z [nm]"\n"0,0";"1.000,5"\n"1,0";"2.000"\n', {"decimal": ","}),
        ("x [um];z [nm]\n0;1,000.5\n1;2,000.0\n", {}),
        ("x [um] z [nm]\n0 1'000.5\n1 2'000\n", {}),
        ("x [um]\tz [nm]\n0\t1\u202f000.5\n1\t2\u00a0000\n", {}),
        ("x [um];z [nm]\n0;1.0005D3\n1;2D+03\n", {}),
        ("x [um];z [nm]\n0;+1000.5\n1;2000\n", {}),
    ],
)
def test_numbers_are_read_as_programs_write_them(tmp_path, text, options):
    found = profile_of(tmp_path, text, **options)
    assert found.x.tolist() == [0.0, 1.0] and found.height == pytest.approx([1.0005, 2.0], rel=1e-12)


def test_the_minus_of_typesetting_is_a_minus(tmp_path):
    assert profile_of(tmp_path, "0;0\n1;\u22121000\n").height.tolist() == [0.0, -1000.0]


# Headers of a column of positions and one of heights, with metres for each.
HEADERS = {
    "x (position) [um];z (height) [nm]": (1e-6, 1e-9), "x [um];z(1) [nm]": (1e-6, 1e-9),
    "x [um];z [nm] (1)": (1e-6, 1e-9), "Position (mm), Height (raw) (um)": (1e-3, 1e-6),
    "x [micrometer];z [nanometer]": (1e-6, 1e-9), "x [Microns];z [Nanometers]": (1e-6, 1e-9),
    "x [1e-6 m];z [1e-9 m]": (1e-6, 1e-9), "X [10^-6 m];Z [10^-9 m]": (1e-6, 1e-9), "X;Z\num;nm": (1e-6, 1e-9),
    "X\tZ\n[um]\t[nm]": (1e-6, 1e-9), "X,Z\n(mm),(um)": (1e-3, 1e-6), "x [mil];z [uin]": (2.54e-5, 2.54e-8),
    "x [Angstrom];z [nm]": (1e-10, 1e-9), "x [\u212b];z [nm]": (1e-10, 1e-9), "x [inch];z [thou]": (0.0254, 2.54e-5),
    "x [MM];z [UM]": (1e-3, 1e-6), "x_um,z_nm": (1e-6, 1e-9), "Lateral um   Height nm": (1e-6, 1e-9),
    "pos mm\theight µm": (1e-3, 1e-6), "x [metres];z [millimetre]": (1.0, 1e-3), "x (ft) z (inches)": (0.3048, 0.0254),
    "# x [um] z [nm]": (1e-6, 1e-9), "x [μm]; z [µm]": (1e-6, 1e-6), "x /um;z /nm": (1e-6, 1e-9),
    "x in um;z in nm": (1e-6, 1e-9), "Distance: um;Height: nm": (1e-6, 1e-9), "% x[mm] z[um]": (1e-3, 1e-6),
    "x [cm];z [mm]": (1e-2, 1e-3), "X [nm];Z [pm]": (1e-9, 1e-12), "x [µm];height [Å]": (1e-6, 1e-10),
    "X (um)  Z (um)": (1e-6, 1e-6), "x (µm), z (µm) (filtered)": (1e-6, 1e-6), "x {um};z {nm}": (1e-6, 1e-9),
    "x [um] (raw);z [nm] (levelled)": (1e-6, 1e-9), "Length (mm) (1);Height (2) (um)": (1e-3, 1e-6),
    "Distance;Height\nmm;um": (1e-3, 1e-6), "# X;Z\n# um;nm": (1e-6, 1e-9), "x<um>;z<nm>": (1e-6, 1e-9),
    "# made by hand\n# x [um], z [nm]": (1e-6, 1e-9), "x [10**-6 m];z [10**-9 m]": (1e-6, 1e-9),
    "x [1E-3 m];z [1E-6 m]": (1e-3, 1e-6), "x[in];z[mil]": (0.0254, 2.54e-5), "x [um]|z [nm]": (1e-6, 1e-9),
    "x [inches];z [microinch]": (0.0254, 2.54e-8), "x [thou];z [uin]": (2.54e-5, 2.54e-8),
    "x [millimeters];z [micrometers]": (1e-3, 1e-6), "x [Ångström];z [nm]": (1e-10, 1e-9), "x [km];z [m]": (1e3, 1.0),
    "x, um;z, nm": (1e-6, 1e-9), "x: um;z: nm": (1e-6, 1e-9), "x = um;z = nm": (1e-6, 1e-9),
    "X unit:um\nZ unit: nm": (1e-6, 1e-9), "Scan length [mm]; Deviation [nm]": (1e-3, 1e-9),
    "x [Micrometers];z [micro-inch]": (1e-6, None), "x [foo];z [bar]": (None, None), "x [um];z [counts]": (1e-6, None),
    "x [Mm];z [nm]": (None, 1e-9), "Weg (mikrometer);Hoehe (nanometer)": (None, None), "x [um];z [V]": (1e-6, None),
    "x [ms];z [nm]": (None, 1e-9), "x [µ];z [nm]": (None, 1e-9), "x [\"];z [mil]": (None, 2.54e-5),
    "x [px];z [nm]": (None, 1e-9), "x [um];z [a.u.]": (1e-6, None), "x [deg];z [um]": (None, 1e-6),
}  # fmt: skip


@pytest.mark.parametrize("head", HEADERS)
def test_each_header_is_read_right_as_it_stands_or_as_advised(tmp_path, head):
    text = head + "\n0 0\n1 -1000\n2 1000\n".replace(" ", ";" if ";" in head else " ")
    try:
        found = profile_of(tmp_path, text)
        assert None not in HEADERS[head]
    except InputError as refusal:
        options, _ = advised(refusal)
        found = profile_of(tmp_path, text, **options)
        assert None in HEADERS[head] or "skiprows" in options
    for values, size, numbers in zip(
        (found.in_unit("m").x, found.in_unit("m").height), HEADERS[head], ([0, 1, 2], [0, -1000, 1000]), strict=True
    ):
        assert size is None or values == pytest.approx(size * np.array(numbers), rel=1e-9)


@pytest.mark.parametrize(("codes", "count"), [((-9999.0,), 2), ((32767.0,), 1), ((-400.0, -500.0), 2), ((), 0)])
def test_dropouts_are_told_with_what_to_do(tmp_path, codes, count):
    x, rng = np.arange(2000.0), np.random.default_rng(5)
    height = np.cumsum(rng.normal(size=2000)) / 10.0
    for index, code in zip((500, 501), codes * 2 if len(codes) == 1 else codes, strict=False):
        height[index if count == 2 else 500] = code
    file = tmp_path / "scan.txt"
    np.savetxt(file, np.column_stack([x, height]))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        geo.Wall.from_profile(geo.read_profile(file))
    assert len(heard) == bool(count)
    if not count:
        return
    assert f"{count} of 2000 heights, the first {codes[0]:g} at index (500,)" in str(heard[0].message)
    if len(codes) == 1:
        assert f"read the file with undefined={codes[0]:g} (undefined={codes[0]:g})" in str(heard[0].message)
        mended = geo.wall_from_text(f"{file}:undefined={codes[0]:g},interpolate=yes")
    else:
        height[500:502] = np.nan
        mended = geo.Wall.from_profile(geo.Profile(x, height).interpolated())
    assert mended.depth < 20.0


def test_real_grooves_are_no_dropouts():
    x = np.arange(1000.0)
    for height in (np.where(x % 100 == 50, -10.0, 0.0), np.where(x > 500, 0.0, -30.0), np.sin(x / 50) - (x == 7)):
        geo.Wall.from_profile(x, height)


def test_a_trace_that_turns_back_is_not_to_be_sorted():
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    x, height = angle + 1.2 * np.sin(2.0 * angle), np.cos(angle) - 1.0
    with pytest.raises(InputError, match=r"the trace turns back, .*; Wall\.from_vertices takes vertices that overhang"):
        geo.Wall.from_profile(x, height)
    wall = geo.Wall.from_vertices(np.column_stack([x, height]))
    assert wall.arc_length == pytest.approx(np.hypot(np.diff(x), np.diff(height)).sum(), rel=1e-9)
    with pytest.raises(InputError, match="sort=yes"):
        geo.Wall.from_profile([0.0, 1.0, 1.0, 2.0], [0.0, -0.5, -0.5, 0.0])


def test_a_name_with_a_colon_takes_parameters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "C:prof.txt").write_text("0 0\n1 -1\n2 -1\n")
    assert geo.wall_from_text("C:prof.txt:seam=step") == geo.Wall.from_profile([0, 1, 2], [0, -1, -1], seam="step")


def test_an_empty_field_is_an_undefined_height(tmp_path):
    assert profile_of(tmp_path, "0;1\n1;\n2;nan\n3;4\n", delimiter=";").undefined == 2


def test_every_option_has_its_word_in_the_text_of_a_wall(tmp_path):
    file = tmp_path / "scan.txt"
    file.write_bytes("Höhe 1 2\n2,0;0;3,0\n0,0;0;1,0\n1,0;0;\n".encode("latin-1"))
    words = "skiprows=1,encoding=latin-1,delimiter=semicolon,decimal=comma,usecols=0/2,units=um/um,sort=yes"
    wall = geo.wall_from_text(f"{file}:{words},interpolate=yes,seam=step")
    assert wall.vertices.tolist() == [[0, 0], [0, -2], [1, -1], [2, 0]] and wall.unit == "um"
    assert geo.wall_from_text(f"{file}:{words},interpolate=yes,detrend=1").depth == 0.0


# ---- before it is a wall -----------------------------------------------------------------------------------------
def test_sorting_averages_at_one_position_and_leaves_undefined_heights_out():
    found = geo.Profile([2, 0, 2, 1, 0], [3, 1, 5, 9, np.nan]).sorted()
    assert found.x.tolist() == [0, 1, 2] and found.height.tolist() == [1, 9, 4]


@given(st.integers(0, 3), st.lists(st.floats(-1, 1), min_size=6, max_size=12))
def test_what_is_left_of_a_fit_is_orthogonal_to_all_polynomials_of_the_degree(degree, heights):
    x = np.linspace(0.0, 1.0, len(heights))
    rest = geo.Profile(x, heights).detrended(degree).height
    for power in range(degree + 1):
        assert abs(rest @ x**power) < 1e-11


def test_masked_points_of_an_array_are_undefined():
    assert geo.Profile([0, 1, 2], np.ma.array([1.0, 7.0, 2.0], mask=[False, True, False])).undefined == 1


def test_a_map_in_a_text_is_given_to_the_package_that_reads_it(tmp_path):
    pytest.importorskip("SurfaceTopography")
    heights = np.array([[0.0, 1.0, 2.0, 1.5], [3.0, 1.0, 0.0, 1.0], [2.0, 5.0, 1.0, 0.5]])
    head = "# Channel: Main\n# Width: 2.0 µm\n# Height: 1.5 µm\n# Value units: nm\n"
    (tmp_path / "map.txt").write_text(head + "\n".join(" ".join(map(str, row)) for row in heights), encoding="utf-8")
    profile = geo.read_profile(tmp_path / "map.txt")
    # heights in nm, so that the positions become nm
    assert profile.unit == "nm" and profile.x == pytest.approx([0.0, 500.0, 1000.0, 1500.0])
    assert profile.height.tolist() == heights[1].tolist()


# ---- what the columns are ----------------------------------------------------------------------------------------
def advised(refused):
    """The options that a message says to pass, as a dict and as on the command line."""
    found = re.search(r"pass (.*?) \(on the command line (.*?)\)", str(getattr(refused, "value", refused)))
    return eval(f"dict({found[1]})"), found[2]


@pytest.mark.parametrize("unit", ["px", "V", "a.u.", "pixel"])
def test_units_that_are_given_count_before_those_of_the_header(tmp_path, unit):
    for head in (f"x [{unit}], height [nm]", f"x [um], height [{unit}]"):
        text = f"{head}\n0 1000\n1 2000\n"
        with pytest.raises(InputError, match="header: expected two units") as refused:
            profile_of(tmp_path, text)
        options, words = advised(refused)
        assert options == {"units": ("um", "nm")}
        assert profile_of(tmp_path, text, **options).height.tolist() == [1.0, 2.0]
        assert geo.wall_from_text(f"{tmp_path / 'scan.txt'}:{words}").unit == "um"


@pytest.mark.parametrize(
    "head",
    [
        "position mm;slope urad", "position [mm]; slope [urad]", "x(mm)\tSlope (urad)",
        "# x-position [mm]; y-slope [urad]",
        "L(mm)  R1 slope x 1E6  /urad", "x_mm, slope_urad", "x mm slope µrad", "X unit:mm\nZ unit: urad",
        "x [mm]  slope [um/m]",
    ],
)  # fmt: skip
def test_slopes_are_recognised_with_and_without_brackets_and_integrated(tmp_path, head):
    """The derivative of x^2/2 in 10^-6 is x; the trapezoidal rule is exact for it."""
    x = np.linspace(0.0, 4.0, 9)
    rows = "\n".join(f"{at:g} {at:g}" for at in x)
    skipped = next(k for k, line in enumerate(f"{head}\n{rows}".splitlines()) if line == "0 0")
    profile = profile_of(tmp_path, f"{head}\n{rows}", skiprows=skipped)
    assert profile.unit == "mm" and profile.height == pytest.approx(0.5e-6 * x**2, rel=1e-9, abs=1e-18)


def test_slopes_without_units_are_integrated_only_if_told(tmp_path):
    text = "# measured slope\n0 0\n2 1\n1 0.5\n"
    with pytest.raises(InputError, match=r"header: expected units as in 'x \[mm\], slope \[urad\]'") as refused:
        profile_of(tmp_path, text)
    assert "quantity='height'" in str(refused.value)
    options, _ = advised(refused)
    assert profile_of(tmp_path, text, **options).height == pytest.approx([0, 0.25e-6, 1e-6])
    assert profile_of(tmp_path, text, quantity="slope").height.tolist() == [0.0, 0.25, 1.0]
    assert profile_of(tmp_path, text, quantity="height").height.tolist() == [0.0, 1.0, 0.5]
    assert geo.wall_from_text(f"{tmp_path / 'scan.txt'}:quantity=slope").depth == 1.0


@pytest.mark.parametrize(
    ("head", "options"),
    [
        ("x mm; slope mm", {}), ("x mm; slope urad", {"quantity": "height"}), ("x mm; z nm", {"quantity": "slope"}),
        ("x mm; slope urad", {"units": ("mm", "nm")}), ("x deg; z nm", {}), ("x mm; z", {}),
    ],
)  # fmt: skip
def test_contradictions_of_quantity_and_unit_are_refused_with_the_call_that_decides(tmp_path, head, options):
    text = f"{head}\n0 1\n1 2\n2 2\n"
    with pytest.raises(InputError, match=r"scan\.txt, header: expected") as refused:
        profile_of(tmp_path, text, **options)
    call, _ = advised(refused)
    assert profile_of(tmp_path, text, **{**options, **call}).unit in ("mm", "um")


@pytest.mark.parametrize("rows", [3, 51, 300])
@pytest.mark.parametrize(
    ("line", "head", "expected"),
    [
        ("{x} {y} {h}", "", {"usecols": (0, 2)}), ("{k} {x} {h}", "", {"usecols": (1, 2)}),
        ("{x};{h}", "1 of 2\nmade by hand\n", {"skiprows": 2}),
        ("{k};{x};{h};9", "a 1\n", {"usecols": (1, 2), "skiprows": 1}),
        ("{cx} {ch} {ch}", "scan 1\n", {"decimal": ",", "skiprows": 1, "usecols": (0, 2)}),
    ],
)  # fmt: skip
def test_a_text_that_is_no_two_columns_is_refused_with_the_options_that_read_it(tmp_path, rows, line, head, expected):
    x = 0.25 * np.arange(rows)
    h = np.cos(3.0 * x).round(3) + 0.0001
    lines = []
    for k in range(rows):
        words = {"k": k, "x": f"{x[k]:.2f}", "y": 7.5, "h": f"{h[k]:.4f}"}
        lines.append(line.format(**words, cx=words["x"].replace(".", ","), ch=words["h"].replace(".", ",")))
    text = head + "\n".join(lines)
    with pytest.raises(InputError, match="expected two numbers") as refused:
        profile_of(tmp_path, text)
    options, words = advised(refused)
    assert options == expected
    found = profile_of(tmp_path, text, **options)
    assert found.x == pytest.approx(x) and found.height == pytest.approx(h, abs=1e-9)
    assert geo.wall_from_text(f"{tmp_path / 'scan.txt'}:{words}") == geo.Wall.from_profile(found)


@pytest.mark.parametrize("word", ["Bad", "***", "NaN", "-nan", "n/a", "---", "1.#QNAN", "#N/A", "inf", "null", "****"])
def test_the_words_of_instruments_for_no_height_are_undefined_heights(tmp_path, word):
    for between in (" ", ";", "\t"):
        profile = profile_of(tmp_path, f"0{between}1\n1{between}{word}\n2{between}3 # a comment\n")
        assert profile.undefined == 1 and profile.interpolated().height.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match="line 2"):
        profile_of(tmp_path, f"0 1\n{word} 1\n2 3\n")


# ---- periodic profiles, and units that cannot be right -----------------------------------------------------------
def test_a_computed_periodic_profile_wraps_round():
    x = np.arange(4) / 4.0
    wall = geo.Wall.from_profile(x, [0.0, -1.0, -2.0, -1.0], seam="wrap")
    assert wall.vertices.tolist() == [[0, 0], [0.25, -1], [0.5, -2], [0.75, -1], [1, 0]]
    # steps that differ from their mean by a thousandth of it
    assert geo.Wall.from_profile([10, 1009, 2010], [0.0, -1.0, -2.0], seam="wrap").period == 3000


@pytest.mark.parametrize(
    ("unit", "width", "height", "warns"),
    [
        ("m", 160.0, 3e-6, True), ("mm", 160.0, 3e-3, False), ("m", 160.0, 3.0, False), ("m", 0.5, 1e-8, False),
        ("", 1000.0, 1e-8, True), ("m", 160.0, 0.0, False), ("", 1.0, 1e-9, False),
        ("", 160.0, 3e-6, False), ("m", 10.5, 1e-6, True), ("m", 10.0, 1e-6, False),
    ],
)  # fmt: skip
def test_a_width_of_160_metres_for_micrometres_is_taken_for_mixed_units(unit, width, height, warns):
    profile = geo.Profile(np.linspace(0.0, width, 5), height * np.array([0, 1, 0, 1, 0]), unit)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        geo.Wall.from_profile(profile)
    assert [("positions in a smaller unit" in str(one.message)) for one in told] == [True] * warns
    assert all(one.filename == __file__ for one in told)


# ---- vertices begin anywhere -------------------------------------------------------------------------------------
@given(
    st.lists(st.tuples(st.integers(1, 9), st.integers(0, 5)), min_size=2, max_size=8), st.integers(0, 7), st.booleans()
)
def test_vertices_may_begin_anywhere_and_run_either_way(rows, roll, backwards):
    """In whole numbers: the same cell, and so the same law."""
    x, down = np.cumsum([0, *(step for step, _ in rows)]), np.array([0, *(-depth for _, depth in rows[:-1]), 0])
    wall = geo.Wall.from_vertices(np.column_stack([x, down]))
    k, period = roll % len(rows), x[-1]
    moved = np.concatenate([x[k:], period + x[1 : k + 1]]) + 100
    vertices = np.column_stack([moved, np.concatenate([down[k:], down[1 : k + 1]]) + 3 * (k > 0) - 7])
    if backwards:
        vertices = vertices[::-1]
    found = geo.Wall.from_vertices(vertices)
    assert found.period == period and np.ptp(found.vertices[:, 1]) == np.ptp(wall.vertices[:, 1])
    assert found.arc_length == pytest.approx(wall.arc_length, rel=1e-14)
    at = np.linspace(0.05, 0.95, 40) * period
    first = np.interp(at, wall.cell.vertices[:, 0], wall.cell.vertices[:, 1])
    heights = np.concatenate([found.cell.vertices[:-1], np.add(found.cell.vertices, (period, 0))])
    assert any(np.allclose(np.interp(at + shift, *heights.T), first, atol=1e-12) for shift in range(period))
