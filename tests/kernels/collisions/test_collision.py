"""The collision law K: conservation, symmetry, branches and spectrum, and how often it asks the law of the wall."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.collisions import collision_law as collision

RNG = 20_260_301
positive = st.floats(1e-6, 1e6)


def velocities(n, rng):
    velocity = rng.normal(size=(n, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1])
    return velocity


@given(mass=positive, inertia=positive)
def test_k_of_specular_is_the_smooth_matrix_and_of_retroreflection_the_no_slip_matrix(mass, inertia):
    disk = geo.Disk.from_inertia(mass, inertia, 1.0)
    rng = np.random.default_rng(RNG)
    velocity = velocities(8, rng)
    for law, matrix in ((ker.specular(), ker.smooth_matrix(disk)), (ker.retroreflection(), ker.no_slip_matrix(disk))):
        K = ker.CollisionLaw(law, disk)
        expected = velocity @ matrix.T
        # spin is measured in units of the kinetic energy
        scale = np.sqrt(disk.inner(velocity, velocity))[:, None] / np.sqrt([mass, mass, inertia])
        assert np.all(np.abs(K.sample(velocity, rng) - expected) <= 64 * np.finfo(float).eps * scale)
        (probability, branch), *others = K.branches(0.7)
        assert not others and probability == 1.0
        assert np.all(np.abs((velocity @ branch.T) - expected) <= 64 * np.finfo(float).eps * scale)


@given(mass=positive, inertia=positive)
def test_no_slip_is_twice_the_projection_on_chi_minus_one(mass, inertia):
    disk = geo.Disk.from_inertia(mass, inertia, 1.0)
    chi = np.array([-1.0, 0.0, 1.0]) / np.sqrt(mass + inertia)
    expected = 2.0 * np.outer(chi, chi * [mass, mass, inertia]) - np.eye(3)
    assert np.allclose(ker.no_slip_matrix(disk), expected, rtol=1e-9, atol=1e-12 * np.max(np.abs(expected)))
    assert np.allclose(ker.smooth_matrix(disk), np.diag([1.0, -1.0, 1.0]), atol=1e-9)


OVERHANG = geo.Wall.from_vertices([(0, 0), (0.4, 0), (0.3, -0.4), (0.9, -0.5), (1, 0)])


@pytest.mark.parametrize("wall", [geo.triangular_teeth(0.9), OVERHANG], ids=["teeth", "overhang"])
def test_branches_of_polygons_are_isometries_that_conserve(wall):
    """S2.28 in the original coordinates: every matrix keeps the metric and the covector -m v1 + J omega."""
    disk = geo.Disk(1.0, 0.5)
    K = ker.CollisionLaw.from_wall(wall, disk)
    metric = np.diag([disk.mass, disk.mass, disk.rim_mass])
    rolling = np.array([-disk.mass, 0.0, disk.rim_mass])
    for theta in (0.2, 0.9, 1.5, 2.6):
        branches = K.branches(theta)
        assert sum(p for p, _ in branches) == pytest.approx(1.0, abs=1e-14)
        for _, matrix in branches:
            assert np.allclose(matrix.T @ metric @ matrix, metric, atol=1e-13)
            assert np.allclose(rolling @ matrix, rolling, atol=1e-13)


def test_spectrum_of_k_is_that_of_the_reflection_law_with_both_signs():
    law = ker.henyey_greenstein(0.6)
    K = ker.CollisionLaw(law, geo.Disk())
    dense = K.operator(ker.Legendre(12), ker.Legendre(2, weight="sin2")).dense()
    found = spec.spectrum(K, k=8)
    assert np.allclose(found.values, [1, 0.6, 0.36, 0.216, -0.216, -0.36, -0.6, -1], atol=1e-12)
    eigenvalues = np.linalg.eigvalsh(dense)
    assert np.allclose(np.sort(np.abs(eigenvalues))[::-1][:8], np.repeat(0.6 ** np.arange(4), 2), atol=1e-12)
    assert found.gap == pytest.approx(0.4, abs=1e-12)


DISK = geo.Disk(1.0, 0.5)


def test_a_collision_law_has_the_foreshortened_law_and_takes_velocities_of_any_shape() -> None:
    law, velocity = ker.CollisionLaw(ker.specular(), DISK), [1.0, -3.0, 4.0]
    assert np.allclose(law.sample(np.tile(velocity, (2, 4, 1))), np.tile([1.0, 3.0, 4.0], (2, 4, 1)), rtol=1e-14)
    assert law.sample(velocity).shape == (3,)
    mixed = ker.CollisionLaw(0.5 * ker.lambertian() + 0.5 * ker.specular(), DISK)
    assert repr(mixed).startswith("CollisionLaw(law=") and "disk=Disk(" in repr(mixed)
    wall = geo.triangular_teeth(0.9)
    assert ker.CollisionLaw.from_wall(wall, DISK).law == ker.WallLaw(wall.foreshorten(DISK))


def function(theta: np.ndarray, psi: np.ndarray) -> np.ndarray:
    return np.cos(theta) * (1.0 + psi) + np.cos(psi) * theta**2


@pytest.mark.parametrize("shape", ["grid", "scattered", "single", "repeated"])
def test_functions_are_taken_at_the_turned_angles(shape: str, monkeypatch) -> None:
    rng = np.random.default_rng(2)
    theta, psi = {
        "grid": (np.linspace(0.2, 2.8, 5)[:, None], np.linspace(0.1, 3.0, 4)),
        "scattered": (0.1 + 2.9 * rng.random((4, 5)), 0.1 + 2.9 * rng.random((4, 5))),
        "single": (0.4, 1.0),
        "repeated": (rng.choice([0.3, 1.0, 2.0], 12), rng.choice([0.5, 2.0], 12)),
    }[shape]
    calls = []
    apply = ker.TriangularTeethLaw.apply
    monkeypatch.setattr(
        ker.TriangularTeethLaw, "apply", lambda law, f, at, edges: calls.append(np.size(at)) or apply(law, f, at, edges)
    )
    # retroreflection and specular reflection are known, so are their halves
    for law, image in (
        (ker.retroreflection(), lambda angle: angle),
        (ker.specular(), lambda angle: np.pi - angle),
    ):
        value = ker.CollisionLaw(law, DISK).apply(function, theta, psi)
        expected = function(image(np.asarray(theta)), np.pi - np.asarray(psi))
        assert value.shape == np.broadcast(theta, psi).shape
        assert np.allclose(value, expected, rtol=1e-13, atol=1e-14)
    law = ker.TriangularTeethLaw(0.8)
    probability, outgoing = law.branches(np.broadcast_to(theta, np.broadcast(theta, psi).shape))
    rolled = np.pi - np.broadcast_to(psi, probability.shape[:-1])
    expected = np.sum(probability * function(np.where(probability > 0, outgoing, 1.0), rolled[..., None]), axis=-1)
    assert np.allclose(ker.CollisionLaw(law, DISK).apply(function, theta, psi), expected, rtol=1e-12, atol=1e-13)
    # grids and what is nearly one ask the law once, for every distinct angle; scattered pairs once for every psi
    assert calls == {"grid": [5], "single": [1], "repeated": [3], "scattered": [1] * 20}[shape]


def test_pairs_are_a_grid_up_to_four_times_their_number() -> None:
    calls = []

    def counted(theta: np.ndarray, psi: np.ndarray) -> np.ndarray:
        calls.append(np.size(psi))
        return np.broadcast_to(np.cos(theta), np.broadcast(theta, psi).shape)

    K = ker.CollisionLaw(ker.specular(), DISK)
    four, five = np.linspace(0.3, 2.5, 4), np.linspace(0.3, 2.5, 5)
    assert np.allclose(K.apply(counted, four, four), np.cos(np.pi - four)) and set(calls) == {4}
    calls.clear()
    assert np.allclose(K.apply(counted, five, five), np.cos(np.pi - five)) and set(calls) == {1}


def test_branches_are_isometries_with_their_probabilities() -> None:
    law = ker.TriangularTeethLaw(0.7)
    K = ker.CollisionLaw(law, DISK)
    shallow = K.branches(0.5)
    assert len(shallow) == 2 and sum(float(p) for p, _ in shallow) == pytest.approx(1.0, abs=1e-14)
    assert all(p > 0.0 and matrix.shape == (3, 3) for p, matrix in shallow)
    several = K.branches([0.5, 2.0])
    assert [bool(p[0] > 0.0) for p, _ in several] == [True, True, False]
    assert all(p.shape == (2,) and matrix.shape == (2, 3, 3) for p, matrix in several)
    # each branch takes minus the velocity of an angle to that of its image, with the probability of this image
    probability, outgoing = law.branches(0.5)
    likely = probability > 0
    images = np.column_stack([DISK.from_angles(outgoing[likely], np.pi - 1.1), probability[likely]])
    found = np.array([[*matrix @ -DISK.from_angles(0.5, 1.1), p] for p, matrix in shallow])
    order = lambda rows: rows[np.argsort(rows[:, 0])]  # noqa: E731
    assert np.allclose(order(found), order(images), atol=1e-13)


def test_slots_that_are_empty_at_all_angles_are_left_out(monkeypatch) -> None:
    probability = np.array([[0.4, 0.0, 0.6, 0.0], [1.0, 0.0, 0.0, 0.0]])
    slots = (probability, np.ones((2, 4)), np.tile([0.0, 0.1, 0.2, 0.3], (2, 1)))
    monkeypatch.setattr(collision, "isometries", lambda law, theta: slots)
    found = ker.CollisionLaw(ker.specular(), DISK).branches([0.5, 0.6])
    assert [p.tolist() for p, _ in found] == [[0.4, 1.0], [0.6, 0.0]]


def test_the_operator_and_its_defect_are_of_the_bases_given() -> None:
    K = ker.CollisionLaw(ker.henyey_greenstein(0.6), DISK)
    operator = K.operator(ker.Legendre(3), ker.Legendre(2, weight="sin2"))
    # eigenvalues g^l on P_l, and cos(psi) changes its sign
    assert np.allclose(operator.dense(), np.diag([1.0, -1.0, 0.6, -0.6, 0.36, -0.36]), atol=1e-13)
    asked = []
    plain = ker.CollisionLaw.operator
    record = lambda self, *bases, **more: asked.append(bases) or plain(self, *bases, **more)  # noqa: E731
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ker.CollisionLaw, "operator", record)
        assert float(K.symmetry_defect()) < 1e-12
        K.symmetry_defect(ker.Legendre(3))
        K.symmetry_defect(psi_basis=ker.Legendre(2, weight="sin2"))
    wide, narrow = ker.Legendre(32), ker.Legendre(8, weight="sin2")
    assert asked == [(wide, narrow), (ker.Legendre(3), narrow), (wide, ker.Legendre(2, weight="sin2"))]
    assert collision.DEFECT_SIZES == (32, 8)
