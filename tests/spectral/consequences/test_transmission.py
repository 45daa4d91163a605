"""Transmission of channels and tubes, against plain simulations and what is known of it."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from campaigns.errors.transmission import TOGETHER, Case, mirrors, passed

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.consequences import clausing

# diffuse walls: own integral equations on other grids
CHANNELS = {1.0: 0.68438, 2.0: 0.54206, 5.0: 0.35641, 10.0: 0.24056}
TUBES = {1.0: 0.6719839, 2.0: 0.5142305, 5.0: 0.3105253, 10.0: 0.1909424}
ARCS = ker.CircularArcLaw(1.2)
# without mirror symmetry: teeth with one vertical side
SAW = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0, -0.6), (1, 0)]))
SAW_TURNED = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (1, -0.6), (1, 0)]))


def direct(length):
    return math.sqrt(1.0 + length * length) - length


@pytest.mark.parametrize(
    ("section", "length", "known", "wrong"),
    [*(("channel", *one, 5.5e-6) for one in CHANNELS.items()), *(("tube", *one, 1e-7) for one in TUBES.items())],
)
def test_diffuse_channels_and_tubes_have_the_known_transmission(section, length, known, wrong):
    found = spec.transmission(ker.lambertian(), length, section)
    assert abs(float(found) - known) < wrong and found.error < 1e-9


def grooved(velocity, along, angle, rng):
    """Velocities after diffuse reflection in the cross section of grooves at this angle to the axis, in space.

    The component along the grooves is kept; ``along`` holds the axis, the direction across it and the normal.
    """
    groove = np.cos(angle)[:, None] * along[0] + np.sin(angle)[:, None] * along[1]
    kept = (velocity * groove).sum(1)
    rest, cosine = np.sqrt(1.0 - kept**2), 2.0 * rng.random(len(kept)) - 1.0
    normal = (rest * np.sqrt(1.0 - cosine**2))[:, None] * along[2]
    return kept[:, None] * groove + (rest * cosine)[:, None] * np.cross(along[2], groove) + normal


def in_space(section, length, diffuse, particles, rng, orientation=None):
    """How many of these particles leave at the far end of a channel |y| < 1/2 or a tube of radius 1, in space.

    With an orientation the diffuse reflections are those of grooves.
    """
    sine, turn = np.sqrt(rng.random(particles)), 2.0 * np.pi * rng.random(particles)
    velocity = np.stack((np.sqrt(1.0 - sine**2), sine * np.cos(turn), sine * np.sin(turn)), axis=1)
    place = np.zeros((particles, 3))
    if section == "channel":
        place[:, 1] = rng.random(particles) - 0.5
    else:
        radius, angle = np.sqrt(rng.random(particles)), 2.0 * np.pi * rng.random(particles)
        place[:, 1], place[:, 2] = radius * np.cos(angle), radius * np.sin(angle)
    through = 0
    while len(place):
        if section == "channel":
            time = (0.5 * np.sign(velocity[:, 1]) - place[:, 1]) / velocity[:, 1]
        else:
            across, off = velocity[:, 1:], place[:, 1:]
            a, b, c = (across**2).sum(1), (across * off).sum(1), (off**2).sum(1) - 1.0
            time = (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a
        place = place + time[:, None] * velocity
        through += np.count_nonzero(place[:, 0] >= length)
        inside = (place[:, 0] > 0.0) & (place[:, 0] < length)
        place, velocity = place[inside], velocity[inside]
        normal = np.zeros_like(place)
        if section == "channel":
            normal[:, 1] = -np.sign(place[:, 1])
        else:
            normal[:, 1:] = -place[:, 1:] / np.linalg.norm(place[:, 1:], axis=1)[:, None]
        side = np.cross(normal, [1.0, 0.0, 0.0])
        sine, turn = np.sqrt(rng.random(len(place))), 2.0 * np.pi * rng.random(len(place))
        scattered = np.sqrt(1.0 - sine**2)[:, None] * normal + (sine * np.sin(turn))[:, None] * side
        scattered[:, 0] += sine * np.cos(turn)
        if orientation is not None:
            angle = turn if orientation == "random" else np.full(len(place), orientation)
            # walls of a channel are mirror images, so their grooves have one direction
            beside = np.array([0.0, 0.0, 1.0]) if section == "channel" else side
            scattered = grooved(velocity, (np.array([1.0, 0.0, 0.0]), beside, normal), angle, rng)
        mirrored = velocity - 2.0 * (velocity * normal).sum(1)[:, None] * normal
        velocity = np.where((rng.random(len(place)) < diffuse)[:, None], scattered, mirrored)
    return through


@pytest.mark.parametrize("section", ["channel", "tube"])
@pytest.mark.parametrize(("diffuse", "length"), [(1.0, 3.0), (0.3, 3.0), (0.6, 0.7)])
def test_particles_in_space_pass_as_often_as_the_integral_equation_says(section, diffuse, length):
    particles = 100_000
    found = float(spec.transmission(ker.maxwell(diffuse), length, section))
    seen = in_space(section, length, diffuse, particles, np.random.default_rng(3)) / particles
    assert abs(seen - found) < 3.5 * math.sqrt(found * (1.0 - found) / particles)


@pytest.mark.parametrize("section", ["channel", "tube"])
def test_smooth_walls_pass_all_particles_and_nearly_smooth_ones_nearly_all(section):
    assert spec.transmission(ker.specular(), 7.0, section).value == 1.0
    # to first order in a, half of the particles that a wall scatters return: by the number of their reflections
    values = [float(spec.transmission(ker.maxwell(a), 2.0, section)) for a in (0.01, 0.02, 0.04)]
    ratio = (1.0 - values[1]) / (1.0 - values[0]), (1.0 - values[2]) / (1.0 - values[1])
    assert 1.9 < ratio[1] < ratio[0] < 2.0


@pytest.mark.parametrize("section", ["channel", "tube"])
@pytest.mark.parametrize(("diffuse", "length"), [(0.0099, 5.0), (1e-6, 1000.0), (1e-13, 1e3), (1e-9, 1e9)])
def test_nearly_smooth_walls_have_the_accuracy_of_diffuse_ones(section, diffuse, length):
    """From first order, 1 - a L/2 plus twice the square of a L at most, up to a hundred diffuse reflections."""
    found, order = spec.transmission(ker.maxwell(diffuse), length, section, tolerance=1e-8), diffuse * length
    assert found.error < 1e-12 and float(found) + found.error <= 1.0
    assert max(1.0 - 0.5 * order, 0.0) - 1e-13 <= float(found) <= 1.0 - 0.5 * order + 2.0 * order**2 + 1e-14
    same = spec.transmission(1.0 * (ker.maxwell(diffuse) @ ker.specular() @ ker.specular()), length, section)
    assert float(same) == pytest.approx(float(found), rel=1e-14)


def test_quadratures_of_the_numbers_of_flights_agree_with_the_sums():
    for diffuse in (1.0, 0.4, 0.01, 1e-4):
        number, weight = clausing._runs(diffuse)
        k = np.arange(1.0, 50.0 / diffuse + 1.0)
        chance = diffuse * np.exp((k - 1.0) * np.log1p(-diffuse)) if diffuse < 1.0 else np.eye(1, k.size)[0]
        for z in (0.1, 3.0, 700.0):
            whole = chance @ np.hypot(1.0, z / k) ** -3.0
            assert weight @ np.hypot(1.0, z / number) ** -3.0 == pytest.approx(whole, rel=1e-13, abs=1e-16)


@pytest.mark.parametrize(("diffuse", "length"), [(0.3, 3.0), (1e-3, 10.0), (0.02, 200.0)])
def test_flights_with_runs_of_specular_reflections_agree_with_the_integral_equation(diffuse, length):
    exact = spec.transmission(ker.maxwell(diffuse), length)
    flown = [by_flights(length, np.random.default_rng(seed), 1e-3, None, diffuse) for seed in range(4)]
    assert all(abs(float(one) - float(exact)) < 1.5 * one.error < 1.5e-3 for one in flown)


def test_sums_with_a_large_specular_part_lose_little_and_stay_within_0_and_1():
    """A path that meets the walls n times finds semi-transparent mirrors in a row: 1/T - 1 = n r/(1 - r)."""
    for r, length in ((1e-6, 1000.0), (0.2, 3.0)):
        law = (1.0 - r) * ker.specular() + r * ker.retroreflection()
        found = spec.transmission(law, length, tolerance=1e-3, rng=0)
        assert abs(mirrors(r, length)[0] - float(found)) < 1.5 * found.error <= 1.5e-3
    for section in ("channel", "tube"):
        grooves = spec.transmission(ker.HemisphereLaw(ker.maxwell(1e-6)), 1000.0, section, tolerance=1e-4, rng=0)
        assert grooves.error <= 1e-4 and 0.999 < float(grooves) - grooves.error < float(grooves) + grooves.error <= 1.0


@pytest.mark.parametrize("length", [0.1, 0.75, 4.0])
def test_retroreflecting_walls_pass_what_meets_no_wall(length):
    found = spec.transmission(ker.retroreflection(), length, rng=0)
    assert float(found) == pytest.approx(direct(length), rel=1e-12) and 0.0 < found.error <= 1e-4


def test_the_error_of_the_integral_equation_holds_against_twice_the_nodes(monkeypatch):
    lengths, laws = [0.3, 4.5, 40.0], [ker.lambertian(), ker.maxwell(0.2)]
    cases = [(law, length, section) for law in laws for length in lengths for section in ("channel", "tube")]
    usual = [spec.transmission(*case) for case in cases]
    monkeypatch.setattr(clausing, "NODES", (18, 20))
    for one, case in zip(usual, cases, strict=True):
        assert abs(float(one) - float(spec.transmission(*case))) <= one.error < 1e-8


@pytest.mark.parametrize(("length", "relative"), [(300.0, 0.015), (1e4, 0.004), (1e5, 0.0025)])
def test_long_diffuse_channels_and_tubes_pass_as_diffusion_says(length, relative):
    """Tubes: 8/(3 L) for radius 1. Channels: (ln(2 L) - 1/2)/L."""
    tube, channel = (spec.transmission(ker.lambertian(), length, section) for section in ("tube", "channel"))
    assert float(tube) == pytest.approx(8.0 / (3.0 * length), rel=relative + 0.01 * (length < 1e3))
    assert float(channel) == pytest.approx((math.log(2.0 * length) - 0.5) / length, rel=relative)
    assert max(tube.error, channel.error) < 3e-8


def by_flights(length, rng, tolerance=0.01, law=None, diffuse=1.0):
    return flown_between((law or ker.lambertian(),), (diffuse,), length, rng, tolerance)


def flown_between(laws, diffuse, length, rng, tolerance):
    runs = clausing._Runs(diffuse)
    enter = partial(clausing._entered_in_plane, runs=runs, rng=rng)
    return clausing._by_flights("channel", length, tolerance, runs, enter, partial(clausing._turn, laws, runs, rng))


@pytest.mark.parametrize("length", [0.5, 3.0])
def test_flights_agree_with_the_integral_equation_in_95_percent(monkeypatch, length):
    monkeypatch.setattr(clausing, "TOGETHER", 2**12)
    exact = float(spec.transmission(ker.lambertian(), length))
    found = [by_flights(length, np.random.default_rng(seed)) for seed in range(20)]
    assert all(one.error <= 0.01 for one in found)
    assert sum(abs(float(one) - exact) > one.error for one in found) <= 3


@pytest.mark.parametrize("section", ["channel", "tube"])
@pytest.mark.parametrize("orientation", ["random", 0.7])
def test_grooved_walls_pass_as_many_particles_in_space_as_a_plain_simulation(section, orientation):
    particles = 60_000
    law = 0.8 * ker.HemisphereLaw(ker.lambertian(), orientation) + 0.2 * ker.HemisphereLaw(ker.specular())
    found = spec.transmission(law, 2.0, section, tolerance=2e-3, rng=1)
    seen = in_space(section, 2.0, 0.8, particles, np.random.default_rng(3), orientation) / particles
    assert abs(seen - float(found)) < 1.5 * (found.error + 1.96 * math.sqrt(seen * (1.0 - seen) / particles))
    assert abs(seen - float(spec.transmission(ker.maxwell(0.8), 2.0, section))) > 10.0 * found.error


@pytest.mark.parametrize("section", ["channel", "tube"])
def test_grooves_along_the_axis_pass_all_particles_and_retroreflecting_ones_across_it_none(section):
    passing = {"channel": direct(2.0), "tube": direct(1.0) ** 2}[section]
    along, across = (ker.HemisphereLaw(ker.retroreflection(), angle) for angle in (0.0, np.pi / 2.0))
    for law, expected in ((along, 1.0), (ker.HemisphereLaw(ker.specular()), 1.0), (across, passing)):
        found = spec.transmission(law, 2.0, section, rng=4)
        assert abs(float(found) - expected) <= found.error * (1.0 + 1e-9) <= 1e-4


@pytest.mark.parametrize("law", [ARCS, SAW], ids=["arcs", "saw"])
def test_grooves_across_a_channel_in_space_pass_as_many_particles_as_the_planar_law(law):
    planar = spec.transmission(law, 2.0, tolerance=2e-3, rng=5)
    spatial = spec.transmission(ker.HemisphereLaw(law, np.pi / 2.0), 2.0, tolerance=2e-3, rng=6)
    assert abs(float(planar) - float(spatial)) < planar.error + spatial.error


def test_a_channel_too_short_for_collisions_has_an_error_all_the_same(monkeypatch):
    monkeypatch.setattr(clausing, "MOST_REFLECTIONS", 2 * 10**6)
    found = spec.transmission(ker.HemisphereLaw(ker.lambertian()), 1e-9, tolerance=1e-12, rng=0)
    assert abs(float(found) - (1.0 - 0.5e-9)) <= found.error < 1e-8


@pytest.mark.parametrize(("law", "wall"), [(ARCS, geo.focusing_arcs(1.2)), (SAW, SAW.wall)], ids=["arcs", "saw"])
def test_particles_in_the_plane_pass_as_often_as_the_flights(law, wall):
    seen = passed(Case(0, "", law, wall, 0.0, 2.0), np.random.default_rng(9)) / TOGETHER
    for asked in (law, law.in_specular_frame()):
        found = spec.transmission(asked, 2.0, tolerance=2e-3, rng=8)
        assert abs(seen - float(found)) < 1.5 * (found.error + 1.96 * math.sqrt(seen * (1.0 - seen) / TOGETHER))


def test_a_channel_passes_as_many_particles_in_both_directions():
    there, back = (spec.transmission(law, 3.0, tolerance=2e-3, rng=2) for law in (SAW, SAW_TURNED))
    assert abs(float(there) - float(back)) < there.error + back.error
    # the direct passage is a third of it only, and the wall is far from diffuse
    assert abs(float(there) - float(spec.transmission(ker.lambertian(), 3.0))) > 10.0 * there.error


def test_flights_end_at_their_limit_and_count_particles_inside_as_error(monkeypatch):
    monkeypatch.setattr(clausing, "MOST_REFLECTIONS", 2 * 10**6)
    monkeypatch.setattr(clausing, "TOGETHER", 2**12)
    monkeypatch.setattr(clausing, "BATCHES", 0.2)
    long = by_flights(2000.0, np.random.default_rng(0), 1e-4)
    assert "still inside" in long.method and long.error > 1e-4
    assert abs(float(long) - float(spec.transmission(ker.lambertian(), 2000.0))) < long.error
    short = spec.transmission(SAW, 1.0, tolerance=1e-9, rng=0)
    assert 2e-4 < short.error < 3e-3 and "still inside" not in short.method


def test_flights_end_at_once_where_polynomials_are_better(monkeypatch):
    law, flown = ker.henyey_greenstein(0.5), []
    whole = clausing._flown
    monkeypatch.setattr(clausing, "LEVELS", clausing.LEVELS[:3])
    monkeypatch.setattr(clausing, "_flown", lambda *how: flown.append(1) or whole(*how))
    found = spec.transmission(law, 3.0, tolerance=1e-12, rng=0)
    assert "polynomials" in found.method and found.error > 1e-12 and len(flown) == 1


def test_a_matrix_with_too_large_an_error_leaves_the_transmission_of_the_one_before(monkeypatch):
    law, solve = ker.henyey_greenstein(0.8), clausing._in_polynomials
    monkeypatch.setattr(clausing, "LEVELS", ((4, 4), *clausing.LEVELS[:3]))
    finest = clausing._by_polynomials((law,), 3.0, 1e-12, np.random.default_rng(0))
    assert "32 polynomials" in finest.method

    def noisy(matrix, length, size, nodes):
        value, noise = solve(matrix, length, size, nodes)
        return (value + 0.1, 0.1) if size == 32 else (value, noise)

    monkeypatch.setattr(clausing, "_in_polynomials", noisy)
    found = clausing._by_polynomials((law,), 3.0, 1e-12, np.random.default_rng(0))
    assert abs(float(found) - float(finest)) < found.error < 0.05 and "16 polynomials" in found.method


def test_a_seed_gives_the_same_number_again():
    first, second = (spec.transmission(SAW, 1.0, tolerance=3e-3, rng=rng) for rng in (4, np.random.default_rng(4)))
    assert first == second and first != spec.transmission(SAW, 1.0, tolerance=3e-3, rng=5)


@pytest.mark.parametrize(
    ("law", "length"), [(ARCS, 3.0), (ker.henyey_greenstein(-0.5), 0.4), (ker.WallLaw(geo.dispersing_arcs(2.0)), 0.4)]
)
def test_polynomials_agree_with_flights_and_their_error_holds(law, length):
    found = spec.transmission(law, length, rng=1)
    assert found.error <= 1e-4 and "polynomials" in found.method
    flown = by_flights(length, np.random.default_rng(2), 1e-3, law)
    assert abs(float(found) - float(flown)) < 1.5 * (found.error + flown.error)


@pytest.mark.parametrize("diffuse", [0.55, 0.8])
def test_polynomials_agree_with_the_integral_equation_of_diffuse_walls(diffuse):
    exact = float(spec.transmission(ker.maxwell(diffuse), 3.0))
    found = clausing._by_polynomials((ker.maxwell(diffuse),), 3.0, 1e-5, np.random.default_rng(0))
    assert abs(float(found) - exact) < found.error < 5e-5


def test_the_derivative_by_the_matrix_is_that_of_the_transmission():
    rng = np.random.default_rng(0)
    matrix = np.asarray(ker.discretise(SAW, ker.Legendre(6)).symmetric)
    step = rng.standard_normal((6, 6))
    flights = clausing._planar_flights(6, 2.0)
    ahead, back = (clausing._solved(flights, matrix + h * step, 2.0, 8)[0] for h in (1e-5, -1e-5))
    slope = clausing._solved(flights, matrix, 2.0, 8)[1]
    assert (ahead - back) / 2e-5 == pytest.approx(float(np.sum(slope * step)), rel=1e-5)


def test_the_error_by_the_rays_of_the_matrix_is_their_spread():
    law, found = ker.WallLaw(geo.dispersing_arcs(2.0)), []
    for seed in range(10):
        matrix = ker.discretise(law, ker.Legendre(8), "qmc", samples=2**14, rng=seed)
        found.append(clausing._in_polynomials([matrix], 2.0, 8, 6))
    value, noise = np.array(found).T
    assert np.sum(np.abs(value - value.mean()) > noise) <= 2
    assert 0.3 < 2.0 * value.std(ddof=1) / np.median(noise) < 1.5


def test_one_small_change_is_not_taken_for_convergence():
    """From 8 to 16 polynomials this law changes by less than half of the error of 16."""
    law, length = ker.CircularArcLaw(1.4471656964570416), 10.880220834204371
    rough, fine = (spec.transmission(law, length, tolerance=tolerance, rng=0) for tolerance in (5e-3, 2e-4))
    assert abs(float(rough) - float(fine)) + fine.error < rough.error


def test_laws_that_keep_functions_of_all_degrees_are_left_to_flights():
    for law in (ker.retroreflection(), SAW, ker.RectangularTeethLaw(1.0)):
        assert clausing._by_polynomials((law,), 4.0, 1e-2, np.random.default_rng(0)).error == math.inf


# ---- a floor and a ceiling -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class OneForm(ker.Law):
    """A law of a user: angles as of a diffuse wall, but in a tenth of the reflections back where the ray came from."""

    def _sample(self, theta, rng):
        return np.where(rng.random(theta.shape) < 0.1, theta, np.arccos(1.0 - 2.0 * rng.random(theta.shape)))

    def _conditionals(self, theta, *wanted):
        return (0.1 * ker.retroreflection() + 0.9 * ker.lambertian())._conditionals(theta, *wanted)


def diffuse_wall(fraction):
    return Case(0, "", ker.maxwell(fraction), None, fraction, 0.0)


def in_plane(floor, ceiling, length, particles, rng):
    """The fraction that passes, by places and velocities in the strip 0 < y < 1, and its standard deviation."""
    sine = 2.0 * rng.random(particles) - 1.0
    x, y, v = np.zeros(particles), rng.random(particles), np.stack((np.sqrt(1.0 - sine**2), sine))
    through = 0
    while x.size:
        rises = v[1] > 0.0
        x = x + np.where(rises, 1.0 - y, -y) / v[1] * v[0]
        through += np.count_nonzero(x >= length)
        inside = (x > 0.0) & (x < length)
        x, v, rises = x[inside], v[:, inside], rises[inside]
        y = np.where(rises, 1.0, 0.0)
        for case, here, way in ((floor, ~rises, 1.0), (ceiling, rises, -1.0)):
            along, across = case.reflect(v[0, here], np.abs(v[1, here]), rng)
            v[:, here] = along, way * across
    return through / particles, math.sqrt(through * (1.0 - through / particles)) / particles


PAIRS = {
    "diffuse and partly": (diffuse_wall(1.0), diffuse_wall(0.3), 3.0),
    "both partly": (diffuse_wall(0.2), diffuse_wall(0.7), 5.0),
    "nearly smooth": (diffuse_wall(0.5), diffuse_wall(0.02), 10.0),
    "arcs and diffuse": (Case(0, "", ARCS, geo.focusing_arcs(1.2), 0.0, 0.0), diffuse_wall(1.0), 3.0),
    "saw and arcs": (Case(0, "", SAW, SAW.wall, 0.0, 0.0), Case(0, "", ARCS, geo.focusing_arcs(1.2), 0.0, 0.0), 1.5),
    "saw and partly": (Case(0, "", SAW, SAW.wall, 0.0, 0.0), diffuse_wall(0.3), 2.0),
    "saw and smooth": (Case(0, "", SAW, SAW.wall, 0.0, 0.0), diffuse_wall(0.0), 2.0),
}


@pytest.mark.parametrize("kind", PAIRS)
def test_a_channel_with_two_laws_passes_as_many_particles_as_a_simulation_in_the_plane(kind):
    floor, ceiling, length = PAIRS[kind]
    seen, sigma = in_plane(floor, ceiling, length, 60_000, np.random.default_rng(11))
    found = spec.transmission(floor.law, length, tolerance=4e-3, rng=1, other=ceiling.law)
    assert found.error <= 4e-3 and abs(float(found) - seen) < found.error + 3.5 * sigma
    # floor and ceiling may be exchanged, in either convention
    laws = ceiling.law.in_specular_frame(), floor.law.in_specular_frame()
    turned = spec.transmission(laws[0], length, tolerance=4e-3, rng=2, other=laws[1])
    assert abs(float(turned) - float(found)) <= 1.2 * (found.error + turned.error)
    # and both laws count
    for law in (floor.law, ceiling.law):
        alike = spec.transmission(law, length, tolerance=4e-3, rng=3)
        assert abs(float(alike) - seen) > 3.0 * (found.error + alike.error)


def test_errors_of_two_laws_hold(monkeypatch):
    exact = spec.transmission(ker.maxwell(0.8), 3.0, other=ker.maxwell(0.3))
    assert exact.error < 1e-12
    laws, rests = (ker.maxwell(0.8), ker.maxwell(0.3)), (ker.lambertian(), ker.lambertian())
    misses = 0
    for seed in range(20):
        flown = flown_between(rests, (0.8, 0.3), 3.0, np.random.default_rng(seed), 8e-3)
        misses += abs(float(flown) - float(exact)) > flown.error
        assert flown.error <= 8e-3
    assert misses <= 3
    rough = ker.henyey_greenstein(0.3), ker.henyey_greenstein(-0.85)
    fine = clausing._by_polynomials(rough, 3.0, 1e-7, np.random.default_rng(0))
    monkeypatch.setattr(clausing, "LEVELS", ((4, 4), *clausing.LEVELS[:2]))
    coarse = clausing._by_polynomials(rough, 3.0, 1e-7, np.random.default_rng(0))
    assert 0.0 < abs(float(coarse) - float(fine)) + fine.error < coarse.error < 0.02
    smooth = clausing._by_polynomials((laws[0], ker.lambertian()), 3.0, 1e-5, np.random.default_rng(0))
    known = spec.transmission(ker.maxwell(0.8), 3.0, other=ker.lambertian())
    assert abs(float(smooth) - float(known)) < smooth.error < 2e-4


@pytest.mark.parametrize("law", [ker.lambertian(), ker.maxwell(0.4), ARCS, SAW, OneForm(), ker.HemisphereLaw(ARCS)])
def test_twice_the_same_law_is_one_law(law):
    one = spec.transmission(law, 2.0, tolerance=5e-3, rng=1)
    assert spec.transmission(law, 2.0, tolerance=5e-3, rng=1, other=law) == one


def test_the_equations_of_two_walls_of_one_law_have_its_solution():
    geometry, runs = clausing.GEOMETRIES["channel"], [clausing._Runs(part) for part in ((0.4,), (0.4, 0.4))]
    first, second = (clausing._by_integral_equation(geometry, part, 7.0) for part in runs)
    assert first.value == pytest.approx(second.value, rel=1e-13)
    same, twice = (clausing._by_polynomials((ARCS,) * n, 3.0, 1e-4, np.random.default_rng(0)) for n in (1, 2))
    assert same.value == pytest.approx(twice.value, rel=1e-12)


def test_a_smooth_ceiling_is_a_symmetry_plane():
    for law in (ker.lambertian(), ker.maxwell(0.3), ARCS, OneForm()):
        wide, half = (spec.transmission(law, 6.0, rng=1, tolerance=1e-3, other=ker.specular()),
                      spec.transmission(law, 3.0, rng=1, tolerance=1e-3))  # fmt: skip
        assert wide == half
    assert float(spec.transmission(ker.retroreflection(), 4.0, rng=0, other=ker.specular())) == pytest.approx(
        direct(2.0), rel=1e-12
    )
    # to which nearly smooth ceilings tend
    near = [float(spec.transmission(ker.lambertian(), 4.0, other=ker.maxwell(a))) for a in (1e-4, 1e-8, 1e-12)]
    limit = float(spec.transmission(ker.lambertian(), 2.0))
    assert 0.0 < limit - near[0] < 1e-3 and abs(near[1] - limit) < 1e-7 and abs(near[2] - limit) < 1e-11
    assert float(spec.transmission(ker.specular(), 9.0, other=ker.specular())) == 1.0


def test_laws_in_space_at_floor_and_ceiling_pass_as_many_particles_as_the_planar_laws():
    across = [ker.HemisphereLaw(law, np.pi / 2.0) for law in (ARCS, ker.maxwell(0.4))]
    found = spec.transmission(across[0], 3.0, tolerance=1e-2, rng=1, other=across[1])
    planar = spec.transmission(ARCS, 3.0, tolerance=5e-3, rng=2, other=ker.maxwell(0.4))
    assert abs(float(found) - float(planar)) < 1.2 * (found.error + planar.error)


def test_a_law_of_a_user_stands_at_the_floor_or_at_the_ceiling():
    law, same = OneForm(), 0.1 * ker.retroreflection() + 0.9 * ker.lambertian()
    values = [spec.transmission(one, 2.0, tolerance=4e-3, rng=1, other=ker.maxwell(0.5)) for one in (law, same)]
    values.append(spec.transmission(ker.maxwell(0.5), 2.0, tolerance=4e-3, rng=2, other=law))
    assert max(map(float, values)) - min(map(float, values)) < 1.2 * sum(one.error for one in values[:2])
