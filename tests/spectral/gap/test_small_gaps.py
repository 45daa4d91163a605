"""Gaps of nearly specular walls: digits that no cancellation takes away, essential edges that are 0, verdicts."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.textbook_tracer import follow, table_of
from scipy.linalg import eigh

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.bounds.oscillations import FREQUENCIES, PARTS, RAYS, least_quotient
from asperity.spectral.essential.edge import essential_edge, grazing_symbol
from asperity.spectral.essential.grazing import grazed, grazing_limit
from asperity.spectral.gap.gap import held_against_oscillations
from asperity.spectral.gap.shallow import shallow_gap
from asperity.spectral.gap.verdict import SpectralGap, isolated


def parabola(depth):
    return geo.Wall([geo.Bezier([(0, 0), (0.5, -depth), (1, 0)])])


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1e-4, 1e-3])
def test_uniform_sines_of_the_slope_have_the_gap_of_the_series(size):
    """4 E sin^2 + 2 E sin^4 with sin(slope) uniform, in 50 digits; the rest of the series is of order s^4 ln s."""
    with mp.workdps(50):
        sine = {"arcs": mp.sin(mp.mpf(size)), "bumps": mp.mpf(size) / 2}
        exact = {name: float(4 * s**2 / 3 + 2 * s**4 / 5) for name, s in sine.items()}
    laws = {"arcs": ker.CircularArcLaw(size), "bumps": ker.WallLaw(geo.dispersing_arcs(size))}
    for name, law in laws.items():
        gap = spec.spectral_gap(law.in_specular_frame())
        assert gap.verdict == "isolated" and gap.value - gap.error > 0.0
        assert abs(gap.value - exact[name]) <= gap.error <= 1e-6 * gap.value


@pytest.mark.parametrize("exponent", [1, 2, 3, 10**6])
@pytest.mark.parametrize("turn", [False, True], ids=["paper", "specular"])
def test_gaps_of_powers_keep_their_digits(exponent, turn):
    """In the paper's convention odd functions have eigenvalues near -1, whose even powers come nearest to 1."""
    law = ker.CircularArcLaw(1e-6)
    law = law.in_specular_frame() if turn else law
    with mp.workdps(50):
        sine = mp.sin(mp.mpf(1e-6))
        factor = 1 if turn or exponent % 2 == 0 else 3
        exact = float(1 - (1 - factor * (4 * sine**2 / 3)) ** exponent)
    found = [spec.spectral_gap(law**exponent)] + ([spec.spectrum(law**exponent, 2)] if exponent == 2 else [])
    for gap in found:
        value, error = (gap.value, gap.error) if isinstance(gap, SpectralGap) else (gap.gap, gap.gap_error)
        assert gap.verdict == "isolated" and value > error and abs(value - exact) <= error + 1e-11 * exact
        assert error <= 1e-11 * exact


def test_times_of_small_gaps_keep_their_digits():
    found = spec.mixing_time(ker.CircularArcLaw(1e-7), 0.01)
    assert abs(found.relaxation_time.value - 0.75e14) <= found.relaxation_time.error + 1.0 < 0.75e3
    assert found.slem.error >= 1e-16 and abs(found.steps / (0.75e14 * np.log(50.0)) - 1.0) < 1e-9


@pytest.mark.parametrize("law", [ker.CircularArcLaw(1e-2), ker.WallLaw(geo.dispersing_arcs(2e-2))], ids=str)
def test_the_form_agrees_with_enclosures_where_both_have_digits(law):
    turned = law.in_specular_frame()
    form, enclosed = spec.spectral_gap(turned, tolerance=1e-5), spec.enclosures(turned, 2, tolerance=1e-10)[1]
    assert "1 - lambda" in form.method and form.error < 0.01 * form.value
    assert abs(form.value - (1.0 - enclosed.value)) <= form.error + enclosed.width


@pytest.mark.parametrize(
    "law",
    [
        *(ker.WallLaw(geo.dispersing_arcs(k)) for k in (1e-9, 1e-6, 3e-6, 1e-5, 0.1, 2.0)),
        *(ker.CircularArcLaw(xi) for xi in (1e-8, 1e-7, 0.5, 1.57)),
        ker.WallLaw(parabola(1e-7)),
        ker.WallLaw(geo.triangular_teeth(3.1)),
    ],
    ids=str,
)
def test_sides_that_are_neither_vertical_nor_overhanging_let_nothing_graze(law):
    limit = grazing_limit(law)
    assert limit.root == limit.error == 0.0 and limit.resolved


def test_the_edge_of_a_shallow_wall_is_its_fraction_of_flat_tops():
    for fraction in (0.0, 0.25, 0.999):
        top = [geo.Segment((0, 0), (fraction, 0))] if fraction else []
        depth = 1e-6 * (1.0 - fraction)
        wall = geo.Wall([*top, geo.Bezier([(fraction, 0), (0.5 * (1 + fraction), -depth), (1, 0)])])
        edge = essential_edge(ker.WallLaw(wall))
        assert abs(edge.low - fraction) <= 1e-15 and abs(edge.high - fraction) <= 1e-15
        limit = grazing_symbol(ker.WallLaw(wall))
        assert (
            np.allclose(limit.matrix, [[0.0, fraction], [fraction, 0.0]], rtol=0.0, atol=1e-15) and limit.error == 0.0
        )


def test_a_traced_side_that_grazing_rays_leave_steeply_has_the_limit_that_its_shape_tells():
    """E[sin(theta)/sin(theta')] of traced rays falls like theta at a corner, like its root at a smooth top."""
    for wall, exponent in ((geo.focusing_arcs(0.7), 1.0), (geo.dispersing_arcs(0.7), 0.5)):
        x, means = (np.arange(4000) + 0.5) / 4000, []
        for theta in (1e-3, 1e-5, 1e-7):
            traced = geo.trace(wall, x, np.full(x.size, theta))
            means.append(float((np.sin(theta) / np.sin(traced.theta))[traced.escaped].mean()))
        slopes = -np.diff(np.log10(means)) / 2.0
        assert np.all(np.abs(slopes - exponent) < 0.15), (wall, slopes)


def test_a_vertical_side_of_a_shallow_hollow_is_looked_at_from_its_own_scale():
    """Half ellipses of depth d turn from the vertical within d^2: rays at 1e-3 would not graze them."""
    walls = {depth: geo.Wall([geo.Arc((0.5, 0), (0.5, depth), np.pi, 2 * np.pi)]) for depth in (0.4, 0.1, 0.02)}
    assert all(0.01 * depth**2 < grazed(wall).scale < depth**2 for depth, wall in walls.items())
    limits = [grazing_symbol(ker.WallLaw(wall)) for wall in walls.values()]
    roots = [limit.root for limit in limits]
    assert all(limit.error < 1e-3 for limit in limits) and 1.0 > roots[0] > roots[1] > roots[2] > 0.0


def open_wall(lowered, *island):
    """An island over a floor; the wall does not close."""
    path = [piece.moved(0.0, -lowered) for piece in island]
    return geo.Wall([geo.Segment((0.0, -0.5 - lowered), (1.0, -0.5 - lowered))], islands=[path])


BALL = (geo.Arc((0.4, -0.2), 0.2, 0.0, -2.0 * np.pi),)
SLANTED = tuple(geo.Segment(*ends) for ends in pairwise([(0.3, -0.3), (0.3, 0.0), (0.7, -0.1), (0.3, -0.3)]))
POST = tuple(geo.Segment(*ends) for ends in pairwise([(0.4, -0.2), (0.4, 0.0), (0.6, 0.0), (0.6, -0.2), (0.4, -0.2)]))


@pytest.mark.parametrize("island", [BALL, SLANTED], ids=["ball", "slanted"])
def test_the_depth_of_a_wall_with_islands_does_not_change_its_grazing_limit(island):
    limits = [grazing_limit(ker.WallLaw(open_wall(lowered, *island))) for lowered in (0.0, 0.1, 3.0)]
    for limit in limits[1:]:
        assert limit.resolved and limit.error < 1e-3
        assert np.all(np.abs(limit.matrix - limits[0].matrix) <= limit.entry_error + limits[0].entry_error)
    # plain rays from y = 0, which pass some thousand cells
    x = (np.arange(2000) + 0.5) / 2000
    traced = geo.trace(open_wall(0.1, *island), x, np.full(x.size, 1e-4))
    ratio = np.sin(1e-4) / np.sin(traced.theta)
    near = traced.theta < 0.5 * np.pi
    means = np.array([ratio[near].sum(), ratio[~near].sum()]) / x.size
    assert traced.escaped.all() and np.all(np.abs(means - limits[1].matrix[0]) < 0.02)


def test_grazing_rays_that_do_not_come_out_of_a_wall_with_islands_leave_its_limit_unknown():
    """Between upright posts the rays have 1/theta reflections: retroreflecting the lost ones would give a limit."""
    assert not grazing_limit(ker.WallLaw(open_wall(0.0, *POST))).resolved


class Losing(ker.InvolutionLaw):
    """Specular reflection, with a fraction of 1/4 of the rays that do not escape and count as retroreflected."""

    is_driven = True

    def random_map(self):
        return lambda x, theta: (np.where(x < 0.25, theta, np.pi - theta), x >= 0.25)


def test_grazing_rays_that_do_not_escape_count_as_error():
    limit = grazing_limit(Losing(lambda theta: np.pi - theta))
    assert 0.25 <= limit.error < 0.3


def test_the_edge_of_an_isometric_law_needs_no_grazing_rays(monkeypatch):
    from asperity.spectral.essential import edge

    monkeypatch.setattr(edge, "grazing_limit", lambda law: pytest.fail("grazing rays were traced"))
    law = ker.WallLaw(open_wall(0.0, *POST))
    for mixed in (law, 0.5 * law + 0.5 * ker.specular(), (law @ ker.TriangularTeethLaw(0.7)).in_specular_frame()):
        found = essential_edge(mixed)
        assert found.low == found.high == 1.0 and found.kind == "bound" and found.reasons


@pytest.mark.parametrize("period", [1.0, 1.25])
def test_rays_square_to_a_steep_side_are_in_the_essential_spectrum(period):
    """From atan(d/D) - u all rays into the hollow leave at atan(d/D) + u, and back: the edge is 1.

    A flat top reflects them to the mirror image, where the other side does the same.
    """
    d, depth = 0.198, 0.483
    bottom = geo.Bezier([(d, -depth), (0.5, -depth - 0.08), (1 - d, -depth)])
    sides = [geo.Segment((0, 0), (d, -depth)), bottom, geo.Segment((1 - d, -depth), (1, 0))]
    wall = geo.Wall(sides if period == 1.0 else [*sides, geo.Segment((1, 0), (period, 0))], period)
    law = ker.WallLaw(wall)
    for u in (1e-3, 1e-5):
        out = law.reflect((np.arange(1000) + 0.5) / 1000 / period, np.full(1000, np.arctan(d / depth) - u))
        assert np.mean(np.abs(out - np.arctan(d / depth) - u) < 1e-9) > 1.0 - 2.0 * u
    edge = essential_edge(law)
    assert edge.low > 1.0 - 1e-6
    mixed = spec.spectral_gap(0.3 * ker.lambertian() + 0.7 * law, 1e-3)
    assert abs(mixed.value - 0.3) <= mixed.error + 1e-9 and mixed.error <= 1e-3


def test_what_cannot_be_told_is_undecided(monkeypatch):
    from asperity.spectral.essential import grazing

    monkeypatch.setattr(grazing, "_at_angle", lambda law, angle, end, parts: (np.array([2.0, 0.0]), 1e-9))
    wall = geo.Wall([geo.Arc((0.5, 0), (0.5, 0.35), np.pi, 2 * np.pi)])
    gap = spec.spectral_gap(ker.WallLaw(wall), tolerance=0.5)
    assert gap.verdict == "undecided" and gap.error >= gap.value - 1e-12
    assert any("no limit that can be told" in line for line in gap.evidence)


def test_no_gap_is_negative():
    gap = SpectralGap(-4.3e-8, 7e-8, "estimate", "", "undecided", (), "specular").cut_at_zero()
    assert gap.value - gap.error >= 0.0 and gap.value + gap.error == pytest.approx(2.7e-8)
    assert "never negative" in gap.evidence[-1]
    sure = SpectralGap(1e-3, 1e-6, "estimate", "", "isolated", (), "specular")
    assert sure.cut_at_zero() is sure


def test_a_fraction_of_identity_scales_the_gap():
    arc, fraction = ker.CircularArcLaw(1.2), 1e-12
    for law, eigenvalue in (
        ((1.0 - fraction) * ker.retroreflection() + fraction * arc, 0.3670253152),
        (((1.0 - fraction) * ker.specular() + fraction * arc).in_specular_frame(), 0.311346443),
    ):
        gap = spec.spectral_gap(law, tolerance=1e-5 * fraction)
        assert gap.verdict == "isolated" and gap.error <= 1e-5 * fraction
        # weights of a sum are known to a rounding of 1
        assert abs(gap.value - fraction * (1.0 - eigenvalue)) <= gap.error + 2e-9 * fraction + 1e-16


def bent_teeth(depth, bend):
    """Triangular teeth whose sides are parabolas that leave the straight line by this much in the middle."""
    left, right = [(0, 0), (0.25, -depth / 2 - bend), (0.5, -depth)], [(0.5, -depth), (0.75, -depth / 2 - bend), (1, 0)]
    return geo.Wall([geo.Bezier(left), geo.Bezier(right)])


def test_the_better_of_two_gaps_is_reported(monkeypatch):
    from asperity.spectral.gap import gap as module

    law = ker.CircularArcLaw(1e-3).in_specular_frame()
    poor = SpectralGap(1e-6, 1e-5, "estimate", "a matrix", "undecided", (), law.frame)
    monkeypatch.setattr(module, "_by_matrices", lambda *arguments: poor)
    gap = spec.spectral_gap(law, tolerance=1e-18)
    assert gap.verdict == "isolated" and gap.error < 1e-5 * gap.value


def test_facets_that_hardly_bend_are_left_to_other_means():
    """Fast oscillations come back nearly whole: 4 h is not the gap there."""
    law, arc = ker.WallLaw(bent_teeth(0.025, 1e-6)), ker.CircularArcLaw(1e-3)
    assert shallow_gap(law.in_specular_frame(), essential_edge(law)) is None
    assert shallow_gap(arc.in_specular_frame(), essential_edge(arc)) is not None


@pytest.mark.slow
@pytest.mark.parametrize("depth, of_slow_functions", [(0.025, 0.03), (1.0, 0.2)])
def test_a_gap_of_slow_functions_is_held_against_fast_oscillations(depth, of_slow_functions):
    """The textbook tracer finds the quotient of the oscillation that the evidence names."""
    wall = bent_teeth(depth, 1e-4)
    law = ker.WallLaw(wall)
    claimed = SpectralGap(of_slow_functions, 1e-6, "estimate", "slow functions", "isolated", (), law.frame)
    found = held_against_oscillations(law, claimed)
    assert found.verdict == "undecided" and found.value - found.error == 0.0
    t = float(found.evidence[-1].split("t = ")[1].split(",")[0])
    rng, table = np.random.default_rng(3), table_of(wall)
    theta = np.arccos(rng.uniform(-1.0, 1.0, 20_000))
    rays = [(follow(table, x, angle), angle) for x, angle in zip(rng.random(theta.size), theta, strict=True)]
    pairs = np.array([(angle, out) for (out, label), angle in rays if label])
    waves = np.exp(1j * t * pairs)
    parts = np.stack([waves.real, waves.imag])
    change = parts[..., 1] - parts[..., 0]
    quotient = eigh(0.5 * change @ change.T / len(pairs), np.cov(parts[..., 0]), eigvals_only=True)[0]
    assert quotient <= 1.5 * (found.value + found.error) and found.value + found.error < 0.1 * claimed.value


def test_gaps_of_laws_go_through_the_check_by_oscillations(monkeypatch):
    from asperity.spectral.gap import gap as module

    law = ker.WallLaw(bent_teeth(1.0, 1e-4))
    claimed = SpectralGap(0.2, 1e-6, "estimate", "slow functions", "isolated", (), law.frame)
    monkeypatch.setattr(module, "_by_matrices", lambda *arguments: claimed)
    assert spec.spectral_gap(law).verdict == "undecided"


def test_facets_of_a_shallow_wall_must_bend_enough():
    """Slopes within 0.6 % of 0.01 come back in step at t = 100 pi, where 1 - |E exp(2 i t phi)| is below the gap."""
    slope, turn = 0.01, 0.012 * 0.01
    for bend, accepted in ((turn / 16, False), (20 * turn / 16, True)):
        law = ker.WallLaw(bent_teeth(slope / 2, bend)).in_specular_frame()
        assert (shallow_gap(law, essential_edge(law)) is not None) == accepted


def test_a_gap_that_may_be_zero_is_not_called_isolated():
    law = ker.henyey_greenstein(0.9)
    found = spec.spectrum(ker.discretise(law, ker.Legendre(8)), k=4)
    edge = essential_edge(law)
    assert isolated(found, 0.5 * found.gap, "", edge, "paper") is not None
    assert isolated(found, found.gap, "", edge, "paper") is None


@pytest.mark.parametrize("wall", [geo.focusing_arcs(1.2), geo.triangular_teeth(0.01)], ids=["arcs", "flat teeth"])
def test_the_least_quotient_of_oscillations_is_that_of_plain_means_over_the_rays(wall):
    law, least = ker.WallLaw(wall), 3.0
    t, quotient, spread = least_quotient(law, least)
    rng = np.random.default_rng(0)
    theta = np.arccos(1.0 - 2.0 * (np.arange(RAYS) + rng.random(RAYS)) / RAYS)
    out = law.sample(theta, rng)
    move = np.sqrt(min(np.mean((out - theta) ** 2), np.mean((np.pi - out - theta) ** 2)))
    tried = FREQUENCIES / move + max(least - FREQUENCIES[0] / move, 0.0)

    def solved(frequency):
        here, there = (np.array([np.cos(frequency * angle), np.sin(frequency * angle)]) for angle in (theta, out))
        change = there - here
        return change, *eigh(0.5 * change @ change.T / RAYS, np.cov(here, bias=True))

    lowest = np.array([solved(frequency)[1][0] for frequency in tried])
    np.testing.assert_allclose(quotient, lowest.min(), rtol=1e-10)
    np.testing.assert_allclose(t, tried[lowest.argmin()], rtol=1e-12)
    change, _, vectors = solved(t)
    batches = np.mean((0.5 * (vectors[:, 0] @ change) ** 2).reshape(-1, PARTS), axis=0)
    np.testing.assert_allclose(spread, np.std(batches, ddof=1) / np.sqrt(PARTS), rtol=1e-8)


def test_a_true_gap_stands_against_oscillations():
    law = ker.CircularArcLaw(0.3)
    gap = spec.spectral_gap(law, tolerance=1e-3)
    assert held_against_oscillations(law, gap) is gap and gap.verdict == "isolated"
