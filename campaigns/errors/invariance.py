"""Whether laws that preserve sin(theta) d theta are told from laws that do not, by how they are drawn.

Matrices are drawn as mixtures of permutations, or as such with one entry moved within its row; densities and users'
laws as sin(theta')/2 (1 + c f(theta) g(theta')), which keeps the measure exactly if the mean of f or of g is 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.errors import InputError
from asperity.kernels.expectations.conditionals import Conditionals
from campaigns.engine import Campaign, Judged

NODES = 40


class Recipe(ker.Law):
    """A user's law with the density sin(theta')/2 (1 + c f(theta) g(theta')), of which nothing else is known."""

    def __init__(self, size: float, first: np.polynomial.Polynomial, second: np.polynomial.Polynomial) -> None:
        self.size, self.first, self.second = size, first, second

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        found, missing = np.empty(theta.shape), np.ones(theta.shape, dtype=bool)
        while missing.any():
            draw = 2.0 * rng.random(missing.sum()) - 1.0
            taken = 2.0 * rng.random(draw.size) < 1.0 + self.size * self.first(np.cos(theta[missing])) * self.second(
                draw
            )
            where = np.flatnonzero(missing)[taken]
            found.flat[where], missing.flat[where] = np.arccos(draw[taken]), False
        return found

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        ends = np.cos(np.concatenate(([0.0], edges, [np.pi])))[::-1]
        node, weight = np.polynomial.legendre.leggauss(NODES + degree)
        at = (0.5 * (ends[1:] + ends[:-1])[:, None] + 0.5 * np.diff(ends)[:, None] * node).ravel()
        weight = (0.25 * np.diff(ends)[:, None] * weight).ravel()
        weight = weight * (1.0 + self.size * self.first(np.cos(theta))[:, None] * self.second(at))
        return Conditionals.of_atoms(np.broadcast_to(np.arccos(at), weight.shape), weight, 1e-12)


@dataclass(frozen=True)
class Case:
    """A law and whether it preserves the measure."""

    kind: str
    law: ker.Law
    kept: bool


def draw(number: int) -> Case:
    """A matrix, a density or a user's law, alone or in a sum or product with walls; every second one is broken."""
    rng, kept = np.random.default_rng([45, number]), number % 2 == 0
    made: Any = (_matrix, _density)[number // 2 % 2]
    kind, law = made(rng, kept, number)
    partner = (ker.TriangularTeethLaw(float(rng.uniform(0.3, 2.5))), ker.maxwell(float(rng.uniform(0.1, 1.0))))
    shape = number // 8 % 4
    if shape == 1:
        law = 0.5 * law + 0.5 * partner[number % 2]
    if shape == 2:
        law = ker.TriangularTeethLaw(1.1) @ law
    if shape == 3:
        law = law.in_specular_frame()
    return Case(kind + ("", ", in a sum", ", in a product", ", in the other convention")[shape], law, kept)


def _broken(rng: np.random.Generator, number: int) -> float:
    """How much is broken; in products more than the error of their matrices, below which it cannot be seen."""
    return float(10.0 ** rng.uniform(-1.0 if number // 8 % 4 == 2 else -3.0, 0.0))


def _matrix(rng: np.random.Generator, kept: bool, number: int) -> tuple[str, ker.Law]:
    size = int(rng.integers(2, 30))
    weight = rng.dirichlet(np.ones(4))
    array = sum((w * np.eye(size)[rng.permutation(size)] for w in weight), np.zeros((size, size)))
    if not kept:
        row = int(rng.integers(size))
        source = int(np.argmax(array[row]))
        target = (source + 1 + int(rng.integers(size - 1))) % size
        moved = array[row, source] * _broken(rng, number)
        array[row, [source, target]] += -moved, moved
    return "matrix", ker.MatrixLaw(array)


def _density(rng: np.random.Generator, kept: bool, number: int) -> tuple[str, ker.Law]:
    """f and g are Legendre polynomials of degrees up to 5, g without mean; f gets a mean if the law is broken."""
    coefficients = (np.polynomial.legendre.leg2poly(np.eye(6)[rng.integers(1, 6)]) for _ in range(2))
    f, g = (np.polynomial.Polynomial(one) for one in coefficients)
    size = float(rng.uniform(0.2, 0.45))
    if not kept:
        f = f + _broken(rng, number)
    if number // 4 % 2:
        return "user's law", Recipe(size, f, g)
    return "density", ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) * (1.0 + size * f(np.cos(a)) * g(np.cos(b))))


def judge(case: Case) -> Iterator[Judged]:
    """The diffusivity of a law with the measure, a refusal that says so of one without it."""
    try:
        spec.diffusivity(case.law)
        refused = False
    except InputError as reason:
        refused = "preserves sin(theta) d theta" in str(reason)
        if not refused:
            yield Judged(case.kind, fault=f"refused for another reason: {reason}")
            return
    wrong = "a law that keeps the measure is refused" if refused else "a law that does not keep the measure is taken"
    yield Judged(case.kind, fault="" if refused != case.kept else wrong, outcome="refused" if refused else "taken")


CAMPAIGNS = (
    Campaign("invariance", "Are laws that preserve the measure told from others?", draw, judge, 400, range(8)),
)
