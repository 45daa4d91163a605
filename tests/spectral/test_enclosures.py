"""Enclosures of eigenvalues of laws: they hold and are narrow."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec


def test_maxwell_has_one_indexed_eigenvalue_and_the_rest_is_refused_with_the_reason():
    found = spec.enclosures(ker.maxwell(0.3), 3)
    assert [item.label for item in found] == ["indexed", "contains-spectrum", "contains-spectrum"]
    # .7 and -.7 are eigenvalues of infinite multiplicity: which of them come first is a matter of rounding
    assert 1.0 in found[0] and all(0.7 in item or -0.7 in item for item in found[1:])
    assert "not indexed" in found[1].reason and "Lambertian fraction" in found[1].reason


SHALLOW_CURVES = [
    geo.Bezier([(0, 0), (0.3, -0.12), (1, 0)]),
    geo.Bezier([(0, 0), (0.2, -0.15), (0.7, -0.1), (1, 0)]),
    geo.Bezier([(0, 0), (0.5, -0.15), (1, 0)]),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "wall",
    [geo.focusing_arcs(0.3), geo.dispersing_arcs(0.5), *(geo.Wall([curve]) for curve in SHALLOW_CURVES)],
    ids=["arc", "bumps", "skew", "skew cubic", "parabola"],
)
def test_enclosures_of_curved_walls_hold_against_a_finer_run(wall):
    law = ker.WallLaw(wall)
    coarse = spec.enclosures(law, 2, basis=ker.Legendre(8), tolerance=1e-5)
    fine = spec.spectrum(law, 2, basis=ker.Legendre(14), tolerance=1e-5)
    assert coarse[1].label == "indexed" and coarse[1].index == 1
    slack = 2.0 * fine.errors.algebraic[1] + fine.matrix_error
    assert coarse[1].low - slack <= fine.values[1] <= coarse[1].high + slack


def test_nothing_is_indexed_below_the_essential_spectrum():
    found = spec.enclosures(ker.CircularArcLaw(np.pi / 2), 2, basis=ker.Legendre(12))
    assert found[1].label == "contains-spectrum" and found[1].index is None


def test_neighbours_of_the_other_parity_do_not_widen_an_enclosure():
    """Of arcs in Feres' convention the odd eigenvalues change sign; the even ones and their enclosures do not."""
    law = ker.CircularArcLaw(0.9)
    paper, turned = spec.enclosures(law, 3), spec.enclosures(law.in_specular_frame(), 3)
    first, second = (next(item for item in found if item.parity == "even" and item.index) for found in (paper, turned))
    assert first.low <= second.high and second.low <= first.high
    assert 0.5 < first.width / second.width < 2.0
