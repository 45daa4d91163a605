"""Coverage of reported errors in sampled estimates: 95 % of the true values should lie within them.

``python -m campaigns.coverage`` repeats every estimate with other rays, 1000 times or ``--repeats`` times, and counts
how often its error holds. The true values are not sampled: diagonal matrices for laws that Legendre polynomials
diagonalise, isometry tables for triangular teeth with a separate formula for their rays, and quadrature for arcs.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from unittest import mock

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.aerodynamics import drag
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.walls.circular_arc import CircularArcLaw
from asperity.spectral.eigenvalues.standard_errors import sampling_errors, sampling_quantile

from .pages import print_table

REPEATS, RAYS, RESISTANCE_RAYS = 1000, 4096, 2**14
TEETH, ARC = ker.TriangularTeethLaw(1.1), CircularArcLaw(1.2)
SCATTERING, MAXWELL = ker.henyey_greenstein(0.6), ker.maxwell(0.4)
PANELS = ker.Panels(np.linspace(0.0, np.pi, 5), 2)


@dataclass(frozen=True)
class Tally:
    """How often the errors of one estimate held.

    Attributes
    ----------
    held, repeats : int
    ratio : float
        Mean reported error over root mean square true error.
    """

    held: int
    repeats: int
    ratio: float

    @property
    def coverage(self) -> float:
        """The fraction of repeats whose error held."""
        return self.held / self.repeats

    def line(self) -> str:
        """The columns of a table."""
        return f"{self.repeats} | {100 * self.coverage:.1f} % | {self.ratio:.2f}"


def tally(once: Callable[[np.random.Generator], tuple[float, float]], repeats: int, seed: int = 0) -> Tally:
    """Repeat a computation of a true error and a reported error."""
    found = np.array([once(np.random.default_rng([seed, number])) for number in range(repeats)])
    true, reported = found.T
    size = float(np.sqrt(np.mean(true**2)))
    return Tally(int(np.count_nonzero(true <= reported)), repeats, float(reported.mean()) / size if size else np.inf)


@lru_cache(maxsize=64)
def truth(law: ker.Law, basis: ker.Basis) -> np.ndarray:
    """The exact matrix."""
    if isinstance(basis, ker.Legendre) and law is SCATTERING:
        return np.diag(0.6 ** np.arange(basis.size))
    if isinstance(basis, ker.Legendre) and law is MAXWELL:
        # the specular part changes the sign of odd polynomials; the diffuse part keeps only the constants
        return np.diag(0.6 * (-1.0) ** np.arange(basis.size) + 0.4 * (np.arange(basis.size) == 0))
    found = ker.discretise(law, basis, tolerance=1e-10)
    assert float(found.error) < 1e-6
    return np.asarray(found.symmetric)


def matrix_once(law: ker.Law, basis: ker.Basis, method: str, rays: int, symmetrise: bool):  # type: ignore[no-untyped-def]
    """The error of a sampled matrix, in the Frobenius norm."""

    def once(rng: np.random.Generator) -> tuple[float, float]:
        found = ker.discretise(law, basis, method, samples=rays, rng=rng, symmetrise=symmetrise)  # type: ignore[arg-type]
        return float(np.linalg.norm(found.symmetric - truth(law, basis))), float(found.error)

    return once


def pairs_once(basis: ker.Basis, rays: int, invariant: bool, symmetrise: bool):  # type: ignore[no-untyped-def]
    """The error of a matrix from pairs; ``invariant`` tells whether their incoming angles follow the measure."""

    def once(rng: np.random.Generator) -> tuple[float, float]:
        theta = ker.SINE.sample(rays, rng) if invariant else np.pi * rng.beta(1.2, 1.6, rays)
        found = ker.estimate(theta, TEETH.sample(theta, rng), basis, symmetrise, invariant=invariant)
        return float(np.linalg.norm(found.symmetric - truth(TEETH, basis))), float(found.error)

    return once


def eigenvalue_once(law: ker.Law, basis: ker.Basis, method: str, rays: int, which: str):  # type: ignore[no-untyped-def]
    """The sampling error of the gap's eigenvalue, or of the eigenvalue of largest modulus."""
    exact = truth(law, basis)
    rest = np.sort(np.linalg.eigvalsh(0.5 * (exact + exact.T)))
    constant = int(np.argmin(np.abs(rest - 1.0)))
    others = np.delete(rest, constant)
    target = float(others.max() if which == "gap" else others[np.abs(others).argmax()])

    def once(rng: np.random.Generator) -> tuple[float, float]:
        matrix = ker.discretise(law, basis, method, samples=rays, rng=rng)  # type: ignore[arg-type]
        found = spec.spectrum(matrix, k=3)
        place = 1 if which == "gap" else 1 + int(np.abs(found.values[1:]).argmax())
        if which == "gap":
            return abs(1.0 - found.gap - target), float(found.gap_errors.quantile * found.gap_errors.sampling[0])
        error = sampling_errors(matrix, found.vectors, found.values)[place] * sampling_quantile(matrix)
        return abs(float(found.values[place]) - target), float(error)

    return once


def distance_once(order: float, kind: str, alike: bool, sampled: int):  # type: ignore[no-untyped-def]
    """The error of a distance of one or two sampled matrices."""
    basis, pairs = ker.Bins(12), 4000
    laws = (MAXWELL, MAXWELL if alike else ker.maxwell(0.7))
    exact = [ker.discretise(law, basis) for law in laws]
    target = float(ker.distance(*exact, order, kind))  # type: ignore[arg-type]

    def once(rng: np.random.Generator) -> tuple[float, float]:
        matrices = list(exact)
        for place in range(sampled):
            theta = ker.SINE.sample(pairs, rng)
            matrices[place] = ker.estimate(theta, laws[place].sample(theta, rng), basis)
        found = ker.distance(*matrices, order, kind)  # type: ignore[arg-type]
        return abs(found.value - target), found.error

    return once


@dataclass(frozen=True)
class Rays(ker.DrivenLaw):
    """Triangular teeth, accessible through rays only."""

    closed: ker.TriangularTeethLaw
    seed: int

    reversible = True

    def reflect(self, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        # each seed needs its own rays, because the library's rays are the same for every law
        return self.closed.reflect(np.mod(x + self.seed * 0.6180339887498949, 1.0), theta)


def resistance_once(rng: np.random.Generator, rays: int = RESISTANCE_RAYS) -> tuple[float, float]:
    """The error of the resistance of triangular teeth with a random apex angle, by rays."""
    closed = ker.TriangularTeethLaw(float(rng.uniform(0.3, 2.8)))
    with mock.patch.object(drag, "Budget", partial(Budget, rays=rays)):
        found = ker.resistance(Rays(closed, int(rng.integers(1000))), 1e-9)
    return abs(found.value - float(ker.resistance(closed))), found.error


def matrices(repeats: int) -> Iterator[tuple[str, Tally]]:
    """Sampled matrices by both methods."""
    cases = [(TEETH, basis) for basis in (ker.Bins(4), ker.Bins(16), ker.Bins(48), ker.Legendre(3), ker.Legendre(12))]
    cases += [(TEETH, PANELS), (ARC, ker.Bins(12)), (ARC, ker.Legendre(6))]
    smooth = [(law, ker.Legendre(size)) for law in (SCATTERING, MAXWELL) for size in (3, 12)]
    for law, basis in cases + smooth:
        for method in ("monte-carlo", "qmc") if (law, basis) in cases else ("monte-carlo",):
            for symmetrise in (False, True):
                found = tally(matrix_once(law, basis, method, RAYS, symmetrise), repeats)
                both = ", both ways" if symmetrise else ""
                yield f"{method}{both} | {law!r} | {basis!r} | {RAYS}", found


def pairs(repeats: int) -> Iterator[tuple[str, Tally]]:
    """Matrices from a user's pairs."""
    for basis in (ker.Bins(4), ker.Bins(12), ker.Legendre(6)):
        for invariant in (True, False):
            for symmetrise in (False, True):
                found = tally(pairs_once(basis, 8000, invariant, symmetrise), repeats)
                name = "pairs" + ("" if invariant else ", other angles") + (", both ways" if symmetrise else "")
                yield f"{name} | {TEETH!r} | {basis!r} | 8000", found


def eigenvalues(repeats: int) -> Iterator[tuple[str, Tally]]:
    """Gaps and largest moduli of sampled matrices."""
    for law, basis, rays in (
        (TEETH, ker.Bins(8), 16384),
        (TEETH, ker.Legendre(6), 16384),
        (ARC, ker.Bins(12), 16384),
        (ARC, ker.Legendre(6), 16384),
        (SCATTERING, ker.Legendre(6), 16384),
    ):
        for method in ("monte-carlo", "qmc") if law is not SCATTERING else ("monte-carlo",):
            for which in ("gap", "slem"):
                found = tally(eigenvalue_once(law, basis, method, rays, which), repeats)
                yield f"{which}, {method} | {law!r} | {basis!r} | {rays}", found


def distances(repeats: int) -> Iterator[tuple[str, Tally]]:
    """Distances of empirical kernels."""
    for order in (1, 2):
        for kind in ("rows", "sup"):
            for alike in (True, False):
                for sampled in (1, 2):
                    found = tally(distance_once(order, kind, alike, sampled), repeats)
                    laws = "the same law" if alike else "two laws"
                    yield f"distance W_{order}, {kind}, {sampled} sampled | {laws} | Bins(12) | 4000", found


def resistances(repeats: int) -> Iterator[tuple[str, Tally]]:
    """Resistances by rays."""
    name = f"resistance, qmc | triangular teeth, any angle | Directions() | {RESISTANCE_RAYS}"
    yield name, tally(resistance_once, repeats)


SECTIONS = {
    "matrices": matrices,
    "pairs": pairs,
    "eigenvalues": eigenvalues,
    "distances": distances,
    "resistances": resistances,
}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.coverage", description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help="of every estimate")
    parser.add_argument("--only", choices=list(SECTIONS), help="one table only")
    options = parser.parse_args()
    for name, section in SECTIONS.items():
        if options.only in (None, name):
            rows = (f"{title} | {found.line()}" for title, found in section(options.repeats))
            print_table("estimate | law | basis | rays | repeats | held | reported / rms", rows)
            print(flush=True)


if __name__ == "__main__":
    main()
