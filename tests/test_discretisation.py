"""Matrices of laws: exact, by quadrature, by sampling; the numbers of closed forms, orders, and errors that hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AccuracyError, InputError
from asperity.kernels.sampling import RANDOMISATIONS

# <u, P u>/<u, u> with u = cos theta, from independent tracers and high-precision quadrature.
TRIANGULAR_07 = 0.134541971359171
ARC_12 = 0.327558333378
ARC_12_SECOND = 0.3670253152


def rayleigh(matrix: ker.KernelMatrix) -> float:
    """<u, P u>/<u, u> with the projection of u = cos theta on the basis."""
    u = matrix.basis.project(np.cos)
    return float(u @ matrix.symmetric @ u / (u @ u))


def eigenvalues(matrix: ker.KernelMatrix) -> np.ndarray:
    return np.linalg.eigvalsh(0.5 * (matrix.symmetric + matrix.symmetric.T))[::-1]


# ---- laws of isometries ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("law", [ker.TriangularTeethLaw(0.7), ker.RectangularTeethLaw(1.0)], ids=repr)
def test_bins_of_polygonal_laws_are_symmetric_and_stochastic_to_rounding(law: ker.Law) -> None:
    matrix = ker.discretise(law, ker.Bins(512))
    assert matrix.method == "exact" and matrix.error.kind == "bound"
    assert matrix.symmetry_defect() < 1e-13 and matrix.stochastic_defect() < 1e-13
    assert matrix.array.min() >= 0.0


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
class Swap(ker.BranchLaw):
    """Specular reflection for steep angles, retroreflection for others: two kinks."""

    steep: float
    fan_out = 2

    def branches(self, theta: object) -> tuple[np.ndarray, np.ndarray]:
        theta = np.asarray(theta, dtype=np.float64)
        specular = (np.abs(theta - np.pi / 2) < self.steep).astype(np.float64)
        return np.stack([specular, 1.0 - specular], -1), np.stack([np.pi - theta, theta], -1)

    def kinks(self, limit: int) -> tuple[np.ndarray, float]:
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


# ---- densities ---------------------------------------------------------------------------------------------------
def test_lambertian_matrices_have_rank_one_to_rounding() -> None:
    for basis in (ker.Bins(60), ker.Legendre(12), ker.Panels([0.0, 0.5, np.pi], 3)):
        matrix = ker.discretise(ker.lambertian(), basis)
        assert np.abs(matrix.symmetric - np.outer(basis.constant, basis.constant)).max() < 1e-14


@pytest.mark.parametrize("g", [0.5, -0.7, 0.9])
def test_legendre_has_the_eigenvalues_of_henyey_greenstein_to_rounding(g: float) -> None:
    matrix = ker.discretise(ker.henyey_greenstein(g), ker.Legendre(64))
    assert np.abs(matrix.symmetric - np.diag(g ** np.arange(64.0))).max() < 1e-12
    assert matrix.tolerance_met


def henyey_greenstein_on(basis: ker.Bins, g: float) -> np.ndarray:
    """The Galerkin matrix from sum (2 l + 1)/2 g^l P_l P_l, with the integral of P_l (P_{l+1} - P_{l-1})/(2 l + 1)."""
    u = np.cos(basis.edges)
    before, legendre = np.ones_like(u), u.copy()
    mass = -np.diff(u)
    flux = 0.5 * np.outer(mass, mass)
    for degree in range(1, int(np.log(1e-17) / np.log(abs(g)))):
        after = ((2 * degree + 1) * u * legendre - degree * before) / (degree + 1)
        integral = -np.diff(after - before) / (2 * degree + 1)
        flux += 0.5 * (2 * degree + 1) * g**degree * np.outer(integral, integral)
        before, legendre = legendre, after
    return flux / np.sqrt(np.outer(mass, mass))


UNEVEN = ker.Bins([0.0, 0.01, 0.3, 0.32, 1.0, 1.7, 2.5, 3.0, np.pi])


@pytest.mark.parametrize("basis", [ker.Bins(64), ker.Bins(256), ker.Bins(7), UNEVEN], ids=repr)
@pytest.mark.parametrize("g", [0.5, 0.95, 0.99, -0.9])
def test_peaked_densities_have_their_exact_masses_between_bins(g: float, basis: ker.Bins) -> None:
    matrix = ker.discretise(ker.henyey_greenstein(g), basis)
    assert np.linalg.norm(matrix.symmetric - henyey_greenstein_on(basis, g)) <= float(matrix.error)
    assert float(matrix.error) < 1e-7
    assert matrix.stochastic_defect() < 1e-10
    assert matrix.symmetry_defect() < 1e-9


def test_a_peak_much_narrower_than_the_bins_is_seen() -> None:
    matrix = ker.discretise(ker.henyey_greenstein(1.0 - 1e-5), ker.Bins(16))
    assert matrix.stochastic_defect() < 1e-10 and eigenvalues(matrix)[0] == pytest.approx(1.0, abs=1e-10)
    # a Galerkin eigenvalue of a reversible law lies below its own, g
    assert 0.999 < eigenvalues(matrix)[1] < 1.0 - 1e-5


@pytest.mark.parametrize(
    "law",
    [
        ker.lambertian(),
        ker.henyey_greenstein(0.5),
        ker.MatrixLaw([[0.5, 0.5], [0.5, 0.5]]),
        ker.DensityLaw(lambda theta, theta_out: 0.5 * np.sin(theta_out) + 0.0 * theta),
        ker.maxwell(0.5),
    ],
    ids=repr,
)
def test_no_angles_have_no_images(law: ker.Law) -> None:
    assert law.apply(np.cos, []).shape == (0,)
    assert law.apply(np.cos, np.empty((3, 0))).shape == (3, 0)
    assert law.apply(ker.Legendre(4).evaluate, np.empty((2, 0))).shape == (2, 0, 4)
    assert law.sample([], np.random.default_rng(1)).shape == (0,)


@pytest.mark.parametrize(
    ("make", "sizes", "order"),
    [
        (ker.Bins, (16, 32, 64), ker.Bins.order),
        (lambda n: ker.Panels(np.linspace(0, np.pi, n + 1), 1), (12, 16, 24), 4),
        (lambda n: ker.Panels(np.linspace(0, np.pi, n + 1), 2), (8, 12, 16), 6),
    ],
    ids=["bins", "linear panels", "quadratic panels"],
)
def test_eigenvalues_converge_with_the_declared_order(make: object, sizes: tuple[int, ...], order: int) -> None:
    law, g = ker.henyey_greenstein(0.5), 0.5
    bases = [make(n) for n in sizes]  # type: ignore[operator]
    assert all(basis.order == order for basis in bases)
    errors = [g - eigenvalues(ker.discretise(law, basis, tolerance=1e-13))[1] for basis in bases]
    # Galerkin eigenvalues of a compact law approach from below
    assert min(errors) > 0.0
    slope = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.15)


def test_a_matrix_law_gives_its_matrix_back() -> None:
    array = [[0.5, 0.3, 0.2], [0.3, 0.4, 0.3], [0.2, 0.3, 0.5]]
    assert np.abs(ker.discretise(ker.MatrixLaw(array), ker.Bins(3)).array - array).max() < 1e-9


def test_products_of_densities_are_the_galerkin_matrices_of_the_product() -> None:
    product = ker.henyey_greenstein(0.5) @ ker.henyey_greenstein(0.8)
    smooth = ker.discretise(product, ker.Legendre(12))
    assert np.abs(smooth.symmetric - np.diag(0.4 ** np.arange(12.0))).max() < 1e-11
    bins = ker.discretise(product, ker.Bins(12))
    exact = ker.discretise(ker.henyey_greenstein(0.4), ker.Bins(12))
    assert np.linalg.norm(bins.symmetric - exact.symmetric) <= float(bins.error)
    # which the product of the two Galerkin matrices is not
    factors = [ker.discretise(ker.henyey_greenstein(g), ker.Bins(12)) for g in (0.5, 0.8)]
    assert np.linalg.norm((factors[0] @ factors[1]).symmetric - exact.symmetric) > float(bins.error)


def test_the_zeroth_power_is_the_identity() -> None:
    for basis in (ker.Bins(5), ker.Legendre(5)):
        matrix = ker.discretise(ker.henyey_greenstein(0.5) ** 0, basis)
        assert np.abs(matrix.symmetric - np.eye(5)).max() < 1e-13


# ---- deterministic laws ------------------------------------------------------------------------------------------
def shuffled(theta: np.ndarray) -> np.ndarray:
    """Swaps the quarters [0, 1/4] and [1/2, 3/4] of the measure and reverses the last quarter."""
    share = ker.SINE.cdf(theta)
    image = np.where(share < 0.25, share + 0.5, np.where((share > 0.5) & (share < 0.75), share - 0.5, share))
    image = np.where(share > 0.75, 1.75 - share, image)
    return ker.SINE.quantile(np.clip(image, 1e-16, 1 - 1e-16))


def test_involutions_with_jumps_are_resolved_exactly() -> None:
    law = ker.InvolutionLaw(shuffled)
    bins = ker.discretise(law, ker.Bins(8))
    expected = np.zeros((8, 8))
    expected[[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 2, 3, 0, 1, 7, 6]] = 1.0
    assert np.abs(bins.array - expected).max() < 1e-9
    smooth = ker.discretise(law, ker.Legendre(8))
    # u = 1 - 2 share; <u, u o T> over the four quarters
    share = (np.arange(400_000) + 0.5) / 400_000
    image = ker.SINE.cdf(shuffled(ker.SINE.quantile(share)))
    assert smooth.symmetric[1, 1] == pytest.approx(3.0 * np.mean((1 - 2 * share) * (1 - 2 * image)), abs=1e-9)
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
    assert 0.5 < distance / float(sampled.error) < 2.0


def test_unsymmetric_bases_see_the_same_arcs() -> None:
    law = ker.CircularArcLaw(1.0)
    fine, coarse = ker.discretise(law, ker.Bins([0.0, 0.4, 1.0, 2.0, np.pi])), ker.Bins([0.0, 1.0, np.pi])
    merge = np.array([[1, 1, 0, 0], [0, 0, 1, 1]])
    assert np.abs(ker.discretise(law, coarse).flux - merge @ fine.flux @ merge.T).max() < 1e-12
    symmetric = ker.discretise(law, ker.Bins([0.0, 1.0, np.pi - 1.0, np.pi]))
    merge = np.array([[1, 0, 0], [0, 1, 1]])
    assert np.abs(ker.discretise(law, coarse).flux - merge @ symmetric.flux @ merge.T).max() < 1e-12


def test_graded_panels_have_the_second_eigenvalue_of_the_arc() -> None:
    basis = ker.Panels.for_wall(geo.focusing_arcs(1.2), degree=3)
    matrix = ker.discretise(ker.WallLaw(geo.focusing_arcs(1.2)), basis)
    second = eigenvalues(matrix)[1]
    # from below, and by about WIDEST^6 at this degree
    assert -2e-7 < second - ARC_12_SECOND < 1e-9


# ---- traced walls and sampling -----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Bounce(ker.DrivenLaw):
    """Triangular teeth, known only by their rays."""

    closed: ker.TriangularTeethLaw = ker.TriangularTeethLaw(1.1)  # noqa: RUF009
    reversible = True

    def respond(self, x: object, theta: object) -> np.ndarray:
        return self.closed.respond(x, theta)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["auto", "qmc", "monte-carlo", "quadrature"])
@pytest.mark.parametrize("basis", [ker.Bins(24), ker.Legendre(10)], ids=repr)
def test_sampled_matrices_lie_within_their_errors(method: str, basis: ker.Basis) -> None:
    exact = ker.discretise(ker.TriangularTeethLaw(1.1), basis)
    found = ker.discretise(Bounce(), basis, method=method, samples=2**16)  # type: ignore[arg-type]
    assert found.method == ("qmc" if method == "auto" else method)
    assert found.error.kind == "estimate" and not found.tolerance_met
    assert np.linalg.norm(found.symmetric - exact.symmetric) < 2.0 * float(found.error)
    assert found.stochastic_defect() < 1e-13
    if found.method != "quadrature":
        assert abs(found.symmetry_defect().z_score) < 5.0
        assert found.samples == 2**16


@pytest.mark.parametrize("symmetrise", [False, True])
@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
@pytest.mark.parametrize("basis", [ker.Bins(12), ker.Legendre(6)], ids=repr)
def test_reported_errors_are_calibrated(basis: ker.Basis, method: str, symmetrise: bool) -> None:
    exact = ker.discretise(ker.TriangularTeethLaw(1.1), basis).symmetric
    ratios = []
    for seed in range(24):
        found = ker.discretise(
            Bounce(),
            basis,
            method=method,
            samples=4096,
            rng=np.random.default_rng(seed),
            symmetrise=symmetrise,  # type: ignore[arg-type]
        )
        ratios.append(np.sum((found.symmetric - exact) ** 2) / float(found.error) ** 2)
    # mean of squares over 24 matrices of dozens of entries each; errors from 8 replicates scatter by a quarter
    assert 0.75 < np.mean(ratios) < 1.35


def test_z_scores_of_sampled_matrices_are_those_of_noise() -> None:
    scores = {
        (method, basis): [
            ker.discretise(Bounce(), basis, method=method, samples=4096, rng=np.random.default_rng(seed))  # type: ignore[arg-type]
            .symmetry_defect()
            .z_score
            for seed in range(40)
        ]
        for method in ("qmc", "monte-carlo")
        for basis in (ker.Bins(12), ker.Legendre(6))
    }
    for found in scores.values():
        assert abs(np.mean(found)) < 0.65 and 0.6 < np.std(found) < 1.5


def test_a_law_that_is_not_reversible_is_found_out_also_when_symmetrised_by_hand() -> None:
    @dataclass(frozen=True)
    class Drift(ker.DrivenLaw):
        """Keeps the measure and moves shares of it by a tenth and a bit: not reversible."""

        def respond(self, x: object, theta: object) -> np.ndarray:
            share = np.mod(ker.SINE.cdf(theta) + 0.1 + 0.3 * np.asarray(x), 1.0)
            return ker.SINE.quantile(np.clip(share, 1e-12, 1 - 1e-12))

    for method in ("qmc", "monte-carlo"):
        found = ker.discretise(Drift(), ker.Bins(16), method=method, samples=2**14)  # type: ignore[arg-type]
        assert found.symmetry_defect().z_score > 10.0
        assert found.reversible is None
    with pytest.raises(InputError, match="not known to be reversible"):
        ker.discretise(Drift(), ker.Bins(16), symmetrise=True)


def test_symmetrised_matrices_keep_the_defect_of_the_raw_counts() -> None:
    plain, both = (
        ker.discretise(Bounce(), ker.Bins(16), "monte-carlo", samples=20_000, symmetrise=symmetrise)
        for symmetrise in (False, True)
    )
    assert np.array_equal(plain.counts, both.counts)
    assert both.symmetry_defect() == plain.symmetry_defect() > 0.01
    assert both.symmetry_defect().z_score == plain.symmetry_defect().z_score
    assert np.abs(both.flux - both.flux.T).max() == 0.0 or np.abs(both.flux - both.flux.T).max() < 1e-18
    assert np.allclose(both.flux, (plain.counts + plain.counts.T) / 40_000, rtol=1e-13, atol=0.0)
    assert 1e-4 < both.stochastic_defect() < 0.2
    assert plain.stochastic_defect() < 1e-14
    assert both.symmetrised and not plain.symmetrised


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
def test_the_same_generator_gives_the_same_bits(method: str) -> None:
    def run(seed: int) -> ker.KernelMatrix:
        rng = np.random.default_rng(seed)
        return ker.discretise(Bounce(), ker.Bins(8), method=method, samples=2**12, rng=rng)  # type: ignore[arg-type]

    assert np.array_equal(run(1).counts, run(1).counts)
    assert not np.array_equal(run(1).counts, run(2).counts)
    without = [ker.discretise(Bounce(), ker.Bins(8), method=method, samples=2**12).counts for _ in range(2)]  # type: ignore[arg-type]
    assert np.array_equal(*without)


def test_replicates_average_to_the_matrix_and_number_eight() -> None:
    for basis in (ker.Bins(12), ker.Bins(300), ker.Legendre(6)):
        found = ker.discretise(Bounce(), basis, "qmc", samples=2**15)
        assert len(found.replicates) == RANDOMISATIONS
        mean = sum(np.asarray(part.todense() if hasattr(part, "todense") else part) for part in found.replicates) / 8
        assert np.abs(mean - found.symmetric).max() < 1e-12


def test_quasi_monte_carlo_rounds_up_and_beats_monte_carlo() -> None:
    quasi = ker.discretise(Bounce(), ker.Bins(16), "qmc", samples=50_000)
    plain = ker.discretise(Bounce(), ker.Bins(16), "monte-carlo", samples=65_536)
    assert quasi.samples == 65_536
    assert float(quasi.error) < 0.35 * float(plain.error)


def test_traced_walls_agree_with_the_closed_form() -> None:
    law = ker.WallLaw(geo.triangular_teeth(0.7))
    exact, traced = (ker.discretise(law, ker.Bins(16), method=method, samples=2**15) for method in ("exact", "qmc"))
    assert exact.method == "exact" and traced.method == "qmc" and traced.unresolved <= 1e-4
    assert np.linalg.norm(exact.symmetric - traced.symmetric) < 2.0 * float(traced.error)


def test_a_wall_without_closed_form_is_sampled_and_says_so() -> None:
    law = ker.WallLaw(geo.dispersing_arcs(0.5))
    found = ker.discretise(law, ker.Bins(16), method="qmc", samples=2**14)
    assert found.method == "qmc" and "tolerance" in repr(found)
    with pytest.raises(InputError, match=r"it has .*quadrature.*monte-carlo"):
        ker.discretise(law, ker.Bins(16), method="exact")
    driven = Bounce()
    alone = ker.discretise(driven, ker.Bins(16), samples=2**14)
    mixed = ker.discretise(0.5 * driven + 0.5 * ker.lambertian(), ker.Bins(16), samples=2**14)
    assert mixed.method == "qmc + quadrature"
    assert mixed.symmetry_defect().z_score == alone.symmetry_defect().z_score
    chained = ker.discretise(driven @ driven, ker.Bins(16), samples=2**14)
    assert chained.method == "monte-carlo"


def test_rays_that_never_escape_are_counted_bounded_and_finally_refused() -> None:
    @dataclass(frozen=True)
    class Leaky(Bounce):
        lost: float = 0.0

        def outcomes(self, x: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self.respond(x, theta), x > self.lost

    whole, few = (ker.discretise(Leaky(lost=lost), ker.Bins(8), samples=2**16) for lost in (0.0, 5e-5))
    assert whole.unresolved == 0.0 < few.unresolved < 1e-4
    assert float(few.error) >= 2.0 * few.unresolved * 8
    with pytest.raises(AccuracyError, match="did not escape") as caught:
        ker.discretise(Leaky(lost=0.01), ker.Bins(8), samples=2**14)
    assert caught.value.defect == pytest.approx(0.01, rel=0.2)


def test_bins_without_rays_are_named() -> None:
    with pytest.raises(AccuracyError, match="bins have no incoming pair"):
        ker.discretise(Bounce(), ker.Bins(64), "monte-carlo", samples=64)


# ---- frames ------------------------------------------------------------------------------------------------------
LAWS = [
    ker.TriangularTeethLaw(0.7),
    ker.henyey_greenstein(0.5),
    ker.CircularArcLaw(1.2),
    ker.InvolutionLaw(shuffled),
    ker.maxwell(0.3),
]


@pytest.mark.parametrize("law", LAWS, ids=repr)
@pytest.mark.parametrize("basis", [ker.Bins(9), ker.Legendre(6)], ids=repr)
def test_the_specular_frame_of_the_law_is_that_of_its_matrix(law: ker.Law, basis: ker.Basis) -> None:
    direct = ker.discretise(law.in_specular_frame(), basis)
    turned = ker.discretise(law, basis).in_specular_frame()
    assert direct.frame == turned.frame == "specular"
    assert np.linalg.norm(direct.symmetric - turned.symmetric) <= float(direct.error) + float(turned.error) + 1e-12


@pytest.mark.parametrize("basis", [ker.Bins([0.0, 0.5, 2.0, np.pi]), ker.Panels([0.0, 1.0, np.pi], 2)], ids=repr)
def test_the_specular_frame_is_exact_in_bases_that_the_flip_does_not_keep(basis: ker.Basis) -> None:
    law = ker.henyey_greenstein(0.5).in_specular_frame()
    found = ker.discretise(law, basis)
    # P J for Henyey-Greenstein is the kernel of -g
    expected = ker.discretise(ker.henyey_greenstein(-0.5), basis)
    assert np.linalg.norm(found.symmetric - expected.symmetric) < 1e-8


# ---- arguments ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"law": "flat"}, "law: expected a law"),
        ({"basis": 12}, "basis: expected a basis"),
        ({"basis": ker.Bins(4, weight="sin2")}, "weight 'sin'"),
        ({"method": "guess"}, "method: expected one of auto"),
        ({"method": "exact"}, "it has quadrature, monte-carlo"),
        ({"method": "qmc"}, "it has quadrature, monte-carlo"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"samples": 0}, "samples"),
        ({"rng": 3}, "rng"),
        ({"law": 0.5 * ker.lambertian()}, "sum of 1"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(change: dict[str, object], message: str) -> None:
    arguments: dict[str, object] = {"law": ker.lambertian(), "basis": ker.Bins(4)}
    with pytest.raises(InputError, match=message):
        ker.discretise(**(arguments | change))  # type: ignore[arg-type]


def test_the_record_of_a_matrix_is_that_of_its_law() -> None:
    matrix = ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(4), tolerance=1e-3)
    assert matrix.law == "TriangularTeethLaw(angle=0.7)"
    assert (matrix.reversible, matrix.mirror_symmetric, matrix.frame) == (True, True, "paper")
    assert matrix.requested_tolerance == 1e-3 and matrix.tolerance_met and matrix.samples == 0
