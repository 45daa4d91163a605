"""Matrices of laws of isometries, of involutions and of arcs: the numbers of closed forms, frames."""

import numpy as np
import pytest

from asperity import kernels as ker

# <u, P u>/<u, u> with u = cos theta, from independent tracers and high-precision quadrature.
TRIANGULAR_07 = 0.134541971359171
ARC_12 = 0.327558333378


def rayleigh(matrix: ker.KernelMatrix) -> float:
    """<u, P u>/<u, u> with the projection of u = cos theta on the basis."""
    u = matrix.basis.project(np.cos)
    return float(u @ matrix.symmetric @ u / (u @ u))


# ---- laws of isometries ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "basis", [ker.Legendre(2), ker.Legendre(64), ker.Panels(np.linspace(0, np.pi, 13), 8)], ids=repr
)
def test_triangular_teeth_have_the_known_number_in_smooth_bases(basis: ker.Basis) -> None:
    matrix = ker.discretise(ker.TriangularTeethLaw(0.7), basis)
    assert rayleigh(matrix) == pytest.approx(TRIANGULAR_07, abs=1e-13)
    assert matrix.symmetry_defect() < 1e-13 and matrix.stochastic_defect() < 1e-13


# ---- deterministic laws ------------------------------------------------------------------------------------------
def shuffled(theta: np.ndarray) -> np.ndarray:
    """Swaps the quarters [0, 1/4] and [1/2, 3/4] of the measure and reverses the last quarter."""
    fraction = ker.SINE.cdf(theta)
    image = np.where(
        fraction < 0.25, fraction + 0.5, np.where((fraction > 0.5) & (fraction < 0.75), fraction - 0.5, fraction)
    )
    image = np.where(fraction > 0.75, 1.75 - fraction, image)
    return ker.SINE.quantile(np.clip(image, 1e-16, 1 - 1e-16))


def test_involutions_with_jumps_are_resolved_exactly() -> None:
    law = ker.InvolutionLaw(shuffled)
    bins = ker.discretise(law, ker.Bins(8))
    expected = np.zeros((8, 8))
    expected[[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 2, 3, 0, 1, 7, 6]] = 1.0
    assert np.abs(bins.array - expected).max() < 1e-9
    smooth = ker.discretise(law, ker.Legendre(8))
    # u = 1 - 2 fraction; <u, u o T> over the four quarters
    fraction = (np.arange(400_000) + 0.5) / 400_000
    image = ker.SINE.cdf(shuffled(ker.SINE.quantile(fraction)))
    assert smooth.symmetric[1, 1] == pytest.approx(3.0 * np.mean((1 - 2 * fraction) * (1 - 2 * image)), abs=1e-9)
    assert smooth.tolerance_met and smooth.stochastic_defect() < 1e-12


# ---- circular arcs -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "basis", [ker.Legendre(2), ker.Legendre(24), ker.Panels(np.linspace(0.0, np.pi, 9), 7)], ids=repr
)
def test_circular_arcs_have_the_known_number_within_the_reported_error(basis: ker.Basis) -> None:
    matrix = ker.discretise(ker.CircularArcLaw(1.2), basis)
    assert abs(rayleigh(matrix) - ARC_12) <= float(matrix.error) + 1e-12
    assert float(matrix.error) < 1e-11
    assert matrix.symmetry_defect() < 1e-13 and matrix.stochastic_defect() < 1e-13


@pytest.mark.parametrize("half_angle", [1e-3, 0.3, 1.2, np.pi / 2])
def test_bins_of_circular_arcs_are_symmetric_and_stochastic_to_rounding(half_angle: float) -> None:
    matrix = ker.discretise(ker.CircularArcLaw(half_angle), ker.Bins(100))
    # rows are integrals over an interval of length 2 xi whose ends are known to a rounding of pi
    assert matrix.symmetry_defect() < 1e-13 and matrix.stochastic_defect() < 2e-13 + 1e-14 / half_angle
    sampled = ker.discretise(ker.CircularArcLaw(half_angle), ker.Bins(100), method="qmc", samples=2**17)
    distance = np.linalg.norm(sampled.symmetric - matrix.symmetric)
    # a half width of 95 % of the norm of many differences
    assert 0.4 < distance / float(sampled.error) < 1.0


def test_unsymmetric_bases_see_the_same_arcs() -> None:
    law = ker.CircularArcLaw(1.0)
    fine, coarse = ker.discretise(law, ker.Bins([0.0, 0.4, 1.0, 2.0, np.pi])), ker.Bins([0.0, 1.0, np.pi])
    merge = np.array([[1, 1, 0, 0], [0, 0, 1, 1]])
    assert np.abs(ker.discretise(law, coarse).flux - merge @ fine.flux @ merge.T).max() < 1e-12
    symmetric = ker.discretise(law, ker.Bins([0.0, 1.0, np.pi - 1.0, np.pi]))
    merge = np.array([[1, 0, 0], [0, 1, 1]])
    assert np.abs(ker.discretise(law, coarse).flux - merge @ symmetric.flux @ merge.T).max() < 1e-12


# ---- frames ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("basis", [ker.Bins([0.0, 0.5, 2.0, np.pi]), ker.Panels([0.0, 1.0, np.pi], 2)], ids=repr)
def test_the_specular_frame_is_exact_in_bases_that_the_flip_does_not_keep(basis: ker.Basis) -> None:
    law = ker.henyey_greenstein(0.5).in_specular_frame()
    found = ker.discretise(law, basis)
    # P J for Henyey-Greenstein is the kernel of -g
    expected = ker.discretise(ker.henyey_greenstein(-0.5), basis)
    assert np.linalg.norm(found.symmetric - expected.symmetric) < 1e-8


# ---- arguments ---------------------------------------------------------------------------------------------------


def test_the_record_of_a_matrix_is_that_of_its_law() -> None:
    matrix = ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(4), tolerance=1e-3)
    assert matrix.law == "TriangularTeethLaw(angle=0.7)"
    assert (matrix.reversible, matrix.mirror_symmetric, matrix.frame) == (True, True, "paper")
    assert matrix.requested_tolerance == 1e-3 and matrix.tolerance_met and matrix.samples == 0
