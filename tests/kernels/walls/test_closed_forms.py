"""Closed-form laws against rays followed segment by segment, high precision, and published and derived numbers."""

import math

import mpmath
import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_plainly

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.laws.law import BranchLaw

EPS = float(np.finfo(np.float64).eps)


# ---- rays one reflection at a time -------------------------------------------------------------------------------
WALLS = [
    *(
        (ker.TriangularTeethLaw(angle), geo.triangular_teeth(angle))
        for angle in (0.2, 0.7, math.pi / 3, math.pi / 2, 1.9, 2.7)
    ),
    *((ker.RectangularTeethLaw(ratio), geo.rectangular_teeth(ratio)) for ratio in (0.1, 1.0, 3.7)),
    *((ker.CircularArcLaw(xi), geo.focusing_arcs(xi)) for xi in (0.05, 0.4, 0.9, 1.2, math.pi / 2)),
]


@pytest.mark.parametrize(("law", "wall"), WALLS, ids=repr)
def test_closed_forms_are_what_rays_do(law: ker.Law, wall: geo.Wall) -> None:
    """Rays of the invariant measure: equal hits and, up to rounding times the hits, equal angles."""
    rng, number = np.random.default_rng(1), 100
    x, theta = rng.uniform(1e-3, 1.0 - 1e-3, number), ker.SINE.sample(number, rng)
    for place, angle, outgoing, hits in zip(x, theta, law.reflect(x, theta), law.hits(x, theta), strict=True):
        _, traced, count = trace_plainly(wall, place, angle)
        assert hits == count, (place, angle)
        # one reflection adds a rounding to the direction; near-tangent hits of an arc lose half of the digits
        assert abs(outgoing - traced) < 1e-13 * (1 + count) ** 2 + (1e-9 if count > 50 else 0.0), (place, angle)


# ---- distributions against the same rays over all entry points --------------------------------------------------
def test_shallow_incidence_on_triangles_has_the_two_outcomes_of_the_ledger() -> None:
    psi = 0.7
    theta = np.linspace(0.01, 0.5 * (math.pi - psi) - 1e-6, 300)
    most = np.ceil(2.0 * theta / psi)
    p = (np.cos(theta - psi / 2) - np.cos((most - 0.5) * psi - theta)) / (2.0 * np.sin(theta) * np.sin(psi / 2))
    probability, _ = ker.TriangularTeethLaw(psi).branches(theta)
    assert np.allclose(probability[:, 0], p, atol=1e-13)
    assert np.allclose(probability[:, :2].sum(axis=1), 1.0, atol=1e-15)


def test_equal_isometries_left_and_right_are_merged_where_the_apex_angle_divides_two_pi() -> None:
    for parts in (3, 4, 5, 6, 8):
        law = ker.TriangularTeethLaw(2.0 * math.pi / parts)
        theta = np.linspace(0.05, 3.09, 101)
        probability, outgoing = law.branches(theta)
        for row, angle in zip(probability, outgoing, strict=True):
            used = np.sort(angle[row > 0.0])
            assert np.all(np.diff(used) > 1e-12)
    assert np.count_nonzero(ker.TriangularTeethLaw(math.pi / 2).branches(1.5)[0]) < 4


# ---- extreme arguments ----------------------------------------------------------------------------------------------
EXTREME_LAWS = [
    *(ker.TriangularTeethLaw(angle) for angle in (1e-4, 1.0, math.pi - 1e-4)),
    *(ker.RectangularTeethLaw(ratio) for ratio in (1e-6, 1.0, 1e8)),
    *(ker.CircularArcLaw(xi) for xi in (1e-8, 1e-3, 1.2, math.pi / 2)),
]


@pytest.mark.parametrize("law", EXTREME_LAWS, ids=repr)
def test_closed_forms_equal_high_precision_down_to_grazing_and_next_to_the_tips(law: ker.Law) -> None:
    compared = 0
    with mpmath.workdps(60):
        for theta in (1e-12, 3e-9, 1e-5, 0.3, 1.5, 2.8, 3.14, 3.1415926, 3.141592653589):
            for x in (1e-9, 0.01, 0.3, 0.6, 0.97, 1.0 - 1e-9):
                angle, hits, slack = high_precision(law, x, theta)
                if slack < 1e-3:
                    continue
                compared += 1
                assert law.hits(x, theta) == hits, (x, theta)
                assert abs(float(law.reflect(x, theta)) - angle) <= 64 * EPS, (x, theta)
    assert compared > 30


def high_precision(law: ker.Law, x: float, theta: float) -> tuple[float, int, float]:
    """The formulas of the facts in 60 digits; slack is the distance of the count of hits to a whole number."""
    mp = mpmath.mp
    t, fraction, pi = mp.mpf(theta), mp.mpf(x), mp.pi
    if isinstance(law, ker.TriangularTeethLaw):
        psi = mp.mpf(law.angle)
        c = (1 - fraction) * mp.cos(t - psi / 2) + fraction * mp.cos(t + psi / 2)
        base, cosine = (t, c) if c > 0 else (pi - t, -c)
        count = (base + mp.acos(cosine)) / psi + mp.mpf(1) / 2
        n = int(mp.floor(count))
        out = pi + base - n * psi if n % 2 == 0 else n * psi - base
        # up to psi/2 there is exactly one hit, however close the count comes to 1
        slack = 1.0 if base <= psi / 2 else tie_distance(count)
        return float(out if c > 0 else pi - out), n, slack
    if isinstance(law, ker.CircularArcLaw):
        xi = mp.mpf(law.half_angle)
        delta = mp.acos(fraction * mp.cos(t - xi) + (1 - fraction) * mp.cos(t + xi))
        gamma = t - delta
        if delta >= pi / 2:
            step = 2 * (pi - delta)
            count, sign = (xi - gamma) / step, 1
        else:
            step = 2 * delta
            count, sign = (xi + gamma) / step, -1
        n = int(mp.ceil(count))
        return float(t + sign * (n * step - pi)), n, 1.0 if count < 0.5 else tie_distance(count)
    d = 2 * mp.mpf(law.height_to_width) * abs(mp.cot(t))
    if fraction <= 0.5:
        return float(pi - t), 1, 1.0
    ahead = 2 * fraction - 1 if t < pi / 2 else 2 - 2 * fraction
    count = d - ahead
    n = max(int(mp.ceil(count)), 0)
    # beyond 1e12 crossings, float64 does not resolve the fractional part to the 1e-3 asked for here
    return float(pi - t if n % 2 == 0 else t), n + 1, tie_distance(count) if d < 1e11 else 0.0


def tie_distance(count: mpmath.mpf) -> float:
    """Distance to a whole number; float64 resolves a tie of large counts less well."""
    return float(abs(count - mpmath.nint(count)) / max(1, abs(count) * mpmath.mpf(2) ** -40))


def test_the_law_of_a_crevice_is_that_of_every_float64_angle_however_many_its_crossings():
    rng = np.random.default_rng(11)
    for ratio in (0.3, 2.7, 1e3, 1e6, 1e8, 1e15):
        near = 10.0 ** rng.uniform(-12.0, 0.0, 12)
        theta = np.concatenate([near, np.pi - near, [1e-300, 5e-324, np.nextafter(np.pi, 0.0), 0.5 * np.pi]])
        found = ker.RectangularTeethLaw(ratio).branches(theta)[0][:, 1]
        with mpmath.workdps(800):
            turns = [mpmath.mpf(ratio) * mpmath.cos(mpmath.mpf(t)) / mpmath.sin(mpmath.mpf(t)) for t in theta.tolist()]
            expected = [float(abs(turn - mpmath.nint(turn))) for turn in turns]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13)
    assert ker.RectangularTeethLaw(1e6).branches(1e-9)[0][0] == pytest.approx(0.9373850752, abs=1e-10)


@pytest.mark.parametrize("theta", [0.3, 1e-3, math.pi - 1e-5, 1e-9])
@pytest.mark.parametrize("ratio", [0.7, 30.0, 1e6, 1e12])
def test_rays_into_a_crevice_have_the_law_and_the_parity_of_their_hits(ratio, theta):
    law, x = ker.RectangularTeethLaw(ratio), (np.arange(20_000) + 0.5) / 20_000
    outgoing = law.reflect(x, theta)
    back = np.abs(outgoing - theta) <= 1e-12 * theta
    assert np.mean(back) == pytest.approx(law.branches(theta)[0][1], abs=1e-4)
    assert np.array_equal(law.hits(x, theta) % 2 == 0, back)


# ---- laws that hold for every wall --------------------------------------------------------------------------------
@pytest.mark.parametrize("law", [*map(ker.TriangularTeethLaw, (0.7, 2.0)), ker.RectangularTeethLaw(1.3)], ids=repr)
def test_every_slot_is_one_isometry_between_kinks(law: BranchLaw) -> None:
    breakpoints, _ = law.breakpoints(400)
    edges = np.concatenate([[0.0], breakpoints, [math.pi]])
    low, width = edges[:-1, None], np.diff(edges)[:, None]
    theta = low + width * np.array([0.1, 0.3, 0.6, 0.9])
    probability, outgoing = law.branches(theta)
    used = probability > 0.0
    assert np.all(used.all(axis=1) | ~used.any(axis=1))
    slope = np.diff(outgoing, axis=1) / np.diff(theta, axis=1)[..., None]
    wide = (width > 1e-6)[:, :, None]
    assert np.all((np.abs(np.abs(slope) - 1.0) < 1e-8) | ~wide)
    assert np.all((np.ptp(np.sign(slope), axis=1) == 0.0) | ~wide[:, 0])


def test_rectangular_kinks_say_how_much_they_leave_out() -> None:
    breakpoints, left_out = ker.RectangularTeethLaw(1.0).breakpoints(101)
    assert breakpoints.size == 101
    # cot(theta) = k/2, k = 1..50: beyond lies cot(theta) > 25, of probability 1 - 25/sqrt(1 + 625)
    assert abs(left_out - (1.0 - 25.0 / math.sqrt(626.0))) < 1e-15
    assert ker.RectangularTeethLaw(1e8).breakpoints(100)[1] > 0.99


@pytest.mark.parametrize("make", [ker.CircularArcLaw, ker.TriangularTeethLaw, ker.RectangularTeethLaw])
def test_no_law_lists_more_breakpoints_than_there_is_memory_for(make) -> None:
    for law in (make(1.2), make(1.2).in_specular_frame(), 0.5 * make(1.2) + 0.5 * ker.specular()):
        assert law.breakpoints(2**20)[0].size <= 2**20
        for limit in (2**20 + 1, 2**31, 10**400):
            with pytest.raises(InputError, match="limit: expected a whole number from 0 to 1048576"):
                law.breakpoints(limit)


def test_triangular_kinks_are_cut_to_the_limit_around_normal_incidence() -> None:
    law = ker.TriangularTeethLaw(1e-3)
    everything, nothing = law.breakpoints(10**6)
    some, left_out = law.breakpoints(200)
    assert nothing == 0.0
    assert some.size <= 200
    assert np.isin(some.round(12), everything.round(12)).all()
    assert abs(left_out - (1.0 - ker.SINE.mass(some[0], some[-1]))) < 1e-15
    assert 0.0 < left_out < 1.0


# ---- published and derived numbers --------------------------------------------------------------------------------
def test_sawteeth_keep_the_harmonics_of_their_base_angle() -> None:
    for parts in (3, 4, 5):
        law = ker.TriangularTeethLaw(math.pi - 2.0 * math.pi / parts)
        theta = np.linspace(0.05, 3.0, 60)
        for k in (1, 2, 3):
            image = law.apply(lambda angle, k=k, parts=parts: np.cos(parts * k * angle), theta)
            assert np.allclose(image, (-1) ** (parts * k) * np.cos(parts * k * theta), atol=1e-12)


def test_arc_rows_by_formula_equal_the_mean_over_entry_points() -> None:
    x = (np.arange(200_000) + 0.5) / 200_000
    for xi in (1e-3, 0.5, 1.2, math.pi / 2):
        law = ker.CircularArcLaw(xi)
        for theta in (1e-5, 0.3 * xi, 0.999 * xi, xi, 1.3 * xi, 1.5, math.pi - 0.4 * xi):
            mean = float(np.mean(np.cos(2.0 * law.reflect(x, theta))))
            assert abs(mean - law.apply(lambda angle: np.cos(2.0 * angle), theta)) < 1e-5
