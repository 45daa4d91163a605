"""Enclosures of random compositions, and in random bases, against independently known spectra.

``python -m campaigns.scattered_enclosures`` prints how many intervals contain their eigenvalue and how many indices
are right.

- *Diagonal*: words in HG, specular and Lambertian reflection, and their sums. The eigenvalues on the Legendre
  polynomial of degree l are products and sums of g^l, (-1)^l and 0.
- *Teeth*: HG(a) T HG(a) with triangular teeth T, against a matrix of scipy's Legendre polynomials by Gauss rules on
  many panels; twice as many panels give its error.
- *Given basis*: powers and sums of scatterings, as Henyey-Greenstein laws and as a user's density, random matrices with
  their powers, and circular arcs, in random polynomials, bins and panels.
- *Only apply*: a user's law whose means are sums over a few directions must be refused in every compound.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import starmap

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.estimates import Estimate
from asperity.kernels.laws.phase_function import HenyeyGreensteinLaw

from .pages import print_table

Floats = NDArray[np.float64]

DIAGONAL, TEETH, LISTED, DEGREES = 200, 12, 5, 3000
# A tolerance coarse enough for the truncation of the polynomials to matter.
COARSE = 0.1
# The judge's panels, nodes on each panel, and breakpoints; its rounding.
PANELS, NODES, BREAKPOINTS, ROUNDING = 750, 4, 256, 1e-15
# Number of laws in given bases and of refused laws; eigenvalues of arcs of half angle 1.2 by a second method.
GIVEN, REFUSED, ARC, ARC_ERROR = 120, 12, (1.0, 0.3670253152, -0.311346443), 5e-10


@dataclass(frozen=True)
class Case:
    """A law and its eigenvalues by decreasing modulus, with their error; the constants' eigenvalue is first."""

    law: ker.Law
    exact: Floats
    error: float
    basis: ker.Basis | None = None
    listed: int = LISTED


class FewDirections(ker.Law):
    """Scattering as a user may write it: sums over a few directions, without an error estimate."""

    reversible = mirror_symmetric = True

    def __init__(self, g: float, directions: int) -> None:
        self.law, self.directions = ker.henyey_greenstein(g), directions

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.law.sample(theta, rng)

    def _apply(self, function, theta):  # type: ignore[no-untyped-def]
        out = np.pi * (np.arange(self.directions) + 0.5) / self.directions
        weight = self.law.density(theta[..., None], out)
        return np.tensordot(weight / weight.sum(axis=-1, keepdims=True), function(out), axes=1)


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


def given_case(number: int) -> Case:
    """A law of one of five kinds in a basis of one of three kinds."""
    rng = np.random.default_rng([20261126, number])
    kind, power = number % 5, int(rng.integers(1, 4))
    g, h = rng.uniform(-0.93, 0.93, 2).tolist()
    degree = np.arange(float(DEGREES))
    if kind == 0:
        law, exact = ker.henyey_greenstein(g) ** power, g ** (power * degree)
    elif kind == 1:
        law, exact = _as_density(g) ** power, g ** (power * degree)
    elif kind == 2:
        parts = _as_density(g), ker.henyey_greenstein(h), ker.lambertian()
        law = 0.5 * parts[0] + 0.3 * parts[1] + 0.2 * parts[2]
        exact = 0.5 * g**degree + 0.3 * h**degree + 0.2 * (degree == 0)
    elif kind == 3:
        flux = rng.random((6, 6)) ** 2
        flux = flux + flux.T
        edges = np.concatenate([[0.0], np.sort(rng.uniform(0.1, 3.0, 5)), [np.pi]])
        mass = 0.5 * np.diff(-np.cos(edges))
        for _ in range(5000):
            # symmetric, with the masses of the bins as row sums
            factor = np.sqrt(mass / flux.sum(axis=1))
            flux = factor[:, None] * flux * factor
        array, root = flux / mass[:, None], np.sqrt(mass)
        given = ker.KernelMatrix(root[:, None] * array / root, ker.Bins(edges), Estimate(0.0, 0.0, "bound", "given"))
        law = ker.MatrixLaw(given) ** power
        exact = np.append(np.linalg.eigvalsh(root[:, None] * array / root) ** power, np.zeros(3))
    else:
        law, exact = ker.CircularArcLaw(1.2) ** power, np.array(ARC) ** power
    inner = np.sort(rng.uniform(0.05, 3.09, int(rng.integers(2, 9))))
    bases = (
        ker.Legendre(int(rng.integers(6, 48))), ker.Bins([0.0, *inner, np.pi]),
        ker.Panels([0.0, *inner, np.pi], int(rng.integers(1, 5))),
    )  # fmt: skip
    error = ARC_ERROR if kind == 4 else 4.0 * ROUNDING
    basis = bases[(number // 5) % 3]
    # only three eigenvalues of arcs are known, and coarse bases approximate two of them poorly
    listed = {3: 4, 4: 3 if basis is bases[0] else 2}.get(kind, LISTED)
    return Case(law, _by_modulus(exact), error, basis, min(listed, basis.size))


def _as_density(g: float) -> ker.Law:
    """The scattering as a user's density."""
    return ker.DensityLaw(ker.henyey_greenstein(g).density)


def refused_case(number: int) -> Case:
    """A law by sums over few directions: alone, as a power, in a sum, in a composition."""
    rng = np.random.default_rng([20261127, number])
    law = FewDirections(float(rng.uniform(0.2, 0.9)), int(rng.integers(8, 32)))
    made = (law, law**2, 0.5 * law + 0.5 * ker.lambertian(), law @ ker.specular() @ law)[number % 4]
    return Case(made, np.ones(1), 0.0, (None, ker.Legendre(12), ker.Bins(8))[number // 4 % 3])


def _judge(g: float, law: ker.Law, degrees: int, panels: int) -> Floats:
    node, fraction = np.polynomial.legendre.leggauss(NODES)
    # the law's breakpoints as edges improve the rule without changing its exact values
    edges = np.union1d(np.linspace(0.0, np.pi, panels + 1), law.breakpoints(BREAKPOINTS)[0])
    half = 0.5 * np.diff(edges)[:, None]
    angle = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * node).ravel()
    weight = 0.5 * (half * fraction).ravel() * np.sin(angle)
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
    """Counts of intervals with and without an eigenvalue, and of right and wrong indices."""
    found: Counter[str] = Counter()
    try:
        items = spec.enclosures(case.law, case.listed, case.basis, tolerance)
    except InputError:
        return Counter(refused=1)
    for item in items:
        found["intervals"] += 1
        inside = _inside(item, case)
        found["without an eigenvalue"] += not inside.any()
        if item.index is not None:
            found["indexed"] += 1
            # enclosures whose moduli overlap may be exchanged
            group = [other for other in items if other.index is not None and _overlap(item, other)]
            held = any(inside[other.index] for other in group)
            held &= any(_inside(other, case)[item.index] for other in group)
            found["indexed falsely"] += not held
    return found


def _inside(item: spec.Enclosure, case: Case) -> NDArray[np.bool_]:
    return np.asarray((item.low - case.error <= case.exact) & (case.exact <= item.high + case.error))


def _overlap(one: spec.Enclosure, other: spec.Enclosure) -> bool:
    # the moduli of an interval [a, b] run from max(a, -b, 0) to max(-a, b)
    least = max(max(item.low, -item.high, 0.0) for item in (one, other))
    return least <= min(max(-item.low, item.high) for item in (one, other))


def main() -> None:
    """Print the table."""
    sets = (
        ("words and sums, diagonal", map(diagonal_case, range(DIAGONAL)), 1e-8),
        ("HG, teeth, HG", map(teeth_case, range(TEETH)), 1e-8),
        ("HG, teeth, HG, few polynomials", map(teeth_case, range(TEETH)), COARSE),
        ("given basis", map(given_case, range(GIVEN)), 1e-8),
        ("only apply", map(refused_case, range(REFUSED)), 1e-8),
    )
    counted = "refused", "intervals", "without an eigenvalue", "indexed", "indexed falsely"

    def cells(name: str, cases: Iterable[Case], tolerance: float) -> list[object]:
        rows = [judged(case, tolerance) for case in cases]
        total = sum(rows, Counter())
        return [name, len(rows), *(total[what] for what in counted)]

    print_table(" | ".join(("laws", "number", *counted)), starmap(cells, sets))


if __name__ == "__main__":
    main()
