"""What every method that makes a matrix is given, and what it gives back."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

from ...core.checks import Floats
from ...core.estimates import ErrorKind
from ...core.rounding import EPS
from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.chunks import Engine
from ..sampling.monte_carlo import DEFAULT_SAMPLES

MethodName = Literal["auto", "exact", "quadrature", "qmc", "monte-carlo"]

# Ray segments, from one collision to the next, of traced conditional distributions: some seconds of work; where they
# were not asked for, as many as take the time of two million rays.
MOST_SEGMENTS, QUICK_SEGMENTS = 40_000_000, 4_000_000
# The error of traced matrices of nine walls fell like their segments to a power of 1.6 to 2.2, and all angles are done
# again where they were too coarse. On fourteen walls this told apart those whose matrix was of use.
ORDER, DONE_AGAIN = 1.75, 2.0
SEED_WITHOUT_RNG = 0
# Rounding of a matrix: the edges of n cells carry a rounding error each, which moves a share of about n eps of a
# cell's measure; 1.2e-13 was measured where n eps is 1.1e-13.
ROUNDING = 8.0 * EPS
# Edges and offsets of isometries are rounded to about an ulp. That moves a share of about n eps of each of some n
# cells of a partition, and the n-th Legendre function, whose derivative has the norm n, by n eps: n^(3/2) eps in all.
DISPLACED = EPS


def _fixed_source() -> np.random.Generator:
    return np.random.default_rng(SEED_WITHOUT_RNG)


@dataclass(frozen=True)
class Budget:
    """What a method may spend on one matrix, and what for.

    Parameters
    ----------
    tolerance : float
        Wanted Frobenius error of the symmetric matrix.
    rays : int
        Sampled rays at most.
    segments : int
        Ray segments of traced conditional distributions at most.
    fallback : float
        The error that the next method promises, infinite if there is none: a larger one is of no use.
    rng : numpy.random.Generator
    symmetrise : bool
        Whether sampled rays count both ways.
    engine : Engine, optional
        Of a long run: its checkpoint and its workers.
    """

    tolerance: float
    rays: int = DEFAULT_SAMPLES
    segments: int = MOST_SEGMENTS
    fallback: float = math.inf
    rng: np.random.Generator = field(default_factory=_fixed_source)
    symmetrise: bool = False
    engine: Engine | None = None

    def predicted(self, error: float, spent: int) -> float:
        """What all segments are likely to make of an error that is left after so many of them."""
        return float(error / max(self.segments / (DONE_AGAIN * spent), 1.0) ** ORDER)

    def out_of_reach(self, error: float, spent: int) -> bool:
        """Whether an error after so many segments speaks against one below the fallback.

        Examples
        --------
        >>> Budget(1e-8, segments=1000, fallback=1e-3).out_of_reach(1e-2, spent=100)
        False
        >>> Budget(1e-8, segments=1000, fallback=1e-3).out_of_reach(1e-2, spent=400)
        True
        """
        return self.predicted(error, spent) > self.fallback


class Method(Protocol):
    """One way to the matrices of some laws; a new one takes its place in `methods.METHODS`, or in `methods.SAMPLED`.

    A method sees a law that is no wall with a closed form, but it may be a sum, a chain, or in the specular frame.
    """

    name: MethodName

    def accepts(self, law: Law, basis: Basis) -> bool:
        """Whether the method has the matrix of this law in this basis."""
        ...

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        """The symmetric array, its error and the evidence for it; what is known of the law is put in later."""
        ...


class Recipe(Protocol):
    """How the matrix of a law is made: by a method that takes it whole, or from the matrices of its parts."""

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        """Whether the matrix can be made in this way."""
        ...

    def without_rays(self, basis: Basis) -> bool:
        """Whether no part needs rays."""
        ...

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        """The matrix; only where `has` says so."""
        ...


def computed(
    symmetric: Floats, basis: Basis, name: MethodName, error: float, how: str, kind: ErrorKind = "estimate"
) -> KernelMatrix:
    """The matrix of a method that samples nothing."""
    return KernelMatrix(symmetric, basis, frobenius_error(error, kind, how), method=name)


def rounding(basis: Basis) -> float:
    """What rounding leaves of a matrix, in the Frobenius norm."""
    return ROUNDING * basis.size


def isometric_rounding(basis: Basis) -> float:
    """What rounding leaves of a matrix of isometries."""
    return float(ROUNDING * basis.size + DISPLACED * basis.size**1.5)


def until_settled(levels: Iterator[Floats], tolerance: float) -> tuple[Floats, float]:
    """The first level that differs from the one before by no more than the tolerance, or the last; the difference."""
    current = next(levels)
    difference = np.inf
    for finer in levels:
        difference = float(np.linalg.norm(finer - current))
        current = finer
        if difference <= tolerance:
            break
    return current, difference
