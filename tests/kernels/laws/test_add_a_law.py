"""The recipe "Add a law" of CONTRIBUTING.md: one dataclass with `_sample` and `_conditionals`."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.kernels.laws.law import is_atomic
from asperity.spectral.essential.edge import essential_edge

G = 0.2


@dataclass(frozen=True)
class LinearLaw(ker.Law):
    """cos(theta') = u' has the density (1 + 3 g u u')/2: the eigenvalues are 1, g on cos(theta), and 0."""

    g: float

    reversible = True
    mirror_symmetric = True

    def _sample(self, theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        slope, draw = 3.0 * self.g * np.cos(theta), rng.random(theta.shape)
        return np.arccos((slope + 4.0 * draw - 2.0) / (1.0 + np.sqrt((1.0 - slope) ** 2 + 4.0 * slope * draw)))

    def _conditionals(self, theta: np.ndarray, tolerance: float, degree: int, edges: np.ndarray) -> ker.Conditionals:
        def density(angle: np.ndarray, out: np.ndarray) -> np.ndarray:
            return 0.5 * np.sin(out) * (1.0 + 3.0 * self.g * np.cos(angle) * np.cos(out))

        return ker.Conditionals.of_density(density, theta, degree, edges, tolerance=tolerance)


LAW = LinearLaw(G)


@pytest.mark.parametrize(
    ("law", "atomic"),
    [
        (LAW, False), (ker.specular(), True), (ker.LeastResistanceLaw(), True), (ker.lambertian(), False),
        (ker.TriangularTeethLaw(0.7) @ ker.RectangularTeethLaw(0.8), True), (ker.CircularArcLaw(1.2), False),
        (ker.DensityLaw(lambda u, v: 0.5 * np.sin(v) * (1.0 + 0.5 * (np.abs(np.cos(u) - np.cos(v)) - 0.5 * (
            2.0 + np.cos(u) ** 2 + np.cos(v) ** 2) + 2.0 / 3.0))), False),
        (ker.WallLaw(geo.dispersing_arcs(1.0)), False), (ker.henyey_greenstein(0.999), False),
    ],
    ids=repr,
)  # fmt: skip
def test_only_finitely_many_atoms_average_any_function_exactly(law: ker.Law, atomic: bool) -> None:
    assert is_atomic(law) == atomic


def second(law: ker.Law) -> float:
    """<e_1, P e_1> with e_1 = 3^(1/2) cos(theta)."""
    return float(ker.discretise(law, ker.Legendre(4)).symmetric[1, 1])


def test_a_law_of_two_methods_has_matrices_a_spectrum_and_a_resistance() -> None:
    law = LAW
    matrix = ker.discretise(law, ker.Legendre(4), tolerance=1e-10)
    assert np.abs(matrix.symmetric - np.diag([1.0, G, 0.0, 0.0])).max() <= float(matrix.error) + 1e-12
    binned = ker.discretise(law, ker.Bins(6), "monte-carlo", samples=2**14)
    centres = (np.arange(6) - 2.5) / 3.0
    exact = (1.0 + 3.0 * G * np.outer(centres, centres)) / 6.0
    # the error is a quantile of 95 %
    assert np.linalg.norm(binned.symmetric - exact) <= 1.5 * float(binned.error)
    assert spec.spectrum(law, 2).values == pytest.approx([1.0, G], abs=1e-8)
    gap = spec.spectral_gap(law, tolerance=1e-6)
    assert abs(float(gap) - (1.0 - G)) <= gap.error + 1e-12
    assert float(ker.resistance(law)) == pytest.approx(0.75 * (1.0 + G / 3.0 + math.pi**2 / 16.0), abs=1e-9)


def test_a_law_composes_mixes_and_changes_its_frame() -> None:
    law = LAW
    assert second(law @ law) == second(law**2) == pytest.approx(G**2, abs=1e-9)
    assert second(0.25 * law + 0.75 * ker.lambertian()) == pytest.approx(0.25 * G, abs=1e-9)
    assert second(law.in_specular_frame()) == pytest.approx(-G, abs=1e-9)
    assert second(ker.TriangularTeethLaw(1.1) @ law) == pytest.approx(G * second(ker.TriangularTeethLaw(1.1)), abs=1e-8)


def test_distances_are_those_of_the_conditional_distributions() -> None:
    # W_1 between the conditional distributions at theta is 3 g |cos(theta)| pi/8
    exact = 3.0 * G * math.pi / 16.0
    found = ker.distance(LAW, ker.lambertian(), kind="rows", tolerance=1e-4)
    assert abs(float(found) - exact) <= found.error <= 1e-4
    mirrored = ker.distance(LAW.in_specular_frame(), ker.lambertian().in_specular_frame(), kind="rows")
    assert abs(float(mirrored) - exact) <= mirrored.error
    mixed = ker.distance(0.5 * LAW + 0.5 * ker.lambertian(), ker.lambertian(), kind="rows")
    assert abs(float(mixed) - 0.5 * exact) <= mixed.error
    product = ker.distance(LAW @ ker.specular(), ker.lambertian(), kind="rows", tolerance=1e-2)
    assert abs(float(product) - exact) <= product.error


def test_what_a_law_does_not_say_has_a_default() -> None:
    law = LAW
    assert law.random_map() is law.isometry_table() is None and law.parts == ((1.0, law),)
    points, left_out = law.breakpoints(8)
    assert points.size == law.outgoing_breakpoints.size == 0 and left_out == math.inf
    basis = ker.Legendre(2)
    found = law.conditionals(1.0)
    assert found.in_basis(basis) @ basis.project(np.cos) == pytest.approx([G * math.cos(1.0)])
    assert 0.0 < float(found.error[0]) < 1e-14
    with pytest.raises(InputError, match="no method 'qmc'"):
        ker.discretise(law, ker.Bins(4), "qmc")


class SameFacts(ker.Law):
    """A law of a user's that states what one of ours states."""

    def __init__(self, law: ker.Law) -> None:
        self.law = law
        for name in ("reversible", "mirror_symmetric", "is_lambertian", "retro", "outgoing_breakpoints", "is_driven"):
            setattr(self, name, getattr(law, name))

    has_density = property(lambda self: self.law.has_density)
    eigenvalue_ratio = property(lambda self: self.law.eigenvalue_ratio)
    is_compact = property(lambda self: self.law.is_compact)
    is_isometric = property(lambda self: self.law.is_isometric)
    keeps_sine = property(lambda self: self.law.keeps_sine)
    lambertian_fraction = property(lambda self: self.law.lambertian_fraction)
    angle_map = property(lambda self: self.law.angle_map)
    traced_wall = property(lambda self: self.law.traced_wall)

    def _sample(self, theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return self.law._sample(theta, rng)

    def _conditionals(self, theta: np.ndarray, tolerance: float, degree: int, edges: np.ndarray) -> ker.Conditionals:
        return self.law._conditionals(theta, tolerance, degree, edges)

    def _branches(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        return self.law._branches(theta)

    def breakpoints(self, limit: int) -> tuple[np.ndarray, float]:
        return self.law.breakpoints(limit)

    def random_map(self):
        return self.law.random_map()

    def isometry_table(self):
        return self.law.isometry_table()


HG = ker.henyey_greenstein(0.4)
TOOLS = {
    "gap": lambda law: spec.spectral_gap(law, tolerance=1e-5),
    "relaxation": lambda law: spec.mixing_time(law, 0.01, "L2").relaxation_time,
    "accommodation": lambda law: spec.accommodation(law).tangential, "resistance": ker.resistance,
    "transmission": lambda law: spec.transmission(law, 0.5, tolerance=5e-4, rng=0), "diffusivity": spec.diffusivity,
    "specular share": spec.specular_share, "edge": lambda law: essential_edge(law).value,
    "norm": lambda law: spec.hilbert_schmidt_norm(law).value,
    "matrix": lambda law: ker.discretise(law, ker.Legendre(4)).symmetric[1, 1],
    "distance": lambda law: ker.distance(law, ker.lambertian(), kind="rows", tolerance=1e-3),
}  # fmt: skip


def exchange() -> ker.Law:
    return ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))


LAWS = [
    ker.specular(), ker.retroreflection(), ker.lambertian(), ker.henyey_greenstein(-0.3), ker.TriangularTeethLaw(0.7),
    ker.RectangularTeethLaw(0.8), ker.InvolutionLaw(lambda theta: np.pi - theta), exchange(),
]  # fmt: skip


def facts_of(law: ker.Law) -> tuple:
    """What a law states, without arrays and functions."""
    return (
        law.has_density, law.eigenvalue_ratio, law.is_compact, law.is_isometric, law.keeps_sine, law.is_driven,
        law.lambertian_fraction, law.angle_map is None, law.traced_wall, law.is_lambertian, law.retro,
    )  # fmt: skip


def test_every_fact_of_a_law_is_told_by_some_law_and_has_a_default() -> None:
    told = [*map(facts_of, [*LAWS, ker.CircularArcLaw(1.0), ker.WallLaw(geo.dispersing_arcs(1.0))])]
    default = facts_of(LAW)
    assert default == (False, None, False, False, False, False, 0.0, True, None, False, None)
    assert all(len({repr(fact) for fact in column}) > 1 for column in zip(*told, strict=True))


@pytest.mark.filterwarnings("ignore:diffusivity")
@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_a_law_with_the_facts_of_ours_gets_the_same_answers(law: ker.Law, tool: str) -> None:
    if tool == "specular share" and law.angle_map is not None:
        pytest.skip("the fraction of a law given by a map is refused")
    ours, theirs = (TOOLS[tool](0.3 * one + 0.7 * HG) for one in (law, SameFacts(law)))
    allowed = sum(getattr(answer, "error", 0.0) for answer in (ours, theirs))
    assert float(theirs) == pytest.approx(float(ours), rel=1e-7, abs=allowed)
    # within a factor, or as exact as anybody could want
    assert getattr(theirs, "error", 0.0) <= max(3.0 * getattr(ours, "error", 0.0), 2e-5)
