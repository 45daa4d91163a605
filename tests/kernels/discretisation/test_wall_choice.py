"""Which method `auto` takes for the matrix of a wall: isometries, first rays, conditional distributions or all rays."""

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import random_curved_wall

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.bench.quantities import wall_of
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import FIRST_RAYS, traced_matrix
from asperity.kernels.sampling.sobol import SobolSampler

# A rough profile of 200 pieces, whose beams resolve completely, and a curve whose beams never do.
PROFILE = geo.Wall.from_vertices(
    np.column_stack([np.linspace(0.0, 1.0, 201), [0.0, *-0.02 * np.random.default_rng(5).random(199), 0.0]])
)
KOCH = geo.koch(4)
MUSHROOMS = ker.WallLaw(geo.mushrooms(0.3, 0.5))
FORESHORTENED = geo.focusing_arcs(1.2).foreshorten(geo.Disk(1.0, 0.5))
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-8)


@pytest.mark.parametrize(
    ("wall", "basis"),
    [
        (FORESHORTENED, ker.Legendre(2)), (geo.dispersing_arcs(1.0), ker.Legendre(12)),
        (geo.dispersing_arcs(2.0), ker.Bins(16)), (geo.mushrooms(0.3, 0.5), ker.Legendre(2)),
        (wall_of("mixed"), ker.Legendre(2)), (random_curved_wall(6), ker.Bins(16)), (geo.koch(3), ker.Legendre(2)),
    ],
    ids=["flat arc", "dispersing", "cusps", "mushrooms", "mixed", "random", "koch"],
)  # fmt: skip
def test_the_reported_error_never_grows_when_the_tolerance_falls(wall, basis):
    law = ker.WallLaw(wall)
    errors = [float(ker.discretise(law, basis, tolerance=tolerance).error) for tolerance in TOLERANCES]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("basis", [ker.Legendre(2), ker.Bins(16)], ids=repr)
def test_a_smaller_tolerance_continues_the_quadrature_to_a_larger_one(basis):
    found = [traced_matrix(FORESHORTENED, basis, Budget(tolerance, segments=10**6)) for tolerance in TOLERANCES]
    errors, rays = [error for _, error, _ in found], [number for *_, number in found]
    assert errors == sorted(errors, reverse=True) and rays == sorted(rays)


@pytest.mark.parametrize("basis", [ker.Legendre(2), ker.Bins(16)], ids=repr)
def test_a_rough_matrix_takes_the_first_rays_and_keeps_its_tolerance(basis):
    rough = ker.discretise(MUSHROOMS, basis, tolerance=1e-2)
    fine = ker.discretise(MUSHROOMS, basis, method="qmc")
    assert rough.samples == FIRST_RAYS < fine.samples and float(rough.error) <= 1e-2
    assert np.linalg.norm(rough.symmetric - fine.symmetric) <= 2.0 * (float(rough.error) + float(fine.error))


def test_all_rays_continue_the_first_ones_and_are_those_asked_for_by_name():
    basis, generators = ker.Legendre(2), [np.random.default_rng(5) for _ in range(2)]
    law = ker.WallLaw(KOCH)
    chosen = ker.discretise(law, basis, tolerance=1e-5, rng=generators[0])
    named = ker.discretise(law, basis, method="qmc", rng=generators[1])
    # but for the order of sums
    assert chosen.method == "qmc" and np.allclose(chosen.symmetric, named.symmetric, rtol=0.0, atol=1e-15)


def test_rays_that_continue_a_run_are_traced_at_once(monkeypatch):
    traced, reflect = [], ker.WallLaw.reflect_with_status

    def counted(law, x, theta):
        traced.append(np.size(x))
        return reflect(law, x, theta)

    monkeypatch.setattr(ker.WallLaw, "reflect_with_status", counted)
    sampler = SobolSampler(MUSHROOMS, ker.Legendre(2), np.random.default_rng(0))
    for number in (2**11, 2**14):
        sampler.sampled(number, symmetrise=False)
    assert traced == [2**11, 2**14 - 2**11]


def test_a_profile_of_many_pieces_takes_rays_for_a_rough_answer_and_isometries_for_an_exact_one():
    law, basis = ker.WallLaw(PROFILE), ker.Legendre(2)
    rough, exact = (ker.discretise(law, basis, tolerance=tolerance) for tolerance in (1e-2, 1e-9))
    assert (rough.method, exact.method) == ("qmc", "exact") and "_known" in vars(law)
    assert float(rough.error) <= 1e-2 and float(exact.error) <= 1e-9
    # Student's distribution with 7 degrees of freedom exceeds 6 standard errors, 2.5 half widths, once in 2000 times
    assert abs(rough.symmetric[1, 1] - exact.symmetric[1, 1]) <= 2.5 * float(rough.error)


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
def test_rays_that_are_asked_for_do_not_look_for_isometries(method):
    law = ker.WallLaw(KOCH)
    assert ker.discretise(law, ker.Legendre(2), method, samples=1024).method == method
    assert "_known" not in vars(law)


def test_isometries_that_leave_too_much_give_way_to_rays():
    found = ker.discretise(ker.WallLaw(KOCH), ker.Legendre(2), samples=2**14)
    assert found.method == "qmc" and found.samples == 2**14


def test_few_pieces_are_done_by_isometries_whatever_the_tolerance():
    wall = geo.Wall.from_vertices([(0, 0), (0.3, -0.2), (0.6, -0.1), (1, 0)])
    assert ker.discretise(ker.WallLaw(wall), ker.Bins(8), tolerance=0.1).method == "exact"


@pytest.mark.parametrize(("name", "bins"), [("cusps", 64), ("random-15", 128)])
def test_quadrature_is_not_begun_where_its_first_panels_would_take_too_long(name, bins, monkeypatch):
    monkeypatch.setattr(
        "asperity.kernels.discretisation.traced.traced_matrix", lambda *a: pytest.fail("quadrature was begun")
    )
    assert ker.discretise(ker.WallLaw(wall_of(name)), ker.Bins(bins)).method == "qmc"


@pytest.mark.parametrize(("wall", "most"), [(geo.mushrooms(0.3), 0.01), (wall_of("random-17"), 0.5)], ids=repr)
def test_cells_of_few_pieces_are_more_exact_by_quadrature(wall, most):
    law, basis = ker.WallLaw(wall), ker.Bins(16)
    chosen, rays = (ker.discretise(law, basis, method=how) for how in ("auto", "qmc"))
    assert chosen.method == "quadrature" and float(chosen.error) <= most * float(rays.error)
    # Student's distribution, as above
    assert np.linalg.norm(chosen.symmetric - rays.symmetric) <= 2.5 * float(rays.error)


@pytest.mark.slow
def test_pieces_that_only_the_asymmetry_shows_are_looked_for_without_dividing_all_panels():
    wall = geo.Wall([geo.Bezier([(0, 0), (0.2, -1.6), (0.8, -1.6), (1, 0)])])
    _, error, rays = traced_matrix(wall, ker.Bins(64), Budget(1.37e-4))
    # 4 million rays if the panels are divided until one meets the piece
    assert error <= 1.37e-4 and rays < 2.5e6


@pytest.mark.parametrize("basis", [ker.Legendre(4), ker.Bins(16)], ids=repr)
def test_a_wall_in_the_other_frame_has_the_error_that_it_has_in_its_own(basis):
    law = ker.WallLaw(wall_of("cusps"))
    own, other = (ker.discretise(one, basis) for one in (law, law.in_specular_frame()))
    assert float(other.error) == float(own.error) and other.samples == own.samples
    assert np.array_equal(other.symmetric, own.in_specular_frame().symmetric)
    assert np.allclose(np.array(other.replicates), np.array(own.in_specular_frame().replicates))


def test_a_wall_of_different_hollows_is_the_sum_of_them_whatever_the_tolerance():
    law, basis = ker.WallLaw(wall_of("mixed")), ker.Legendre(2)
    rough, fine = (ker.discretise(law, basis, tolerance=tolerance) for tolerance in (4e-3, 1e-6))
    assert float(rough.error) <= 4e-3
    assert "exact" in fine.method and abs(rough.symmetric[1, 1] - fine.symmetric[1, 1]) <= 2.5 * float(rough.error)


def test_where_few_rays_are_allowed_the_more_exact_matrix_is_returned():
    law, basis = ker.WallLaw(random_curved_wall(6)), ker.Legendre(4)
    chosen, rays = (ker.discretise(law, basis, method=how, tolerance=1e-6, samples=2**13) for how in ("auto", "qmc"))
    assert float(chosen.error) <= float(rays.error)
