"""Matrices of laws from sampled rays: scrambled Sobol sequences or independent rays."""

from __future__ import annotations

from dataclasses import replace

from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.monte_carlo import independent_rays
from ..sampling.sobol import SobolSampler
from .method import Budget, MethodName, rounding


def by_sobol_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law driven by a uniform number, by rays of scrambled Sobol sequences."""
    return sobol_matrix(SobolSampler(law, basis, budget.rng), budget)


def by_independent_rays(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of any law by independent rays."""
    found = independent_rays(law, basis, budget.rays, budget.rng, budget.symmetrise, budget.engine)
    return _sampled("monte-carlo", found)


def sobol_matrix(sampler: SobolSampler, budget: Budget) -> KernelMatrix:
    """The matrix from at least ``budget.rays`` rays of the sampler, which continues its Sobol sequence."""
    return _sampled("qmc", sampler.sampled(budget.rays, symmetrise=budget.symmetrise, engine=budget.engine))


def _sampled(name: MethodName, found: KernelMatrix) -> KernelMatrix:
    # All rays of a cell can go to one cell: then only rounding is left.
    error = float(found.error) + rounding(found.basis)
    return replace(found, error=frobenius_error(error, "estimate", found.error.method), method=name)
