"""Matrices of laws from sampled rays: scrambled Sobol sequences or independent rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.chunks import IndependentRays, count_long
from ..sampling.counts import BATCHES, LARGEST_REPLICATES
from ..sampling.rays import RaySums
from ..sampling.sobol import PARTS, SobolSampler
from .method import Budget, MethodName, rounding


def by_sobol_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law driven by a uniform number, by rays of scrambled Sobol sequences."""
    return sobol_matrix(SobolSampler(law, basis, budget.rng), budget)


def by_independent_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of any law from independent rays with incoming angles from the invariant measure.

    In bases without cells the error comes from the spread of 32 parts, or of 8 if 32 matrices are too large to store.
    A chunk of rays depends only on numbers drawn from ``budget.rng``, its part and its own index. Workers count or add
    up the rays and a checkpoint stores the sums, which are the same to the last bit.
    """
    root = tuple(int(word) for word in budget.rng.integers(0, 2**63, size=2))
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
