"""The protocol of the methods that compute matrices, their budget and errors, and the methods by sampled rays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from ...core.checks import Floats, choice, finite_number, new_seed, read_only, whole_number
from ...core.errors import InputError
from ...core.estimates import ErrorKind
from ...core.long_runs import Engine
from ...core.rounding import EPS
from ..bases.basis import Basis
from ..bases.polynomials import node_rounding
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.chunks import IndependentRays, RaySums, count_long
from ..sampling.counts import BATCHES, LARGEST_REPLICATES
from ..sampling.sobol import PARTS, SobolSampler

MethodName = Literal["auto", "exact", "quadrature", "qmc", "monte-carlo"]
# The methods whose rays can be stored on the way and traced by workers.
SAMPLING = ("qmc", "monte-carlo", "by_sobol_rays", "by_independent_rays")
# Limits on the ray segments of traced conditional distributions of one matrix: ten to twenty seconds of work; without
# an explicit request for quadrature, the time of two million rays, or of the largest number of rays.
MOST_SEGMENTS, QUICK_SEGMENTS, SEGMENTS_A_RAY = 140_000_000, 4_000_000, 4
SEED_WITHOUT_RNG = 0
# Tracing this number of rays takes about a second.
DEFAULT_SAMPLES = 2**20
# Rounding error of a matrix with n functions, divided by n. Each edge of n cells has a rounding error that moves a
# fraction of about n eps of a cell's measure; an error of 1.2e-13 was measured for n eps = 1.1e-13.
ROUNDING = 8.0 * EPS
# Least factor by which the differences of levels fall near kinks, margin of the error there, and agreement to rounding.
ORDER, MARGIN, ROUNDED = 4.0, 4.0, 1e-13


@dataclass(frozen=True)
class Budget:
    """The limits on the work for one matrix, and the wanted error.

    Parameters
    ----------
    tolerance : float
        Wanted Frobenius error of the symmetric matrix.
    rays : int
        Limit on the sampled rays.
    segments : int
        Limit on the ray segments of traced conditional distributions.
    rng : numpy.random.Generator
    symmetrise : bool
        Whether sampled rays count in both directions.
    engine : Engine, optional
        Checkpoint and workers of a long run.
    """

    tolerance: float
    rays: int = DEFAULT_SAMPLES
    segments: int = MOST_SEGMENTS
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(SEED_WITHOUT_RNG))
    symmetrise: bool = False
    engine: Engine | None = None


def checked_budget(
    law: Any,
    method: str,
    tolerance: float,
    samples: int | None,
    rng: np.random.Generator,
    *,
    symmetrise: bool,
    engine: Engine,
) -> Budget:
    """The budget of a call of `discretise`; raises InputError for what does not fit the law or the method."""
    choice("symmetrise", symmetrise, (True, False))
    if finite_number("tolerance", tolerance) < 0.0:
        raise InputError(f"tolerance: expected a number of at least 0, got {tolerance!r}")
    number = DEFAULT_SAMPLES if samples is None else whole_number("samples", samples, 2 * PARTS)
    if symmetrise and not law.reversible:
        raise InputError(f"symmetrise: {law!r} is not known to be reversible, so its rays must not be turned round")
    if engine and method not in SAMPLING:
        raise InputError(f"method: checkpoint and client need 'monte-carlo' or 'qmc', got {method!r}")
    # Quadrature requested by name may take some seconds.
    segments = MOST_SEGMENTS if method == "quadrature" else min(QUICK_SEGMENTS, SEGMENTS_A_RAY * number)
    return Budget(tolerance, number, segments, rng=rng, symmetrise=symmetrise, engine=engine or None)


class Method(NamedTuple):
    """A method that computes the matrices of some laws; each is listed in `methods.METHODS` or `methods.SAMPLED`.

    Walls are replaced by their `parts` beforehand. The law may be a sum, a chain, or in the specular frame.

    Attributes
    ----------
    name : str
        The kind of the method.
    accepts : callable
        Whether the method can compute the matrix of a law in a basis.
    matrix : callable
        From law, basis and budget to the matrix, with its error and the evidence for it; `discretise` adds the
        properties of the law.
    """

    name: MethodName
    accepts: Callable[[Law, Basis], bool]
    matrix: Callable[[Any, Any, Budget], KernelMatrix]


def computed(
    symmetric: Floats, basis: Basis, name: MethodName, error: float, how: str, kind: ErrorKind = "estimate"
) -> KernelMatrix:
    """The matrix of a method without sampling, with its error and the description of the error.

    The array is the caller's no more: it becomes read-only, and is not copied.
    """
    return KernelMatrix(read_only(symmetric), basis, frobenius_error(error, kind, how), method=name)


def rounding(basis: Basis) -> float:
    """The rounding error of a matrix in the Frobenius norm: of sums and masses, and of quadrature nodes."""
    return ROUNDING * basis.size + node_rounding(basis)


def until_converged(levels: Iterator[Floats], tolerance: float, smooth: bool = True) -> tuple[Floats, float]:
    """The first level that is known to the tolerance, or the last, and its error: the difference from the previous one.

    Where kinks are not known, two levels may agree by chance, but not three: their differences fall by `ORDER` or more.
    The error is the last difference, or that before over `ORDER`, with a margin. Two levels decide if they agree to
    rounding.
    """
    current, before, error = next(levels), np.inf, np.inf
    for finer in levels:
        difference = float(np.linalg.norm(finer - current))
        three = np.isfinite(before)
        error = difference if smooth else MARGIN * max(difference, before / ORDER if three else 0.0)
        current, before = finer, difference
        if error <= tolerance if smooth or three else difference <= ROUNDED:
            break
    return current, error


def by_sobol_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law driven by a uniform number, by rays of scrambled Sobol sequences."""
    return sobol_matrix(SobolSampler(law, basis, budget.rng), budget)


def by_independent_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of any law from independent rays with incoming angles from the invariant measure.

    In bases without cells the error comes from the spread of 32 parts, or of 8 if 32 matrices are too large to store.
    A chunk of rays depends only on numbers drawn from ``budget.rng``, its part and its own index. Workers count or add
    up the rays and a checkpoint stores the sums, which are the same to the last bit.
    """
    root = new_seed(budget.rng)
    most = LARGEST_REPLICATES // (np.dtype(np.float64).itemsize * basis.size**2)
    parts = 1 if basis.is_partition else BATCHES if most >= BATCHES else PARTS
    sums = RaySums(law, basis, parts)
    sums.each = max(-(-budget.rays // parts), 1)
    count_long(sums, IndependentRays(law, basis, root, sums.each, parts), budget.engine or {})
    return _sampled("monte-carlo", sums.matrix(symmetrise=budget.symmetrise))


def sobol_matrix(sampler: SobolSampler, budget: Budget) -> KernelMatrix:
    """The matrix from at least ``budget.rays`` rays of the sampler, which continues its Sobol sequence."""
    return _sampled("qmc", sampler.sampled(budget.rays, symmetrise=budget.symmetrise, engine=budget.engine))


def _sampled(name: MethodName, found: KernelMatrix) -> KernelMatrix:
    # All rays of a cell can go to one cell: then only rounding is left.
    error = float(found.error) + rounding(found.basis)
    return replace(found, error=frobenius_error(error, "estimate", found.error.method), method=name)
