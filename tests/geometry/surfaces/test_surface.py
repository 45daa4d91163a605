"""Rays on height maps: exact cases, symmetries, and a tracer in 50 digits that shares no code."""

import numpy as np
import pytest
from campaigns.judges.precise_surface import follow

from asperity import geometry as geo
from asperity.errors import InputError


def cosine_rays(n, rng, surface):
    """Entry points on one period and incoming velocities of the cosine law."""
    radius, angle = np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    down = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -np.sqrt(1.0 - radius**2)])
    return rng.random((n, 2)) * surface.periods, down


def noise(n, m, steepness, spacing=1.0, seed=0):
    """Heights without correlation, scaled to an rms slope."""
    rough = geo.Surface(np.random.default_rng(seed).standard_normal((n, m)), spacing)
    return geo.Surface(rough.heights * steepness / rough.rms_slope, spacing)


MAPS = {
    "noise": noise(24, 17, 0.7, (0.7, 1.3)),
    "steep": noise(12, 12, 6.0, seed=1),
    "integers": geo.Surface(np.random.default_rng(2).integers(0, 3, (8, 9)).astype(float)),
    "plateau": geo.Surface(np.kron([[0.0, 1.0], [1.0, 1.0]], np.ones((3, 3)))),
    "cliffs": geo.Surface(np.where(np.arange(12)[:, None] % 4 == 0, 30.0, 0.0) + np.zeros((12, 3))),
    "column": geo.Surface([[0.0], [0.4], [-0.3]], 0.5),
    "two by two": geo.Surface([[0.0, 1.0], [1.0, 0.0]], (1.0, 2.0)),
}


@pytest.fixture(params=MAPS)
def surface(request):
    return MAPS[request.param]


def test_rays_are_those_of_a_tracer_in_50_digits(surface):
    x, v = cosine_rays(25, np.random.default_rng(5), surface)
    found = surface.trace(x, v)
    assert found.escaped.all()
    for k in range(len(x)):
        out_x, out_y, along, hits = follow(surface.heights.tolist(), surface.spacing, x[k], v[k])
        assert found.collisions[k] == hits
        # each hit multiplies an error of the position by the bend of the surface
        room = 1e-14 * 4.0 ** min(hits, 12)
        assert np.abs(found.velocities[k] - [float(one) for one in along]).max() < room
        assert np.abs(found.points[k] - [float(out_x), float(out_y)]).max() < 100.0 * room


def test_the_speed_is_kept_and_no_ray_is_lost(surface):
    x, v = cosine_rays(20_000, np.random.default_rng(6), surface)
    found = surface.trace(x, 3.0 * v)
    assert found.escaped.all() and (found.collisions >= 1).all()
    assert (found.velocities[:, 2] > 0.0).all()
    assert np.abs(np.linalg.norm(found.velocities, axis=1) - 3.0).max() < 1e-12


def test_a_ray_returns_on_its_own_path(surface):
    x, v = cosine_rays(4_000, np.random.default_rng(7), surface)
    there = surface.trace(x, v)
    back = surface.trace(there.points, -there.velocities)
    # a ray within rounding of an edge may take the neighbouring facet on its way back, and rays of many hits diverge
    same = np.abs(back.velocities + v).max(axis=1) < 1e-9
    few = there.collisions <= 6
    assert same[few].mean() > 0.999 and (back.collisions == there.collisions)[few & same].all()


def test_a_flat_surface_mirrors_every_ray_where_it_enters():
    flat = geo.Surface(np.full((3, 2), 2.5), (0.5, 2.0), "mm")
    x, v = cosine_rays(1000, np.random.default_rng(0), flat)
    found = flat.trace(x, v)
    assert np.array_equal(found.velocities, v * [1.0, 1.0, -1.0]) and np.array_equal(found.points, x)
    assert (found.collisions == 1).all() and flat.rms_slope == flat.rms_height == 0.0 and flat.area == 6.0


@pytest.mark.parametrize("along_y", [False, True])
def test_grooves_reflect_as_the_planar_wall_does(along_y):
    heights = np.array([0.0, -0.3, -1.0, -0.7, -0.2, -0.5])
    wall = geo.Wall.from_profile(np.arange(7) / 6.0, np.append(heights, 0.0), seam="step")
    grooves = geo.Surface(heights[None] if along_y else heights[:, None], 1.0 / 6.0)
    x, v = cosine_rays(3000, np.random.default_rng(1), grooves)
    found = grooves.trace(x, v)
    across, along = (1, 0) if along_y else (0, 1)
    # the velocity along the grooves is kept, and across it is that of the planar ray
    assert np.abs(found.velocities[:, along] - v[:, along]).max() < 1e-15
    theta = np.arctan2(-v[:, 2], -v[:, across])
    planar = geo.trace(wall, x[:, across], theta)
    out = np.arctan2(found.velocities[:, 2], found.velocities[:, across])
    assert np.abs(out - planar.theta).max() < 1e-9
    assert np.array_equal(found.collisions, planar.collisions)
    assert np.abs(found.points[:, across] - planar.x).max() < 1e-9


def test_translation_by_points_of_the_grid_moves_rays():
    rough = MAPS["noise"]
    moved = geo.Surface(np.roll(rough.heights, (5, 3), (0, 1)), rough.spacing)
    # sixteenths of the spacing, so that positions are moved without rounding
    rng = np.random.default_rng(3)
    at = rng.integers(0, 256, (5000, 2)) / 16.0
    unit, unit_moved = geo.Surface(rough.heights), geo.Surface(moved.heights)
    _, v = cosine_rays(5000, rng, rough)
    here, there = unit.trace(at, v), unit_moved.trace(at + np.array([5.0, 3.0]), v)
    assert np.array_equal(here.collisions, there.collisions)
    # positions relative to the square are the same to the last bit, and with them the velocities
    assert np.abs(here.velocities - there.velocities).max() < 1e-12
    assert np.abs(here.points + np.array([5.0, 3.0]) - there.points).max() < 1e-10


def test_whole_periods_do_not_matter_and_points_are_unfolded():
    rough = MAPS["two by two"]
    x, v = cosine_rays(500, np.random.default_rng(4), rough)
    far = np.array(rough.periods) * [1024.0, -4096.0]
    near, moved = rough.trace(x, v), rough.trace(x + far, v)
    few = near.collisions < 5
    assert np.abs(near.points + far - moved.points)[few].max() < 1e-8
    assert (np.abs(near.points - x) > rough.periods).any()


def test_turning_by_half_a_turn_and_transposing_turn_the_rays():
    rough = MAPS["noise"]
    x, v = cosine_rays(2000, np.random.default_rng(8), rough)
    here = rough.trace(x, v)
    half = geo.Surface(np.roll(rough.heights[::-1, ::-1], 1, (0, 1)), rough.spacing)
    other = half.trace(-x, v * [-1.0, -1.0, 1.0])
    assert np.array_equal(here.collisions, other.collisions)
    assert np.abs(here.velocities - other.velocities * [-1.0, -1.0, 1.0]).max() < 1e-11
    across = geo.Surface(rough.heights.T, rough.spacing[::-1])
    other = across.trace(x[:, ::-1], v[:, [1, 0, 2]])
    assert np.abs(here.velocities - other.velocities[:, [1, 0, 2]]).max() < 1e-11


def test_scaling_all_lengths_by_a_power_of_two_changes_no_bit():
    rough = MAPS["steep"]
    x, v = cosine_rays(2000, np.random.default_rng(9), rough)
    large = geo.Surface(rough.heights * 4.0, 4.0)
    assert np.array_equal(rough.trace(x, v).velocities, large.trace(4.0 * x, v).velocities)
    assert np.array_equal(rough.trace(x, v).velocities * 2.0**-900, rough.trace(x, v * 2.0**-900).velocities)


@pytest.mark.parametrize("kind", ["vertices", "edges", "diagonals", "quarters"])
@pytest.mark.parametrize("down", ["vertical", "dyadic", "grazing"])
def test_aimed_rays_escape_but_level_ones(surface, kind, down):
    rng, n = np.random.default_rng(10), 4000
    at = rng.integers(0, 64, (n, 2)).astype(float)
    at[:, 0] += {"edges": rng.random(n), "diagonals": rng.random(n), "quarters": rng.integers(0, 4, n) / 4.0}.get(
        kind, 0.0
    )
    at[:, 1] += {"diagonals": at[:, 0] % 1.0, "quarters": rng.integers(0, 4, n) / 4.0}.get(kind, 0.0)
    v = {
        "vertical": np.tile([0.0, 0.0, -1.0], (n, 1)),
        "dyadic": np.column_stack([rng.integers(-4, 5, (n, 2)) / 4.0, -rng.integers(1, 5, n) / 4.0]),
        "grazing": np.column_stack([rng.standard_normal((n, 2)), -np.full(n, 1e-3)]),
    }[down]
    found = surface.trace(at * surface.spacing, v)
    lost = ~found.escaped
    assert np.isfinite(found.velocities).all() and np.isfinite(found.points).all()
    assert np.abs(np.linalg.norm(found.velocities, axis=1) / np.linalg.norm(v, axis=1) - 1.0).max() < 1e-11
    assert (found.collisions >= 1).all() and (found.velocities[~lost, 2] > 0.0).all()
    # exactly level: at the height of the top, or in a straight valley
    assert (found.velocities[lost, 2] == 0.0).all()
    if down == "grazing":
        assert not lost.any()


def test_a_level_ray_at_the_top_grazes():
    # facets of 45 degrees turn a vertical ray level: at the ridge it has the height of the top
    roof = geo.Surface([[0.0], [1.0]])
    found = roof.trace([1.0, 0.5], [0.0, 0.0, -1.0])
    assert found.counts() == {"escaped": 0, "corner": 0, "grazing": 1, "bounce_limit": 0}
    assert found.velocities[2] == 0.0 and abs(found.velocities[0]) == 1.0


def test_the_limit_on_collisions_holds():
    roof = geo.Surface([[0.0], [1.0]])
    found = roof.trace([1.5, 0.25], [0.0, 0.0, -1.0], max_collisions=1)
    assert found.counts()["bounce_limit"] == 1 and int(found.collisions) == 1
    assert int(roof.trace([1.5, 0.25], [0.0, 0.0, -1.0], max_collisions=2).collisions) == 2


def test_the_result_does_not_depend_on_threads():
    rough = MAPS["noise"]
    x, v = cosine_rays(40_000, np.random.default_rng(11), rough)
    one, two = rough.trace(x, v, threads=1), rough.trace(x, v, threads=2)
    assert np.array_equal(one.velocities, two.velocities) and np.array_equal(one.points, two.points)


def test_points_and_velocities_broadcast():
    found = MAPS["noise"].trace(np.zeros((4, 1, 2)) + 0.3, np.tile([0.1, 0.2, -1.0], (3, 1)))
    assert found.points.shape == (4, 3, 2) and found.status.shape == (4, 3)
    assert MAPS["noise"].trace(np.zeros((0, 2)), np.zeros((0, 3))).points.shape == (0, 2)


def test_vertical_rays_leave_gentle_facets_at_twice_their_slope():
    # f(x) + g(y) with slopes 1/5: v_n' = (1 - s^2)/(1 + s^2) with s^2 = 2/25
    tent = geo.Surface(np.add.outer([0.0, 0.2], [0.0, 0.2]))
    up = tent.trace(np.random.default_rng(0).random((1000, 2)) * 2.0, [0.0, 0.0, -1.0])
    assert np.abs(up.velocities[:, 2] - 23.0 / 27.0).max() < 1e-15 and (up.collisions == 1).all()


def test_a_trajectory_has_the_hits_of_the_ray(surface):
    x, v = cosine_rays(20, np.random.default_rng(12), surface)
    for one, along in zip(x - 100.0, v, strict=True):
        path, found = surface.trajectory(one, along), surface.trace(one, along)
        assert len(path) == found.collisions + 2 and np.allclose(path[-1, :2], found.points)
        assert path[0, 2] == path[-1, 2] == surface.heights.max() and np.array_equal(path[0, :2], one)
        legs = np.diff(path, axis=0)
        for leg, way in ((legs[0], along), (legs[-1], found.velocities)):
            # a hit at the top is the entry or the exit
            if np.linalg.norm(leg) > 1e-9:
                assert np.allclose(leg / np.linalg.norm(leg), way, atol=1e-6)


def test_the_facts_of_known_surfaces():
    # one point raised by 1: four facets with the slope 1, two with the slopes (1, -1), two level ones
    one = geo.Surface([[0.0, 0.0], [0.0, 1.0]], 1.0, "nm")
    assert one.periods == (2.0, 2.0) and one.rms_slope == 1.0
    assert one.area == pytest.approx(2.0 * np.sqrt(2.0) + np.sqrt(3.0) + 1.0, rel=1e-15)
    # the mean square of a linear function on a triangle, by its values at the middles of the sides
    middles = [0.5, 0.5, 0.0]
    square = 6.0 * np.mean(np.square(middles)) / 8.0
    assert one.rms_height == pytest.approx(np.sqrt(square - 0.25**2), rel=1e-15)
    points = geo.Surface(MAPS["noise"].heights, MAPS["noise"].spacing)
    assert points == MAPS["noise"] and hash(points) == hash(MAPS["noise"]) and points != one
    with pytest.raises(ValueError, match="read-only"):
        points.heights[0, 0] = 1.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: geo.Surface([1.0, 2.0]), r"heights: expected shape \(n, m\), got \(2,\)"),
        (lambda: geo.Surface([[0.0, np.nan]]), r"heights: expected finite numbers, got nan at index \(0, 1\)"),
        (lambda: geo.Surface([[0.0, np.inf]]), "heights: expected finite numbers, got inf"),
        (lambda: geo.Surface([[0.0, 1j]]), "heights: expected numbers"),
        (lambda: geo.Surface(np.zeros((0, 3))), r"heights: expected one at least, got shape \(0, 3\)"),
        (lambda: geo.Surface(np.broadcast_to(0.0, (10**6, 10**6))), "heights: the map takes 3.2e[+]04 GB of memory"),
        (lambda: geo.Surface([[0.0, 1e200]]), "heights: expected at most 1e[+]100"),
        (lambda: geo.Surface([[0.0, 1.0]], 1e-150), "heights: expected at most 1e[+]100"),
        (lambda: geo.Surface([[0.0]], -1.0), "spacing: expected a positive number or a pair of such, got -1.0"),
        (lambda: geo.Surface([[0.0]], 0.0), "spacing: expected a positive number"),
        (lambda: geo.Surface([[0.0]], [1.0, 2.0, 3.0]), "spacing: expected a positive number or a pair"),
        (lambda: geo.Surface([[0.0]], "mm"), "spacing: expected numbers"),
        (lambda: geo.Surface([[0.0]], 1.0, 3), "unit: expected a str"),
        (lambda: MAPS["noise"].trace([0.0, 0.0], [0.0, 0.0, 1.0]), "velocities: expected incoming ones"),
        (lambda: MAPS["noise"].trace([0.0, 0.0], [1.0, 0.0, 0.0]), "velocities: expected incoming ones"),
        (lambda: MAPS["noise"].trace([0.0], [0.0, 0.0, -1.0]), r"points: expected shape \(\.\.\., 2\)"),
        (lambda: MAPS["noise"].trace([0.0, np.nan], [0.0, 0.0, -1.0]), "points: expected finite"),
        (lambda: MAPS["noise"].trace(np.zeros((3, 2)), -np.ones((2, 3))), r"for all pairs pass points\[:, None\]"),
        (lambda: MAPS["noise"].trace([0.0, 0.0], [0.0, 0.0, -1.0], max_collisions=1.5), "max_collisions: expected"),
        (lambda: MAPS["noise"].trajectory([[0.0, 0.0]], [0.0, 0.0, -1.0]), r"point: expected shape \(2,\)"),
        (lambda: MAPS["noise"].plot(ax=3), "ax: expected"),
        (lambda: MAPS["noise"].save("map.toml"), "expected a name that ends in .npz"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_clear_error(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_the_plot_shows_the_map_and_the_ray():
    from matplotlib import pyplot

    ax = MAPS["noise"].plot([[1.0, 2.0], [3.0, 4.0]], [0.4, 0.1, -0.5])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y") and len(ax.lines) == 10
    assert ax.get_xlim()[1] - ax.get_xlim()[0] >= MAPS["noise"].periods[0]
    pyplot.close("all")


def test_rays_along_a_facet_within_rounding_leave_it():
    # a velocity along the facet below the highest point, but for some roundings of its descent
    rng = np.random.default_rng(13)
    for _ in range(40):
        rough = geo.Surface(rng.standard_normal((5, 4)), tuple(rng.uniform(0.3, 3.0, 2)))
        i, j = np.unravel_index(np.argmax(rough.heights), rough.heights.shape)
        slope = rough.facet_slopes()[0, i, j]
        across = np.array([1.0, 0.0]) + rng.random((200, 1)) * [0.0, 1.0] * np.divide(*rough.spacing[::-1])
        descent = across @ slope
        v = np.column_stack([across, descent * (1.0 + rng.integers(-3, 4, 200) * 2.0**-52)])[descent < 0.0]
        if len(v):
            found = rough.trace(np.multiply((i, j), rough.spacing), v)
            assert found.escaped.all() and found.collisions.max() < 1000
