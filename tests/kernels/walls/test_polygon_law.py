"""Exact laws of polygonal walls: against closed forms, traced rays, and what must hold for every wall."""

import math

import numpy as np
import pytest
from campaigns.judges.precise_triangular import ANGLE, BINS, reference

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.discretisation.isometries import branch_matrix, table_matrix
from asperity.kernels.walls.polygons import table_of_beams
from asperity.kernels.walls.wall_law import isometries

EPS = float(np.finfo(np.float64).eps)
SKEW = [(0, 0), (0.3, -0.5), (1, 0)]
STEP = [(0, 0), (0.2, 0), (0.2, -0.5), (1, -0.5), (1, 0)]
SPIKED = [(0, 0), (0.2, -0.7), (0.5, -0.2), (0.6, -0.9), (0.8, 0), (1, 0)]
OVERHANG = [(0, 0), (0.4, 0), (0.3, -0.4), (0.9, -0.5), (1, 0)]
DOVETAIL = [(0, 0), (0.4, 0), (0.3, -0.4), (0.9, -0.5), (0.8, 0), (1, 0)]
WALLS = {"skew": SKEW, "step": STEP, "spiked": SPIKED, "overhang": OVERHANG}
BASES = [
    ker.Bins(48),
    ker.Bins([0.0, 0.02, 0.4, 1.1, 2.0, 3.1, math.pi]),
    ker.Legendre(24),
    ker.Panels([0.0, 0.05, 0.3, 0.9, 1.5, 2.2, 2.9, math.pi], 4),
]


def law_of(name: str) -> ker.PolygonLaw:
    return ker.PolygonLaw(geo.Wall.from_vertices(WALLS[name]))


# ---- tables of laws in closed form ----------------------------------------------------------------------------------
@pytest.mark.parametrize("psi", [1e-3, 0.05, 0.7, math.pi / 3, math.pi / 2, 2.0, 2.9, math.pi - 1e-4])
def test_the_table_of_triangular_teeth_is_their_law(psi: float) -> None:
    law = ker.TriangularTeethLaw(psi)
    table = law.isometry_table()
    assert table is not None and table.mass() == pytest.approx(1.0, abs=1e-14)
    theta = np.concatenate([[1e-9, 1e-4, math.pi - 1e-4], np.random.default_rng(1).uniform(0.001, 3.14, 500)])
    (fraction, angle), (expected, outgoing) = table.branches(theta), law.branches(theta)
    assert np.abs(fraction.sum(axis=-1) - 1.0).max() < 1e-14
    # next to a kink, known to a few ulps, a probability is known to an ulp over the width of its interval
    for k in (1, 2, 5):
        found, wanted = (fraction * np.cos(k * angle)).sum(-1), (expected * np.cos(k * outgoing)).sum(-1)
        assert np.abs(found - wanted).max() < 1e-13 + 64.0 * EPS / psi


@pytest.mark.parametrize("psi", [0.05, 0.7, math.pi / 2, 2.9])
@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_matrices_from_the_table_are_those_of_quadrature_between_kinks(psi: float, basis: ker.Basis) -> None:
    law = ker.TriangularTeethLaw(psi)
    found = ker.discretise(law, basis)
    reference, error = branch_matrix(law, basis, 0.0)
    assert found.method == "exact" and error < 1e-11
    assert np.linalg.norm(found.symmetric - reference) < 2e-13
    assert np.linalg.norm(found.symmetric - found.symmetric.T) < 2e-13


@pytest.mark.parametrize("r", [1e-6, 0.5, 40.0, 1e8])
def test_polygons_that_are_teeth_have_the_laws_of_teeth(r: float) -> None:
    basis = ker.Bins(32)
    wall = geo.rectangular_teeth(r)
    for law in (ker.PolygonLaw(wall), ker.PolygonLaw(wall.mirrored()), ker.PolygonLaw(wall.scaled(7.0))):
        found = ker.discretise(law, basis).symmetric
        assert np.linalg.norm(found - ker.discretise(ker.RectangularTeethLaw(r), basis).symmetric) < 1e-13
        theta = np.array([0.3, 1.0, 2.7])
        wanted = ker.RectangularTeethLaw(r).apply(np.cos, theta)
        assert np.allclose(law.apply(np.cos, theta), wanted, atol=1e-14 * max(1.0, r))
    assert float(ker.PolygonLaw(wall).unresolved) == 0.0


# ---- laws of polygons -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", WALLS)
def test_probabilities_sum_to_one_and_are_linear_in_the_cotangent_between_kinks(name: str) -> None:
    law = law_of(name)
    theta = np.random.default_rng(2).uniform(0.01, 3.13, 2000)
    probability, outgoing = law.branches(theta)
    assert np.abs(probability.sum(axis=-1) - 1.0).max() < 1e-14
    assert law.isometry_table().mass() == pytest.approx(1.0, abs=1e-13)
    assert probability.min() >= 0.0 and outgoing.min() > 0.0 and outgoing.max() < math.pi
    breakpoints, left_out = law.breakpoints(10**6)
    assert left_out < 0.1
    edges = np.concatenate([[0.05], breakpoints[(breakpoints > 0.05) & (breakpoints < 3.09)], [3.09]])
    width = np.diff(edges)
    inside = edges[:-1] + np.array([[0.2], [0.5], [0.8]]) * width
    inside = inside[:, width > 1e-6]
    fraction = law.branches(inside)[0]
    low, middle, high = np.cos(inside) / np.sin(inside)
    weight = ((middle - low) / (high - low))[:, None]
    assert np.abs((1.0 - weight) * fraction[0] + weight * fraction[2] - fraction[1]).max() < 1e-11


def test_different_hollows_add_up_by_their_widths_and_equal_ones_are_computed_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from asperity.kernels.walls import polygons

    calls: list[int] = []
    whole = polygons.beams_of

    def counted(chain: np.ndarray, **limits: float) -> object:
        calls.append(len(chain))
        return whole(chain, **limits)

    monkeypatch.setattr(polygons, "beams_of", counted)
    skew, mirrored = [(0.3, -0.5), (1.0, 0.0)], [(1.7, -0.5), (2.0, 0.0)]
    large, other = [(2.6, -1.0), (4.0, 0.0)], [(4.2, -0.9), (4.5, -0.1), (5.0, 0.0)]
    wall = geo.Wall.from_vertices([(0.0, 0.0), *skew, *mirrored, *large, *other, (6.0, 0.0)])
    basis = ker.Legendre(12)
    found = ker.discretise(ker.PolygonLaw(wall), basis).symmetric
    assert calls == [3, 3, 4]
    alone = ker.PolygonLaw(geo.Wall.from_vertices(SKEW))
    mirrored_angle = ker.PolygonLaw(geo.Wall.from_vertices(SKEW).mirrored())
    last = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.2, -0.9), (0.5, -0.1), (1, 0)]))
    total = (3.0 * alone + mirrored_angle + last + ker.specular()) * (1.0 / 6.0)
    assert np.linalg.norm(found - ker.discretise(total, basis).symmetric) < 1e-12


def test_what_is_not_resolved_is_sent_back_and_reported() -> None:
    wall = geo.Wall.from_vertices(DOVETAIL)
    rough, fine = ker.PolygonLaw(wall, max_beams=100), ker.PolygonLaw(wall, max_beams=10_000)
    assert float(rough.unresolved) > 1e-5 > 10.0 * float(fine.unresolved) and rough.unresolved.kind == "bound"
    for basis in BASES:
        found, exact = ker.discretise(rough, basis), ker.discretise(fine, basis)
        assert np.linalg.norm(found.symmetric @ basis.constant - basis.constant) < 1e-12
        assert np.linalg.norm(found.symmetric - exact.symmetric) <= float(found.error) + float(exact.error)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_the_tolerance_bounds_the_unresolved_flux_of_the_whole_wall(tolerance: float) -> None:
    law = ker.PolygonLaw(geo.koch(3), tolerance=tolerance, max_beams=10**7)
    assert 0.1 * tolerance < float(law.unresolved) <= tolerance


def test_few_angles_are_answered_as_many() -> None:
    theta = np.random.default_rng(6).uniform(0.01, 3.13, 3)
    law, same = (ker.PolygonLaw(geo.koch(2), max_beams=3000) for _ in range(2))
    at_once, _ = same.branches(np.concatenate([theta, np.linspace(0.1, 3.0, 500)]))
    for k, angle in enumerate(theta):
        probability, _ = law.branches(angle)
        assert np.array_equal(probability, at_once[k][: probability.size]) and not at_once[k][probability.size :].any()


def test_signs_from_the_table_are_those_found_by_probing() -> None:
    theta = np.linspace(0.2, 3.0, 40)
    for law in (ker.TriangularTeethLaw(0.7), ker.RectangularTeethLaw(3.0)):
        probability, sign, offset = isometries(law, theta)
        image = sign * theta[:, None] + offset
        fraction, outgoing = law.branches(theta)
        for k in (1, 3):
            assert np.allclose((probability * np.cos(k * image)).sum(-1), (fraction * np.cos(k * outgoing)).sum(-1))
    frame = ker.TriangularTeethLaw(0.7).in_specular_frame().isometry_table()
    assert frame is not None
    fraction, outgoing = frame.branches(theta)
    wanted = ker.TriangularTeethLaw(0.7).in_specular_frame().apply(np.cos, theta)
    assert np.allclose((fraction * np.cos(outgoing)).sum(-1), wanted, atol=1e-13)
    assert ker.lambertian().isometry_table() is None


def test_the_largest_hollow_tells_first_that_beams_do_not_resolve():
    law = ker.PolygonLaw(geo.koch(4), max_beams=2_000)
    assert not law.resolves(1e-4) and len(law._known) == 1
    assert law.resolves(1.0) and len(law._known) == len(law._shapes) > 1
    assert float(law.unresolved) > 1e-4
    # the tables that are known are used
    known = dict(law._known)
    assert law.isometry_table() is law.isometry_table() and all(law._known[key] is known[key] for key in known)


def _closed_form(bins: ker.Bins) -> np.ndarray:
    return ker.discretise(ker.TriangularTeethLaw(ANGLE), bins).symmetric


def _beams(bins: ker.Bins) -> np.ndarray:
    vertices = geo.triangular_teeth(ANGLE).vertices
    return table_matrix(table_of_beams(beams_of(vertices)), bins)[0]


@pytest.fixture(scope="module")
def precise() -> np.ndarray:
    return reference()


@pytest.mark.parametrize("made", [_closed_form, _beams], ids=["closed form", "beams"])
def test_triangular_teeth_on_512_bins_are_right_to_1e_13_as_an_operator(made, precise) -> None:
    miss = made(ker.Bins(BINS)) - precise
    # an ulp of an end of one of 2424 masses, as a fraction of a bin: each of them less than 1e-13, together more
    assert np.abs(miss).max() < 1e-13
    assert np.linalg.norm(miss, 2) < 1.2e-13
    assert np.linalg.norm(miss) < float(ker.discretise(ker.TriangularTeethLaw(ANGLE), ker.Bins(BINS)).error)


def test_the_40_digits_of_joined_bins_are_those_of_wider_bins(precise) -> None:
    few = reference(size=16)
    # the edges of 16 bins are among those of 512, and all bins weigh the same
    joined = precise.reshape(16, BINS // 16, 16, BINS // 16).sum((1, 3)) * 16 / BINS
    assert np.abs(few - joined).max() < 1e-14
    assert np.abs(few - _closed_form(ker.Bins(16))).max() < 1e-14
