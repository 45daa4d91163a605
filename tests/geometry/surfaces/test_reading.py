"""Height maps from files and random ones: levelled, filled, mirrored, named spikes, and the statistics asked for."""

import warnings

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.errors import FileExistsRefusal, InputError

RNG = np.random.default_rng(0)
SMOOTH = geo.Surface.random(geo.HeightCorrelation(0.15), (24, 20), rms_slope=0.4, period=(12.0, 8.0), rng=5)
# Standard deviations beyond which a mean is none of chance.
FAR = 4.0


def written(path, array, **more):
    np.savetxt(path, array, **more)
    return path


def test_a_saved_surface_is_restored_exactly(tmp_path):
    unit = geo.Surface(SMOOTH.heights, SMOOTH.spacing, "µm")
    unit.save(tmp_path / "map.npz")
    restored = geo.read_surface(tmp_path / "map.npz")
    assert restored == unit and restored.unit == "µm"
    with pytest.raises(FileExistsRefusal, match=r"map\.npz exists; pass overwrite=True"):
        unit.save(tmp_path / "map.npz")
    unit.save(tmp_path / "map.npz", overwrite=True)


@pytest.mark.parametrize("delimiter", [" ", "\t", ", ", ";", ","])
def test_texts_and_arrays_of_numpy_are_the_same_map(tmp_path, delimiter):
    text = written(tmp_path / "map.txt", SMOOTH.heights, delimiter=delimiter, fmt="%.17g", header="heights in nm")
    np.save(tmp_path / "map.npy", SMOOTH.heights)
    found = [geo.read_surface(path, (0.5, 0.4), tiling="wrap") for path in (text, tmp_path / "map.npy")]
    assert found[0] == found[1] and found[0].spacing == (0.5, 0.4)
    # what is taken off is a tilt
    tilt = found[0].heights - SMOOTH.heights
    assert np.abs(np.diff(tilt, 2, axis=0)).max() < 1e-14 and np.abs(np.diff(tilt, 2, axis=1)).max() < 1e-14


@pytest.mark.parametrize("periodic", [False, True])
def test_a_file_of_an_instrument_has_its_sizes_unit_and_periods(tmp_path, periodic):
    topography = pytest.importorskip("SurfaceTopography")
    scan = topography.Topography(SMOOTH.heights, (12.0, 8.0), unit="um", periodic=periodic)
    scan.to_netcdf(tmp_path / "map.nc")
    found = geo.read_surface(tmp_path / "map.nc", degree=0)
    assert found.unit in ("um", "µm") and np.allclose(found.spacing, (0.5, 0.4), rtol=1e-12)
    wanted = SMOOTH.heights - SMOOTH.heights.mean()
    assert found.heights.shape == ((24, 20) if periodic else (46, 38))
    assert np.abs(found.heights[:24, :20] - wanted).max() < 1e-12


def test_a_tilt_is_taken_off_before_gaps_are_filled(tmp_path):
    x, y = np.meshgrid(np.arange(15.0), np.arange(11.0), indexing="ij")
    plane = 3.0 * x - 2.0 * y + 7.0
    holes = plane.copy()
    holes[3:6, 2:5] = holes[0, 0] = holes[14, 4:] = np.nan
    found = geo.read_surface(written(tmp_path / "map.txt", holes), 1.0)
    assert np.abs(found.heights).max() < 1e-12 and found.heights.shape == (28, 20)
    bow = geo.read_surface(written(tmp_path / "map.txt", plane + 0.1 * x * y + 0.2 * x**2), 1.0, degree=2)
    assert np.abs(bow.heights).max() < 1e-12
    # a gap in a wave is filled within the bend of the wave over the gap
    wave = np.sin(0.3 * x)
    gap = wave.copy()
    gap[5:8, 4:7] = np.nan
    filled = geo.read_surface(written(tmp_path / "map.txt", gap), 1.0, degree=0, tiling="wrap").heights
    assert np.abs(filled - filled.mean() - (wave - wave.mean()))[5:8, 4:7].max() < 0.02 + 0.09 * 4.0 / 2.0


def test_a_patch_is_mirrored_without_double_rows(tmp_path):
    z = RNG.standard_normal((5, 4))
    found = geo.read_surface(written(tmp_path / "map.txt", z), 1.0, degree=0).heights
    level = z - z.mean()
    np.testing.assert_allclose(found[:5, :4], level, atol=1e-15)
    rows, columns = [0, 1, 2, 3, 4, 3, 2, 1], [0, 1, 2, 3, 2, 1]
    np.testing.assert_allclose(found, level[np.ix_(rows, columns)], atol=1e-15)


def test_spikes_are_named_and_filled_on_demand(tmp_path):
    spoiled = SMOOTH.heights.copy()
    spoiled[7, 9], spoiled[20, 3] = 30.0, -5.0
    path = written(tmp_path / "map.txt", spoiled)
    words = r"2 of 480 heights, the worst 30 at index \(7, 9\), are far from all their neighbours"
    with pytest.warns(UserWarning, match=words + "; pass spikes='fill'"):
        kept = geo.read_surface(path, (0.5, 0.4), tiling="wrap")
    with pytest.warns(UserWarning, match=words + " and are interpolated"):
        filled = geo.read_surface(path, (0.5, 0.4), tiling="wrap", spikes="fill")
    assert kept.rms_slope > 3 * SMOOTH.rms_slope and filled.rms_slope == pytest.approx(SMOOTH.rms_slope, rel=0.05)
    assert np.abs(filled.heights - SMOOTH.heights).max() < 0.3


@pytest.mark.parametrize("heights", [
    SMOOTH.heights, RNG.standard_normal((60, 60)), np.kron(RNG.integers(0, 2, (8, 8)), np.ones((4, 4))),
    np.add.outer(np.arange(9.0), np.arange(9.0)), np.cumsum(RNG.standard_normal((50, 50)), axis=0),
    np.kron([[0, 0, 0], [0, 1, 0], [0, 0, 0]], np.ones((3, 3))), np.where(RNG.random((40, 40)) < 0.2, 1.0, 0.0),
], ids=["smooth", "noise", "steps", "plane", "walk", "pillar", "dots"])  # fmt: skip
def test_rough_maps_and_steps_have_no_spikes(tmp_path, heights):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        geo.read_surface(written(tmp_path / "map.txt", heights), 1.0, degree=0, tiling="wrap")


def test_units_and_codes_of_undefined_heights(tmp_path):
    z = SMOOTH.heights.copy()
    z[3, 4] = -9999.0
    path = written(tmp_path / "map.txt", z)
    found = geo.read_surface(path, 0.5, ("um", "nm"), undefined=-9999.0, tiling="wrap")
    assert found.unit == "um" and found.rms_height == pytest.approx(1e-3 * SMOOTH.rms_height, rel=0.2)
    assert geo.read_surface(path, 0.5, "mm", undefined=-9999.0).unit == "mm"


def test_quarters_are_those_of_the_measured_patch(tmp_path):
    patch = SMOOTH.heights[:17, :12]
    mirrored = geo.read_surface(written(tmp_path / "map.txt", patch), 1.0, degree=0)
    wrapped = geo.Surface(patch - patch.mean(), 1.0)
    for one, other in zip(mirrored.quarters(), wrapped.quarters(), strict=True):
        assert one.heights.shape == (16, 10)
        np.testing.assert_allclose(one.heights, other.heights, atol=1e-14)
    corner = mirrored.quarters()[3].heights[:9, :6]
    np.testing.assert_allclose(corner, (patch - patch.mean())[8:, 6:], atol=1e-14)
    with pytest.raises(InputError, match="heights: expected 4 points or more along each axis, got a map of 3 x 4"):
        geo.Surface(np.eye(3, 4)).quarters()


@pytest.mark.parametrize(
    ("content", "arguments", "message"),
    [
        (b"1 2\n3 4", {}, r"a matrix of shape \(2, 2\) has no spacing; pass spacing=1.0"),
        (b"1 2\n3", {"spacing": 1.0}, "line 2: expected 2 heights as in the first row, got 1"),
        (b"1 2\n3 abc", {"spacing": 1.0}, "line 2: expected heights, got 'abc'"),
        (b"1,5 2,5\n3,1 4,2", {"spacing": 1.0}, "write decimal points for commas"),
        (b"nan nan\nnan 1", {"spacing": 1.0}, "heights: expected at least 3 of 4 to be defined, got 1"),
        (b"1 2\n3 4", {"spacing": 0.0}, "spacing: expected a positive number"),
        (b"1 2\n3 4", {"spacing": 1.0, "units": ("um", "rad")}, "units: expected units of length"),
        (b"1 2\n3 4", {"spacing": 1.0, "units": 3}, "units: expected two units of length"),
        (b"1 2\n3 4", {"spacing": 1.0, "tiling": "step"}, "tiling: expected 'mirror' or 'wrap'"),
        (b"1 2\n3 4", {"spacing": 1.0, "spikes": True}, "spikes: expected 'keep' or 'fill'"),
        (b"1 2\n3 4", {"spacing": 1.0, "degree": -1}, "degree: expected a whole number of at least 0"),
        (b"1 2\n3 4", {"spacing": 1.0, "undefined": "x"}, "undefined: expected numbers"),
        (b"\x00\xff\xfe", {"spacing": 1.0}, "it is no text; SurfaceTopography cannot read it"),
        (b"", {"spacing": 1.0}, "0 bytes"),
    ],
)  # fmt: skip
def test_bad_files_and_options_end_in_one_clear_error(tmp_path, content, arguments, message):
    (tmp_path / "map.txt").write_bytes(content)
    with pytest.raises(InputError, match=message):
        geo.read_surface(tmp_path / "map.txt", **arguments)


def test_other_bad_files_end_in_one_clear_error(tmp_path):
    np.save(tmp_path / "line.npy", np.zeros(5))
    with pytest.raises(InputError, match="expected a map of two dimensions"):
        geo.read_surface(tmp_path / "line.npy", 1.0)
    np.save(tmp_path / "complex.npy", np.zeros((2, 2), complex))
    with pytest.raises(InputError, match="heights: expected numbers"):
        geo.read_surface(tmp_path / "complex.npy", 1.0)
    np.savez(tmp_path / "other.npz", z=np.zeros((2, 2)))
    with pytest.raises(InputError, match=r"expected a surface as Surface.save writes it"):
        geo.read_surface(tmp_path / "other.npz")
    with pytest.raises(InputError, match="missing"):
        geo.read_surface(tmp_path / "missing.txt", 1.0)
    topography = pytest.importorskip("SurfaceTopography")
    topography.UniformLineScan(np.array([0.0, 1.0, 0.5, 0.2]), 4.0, unit="um").to_netcdf(tmp_path / "line.nc")
    with pytest.raises(InputError, match=r"expected a map, got a line; use geo.read_profile"):
        geo.read_surface(tmp_path / "line.nc")


def ensemble(count=300, **asked):
    return [geo.Surface.random(**asked, rng=np.random.default_rng([1, k])) for k in range(count)]


def z_score(values, expected):
    values = np.asarray(values)
    return (values.mean() - expected) / (values.std(ddof=1) / np.sqrt(len(values)))


def test_the_memory_of_large_maps_is_announced_before_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("asperity.core.checks.memory_left", lambda: 2**28)
    for name, size in (("large", 4000), ("small", 1500)):
        np.lib.format.open_memmap(tmp_path / f"{name}.npy", "w+", np.uint8, (size, size)).flush()
    with pytest.raises(InputError, match=r"heights: a map of 16000000 heights takes 0.51 GB of memory"):
        geo.read_surface(tmp_path / "large.npy", 1.0)
    with pytest.raises(InputError, match=r"heights: what makes a surface of a map of 2250000 heights takes 0.77 GB"):
        geo.read_surface(tmp_path / "small.npy", 1.0, degree=5)
    with pytest.raises(InputError, match=r"points: a random map takes 1.3 GB of memory"):
        geo.Surface.random(geo.HeightCorrelation(0.1), 2**12, rms_slope=1.0)


@pytest.mark.parametrize("shape", ["gaussian", "exponential"])
def test_random_heights_have_the_given_correlations_in_every_direction(shape):
    length, period, points = 0.3, (2.0, 3.0), (16, 24)
    found = ensemble(spectrum=geo.HeightCorrelation(length, shape), points=points, rms_height=0.3, period=period)
    x, y = np.meshgrid(np.arange(16) / 8.0, np.arange(24) / 8.0, indexing="ij")
    rho = np.zeros(points)
    for k in range(-8, 9):
        for m in range(-6, 7):
            distance = np.hypot(x + 2.0 * k, y + 3.0 * m) / length
            rho += np.exp(-(distance**2) if shape == "gaussian" else -distance)
    rho -= rho.mean()
    # mean squares on facets are half of the mean square of heights and a sixth of three products of neighbours
    rho *= 0.09 / ((3.0 * rho[0, 0] + rho[1, 0] + rho[0, 1] + rho[1, 1]) / 6.0)
    products = {
        shift: [np.mean(one.heights * np.roll(one.heights, shift, (0, 1))) for one in found]
        for shift in [(0, 0), (1, 0), (0, 1), (1, 1), (2, 1), (3, 0), (0, 5), (8, 12), (1, -1)]
    }
    for shift, values in products.items():
        assert abs(z_score(values, rho[shift])) < FAR
    assert abs(z_score([one.rms_height**2 for one in found], 0.09)) < FAR


def test_random_slopes_are_those_asked_for():
    for spectrum in (geo.SelfAffine(0.7), geo.HeightCorrelation(0.2), lambda q: 1.0 / (1.0 + q**4)):
        found = ensemble(60, spectrum=spectrum, points=(20, 15), rms_slope=0.5, period=(2.0, 1.5))
        assert abs(z_score([one.rms_slope**2 for one in found], 0.25)) < FAR
        # isotropic: half of the mean square along each axis
        assert abs(z_score([np.mean(one._slopes[0] ** 2) - np.mean(one._slopes[1] ** 2) for one in found], 0.0)) < FAR
    powers = lambda q: np.exp(-q)  # noqa: E731
    waves = 2.0 * np.pi * np.hypot(*np.meshgrid(np.fft.fftfreq(12, 1 / 12), np.fft.fftfreq(12, 1 / 12)))
    wanted = np.exp(-waves).sum() - 1.0
    plain = ensemble(400, spectrum=powers, points=12)
    assert abs(z_score([np.mean(one.heights**2) for one in plain], wanted)) < FAR


def test_self_affine_maps_have_the_power_of_the_plane():
    found = ensemble(200, spectrum=geo.SelfAffine(0.6), points=32, rms_height=1.0)
    power = np.mean([np.abs(np.fft.fft2(one.heights)) ** 2 for one in found], axis=0)
    # |q| = 1 and |q| = 8 along the axes and the diagonal
    for low, high, ratio in (((1, 0), (8, 0), 8.0), ((0, 1), (0, 8), 8.0), ((1, 1), (6, 6), 6.0)):
        assert np.log(power[low] / power[high]) / np.log(ratio) == pytest.approx(2.0 + 2.0 * 0.6, abs=0.15)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"rms_slope": None}, "rms_slope: expected one of rms_slope and rms_height"),
        ({"rms_height": 0.1}, "rms_slope: expected one of rms_slope and rms_height"),
        ({"spectrum": 3}, r"spectrum: expected HeightCorrelation\(0.1\)"),
        ({"spectrum": lambda q: -q}, "spectrum: expected 63 powers of at least 0"),
        ({"points": 1}, "points: expected a whole number from 2"),
        ({"points": (8, 8, 8)}, "points: expected one number or one for each axis"),
        ({"period": (1.0, -1.0)}, "period: expected a number greater than 0"),
        ({"spectrum": geo.HeightCorrelation(50.0)}, "length: expected at most 1.5 for the period 1, got 50.0"),
        ({"rng": -1}, "rng: expected"),
    ],
)  # fmt: skip
def test_bad_statistics_end_in_one_clear_error(asked, message):
    with pytest.raises(InputError, match=message):
        geo.Surface.random(**{"spectrum": geo.SelfAffine(0.5), "points": 8, "rms_slope": 0.3, **asked})
