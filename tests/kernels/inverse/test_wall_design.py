"""Walls designed for a wish: known optima, wanted values, and limits of what can be made."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.inverse.design import hollow_radius


def test_a_wanted_resistance_is_met():
    found = ker.design_wall(ker.resistance, geo.focusing_arcs, [(0.2, 1.5)], wanted=1.2, tolerance=1e-8)
    assert float(ker.resistance(ker.WallLaw(geo.focusing_arcs(float(found.parameters[0]))))) == pytest.approx(
        1.2, abs=1e-6
    )


def test_best_hollow_is_the_same_search():
    design = ker.design_wall(ker.resistance, ker.TriangularTeethLaw, [(0.2, 3.0)])
    best = ker.best_hollow(ker.TriangularTeethLaw, [(0.2, 3.0)])
    assert design.parameters.tolist() == best.parameters.tolist() and design.value == best.resistance


def test_the_gap_is_an_objective():
    found = ker.design_wall(
        lambda law, tolerance: spec.spectral_gap(law, tolerance), ker.maxwell, [(0.0, 1.0)], wanted=0.3, tolerance=1e-6
    )
    # the gap of Maxwell's law in the paper's convention is that of its odd functions below 1, and its even ones
    assert float(spec.spectral_gap(ker.maxwell(float(found.parameters[0])))) == pytest.approx(0.3, abs=1e-4)


def test_limits_keep_deep_walls_out():
    free = ker.design_wall(ker.resistance, geo.triangular_teeth, [(0.3, 3.0)])
    shallow = ker.design_wall(ker.resistance, geo.triangular_teeth, [(0.3, 3.0)], most_depth=0.2)
    assert free.member.depth > 0.2 >= shallow.member.depth
    assert float(shallow.value) < float(free.value)
    assert np.isnan(shallow.tried[:, -1]).any()
    # the resistance of teeth falls with the apex angle beyond the best one: the best within the limit lies on it
    assert shallow.member.depth == pytest.approx(0.2, abs=2e-3)


def test_the_smallest_radius_is_that_of_the_hollow_side():
    assert hollow_radius(geo.flat()) == np.inf
    assert hollow_radius(geo.rectangular_teeth(1.0)) == 0.0
    for half_angle in (0.3, 1.2):
        arcs = geo.focusing_arcs(half_angle)
        assert hollow_radius(arcs) == pytest.approx(0.5 / np.sin(half_angle), rel=1e-12)
    # bumps meet in a sharp valley, whatever their own radius
    assert hollow_radius(geo.dispersing_arcs(0.5)) == 0.0
    # an ellipse as the image of a circle: b^2/a at the ends of its long axis, here at the bottom
    deep = geo.Wall([geo.Arc((0.5, 0.0), (0.5, 1.0), np.pi, 2.0 * np.pi)])
    assert hollow_radius(deep) == pytest.approx(0.25, rel=1e-3)
