"""Enclosures of eigenvalues of laws: they hold, they are narrow, or they are refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError

EPS = np.finfo(float).eps


@pytest.mark.parametrize(("g", "k"), [(-0.7, 4), (0.5, 10), (0.9, 1), (0.99, 4), (0.999999, 1)])
def test_every_eigenvalue_of_henyey_greenstein_is_enclosed_and_indexed(g, k):
    found = spec.enclosures(ker.henyey_greenstein(g), k)
    exact = np.sort(g ** np.arange(float(k)))[::-1]
    for item, value in zip(found, exact, strict=True):
        assert item.label == "indexed" and item.kind == "bound"
        assert value in item
        assert item.index == round(np.log(abs(value)) / np.log(abs(g)))
        # the numbers are right to a few roundings, and the intervals no wider than some dozen
        assert item.width <= 100.0 * max(abs(item.value - value), EPS)


@pytest.mark.parametrize("bins", [16, 64])
def test_enclosures_by_steps_are_at_most_a_hundred_times_as_wide_as_the_error(bins):
    """Trial functions of order 1: the error of the quotient is of order 2, and Kato and Temple's interval too."""
    found = spec.enclosures(ker.henyey_greenstein(0.5), 3, basis=ker.Bins(bins))
    for item, value in zip(found, [1.0, 0.5, 0.25], strict=True):
        assert value in item
        if item.label == "indexed":
            assert item.width <= 100.0 * max(abs(item.value - value), EPS)
    assert found[1].label == "indexed"


def test_maxwell_has_one_indexed_eigenvalue_and_the_rest_is_refused_with_the_reason():
    found = spec.enclosures(ker.maxwell(0.3), 3)
    assert [item.label for item in found] == ["indexed", "contains-spectrum", "contains-spectrum"]
    # .7 and -.7 are eigenvalues of infinite multiplicity: which of them come first is a matter of rounding
    assert 1.0 in found[0] and all(0.7 in item or -0.7 in item for item in found[1:])
    assert "not indexed" in found[1].reason and "Lambertian fraction" in found[1].reason


@pytest.mark.slow
def test_the_focusing_arc_has_the_published_eigenvalues():
    """Facts 10: 0.3670253152(3) and -0.311346443 at a half angle of 1.2."""
    found = spec.enclosures(ker.CircularArcLaw(1.2), 3, basis=ker.Legendre(20))
    assert [item.label for item in found] == ["indexed"] * 3
    assert 0.3670253152 in found[1] and -0.311346443 in found[2]
    assert found[1].width < 100.0 * abs(found[1].value - 0.3670253152)
    assert found[1].kind == "estimate"


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


def test_a_matrix_law_has_finite_rank():
    found = spec.enclosures(ker.MatrixLaw([[0.7, 0.3], [0.3, 0.7]]), 2)
    assert 0.4 in found[1] and found[1].label == "indexed" and found[1].width < 1e-14


def test_what_cannot_be_enclosed_is_refused():
    with pytest.raises(InputError, match="law: expected"):
        spec.enclosures(np.eye(3), 2)
    with pytest.raises(InputError, match="k: expected"):
        spec.enclosures(ker.lambertian(), 0)
    rotation = ker.MatrixLaw(np.roll(np.eye(8), 1, axis=1))
    with pytest.raises(AccuracyError, match="not symmetric"):
        spec.enclosures(rotation, 2)


def test_enclosures_of_mirror_symmetric_laws_say_their_parity():
    """g^l belongs to the polynomial of degree l: even where l is."""
    found = spec.enclosures(ker.henyey_greenstein(0.8), 4)
    assert [item.parity for item in found] == ["even", "odd", "even", "odd"]
    assert all(0.8**degree in found[degree] for degree in range(4))
    assert "indexed 1, odd (bound:" in str(found[1])
    skew = ker.MatrixLaw([[0.6, 0.3, 0.1], [0.3, 0.5, 0.2], [0.1, 0.2, 0.7]])
    assert {item.parity for item in spec.enclosures(skew, 2)} == {"none"}


def test_neighbours_of_the_other_parity_do_not_widen_an_enclosure():
    """Of arcs in Feres' convention the odd eigenvalues change sign; the even ones and their enclosures do not."""
    law = ker.CircularArcLaw(0.9)
    paper, turned = spec.enclosures(law, 3), spec.enclosures(law.in_specular_frame(), 3)
    first, second = (next(item for item in found if item.parity == "even" and item.index) for found in (paper, turned))
    assert first.low <= second.high and second.low <= first.high
    assert 0.5 < first.width / second.width < 2.0


MIXTURES = {
    "two phase functions": (
        0.5 * ker.henyey_greenstein(0.9) + 0.5 * ker.henyey_greenstein(0.5),
        lambda degree: 0.5 * 0.9**degree + 0.5 * 0.5**degree,
    ),
    "specular, Lambertian and a phase function": (
        0.25 * ker.maxwell(0.5) + 0.75 * ker.henyey_greenstein(0.6),
        lambda degree: np.where(degree > 0, 0.125 * (-1.0) ** degree + 0.75 * 0.6**degree, 1.0),
    ),
}


@pytest.mark.parametrize("basis", [None, ker.Bins(32)], ids=["polynomials", "steps"])
@pytest.mark.parametrize("mixture", MIXTURES)
def test_indexed_eigenvalues_of_mixtures_are_enclosed(mixture, basis):
    """On the polynomial of degree l all parts are multiples of the identity, up to the sign of specular reflection."""
    law, eigenvalue = MIXTURES[mixture]
    exact = eigenvalue(np.arange(400.0))
    exact = exact[np.argsort(-np.abs(exact), kind="stable")]
    found = [item for item in spec.enclosures(law, 4, basis) if item.label == "indexed"]
    assert len(found) >= 3
    for item in found:
        assert exact[item.index] in item
        assert item.width <= 100.0 * max(abs(item.value - exact[item.index]), EPS)
