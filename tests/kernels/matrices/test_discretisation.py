"""Matrices of laws of isometries, of involutions and of arcs: the numbers of closed forms, frames."""

from dataclasses import dataclass

import numpy as np
import pytest

from asperity import kernels as ker
from asperity.kernels.laws.law import BranchLaw

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


def test_rectangular_teeth_are_exact_up_to_grazing() -> None:
    # <u, P u> = -<u, (1 - 2 p) u> with p the probability of retroreflection, |d - nearest even number|/2 of
    # d = 2 r |cot theta|: in c = cot theta, the integral of (1 - |d - even|) c^2 (1 + c^2)^(-5/2) over c > 0, which is
    # summed here piece by piece up to d = 4000; beyond, 1 - |d - even| is replaced by its mean 1/2, which leaves less
    # than a quarter of the last integrand.
    r = 1.0
    steps = np.arange(0.0, 4000.0)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    c = (steps[:, None] + 0.5 * (1.0 + nodes)) / (2.0 * r)
    d = 2.0 * r * c
    retro = 0.5 * np.abs(d - 2.0 * np.rint(0.5 * d))
    total = 3.0 * np.sum(0.25 * weights * (2.0 * retro - 1.0) * c**2 * (1.0 + c**2) ** -2.5)
    matrix = ker.discretise(ker.RectangularTeethLaw(r), ker.Legendre(16))
    total -= 3.0 * 0.5 * 0.5 * (4000.0 / (2.0 * r)) ** -2.0
    assert abs(rayleigh(matrix) - total) <= float(matrix.error) + 1e-9
    assert matrix.error.kind == "bound"


@dataclass(frozen=True)
class Swap(BranchLaw):
    """Specular reflection for steep angles, retroreflection for others: two breakpoints."""

    steep: float

    def _branches(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        specular = (np.abs(theta - np.pi / 2) < self.steep).astype(np.float64)
        return np.stack([specular, 1.0 - specular], -1), np.stack([np.pi - theta, theta], -1)

    def breakpoints(self, limit: int) -> tuple[np.ndarray, float]:
        return np.array([np.pi / 2 - self.steep, np.pi / 2 + self.steep]), 0.0


@pytest.mark.parametrize("edges", [[0.0, 0.3, 1.0, 2.0, 2.9, np.pi], [0.0, np.pi / 2, np.pi]])
def test_masses_between_bins_are_exact_for_a_law_with_known_masses(edges: list[float]) -> None:
    steep = 0.5
    basis = ker.Bins(edges)

    def mass(low: float, high: float) -> float:
        return 0.5 * (np.cos(low) - np.cos(high)) if high > low else 0.0

    expected = np.zeros((basis.size, basis.size))
    inner = (np.pi / 2 - steep, np.pi / 2 + steep)
    for i in range(basis.size):
        low, high = basis.edges[i : i + 2]
        expected[i, i] += mass(low, min(high, inner[0])) + mass(max(low, inner[1]), high)
        for j in range(basis.size):
            # the mirror image of bin j, cut by bin i and the steep angles
            back, ahead = np.pi - basis.edges[j + 1], np.pi - basis.edges[j]
            expected[i, j] += mass(max(low, inner[0], back), min(high, inner[1], ahead))
    flux = ker.discretise(Swap(steep), basis).flux
    assert np.abs(flux - expected).max() < 1e-15


def test_chains_of_isometries_are_exact_too() -> None:
    law = ker.TriangularTeethLaw(1.7)
    matrix = ker.discretise(law @ law, ker.Legendre(40))
    assert matrix.method == "exact"
    # in an infinite basis the square of the Galerkin matrix; column 0 and the constant are exact in any
    assert matrix.stochastic_defect() < 1e-13 and matrix.symmetry_defect() < 1e-13
    nodes, weights = ker.SINE.quadrature(np.linspace(0.0, np.pi, 4001), 2)
    u_image = law.apply(np.cos, nodes)
    assert rayleigh(matrix) == pytest.approx(float(3.0 * np.sum(weights * u_image**2)), abs=1e-6)


def test_sums_are_done_term_by_term() -> None:
    matrix = ker.discretise(ker.maxwell(0.25), ker.Legendre(6))
    assert matrix.method == "quadrature + exact"
    expected = np.diag(0.75 * (-1.0) ** np.arange(6)) + 0.25 * np.eye(6)[:, :1] @ np.eye(6)[:1]
    assert np.abs(matrix.symmetric - expected).max() < 1e-13


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
