"""Enclosures of mixtures with isometries, whose conditional distributions are exact."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.bases.assembly import largest_square_sum

ARC = ker.CircularArcLaw(0.9)
# the gaps and errors of matrices of 96 polynomials or less
LAWS = {
    "specular, arcs": (0.5 * ker.specular() + 0.5 * ARC, "isolated", 0.3824122),
    "specular, dispersing": (
        0.3 * ker.specular() + 0.7 * ker.WallLaw(geo.dispersing_arcs(1.0)), "isolated", 0.5013328,
    ),
    "triangular, arcs": (0.3 * ker.TriangularTeethLaw(1.1) + 0.7 * ARC, "isolated", 0.6836728),
    "rectangular, lambertian": (
        0.2 * ker.RectangularTeethLaw(0.8) + 0.8 * ker.lambertian(), "essential edge", 0.7921222,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("law", "verdict", "gap"), LAWS.values(), ids=LAWS)
def test_gaps_of_mixtures_with_isometries_are_enclosed_to_the_tolerance(law, verdict, gap):
    found = spec.spectral_gap(law, tolerance=1e-6)
    assert found.verdict == verdict and found.error <= 1e-6
    assert abs(float(found) - gap) <= found.error + 1e-7


@pytest.mark.parametrize("basis", [ker.Bins(5), ker.Panels(np.linspace(0.0, np.pi, 4), 3)], ids=repr)
@pytest.mark.parametrize("law", [one for one, *_ in LAWS.values()], ids=LAWS)
def test_conditionals_of_mixtures_are_those_of_their_terms_within_the_errors(law, basis):
    theta = np.array([0.2, 0.9, 1.7, 2.8])
    found = law.conditionals(theta, 1e-7, 4 if isinstance(basis, ker.Panels) else 0, basis.edges[1:-1])
    of_terms = [(weight, term.conditionals(theta, 1e-9, 8, basis.edges[1:-1])) for weight, term in law.terms]
    means = sum(weight * term.in_basis(basis) for weight, term in of_terms)
    wrong = np.linalg.norm(found.in_basis(basis) - means, axis=1)
    assert np.all(wrong <= np.sqrt(largest_square_sum(basis)) * (found.error + 1e-9))
    assert np.allclose(found.masses(basis.edges).sum(axis=1), 1.0, rtol=0.0, atol=1e-14)
