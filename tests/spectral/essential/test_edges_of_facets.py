"""Essential edges and gaps of walls whose facets are diffuse in part, and bounds that they must respect."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.gap.theorems import form_of_one_hit
from wall_shapes import OPEN

ARCS, TEETH, SEMICIRCLE = geo.focusing_arcs(1.0), geo.triangular_teeth(0.9), geo.focusing_arcs(0.5 * np.pi)


def faceted(wall: geo.Wall, a: float) -> ker.FacetedLaw:
    return ker.FacetedLaw(wall, ker.maxwell(a))


@pytest.mark.parametrize("wall", [TEETH, geo.rectangular_teeth(1.0), geo.triangular_teeth(2.5)], ids=repr)
def test_edges_of_straight_pieces_lie_between_the_mean_of_specular_rays_and_the_specular_fraction(wall) -> None:
    edge = spec.essential_edge(faceted(wall, 0.2))
    rng, number = np.random.default_rng(8), 2**16
    rays = geo.trace(wall, rng.random(number) * wall.period, ker.SINE.sample(number, rng))
    assert float(np.mean(0.8**rays.collisions)) - 0.003 < edge.low <= edge.high == 0.8
    assert edge.kind == "estimate" and "argued" in edge.reasons[0]


def test_edges_of_curved_walls_are_grazing_limits_with_the_weight_of_the_specular_rays() -> None:
    for a in (0.2, 0.5):
        edge = spec.essential_edge(faceted(SEMICIRCLE, a))
        x, theta = (np.arange(20_000) + 0.5) / 20_000, 1e-6
        rays = geo.trace(SEMICIRCLE, x, theta)
        expected = np.mean((1.0 - a) ** rays.collisions * np.sin(theta) / np.sin(rays.theta))
        assert abs(edge.value - expected) < 1e-4
    assert spec.essential_edge(faceted(ARCS, 0.2)).high == 0.0
    # a flat top is a mirror in part, once
    topped = geo.Wall([*ARCS.pieces, geo.Segment((1, 0), (2, 0))], period=2.0)
    found = spec.essential_edge(faceted(topped, 0.3))
    assert found.low == pytest.approx(0.35) and found.high == pytest.approx(0.35)


def test_nothing_is_said_of_other_facets_and_of_walls_that_do_not_close() -> None:
    for law in (ker.FacetedLaw(ARCS, ker.henyey_greenstein(0.3)), faceted(OPEN["island"](), 0.2)):
        edge = spec.essential_edge(law)
        assert (edge.low, edge.high) == (0.0, 1.0)
    half = 0.5 * faceted(TEETH, 0.2) + 0.5 * ker.lambertian()
    assert spec.essential_edge(half).high == pytest.approx(0.4)


def test_walls_of_straight_pieces_gain_a_gap_and_their_evidence_has_its_lower_bound() -> None:
    law = faceted(TEETH, 0.2)
    assert spec.spectral_gap(ker.WallLaw(TEETH)).verdict == "no gap"
    gap = spec.spectral_gap(law, tolerance=1e-2)
    least = 0.2 * form_of_one_hit(law)
    assert gap.verdict == "essential edge" and gap.value - gap.error >= 0.2 - 1e-12 > least > 0.0
    assert any("the gap is at least a gamma" in line for line in gap.evidence)


def test_gaps_of_curved_walls_are_isolated() -> None:
    # the value in 64 bins
    gap = spec.spectral_gap(faceted(ARCS, 1.0), tolerance=1e-2)
    assert gap.verdict == "isolated" and abs(gap.value - 0.730) < gap.error + 2e-3
    assert gap.value > form_of_one_hit(faceted(ARCS, 1.0))
