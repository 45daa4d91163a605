"""Parities, mixing times, conductance, the billiard Laplacian, diffusion, large matrices, sampling errors."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError

# ---- parities ---------------------------------------------------------------------------------------------------


def test_laws_without_mirror_symmetry_have_no_parities():
    law = ker.MatrixLaw([[0.6, 0.3, 0.1], [0.3, 0.5, 0.2], [0.1, 0.2, 0.7]])
    assert set(spec.spectrum(law, k=3).parity) == {"none"}


# ---- mixing -----------------------------------------------------------------------------------------------------
def test_mixing_times_bound_the_distance_that_powers_of_the_matrix_have():
    matrix = ker.discretise(ker.henyey_greenstein(0.8), ker.Bins(32))
    weights = matrix.weights
    density = np.where(np.arange(32) < 4, 8.0, 0.0)
    size = np.sqrt(weights @ (density - 1.0) ** 2)
    for distance, measure in [
        ("L2", lambda f: np.sqrt(weights @ (f - 1.0) ** 2)),
        ("total variation", lambda f: 0.5 * weights @ np.abs(f - 1.0)),
        ("chi-square", lambda f: weights @ (f - 1.0) ** 2),
    ]:
        found = spec.mixing_time(matrix, 0.05, distance, initial=size)
        after = np.linalg.matrix_power(matrix.array, found.steps) @ density
        assert measure(after) <= 0.05
        assert found.earliest <= found.steps


@pytest.mark.parametrize("distance", ["total variation", "L2", "chi-square"])
def test_mixing_times_from_the_worst_start_are_those_of_powers_one_by_one(distance):
    rng = np.random.default_rng(0)
    flux = rng.random((7, 7)) ** 6 + 3.0 * np.eye(7)
    for kernel in (ker.discretise(ker.henyey_greenstein(0.8), ker.Bins(24)), ker.MatrixLaw(doubly(flux))):
        chain = np.asarray(kernel.array)
        weights = np.asarray(getattr(kernel, "weights", np.full(len(chain), 1.0 / len(chain))))

        def far(power, weights=weights):
            rest = np.abs(power / weights - 1.0)
            return {"L2": np.sqrt(rest**2 @ weights), "total variation": 0.5 * rest @ weights,
                    "chi-square": rest**2 @ weights}[distance].max()  # fmt: skip

        for within in (0.5, 0.25, 0.01):
            found = spec.mixing_time(kernel, within, distance, start="worst")
            power, steps = chain, 1
            while far(power) > within:
                power, steps = power @ chain, steps + 1
            assert found.steps == found.earliest == steps and found.start == "worst"
            # a density at distance 1 is nearer than an angle
            assert spec.mixing_time(kernel, within, distance).steps <= steps + 1


def doubly(flux):
    """A symmetric array with rows of sum 1."""
    array = flux + flux.T
    for _ in range(500):
        root = np.sqrt(array.sum(axis=1))
        array = array / root / root[:, None]
    return array


def test_the_worst_start_needs_finitely_many_states():
    for kernel in (ker.maxwell(0.5), ker.henyey_greenstein(0.5), spec.spectrum(ker.maxwell(0.5), 2)):
        with pytest.raises(InputError, match=r"start: expected 'density'.*pass ker.discretise\(law, ker.Bins\(64\)\)"):
            spec.mixing_time(kernel, start="worst")
    assert spec.mixing_time(ker.lambertian(), start="worst").steps == 1
    assert spec.mixing_time(ker.discretise(ker.maxwell(0.5), ker.Bins(64)), start="worst").steps >= 2


def test_the_eigenfunctions_that_are_drawn_are_the_legendre_polynomials():
    ax = Figure().subplots()
    spec.spectrum(ker.henyey_greenstein(0.5), k=3).plot_eigenfunctions(ax)
    first, second, _ = ax.lines
    u = np.cos(first.get_xdata())
    assert [first.get_label(), second.get_label()] == ["0.5 (odd)", "0.25 (even)"]
    assert np.allclose(first.get_ydata(), np.sqrt(3.0) * u, atol=1e-9)
    assert np.allclose(second.get_ydata(), np.sqrt(5.0) * (1.5 * u**2 - 0.5), atol=1e-9)


# ---- cuts and the Laplacian -------------------------------------------------------------------------------------
@pytest.mark.parametrize("g", [0.3, 0.9])
def test_cheegers_bounds_hold(g):
    found = spec.conductance(ker.discretise(ker.henyey_greenstein(g), ker.Bins(64)))
    assert found.gap_below <= 1 - g <= found.gap_above + found.error


@pytest.mark.parametrize("half_angle", [0.1, 0.2])
def test_shallow_arcs_tend_to_the_billiard_laplacian(half_angle):
    found = spec.laplacian_comparison(ker.CircularArcLaw(half_angle), 3)
    exact = (np.log(1 / np.cos(half_angle) + np.tan(half_angle)) - np.sin(half_angle)) / np.sin(half_angle)
    assert spec.mean_squared_slope(geo.focusing_arcs(half_angle)) == pytest.approx(exact, rel=1e-6)
    assert found.flatness == pytest.approx(exact, rel=0.5 * half_angle)
    assert np.all(np.abs(found.ratios - 1.0) < half_angle)


def test_walls_with_vertical_sides_have_no_flatness():
    assert spec.mean_squared_slope(geo.rectangular_teeth(1.0)) == np.inf
    assert spec.mean_squared_slope(geo.focusing_arcs(np.pi / 2)) == np.inf


# ---- diffusion --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("a", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("arrangement", ["mirror", "half-turn"])
def test_maxwells_walls_have_the_diffusivity_of_smoluchowski(a, arrangement):
    for law in (ker.maxwell(a), ker.maxwell(a).in_specular_frame()):
        found = spec.diffusivity(law, radius=0.5, speed=3.0, arrangement=arrangement)
        assert found.eta == pytest.approx((2 - a) / a, rel=1e-12) and found.zeta == pytest.approx(1 - a, abs=1e-12)
        assert float(found) == pytest.approx((2 - a) / a * 4 * 0.5 * 3.0 / np.pi, rel=1e-12)


def test_the_semicircle_turns_grazing_flights_round():
    """Of M, its ends' difference: zeta = -(1/8) ln 9."""
    found = spec.diffusivity(ker.CircularArcLaw(np.pi / 2))
    zeta = -np.log(9) / 8
    assert abs(found.zeta - zeta) <= found.zeta_error < 1e-7
    assert abs(found.eta - (1 + zeta) / (1 - zeta)) <= found.eta_error


def test_the_page_on_diffusion_has_the_means_of_cotangents_that_rays_give():
    """Every number of its table, to a unit of the last digit."""
    page = (Path(__file__).parents[3] / "docs" / "theory" / "knudsen-diffusion.md").read_text(encoding="utf-8")
    walls = {
        "arcs, half angle 0.3": geo.focusing_arcs(0.3),
        "bumps, curvature 1": geo.dispersing_arcs(1.0),
        "triangular teeth, angle 1": geo.triangular_teeth(1.0),
        "semicircles": geo.focusing_arcs(np.pi / 2),
        "`koch(2)`": geo.koch(2),
    }
    x = (np.arange(100_000) + 0.5) / 100_000
    for name, wall in walls.items():
        row = re.search(rf"^\| {re.escape(name)} ((\| -?[\d.]+ ){{4}})\|$", page, flags=re.MULTILINE)
        assert row is not None, name
        for theta, text in zip((0.1, 0.01, 0.001, 0.0001), row[1].replace("|", "").split(), strict=True):
            traced = geo.trace(wall, x * wall.period, np.full(x.size, theta))
            mean = -float(np.mean(np.tan(theta) / np.tan(traced.theta[traced.escaped])))
            assert abs(mean - float(text)) < 10.0 ** -len(text.partition(".")[2]), (name, theta, mean)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "arrangement"), [(ker.maxwell(0.5), "half-turn"), (ker.CircularArcLaw(np.pi / 2), "mirror")], ids=str
)
def test_exit_times_agree_with_the_spectral_formula(law, arrangement):
    lengths = 10.0 * 2.0 ** np.arange(0, 4.0, 0.5)
    simulated = spec.exit_times(law, lengths, 1000, np.random.default_rng(5), arrangement=arrangement).eta()
    found = spec.diffusivity(law, arrangement=arrangement)
    assert abs(float(simulated) - found.eta) <= simulated.error + found.eta_error
    assert simulated.error < 0.75 * found.eta


def test_times_scale_with_width_and_speed():
    first = spec.exit_times(ker.lambertian(), [5.0, 10.0, 20.0], 50, np.random.default_rng(1))
    second = spec.exit_times(ker.lambertian(), [10.0, 20.0, 40.0], 50, np.random.default_rng(1), radius=2.0, speed=4.0)
    assert np.allclose(first.times, 2.0 * second.times)


@pytest.mark.parametrize(
    ("law", "eta"),
    [
        (ker.lambertian(), 1.0),
        (ker.CircularArcLaw(0.05), 1.0),
        (ker.WallLaw(geo.dispersing_arcs(1.0)), 1.0),
        (ker.WallLaw(geo.koch(2)), 2.6),
        (ker.MatrixLaw([[0.75, 0.25], [0.25, 0.75]]), 1.0),
        (0.5 * ker.MatrixLaw([[0.75, 0.25], [0.25, 0.75]]) + 0.5 * ker.specular(), 3.0),
    ],
    ids=repr,
)
def test_a_limit_by_theorem_has_a_bound_that_is_not_zero_and_its_reason(law, eta):
    found = spec.diffusivity(law)
    assert found.kind == "bound" and "by the law's structure or the shape of the wall" in found.method
    assert abs(found.eta - eta) <= found.eta_error and 0.0 < found.eta_error < 1e-12
    assert 0.0 < found.zeta_error < 1e-12 and 0.0 < found.error < 1e-12


def test_a_limit_at_decreasing_angles_is_an_estimate_with_an_error():
    found = spec.diffusivity(ker.TriangularTeethLaw(1.0))
    assert found.kind == "estimate" and "at decreasing angles" in found.method
    assert abs(found.eta - 1.0) <= found.eta_error < 1e-4


def test_the_text_of_a_diffusivity_says_that_it_is_a_slope_and_from_where_on():
    """At L = 160 r the constant beside the slope of shallow arcs, whose L^2/(D_0 tau) is 45, is the larger part."""
    shallow, deep = spec.diffusivity(ker.CircularArcLaw(0.05), radius=2.0), spec.diffusivity(ker.CircularArcLaw(1.2))
    for text in (str(shallow), repr(shallow), f"{shallow}", shallow._repr_html_()):
        assert "2.5464790894" in text and ", the slope of L^2/tau against ln(L/r) for L well above" in text
    assert shallow.onset > 2.0 * 160.0 > 10.0 * deep.onset
    # of all flights beyond the onset the persistence is near its limit, by rays of another seed
    angle = 0.5 * np.arctan(2.0 * 2.0 / shallow.onset)
    outgoing = ker.CircularArcLaw(0.05).sample(np.full(20_000, angle), np.random.default_rng(8))
    assert abs(np.mean(np.tan(angle) / np.tan(outgoing))) < 0.1


def test_a_diffusivity_whose_logarithm_begins_far_out_warns_and_one_at_hand_does_not():
    for radius in (1.0, 1e-6):
        with pytest.warns(UserWarning, match=r"beyond 1000 r only.*channel_diffusivity\(law, lengths\)"):
            found = spec.diffusivity(ker.CircularArcLaw(0.001), radius=radius)
        assert "L beyond 2000 r at least, the same for all walls that turn grazing flights" in repr(found)
        assert np.isfinite(spec.diffusivity(ker.CircularArcLaw(0.05), radius=radius).onset)
    assert "the same for all walls" not in str(spec.diffusivity(ker.maxwell(0.5)))
    assert spec.sweep(ker.CircularArcLaw, {"half_angle": [0.001]}, "eta", progress=False).rows[0].value == 1.0


def mean_exit_time(length):
    """Of particles from a diffuse wall at 0 until they leave (-length, length) in a channel of width 1, at speed 1.

    T(x) = the mean time to the next wall or end + the integral of T(y)/2 (1 + (x - y)^2)^(-3/2).
    """
    unit, weight = np.polynomial.legendre.leggauss(801)
    x, weight = length * unit, length * weight
    to_next = np.full(x.size, 0.5 * np.pi)
    for distance in (length - x, length + x):
        to_next += 0.25 * distance * np.log1p(distance**-2.0) - 0.5 * np.arctan(1.0 / distance)
    kernel = 0.5 * (1.0 + (x - x[:, None]) ** 2) ** -1.5 * weight
    return np.linalg.solve(np.eye(x.size) - kernel, to_next)[400]


def test_diffuse_channels_have_the_mean_exit_times_of_an_integral_equation_in_95_percent():
    lengths = [0.25, 2.0, 10.0]
    exact = np.array([mean_exit_time(length) for length in lengths])
    inside = []
    for seed in range(20):
        found = spec.channel_diffusivity(ker.lambertian(), lengths, 1000, seed, radius=0.5)
        inside.append(np.abs(found.times - exact) <= found.time_errors)
        assert np.allclose(found.values, 0.5 * found.lengths**2 / found.times)
        assert np.all(np.abs(found.errors / found.values - found.time_errors / found.times) < 1e-14)
    assert np.all(np.sum(inside, axis=0) >= 17)


def test_the_diffusivity_of_channels_grows_by_half_of_the_slope():
    found = spec.channel_diffusivity(ker.lambertian(), [10.0, 80.0], rng=2)
    slope = 2.0 * (found.values[1] - found.values[0]) / np.log(8.0)
    assert abs(slope - float(spec.diffusivity(ker.lambertian()))) < 2.0 * found.errors.sum() / np.log(8.0) + 0.05
    assert found.onset < 10.0 and "onset     3.1" in repr(found)


def test_the_diffusivity_of_one_length_scales_with_radius_and_speed():
    first = spec.channel_diffusivity(ker.CircularArcLaw(0.3), 5.0, 50, 1)
    second = spec.channel_diffusivity(ker.CircularArcLaw(0.3), [10.0], 50, 1, radius=2.0, speed=4.0)
    assert second.values == pytest.approx(8.0 * first.values) and second.onset == pytest.approx(2.0 * first.onset)


def test_a_channel_whose_slope_is_unknown_has_times_all_the_same():
    law = ker.WallLaw(geo.rectangular_teeth()) @ ker.henyey_greenstein(0.5)
    found = spec.channel_diffusivity(law, [1.0, 2.0], 200, 3)
    assert found.onset == np.inf and np.all(found.times > 0.0)


@pytest.mark.filterwarnings("ignore:diffusivity:UserWarning")
def test_half_rectangular_teeth_in_a_diffuse_wall_have_the_mean_of_their_diffusivities():
    """Between two diffuse reflections d is kept, so eta is the mean of (2 + c)/(2 - c) for c = 1 - q, uniform."""
    found = spec.diffusivity(0.5 * ker.RectangularTeethLaw(1.0) + 0.5 * ker.lambertian())
    assert abs(found.eta - (4.0 * np.log(2.0) - 1.0)) <= found.eta_error < 10.0


def test_a_diffusivity_that_the_limit_at_grazing_does_not_bound_is_refused():
    with pytest.raises(AccuracyError, match="does not bound") as caught:
        spec.diffusivity(0.9 * ker.RectangularTeethLaw(1.0) + 0.1 * ker.lambertian())
    assert 0.1 < caught.value.defect < 2.0


# ---- sampling ---------------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_errors_of_the_gap_of_one_matrix_hold_in_95_percent():
    # the changes from the coarser basis alone would hold in 80 %
    held = []
    for half_angle in (0.3, 0.7, 1.4):
        law = ker.CircularArcLaw(half_angle)
        for turned in (law, law.in_specular_frame()):
            gap = spec.spectral_gap(turned, 1e-4)
            for basis in (*map(ker.Legendre, (8, 24)), *map(ker.Bins, (16, 48))):
                found = spec.spectral_gap(ker.discretise(turned, basis, tolerance=1e-5))
                held.append(abs(found.value - gap.value) <= found.error + gap.error)
    assert np.mean(held) >= 0.95
