"""Single velocities and functions under the collision law, by hand, and how often the law of the wall is asked."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.collisions import collision_law as collision

DISK = geo.Disk(1.0, 0.5)


def test_retroreflection_turns_all_but_the_fraction_along_chi() -> None:
    K = ker.CollisionLaw(ker.retroreflection(), DISK)
    velocity = np.array([[1.0, -1.0, 0.0], [0.0, -2.0, 3.0], [-0.5, -1e-12, 0.25]])
    # chi is along (-1, 0, 1): v1 + J/m omega, at mass 1 and inertia 1/2 a third of one, two thirds of the other
    along = (-velocity[:, 0] + 0.5 * velocity[:, 2]) / 1.5
    chi = along[:, None] * np.array([-1.0, 0.0, 1.0])
    assert np.allclose(K.sample(velocity, np.random.default_rng(0)), 2.0 * chi - velocity, rtol=1e-14, atol=1e-15)
    shaped = K.sample(np.tile(velocity[0], (2, 4, 1)), np.random.default_rng(0))
    assert shaped.shape == (2, 4, 3) and np.allclose(shaped, (2.0 * chi - velocity)[0])
    assert K.sample(velocity[0], np.random.default_rng(0)).shape == (3,)


def test_specular_reflection_turns_the_vertical_fraction_alone() -> None:
    K = ker.CollisionLaw(ker.specular(), DISK)
    found = K.sample([[1.0, -3.0, 4.0]], np.random.default_rng(0))
    assert np.allclose(found, [[1.0, 3.0, 4.0]], rtol=1e-14)


@pytest.mark.parametrize("up", [0.0, 1e-300, 2.0])
def test_velocities_along_the_wall_or_away_from_it_are_refused(up: float) -> None:
    K = ker.CollisionLaw(ker.specular(), DISK)
    with pytest.raises(InputError, match=r"v2 >= 0 at row \[1, 0\]"):
        K.sample([[[1.0, -1.0, 0.0]], [[1.0, up, 0.0]], [[1.0, up, 0.0]]], np.random.default_rng(0))
    for wrong in (3.0, [1.0, -1.0], [[1.0, -1.0, 0.0, 2.0]]):
        with pytest.raises(InputError, match="shape"):
            K.sample(wrong, np.random.default_rng(0))
    with pytest.raises(InputError, match="Generator"):
        K.sample([0.0, -1.0, 0.0], "seven")


def test_only_laws_in_the_papers_frame_and_disks_and_walls_are_taken() -> None:
    with pytest.raises(InputError, match="law"):
        ker.CollisionLaw(geo.triangular_teeth(0.9), DISK)
    with pytest.raises(InputError, match="disk"):
        ker.CollisionLaw(ker.specular(), 3)
    with pytest.raises(InputError, match="paper"):
        ker.CollisionLaw(ker.specular().in_specular_frame(), DISK)
    with pytest.raises(InputError, match="sum of 1"):
        ker.CollisionLaw(0.5 * ker.lambertian(), DISK)
    with pytest.raises(InputError, match="wall"):
        ker.CollisionLaw.from_wall(ker.specular(), DISK)
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
        ker.TriangularTeethLaw, "apply", lambda law, f, at: calls.append(np.size(at)) or apply(law, f, at)
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
    # each branch takes minus the velocity of an angle to that of its image
    probability, outgoing = law.branches(0.5)
    images = DISK.from_angles(outgoing[probability > 0], np.pi - 1.1)
    found = np.array([matrix @ -DISK.from_angles(0.5, 1.1) for _, matrix in shallow])
    order = lambda rows: rows[np.argsort(rows[:, 0])]  # noqa: E731
    assert np.allclose(order(found), order(images), atol=1e-13)
    with pytest.raises(InputError):
        ker.CollisionLaw(ker.lambertian(), DISK).branches(0.5)


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
