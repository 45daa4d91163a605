"""What holds of every wall, its images and its file; of its rays: reversal, flux, bounces, mirror, scale, period.

Rays end where other tracers say: one in double-doubles, one in 50 digits, and a plain one with formulas of its own.
"""

import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_plainly
from campaigns.rays.aimed_rays import AimedRays, aimed_rays, grazing_rays, judge

from asperity import geometry as geo
from asperity.geometry.curves.columns import FIRST_PAIR, FORM, NO_FORM, PAIRS_END, RUN_SINE

EPS = np.finfo(float).eps
# Rays on a wall; between an island of a curve and the floor some are nearly caught.
RAYS, FEW, MANY_PIECES, MOST_HITS = 2_000, 500, 200, 1_000


def spread_rays(wall, count, rng):
    """Rays that enter with the invariant measure, at positions that a whole number of periods moves exactly."""
    return wall.period * rng.integers(2**30, size=count) / 2**30, np.arccos(1.0 - 2.0 * rng.random(count))


def conditioned(wall, x, theta, found, most=MOST_HITS):
    """The rays that neighbours on either side accompany, and how far the end of a ray moves when its start does."""
    h = 1e-8
    moves = [(x + h * wall.period, theta), (x, theta + h * np.minimum(1.0, np.sin(theta)))]
    moves += [(2 * x - moves[0][0], theta), (x, 2 * theta - moves[1][1])]
    near = [geo.trace(wall, *move, max_collisions=most) for move in moves]
    stable = np.all([n.collisions == found.collisions for n in near], axis=0) & found.escaped
    moved = sum(np.abs(n.theta - found.theta) + np.abs(n.x - found.x) / wall.period for n in near)
    return stable, 64 * EPS * (1 + found.collisions) * (1 + moved / h)


# ---- the wall ----------------------------------------------------------------------------------------------------
def test_pieces_share_their_joints_to_the_bit(wall):
    paths = [(wall.pieces, wall.vertices), *zip(wall.islands, wall.island_vertices, strict=True)]
    for pieces, joints in paths:
        assert joints.shape == (len(pieces) + 1, 2) and not joints.flags.writeable
        for piece, start, end in zip(pieces, joints[:-1], joints[1:], strict=True):
            assert piece.start == tuple(start) and piece.end == tuple(end)
    ends = wall.vertices[[0, -1]]
    assert ends[:, 0].tolist() == [0.0, wall.period] and ends[0, 1] == ends[1, 1]
    for loop in wall.island_vertices:
        assert tuple(loop[0]) == tuple(loop[-1])


def test_walls_without_islands_close_and_consist_of_tops_and_hollows(wall):
    assert wall.closes == (not wall.islands)
    covered = wall.flat_top + sum(hollow.width for hollow in wall.hollows)
    assert covered == pytest.approx(wall.period if wall.closes else wall.flat_top, rel=1e-13)


@pytest.mark.parametrize("factor", [1e-6, 3.7, 1e6])
def test_a_wall_is_valid_at_every_scale(wall, factor):
    pieces, *islands = [[p.stretched(factor, factor) for p in path] for path in (wall.pieces, *wall.islands)]
    scaled = wall.scaled(factor)
    assert geo.Wall(pieces, wall.period * factor, islands) == scaled
    assert scaled.depth == pytest.approx(factor * wall.depth, rel=1e-15)
    assert scaled.arc_length == pytest.approx(factor * wall.arc_length, rel=1e-13)


def test_images_of_a_wall_are_valid_walls(wall):
    disk = geo.Disk(1.0, 0.5)
    for image in (wall.mirrored(), wall.foreshorten(disk), wall.unforeshorten(disk), wall.scaled(0.3)):
        assert geo.Wall(image.pieces, image.period, image.islands) == image
        assert image.closes == wall.closes and len(image.hollows) == len(wall.hollows)
        assert image.is_mirror_symmetric == wall.is_mirror_symmetric
    assert wall.foreshorten(disk).depth == pytest.approx(wall.depth * np.sqrt(3.0), rel=1e-14)
    assert wall.foreshorten(disk).period == wall.period
    np.testing.assert_allclose(wall.foreshorten(disk).unforeshorten(disk).vertices, wall.vertices, rtol=1e-15)
    np.testing.assert_allclose(wall.mirrored().mirrored().vertices, wall.vertices, rtol=0, atol=1e-15 * wall.period)


def test_a_saved_wall_is_read_back_to_the_bit(wall, tmp_path):
    wall.save(tmp_path / "wall.toml")
    again = geo.load_wall(tmp_path / "wall.toml")
    assert again == wall and repr(again.vertices.tolist()) == repr(wall.vertices.tolist())
    assert again.arc_length == wall.arc_length and again.hollows == wall.hollows
    again.save(str(tmp_path / "again.toml"))
    assert (tmp_path / "again.toml").read_bytes() == (tmp_path / "wall.toml").read_bytes()


# ---- its rays ----------------------------------------------------------------------------------------------------
def test_tracing_back_returns_the_ray(wall):
    x, theta = spread_rays(wall, RAYS, np.random.default_rng(2))
    there = geo.trace(wall, x, theta, max_collisions=MOST_HITS)
    gone = there.escaped
    x, theta, out, angle = x[gone], theta[gone], there.x[gone], there.theta[gone]
    back = geo.trace(wall, out, angle, max_collisions=MOST_HITS)
    stable, allowed = conditioned(wall, out, angle, back)
    miss = np.abs(back.theta - theta) + np.abs(back.x - x) / wall.period
    assert gone.mean() > 0.98 and stable.mean() > 0.95
    assert np.array_equal(back.collisions[stable], there.collisions[gone][stable])
    assert np.all(miss[stable] <= allowed[stable])


def test_the_flux_is_preserved(closed_wall):
    """The outgoing -cos theta' of rays that enter with the invariant measure is uniform: chi-square in 32 bins."""
    x, theta = spread_rays(closed_wall, 40_000, np.random.default_rng(3))
    number, _ = np.histogram(-np.cos(geo.trace(closed_wall, x, theta).theta), 32, (-1.0, 1.0))
    expected = len(x) / 32
    chi = np.sum((number - expected) ** 2) / expected
    assert abs(chi - 31) / np.sqrt(62) < 4.5


def test_the_mean_number_of_bounces_is_wall_over_opening(closed_wall, request):
    """Kac: over the flux, mean bounces in the hollows = length of their boundary / width of their openings.

    Mushrooms are left out, rays that circle in the cap outside the stem's caustic are never reached from the opening;
    so is a wall with a pocket behind a point.
    """
    name = request.node.callspec.params["closed_wall"]
    if "mushroom" in name or name in ("flat", "floor", "long stems", "corner on an edge"):
        pytest.skip("no hollow, or one of which rays reach a part only")
    rng, n = np.random.default_rng(4), 20_000
    widths, lefts = np.array([(hollow.width, hollow.left) for hollow in closed_wall.hollows]).T
    which = rng.choice(len(widths), n, p=widths / widths.sum())
    x, theta = lefts[which] + widths[which] * rng.random(n), np.arccos(1.0 - 2.0 * rng.random(n))
    hits = geo.trace(closed_wall, x, theta).collisions
    expected = (closed_wall.arc_length - closed_wall.flat_top) / widths.sum()
    assert abs(np.mean(hits) - expected) < 4.5 * np.std(hits) / np.sqrt(n) + 1e-8


def test_mirror_scale_and_period_move_the_rays_with_the_wall(wall):
    x, theta = spread_rays(wall, FEW, np.random.default_rng(10))
    found = geo.trace(wall, x, theta, max_collisions=MOST_HITS)
    stable, allowed = conditioned(wall, x, theta, found)
    assert stable.mean() > 0.9
    images = [
        (wall.mirrored(), wall.period - x, np.pi - theta),
        *((wall.scaled(factor), x * factor, theta) for factor in (2.0**20, 2.0**-20)),
        (wall, x + 3 * wall.period, theta),
    ]
    for k, image in enumerate(images):
        one = geo.trace(*image, max_collisions=MOST_HITS)
        angle = np.pi - one.theta if k == 0 else one.theta
        assert np.array_equal(one.collisions[stable], found.collisions[stable])
        assert np.all(np.abs(angle - found.theta)[stable] <= allowed[stable])
    np.testing.assert_allclose(one.x[stable] - found.x[stable], 3 * wall.period, rtol=1e-12)
    if wall.closes and wall.vertices[0, 1] == 0.0:
        # Lemma 2.1: a ray leaves the hollow that it enters
        assert np.array_equal(np.floor(found.x[stable] / wall.period), np.zeros(stable.sum()))


def test_the_trajectory_ends_where_the_trace_does(wall):
    for x, theta in ((0.37, 1.9), (0.81, 0.4), (2.6, 2.8), (-0.31, 0.25)):
        path, traced = geo.trajectory(wall, x * wall.period, theta), geo.trace(wall, x * wall.period, theta)
        np.testing.assert_allclose(path[0], [x * wall.period, 0.0], atol=1e-15 * wall.period)
        np.testing.assert_allclose(path[-1], [traced.x, 0.0], rtol=1e-9, atol=1e-9 * wall.period)
        assert len(path) == int(traced.collisions) + 2


@pytest.mark.parametrize("make", [spread_rays, aimed_rays, grazing_rays])
def test_no_ray_is_lost_and_none_is_wrong_but_for_conditioning(wall, make):
    """Against the tracer in double-doubles, which flags the rays whose last half ulp decides; it against 50 digits."""
    if wall.islands and make is not spread_rays:
        pytest.skip("a grazing ray passes a million cells of an open wall")
    count = 200 if len(wall.pieces) < MANY_PIECES else 40
    cell = wall.cell
    found = list(judge(AimedRays("rays", cell, *make(cell, count, np.random.default_rng(5)))))
    assert [one.fault for one in found if one.verdict == "fails"] == []
    assert sum(one.number for one in found if one.kind == "rays") == count


def test_the_tracer_agrees_with_a_plain_one(wall, request):
    """The plain tracer's formulas are others, and it knows neither tables nor runs: it takes hit by hit."""
    if request.node.callspec.params["wall"] in ("flattest arcs", "plate in the opening"):
        pytest.skip("the plain tracer loses the digits of the radius, and knows no plate in the opening")
    cell = wall.cell.scaled(1.0 / wall.period)
    x, theta = spread_rays(cell, 4 if cell.islands or len(cell.pieces) > 100 else 30, np.random.default_rng(1))
    found = geo.trace(cell, x, theta, max_collisions=MOST_HITS)
    stable, allowed = conditioned(cell, x, theta, found)
    stable &= (found.collisions < 30) & ((np.sin(theta) > 0.3) | cell.closes)
    for i in np.flatnonzero(stable):
        there, angle, hits = trace_plainly(cell, x[i], theta[i])
        assert hits == found.collisions[i]
        # it drifts off its curves by rounding
        assert abs(angle - found.theta[i]) <= 8 * allowed[i]
        assert abs(there - found.x[i]) * np.sin(angle) <= 8 * allowed[i] * (cell.period + cell.depth)


def hit_by_hit(wall):
    """The same wall without its closed forms, and with the marks that allow runs taken off its tables."""
    plain = geo.Wall(wall.pieces, wall.period, wall.islands)
    hollows, lines, arcs = (getattr(plain.scene, name).copy() for name in ("hollows", "lines", "arcs"))
    arcs[:, RUN_SINE], lines[:, [FIRST_PAIR, PAIRS_END]], hollows[:, FORM] = 0.0, 0.0, NO_FORM
    curves = tuple(arcs if table is plain.scene.arcs else table for table in plain.scene.curves)
    plain.__dict__["scene"] = plain.scene._replace(hollows=hollows, lines=lines, curves=curves)
    return plain


def test_closed_forms_and_runs_of_hits_in_one_step_change_nothing_but_the_time(closed_wall):
    scene = closed_wall.scene
    if not (np.any(scene.hollows[:, FORM] != NO_FORM) or len(scene.pairs) or len(scene.arcs)):
        pytest.skip("it is traced hit by hit")
    rng = np.random.default_rng(3)
    count = FEW if len(closed_wall.pieces) < MANY_PIECES else 100
    x, theta = np.concatenate([make(closed_wall, count, rng) for make in (spread_rays, aimed_rays)], axis=1)
    most = 4 * MOST_HITS
    fast, slow = (geo.trace(one, x, theta, max_collisions=most) for one in (closed_wall, hit_by_hit(closed_wall)))
    stable, allowed = conditioned(closed_wall, x, theta, slow, most)
    miss = np.abs(fast.theta - slow.theta) + np.abs(fast.x - slow.x) / closed_wall.period
    assert np.array_equal(fast.status[stable], slow.status[stable])
    assert np.array_equal(fast.collisions[stable], slow.collisions[stable])
    assert np.all(miss[stable] <= allowed[stable])
