"""Enclosures of random compositions with Henyey-Greenstein scatterings against spectra that are known otherwise.

``python -m benchmarks.scattered_enclosures`` prints how many intervals hold their eigenvalue and how many indices are
right. *Diagonal*: words in HG, specular and Lambertian reflection and sums of these, whose eigenvalues on the Legendre
polynomial of degree l are products and sums of g^l, (-1)^l and 0. *Teeth*: HG(a) T HG(a) with triangular teeth T,
against a matrix of scipy's Legendre polynomials by Gauss rules on many panels, with twice as many for its error.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.phase_function import HenyeyGreensteinLaw

Floats = NDArray[np.float64]

DIAGONAL, TEETH, LISTED, DEGREES = 200, 12, 5, 3000
# A tolerance so coarse that what the polynomials leave out shows.
COARSE = 0.1
# The judge's panels, nodes on each, and kinks; differences of roundings.
PANELS, NODES, KINKS, ROUNDING = 750, 4, 256, 1e-15


@dataclass(frozen=True)
class Case:
    """A law and its eigenvalues by modulus, the constants' first, with their error."""

    law: ker.Law
    exact: Floats
    error: float


def diagonal_case(number: int) -> Case:
    """A random word, or a sum of two or three."""
    rng = np.random.default_rng([20261124, number])
    degree = np.arange(float(DEGREES))
    terms: list[tuple[ker.Law, Floats]] = []
    for _ in range(int(rng.integers(1, 4))):
        laws: list[ker.Law] = [ker.henyey_greenstein(float(rng.uniform(-0.95, 0.95)))]
        laws += [ker.henyey_greenstein(float(rng.uniform(-0.95, 0.95))) for _ in range(int(rng.integers(0, 2)))]
        laws += [ker.specular()] * int(rng.integers(0, 2)) + [ker.lambertian()] * int(rng.random() < 0.1)
        if terms and rng.random() < 0.3:
            laws = [ker.specular()]
        values = np.ones(DEGREES)
        for law in laws:
            if isinstance(law, HenyeyGreensteinLaw):
                values = values * law.g**degree
            else:
                values = values * (np.where(degree % 2, -1.0, 1.0) if law == ker.specular() else degree == 0)
        order = rng.permutation(len(laws))
        word = laws[order[0]]
        for place in order[1:]:
            word = word @ laws[place]
        terms.append((word, values))
    weights = rng.dirichlet(np.ones(len(terms)))
    weights[-1] = 1.0 - weights[:-1].sum()
    law, exact = terms[0]
    if len(terms) > 1:
        law = sum((float(w) * one for w, (one, _) in zip(weights[1:], terms[1:], strict=True)), float(weights[0]) * law)
        exact = sum(w * values for w, (_, values) in zip(weights, terms, strict=True))
    return Case(law, np.append(1.0, _by_modulus(exact[1:])), ROUNDING)


def teeth_case(number: int) -> Case:
    """A scattering before and after random triangular teeth."""
    rng = np.random.default_rng([20261125, number])
    g, teeth = float(rng.uniform(0.1, 0.7)), ker.TriangularTeethLaw(float(rng.uniform(0.2, 1.3)))
    degrees = int(np.ceil(np.log(1e-13) / np.log(g)))
    found = [_by_modulus(np.linalg.eigvalsh(_judge(g, teeth, degrees, many * PANELS))) for many in (1, 2)]
    error = float(np.abs(found[1] - found[0])[:LISTED].max())
    scattering = ker.henyey_greenstein(g)
    return Case(scattering @ teeth @ scattering, found[1], 2.0 * error + ROUNDING)


def _judge(g: float, law: ker.Law, degrees: int, panels: int) -> Floats:
    node, share = np.polynomial.legendre.leggauss(NODES)
    # kinks of the law as edges: they make the rule better, not its values others
    edges = np.union1d(np.linspace(0.0, np.pi, panels + 1), law.kinks(KINKS)[0])
    half = 0.5 * np.diff(edges)[:, None]
    angle = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * node).ravel()
    weight = 0.5 * (half * share).ravel() * np.sin(angle)
    degree = np.arange(degrees)

    def values(theta: Floats) -> Floats:
        return np.sqrt(2.0 * degree + 1.0) * eval_legendre(degree, np.cos(theta)[..., None])

    probability, outgoing = law.branches(angle)
    image = np.einsum("ab,abn->an", probability, values(np.nan_to_num(outgoing)))
    matrix = g ** degree[:, None] * (values(angle).T @ (weight[:, None] * image)) * g**degree
    return np.asarray(0.5 * (matrix + matrix.T))


def _by_modulus(values: Floats) -> Floats:
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])


def judged(case: Case, tolerance: float = 1e-8) -> Counter[str]:
    """How many intervals hold an eigenvalue, and how many indices are right; what is wrong by its name."""
    found: Counter[str] = Counter()
    for item in spec.enclosures(case.law, LISTED, tolerance=tolerance):
        low, high = item.low - case.error, item.high + case.error
        found["intervals"] += 1
        inside = (low <= case.exact) & (case.exact <= high)
        found["without an eigenvalue"] += not inside.any()
        if item.index is not None:
            found["indexed"] += 1
            found["indexed falsely"] += not inside[item.index]
    return found


def main() -> None:
    """Print the table."""
    print("| laws | compositions | intervals | without an eigenvalue | indexed | indexed falsely |")
    print("|---|---|---|---|---|---|")
    for name, cases, tolerance in (
        ("words and sums, diagonal", map(diagonal_case, range(DIAGONAL)), 1e-8),
        ("HG, teeth, HG", map(teeth_case, range(TEETH)), 1e-8),
        ("HG, teeth, HG, few polynomials", map(teeth_case, range(TEETH)), COARSE),
    ):
        rows = [judged(case, tolerance) for case in cases]
        total = sum(rows, Counter())
        print(
            f"| {name} | {len(rows)} | {total['intervals']} | {total['without an eigenvalue']} | {total['indexed']} "
            f"| {total['indexed falsely']} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
