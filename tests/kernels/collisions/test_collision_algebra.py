"""The algebra of collision laws: compositions, mixtures, powers, adjoints and matrices, against velocities and closed
forms."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.collisions.collision_law import CollisionCombination

RNG = 20_260_318
DISK = geo.Disk(1.3, 0.4 / 1.3)
TEETH = ker.CollisionLaw(ker.TriangularTeethLaw(0.9), DISK)
DIFFUSE = ker.CollisionLaw(ker.lambertian(), DISK)
SMOOTH = ker.CollisionLaw(ker.specular(), DISK)
NO_SLIP = ker.CollisionLaw(ker.retroreflection(), DISK)
ANGLES = (ker.Legendre(5), ker.Legendre(4, weight="sin2"))
PAIR = ker.TensorBasis(ANGLES)


def velocities(n):
    velocity = np.random.default_rng(RNG).normal(size=(n, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1])
    return velocity


def angles_of(velocity):
    return DISK.to_angles(velocity)


@pytest.mark.parametrize(("first", "second"), [(SMOOTH, NO_SLIP), (NO_SLIP, SMOOTH), (NO_SLIP, NO_SLIP)])
def test_a_composition_is_the_second_law_on_minus_the_outcome_of_the_first(first, second):
    before = velocities(50)
    expected = second.sample(-first.sample(before))
    assert np.allclose((first @ second).sample(before), expected, atol=1e-13)
    ((probability, matrix),) = (first @ second).branches(0.7)
    assert probability == 1.0
    assert np.allclose(before @ matrix.T, expected, atol=1e-13)


def test_the_composition_of_random_laws_has_the_outcomes_of_two_draws():
    n = 40_000
    before = np.tile(-DISK.from_angles(1.1, 0.8), (n, 1))
    rng = np.random.default_rng(RNG)
    whole = (TEETH @ DIFFUSE).sample(before, rng)
    steps = DIFFUSE.sample(-TEETH.sample(before, rng), rng)
    for function in (lambda t, p: np.cos(t), lambda t, p: np.cos(t) ** 2 * p, lambda t, p: np.sin(t + p)):
        mean = float((TEETH @ DIFFUSE).apply(function, 1.1, 0.8))
        for outcome in (whole, steps):
            value = function(*angles_of(outcome))
            assert abs(value.mean() - mean) < 4.5 * value.std() / np.sqrt(n) + 1e-9


def test_psi_is_flipped_by_odd_products_and_kept_by_even_ones():
    psi = np.array([0.3, 1.0, 2.5])
    for n in range(5):
        value = (TEETH**n).apply(lambda _, p: p, 1.1, psi)
        assert np.allclose(value, psi if n % 2 == 0 else np.pi - psi, atol=1e-14)
    before = velocities(500)
    after = (TEETH @ DIFFUSE).sample(before, rng=RNG)
    # the rolling momentum of minus the incoming velocity
    assert np.allclose(DISK.rolling_momentum(after), -DISK.rolling_momentum(before), atol=1e-13)
    assert np.allclose(DISK.inner(after, after), DISK.inner(before, before), rtol=1e-13)
    odd = (TEETH @ DIFFUSE @ TEETH).sample(before, rng=RNG)
    assert np.allclose(DISK.rolling_momentum(odd), DISK.rolling_momentum(before), atol=1e-13)


def test_a_mixture_of_collision_laws_is_the_collision_law_of_the_mixture():
    assert (
        ker.CollisionLaw(0.25 * ker.specular() + 0.75 * ker.retroreflection(), DISK) == 0.25 * SMOOTH + 0.75 * NO_SLIP
    )
    assert np.float64(0.5) * SMOOTH + NO_SLIP * 0.5 == ker.CollisionLaw(
        0.5 * ker.specular() + 0.5 * ker.retroreflection(), DISK
    )
    assert 2.0 * (0.5 * SMOOTH) + 0.0 * NO_SLIP == SMOOTH
    thrice = 0.2 * SMOOTH + (0.3 * NO_SLIP + 0.5 * DIFFUSE)
    assert isinstance(thrice, ker.CollisionLaw)
    assert [weight for weight, _ in thrice.law.terms] == [0.2, 0.3, 0.5]


def test_a_sum_with_and_without_flip_draws_both_in_proportion():
    law = 0.3 * TEETH + 0.7 * (TEETH @ TEETH)
    n = 20_000
    before = np.tile(-DISK.from_angles(1.1, 0.8), (n, 1))
    theta, psi = angles_of(law.sample(before, rng=RNG))
    kept = np.abs(psi - 0.8) < 1e-9
    assert np.all(kept | (np.abs(psi - (np.pi - 0.8)) < 1e-9))
    assert abs(kept.mean() - 0.7) < 4.5 * np.sqrt(0.21 / n)
    found, mean = np.cos(theta) * psi, float(law.apply(lambda t, p: np.cos(t) * p, 1.1, 0.8))
    assert abs(found.mean() - mean) < 4.5 * found.std() / np.sqrt(n)
    assert sum(float(p) for p, _ in law.branches(1.1)) == pytest.approx(1.0, abs=1e-13)
    assert float(law.apply(lambda _, p: p, 1.1, 0.8)) == pytest.approx(0.3 * (np.pi - 0.8) + 0.7 * 0.8, abs=1e-13)


@pytest.mark.parametrize("law", [TEETH, TEETH @ DIFFUSE, 0.3 * TEETH + 0.7 * (DIFFUSE @ TEETH), TEETH**2], ids=repr)
def test_operator_and_matrix_agree_with_expectations(law):
    operator, matrix = law.operator(*ANGLES), ker.discretise(law, PAIR)
    assert np.allclose(operator.dense(), matrix.symmetric, atol=1e-12)
    vector = np.random.default_rng(RNG).normal(size=PAIR.size)
    assert np.allclose(operator @ vector, matrix.symmetric @ vector, atol=1e-12)
    assert np.allclose(operator.rmatvec(vector), matrix.symmetric.T @ vector, atol=1e-12)
    # <e_i, K e_j> by an independent quadrature of `apply`
    (theta, weight), (psi, psi_weight) = (basis.measure.quadrature(np.linspace(0.0, np.pi, 21), 4) for basis in ANGLES)
    for j in (1, 7):
        row, column = divmod(j, 4)

        def function(t, p, row=row, column=column):
            return ANGLES[0].evaluate(t)[..., row] * ANGLES[1].evaluate(p)[..., column]

        value = law.apply(function, theta[:, None], psi)
        image = np.einsum(
            "a,b,ai,bk,ab->ik", weight, psi_weight, ANGLES[0].evaluate(theta), ANGLES[1].evaluate(psi), value
        )
        assert np.allclose(image.ravel(), matrix.symmetric[:, j], atol=2e-3)


def test_powers_of_a_sum_multiply_out():
    law = 0.4 * SMOOTH + 0.6 * (NO_SLIP @ NO_SLIP)
    for n in range(6):
        # an odd number of smooth collisions turns both angles, an even one neither
        odd = 0.5 - 0.5 * 0.2**n
        value = float((law**n).apply(lambda t, p: t * p, 1.1, 0.8))
        assert value == pytest.approx(odd * (np.pi - 1.1) * (np.pi - 0.8) + (1.0 - odd) * 1.1 * 0.8, rel=1e-13)
    assert isinstance(law**1, CollisionCombination) and law**1 is law
    assert (TEETH**3).law == TEETH.law**3


def test_the_adjoint_reverses_products_and_moves_to_the_other_side():
    scatter = ker.CollisionLaw(ker.henyey_greenstein(0.5), DISK)
    law = TEETH @ scatter @ SMOOTH
    turned = law.adjoint()
    assert np.allclose(turned.operator(*ANGLES).dense(), law.operator(*ANGLES).dense().T, atol=1e-9)
    assert TEETH.adjoint() is TEETH and TEETH.reversible
    assert law.reversible is None
    sum_of_both = 0.5 * law + 0.5 * (TEETH @ scatter)
    expected = sum_of_both.operator(*ANGLES).dense().T
    assert np.allclose(sum_of_both.adjoint().operator(*ANGLES).dense(), expected, atol=1e-9)


def test_the_symmetry_defect_of_a_product_is_that_of_its_matrix():
    # neither factor commutes with the other
    law = 0.5 * (TEETH @ DIFFUSE) + 0.5 * (TEETH @ ker.CollisionLaw(ker.henyey_greenstein(0.5), DISK) @ SMOOTH)
    dense = law.operator(*ANGLES).dense()
    expected = np.linalg.norm(dense - dense.T) / (2.0 * np.linalg.norm(dense))
    assert float(law.operator(*ANGLES).symmetry_defect()) == pytest.approx(expected, rel=1e-12)
    assert float(TEETH.symmetry_defect()) < 1e-12


def test_states_keep_their_position():
    rng = np.random.default_rng(RNG)
    position, before = rng.normal(size=(300, 2)), velocities(300)
    at, after = TEETH.sample_states(position, before, rng=RNG)
    assert np.array_equal(at, position) and at is not position
    assert np.array_equal(after, TEETH.sample(before, rng=RNG))
    points = np.array([[0.5, 2.0], [-1.0, 3.0], [0.5, 2.0]])
    theta, psi = np.array([0.4, 1.0, 2.0]), np.array([0.3, 1.0, 2.0])
    value = TEETH.apply_to_states(lambda y, t, p: y[..., 0] * np.cos(t) + y[..., 1] * p, points, theta, psi)
    expected = points[:, 0] * TEETH.apply(lambda t, _: np.cos(t), theta, psi) + points[:, 1] * (np.pi - psi)
    assert np.allclose(value, expected, atol=1e-13)


@pytest.mark.parametrize("half_angle", [0.4, 1.2])
def test_the_law_of_elliptical_arcs_is_discretised_by_the_closed_form(half_angle):
    K = ker.CollisionLaw.from_wall(geo.elliptical_arcs(half_angle, DISK), DISK)
    exact = ker.discretise(ker.CircularArcLaw(half_angle), ANGLES[0])
    found = K.operator(*ANGLES).theta_matrix
    assert found.method == exact.method and float(found.error) < 1e-12
    assert np.max(np.abs(found.symmetric - exact.symmetric)) < 1e-12


def test_the_flip_in_psi_is_discretised_from_isometries_alone():
    psi = ker.Bins(4, weight="sin2")
    law = 0.25 * ker.specular() + 0.75 * (ker.specular() @ ker.specular())
    assert np.allclose(ker.discretise(law, psi).array, 0.25 * np.eye(4)[::-1] + 0.75 * np.eye(4), atol=1e-14)
    assert np.allclose(ker.discretise(ker.specular() ** 3, psi).array, np.eye(4)[::-1], atol=1e-14)
    assert np.allclose(ker.discretise(ker.specular().in_specular_frame(), psi).array, np.eye(4), atol=1e-14)
    flip = ker.discretise(ker.specular(), psi)
    teeth = ker.discretise(TEETH.law, ker.Bins(6))
    pair = ker.TensorBasis((ker.Bins(6), psi))
    matrix = ker.discretise(TEETH, pair)
    assert np.allclose(teeth.tensor(flip).symmetric, matrix.symmetric, atol=1e-13)
    assert matrix.reversible and matrix.mirror_symmetric
    # the flip of four bins is exact, of Frobenius norm 2
    assert float(matrix.error) == pytest.approx(2.0 * float(teeth.error), rel=1e-12)
    assert matrix.law == f"({teeth.law}) x (psi -> pi - psi)"
