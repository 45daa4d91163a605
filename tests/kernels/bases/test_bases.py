"""Measures, bases, grids within grids and sums of products, held to closed forms in 40 digits and laws of their own."""

from contextlib import nullcontext
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import legendre

from asperity import geometry as geo
from asperity.kernels import SINE, SINE_SQUARED, Basis, Bins, Legendre, Panels, TensorBasis
from asperity.kernels.bases import assembly as products_module
from asperity.kernels.bases import measure as weights_module
from asperity.kernels.bases import partitions as panels_module
from asperity.kernels.bases.angles import cell_among
from asperity.kernels.bases.assembly import (
    add_products,
    is_mirror_symmetric,
    largest_square_sum,
    mirror_refinement,
    one_blas_thread,
    overlaps,
    reflection_matrix,
)
from asperity.kernels.bases.measure import gauss_on_intervals, gauss_rule, measure_by_name
from asperity.kernels.bases.polynomials import Directions, legendre_moments, node_rounding
from asperity.kernels.discretisation.method import rounding

UNEVEN = [0.0, 0.4, 1.1, 2.0, np.pi]


def exact_mass(name: str, low: float, high: float) -> mpmath.mpf:
    """The antiderivative in 150 digits, of which 60 are left for angles of 1e-30."""
    with mpmath.workdps(150):
        low, high = mpmath.mpf(low), mpmath.mpf(high)
        if name == "sin":
            return (mpmath.cos(low) - mpmath.cos(high)) / 2
        return (high - low - (mpmath.sin(2 * high) - mpmath.sin(2 * low)) / 2) / mpmath.pi


def relative_errors(measure, intervals) -> np.ndarray:
    with mpmath.workdps(40):
        return np.array([float(float(measure.mass(*pair)) / exact_mass(measure.name, *pair) - 1) for pair in intervals])


@pytest.mark.parametrize("measure", [SINE, SINE_SQUARED], ids=["sin", "sin2"])
def test_masses_have_all_their_digits(measure) -> None:
    widths = [1e-9, 1e-5, 1e-3, 0.01, 0.04, 0.0499, 0.0501, 0.06, 0.2, 0.3, 0.45, 0.4999, 0.5001, 0.9, 1.04, 1.3]
    intervals = [(low, low + width) for low in (0.0, 1e-6, 0.03, 0.7, 1.5) for width in widths]
    assert np.abs(relative_errors(measure, intervals)).max() < 1e-14
    assert float(measure.mass(0.0, np.pi)) == pytest.approx(1.0, rel=1e-15)
    assert float(measure.cdf(0.3)) == float(measure.mass(0.0, 0.3))


def test_the_series_for_short_intervals_has_no_bias() -> None:
    """A term that is wrong shows in the mean of 300 rounding errors."""
    errors = relative_errors(SINE_SQUARED, [(0.0, width) for width in np.linspace(0.485, 0.4999, 300)])
    assert abs(errors.mean()) < 1.2e-16


def test_densities_at_angles_whose_sines_are_known() -> None:
    angle = np.array([np.pi / 6, np.pi / 2, 5 * np.pi / 6])
    assert SINE.density(angle) == pytest.approx([0.25, 0.5, 0.25], rel=1e-15)
    assert SINE_SQUARED.density(angle) == pytest.approx(np.array([0.25, 1.0, 0.25]) * 2 / np.pi, rel=4e-16)


@pytest.mark.parametrize("measure", [SINE, SINE_SQUARED], ids=["sin", "sin2"])
def test_quantiles_are_accurate_at_both_ends(measure) -> None:
    small = np.concatenate((np.logspace(-60, -1, 119), [0.2, 0.3, 0.45, 0.499, 0.5]))
    for fraction, angle in zip(small, measure.quantile(small), strict=True):
        miss = float(exact_mass(measure.name, 0.0, angle) - mpmath.mpf(fraction))
        assert abs(miss) < 1.2e-15 * float(measure.density(angle)) * angle
    for fraction in (1e-9, 0.01, 0.2, 0.45):
        found = float(exact_mass(measure.name, 0.0, float(measure.quantile(fraction))))
        assert found == pytest.approx(fraction, rel=2e-15, abs=0.0)
    # 1 - fraction is exact: the upper half is the mirror image of the lower one
    upper = 1.0 - np.array([2.0**-50, 2.0**-40, 2.0**-20, 0.125, 0.25, 0.4375])
    assert np.abs(np.pi - measure.quantile(upper) - measure.quantile(1.0 - upper)).max() < 9e-16
    assert measure.quantile([0.0, 1.0]).tolist() == [0.0, np.pi]


class Draws(np.random.Generator):
    """A generator whose numbers are known."""

    def random(self, size: tuple[int, ...]) -> np.ndarray:  # type: ignore[override]
        return np.resize([0.0, 0.25, 0.5, 0.75, 1.0 - 2.0**-53], size)


@pytest.mark.parametrize("measure", [SINE, SINE_SQUARED], ids=["sin", "sin2"])
def test_samples_stay_inside_the_open_interval(measure) -> None:
    sample = measure.sample(5, Draws(np.random.PCG64()))
    assert np.all((sample > 0.0) & (sample < np.pi)) and np.all(np.diff(sample) < 0.0)
    assert measure.cdf(sample) == pytest.approx([1.0, 0.75, 0.5, 0.25, 2.0**-53], rel=1e-14, abs=0.0)
    assert sample[0] == np.nextafter(np.pi, 0.0)
    assert measure.sample(0).shape == (0,)


def test_rules_integrate_polynomials_and_keep_their_nodes_inside() -> None:
    edges = np.array([0.0, 0.7, 2.5, np.pi])
    angle, weight = gauss_rule(edges, 4)
    assert angle.shape == weight.shape == (12,) and np.all(np.diff(angle) > 0.0)
    for power in range(8):
        for k, (low, high) in enumerate(pairwise(edges)):
            part = slice(4 * k, 4 * k + 4)
            exact = (high ** (power + 1) - low ** (power + 1)) / (power + 1)
            assert float(weight[part] @ angle[part] ** power) == pytest.approx(exact, rel=1e-13)
    angle, weight = SINE_SQUARED.quadrature(edges, 20)
    assert float(weight.sum()) == pytest.approx(1.0, rel=1e-14)
    assert float(weight @ np.cos(angle) ** 2) == pytest.approx(0.25, rel=1e-14)
    # intervals of no length that rounding can tell from the ends
    angle, _ = gauss_on_intervals(np.array([0.0, np.pi]), np.array([0.0, np.pi]), 3)
    assert np.all(angle > 0.0) and np.all(angle < np.pi) and angle[:3].max() < 1e-290 and angle[3:].min() > 3.14
    assert SINE.quadrature([0.0, np.pi], 1)[0] == pytest.approx([0.5 * np.pi])
    nodes = weights_module._gauss_on_unit_interval(3)
    assert not nodes[0].flags.writeable and not nodes[1].flags.writeable


def test_measures_have_names() -> None:
    assert measure_by_name("sin") is SINE and measure_by_name("sin2") is SINE_SQUARED


def exact_polynomials(n: int, angle: float, weight: str) -> list[float]:
    with mpmath.workdps(40):
        x = mpmath.cos(mpmath.mpf(angle))
        if weight == "sin":
            return [float(mpmath.sqrt(2 * k + 1) * mpmath.legendre(k, x)) for k in range(n)]
        return [float(mpmath.chebyu(k, x)) for k in range(n)]


@pytest.mark.parametrize("weight", ["sin", "sin2"])
def test_polynomials_are_those_of_forty_digits(weight: str) -> None:
    for angle in (1e-9, 1e-3, 0.4, 1.5, 1.6, 2.9, np.pi - 1e-3):
        exact = exact_polynomials(20, angle, weight)
        assert Legendre(20, weight).evaluate(angle) == pytest.approx(exact, rel=1e-13, abs=1e-13)
    assert Legendre(1, weight).evaluate(0.3).tolist() == [1.0]
    assert Legendre(3, weight).evaluate(np.full((2, 5), 1.0)).shape == (2, 5, 3)
    assert Legendre(3).evaluate([0.2, 1.0])[:, 1] == pytest.approx(np.sqrt(3.0) * np.cos([0.2, 1.0]), rel=1e-14)


@pytest.mark.parametrize("weight", ["sin", "sin2"])
def test_mirrored_angles_give_the_same_bits(weight: str) -> None:
    upper = np.pi - np.array([1e-8, 3e-4, 0.01, 0.1, 0.15, 0.2, 0.7, 1.0, 1.5])
    lower = np.pi - upper  # without rounding where the angle is beyond pi/2
    sign = (-1.0) ** np.arange(30)
    basis = Legendre(30, weight)
    assert np.array_equal(basis.evaluate(upper), sign * basis.evaluate(lower))


@pytest.mark.parametrize("weight", ["sin", "sin2"])
@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 33, 100, 200])
def test_the_nodes_of_a_basis_integrate_products_of_two_functions_and_are_few(n: int, weight: str) -> None:
    basis = Legendre(n, weight)
    angle, mass = basis.measure.quadrature(basis.edges, basis.nodes_per_interval)
    values = basis.evaluate(angle)
    assert np.abs(values.T @ (mass[:, None] * values) - np.eye(n)).max() < 4e-14
    panels = basis.edges.size - 1
    assert panels == (n + 15) // 16 and basis.edges[0] == 0.0 and basis.edges[-1] == np.pi
    assert angle.size <= 0.5 * np.pi * n + 19 * panels
    assert basis.size == n and basis.constant.tolist() == [1.0] + [0.0] * (n - 1)
    assert basis.project(np.ones_like) == pytest.approx(basis.constant, abs=1e-13)


def test_polynomials_know_their_names_and_their_halves() -> None:
    assert repr(Legendre(5)) == "Legendre(5)" and repr(Legendre(5, "sin2")) == "Legendre(5, weight='sin2')"
    assert Legendre(5) != Legendre(5, "sin2") and Legendre(5, "sin2").measure is SINE_SQUARED
    assert Legendre(5).is_polynomial and not Panels(UNEVEN, 2).is_polynomial
    assert Legendre(1).coarsened() is None
    for n, half in ((2, 1), (3, 2), (8, 4)):
        coarse, table = Legendre(n, "sin2").coarsened()
        assert coarse == Legendre(half, "sin2") and np.array_equal(table, np.eye(n)[:half])


@pytest.mark.parametrize("weight", ["sin", "sin2"])
@pytest.mark.parametrize("degree", [0, 3, 9])
def test_panels_are_orthonormal_and_local(degree: int, weight: str) -> None:
    panels = Panels(UNEVEN, degree, weight)
    width = degree + 1
    assert panels.size == 4 * width and panels.order == 2 * width
    # a rule that shares nothing with the basis
    nodes, masses = np.polynomial.legendre.leggauss(40)
    low, high = np.array(UNEVEN[:-1]), np.array(UNEVEN[1:])
    angle = (0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * nodes).ravel()
    density = 0.5 * np.sin(angle) if weight == "sin" else 2.0 / np.pi * np.sin(angle) ** 2
    mass = (0.5 * (high - low)[:, None] * masses).ravel() * density
    values = panels.evaluate(angle)
    assert np.all(values[80:120, : 2 * width] == 0.0) and np.all(values[80:120, 3 * width :] == 0.0)
    panel, local = panels.local(angle)
    assert np.array_equal(panel, np.repeat(np.arange(4), 40))
    assert np.array_equal(values.reshape(160, 4, width)[np.arange(160), panel], local)
    # leading coefficients are positive, as those of Legendre polynomials are
    series = panels.legendre_series(np.eye(panels.size)).reshape(4, width, 4, width)
    assert all(np.all(np.diagonal(series[p, :, p]) > 0.0) for p in range(4))
    table = np.polynomial.legendre.legvander(np.tile(nodes, 4), degree)
    assert np.polynomial.legendre.legvander(panels.positions(angle)[1], degree) == pytest.approx(table, abs=1e-13)
    vectors = np.random.default_rng(0).normal(size=(panels.size, 2))
    rows = panels.legendre_series(vectors)[panel]
    assert np.abs(np.einsum("ak,akc->ac", table, rows) - values @ vectors).max() < 1e-12 * width**2
    moments = np.stack([(mass * (panel == p)) @ table for p in range(4)])
    assert np.abs(panels.of_legendre(moments) - panels.constant).max() < 1e-13
    several = panels.of_legendre(np.stack([moments, 2.0 * moments, 0.0 * moments]))
    assert np.abs(several - np.outer([1.0, 2.0, 0.0], panels.constant)).max() < 2e-13


def test_panels_take_few_nodes_and_enough_of_them_on_the_widest_panel() -> None:
    for degree in (0, 1, 4, 12):
        panels = Panels([0.0, np.pi], degree, "sin2")
        assert panels.nodes_per_interval == degree + 11
        angle, mass = panels.measure.quadrature(panels.edges, panels.nodes_per_interval)
        values = panels.evaluate(angle)
        assert np.abs(values.T @ (mass[:, None] * values) - np.eye(degree + 1)).max() < 1e-12
        fine, weight = panels.measure.quadrature(panels.edges, 60)
        assert np.abs(panels.evaluate(fine).T @ (weight * np.cos(fine)) - panels.project(np.cos)).max() < 1e-13


def test_panels_know_their_names_and_their_halves() -> None:
    assert repr(Panels(UNEVEN, 2)) == "Panels(<5 edges>, 2)"
    assert repr(Panels(UNEVEN, 2, "sin2")) == "Panels(<5 edges>, 2, weight='sin2')"
    for degree, half in ((1, 0), (2, 0), (3, 1), (6, 2)):
        panels = Panels(UNEVEN, degree, "sin2")
        coarse, table = panels.coarsened()
        assert coarse == Panels(UNEVEN, half, "sin2")
        assert np.abs(table @ table.T - np.eye(coarse.size)).max() == 0.0
    coarse, table = Panels(UNEVEN, 0, "sin2").coarsened()
    assert coarse.edges.tolist() == [0.0, 1.1, np.pi] and coarse.degree == 0 and coarse.measure is SINE_SQUARED
    assert np.abs(table @ table.T - np.eye(2)).max() < 1e-15
    assert Panels([0.0, np.pi], 0).coarsened() is None


def test_panels_ask_for_the_memory_of_their_coefficients(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(panels_module, "check_memory", lambda *given: asked.append(given[-1]))
    assert asked == [Panels(UNEVEN, 4)._coefficients.size]


def near(edges: np.ndarray, angle: float) -> bool:
    return bool(np.abs(edges - angle).min() < 1e-13)


def test_panels_for_a_plain_wall_are_graded_to_grazing_alone() -> None:
    basis = Panels.for_wall(geo.triangular_teeth(1.0))
    edges = basis.edges
    # 0.35^9 < 1e-4 < 0.35^8: nine panels on either side of the middle, and no smaller ones
    assert edges[1] == pytest.approx(0.5 * np.pi * 0.35**9, rel=1e-14)
    assert np.pi - edges[-2] == pytest.approx(0.5 * np.pi * 0.35**9, rel=1e-9)
    for level in range(1, 10):
        assert near(edges, 0.5 * np.pi * 0.35**level) and near(edges, np.pi - 0.5 * np.pi * 0.35**level)
    assert near(edges, 0.5 * np.pi) and edges[-1] == np.pi and basis.degree == 6 and basis.measure is SINE
    assert np.diff(edges).max() <= np.pi / 24 * (1.0 + 1e-12)
    # the gaps wider than pi/24 are pi/2 0.65 0.35^k: they are cut into 8, 3 and 1 equal parts, those below stay whole
    assert edges.size - 1 == 2 * (8 + 3 + 8)
    assert np.ptp(np.diff(edges[(edges > 0.55) & (edges < 1.58)])) < 1e-13
    fine = Panels.for_wall(geo.triangular_teeth(1.0), degree=2, smallest=1e-8)
    assert fine.edges[1] == pytest.approx(0.5 * np.pi * 0.35**18, rel=1e-14) and fine.degree == 2


@pytest.mark.parametrize("half_angle", [0.3, 1.2])
def test_panels_for_an_arc_follow_five_kinks_and_are_graded_to_where_they_gather(half_angle: float) -> None:
    edges = Panels.for_wall(geo.focusing_arcs(half_angle)).edges
    mirrored = lambda angle: near(edges, angle) and near(edges, np.pi - angle)  # noqa: E731
    assert mirrored(half_angle)
    breakpoints = [half_angle * (1.0 + sign / n) for n in range(1, 6) for sign in (1.0, -1.0)]
    assert all(mirrored(breakpoint) for breakpoint in breakpoints if 0.0 < breakpoint < np.pi)
    assert not near(edges, half_angle * (1.0 + 1.0 / 6.0)) and not near(edges, half_angle * (1.0 - 1.0 / 6.0))
    # half way to grazing nine panels shrink towards it, and five towards the critical angle, 0.35^5 < 0.01 < 0.35^4
    half = 0.5 * half_angle
    assert edges[1] == pytest.approx(half * 0.35**9, rel=1e-14)
    assert all(mirrored(half_angle - half * 0.35**level) for level in range(1, 6))
    assert not near(edges, half_angle - half * 0.35**6)
    middle = 0.5 * np.pi - half_angle
    assert all(mirrored(half_angle + middle * 0.35**level) for level in range(1, 6)) and near(edges, 0.5 * np.pi)
    assert not near(edges, half_angle + middle * 0.35**6)
    assert np.diff(edges).min() > 1e-5 and np.diff(edges).max() <= np.pi / 24 * (1.0 + 1e-12)


def test_angles_that_nearly_coincide_are_one_edge() -> None:
    # pi/3 (1 + 1/2) is pi/2 up to rounding; at pi/2 both critical angles are one
    for half_angle in (np.pi / 3, 0.5 * np.pi, 0.5 * np.pi - 1e-7, 1e-3):
        edges = Panels.for_wall(geo.focusing_arcs(half_angle)).edges
        assert np.diff(edges).min() > 1e-5 - 1e-12 and edges[-1] == np.pi
        assert np.abs(edges - half_angle).min() < 1e-5
    plain = Panels.for_wall(geo.flat())
    assert Panels.for_wall(geo.focusing_arcs(0.5 * np.pi)) != plain
    # no circular arc of at most a quarter turn either way: nothing to follow
    two = geo.Wall(
        [piece.stretched(0.5, 0.5).moved(x, 0.0) for x in (0.0, 0.5) for piece in geo.focusing_arcs(1.2).pieces]
    )
    for wall in (geo.elliptical_arcs(1.0, geo.Disk(1.0, 0.5)), two):
        assert Panels.for_wall(wall) == plain


@pytest.mark.parametrize(
    "basis", [Bins(7), Bins(UNEVEN), Bins(UNEVEN, "sin2"), Legendre(6), Panels(UNEVEN, 2), Panels(UNEVEN, 0)], ids=repr
)
@pytest.mark.parametrize("chunk", [1, 50, 2**21])
def test_sums_of_products_are_those_of_single_pairs(basis, chunk: int, monkeypatch) -> None:
    monkeypatch.setattr(products_module, "NUMBERS_AT_ONCE", chunk)
    monkeypatch.setattr(products_module, "LARGE", chunk)
    rng = np.random.default_rng(1)
    incoming, outgoing, weight = np.pi * rng.random(40), np.pi * rng.random(40), rng.normal(size=40)
    total = np.full((basis.size, basis.size), 0.5)
    expected = total.copy()
    for theta, turned, fraction in zip(incoming, outgoing, weight, strict=True):
        expected += fraction * np.outer(basis.evaluate(theta), basis.evaluate(turned))
    add_products(total, basis, incoming, outgoing, weight)
    assert np.abs(total - expected).max() < 1e-12 * np.abs(expected).max()


def test_long_sums_are_cut_into_pieces_of_bounded_size(monkeypatch) -> None:
    assert 2**22 <= 8 * products_module.NUMBERS_AT_ONCE <= 2**26  # bytes
    assert 2**20 <= products_module.LARGE <= 2**24
    sizes = []
    monkeypatch.setattr(products_module, "NUMBERS_AT_ONCE", 30)
    monkeypatch.setattr(Legendre, "evaluate", lambda basis, angle: sizes.append(angle.size) or np.ones((angle.size, 6)))
    total = np.zeros((6, 6))
    add_products(total, Legendre(6), np.ones(12), np.ones(12), np.full(12, 0.5))
    assert sizes == [5, 5, 5, 5, 2, 2] and np.all(total == 6.0)


def test_cells_of_angles_and_overlaps_with_known_functions() -> None:
    angle = np.array([0.0, 0.4, 0.5, 2.0, 3.0, np.pi])
    assert Bins(UNEVEN).index(angle).tolist() == [0, 1, 1, 3, 3, 3]
    assert Bins(2).index(angle).tolist() == [0, 0, 0, 1, 1, 1]
    assert Panels(UNEVEN, 1).index(angle).tolist() == [0, 1, 1, 3, 3, 3]
    # <1, cos> = 0, <sqrt(3) cos, cos> = 1 / sqrt(3); <1, cos^2> = 1/3, <P_2, cos^2> = 2 / (3 sqrt(5))
    found = overlaps(
        Legendre(3), lambda theta: np.stack([np.cos(theta), np.cos(theta) ** 2], axis=-1), [0.0, 1.0, np.pi]
    )
    exact = [[0.0, 1.0 / 3.0], [1.0 / np.sqrt(3.0), 0.0], [0.0, 2.0 / (3.0 * np.sqrt(5.0))]]
    assert np.abs(found - exact).max() < 1e-14


def test_products_run_on_one_thread_of_the_linear_algebra() -> None:
    from threadpoolctl import ThreadpoolController

    threads = lambda: {entry["num_threads"] for entry in ThreadpoolController().select(user_api="blas").info()}  # noqa: E731
    with ThreadpoolController().limit(limits=3, user_api="blas"):
        outside = threads()
        with one_blas_thread():
            assert threads() == {1}
        assert threads() == outside


def test_the_largest_sum_of_squares_is_that_of_the_orthogonal_polynomials_at_an_end() -> None:
    # sum of 2 l + 1, sum of (l + 1)^2, and 1 over the smallest mass
    assert largest_square_sum(Legendre(5)) == pytest.approx(25.0, rel=1e-14)
    assert largest_square_sum(Legendre(5, "sin2")) == pytest.approx(55.0, rel=1e-14)
    narrow = float(exact_mass("sin", 1.0, 1.3))
    assert largest_square_sum(Bins([0.0, 1.0, 1.3, np.pi])) == pytest.approx(1.0 / narrow, rel=1e-14)


# the narrow panel's sum is largest at its right end, which is the next panel's left one; then at 0, and at pi
ENDS = Panels([0.0, 1.8, 2.1, np.pi], 2), Panels([0.0, 0.3, np.pi], 2), Panels([0.0, 2.9, np.pi], 1)


@pytest.mark.parametrize("basis", [*ENDS, Legendre(4), Legendre(4, "sin2"), Bins(UNEVEN), Directions()])
def test_the_largest_sum_of_squares_is_attained_and_exceeded_nowhere(basis: Basis) -> None:
    inner = basis.edges[1:-1]
    angle = np.concatenate((np.linspace(1e-9, np.pi - 1e-9, 10_001), inner + 1e-9, inner - 1e-9))
    found = np.sum(basis.evaluate(angle) ** 2, axis=-1).max()
    assert found <= largest_square_sum(basis) * (1.0 + 1e-14)
    assert found >= largest_square_sum(basis) * (1.0 - 1e-6)


def test_moments_of_polynomials_are_sums_of_weights_times_polynomials():
    local = np.array([[-0.9, 0.3, 0.75], [0.1, -0.4, 0.6]])
    weight = np.array([[0.5, 2.0, -1.0], [1.0, 0.25, 3.0]])
    for degree in (0, 1, 6):
        exact = [(weight * np.polynomial.Legendre.basis(k)(local)).sum(axis=1) for k in range(degree + 1)]
        found = legendre_moments(local.ravel(), weight.ravel(), degree, np.repeat([0, 1], 3), 2)
        assert found.shape == (degree + 1, 2) and np.abs(found - exact).max() < 1e-14


BASES = [*ENDS, Panels([0.0, np.pi], 12), Legendre(1), Legendre(6), Legendre(6, "sin2"), Bins(UNEVEN), Directions()]


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_magnitudes_are_exceeded_nowhere(basis: Basis) -> None:
    largest, weighted = basis.magnitudes()
    assert largest.shape == weighted.shape == (basis.edges.size - 1,)
    angle = np.linspace(1e-9, np.pi - 1e-9, 10_001)
    cell = cell_among(basis.edges, angle)
    found = np.sqrt(np.sum(basis.evaluate(angle) ** 2, axis=-1))
    assert np.all(found <= largest[cell] * (1.0 + 1e-8))
    assert np.all(found * np.sqrt(np.sin(angle)) <= weighted[cell])
    # neither is larger than needed by more than the factor of Bernstein's inequality
    assert largest.max() <= found.max() * (1.0 + 1e-6)
    if np.isfinite(weighted).all():
        assert weighted.max() <= 1.25 * (found * np.sqrt(np.sin(angle))).max()


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_derivative_norms_are_those_of_differences(basis: Basis) -> None:
    # the default of all bases, against the closed forms of polynomials and bins
    assert basis.derivative_norm() == pytest.approx(Basis.derivative_norm(basis), rel=1e-7, abs=1e-12)


def test_the_derivative_norm_of_panels_is_that_of_the_derivatives_of_their_polynomials() -> None:
    # on one panel the sums over e_i of the squared slopes are the trace of the Gram matrix of the slopes of powers
    basis = Panels([0.0, np.pi], 2)
    angle, weight = basis.measure.quadrature(basis.edges, 20)
    powers = np.stack([np.ones_like(angle), angle, angle**2], axis=1)
    slopes = np.stack([np.zeros_like(angle), np.ones_like(angle), 2.0 * angle], axis=1)
    gram, of_slopes = (table.T @ (weight[:, None] * table) for table in (powers, slopes))
    assert basis.derivative_norm() == pytest.approx(np.trace(np.linalg.solve(gram, of_slopes)) ** 0.5, rel=1e-8)


def test_the_derivative_norm_of_polynomials_is_the_root_of_their_eigenvalues() -> None:
    # l (l + 1) for l = 0, 1, 2, and l (l + 2)
    assert Legendre(3).derivative_norm() == pytest.approx(8.0**0.5)
    assert Legendre(3, "sin2").derivative_norm() == pytest.approx(11.0**0.5)


@pytest.mark.parametrize("basis", [Panels([0.0, 1.0, 1.0 + 1e-3, np.pi], 3), Legendre(12)], ids=repr)
def test_displaced_nodes_change_a_matrix_by_at_most_the_derivative_norm(basis: Basis) -> None:
    shift = 1e-8
    angle, weight = basis.measure.quadrature(basis.edges, basis.nodes_per_interval)
    before, after = basis.evaluate(angle), basis.evaluate(angle + shift)
    change = np.linalg.norm((before * weight[:, None]).T @ (after - before))
    assert 0.1 * shift * basis.derivative_norm() < change <= shift * basis.derivative_norm()
    assert node_rounding(basis) == pytest.approx(2.0 * np.finfo(float).eps * basis.derivative_norm())
    assert rounding(basis) > node_rounding(basis)


def test_blas_is_limited_to_one_thread_only_for_products_that_it_would_divide(monkeypatch):
    limits = []
    monkeypatch.setattr(products_module, "one_blas_thread", lambda: limits.append(1) or nullcontext())
    for number, limited in ((2**16, 0), (2**17, 1)):
        theta = np.linspace(0.1, 3.0, number)
        total = np.zeros((2, 2))
        add_products(total, Legendre(2), theta, theta, np.ones(number))
        assert len(limits) == limited and total[0, 0] == number


EVERY_BASIS = [
    Bins(1),
    Bins(7),
    Bins(8),
    Bins([0.0, 0.3, 2.0, np.pi]),
    Bins(9, weight="sin2"),
    Legendre(1),
    Legendre(40),
    Legendre(30, weight="sin2"),
    Panels([0.0, 0.01, 1.0, 2.0, np.pi], 5),
    Panels([0.0, 1.0, 2.0, np.pi], 0),
    Panels([0.0, 1.0, np.pi], 3, weight="sin2"),
]
# e_i e_j reaches the size of the basis and is integrated by as many rounded terms.
ROUNDING = 1e-13


def uniform_rule(basis: Basis) -> tuple[np.ndarray, np.ndarray]:
    """Gauss nodes that share nothing with the basis but its edges."""
    edges = np.unique(np.concatenate((basis.edges, np.linspace(0.0, np.pi, 12))))
    nodes, weights = legendre.leggauss(30)
    centre, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    angle = (centre[:, None] + half[:, None] * nodes).ravel()
    density = 0.5 * np.sin(angle) if basis.measure.name == "sin" else 2.0 / np.pi * np.sin(angle) ** 2
    return angle, (half[:, None] * weights).ravel() * density


@pytest.mark.parametrize("basis", EVERY_BASIS, ids=repr)
def test_every_basis_is_orthonormal_for_its_measure(basis: Basis) -> None:
    angle, weight = uniform_rule(basis)
    values = basis.evaluate(angle)
    assert np.abs(values.T @ (weight[:, None] * values) - np.eye(basis.size)).max() < ROUNDING


@pytest.mark.parametrize("basis", EVERY_BASIS, ids=repr)
def test_the_constant_has_the_declared_coefficients_and_weights_sum_to_one(basis: Basis) -> None:
    assert np.abs(basis.evaluate([0.2, 1.5, 3.0]) @ basis.constant - 1.0).max() < ROUNDING
    assert abs(basis.weights.sum() - 1.0) < ROUNDING
    assert np.abs(basis.project(np.ones_like) - basis.constant).max() < ROUNDING


@pytest.mark.parametrize("basis", [b for b in EVERY_BASIS if b.size > 1], ids=repr)
def test_coarsened_bases_are_subspaces(basis: Basis) -> None:
    coarse = basis.coarsened()
    assert coarse is not None
    angle = np.linspace(0.05, 3.1, 40)
    small, table = coarse
    assert 0.4 * basis.size <= small.size <= 0.67 * basis.size
    assert np.abs(table @ table.T - np.eye(small.size)).max() < ROUNDING
    scale = np.abs(small.evaluate(angle)).max()
    assert np.abs(small.evaluate(angle) - basis.evaluate(angle) @ table.T).max() < ROUNDING * scale


def test_equal_bins_are_equal_in_the_cosine() -> None:
    assert np.allclose(np.cos(Bins(10).edges), np.linspace(1.0, -1.0, 11), rtol=0.0, atol=4e-16)
    assert np.allclose(Bins(10).weights, 0.1, rtol=4e-15, atol=0.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 300), st.floats(1e-12, np.pi - 1e-12))
def test_the_quick_search_finds_the_bin_whose_edges_hold_the_angle(n: int, angle: float) -> None:
    bins = Bins(n)
    index = int(bins.index(angle))
    assert bins.edges[index] <= angle < bins.edges[index + 1]


@pytest.mark.parametrize("n", [1, 2, 3, 64, 511, 512])
def test_edges_themselves_belong_to_the_bin_on_their_right(n: int) -> None:
    bins = Bins(n)
    assert bins.index(bins.edges[:-1]).tolist() == list(range(n))
    assert int(bins.index(np.pi)) == n - 1
    lower = bins.edges[: (n + 1) // 2]
    assert np.array_equal(bins.edges[::-1][: (n + 1) // 2], np.pi - lower)


def test_high_degrees_stay_accurate_next_to_grazing() -> None:
    # P_l(cos t) = 1 - l (l + 1) t^2 / 4 + O((l t)^4): the recurrence in cos t would lose it below t = 1e-8
    angle, degree = 1e-7, 400
    value = Legendre(degree + 1).evaluate(angle)[degree] / np.sqrt(2 * degree + 1.0)
    assert value == pytest.approx(1.0 - degree * (degree + 1) * angle**2 / 4.0, abs=1e-15)


@pytest.mark.parametrize("basis", [b for b in EVERY_BASIS if b.measure == SINE], ids=repr)
def test_the_flip_matrix_is_that_of_the_flip(basis: Basis) -> None:
    angle, weight = uniform_rule(basis)
    angle = np.sort(np.concatenate((angle, np.pi - angle)))
    edges = np.unique(np.concatenate((basis.edges, np.pi - basis.edges)))
    fine, weight = SINE.quadrature(edges, 40)
    expected = basis.evaluate(fine).T @ (weight[:, None] * basis.evaluate(np.pi - fine))
    assert np.abs(reflection_matrix(basis) - expected).max() < 1e-12
    finer, restriction = mirror_refinement(basis)
    assert is_mirror_symmetric(finer)
    # the flip of the finer basis, restricted, is the flip's Galerkin matrix
    assert np.abs(restriction @ reflection_matrix(finer) @ restriction.T - expected).max() < 1e-12


def test_tensor_bases_are_products_with_the_last_angle_fastest() -> None:
    theta, psi = Bins(3), Legendre(4, weight="sin2")
    basis = TensorBasis((theta, psi))
    value = basis.evaluate([[1.0, 0.5]])[0]
    assert np.array_equal(value, np.outer(theta.evaluate(1.0), psi.evaluate(0.5)).ravel())
    coefficients = basis.project(lambda point: np.cos(point[..., 0]) * np.cos(point[..., 1]))
    assert np.allclose(coefficients, np.kron(theta.project(np.cos), psi.project(np.cos)), atol=1e-14)
    assert TensorBasis((basis, theta)).factors == (theta, psi, theta)
    assert not basis.is_partition
    assert TensorBasis((Bins(2), Bins(2))).is_partition
    coarse = basis.coarsened()
    assert coarse is not None and coarse[1].shape == (2 * 2, 12)


def test_equality_is_that_of_the_functions() -> None:
    assert Bins(4) == Bins(Bins(4).edges)
    assert Bins(4) != Bins(4, weight="sin2")
    assert Legendre(3) != Legendre(4)
    assert Legendre(3) != Legendre(3, weight="sin2") and hash(Legendre(3)) != hash(Legendre(3, weight="sin2"))
    assert Panels([0, 1, np.pi], 2) != Panels([0, 1, np.pi], 3)
    assert Panels([0, 1, np.pi], 2) != Panels([0, 1, np.pi], 2, weight="sin2")
    assert Panels([0, 1, np.pi], 2) == Panels([0, 1, np.pi], 2)
    assert len({Bins(4), Bins(Bins(4).edges), Legendre(4)}) == 2


def test_bases_are_immutable() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Bins(4).edges[0] = 1.0
    with pytest.raises(AttributeError):
        Legendre(4).n = 5  # type: ignore[misc]
