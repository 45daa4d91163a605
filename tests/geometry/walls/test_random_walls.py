"""Random walls: their heights are normal, with the given correlations, heights and slopes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from asperity import geometry as geo

pytest.importorskip("SurfaceTopography")

WALLS = 400
# 99.99 % of normal numbers are nearer to their mean than so many standard deviations.
FAR = 3.9


def vertices(count=WALLS, seed=0, **asked):
    """Heights at the vertices of many polygons, shape (count, points + 1), each from its highest point."""
    return np.array(
        [geo.random_wall(**asked, rng=np.random.default_rng([seed, k])).vertices[:, 1] for k in range(count)]
    )


def centred(heights):
    return heights[:, :-1] - heights[:, :-1].mean(axis=1, keepdims=True)


def z_score(values, expected):
    return (values.mean() - expected) / (values.std(ddof=1) / np.sqrt(len(values)))


def circular_covariance(heights):
    """Mean products at each distance, one row a wall; it does not depend on where a wall begins."""
    power = np.abs(np.fft.rfft(heights)) ** 2
    return np.fft.irfft(power, heights.shape[1]) / heights.shape[1]


@pytest.mark.parametrize("points", [32, 33])
@pytest.mark.parametrize("shape", ["gaussian", "exponential"])
def test_heights_have_the_given_correlations(points, shape):
    length, period = 0.4, 3.0
    asked = {"spectrum": geo.HeightCorrelation(length, shape), "points": points, "rms_height": 0.3, "period": period}
    found = circular_covariance(centred(vertices(**asked)))
    distance = period / points * np.arange(points // 2 + 1)
    images = np.abs(distance + period * np.arange(-50, 51)[:, None]) / length
    rho = np.exp(-(images**2) if shape == "gaussian" else -images).sum(axis=0)
    whole = np.append(rho, rho[1 : (points + 1) // 2][::-1])
    # the mean height is taken away
    rho = (rho - whole.mean()) / (rho[0] - whole.mean())
    # the mean square along a side between heights with the correlation r is (2 + r)/3 of that of the heights
    rho = 3.0 * rho / (2.0 + rho[1])
    for k, expected in enumerate(rho):
        assert abs(z_score(found[:, k], 0.09 * expected)) < FAR


@pytest.mark.parametrize("points", [16, 17])
def test_squared_slopes_have_the_given_mean(points):
    spectrum = geo.SelfAffine(0.7)
    heights = vertices(spectrum=spectrum, points=points, rms_slope=0.2, period=2.0)
    slopes = np.mean((np.diff(heights, axis=1) * points / 2.0) ** 2, axis=1)
    assert abs(z_score(slopes, 0.04)) < FAR


@pytest.mark.slow
def test_squared_slopes_of_smooth_walls_have_the_given_mean():
    # so coarse that the cubics differ from the polynomial through the heights
    found, (node, weight) = [], np.polynomial.legendre.leggauss(3)
    for k in range(WALLS // 2):
        wall = geo.random_wall(geo.SelfAffine(0.5), 9, rms_slope=0.2, smooth=True, rng=np.random.default_rng([1, k]))
        control = np.array([piece.control_points for piece in wall.pieces])
        difference = 3.0 * np.diff(control, axis=1)
        t = 0.5 + 0.5 * node
        slope = np.einsum("it,pij->pjt", [(1 - t) ** 2, 2 * t * (1 - t), t**2], difference)
        # x is linear in the parameter, so that the slope is a polynomial, of degree 2
        run = control[:, 3, 0] - control[:, 0, 0]
        found.append(np.sum(0.5 * weight * (slope[:, 1] / slope[:, 0]) ** 2 * run[:, None]))
    assert abs(z_score(np.array(found), 0.04)) < FAR


@pytest.mark.parametrize("points", [9, 12])
@pytest.mark.parametrize("smooth", [False, True])
def test_squared_heights_along_a_wall_have_the_given_mean(points, smooth):
    # so coarse that the vertices of polygons have 1.2 times the height
    found, at = [], 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0]
    weight = 0.5 * np.polynomial.legendre.leggauss(4)[1]
    for k in range(WALLS // 2):
        rng = np.random.default_rng([2, k])
        wall = geo.random_wall(geo.HeightCorrelation(0.1), points, rms_height=0.03, smooth=smooth, rng=rng)
        runs = np.array([piece.end[0] - piece.start[0] for piece in wall.pieces])
        heights = np.array([piece.point(at)[:, 1] for piece in wall.pieces])
        mean, square = (float(np.sum(runs[:, None] * weight * heights**power)) for power in (1, 2))
        found.append(square - mean**2)
    assert abs(z_score(np.array(found), 0.03**2)) < FAR


def test_smooth_walls_pass_through_the_heights_of_the_polygon_without_corners():
    asked = {"spectrum": lambda q: 1e-3 * np.exp(-((0.1 * q) ** 2)), "points": 24, "rng": 5}
    polygon, smooth = geo.random_wall(**asked), geo.random_wall(**asked, smooth=True)
    ends = np.array([piece.start for piece in smooth.pieces])
    on_grid = np.isclose(ends[:, 0] * 24, np.round(ends[:, 0] * 24))
    np.testing.assert_allclose(np.diff(ends[on_grid, 1]), np.diff(polygon.vertices[:-1, 1]), atol=1e-15)
    for before, after in zip(smooth.pieces, [*smooth.pieces[1:], smooth.pieces[0]], strict=True):
        (one, two), (three, four) = before.control_points[-2:], after.control_points[:2]
        (x, y), (u, v) = np.subtract(two, one), np.subtract(four, three)
        assert x * v - y * u == pytest.approx(0.0, abs=1e-15)
    assert smooth.depth > 0.0 and max(end[1] for end in ends) <= 0.0


def test_few_frequencies_too_have_normal_heights():
    # a single frequency: sums of many would be normal whatever the amplitudes are
    heights = vertices(
        spectrum=lambda q: np.where(q < 7.0, 1.0, 0.0), points=8, rms_height=1.0
    )  # wave numbers 2 pi, 4 pi, ...
    squares = np.mean(centred(heights) ** 2, axis=1) * (2.0 + np.cos(2.0 * np.pi / 8)) / 3.0
    # the squared amplitude of a complex normal coefficient is exponential
    assert stats.kstest(squares, "expon").pvalue > 1e-4


def test_self_affine_heights_are_those_of_the_library():
    from SurfaceTopography.Generation import fourier_synthesis

    rng = np.random.default_rng(8)
    theirs = fourier_synthesis(
        (65,), (2.0,), hurst=0.6, rms_height=0.1, long_cutoff=0.9, short_cutoff=0.12, rng=rng,
        amplitude_distribution=lambda n: rng.rayleigh(np.sqrt(0.5), n),
    ).heights()  # fmt: skip
    wall = geo.random_wall(geo.SelfAffine(0.6, longest=0.9, shortest=0.12), 65, rms_height=0.1, period=2.0, rng=8)
    top = int(np.argmax(theirs))
    # of theirs the vertices have the height in the mean over all walls, of ours the sides
    own, their = wall.vertices[:-1, 1], np.roll(theirs, -top) - theirs[top]
    factor = own.min() / their.min()
    np.testing.assert_allclose(own, factor * their, atol=1e-14)
    assert 1.0 < factor < 1.3


def test_a_power_spectral_density_is_taken_as_it_is():
    found = vertices(spectrum=lambda q: 0.01 / q**2, points=12, period=3.0)
    wave = 2.0 * np.pi / 3.0 * np.arange(1, 7)
    # all frequencies but the highest count twice
    expected = np.sum(0.01 / wave**2 * [2, 2, 2, 2, 2, 1]) / 3.0
    assert abs(z_score(np.mean(centred(found) ** 2, axis=1), expected)) < FAR


@settings(deadline=None, max_examples=30)
@given(
    points=st.integers(4, 60), hurst=st.floats(0.01, 0.99), slope=st.floats(1e-6, 20.0), seed=st.integers(0, 99),
    smooth=st.booleans(),
)  # fmt: skip
def test_every_random_wall_is_valid(points, hurst, slope, seed, smooth):
    wall = geo.random_wall(geo.SelfAffine(hurst), points, rms_slope=slope, smooth=smooth, rng=seed)
    assert wall.closes and wall.period == 1.0 and wall.depth > 0.0
    if not smooth:
        assert len(wall.pieces) == points and wall.vertices[0].tolist() == [0.0, 0.0]


def test_generators_and_seeds_are_numpys():
    def wall(rng):
        return geo.random_wall(geo.HeightCorrelation(0.2), 16, rms_slope=0.1, rng=rng)

    assert wall(4) == wall(np.random.default_rng(4)) != wall(5)
    state = np.random.get_state()[1].tolist()  # noqa: NPY002 - which must not be used
    assert wall(None) != wall(None) and np.random.get_state()[1].tolist() == state  # noqa: NPY002
