"""Coverage of reported errors of sampled estimates: 95 % of the true values should lie within them.

A case repeats one estimate with other rays. The true values are not sampled: diagonal matrices for laws that Legendre
polynomials diagonalise, isometry tables for triangular teeth with a separate formula for their rays, and quadrature for
arcs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from typing import SupportsFloat
from unittest.mock import patch

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.core.errors import AccuracyError
from asperity.kernels.aerodynamics import drag
from asperity.kernels.discretisation.method import Budget, MethodName
from asperity.kernels.laws.law import DrivenLaw
from asperity.spectral.eigenvalues.spectra import sampling_errors, sampling_quantile
from asperity.study import check_tracer
from campaigns.engine import Campaign, Judged

# Repetitions of a case, and cases of an estimate.
REPEATS, BLOCKS = 25, 12
RAYS, EIGENVALUE_RAYS, RESISTANCE_RAYS, PAIRS, DISTANCE_PAIRS = 4096, 2**14, 2**14, 8000, 4000
ALARM_PAIRS, ALARM_LEVEL = 300, 0.05
TEETH, ARC = ker.TriangularTeethLaw(1.1), ker.CircularArcLaw(1.2)
# Flat but for notches that few of the rays meet, or none.
NOTCHES = [ker.RectangularTeethLaw(depth) for depth in (1e-6, 1e-4, 3e-4, 1e-3)]
SCATTERING, MAXWELL = ker.henyey_greenstein(0.6), ker.maxwell(0.4)
PANELS = ker.Panels(np.linspace(0.0, np.pi, 5), 2)
# The true error and the reported one of one repetition.
Errors = tuple[SupportsFloat, SupportsFloat]


@cache
def truth(law: ker.Law, basis: ker.Basis) -> Floats:
    """The exact matrix."""
    if isinstance(basis, ker.Legendre) and law is SCATTERING:
        return np.diag(0.6 ** np.arange(basis.size))
    if isinstance(basis, ker.Legendre) and law is MAXWELL:
        # the specular part changes the sign of odd polynomials; the diffuse part keeps only the constants
        return np.diag(0.6 * (-1.0) ** np.arange(basis.size) + 0.4 * (np.arange(basis.size) == 0))
    found = ker.discretise(law, basis, tolerance=1e-10)
    assert float(found.error) < 1e-6
    return np.asarray(found.symmetric)


def matrix(law: ker.Law, basis: ker.Basis, method: MethodName, symmetrise: bool, rng: np.random.Generator) -> Errors:
    """A sampled matrix, in the Frobenius norm."""
    found = ker.discretise(law, basis, method, samples=RAYS, rng=rng, symmetrise=symmetrise)
    return np.linalg.norm(found.symmetric - truth(law, basis)), found.error


def pairs(basis: ker.Basis, invariant: bool, symmetrise: bool, rng: np.random.Generator) -> Errors:
    """A matrix from pairs; ``invariant`` tells whether their incoming angles follow the measure."""
    theta = ker.SINE.sample(PAIRS, rng) if invariant else np.pi * rng.beta(1.2, 1.6, PAIRS)
    found = ker.estimate(theta, TEETH.sample(theta, rng), basis, symmetrise, invariant=invariant)
    return np.linalg.norm(found.symmetric - truth(TEETH, basis)), found.error


def few_pairs(law: ker.Law, number: int, bins: int, symmetrise: bool, rng: np.random.Generator) -> Errors:
    """A matrix from a few pairs; nothing is claimed where a bin has none."""
    theta, basis = ker.SINE.sample(number, rng), ker.Bins(bins)
    try:
        found = ker.estimate(theta, law.sample(theta, rng), basis, symmetrise, invariant=True)
    except AccuracyError:
        return 0.0, 1.0
    return np.linalg.norm(found.symmetric - truth(law, basis)), found.error


def eigenvalue(law: ker.Law, basis: ker.Basis, method: MethodName, which: str, rng: np.random.Generator) -> Errors:
    """The gap's eigenvalue, or the one of largest modulus, with its sampling error."""
    exact = truth(law, basis)
    values = np.linalg.eigvalsh(0.5 * (exact + exact.T))
    others = np.delete(values, np.argmin(np.abs(values - 1.0)))
    sampled = ker.discretise(law, basis, method, samples=EIGENVALUE_RAYS, rng=rng)
    found = spec.spectrum(sampled, k=3)
    if which == "gap":
        return abs(1.0 - found.gap - others.max()), found.gap_errors.quantile * found.gap_errors.sampling[0]
    index = 1 + int(np.abs(found.values[1:]).argmax())
    error = sampling_errors(sampled, found.vectors, found.values)[index] * sampling_quantile(sampled)
    return abs(found.values[index] - others[np.abs(others).argmax()]), error


def distance(order: float, kind: str, alike: bool, sampled: int, rng: np.random.Generator) -> Errors:
    """A distance of one or two sampled matrices."""
    basis, laws = ker.Bins(12), (MAXWELL, MAXWELL if alike else ker.maxwell(0.7))
    exact = [ker.discretise(law, basis) for law in laws]
    matrices = list(exact)
    for k in range(sampled):
        theta = ker.SINE.sample(DISTANCE_PAIRS, rng)
        matrices[k] = ker.estimate(theta, laws[k].sample(theta, rng), basis)
    found = ker.distance(*matrices, order, kind)
    return abs(found.value - float(ker.distance(*exact, order, kind))), found.error


def flat_distance(law: ker.Law, method: MethodName, rng: np.random.Generator) -> Errors:
    """The distance of a wall from a flat one, by rays."""
    flat = ker.discretise(ker.specular(), ker.Bins(16))
    found = ker.distance(ker.discretise(law, flat.basis, method, samples=RAYS, rng=rng), flat)
    return abs(found.value - float(ker.distance(ker.discretise(law, flat.basis, tolerance=1e-10), flat))), found.error


@dataclass(frozen=True)
class Rays(DrivenLaw):
    """Triangular teeth, accessible through rays only."""

    closed: ker.TriangularTeethLaw
    seed: int

    reversible = True

    def reflect(self, x: Floats, theta: Floats) -> Floats:
        # each seed needs its own rays, because the library's rays are the same for every law
        return self.closed.reflect(np.mod(x + self.seed * 0.6180339887498949, 1.0), theta)


def resistance(rng: np.random.Generator) -> Errors:
    """The resistance of triangular teeth with a random apex angle, by rays."""
    closed = ker.TriangularTeethLaw(float(rng.uniform(0.3, 2.8)))
    with patch.object(drag, "Budget", partial(Budget, rays=RESISTANCE_RAYS)):
        found = ker.resistance(Rays(closed, int(rng.integers(1000))), 1e-9)
    return abs(found.value - float(ker.resistance(closed))), found.error


def mean_collisions(rng: np.random.Generator) -> Errors:
    """The mean number of collisions: the length of the hollows over that of their openings, by Kac."""
    found = check_tracer(geo.focusing_arcs(1.2), rng).mean_collisions
    return abs(found.value - 1.2 / np.sin(1.2)), found.error


def false_alarm(rng: np.random.Generator) -> Errors:
    """The test of whether two samples of one law differ: at this level it holds if its p-value is larger."""
    samples = []
    for number in (ALARM_PAIRS, ALARM_PAIRS * 2 // 3):
        theta = ker.SINE.sample(number, rng)
        samples.append(ker.estimate(theta, MAXWELL.sample(theta, rng), ker.Bins(6)))
    test = ker.difference_test(*samples, permutations=99, rng=rng)
    return float(test.differs(ALARM_LEVEL)), 0.5


def estimates() -> dict[str, Callable[[np.random.Generator], Errors]]:
    """All estimates by name."""
    found: dict[str, Callable[[np.random.Generator], Errors]] = {}

    def add(what: Callable[..., Errors], *arguments: object) -> None:
        found[", ".join([what.__name__.replace("_", " "), *map(str, arguments)])] = partial(what, *arguments)

    bases = ker.Bins(4), ker.Bins(16), ker.Bins(48), ker.Legendre(3), ker.Legendre(12), PANELS
    smooth = [(law, ker.Legendre(size)) for law in (SCATTERING, MAXWELL) for size in (3, 12)]
    for law, basis in [*product([TEETH], bases), (ARC, ker.Bins(12)), (ARC, ker.Legendre(6)), *smooth]:
        for method in ("monte-carlo",) if (law, basis) in smooth else ("monte-carlo", "qmc"):
            for symmetrise in (False, True):
                add(matrix, law, basis, method, symmetrise)
    for law, method in product(NOTCHES, ("monte-carlo", "qmc")):
        add(matrix, law, ker.Bins(16), method, False)
        add(flat_distance, law, method)
    for basis, *flags in product((ker.Bins(4), ker.Bins(12), ker.Legendre(6)), (True, False), (False, True)):
        add(pairs, basis, *flags)
    few = [(10, 2), (12, 3), (40, 4), (160, 16)]
    for law, numbers, symmetrise in product((ker.lambertian(), TEETH, MAXWELL), few, (False, True)):
        add(few_pairs, law, *numbers, symmetrise)
    for law, basis in ((TEETH, ker.Bins(8)), (TEETH, ker.Legendre(6)), (ARC, ker.Bins(12)), (ARC, ker.Legendre(6))):
        for method, which in product(("monte-carlo", "qmc"), ("gap", "slem")):
            add(eigenvalue, law, basis, method, which)
    for which in ("gap", "slem"):
        add(eigenvalue, SCATTERING, ker.Legendre(6), "monte-carlo", which)
    for arguments in product((1, 2), ("rows", "sup"), (True, False), (1, 2)):
        add(distance, *arguments)
    for once in (resistance, mean_collisions, false_alarm):
        add(once)
    return found


ESTIMATES = estimates()


def draw(number: int) -> tuple[str, int]:
    """The name of an estimate, and the number of its block of repetitions."""
    return list(ESTIMATES)[number % len(ESTIMATES)], number // len(ESTIMATES)


def judge(case: tuple[str, int]) -> Iterator[Judged]:
    """The repetitions of a block."""
    name, block = case
    for k in range(block * REPEATS, (block + 1) * REPEATS):
        true, reported = ESTIMATES[name](np.random.default_rng([0, k]))
        yield Judged(name, float(reported), float(true))


CAMPAIGNS = (
    Campaign(
        "coverage", "Do errors from rays hold in 95 % of repetitions?", draw, judge, BLOCKS * len(ESTIMATES),
        range(0, len(ESTIMATES), 16), level=0.95,
    ),
)  # fmt: skip
