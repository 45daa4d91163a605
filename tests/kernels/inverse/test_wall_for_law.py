"""Walls for wanted laws and for other wishes: moments by another way than the search's, known optima, bounds."""

import numpy as np
import pytest

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.inverse import wall_for_law
from asperity.kernels.inverse.hollows import few_weights, nearest_weights, possible_gain

MOMENTS = 5


@pytest.fixture(scope="module")
def lambert():
    return ker.wall_for(ker.lambertian(), moments=MOMENTS)


def moments_of(law, number=MOMENTS):
    return ker.discretise(law, ker.Legendre(number), tolerance=1e-12).symmetric


def test_the_wall_for_lamberts_law_has_its_moments_to_rounding(lambert):
    assert float(lambert.defect) < 1e-12
    assert float(lambert.defect) + lambert.defect.error < 1e-9
    assert lambert.wall.closes and lambert.wall.period == 1.0


def test_the_same_call_gives_the_same_wall_to_the_bit(lambert):
    assert ker.wall_for(ker.lambertian(), moments=MOMENTS).wall == lambert.wall


@pytest.mark.parametrize(
    "law",
    [ker.maxwell(0.3), ker.henyey_greenstein(-0.5), 0.5 * ker.specular() + 0.5 * ker.retroreflection()],
    ids=["maxwell", "henyey-greenstein", "fair coin"],
)
def test_diffuse_laws_are_met_to_rounding(law):
    found = ker.wall_for(law, moments=MOMENTS)
    assert float(found.defect) < 1e-12
    assert np.abs(moments_of(ker.WallLaw(found.wall)) - moments_of(law)).max() < 1e-12


def test_a_law_without_mirror_symmetry_is_met_with_mirrored_hollows_of_other_weight():
    skew = geo.Wall.from_vertices([(0, 0), (0.3, -0.8), (1, 0)])
    law = 0.5 * ker.WallLaw(skew) + 0.5 * ker.lambertian()
    found = ker.wall_for(law, moments=3)
    wanted = moments_of(law, 3)
    assert abs(wanted[1, 2]) > 1e-3
    assert np.abs(moments_of(ker.WallLaw(found.wall), 3) - wanted).max() < 1e-10


def test_a_law_in_the_specular_frame_is_turned_back():
    law = ker.maxwell(0.5)
    assert ker.wall_for(law.in_specular_frame(), moments=3).wall == ker.wall_for(law, moments=3).wall


def test_matrices_stand_for_laws_and_for_moments():
    flux = ker.discretise(ker.henyey_greenstein(0.3), ker.Bins(6))
    by_bins = ker.wall_for(flux, moments=4)
    assert float(by_bins.defect) < 1e-12
    assert np.abs(moments_of(ker.WallLaw(by_bins.wall), 4) - moments_of(ker.MatrixLaw(flux), 4)).max() < 1e-11
    legendre = ker.discretise(ker.henyey_greenstein(0.3), ker.Legendre(4))
    by_moments = ker.wall_for(legendre, moments=10)
    assert by_moments.moments == 4 and float(by_moments.defect) < 1e-12
    with pytest.raises(InputError, match="moments alone"):
        _ = by_moments.distance


def test_the_joint_distance_falls_with_the_moments():
    law = ker.maxwell(0.5)
    coarse, fine = ker.wall_for(law, moments=3), ker.wall_for(law, moments=8)
    assert float(fine.distance) + fine.distance.error < float(coarse.distance) - coarse.distance.error


def test_the_wall_for_retroreflection_is_near_to_it_and_says_how_well_it_is_known(monkeypatch):
    monkeypatch.setattr(wall_for_law, "ROUNDS", 1)
    found = ker.wall_for(ker.retroreflection(), moments=4, tolerance=0.05)
    # the mean of |theta' - theta| is at least the joint distance; that of the double parabola is .058
    away = ker.retroreflection_distance(found.wall, rng=1)
    assert float(away) + away.error < 0.02
    assert 0.0 < float(found.defect) < 0.1 and found.defect.kind == "estimate"
    assert 0.0 < found.defect.error <= found.bound.error < 0.02


def test_few_hollows_have_a_larger_defect_that_is_reported():
    found = ker.wall_for(ker.lambertian(), moments=MOMENTS, most_hollows=4)
    assert len(found.hollows) <= 4 and 1e-3 < float(found.defect) < 1.0
    difference = moments_of(ker.WallLaw(found.wall)) - moments_of(ker.lambertian())
    assert float(found.defect) == pytest.approx(np.linalg.norm(difference), rel=1e-9)


def test_the_bound_of_few_hollows_counts_all_mixtures_of_the_given_ones():
    given = [geo.flat(), *(geo.triangular_teeth(angle) for angle in (0.7, 1.0, 1.4))]
    best = ker.wall_for(ker.lambertian(), moments=MOMENTS, hollows=given)
    few = ker.wall_for(ker.lambertian(), moments=MOMENTS, hollows=given, most_hollows=2)
    assert len(few.hollows) <= 2 and few.bound.kind == "bound"
    excess = float(few.defect) - float(best.defect)
    assert 1e-3 < excess == pytest.approx(float(few.bound), rel=1e-9)
    assert float(best.defect) > 1e-3


def test_a_law_outside_the_hull_of_given_hollows_ends_with_its_distance_and_a_bound_of_rounding():
    found = ker.wall_for(ker.lambertian(), moments=MOMENTS, hollows=[geo.flat(), geo.triangular_teeth(1.0)])
    assert float(found.defect) > 0.5
    assert found.bound.kind == "bound" and float(found.bound) < 1e-12
    # no other fraction of flat tops is nearer
    flat, teeth = moments_of(ker.specular()), moments_of(ker.TriangularTeethLaw(1.0))
    others = [np.linalg.norm(w * flat + (1 - w) * teeth - moments_of(ker.lambertian())) for w in np.linspace(0, 1, 201)]
    assert min(others) >= float(found.defect) * (1.0 - 1e-12)


def test_the_picture_says_how_many_hollows(lambert):
    assert f"{len(lambert.hollows)} hollows" in lambert.plot().get_title()


def test_the_nearest_point_of_a_hull_is_that_of_quadratic_programming():
    rng = np.random.default_rng(4)
    for _ in range(20):
        points, target = rng.normal(size=(9, 4)), rng.normal(size=4)
        weights = nearest_weights(points, target)
        residual = weights @ points - target
        assert weights.min() >= 0.0 and weights.sum() == pytest.approx(1.0)
        # the optimum's condition: no point lies further down the residual than the nearest one
        assert np.min(points @ residual) >= residual @ (weights @ points) - 1e-12
        assert possible_gain(points, target, weights) < 1e-6
        others = rng.dirichlet(np.ones(9), size=200)
        assert np.linalg.norm(others @ points - target, axis=1).min() >= np.linalg.norm(residual) - 1e-12
        for other in others[:5]:
            loss = np.linalg.norm(other @ points - target) - np.linalg.norm(residual)
            assert possible_gain(points, target, other) >= loss - 1e-12


def test_few_weights_keep_to_their_cost():
    rng = np.random.default_rng(5)
    points, cost = rng.normal(size=(40, 6)), rng.integers(1, 3, 40).astype(float)
    weights = few_weights(points, np.zeros(6), cost, 4.0)
    assert cost[weights > 0.0].sum() <= 4.0
    one = np.linalg.norm(points[cost <= 4.0], axis=1).min()
    assert np.linalg.norm(weights @ points) <= one


def test_alternating_cells_do_not_converge_and_flattening_ones_do():
    teeth, flat = geo.triangular_teeth(1.0), geo.flat()
    alternating = ker.dichotomy([teeth, flat] * 3)
    assert alternating.verdict == "does not converge"
    assert alternating.diameters[-1] == alternating.diameters[0] > 0.02
    assert alternating.distances[0, 2] == 0.0
    flattening = ker.dichotomy([geo.triangular_teeth(np.pi - 2.0**-k) for k in range(1, 7)])
    assert flattening.verdict == "converges"
    assert np.all(np.diff(flattening.diameters) < 0.0)
    # a scale that keeps the disk within 1 of its limit law is no small one
    assert flattening.scales[0] == 1e-3


@pytest.mark.parametrize("fraction", [1e-9, 1e-8, 1e-7, 1e-5])
def test_narrow_hollows_keep_their_accuracy_beside_a_flat_top(fraction):
    # the coordinates of a hollow of width 1e-10 round to 1e-6 of it, which is symmetric no more
    found = ker.wall_for(ker.maxwell(fraction))
    assert float(found.defect) + found.defect.error < max(0.1 * fraction, 1e-11) and found.defect.error < 1e-11


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-8])
@pytest.mark.parametrize("wanted", [1.1, 1.2, 1.3, 1.41])
def test_a_wanted_resistance_is_met_within_the_tolerance(wanted, tolerance):
    found = ker.design_wall(ker.resistance, geo.triangular_teeth, [(0.5, 3.0)], wanted, tolerance)
    exact = float(ker.resistance(ker.TriangularTeethLaw(float(found.parameters[0])), 1e-12))
    assert abs(exact - wanted) <= tolerance and found.refused == ()


def the_gap(law, tolerance):
    return spec.spectral_gap(law, tolerance)


def peak(a, b=0.5):
    # the gap of Maxwell's law is the diffuse fraction
    return ker.maxwell(float(np.exp(-100.0 * ((a - 0.513) ** 2 + (b - 0.5) ** 2))))


@pytest.mark.parametrize("bounds", [[(0.0, 1.0)], [(0.0, 1.0), (0.2, 0.9)]])
def test_a_number_that_no_member_on_the_grid_reaches_is_met_between_them(bounds):
    found = ker.design_wall(the_gap, peak, bounds, wanted=0.995, tolerance=1e-7, grid=5)
    assert found.tried[: 5 ** len(bounds), -1].max() < 0.995 and abs(float(found.value) - 0.995) <= 1e-7


def test_a_family_that_jumps_over_a_number_gives_the_nearest_member_or_another_crossing():
    # from .2 to .6 at .5, and continuously through .4 and back at .82
    def member(a):
        return ker.maxwell(0.4 * a if a < 0.5 else 0.6 - 2.0 * (a - 0.72) if a > 0.72 else 0.6)

    found = ker.design_wall(the_gap, member, [(0.0, 1.0)], wanted=0.4, tolerance=1e-7)
    assert found.parameters[0] == pytest.approx(0.82, abs=1e-6)
    near = ker.design_wall(the_gap, member, [(0.0, 0.7)], wanted=0.35, tolerance=1e-7)
    assert float(near.value) == pytest.approx(0.2, abs=1e-3)


def partial(a):
    if 0.3 < a < 0.6:
        raise ValueError("no wall of this depth")
    # beyond .9 the law refuses
    return ker.maxwell(a if a < 0.9 else 2.0)


@pytest.mark.parametrize(("wanted", "value"), [(0.2, 0.2), (0.7, 0.7), ("max", 0.9), ("min", 0.0), (0.95, 0.9)])
def test_members_that_refuse_are_left_out_and_named(wanted, value):
    found = ker.design_wall(the_gap, partial, [(0.0, 1.0)], wanted, tolerance=1e-7)
    assert float(found.value) == pytest.approx(value, abs=1e-4)
    assert found.refused[0] == "(0.375): no wall of this depth" and "refused    (0.375): no wall" in repr(found)
    assert any("diffuse_fraction: expected a number" in line for line in found.refused)


@pytest.mark.parametrize(("odd", "said"), [(np.nan, "finite"), (np.inf, "finite"), (1j, "numbers")])
def test_an_objective_that_is_no_number_is_never_the_best(odd, said):
    def objective(law, tolerance):
        gap = spec.spectral_gap(law, tolerance)
        return gap if float(gap) < 0.5 else odd

    for wanted, value in (("max", 0.5), ("min", 0.0), (0.3, 0.3)):
        found = ker.design_wall(objective, ker.maxwell, [(0.0, 1.0)], wanted, tolerance=1e-6)
        assert float(found.value) == pytest.approx(value, abs=1e-3) and said in found.refused[0]
    with pytest.raises(InputError, match=rf"none among 12; the first is \(0.6.*{said}.*change the bounds"):
        ker.design_wall(objective, ker.maxwell, [(0.6, 1.0)])


def test_the_gap_is_an_objective():
    found = ker.design_wall(
        lambda law, tolerance: spec.spectral_gap(law, tolerance), ker.maxwell, [(0.0, 1.0)], wanted=0.3, tolerance=1e-6
    )
    # the gap of Maxwell's law in the paper's convention is that of its odd functions below 1, and its even ones
    assert float(spec.spectral_gap(ker.maxwell(float(found.parameters[0])))) == pytest.approx(0.3, abs=1e-4)


DISK, DISK_MOMENTS = geo.Disk(1.0, 0.4), 4
REPLICATES, SAMPLES = 8, 2**14


@pytest.fixture(scope="module")
def wanted():
    return ker.CollisionLaw(ker.maxwell(0.5), DISK)


@pytest.fixture(scope="module")
def found(wanted):
    return ker.collision_for(wanted, moments=DISK_MOMENTS)


def test_the_wall_of_a_disk_is_unforeshortened(wanted, found):
    law = ker.CollisionLaw.from_wall(found.wall, DISK).law
    assert np.abs(moments_of(law, DISK_MOMENTS) - moments_of(wanted.law, DISK_MOMENTS)).max() < 1e-10
    assert found.wall_law.wall == found.wall.foreshorten(DISK)


def moments_of_collisions(wall, scale):
    """Moments <e_l, P e_m> of true collisions, their standard errors, and the mean of |psi + psi' - pi|."""
    basis, space = ker.Legendre(DISK_MOMENTS), geo.ConfigurationSpace(wall, DISK, scale)
    tables, rolls = [], []
    for replicate in range(REPLICATES):
        rng = np.random.default_rng([7, replicate])
        theta, psi = ker.SINE.sample(SAMPLES, rng), np.pi * (0.1 + 0.8 * rng.random(SAMPLES))
        alpha, x1 = space.spacing * (rng.random(SAMPLES) - 0.5), scale * wall.period * rng.random(SAMPLES)
        position = np.stack([x1, alpha], axis=-1)
        collided = geo.collide(DISK, wall, scale, position, -DISK.from_angles(theta, psi), space.spacing)
        assert collided.escaped.all()
        outgoing, rolled = DISK.to_angles(collided.velocity)
        table = basis.evaluate(theta).T @ basis.evaluate(outgoing) / SAMPLES
        tables.append(0.5 * (table + table.T))
        rolls.append(float(np.mean(np.abs(rolled + psi - np.pi))))
    error = np.std(tables, axis=0, ddof=1) / np.sqrt(REPLICATES)
    return np.mean(tables, axis=0), error, np.mean(rolls)


def test_the_true_disk_approaches_the_wanted_collision_law(wanted, found):
    matrix = ker.discretise(wanted.law, ker.Legendre(DISK_MOMENTS)).symmetric
    defects, rolls = [], []
    for scale in (1e-2, 1e-3, 1e-5):
        mean, error, rolled = moments_of_collisions(found.wall, scale)
        defects.append(np.linalg.norm(mean - matrix))
        rolls.append(rolled)
    # at 1e-5 the limit law of order eps^(2/5) in psi, and sampling in theta
    assert np.linalg.norm(error) < 0.02 and defects[2] < 3.0 * np.linalg.norm(error)
    assert defects[0] > 0.05 > 3.0 * defects[2]
    assert np.log(rolls[0] / rolls[2]) / np.log(1e3) == pytest.approx(0.4, abs=0.05)


def test_the_wall_without_the_disks_factor_has_another_law(wanted, found):
    matrix = ker.discretise(wanted.law, ker.Legendre(DISK_MOMENTS)).symmetric
    mean, error, _ = moments_of_collisions(found.wall.foreshorten(DISK), 1e-5)
    assert np.linalg.norm(mean - matrix) > 10.0 * np.linalg.norm(error)
