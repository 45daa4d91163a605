"""Reported errors of matrices of random compositions, mixtures, powers, frames and adjoints, against references.

Case 2000 and later ones have bases with narrow cells, on which the rounding of angles is large.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from asperity import kernels as ker
from asperity.errors import AccuracyError, InputError
from campaigns.engine import Campaign, Judged
from campaigns.judges import reference_operators as ref
from campaigns.judges.reference_operators import Expression, Floats, leaf

FIRST_NARROW = 2000
# Rays of sampled matrices.
SAMPLES, SAMPLED = 2**14, ("qmc", "monte-carlo")
# Cost of an operator in a word, and limits on the cost of a word and on the number of words.
COST, DEAREST, MOST_WORDS = {ref.Triangular: 1, ref.Rectangular: 1, ref.Arcs: 4}, 4, 12
LOPSIDED = np.array([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
CYCLE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Case:
    """A composed law, a basis with the name of its kind, and a method."""

    number: int
    expression: Expression
    kind: str
    basis: ker.Basis
    method: str


def random_leaf(rng: np.random.Generator) -> Expression:
    """One law."""
    makers: dict[Callable[[], Expression], float] = {
        lambda: leaf(ker.retroreflection(), ref.identity): 0.08,
        lambda: leaf(ker.specular(), ref.flip): 0.1,
        lambda: leaf(ker.lambertian(), ref.Diagonal(np.ones(1))): 0.06,
        lambda: scattering(float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.9))): 0.26,
        lambda: teeth(float(rng.uniform(0.4, 2.8))): 0.2,
        lambda: crevices(float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))): 0.12,
        lambda: _two_moments(*rng.uniform(-0.5, 0.5, 2).tolist()): 0.07,
        lambda: transitions(LOPSIDED if rng.random() < 0.5 else CYCLE): 0.05,
        lambda: leaf(ker.InvolutionLaw(ref.exchanged), ref.exchange): 0.04,
        lambda: arcs(float(rng.uniform(0.3, 1.5))): 0.02,
    }
    return list(makers)[rng.choice(len(makers), p=list(makers.values()))]()


def teeth(angle: float) -> Expression:
    """Triangular teeth."""
    return leaf(ker.TriangularTeethLaw(angle), ref.Triangular(angle))


def crevices(ratio: float) -> Expression:
    """Rectangular teeth of this height over width."""
    return leaf(ker.RectangularTeethLaw(ratio), ref.Rectangular({ratio: 1}))


def arcs(half_angle: float) -> Expression:
    """Focusing arcs."""
    return leaf(ker.CircularArcLaw(half_angle), ref.Arcs(half_angle))


def scattering(g: float) -> Expression:
    """Henyey-Greenstein scattering."""
    return leaf(ker.henyey_greenstein(g), ref.scattering(g))


def transitions(array: Floats) -> Expression:
    """Transitions between bins."""
    return leaf(ker.MatrixLaw(array), ref.Piecewise(array))


def _two_moments(a: float, b: float) -> Expression:
    def density(theta: Floats, out: Floats) -> Floats:
        u, v = np.cos(theta), np.cos(out)
        return 0.5 * np.sin(out) * (1.0 + a * u * v + b * (1.5 * u * u - 0.5) * (1.5 * v * v - 0.5))

    return leaf(ker.DensityLaw(density), ref.Diagonal(np.array([1.0, a / 3.0, b / 5.0])))


def random_expression(rng: np.random.Generator, depth: int, turned: bool) -> Expression:
    """A random tree of at most ``depth``, all of whose laws are in one frame."""
    if depth == 0:
        one = random_leaf(rng)
        return one.turned() if turned else one
    kind = rng.choice(["compose", "mix", "power", "adjoint", "leaf"], p=[0.45, 0.25, 0.12, 0.08, 0.1])
    first = random_expression(rng, depth - 1, turned)
    if kind == "leaf":
        return first
    if kind == "power":
        return first.power(int(rng.integers(2, 4)))
    if kind == "adjoint":
        return first.adjoint()
    second = random_expression(rng, depth - 1, turned)
    return first @ second if kind == "compose" else first.mixed(second, float(rng.uniform(0.1, 0.9)))


def random_basis(rng: np.random.Generator) -> tuple[str, ker.Basis]:
    """Random bins, polynomials or panels, and the kind of the basis."""
    kind = rng.choice(["Bins(n)", "Bins(edges)", "Legendre", "Panels"], p=[0.25, 0.2, 0.35, 0.2])
    if kind == "Bins(n)":
        return kind, ker.Bins(int(rng.choice([2, 4, 8, 16])))
    if kind == "Legendre":
        return kind, ker.Legendre(int(rng.choice([4, 8, 16, 32, 64], p=[0.25, 0.3, 0.25, 0.1, 0.1])))
    edges = np.concatenate(([0.0], np.sort(rng.uniform(0.05, 3.09, int(rng.integers(1, 6)))), [np.pi]))
    return kind, ker.Bins(edges) if kind == "Bins(edges)" else ker.Panels(edges, int(rng.integers(0, 4)))


def narrow_basis(rng: np.random.Generator) -> tuple[str, ker.Basis]:
    """Bins or panels with a narrow cell, in the middle or at both ends."""
    if rng.random() < 0.7:
        middle, width = rng.uniform(0.3, 2.8), 10.0 ** rng.uniform(-6.0, -2.0)
        edges = np.array([0.0, 0.5 * middle, middle, middle + width, 0.5 * (middle + np.pi), np.pi])
    else:
        # The references sum a limited number of crossings of crevices, so that cells at grazing cannot be narrower.
        width = 10.0 ** rng.uniform(-2.0, -1.0)
        edges = np.array([0.0, width, 1.0, 2.0, np.pi - width, np.pi])
    if rng.random() < 0.4:
        return "narrow bins", ker.Bins(edges)
    return "narrow panels", ker.Panels(edges, int(rng.integers(0, 5)))


def draw(number: int) -> Case:
    """A random expression that the reference can afford, a basis and a method."""
    rng = np.random.default_rng([number, 16])
    narrow = number >= FIRST_NARROW
    while True:
        depth, turned = int(rng.integers(1, 4)), bool(rng.random() < 0.25)
        try:
            expression = random_expression(rng, depth, turned)
        except InputError:
            # the adjoint has no closed form
            continue
        if rng.random() < 0.1:
            expression = expression.turned()
        cost = max(sum(COST.get(type(operator), 0) for operator in word) for _, word in expression.words)
        if cost <= (DEAREST // 2 if narrow else DEAREST) and len(expression.words) <= MOST_WORDS:
            break
    kind, basis = narrow_basis(rng) if narrow else random_basis(rng)
    return Case(number, expression, kind, basis, str(rng.choice(["auto", "quadrature", "exact"], p=[0.68, 0.23, 0.09])))


def draw_sampled(number: int) -> Case:
    """The same with a method by rays."""
    return replace(draw(number), method=SAMPLED[number % 3 > 0])


def judge(case: Case) -> Iterator[Judged]:
    """The matrix, if the law has the method and every cell of a sample has rays."""
    law, basis, rng = case.expression.law, case.basis, np.random.default_rng(case.number)
    sampled = case.method in SAMPLED
    try:
        matrix = ker.discretise(law, basis, method=case.method, samples=SAMPLES, rng=rng)
    except InputError:
        return
    except AccuracyError:
        # only rays may miss a narrow cell; any other refusal is a failure
        if not sampled:
            raise
        return
    # a half width, which the method "auto" may choose, is not judged as a bound
    if sampled or not matrix.samples:
        exact, error = ref.reference(case.expression, basis)
        method = "sum of several" if "+" in matrix.method else matrix.method
        yield Judged(
            f"{method}, {case.kind}", float(matrix.error), float(np.linalg.norm(matrix.symmetric - exact)), error
        )


QUESTION = "Do errors of matrices of composed laws hold?"
CAMPAIGNS = (
    Campaign("composed-laws", QUESTION, draw, judge, 3000, [3, 9, 20, 33, 1013, 2002, 2003]),
    Campaign("sampled-composed-laws", f"{QUESTION[:-1]}, by rays?", draw_sampled, judge, 300, [1], level=0.95),
)
