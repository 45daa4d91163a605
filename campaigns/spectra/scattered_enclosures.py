"""Enclosures of random sums, and in random bases, against independently known spectra.

- *Diagonal*: sums of HG laws, in one frame or the other, specular and Lambertian reflection. The eigenvalues on the
  Legendre polynomial of degree l are sums of g^l, (-g)^l, (-1)^l and 0.
- *Given basis*: powers and sums of scatterings, as Henyey-Greenstein laws and as a user's density, random matrices with
  their powers, and circular arcs, in random polynomials, bins and panels.
- *Only apply*: a user's law whose means are sums over a few directions must be refused in every compound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.errors import InputError
from asperity.estimates import Estimate
from asperity.kernels.expectations.conditionals import Conditionals
from asperity.kernels.laws.law import sum_of
from asperity.spectral.bounds.enclosure import Enclosure
from campaigns.engine import Campaign, Judged

DIAGONAL, GIVEN, REFUSED = 200, 120, 12
LISTED, DEGREES = 5, 3000
TOLERANCES = 1e-8, 0.1
ROUNDING = 1e-15
# Eigenvalues of arcs of half angle 1.2 by a second method.
ARC, ARC_ERROR = (1.0, 0.3670253152, -0.311346443), 5e-10


@dataclass(frozen=True)
class Case:
    """A law and its eigenvalues by decreasing modulus, with their error; the constants' eigenvalue is first."""

    kind: str
    law: ker.Law
    exact: Floats
    error: float = ROUNDING
    basis: ker.Basis | None = None
    listed: int = LISTED
    tolerances: tuple[float, ...] = TOLERANCES


class FewDirections(ker.Law):
    """Scattering as a user may write it: sums over a few directions, without an error estimate."""

    reversible = mirror_symmetric = True

    def __init__(self, g: float, directions: int) -> None:
        self.law, self.directions = ker.henyey_greenstein(g), directions

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.law.sample(theta, rng)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        out = np.pi * (np.arange(self.directions) + 0.5) / self.directions
        weight = self.law.density(theta[:, None], out)
        return Conditionals.of_atoms(np.broadcast_to(out, weight.shape), weight / weight.sum(axis=1)[:, None], np.nan)


def draw_diagonal(number: int) -> Case:
    """One to three laws that are diagonal in Legendre polynomials, with random weights."""
    rng = np.random.default_rng([20261124, number])
    degree = np.arange(float(DEGREES))
    terms: list[tuple[ker.Law, Floats]] = []
    for _ in range(int(rng.integers(1, 4))):
        g, kind = float(rng.uniform(-0.95, 0.95)), rng.random()
        if terms and kind < 0.3:
            terms.append((ker.specular(), np.where(degree % 2, -1.0, 1.0)))
        elif kind > 0.9:
            terms.append((ker.lambertian(), 1.0 * (degree == 0)))
        else:
            terms.append((ker.henyey_greenstein(g), g**degree))
    weights = rng.dirichlet(np.ones(len(terms)))
    weights[-1] = 1.0 - weights[:-1].sum()
    law = sum_of(tuple(zip(weights.tolist(), (one for one, _ in terms), strict=True)))
    exact = sum(w * values for w, (_, values) in zip(weights, terms, strict=True))
    if rng.random() < 0.3:
        law, exact = law.in_specular_frame(), np.where(degree % 2, -1.0, 1.0) * exact
    return Case("sums, diagonal", law, np.append(1.0, _by_modulus(exact[1:])))


def draw_given(number: int) -> Case:
    """A law of one of five kinds in a basis of one of three kinds."""
    rng = np.random.default_rng([20261126, number])
    kind, power = number % 5, int(rng.integers(1, 4))
    g, h = rng.uniform(-0.93, 0.93, 2).tolist()
    degree, error = np.arange(float(DEGREES)), 4.0 * ROUNDING
    # the first scattering as a user's density
    density = ker.DensityLaw(ker.henyey_greenstein(g).density)
    if kind < 2:
        law, exact = (ker.henyey_greenstein(g), density)[kind] ** power, g ** (power * degree)
    elif kind == 2:
        law = 0.5 * density + 0.3 * ker.henyey_greenstein(h) + 0.2 * ker.lambertian()
        exact = 0.5 * g**degree + 0.3 * h**degree + 0.2 * (degree == 0)
    elif kind == 3:
        given = _random_matrix(rng)
        law, exact = ker.MatrixLaw(given) ** power, np.append(np.linalg.eigvalsh(given.symmetric) ** power, np.zeros(3))
    else:
        law, exact, error = ker.CircularArcLaw(1.2) ** power, np.array(ARC) ** power, ARC_ERROR
    inner = np.sort(rng.uniform(0.05, 3.09, int(rng.integers(2, 9))))
    bases = (
        ker.Legendre(int(rng.integers(6, 48))), ker.Bins([0.0, *inner, np.pi]),
        ker.Panels([0.0, *inner, np.pi], int(rng.integers(1, 5))),
    )  # fmt: skip
    basis = bases[(number // 5) % 3]
    # only three eigenvalues of arcs are known, and coarse bases approximate two of them poorly
    listed = {3: 4, 4: 3 if basis is bases[0] else 2}.get(kind, LISTED)
    return Case("given basis", law, _by_modulus(exact), error, basis, min(listed, basis.size), TOLERANCES[:1])


def _random_matrix(rng: np.random.Generator) -> ker.KernelMatrix:
    """A symmetric flux on random bins with the masses of the bins as row sums."""
    flux = rng.random((6, 6)) ** 2
    flux = flux + flux.T
    edges = np.concatenate([[0.0], np.sort(rng.uniform(0.1, 3.0, 5)), [np.pi]])
    mass = 0.5 * np.diff(-np.cos(edges))
    for _ in range(5000):
        factor = np.sqrt(mass / flux.sum(axis=1))
        flux = factor[:, None] * flux * factor
    return ker.KernelMatrix(flux / np.sqrt(np.outer(mass, mass)), ker.Bins(edges), Estimate(0.0, 0.0, "bound", "given"))


def draw_refused(number: int) -> Case:
    """A law by sums over few directions: alone, as a power, in a sum, in a composition."""
    rng = np.random.default_rng([20261127, number])
    law = FewDirections(float(rng.uniform(0.2, 0.9)), int(rng.integers(8, 32)))
    made = (law, law**2, 0.5 * law + 0.5 * ker.lambertian(), law @ ker.specular() @ law)[number % 4]
    basis = (None, ker.Legendre(12), ker.Bins(8))[number // 4 % 3]
    return Case("only apply", made, np.ones(1), basis=basis)


def _by_modulus(values: Floats) -> Floats:
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])


def judge(case: Case) -> Iterator[Judged]:
    """Every interval must contain an eigenvalue, the one of its index if it has one."""
    for tolerance in case.tolerances:
        items = spec.enclosures(case.law, case.listed, case.basis, tolerance)
        for item in items:
            middle, half_width = 0.5 * (item.low + item.high), 0.5 * (item.high - item.low)
            nearest = float(np.abs(case.exact - middle).min())
            fault = "" if item.index is None or _is_indexed(item, items, case) else f"{item} has another number"
            outcome = "contains" if item.index is None else "indexed"
            yield Judged(f"{case.kind}, to {tolerance:g}", half_width, nearest, case.error, fault, outcome)


def judge_refused(case: Case) -> Iterator[Judged]:
    """There must be no interval."""
    try:
        next(judge(case))
    except InputError:
        yield Judged(case.kind, outcome="refused")
    else:
        yield Judged(case.kind, fault="not refused")


def _is_indexed(item: Enclosure, items: list[Enclosure], case: Case) -> bool:
    """Whether the index is right; enclosures whose moduli overlap may be exchanged."""
    group = [other for other in items if other.index is not None and _overlap(item, other)]
    inside = [_inside(other, case) for other in group]
    return any(_inside(item, case)[other.index] for other in group) and any(one[item.index] for one in inside)


def _inside(item: Enclosure, case: Case) -> NDArray[np.bool_]:
    return np.asarray((item.low - case.error <= case.exact) & (case.exact <= item.high + case.error))


def _overlap(one: Enclosure, other: Enclosure) -> bool:
    # the moduli of an interval [a, b] run from max(a, -b, 0) to max(-a, b)
    least = max(max(item.low, -item.high, 0.0) for item in (one, other))
    return least <= min(max(-item.low, item.high) for item in (one, other))


CAMPAIGNS = (
    Campaign(
        "scattered-enclosures", "Are intervals and indices of sums of scatterings right?", draw_diagonal,
        judge, DIAGONAL, range(10),
    ),
    Campaign("given-bases", "The same in given bases?", draw_given, judge, GIVEN, [0, 2, 3, 4, 8, 13, 14, 19, 28]),
    Campaign("only-apply", "Are laws without errors refused?", draw_refused, judge_refused, REFUSED, [2, 5]),
)  # fmt: skip
