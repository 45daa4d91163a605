"""Curves: points, tangents, lengths, boxes and images against closed forms and mpmath."""

import copy
import math
import pickle

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity.errors import InputError

EPS = np.finfo(float).eps
pi = math.pi

numbers = st.floats(-3.0, 3.0)
sizes = st.floats(0.1, 3.0)


@st.composite
def segments(draw):
    start, end = draw(st.tuples(numbers, numbers)), draw(st.tuples(numbers, numbers))
    return geo.Segment(start, end if math.dist(start, end) > 1e-3 else (start[0] + 1.0, start[1]))


@st.composite
def arcs(draw):
    first = draw(st.floats(-6.0, 6.0))
    span = draw(st.floats(0.01, 2 * pi)) * draw(st.sampled_from([-1, 1]))
    axes = draw(st.one_of(sizes, st.tuples(sizes, sizes)))
    return geo.Arc(draw(st.tuples(numbers, numbers)), axes, first, first + span * (1 - 1e-12))


@st.composite
def beziers(draw):
    points = draw(st.lists(st.tuples(numbers, numbers), min_size=3, max_size=4))
    points[-1] = (points[0][0] + draw(st.floats(0.5, 2.0)), points[-1][1])
    return geo.Bezier(points)


curves = st.one_of(segments(), arcs(), beziers())


@given(curves)
def test_ends_are_exact_to_the_bit(curve):
    assert tuple(curve.point(0.0)) == curve.start
    assert tuple(curve.point(1.0)) == curve.end
    assert curve.point([[0.0, 0.5, 1.0]]).shape == (1, 3, 2)
    assert curve.tangent([[0.0, 0.5, 1.0]]).shape == (1, 3, 2)


@given(curves, st.floats(0.05, 0.95))
def test_tangents_are_unit_vectors_along_the_secant(curve, s):
    step = 1e-6
    secant = curve.point(s + step) - curve.point(s - step)
    tangent = curve.tangent(s)
    assert np.hypot(*tangent) == pytest.approx(1.0, abs=4 * EPS)
    if np.hypot(*secant) > 1e-7:  # not near a cusp of a Bezier curve, where the secant turns
        chord = curve.point(s + 100 * step) - curve.point(s - 100 * step)
        if np.hypot(*(chord / np.hypot(*chord) - secant / np.hypot(*secant))) < 1e-4:
            assert tangent == pytest.approx(secant / np.hypot(*secant), abs=1e-3)


@settings(deadline=None)
@given(curves)
def test_length_is_the_limit_of_polylines(curve):
    points = curve.point(np.linspace(0.0, 1.0, 20001))
    polyline = np.sum(np.hypot(*np.diff(points, axis=0).T))
    # a polyline of n steps is short by a relative O(1/n^2) of the squared turning; cusps cost O(1/n)
    assert curve.length == pytest.approx(polyline, rel=1e-5, abs=1e-6)
    assert curve.length >= polyline * (1 - 1e-11)


@given(curves)
def test_box_is_the_smallest_that_holds_the_curve(curve):
    points = curve.point(np.linspace(0.0, 1.0, 4001))
    xmin, ymin, xmax, ymax = curve.box
    low, high = points.min(axis=0), points.max(axis=0)
    assert xmin <= low[0] + 1e-13 and ymin <= low[1] + 1e-13
    assert xmax >= high[0] - 1e-13 and ymax >= high[1] - 1e-13
    assert np.allclose([xmin, ymin, xmax, ymax], [*low, *high], rtol=0, atol=1e-4)


@given(curves)
def test_reversing_twice_gives_the_same_curve(curve):
    assert curve.reversed().reversed() == curve
    assert curve.reversed().start == curve.end
    s = np.linspace(0.0, 1.0, 7)
    assert np.allclose(curve.reversed().point(s), curve.point(1 - s), rtol=0, atol=1e-13)


@given(curves, st.sampled_from([(2.0, 3.0), (-1.0, 1.0), (0.5, -4.0), (-2.0, -1.5)]))
def test_images_under_stretches_are_pointwise(curve, factors):
    s = np.linspace(0.0, 1.0, 9)
    image = curve.stretched(*factors)
    assert type(image) is type(curve)
    assert np.allclose(image.point(s), curve.point(s) * factors, rtol=0, atol=1e-12)
    assert np.allclose(curve.moved(1.5, -2.5).point(s), curve.point(s) + np.array([1.5, -2.5]), rtol=0, atol=1e-13)


@given(curves, st.floats(0.1, 0.9))
def test_the_parts_of_a_split_curve_lie_on_it(curve, s):
    before, after = curve.split(s)
    assert before.end == after.start and before.start == curve.start and after.end == curve.end
    t = np.linspace(0.0, 1.0, 9)
    assert np.allclose(before.point(t), curve.point(s * t), rtol=0, atol=1e-12)
    assert np.allclose(after.point(t), curve.point(s + (1 - s) * t), rtol=0, atol=1e-12)


@pytest.mark.parametrize("s", [np.zeros((2, 2)), 10**400, 1.5])
def test_a_curve_is_split_at_one_place_on_it(s):
    # an array of two rows went on for ever
    with pytest.raises(InputError, match=r"^s: expected"):
        geo.Bezier([(0, 0), (0.5, -1), (1, 0)]).split(s)


@given(curves, st.sampled_from([1e-1, 1e-2, 1e-3]))
def test_flattening_keeps_its_tolerance(curve, tolerance):
    points = curve.flattened(tolerance)
    s = np.linspace(0.0, 1.0, len(points))
    middle = curve.point(0.5 * (s[1:] + s[:-1]))
    chord = np.diff(points, axis=0)
    length = np.hypot(*chord.T)
    offset = middle - points[:-1]
    ok = length > 1e-12
    distance = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])[ok] / length[ok]
    assert np.all(distance <= tolerance * (1 + 1e-9))
    assert tuple(points[0]) == curve.start and tuple(points[-1]) == curve.end


@pytest.mark.parametrize("axes", [(1.0, 1.0), (2.0, 1.0), (1.0, 2.0), (1.0, 1e-3), (1e-3, 1.0), (1.0, 1.0 + 1e-9)])
@pytest.mark.parametrize("angles", [(0.0, pi / 2), (-pi, 0.0), (0.3, 5.9), (2.0, 1.3), (1.0, 1.0 + 2 * pi), (1.5, 1.6)])
def test_arc_length_equals_the_elliptic_integral(axes, angles):
    mpmath.mp.dps = 40
    a, b = (mpmath.mpf(v) for v in axes)
    low, high = sorted(mpmath.mpf(t) for t in angles)
    exact = b * (mpmath.ellipe(high, 1 - a**2 / b**2) - mpmath.ellipe(low, 1 - a**2 / b**2))
    arc = geo.Arc((0.3, -0.2), axes, *angles)
    assert arc.length == pytest.approx(float(exact), rel=1e-13)


@pytest.mark.parametrize("half_angle", [1e-8, 1e-5, 1e-2, 0.4, 1.0, pi / 2])
def test_a_pinned_arc_keeps_its_digits_however_flat_it_is(half_angle):
    mpmath.mp.dps = 60
    xi = mpmath.mpf(half_angle)
    radius = 1 / (2 * mpmath.sin(xi))
    arc = geo.focusing_arcs(half_angle).pieces[0]
    assert arc.half_span == pytest.approx(half_angle, rel=4 * EPS)
    for s in (0.0, 0.1, 0.5, 0.77, 1.0):
        phi = (2 * mpmath.mpf(s) - 1) * xi
        x, y = mpmath.mpf("0.5") + radius * mpmath.sin(phi), radius * (mpmath.cos(xi) - mpmath.cos(phi))
        depth = float(mpmath.tan(xi / 2) / 2)
        assert abs(arc.point(s)[0] - float(x)) < 8 * EPS
        assert abs(arc.point(s)[1] - float(y)) < 16 * EPS * depth
        # the slope of the tangent is tan(phi)
        assert arc.tangent(s)[1] == pytest.approx(float(mpmath.sin(phi)), rel=16 * EPS, abs=16 * EPS * half_angle)


def test_length_of_a_quadratic_bezier_curve_equals_mpmath():
    mpmath.mp.dps = 30
    rng = np.random.default_rng(4)
    for _ in range(20):
        p = rng.uniform(-1, 1, (3, 2))
        q = [[mpmath.mpf(float(v)) for v in row] for row in p]

        def speed(t, q=q):
            d = [2 * ((1 - t) * (q[1][k] - q[0][k]) + t * (q[2][k] - q[1][k])) for k in (0, 1)]
            return mpmath.sqrt(d[0] ** 2 + d[1] ** 2)

        exact = mpmath.quad(speed, [0, 0.25, 0.5, 0.75, 1])
        assert geo.Bezier(p).length == pytest.approx(float(exact), rel=1e-12)


def test_length_of_special_bezier_curves():
    assert geo.Bezier([(0, 0), (1, 0), (2, 0)]).length == 2.0
    assert geo.Bezier([(0, 0), (2, 0), (0, 0)]).length == pytest.approx(2.0, rel=1e-15)  # there and back
    # the parabola y = -x^2, 0 <= x <= 1
    exact = (2 * math.sqrt(5) + math.asinh(2)) / 4
    assert geo.Bezier([(0, 0), (0.5, 0), (1, -1)]).length == pytest.approx(exact, rel=1e-15)
    # the semicubical parabola (t^2, t^3) from its cusp: a cubic
    cusp = geo.Bezier([(0, 0), (0, 0), (1 / 3, 0), (1, 1)])
    assert cusp.length == pytest.approx((13**1.5 - 8) / 27, rel=1e-12)
    assert cusp.tangent(0.0) == pytest.approx([1.0, 0.0], abs=1e-5)


def test_an_ellipse_with_equal_axes_becomes_circular_exactly():
    circle = geo.Arc((0, 0), 0.7, 0.0, 1.0)
    for factor in np.random.default_rng(1).uniform(1e-3, 1.0, 200):
        there_and_back = circle.stretched(1.0, factor).stretched(1.0, 1.0 / factor)
        assert there_and_back.is_circular
        assert there_and_back.semi_axes == (0.7, 0.7)
    assert not circle.stretched(1.0, 0.999).is_circular


def test_semi_axes_may_be_one_number_or_two():
    assert geo.Arc((0, 0), 2, 0, 1) == geo.Arc((0, 0), (2, 2), 0, 1)
    arc = geo.Arc(center=(1, 2), semi_axes=(3, 4), start=0.5, end=-0.5)
    assert (arc.start_angle, arc.end_angle, arc.direction) == (0.5, -0.5, -1)


def test_box_of_a_whole_ellipse_is_exact():
    assert geo.Arc((0.5, -0.5), (0.25, 0.5), 0.3, 0.3 + 2 * pi).box == (0.25, -1.0, 0.75, 0.0)


@given(curves)
def test_curves_are_values(curve):
    assert copy.deepcopy(curve) == curve == pickle.loads(pickle.dumps(curve))
    assert hash(copy.deepcopy(curve)) == hash(curve)
    with pytest.raises(AttributeError):
        curve.start = (0.0, 0.0)


def test_repr_of_curves_can_be_evaluated():
    for curve in (geo.Segment((0, 0), (1, 2)), geo.Arc((0, 1), (1, 2), 0.1, 0.2), geo.Arc((0, 1), 3, 0.1, 0.2)):
        assert eval(repr(curve), vars(geo)) == curve
    bezier = geo.Bezier([(0, 0), (1, 1), (2, 0)])
    assert eval(repr(bezier), vars(geo)) == bezier
