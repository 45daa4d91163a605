"""Verdicts on gaps: theorems, edges of the essential spectrum, isolated eigenvalues."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.laws.structure import lists_branches
from asperity.kernels.walls.wall_law import made_of_isometries
from asperity.spectral.bounds.images import expectations
from asperity.spectral.essential.edge import essential_edge, grazing_symbol

SEMICIRCLE = ker.CircularArcLaw(np.pi / 2)
TEETH = ker.TriangularTeethLaw(0.7)
EDGE_OF_SEMICIRCLE = 3 / 8 * np.log(9)


@pytest.mark.parametrize(
    "law",
    [
        ker.TriangularTeethLaw(np.pi / 7),
        ker.TriangularTeethLaw(1.0),  # psi/pi irrational
        TEETH @ TEETH,
        0.5 * TEETH + 0.5 * ker.RectangularTeethLaw(2.0),
        (TEETH**3).adjoint(),
        TEETH.in_specular_frame(),
        ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (0.5, -0.1), (1, 0)])),
        ker.InvolutionLaw(lambda theta: np.pi - theta),
        ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(4))),
        ker.specular(),
        ker.retroreflection(),
    ],
    ids=str,
)
def test_combinations_of_isometries_have_no_gap_by_theorem(law):
    gap = spec.spectral_gap(law)
    assert gap.verdict == "no gap" and float(gap) == 0.0 and gap.kind == "bound" and gap.evidence


def test_one_walk_through_the_algebra_serves_both_questions():
    unresolved = ker.WallLaw(geo.koch(4))
    assert made_of_isometries(0.5 * unresolved + 0.5 * TEETH)
    assert lists_branches(TEETH @ ker.specular())
    assert not lists_branches(TEETH @ ker.lambertian()) and not made_of_isometries(TEETH @ ker.lambertian())
    assert not made_of_isometries(ker.WallLaw(geo.focusing_arcs(1.0)))


def test_a_polygon_mixed_with_a_lambertian_law_has_the_gap_of_fact_eleven():
    gap = spec.spectral_gap(0.3 * ker.lambertian() + 0.7 * TEETH)
    assert float(gap) == pytest.approx(0.3, abs=1e-14) and gap.kind == "bound" and gap.verdict == "essential edge"


def test_the_semicircle_ends_at_the_edge_of_its_essential_spectrum():
    for law, convention in ((SEMICIRCLE, "paper"), (SEMICIRCLE.in_specular_frame(), "specular")):
        gap = spec.spectral_gap(law)
        assert gap.verdict == "essential edge" and gap.convention == convention
        assert abs(float(gap) - (1 - EDGE_OF_SEMICIRCLE)) <= gap.error < 1e-7


def test_grazing_rays_of_the_semicircle_have_the_symbol_of_the_closed_form():
    """One end to itself: the integral of 1/(4 x - 1) over (1/3, 1); to the other: that of 1/(3 - 8 x) over (0, 1/3)."""
    limit = grazing_symbol(SEMICIRCLE)
    expected = np.log(9) * np.array([[1 / 4, 1 / 8], [1 / 8, 1 / 4]])
    assert np.max(np.abs(limit.matrix - expected)) <= limit.entry_error < 1e-7


def test_a_traced_semicircle_has_the_symbol_of_the_closed_form():
    semicircle = geo.Wall([geo.Arc((0.5, 0.0), (0.5, 0.5), np.pi, 2 * np.pi)])
    traced = ker.WallLaw(geo.Wall([*semicircle.pieces], period=1.0, islands=[]))
    edge = essential_edge(traced)
    assert abs(edge.value - EDGE_OF_SEMICIRCLE) <= max(edge.error, 1e-8)


def test_symbols_multiply_and_mix():
    for law, expected in [
        (SEMICIRCLE**2, EDGE_OF_SEMICIRCLE**2),
        (0.3 * ker.lambertian() + 0.7 * SEMICIRCLE, 0.7 * EDGE_OF_SEMICIRCLE),
        (0.5 * ker.specular() + 0.5 * SEMICIRCLE, 0.5 + 0.5 * EDGE_OF_SEMICIRCLE),
        (ker.henyey_greenstein(0.9), 0.0),
        (ker.lambertian() @ TEETH @ ker.lambertian(), 0.0),
    ]:
        edge = essential_edge(law)
        assert abs(edge.value - expected) <= edge.error + 1e-12, law


def test_the_parabola_pair_sends_grazing_rays_back_and_has_no_visible_gap():
    """Its two reflections turn a grazing ray round exactly to first order, whatever its entry point."""
    gap = spec.spectral_gap(ker.WallLaw(geo.double_parabola()), tolerance=1e-6)
    assert gap.verdict == "essential edge" and 0.0 <= float(gap) <= 1e-6 and gap.error <= 1e-6


def test_the_edge_of_a_side_is_at_the_angle_where_its_rays_begin_to_meet_the_curve():
    """A cusp, steep on one side: near .51915 and its image all but few rays come back to each other."""
    curve = geo.Bezier([(0.3, -0.4), (0.5, -0.6), (0.8, -0.2), (1, 0)])
    wall = geo.Wall([geo.Segment((0, 0), (0.3, -0.4)), curve])
    edge = essential_edge(ker.WallLaw(wall))
    # the side turns theta to twice its normal's angle less theta
    here = np.linspace(0.5191, 0.5192, 11)
    there = 2.0 * (np.arctan2(-0.4, 0.3) + 0.5 * np.pi) - here
    x = (np.arange(2**16) + 0.5) / 2**16
    shares = [
        np.mean(np.abs(geo.trace(wall, x[:, None], first).theta - second) < 1e-9, axis=0)
        for first, second in ((here, there), (there, here))
    ]
    top = float(np.sqrt(shares[0] * shares[1]).max())
    assert edge.low - 2e-5 < top < edge.high + 2e-5 and edge.error < 1e-5
    gap = spec.spectral_gap(ker.WallLaw(wall), 1e-4)
    assert gap.verdict == "essential edge" and abs(gap.value - (1.0 - edge.value)) <= gap.error < 1e-5


def test_a_mushroom_ends_at_an_essential_edge_above_its_fraction_of_flat_tops():
    edge = essential_edge(ker.WallLaw(geo.mushrooms(0.3)))
    assert edge.low > 0.7 and edge.high < 1.0 and edge.error < 1e-6
    # E[sin(theta)/sin(theta')] by plain tracing at theta = 1e-5, by z-score over shifted lattices
    shift = np.arange(8)[:, None] / 8 + 0.05
    x = (np.arange(2**12) + shift) / 2**12 % 1.0
    traced = geo.trace(geo.mushrooms(0.3), x.ravel(), np.full(x.size, 1e-5))
    means = (np.sin(1e-5) / np.sin(traced.theta)).reshape(x.shape).mean(axis=1)
    assert abs(means.mean() - edge.value) < 6.0 * means.std(ddof=1) / np.sqrt(8) + edge.error


def test_a_curved_wall_without_mirror_symmetry_is_isolated():
    law = ker.WallLaw(geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.7, -0.5), (1, 0)])]))
    gap = spec.spectral_gap(law, tolerance=1e-2)
    assert gap.verdict == "isolated" and gap.error < 1e-2
    assert any("essential" in line for line in gap.evidence)


@pytest.mark.parametrize(
    "law, tolerance, expected",
    [
        # specular reflection keeps even functions: (1 + g^2)/2 lies beyond the edge at 1/2
        (0.5 * ker.specular() + 0.5 * ker.henyey_greenstein(0.9), 0.6, 0.5 * (1.0 - 0.9**2)),
        (ker.CircularArcLaw(1.2), 2.0, 1.0 - 0.3670253152),
    ],
    ids=["half specular", "arc"],
)
def test_a_coarse_tolerance_does_not_turn_the_edge_into_a_gap(law, tolerance, expected):
    gap = spec.spectral_gap(law, tolerance=tolerance)
    assert abs(float(gap) - expected) <= gap.error <= tolerance


def test_a_tolerance_below_the_rounding_asks_for_what_there_is():
    """Gaps ask for means more exactly than for themselves."""
    law, theta = ker.LeastResistanceLaw(), np.array([0.5, 1.0])
    rough, fine = (expectations(law, ker.Legendre(3))(theta, tolerance)[0] for tolerance in (1e-6, 1e-20))
    assert fine == pytest.approx(rough, abs=1e-6)


def test_the_focusing_arc_has_an_isolated_eigenvalue_in_both_conventions():
    """Facts 10: 0.3670253152(3), and in the other convention minus the least, 0.311346443."""
    law = ker.CircularArcLaw(1.2)
    for turned, eigenvalue in ((law, 0.3670253152), (law.in_specular_frame(), 0.311346443)):
        gap = spec.spectral_gap(turned, tolerance=1e-5)
        assert gap.verdict == "isolated" and gap.error <= 1e-5
        assert abs(1.0 - float(gap) - eigenvalue) <= gap.error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wall", "tolerance", "most"),
    [(geo.dispersing_arcs(1.0), 1e-13, 1e-9), (geo.focusing_arcs(1.2).foreshorten(geo.Disk(1.0, 0.5)), 1e-7, 1e-6)],
    ids=["bumps", "elliptic arcs"],
)
def test_a_tolerance_that_is_too_small_for_the_time_does_not_cost_the_enclosures(wall, tolerance, most):
    assert spec.spectral_gap(ker.WallLaw(wall), tolerance=tolerance).error < most


def test_the_gap_of_elliptic_arcs_is_that_of_a_finer_tolerance():
    # .1192803291 +- 1.05e-7; with jumps that the law smooths between nodes unseen, .11928096(28) at 1e-6
    gap = spec.spectral_gap(ker.WallLaw(geo.focusing_arcs(1.2).foreshorten(geo.Disk(1.0, 0.5))), tolerance=1e-6)
    assert abs(float(gap) - 0.1192803291) <= gap.error + 1.05e-7
