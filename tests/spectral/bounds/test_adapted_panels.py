"""Trial functions on adapted panels, and the rows of laws against panels that they rest on."""

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import random_curved_wall

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.discretisation.arcs import arc_matrix
from asperity.kernels.expectations.angle_panels import NODES
from asperity.spectral.bounds import trial_space
from asperity.spectral.bounds.images import expectations, expectations_of, suits_panels
from asperity.spectral.bounds.trial_space import adapted_trial_space

ANGLES = np.concatenate([0.05 + 0.3 * np.arange(10.0), [1e-6, 1.2, np.pi - 1e-6]])
EDGES = np.append(np.arange(0.0, 3.0, 0.3), np.pi)


@pytest.fixture(scope="module")
def panels():
    return ker.Panels(EDGES, 5)


@pytest.mark.parametrize("half_angle", [1e-3, 0.6, 1.2, np.pi / 2])
def test_rows_of_arcs_against_panels_act_on_smooth_functions_as_the_law_does(half_angle):
    law, smooth = ker.CircularArcLaw(half_angle), ker.Panels(EDGES, 12)
    images, errors = expectations(law, smooth)(ANGLES, 1e-12)
    assert np.allclose(images @ smooth.project(np.cos), law.apply(np.cos, ANGLES), atol=1e-12)
    assert np.allclose(images @ smooth.constant, 1.0, atol=1e-13) and np.all(errors <= 1e-5)


@pytest.mark.parametrize("half_angle", [0.6, 1.2, np.pi / 2])
def test_means_by_tables_are_those_by_cutting_rows_at_edges(half_angle, panels):
    vectors = np.random.default_rng(0).normal(size=(panels.size, 2))
    law = ker.CircularArcLaw(half_angle)
    images, _ = expectations(law, panels)(ANGLES, 1e-12)
    means, _ = expectations_of(law, panels, vectors)(ANGLES, 1e-12)
    # the functions are as large as their heights on narrow cells
    scale = np.abs(panels.evaluate(ANGLES)).max() * np.abs(vectors).max()
    assert np.abs(images @ vectors - means).max() < 1e-9 * scale


def test_rows_of_traced_walls_are_those_of_the_closed_form(panels):
    wall = geo.focusing_arcs(0.9)
    from asperity.kernels.walls.conditionals import WallConditionals

    traced = WallConditionals(wall, 1, panels.edges[1:-1], 2)(ANGLES[:5], 1e-8)[0].in_basis(panels)
    exact, _ = expectations(ker.CircularArcLaw(0.9), panels)(ANGLES[:5], 1e-12)
    assert np.abs(traced - exact).max() < 1e-6 * np.abs(panels.evaluate(ANGLES)).max()


def test_sums_and_the_other_frame_have_the_rows_of_their_parts():
    panels = ker.Panels(np.linspace(0.0, np.pi, 9), 4)
    arc = ker.CircularArcLaw(0.7)
    law = 0.3 * arc + 0.7 * ker.lambertian()
    assert suits_panels(law) and suits_panels(law.in_specular_frame())
    assert not suits_panels(arc @ arc)
    images, _ = expectations(law.in_specular_frame(), panels)(ANGLES, 1e-12)
    smooth = panels.project(lambda theta: theta**2)
    assert np.allclose(images @ smooth, law.in_specular_frame().apply(lambda theta: theta**2, ANGLES), atol=1e-10)


# campaigns/judges/precise_arc_eigenvalues.py: second and third eigenvalue by modulus, and the error
PRECISE = {
    0.6: (0.286691174546, -0.537859309982, 1e-8),
    0.9: (0.235175619486, -0.314437701261, 1e-8),
    1.2: (0.367025305208, -0.311346431743, 2e-8),
}


@pytest.mark.parametrize("half_angle", PRECISE)
def test_enclosures_of_arcs_hold_the_eigenvalues_of_a_second_method(half_angle):
    found = spec.enclosures(ker.CircularArcLaw(half_angle), 3, tolerance=1e-6)
    *exact, error = PRECISE[half_angle]
    for item, value in zip(found.items[1:], exact, strict=True):
        assert item.label == "indexed" and item.width < 2e-6
        assert item.low - error <= value <= item.high + error
        # moduli of Galerkin matrices are too small
        assert abs(value) < abs(item.value) + 1e-7


def test_the_gap_of_the_arc_is_known_to_a_billionth():
    """Facts of the literature and of a second program: 0.3670253152(3)."""
    gap = spec.spectral_gap(ker.WallLaw(geo.focusing_arcs(1.2)), tolerance=1e-9)
    assert gap.verdict == "isolated" and gap.error <= 1e-9
    assert abs(1.0 - gap.value - 0.3670253152) <= gap.error + 3e-10


def test_enclosures_of_a_traced_wall_hold_the_far_finer_run_of_the_benchmark():
    """The campaign `enclosures`: dispersing arcs of curvature 1."""
    found = spec.enclosures(ker.WallLaw(geo.dispersing_arcs(1.0)), 3, tolerance=1e-4)
    for item, value in zip(found.items[1:], (0.28381035719, -0.65746451545), strict=True):
        assert item.label == "indexed" and item.width < 2e-4 and value in item


def test_trial_functions_are_orthonormal_and_of_one_parity():
    found = adapted_trial_space(ker.CircularArcLaw(1.2), 3, 1e-6)
    gram = found.vectors.T @ found.vectors
    assert np.allclose(gram, np.eye(3), atol=1e-4)
    assert found.mirrored and found.values[0] == 1.0
    here = found.basis.evaluate(0.5 * np.pi + 0.5 * NODES[NODES != 0.0]) @ found.vectors
    sign = np.array([1.0, -1.0, -1.0])
    assert np.allclose(here[::-1], sign * here, atol=1e-12)


def test_trial_functions_of_a_lopsided_wall_have_no_parity():
    law = ker.WallLaw(geo.Wall([geo.Bezier([(0, -0.15), (0.15, 0.05), (0.5, 0.05), (1, -0.15)])]))
    space = adapted_trial_space(law, 3, 1e-4)
    assert space.parities == ("none",) * 3 and not space.mirrored
    # neither even nor odd
    values = space.basis.evaluate([0.4, np.pi - 0.4]) @ space.vectors[:, 1:]
    assert np.all(abs(abs(values[0]) - abs(values[1])) > 0.05)


def test_an_essential_spectrum_just_below_an_eigenvalue_does_not_stop_its_trial_function():
    """Two segments keep the directions of a band of spectrum below .70, and the eigenvalue is .715."""
    space = adapted_trial_space(ker.WallLaw(random_curved_wall(19)), 2, 3e-6)
    # sixty steps of plain iteration leave 6.4e-8 on 294 panels
    assert space.values[1] == pytest.approx(0.71528, abs=2e-5)
    assert space.square < 4e-8 and len(space.basis.edges) < 150


@pytest.mark.parametrize("basis", [ker.Legendre(8), ker.Bins(32), ker.Bins([0.0, 1.0, np.pi])], ids=repr)
@pytest.mark.parametrize("half_angle", [0.3, 1.0, np.pi / 2])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_arcs_follow_no_more_hits_than_the_tolerance_needs(half_angle, tolerance, basis):
    fine, rounding = arc_matrix(half_angle, basis)
    rough, error = arc_matrix(half_angle, basis, tolerance)
    assert np.linalg.norm(rough - fine) <= error + rounding <= 1e-3 * tolerance


def test_a_rough_matrix_of_arcs_leaves_many_hits_out():
    fine, rough = (arc_matrix(1.2, ker.Legendre(2), tolerance) for tolerance in (0.0, 1e-2))
    assert 1e-11 < np.linalg.norm(rough[0] - fine[0]) <= rough[1]


def test_the_panel_at_grazing_is_halved_as_often_as_its_residual_asks_for(monkeypatch):
    levels, level = [], trial_space._Level
    monkeypatch.setattr(trial_space, "_Level", lambda *given: levels.append(given) or level(*given))
    trial = adapted_trial_space(ker.WallLaw(geo.dispersing_arcs(1.0)), 3, 1e-9)
    # halved once a level, it takes more than ten levels; so few levels and panels end where the residual is met
    assert len(levels) <= 4 and len(trial.basis.edges) < 50
