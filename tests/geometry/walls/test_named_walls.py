"""Named walls: their shapes from closed forms, also at the extremes."""

import math

import mpmath
import numpy as np
import pytest

from asperity import geometry as geo
from asperity.geometry.cells.cell import Hollow

EPS = np.finfo(float).eps
pi = math.pi


@pytest.mark.parametrize("name", geo.WALLS)
def test_named_walls_have_period_one_and_touch_the_opening_at_both_ends(name):
    wall = geo.WALLS[name].build()
    assert wall.period == 1.0 and wall.closes
    assert wall.vertices[0].tolist() == [0.0, 0.0] and wall.vertices[-1].tolist() == [1.0, 0.0]
    assert geo.Wall(wall.pieces) == wall
    assert wall.is_mirror_symmetric
    assert geo.WALLS[name].summary and geo.WALLS[name].name == name
    # a function without arguments returns the wall of the command line
    assert wall == getattr(geo, name.replace("-", "_"))() == geo.wall_from_text(name)
    written = ",".join(f"{key}={value!r}" for key, value in geo.WALLS[name].defaults.items())
    assert geo.wall_from_text(f"{name}:{written}") == wall


@pytest.mark.parametrize("angle", [1e-4, 0.7, pi / 2, 2.5, pi - 1e-4])
def test_triangular_teeth_have_their_apex_angle(angle):
    wall = geo.triangular_teeth(angle)
    rise, fall = wall.pieces[1].tangent(0.0), -wall.pieces[0].tangent(0.0)
    # the angle at the notch between the two sides, from its half: the sides are mirror images
    half = math.atan2(abs(rise[0]), rise[1])
    assert 2 * half == pytest.approx(angle, rel=4 * EPS)
    assert fall.tolist() == [-rise[0], rise[1]]
    assert wall.depth == pytest.approx(float(mpmath.cot(mpmath.mpf(angle) / 2) / 2), rel=4 * EPS / (pi - angle))


@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e8])
def test_rectangular_teeth_are_half_flat(ratio):
    wall = geo.rectangular_teeth(ratio)
    assert wall.hollows == (Hollow(0.5, 1.0, 1, 4),)
    assert wall.flat_top == 0.5 and wall.depth == ratio / 2
    assert wall.arc_length == pytest.approx(1.0 + ratio, rel=2 * EPS)


@pytest.mark.parametrize("xi", [1e-8, 1e-3, 0.5, 1.2, pi / 2])
def test_focusing_arcs_subtend_their_angle(xi):
    wall = geo.focusing_arcs(xi)
    arc = wall.pieces[0]
    assert arc.is_circular and arc.direction == 1
    assert arc.semi_axes[0] == pytest.approx(0.5 / math.sin(xi), rel=2 * EPS)
    assert wall.depth == pytest.approx(0.5 * math.tan(xi / 2), rel=8 * EPS)
    assert wall.arc_length == pytest.approx(xi / math.sin(xi), rel=4 * EPS)
    assert wall.hollows == (Hollow(0.0, 1.0, 0, 1),)


@pytest.mark.parametrize("curvature", [1e-8, 1e-4, 1 / 3, 1.0, 2.0])
def test_dispersing_arcs_are_bumps_with_tops_at_the_integers(curvature):
    mpmath.mp.dps = 50
    k = mpmath.mpf(curvature)
    depth = 1 / k - mpmath.sqrt(1 / k**2 - mpmath.mpf("0.25"))
    wall = geo.dispersing_arcs(curvature)
    assert wall.depth == pytest.approx(float(depth), rel=8 * EPS)
    assert [p.semi_axes[0] for p in wall.pieces] == [1 / curvature, 1 / curvature]
    assert [p.direction for p in wall.pieces] == [-1, -1]  # the free side is outside the circle
    top = wall.pieces[0].tangent(0.0)
    assert top == pytest.approx([1.0, 0.0], abs=4 * EPS)
    slope = wall.pieces[0].tangent(1.0)
    assert -slope[1] == pytest.approx(curvature / 2, rel=1e-7 if curvature > 1.9 else 8 * EPS)


@pytest.mark.parametrize("ratio", [1e-12, 0.5, 2.0, 1e6, 1e12])
@pytest.mark.parametrize("xi", [1e-8, 0.9, pi / 2])
def test_elliptical_arcs_foreshorten_to_circular_arcs(ratio, xi):
    disk = geo.Disk(1.0, 1.0 / ratio)
    felt = geo.elliptical_arcs(xi, disk).foreshorten(disk)
    circular = geo.focusing_arcs(xi)
    arc, exact = felt.pieces[0], circular.pieces[0]
    assert arc.is_circular
    assert arc.semi_axes == exact.semi_axes
    assert (arc.start, arc.end) == (exact.start, exact.end)
    assert arc.center[0] == exact.center[0] and arc.center[1] == pytest.approx(exact.center[1], rel=2 * EPS)
    assert felt.arc_length == circular.arc_length


@pytest.mark.parametrize("xi", [0.3, 1.2])
def test_elliptical_arcs_are_the_corrected_tooth_function(xi):
    disk = geo.Disk(1.3, 0.4 / 1.3)
    wall = geo.elliptical_arcs(xi, disk)
    x, y = wall.pieces[0].point(np.linspace(0.01, 0.99, 40)).T
    kappa = (1 + 1.3 / 0.4) ** -0.5
    below = 0.5 / math.tan(xi) - np.sqrt(0.25 / math.sin(xi) ** 2 - (x - 0.5) ** 2)
    assert np.allclose(y, kappa * below, rtol=0, atol=8 * EPS)


def test_the_double_parabola_is_the_published_one():
    wall = geo.double_parabola()
    s = np.linspace(0.0, 1.0, 33)
    x, y = wall.pieces[0].point(s).T
    assert np.allclose(x, y**2 / 4, rtol=0, atol=2 * EPS)
    x, y = wall.pieces[1].point(s).T
    assert np.allclose(x, 1 - y**2 / 4, rtol=0, atol=2 * EPS)
    assert wall.depth == math.sqrt(2.0) and wall.vertices[1, 0] == 0.5
    # 2 int_0^sqrt(2) (1 + y^2/4)^(1/2) dy
    assert wall.arc_length == pytest.approx(2 * (math.sqrt(0.75) + math.asinh(math.sqrt(0.5))), rel=4 * EPS)


@pytest.mark.parametrize("s", [1e-8, 0.1, 0.5, 0.999])
@pytest.mark.parametrize("a", [0.0, 1e-8, 0.5, 3.0])
def test_mushrooms_have_stem_and_cap(s, a):
    wall = geo.mushrooms(s, a)
    (hollow,) = wall.hollows
    assert hollow.width == pytest.approx(s, rel=4 * EPS, abs=2 * EPS)
    assert hollow.left + hollow.right == 1.0
    assert wall.is_mirror_symmetric
    stem = a * s if a * s > 1e-12 else 0.0
    assert wall.depth == pytest.approx(stem + 0.5, rel=4 * EPS)
    below = sum(p.length for p in wall.pieces[hollow.first : hollow.last])
    assert below == pytest.approx(pi / 2 + (1 - s) + 2 * stem, rel=4 * EPS)


@pytest.mark.parametrize(("s", "a"), [(0.2, 0.5), (0.3, 1.0), (0.5, 0.2), (0.6, 2.0)])
@pytest.mark.parametrize("generations", [1, 2, 3])
def test_generations_of_mushrooms_open_more_of_the_wall(s, a, generations):
    wall = geo.mushrooms(s, a, generations)
    assert 1.0 - wall.flat_top == pytest.approx(1 - (1 - s) ** generations, rel=1e-14)
    assert sum(h.width for h in wall.hollows) == pytest.approx(1 - (1 - s) ** generations, rel=1e-14)
    assert wall.depth == pytest.approx(a * s + 0.5, rel=1e-15)
    assert wall.is_mirror_symmetric


@pytest.mark.parametrize(("s", "a"), [(0.2, 0.5), (0.3, 1.0), (0.5, 0.2)])
def test_the_second_generation_is_the_largest_that_fits(s, a):
    wall = geo.mushrooms(s, a, 2)
    # every hollow is a mushroom whose cap is its width over s
    caps = sorted({round(h.width / s, 12) for h in wall.hollows})
    small, whole = caps
    assert whole == 1.0
    cells = (1 - s) / 2 / small
    assert cells == pytest.approx(round(cells), abs=1e-9)
    assert small * (a * s + 0.5) < a * s
    larger = (1 - s) / 2 / (round(cells) - 1) if round(cells) > 1 else math.inf
    assert larger * (a * s + 0.5) >= a * s


@pytest.mark.parametrize("generations", range(7))
def test_koch_walls_are_koch_curves(generations):
    wall = geo.koch(generations)
    x, y = wall.vertices.T
    assert len(wall.pieces) == 4**generations
    lengths = np.hypot(np.diff(x), np.diff(y))
    assert lengths == pytest.approx(3.0**-generations, rel=1e-11)
    # mirror symmetric to the bit
    assert np.array_equal(1.0 - x[::-1], x) and np.array_equal(y[::-1], y)
    assert wall.depth == pytest.approx(math.sqrt(3) / 6 if generations else 0.0, rel=2 * EPS)
    assert wall.flat_top == pytest.approx((2 / 3) ** max(generations, 1) if generations else 1.0, rel=1e-13)
    assert len(wall.hollows) == max(2**generations - 1, 0)
    # self-similar: the first quarter is a third of the generation before
    if generations:
        before = geo.koch(generations - 1).vertices
        assert np.allclose(wall.vertices[: len(before)], before / 3, rtol=0, atol=4 * EPS)


def test_a_koch_wall_of_65536_pieces_is_validated():
    wall = geo.koch(8)
    assert len(wall.pieces) == 65536
    assert wall.arc_length == pytest.approx((4 / 3) ** 8, rel=1e-11)
