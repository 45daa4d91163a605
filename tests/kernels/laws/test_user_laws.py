"""Laws and functions of users: they change no arrays, are checked at one door, and have errors that hold."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from campaigns.errors import own_laws
from numpy.polynomial import legendre

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.kernels.laws.law import knows_errors
from asperity.spectral.essential.grazing import grazing_limit

THETA = np.array([0.4, 1.3, 2.6])


def mirrored(theta: np.ndarray) -> np.ndarray:
    return np.pi - theta


@dataclass(frozen=True)
class OwnLaw(ker.Law):
    """A law of two functions."""

    draw: Callable[[np.ndarray], Any] = mirrored
    distribution: Callable[..., Any] = field(
        default=lambda theta, *_: ker.Conditionals.of_atoms((np.pi - theta)[:, None], np.ones((theta.size, 1)), 0.0)
    )

    def _sample(self, theta, rng):
        return self.draw(theta)

    def _conditionals(self, theta, tolerance, degree, edges):
        return self.distribution(theta, degree, edges)

    def __repr__(self):
        return "OwnLaw"


def weighted(*weights: float) -> OwnLaw:
    """A law of atoms at 1 and 2 with these weights, of which it says that they are exact."""
    return OwnLaw(
        distribution=lambda theta, *_: ker.Conditionals.of_atoms(
            np.tile([1.0, 2.0], (theta.size, 1)), np.tile(weights, (theta.size, 1)), 0.0
        )
    )


# ---- copies --------------------------------------------------------------------------------------------------------
def in_place(theta: np.ndarray, *_: Any) -> np.ndarray:
    theta *= -1.0
    theta += np.pi
    return theta


def test_a_law_that_changes_its_argument_is_right_and_changes_no_array_of_the_caller():
    law = OwnLaw(in_place, lambda theta, *_: ker.Conditionals.of_atoms(in_place(theta)[:, None], np.ones((3, 1)), 0.0))
    theta = THETA.copy()
    assert np.array_equal(law.sample(theta, rng=0), mirrored(THETA)) and np.array_equal(theta, THETA)
    assert np.array_equal(law.apply(np.cos, theta), np.cos(mirrored(THETA))) and np.array_equal(theta, THETA)
    basis = ker.Bins(4)
    matrix = ker.discretise(law, basis, "monte-carlo", samples=2**12, rng=0)
    assert np.array_equal(matrix.array != 0.0, np.eye(4)[::-1].astype(bool))
    edges = np.array([1.0, 2.0])
    changing = OwnLaw(distribution=lambda theta, degree, edges: (edges.fill(0.0), OwnLaw().conditionals(theta))[1])
    changing.conditionals(THETA, edges=edges)
    assert edges.tolist() == [1.0, 2.0]


# ---- angles that a law draws ---------------------------------------------------------------------------------------
DRAWS = {
    "beyond pi": (lambda theta: theta + 2.0, r"OwnLaw.*\(0, pi\), got 3\.3 at theta = 1\.3"),
    "nan": (lambda theta: np.where(theta > 1.0, np.nan, theta), r"OwnLaw.*got nan at theta = 1\.3"),
    "one fewer": (lambda theta: theta[:-1], r"OwnLaw.*expected shape \(3,\), got \(2,\)"),
    "complex": (lambda theta: theta + 1j, "OwnLaw.*expected numbers"),
    "nothing": (lambda theta: None, "OwnLaw.*expected numbers"),
    "failure": (lambda theta: [][0], "_sample of OwnLaw failed.*0.4.*IndexError"),
}
CALLS = {
    "sample": lambda law: law.sample(THETA, rng=0),
    "sum": lambda law: (0.5 * law + 0.5 * law).sample(np.tile(THETA, 3), rng=0),
    "composition": lambda law: (law @ ker.henyey_greenstein(0.5)).sample(THETA, rng=0),
    "frame": lambda law: law.in_specular_frame().sample(THETA, rng=0),
    "collision": lambda law: ker.CollisionLaw(law, geo.Disk()).sample(
        np.stack([-np.cos(THETA), -np.sin(THETA), 0.0 * THETA], axis=1), rng=0
    ),
    "matrix": lambda law: ker.discretise(law, ker.Bins(2), "monte-carlo", samples=64, rng=0),
    "position": lambda law: ker.PositionLaw([0.0, 1.0], [law]).sample(0.5, THETA, rng=0),
}


@pytest.mark.parametrize("name", DRAWS)
def test_angles_that_a_law_draws_are_checked(name):
    draw, message = DRAWS[name]
    with pytest.raises(InputError, match=message):
        OwnLaw(draw).sample(THETA, rng=0)


@pytest.mark.parametrize("call", CALLS.values(), ids=list(CALLS))
def test_all_samples_pass_the_door(call):
    call(OwnLaw(lambda theta: list(np.ravel(mirrored(theta))) if np.ndim(theta) else float(theta)))
    for draw in (lambda theta: theta + 9.0, lambda theta: np.full(np.shape(theta), np.nan), lambda theta: 1 / 0):
        with pytest.raises(InputError, match="OwnLaw"):
            call(OwnLaw(draw))


def test_rounding_puts_no_angle_on_an_end():
    out = OwnLaw(lambda theta: np.where(theta < 1.0, 0.0, np.pi)).sample(THETA, rng=0)
    assert np.all((out > 0.0) & (out < np.pi))


def test_the_map_of_a_random_number_passes_the_door():
    class Mapped(OwnLaw):
        def random_map(self):
            return lambda x, theta: (theta + 9.0, None)

    with pytest.raises(InputError, match=r"OwnLaw.*\(0, pi\)"):
        ker.discretise(Mapped(), ker.Bins(2), "qmc", samples=64, rng=0)


# ---- conditional distributions -------------------------------------------------------------------------------------
WEIGHTS = {
    "signed": ((1.5, -0.5), r"OwnLaw.*weights of at least 0, got -0\.5 at theta = "),
    "halves": ((0.25, 0.25), r"OwnLaw.*weights of sum 1 within the error, got 0\.5 at theta = "),
    "nan": ((0.5, np.nan), r"OwnLaw.*weights of at least 0, got nan at theta = "),
    "infinite": ((0.5, np.inf), "OwnLaw.*weights of sum 1"),
    "none": ((0.0, 0.0), "OwnLaw.*at least one atom"),
}
QUESTIONS = {
    "conditionals": lambda law: law.conditionals(THETA),
    "apply": lambda law: law.apply(np.cos, THETA),
    "sum": lambda law: (0.5 * law + 0.5 * ker.lambertian()).apply(np.cos, THETA),
    "composition": lambda law: (ker.henyey_greenstein(0.5) @ law).apply(np.cos, THETA),
    "frame": lambda law: law.in_specular_frame().conditionals(THETA),
    "matrix": lambda law: ker.discretise(law, ker.Legendre(4)),
    "gap": spec.spectral_gap,
    "resistance": ker.resistance,
    "table": lambda law: law.table(4, 5),
    "distance": lambda law: ker.distance(law, ker.lambertian(), kind="rows"),
}


@pytest.mark.parametrize("question", QUESTIONS.values(), ids=list(QUESTIONS))
@pytest.mark.parametrize("name", WEIGHTS)
def test_what_are_no_distributions_is_refused_with_the_angle(name, question):
    weights, message = WEIGHTS[name]
    with pytest.raises(InputError, match=message):
        question(weighted(*weights))


def test_other_answers_than_distributions_are_refused():
    one = ker.lambertian().conditionals(THETA)
    for answer, message in (
        (None, "expected ker.Conditionals, got None"),
        (one._replace(nodes=one.nodes + 3.0), r"outgoing angles in \(0, pi\)"),
        (one._replace(error=-np.ones(3)), "an error of at least 0"),
        (one._replace(starts=one.starts[:-1]), "for each of 3 angles"),
        (ker.lambertian().conditionals(THETA[:2]), "for each of 3 angles"),
    ):
        with pytest.raises(InputError, match=message):
            OwnLaw(distribution=lambda theta, *_, answer=answer: answer).conditionals(THETA)
    with pytest.raises(InputError, match=r"_conditionals of OwnLaw failed.*KeyError"):
        OwnLaw(distribution=lambda *_: {}[1]).conditionals(THETA)


def test_atoms_need_an_error():
    with pytest.raises(TypeError, match="error"):
        ker.Conditionals.of_atoms([[1.0]], [[1.0]])
    with pytest.raises(InputError, match=r"one shape \(angles, atoms\)"):
        ker.Conditionals.of_atoms([[1.0, 2.0]], [[1.0]], 0.0)


# ---- densities -----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Kinked(ker.Law):
    """(1 + c (h(a) - m)(h(b) - m)) sin(b)/2 with h = |cos|^(1/2) away from its zero: a kink that nobody mentions."""

    reversible = True
    mirror_symmetric = False
    kink: float = 0.3
    factor: float = 0.4

    @property
    def moments(self):
        """The mean and the variance of h(u) = |u - kink|^(1/2) for u uniform in (-1, 1), in closed form."""
        low, high = 1.0 + self.kink, 1.0 - self.kink
        mean = (low**1.5 + high**1.5) / 3.0
        return mean, (low**2 + high**2) / 4.0 - mean**2

    def density(self, theta, out):
        mean, _ = self.moments
        height, after = (np.sqrt(np.abs(np.cos(angle) - self.kink)) - mean for angle in (theta, out))
        return 0.5 * np.sin(out) * (1.0 + self.factor * height * after)

    def _sample(self, theta, rng):
        return ker.DensityLaw(self.density).sample(theta, rng)

    def _conditionals(self, theta, tolerance, degree, edges):
        return ker.Conditionals.of_density(self.density, theta, degree, edges, tolerance=tolerance)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_the_gap_of_a_density_with_a_kink_that_nobody_mentions_has_an_error_that_holds(tolerance):
    law = Kinked()
    gap = spec.spectral_gap(law, tolerance=tolerance)
    assert abs(float(gap) - (1.0 - law.factor * law.moments[1])) <= gap.error + 1e-14


@dataclass(frozen=True)
class Bent(Kinked):
    """The same with h(u) = |u - kink|: integrals of polynomials and of distribution functions are elementary."""

    factor: float = 0.9

    def density(self, theta, out):
        height, after = (np.abs(np.cos(angle) - self.kink) - self.mean for angle in (theta, out))
        return 0.5 * np.sin(out) * (1.0 + self.factor * height * after)

    @property
    def mean(self):
        return 0.5 * (1.0 + self.kink**2)

    def integral(self, function, breaks=()):
        """That of a function of u over (-1, 1), which is a polynomial between the kink and the breaks."""
        ends = np.unique([-1.0, self.kink, *breaks, 1.0])
        nodes, weights = np.polynomial.legendre.leggauss(8)
        half = 0.5 * np.diff(ends)[:, None]
        return np.sum(half * weights * function(0.5 * (ends[1:] + ends[:-1])[:, None] + half * nodes))


# at the first two the rules of Gauss and Kronrod agree by chance
KINKS = (0.012131502700984842, -0.09776620855528517, *np.cos(np.linspace(0.1, 3.0, 11) ** 1.1))
POLYNOMIALS = np.eye(5) * np.sqrt(2.0 * np.arange(5) + 1.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-5])
def test_matrices_of_densities_with_a_kink_that_nobody_mentions_have_errors_that_hold(tolerance):
    for kink in KINKS:
        law = Bent(kink)
        means = [
            0.5 * law.integral(lambda u, p=p, law=law: (np.abs(u - law.kink) - law.mean) * legendre.legval(u, p))
            for p in POLYNOMIALS
        ]
        exact = law.factor * np.outer(means, means)
        exact[0, 0] += 1.0
        for one in (law, ker.DensityLaw(law.density)):
            P = ker.discretise(one, ker.Legendre(5), tolerance=tolerance)
            assert np.linalg.norm(P.symmetric - exact) <= float(P.error)


@pytest.mark.slow
def test_matrices_in_bins_of_densities_with_a_narrow_tent_that_nobody_mentions_have_errors_that_hold():
    at, width = 1.7754339081045577, 0.07
    kinks = (at - width, at, at + width)
    edges = np.unique((0.0, *kinks, np.pi))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(edges)[:, None]
    angle = (0.5 * (edges[1:] + edges[:-1]))[:, None] + half * nodes

    def tent(theta):
        return np.maximum(1.0 - np.abs(theta - at) / width, 0.0)

    mean = np.sum(half * weights * tent(angle) * 0.5 * np.sin(angle))

    def density(theta, out):
        return 0.5 * np.sin(out) * (1.0 + 0.9 * (tent(theta) - mean) * (tent(out) - mean))

    known = ker.discretise(ker.DensityLaw(density, kinks), ker.Bins(4))
    found = ker.discretise(ker.DensityLaw(density), ker.Bins(4), tolerance=1e-6)
    assert np.linalg.norm(found.symmetric - known.symmetric) <= float(found.error) and float(known.error) < 1e-8


def test_distances_of_densities_with_a_kink_that_nobody_mentions_have_errors_that_hold():
    for kink in KINKS:
        law = Bent(kink)

        def primitive(u, law=law):
            """The integral of (h - m)/2 from -1 to u."""
            left, right = np.minimum(u, law.kink), np.maximum(u, law.kink)
            return 0.25 * (
                (1.0 + law.kink) ** 2 - (law.kink - left) ** 2 + (right - law.kink) ** 2
            ) - 0.5 * law.mean * (u + 1.0)

        # the distance of the angles is the area between the distribution functions in the angle
        angle = np.linspace(0.0, np.pi, 400_001)
        area = np.trapezoid(np.abs(primitive(np.cos(angle))), angle)
        turn = [law.kink - law.mean, law.kink + law.mean]
        spread = 0.5 * law.integral(
            lambda u, law=law: np.abs(np.abs(u - law.kink) - law.mean), np.clip(turn, -1.0, 1.0)
        )
        found = ker.distance(law, ker.lambertian(), kind="rows", tolerance=1e-3)
        assert abs(float(found) - law.factor * area * spread) <= found.error + 1e-9


def test_a_law_that_is_not_symmetric_may_not_say_that_it_is():
    class OneWay(Bent):
        def density(self, theta, out):
            return (
                0.5 * np.sin(out) * (1.0 + self.factor * np.cos(theta) * (np.abs(np.cos(out) - self.kink) - self.mean))
            )

    class Honest(OneWay):
        reversible = False

    for question in (spec.spectral_gap, spec.mixing_time, lambda law: ker.discretise(law, ker.Legendre(8))):
        with pytest.raises(InputError, match=r"reversible: .* says that it is, .*: say reversible = False"):
            question(OneWay())
    P = ker.discretise(Honest(), ker.Legendre(8))
    assert abs(P.array - P.array.T).max() > 0.01


def test_densities_that_are_none_are_refused_with_the_angle():
    for factor, message in (
        (0.5, r"integral of 1 .*got 0\.5 at theta = 1"),
        (-1.0, "values of at least 0, got -.* at theta = 1, theta' = "),
        (np.nan, "finite values of at least 0, got nan"),
    ):
        with pytest.raises(InputError, match=message):
            ker.Conditionals.of_density(lambda a, b, factor=factor: factor * 0.5 * np.sin(b), [1.0], 2, ())


def test_the_remedies_for_a_narrow_peak_work():
    def density(a, b):
        return 0.5 * np.sin(b) * 0.5 + 0.5 * np.exp(-0.5 * ((b - 1.0) / 1e-7) ** 2) / (np.sqrt(2.0 * np.pi) * 1e-7)

    with pytest.raises(InputError, match="give angles beside a peak narrower than 1e-4 as breakpoints"):
        ker.Conditionals.of_density(density, [0.5], 2, ())
    found = ker.Conditionals.of_density(density, [0.5], 2, (), breakpoints=[1.0 - 1e-6, 1.0 + 1e-6])
    assert abs(found.mean(np.cos)[0] - 0.5 * np.cos(1.0) * np.exp(-0.5e-14)) <= found.error[0] < 1e-9
    half = ker.Conditionals.of_density(lambda a, b: 2.0 * (0.25 * np.sin(b)), [0.5], 2, ())
    assert half.error[0] < 1e-14


# ---- functions -----------------------------------------------------------------------------------------------------
def below(x: float) -> float:
    """The probability of an angle below x under sin/2."""
    return float(np.sin(0.5 * x) ** 2)


FUNCTIONS: dict[str, tuple[Callable[[Any], Any], float]] = {
    "step": (lambda x: x < 1.0, below(1.0)),
    "two steps": (lambda x: (x > 1.1) & (x < 1.2), below(1.2) - below(1.1)),
    "cos(1000 x)": (lambda x: np.cos(1000.0 * x), -1.0 / (1000.0**2 - 1.0)),
    "kink": (lambda x: np.abs(np.cos(x) - 0.3), 0.5 * (1.0 + 0.3**2)),
    "root": (lambda x: np.sqrt(np.abs(np.cos(x) - 0.3)), (1.3**1.5 + 0.7**1.5) / 3.0),
    "1/sin(x/2)^(1/2)": (lambda x: 1.0 / np.sqrt(np.sin(0.5 * x)), 4.0 / 3.0),
    "many steps": (lambda x: np.floor(20.0 * np.cos(x)), -0.5),
}
LAWS: dict[str, Callable[[float, Callable[..., Any]], float]] = {
    "lambertian()": lambda mean, f: mean,
    "maxwell(0.25)": lambda mean, f: 0.25 * mean + 0.75 * float(f(np.pi - 0.7)),
    "MatrixLaw(np.full((4, 4), 0.25))": lambda mean, f: mean,
    "lambertian() @ ker.TriangularTeethLaw(1.1) @ ker.retroreflection()": lambda mean, f: mean,
    "maxwell(0.25) @ ker.maxwell(0.5)": lambda mean, f: 0.625 * mean + 0.375 * float(f(0.7)),
    "lambertian().in_specular_frame()": lambda mean, f: mean,
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_that_are_not_smooth_have_their_means(name, law):
    function, mean = FUNCTIONS[name]
    found = eval(f"ker.{law}", {"ker": ker, "np": np}).apply(function, 0.7)
    wanted = LAWS[law](mean, function)
    assert abs(float(found) - wanted) <= 1e-8 * max(1.0, abs(wanted))


def test_collisions_average_them_too():
    K, psi = ker.CollisionLaw(ker.lambertian(), geo.Disk()), np.array([0.5, 2.0])
    found = K.apply(lambda theta, psi: (theta < 1.0) * psi, 0.7, psi)
    assert np.abs(found - below(1.0) * (np.pi - psi)).max() < 1e-12


@pytest.mark.parametrize(
    ("function", "where"),
    [
        (lambda x: x**-1.9, r"near theta' = \d.*e-"),
        (lambda x: np.random.default_rng(0).random(np.shape(x)), "near theta' = "),
        (lambda x: np.where(x > 2.0, np.nan, 1.0), r"near theta' = (2|1\.99)"),
    ],
    ids=["x^-1.9", "noise", "nan"],
)
def test_functions_that_are_not_resolved_are_refused(function, where):
    for law in (ker.lambertian(), ker.maxwell(0.3), ker.MatrixLaw(np.full((4, 4), 0.25))):
        with pytest.raises(AccuracyError, match=where) as reason:
            law.apply(function, 0.7)
        assert not reason.value.defect < 1e-9
    assert np.isfinite(ker.specular().apply(function, 2.0))


def test_the_remedy_for_a_function_that_is_not_resolved_works():
    # two steps so close that no first node sees them
    def hidden(x: np.ndarray) -> np.ndarray:
        return np.abs(x - 1.1001) < 1e-5

    found = ker.lambertian().apply(hidden, 0.7, edges=[1.1001 - 1e-5, 1.1001 + 1e-5])
    assert abs(found - (below(1.1001 + 1e-5) - below(1.1001 - 1e-5))) < 1e-14


def test_atoms_average_any_function_exactly():
    for law in (ker.specular(), ker.TriangularTeethLaw(1.1), ker.retroreflection() @ ker.specular()):
        probability, outgoing = law.branches(0.7)
        exact = float(probability @ np.sin(1e6 * outgoing))
        assert float(law.apply(lambda x: np.sin(1e6 * x), 0.7)) == pytest.approx(exact, rel=1e-14)


def test_the_campaign_draws_laws_that_are_broken_on_purpose():
    kinds = {own_laws.draw(number).kind for number in range(200)}
    assert kinds == set(own_laws.KINDS) and any(own_laws.draw(number).broken for number in range(10))


@dataclass(frozen=True)
class Noted(OwnLaw):
    note: Any = ()


@pytest.mark.parametrize("note", [(), []], ids=["with a hash", "without"])
def test_what_is_known_of_a_law_is_asked_once(note):
    asked = []

    def distribution(theta, *_):
        asked.append(theta.size)
        return ker.Conditionals.of_atoms((np.pi - theta)[:, None], np.ones((theta.size, 1)), 0.0)

    law = Noted(distribution=distribution, note=note)
    assert knows_errors(law) and knows_errors(law) and len(asked) == 1
    first, number = grazing_limit(law), len(asked)
    assert np.array_equal(grazing_limit(law).matrix, first.matrix)
    # without a hash nothing tells that the law is the same
    assert (len(asked) == number) == (note == ())
