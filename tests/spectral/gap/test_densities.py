"""Gaps of densities as users write them: smooth or not, in sums and products, against known eigenvalues."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError


def law_of(function, points, sign, fraction=0.9):
    """1 + c (h - m)(h' - m) as a law that is told the points, and its eigenvalue beside 1."""
    edges = np.unique(np.concatenate((np.linspace(0.0, np.pi, 400), points)))
    node, weight = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(edges)[:, None]
    angle = 0.5 * (edges[1:] + edges[:-1])[:, None] + half * node
    mass = half * weight * 0.5 * np.sin(angle)
    mean = float(np.sum(mass * function(angle)))
    low, high = np.min(function(angle) - mean), np.max(function(angle) - mean)
    c = fraction / abs(low * high) if sign > 0 else -fraction / max(low**2, high**2)

    def density(a, b):
        return (1.0 + c * (function(a) - mean) * (function(b) - mean)) * ker.SINE.density(b)

    return ker.DensityLaw(density, points), c * float(np.sum(mass * (function(angle) - mean) ** 2))


FUNCTIONS = {
    "cosine": (np.cos, []),
    "fast cosine": (lambda a: np.cos(37.0 * a), []),
    "jump": (lambda a: 1.0 * (a < 1.1), [1.1]),
    "narrow tent": (lambda a: np.maximum(1.0 - np.abs(a - 1.1) / 0.035, 0.0), [1.065, 1.1, 1.135]),
    "two near jumps": (lambda a: 1.0 * (np.abs(a - 1.1) < 1e-3), [1.1 - 1e-3, 1.1 + 1e-3]),
    "kink that is not told": (lambda a: np.abs(a - 1.1), []),
}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_gap_of_a_density_is_that_of_its_known_eigenvalue(name, sign):
    law, eigenvalue = law_of(*FUNCTIONS[name], sign)
    gap = spec.spectral_gap(law)
    assert abs(gap.value - (1.0 - max(eigenvalue, 0.0))) <= gap.error + 1e-7 * (name[0] == "k") and gap.error < 1e-6
    assert gap.verdict == ("isolated" if eigenvalue > 0.0 else "essential edge")
    assert min(abs(spec.spectrum(law, 2).values - eigenvalue)) < 1e-6


def test_a_jump_that_is_not_told_beside_an_edge_of_panels_is_refused():
    """A user writes 1.5708 for pi/2, where panels end; the two functions differ by 4e-6."""
    law, _ = law_of(lambda a: 1.0 * (a < 1.5708), [1.5708], 1.0)
    with pytest.raises(InputError, match="integrate to 1"):
        ker.DensityLaw(law._function)


def test_sums_and_products_with_isometries_have_the_eigenvalues_of_their_parts():
    """Of the law with the eigenvalue -1/6 on the cosine, an odd function."""
    law, eigenvalue = law_of(np.cos, [], -1.0, 0.5)
    assert eigenvalue == pytest.approx(-1.0 / 6.0)
    flat, same = ker.specular(), ker.retroreflection()
    for compound, value in (
        (0.5 * law + 0.5 * flat, 0.5), (0.5 * law + 0.5 * same, 0.5), ((0.5 * law + 0.5 * same) @ law, 1.0),
        ((0.5 * law + 0.5 * flat) @ law, 1.0 - (eigenvalue - 1.0) * eigenvalue / 2.0), (law @ flat @ law, 1.0),
        (law.in_specular_frame(), 1.0 + eigenvalue), (law @ law, 1.0 - eigenvalue**2),
    ):  # fmt: skip
        gap = spec.spectral_gap(compound)
        assert abs(gap.value - value) <= gap.error < 1e-9


def test_a_gap_with_a_larger_error_is_not_called_isolated():
    small = 1e-15
    gap = spec.spectral_gap(ker.MatrixLaw([[1.0 - small, small], [small, 1.0 - small]]))
    assert gap.error >= gap.value and gap.verdict == "undecided"
    assert spec.spectral_gap(ker.MatrixLaw([[0.75, 0.25], [0.25, 0.75]])).verdict == "isolated"


class RetroreflectedOrDiffuse(ker.Law):
    """Retroreflection with the probability sin(theta)/2, else Lambertian: not symmetric, and it does not say so."""

    def _sample(self, theta, rng):
        return np.where(rng.random(theta.shape) < 0.5 * np.sin(theta), theta, ker.SINE.sample(theta.shape, rng))

    def _conditionals(self, theta, tolerance, degree, edges):
        kept, diffuse = 0.5 * np.sin(theta), ker.lambertian().conditionals(theta, tolerance, degree, edges)
        atoms = ker.Conditionals.of_atoms(theta[:, None], np.ones((theta.size, 1)), 0.0)
        both = ker.Conditionals.mixed([(1.0, atoms), (1.0, diffuse)])
        first = np.arange(both.nodes.size) == both.starts[:-1][both.owner]
        return both._replace(weights=both.weights * np.where(first, kept[both.owner], 1.0 - kept[both.owner]))


@pytest.mark.parametrize("question", [spec.spectral_gap, spec.spectrum, spec.enclosures])
def test_an_asymmetric_law_is_refused_by_all_questions_for_its_spectrum(question):
    with pytest.raises(AccuracyError, match="not symmetric"):
        question(RetroreflectedOrDiffuse())


class TwoAtoms(ker.Law):
    """Retroreflection with the probability sin(theta)/2, else specular: symmetric, and 1 on all even functions."""

    def _sample(self, theta, rng):
        return np.where(rng.random(theta.shape) < 0.5 * np.sin(theta), theta, np.pi - theta)

    def _conditionals(self, theta, tolerance, degree, edges):
        kept = 0.5 * np.sin(theta)
        return ker.Conditionals.of_atoms(np.stack([theta, np.pi - theta], 1), np.stack([kept, 1.0 - kept], 1), 0.0)


def test_of_a_symmetric_law_of_atoms_all_questions_are_answered():
    assert spec.spectral_gap(TwoAtoms()).value < 1e-6 and spec.spectrum(TwoAtoms(), 3).gap < 1e-6


def test_an_infinite_error_says_why():
    matrix = ker.discretise(ker.henyey_greenstein(0.5), ker.Legendre(2))
    for error, words in (
        (spec.spectral_gap(matrix).error, spec.spectral_gap(matrix).evidence),
        (spec.spectrum(matrix, 2).estimates()[1].error, (spec.spectrum(matrix, 2).estimates()[1].method,)),
    ):
        assert error == np.inf and any("no coarser basis" in word for word in words)


def test_a_feature_between_the_probes_decides_on_the_symmetries():
    law, _ = law_of(*FUNCTIONS["two near jumps"], 1.0)
    assert law.reversible and law.mirror_symmetric is False
