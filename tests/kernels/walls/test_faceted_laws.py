"""Walls whose facets have a law of their own: limits, hits, two scales, view factors against closed forms, refusals."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AccuracyError, InputError
from asperity.kernels.discretisation.radiosity import has_radiosity
from asperity.kernels.walls.faceted_law import follow_facets
from wall_shapes import CLOSED

ARCS, TEETH, RIGHT = geo.focusing_arcs(1.0), geo.triangular_teeth(0.9), geo.triangular_teeth(np.pi / 2.0)
LEANING = geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (0.8, 0), (1, 0)])


@pytest.mark.parametrize("wall", [ARCS, TEETH, LEANING, geo.flat()], ids=repr)
def test_mirrors_have_the_parts_of_the_wall_retroreflectors_are_ideal_and_a_flat_wall_has_the_facets_law(wall) -> None:
    mirrors = ker.FacetedLaw(wall, 1.0 * ker.specular())
    assert mirrors.parts == ker.WallLaw(wall).parts
    back = ker.FacetedLaw(wall, ker.retroreflection())
    assert back.parts == ((1.0, ker.retroreflection()),) and back.mirror_symmetric and float(back.sample(0.3)) == 0.3
    bins = ker.Bins(8)
    assert np.array_equal(ker.discretise(mirrors, bins).array, ker.discretise(ker.WallLaw(wall), bins).array)
    if wall == geo.flat():
        law = ker.FacetedLaw(wall, ker.maxwell(0.3))
        assert law.parts == ((1.0, ker.maxwell(0.3)),)
        assert np.array_equal(ker.discretise(law, bins).array, ker.discretise(ker.maxwell(0.3), bins).array)


@pytest.mark.parametrize("name", ["triangular-teeth", "several hollows", "koch", "valley of arcs", "double-parabola"])
@pytest.mark.parametrize("facets", [ker.maxwell(0.2), ker.henyey_greenstein(0.6), ker.WallLaw(RIGHT)], ids=repr)
def test_the_mean_number_of_hits_is_the_length_of_the_wall_over_its_period_for_every_law(name, facets) -> None:
    wall, number, rng = CLOSED[name](), 8_000, np.random.default_rng(6)
    x, theta = rng.random(number) * wall.period, ker.SINE.sample(number, rng)
    _, hits, status = follow_facets(wall, x, theta, lambda angle, _: facets.sample(angle, rng))
    assert not status.any()
    assert abs(hits.mean() - wall.arc_length / wall.period) < 4.0 * hits.std() / np.sqrt(number)


def test_properties_follow_from_wall_and_facets() -> None:
    tilted = ker.MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    law, turning = ker.FacetedLaw(LEANING, ker.maxwell(0.2)), ker.FacetedLaw(ARCS, tilted)
    assert (law.reversible, law.mirror_symmetric, law.diffuse_fraction) == (True, None, 0.2)
    assert (turning.reversible, turning.diffuse_fraction) == (None, None)
    assert turning.adjoint().wall is ARCS and law.adjoint() is law
    bins = ker.Bins(3)
    backward = ker.discretise(turning.adjoint().facets, bins)
    assert np.allclose(backward.array, ker.discretise(tilted, bins).array.T, atol=1e-14)
    assert ker.FacetedLaw(ARCS, ker.TriangularTeethLaw(1.0) @ ker.maxwell(0.2)).diffuse_fraction is None
    assert ker.FacetedLaw(ARCS, ker.lambertian() @ ker.specular()).diffuse_fraction == 1.0
    assert ker.FacetedLaw(ARCS, ker.lambertian().in_specular_frame().in_specular_frame()).diffuse_fraction == 1.0
    assert ker.FacetedLaw(ARCS, ker.maxwell(0.2)).mirror_symmetric
    assert pickle.loads(pickle.dumps(law)) == law and hash(law) == hash(ker.FacetedLaw(LEANING, ker.maxwell(0.2)))


def test_the_adjoint_goes_the_paths_back() -> None:
    cycle = ker.MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    law, bins = ker.FacetedLaw(LEANING, cycle), ker.Bins(6)
    there, back = (ker.discretise(one, bins, samples=2**16, rng=k) for k, one in enumerate((law, law.adjoint())))
    distance = np.linalg.norm(there.symmetric - back.symmetric.T)
    assert distance < 1.5 * np.hypot(float(there.error), float(back.error))
    assert np.linalg.norm(there.symmetric - there.symmetric.T) > 3.0 * float(there.error)


def test_two_scales_nest_and_the_inner_wall_is_met_in_the_facets_frame() -> None:
    # a flat facet's law in the outer wall, one wall in another, and a wall of three scales with the same numbers
    fine = ker.FacetedLaw(geo.flat(), ker.WallLaw(TEETH))
    outer, theta = ker.FacetedLaw(ARCS, fine), np.full(2_000, 0.8)
    assert np.array_equal(outer.sample(theta, rng=3), ker.FacetedLaw(ARCS, ker.WallLaw(TEETH)).sample(theta, rng=3))
    three = ker.FacetedLaw(ARCS, ker.FacetedLaw(TEETH, ker.FacetedLaw(RIGHT, ker.retroreflection())))
    assert np.abs(three.sample(theta, rng=1) - theta).max() < 1e-12


@pytest.mark.parametrize(("wall", "expected"), [(ARCS, 0.255544569), (RIGHT, 0.302190338)], ids=["arcs", "groove"])
def test_diffuse_facets_return_the_momentum_that_their_integral_equation_says(wall, expected) -> None:
    basis = ker.Legendre(2)
    found = ker.discretise(ker.FacetedLaw(wall, ker.lambertian()), basis, samples=2**18)
    assert abs(found.symmetric[1, 1] - expected) < min(float(found.error), 5e-4)


@pytest.mark.parametrize(
    ("wall", "basis"),
    [(ARCS, ker.Legendre(6)), (TEETH, ker.Bins(16)), (LEANING, ker.Panels([0.0, 0.6, np.pi], 2)),
     (geo.elliptical_arcs(0.7), ker.Bins(8))],
    ids=repr,
)  # fmt: skip
def test_view_factors_agree_with_independent_rays(wall, basis) -> None:
    law = ker.FacetedLaw(wall, ker.maxwell(0.35))
    found = ker.discretise(law, basis, samples=2**16, rng=1)
    rays = ker.discretise(law, basis, "monte-carlo", samples=2**16, rng=2)
    assert found.method == "qmc" and float(found.error) < 0.4 * float(rays.error)
    assert np.linalg.norm(found.symmetric - rays.symmetric) < 1.3 * float(rays.error)
    assert np.abs(found.symmetric @ basis.constant - basis.constant).max() < 1e-6
    assert np.allclose(np.mean(found.replicates, axis=0), found.symmetric, rtol=0.0, atol=1e-12)


def test_the_matrix_of_sixty_four_bins_is_within_a_three_thousandth_of_a_finer_one() -> None:
    law, bins = ker.FacetedLaw(ARCS, ker.maxwell(0.2)), ker.Bins(64)
    found, finer = ker.discretise(law, bins), ker.discretise(law, bins, samples=2**21, rng=9)
    assert np.linalg.norm(found.symmetric - finer.symmetric, 2) < 0.003
    assert np.linalg.norm(found.symmetric - finer.symmetric) < float(found.error) + float(finer.error)


def test_few_rays_give_large_errors_and_bins_without_rays_are_refused() -> None:
    law = ker.FacetedLaw(ARCS, ker.lambertian())
    few = ker.discretise(law, ker.Bins(64), samples=16)
    assert np.all(few.array >= 0.0) and float(few.error) > 1.0
    with pytest.raises(AccuracyError, match="bins have no rays; use more samples"):
        ker.discretise(law, ker.Bins(512), samples=16)


def test_walls_of_bezier_pieces_and_facets_of_other_laws_are_sampled() -> None:
    bins = ker.Bins(4)
    for law in (
        ker.FacetedLaw(CLOSED["double-parabola"](), ker.maxwell(0.2)),
        ker.FacetedLaw(ARCS, ker.WallLaw(TEETH)),
    ):
        assert not has_radiosity(law, bins)
        assert ker.discretise(law, bins, samples=2**10).method == "monte-carlo"


def test_rays_of_workers_and_checkpoints_are_those_of_one_process(tmp_path: Path) -> None:
    law, bins = ker.FacetedLaw(TEETH, ker.maxwell(0.3)), ker.Bins(4)
    plain = ker.discretise(law, bins, "monte-carlo", samples=2**12)
    stored = ker.discretise(law, bins, "monte-carlo", samples=2**12, checkpoint=tmp_path / "rays")
    again = ker.discretise(law, bins, "monte-carlo", samples=2**12, checkpoint=tmp_path / "rays", client=2)
    assert np.array_equal(plain.counts, stored.counts) and np.array_equal(plain.counts, again.counts)
    with pytest.raises(InputError, match="use 'monte-carlo'"):
        ker.discretise(law, bins, "qmc", samples=2**12, checkpoint=tmp_path / "other")


def test_laws_that_do_not_fit_are_refused_by_name() -> None:
    for facets in (0.3, ker.maxwell(0.2).in_specular_frame(), 0.5 * ker.lambertian()):
        with pytest.raises(InputError, match=r"^facets: "):
            ker.FacetedLaw(ARCS, facets)
    with pytest.raises(InputError, match=r"^wall: "):
        ker.FacetedLaw(ker.lambertian(), ker.lambertian())


def test_facets_that_fail_are_named_and_rays_that_they_lose_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(ker.Law):
        reversible = True

        def _sample(self, theta, rng):
            raise AccuracyError("no rays left", 0.5)

        def _conditionals(self, theta, tolerance, degree, edges):
            raise AssertionError

        def __repr__(self) -> str:
            return "Failing()"

    with pytest.raises(AccuracyError, match=r"facets: Failing\(\) on Wall.*no rays left") as failure:
        ker.FacetedLaw(ARCS, Failing()).sample(1.0)
    assert failure.value.defect == 0.5
    fine = ker.WallLaw(geo.dispersing_arcs(1.0))
    law = ker.FacetedLaw(TEETH, fine)
    monkeypatch.setattr(type(fine), "reflect_with_status", lambda self, x, theta: (theta, x > 0.001))
    few = law._sample_with_status(np.full(20_000, 0.9), np.random.default_rng(0))[1]
    assert 0.0005 < 1.0 - few.mean() < 0.01
    with pytest.raises(AccuracyError, match="did not escape"):
        law.sample(np.full(20_000, 0.9), rng=0)
    with pytest.raises(AccuracyError, match="did not escape"):
        ker.discretise(law, ker.Bins(2), samples=2**14)
