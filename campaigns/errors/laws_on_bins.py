"""Whether matrices, means and resistances of random laws on bins have the errors that they report.

The laws have 1 to 20 bins of any widths, few or many transitions, and are alone, mirrored, squared or mixed with a
mirror. The judge is a Gauss rule between the edges of bins and basis, their mirror images, and seven more angles.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from asperity import kernels as ker
from asperity.estimates import Estimate
from campaigns.engine import Campaign, Judged

Floats = np.ndarray
NODES, ROUNDING = 18, 1e-14


@dataclass(frozen=True)
class Case:
    """Transition probabilities between bins, how the law is composed, and a basis."""

    law: ker.MatrixLaw
    kind: str
    basis: ker.Basis


def _edges(rng: np.random.Generator, bins: int) -> Floats:
    """Edges of unequal bins, of which some are narrow."""
    widths = np.exp(rng.uniform(-6.0, 0.0, bins))
    return np.append(np.pi * np.concatenate(([0.0], np.cumsum(widths)[:-1])) / widths.sum(), np.pi)


def draw(number: int) -> Case:
    """A random case."""
    rng = np.random.default_rng([20261127, 7, number])
    size = int(rng.integers(1, 21))
    array = rng.random((size, size)) * (rng.random((size, size)) < rng.uniform(0.05, 1.0)) + 1e-3 * np.eye(size)
    cells = ker.Bins(_edges(rng, size))
    root = np.sqrt(cells.weights)
    array = root[:, None] * (array / array.sum(axis=1, keepdims=True)) / root
    law = ker.MatrixLaw(ker.KernelMatrix(array, cells, Estimate(0.0, 0.0, "bound", "given")))
    basis = (
        lambda: ker.Legendre(int(rng.integers(1, 21))),
        lambda: ker.Bins(_edges(rng, int(rng.integers(1, 17)))),
        lambda: ker.Panels(_edges(rng, int(rng.integers(1, 9))), int(rng.integers(0, 6))),
    )[rng.integers(3)]()
    return Case(law, str(rng.choice(["alone", "mirrored", "squared", "mixed"])), basis)


def judge(case: Case) -> Iterator[Judged]:
    """The matrix, the means of the functions of the basis, and the resistance."""
    law, mirror, basis = case.law, ker.specular(), case.basis
    edges = (law.edges, basis.edges, np.pi - law.edges, np.pi - basis.edges, np.linspace(0.0, np.pi, 9))
    angle, weight = ker.SINE.quadrature(np.unique(np.concatenate(edges)), NODES)
    cell = np.clip(np.searchsorted(law.edges, angle, side="right") - 1, 0, len(law.array) - 1)
    after = law.array[cell][:, cell] * (weight / np.bincount(cell, weight)[cell])

    def images(values: Floats, mirrored: Floats) -> Floats:
        return {
            "alone": lambda: after @ values, "mirrored": lambda: after @ mirrored,
            "squared": lambda: after @ (after @ values), "mixed": lambda: 0.25 * after @ values + 0.75 * mirrored,
        }[case.kind]()  # fmt: skip

    whole = {"alone": law, "mirrored": law @ mirror, "squared": law @ law, "mixed": 0.25 * law + 0.75 * mirror}
    chosen = whole[case.kind]
    values = basis.evaluate(angle)
    found = ker.discretise(chosen, basis)
    exact = (weight[:, None] * values).T @ images(values, basis.evaluate(np.pi - angle))
    size = float(np.linalg.norm(exact))
    yield Judged(
        f"matrix, {case.kind}", float(found.error), float(np.linalg.norm(found.symmetric - exact)), ROUNDING * size
    )
    pair = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    means = images(pair, pair * [-1.0, 1.0])
    resistance = ker.resistance(chosen)
    true = 0.75 * (1.0 + float(weight @ np.sum(pair * means, axis=1)))
    yield Judged(f"resistance, {case.kind}", resistance.error, abs(resistance.value - true), ROUNDING)
    given = chosen.apply(lambda theta: np.stack([np.cos(theta), np.sin(theta)], axis=-1), angle[::7])
    yield Judged(f"means, {case.kind}", 1e-8, float(np.abs(given - means[::7]).max()), ROUNDING)


CAMPAIGNS = (Campaign("laws-on-bins", "Do errors of laws on bins hold?", draw, judge, 600, range(6)),)
