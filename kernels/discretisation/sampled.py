"""Matrices of laws from sampled rays: scrambled Sobol sequences or independent rays."""

from __future__ import annotations

from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.counts import SampledArray
from ..sampling.monte_carlo import independent_rays
from ..sampling.sobol import PARTS, SobolSampler
from .method import Budget, MethodName, rounding


class Sobol:
    """Laws driven by a uniform number, by rays of scrambled Sobol sequences."""

    name: MethodName = "qmc"

    def accepts(self, law: Law, basis: Basis) -> bool:
        return law.random_map() is not None

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        return sobol_matrix(SobolSampler(law, basis, budget.rng), basis, budget)


class MonteCarlo:
    """Any law, by independent rays."""

    name: MethodName = "monte-carlo"

    def accepts(self, law: Law, basis: Basis) -> bool:
        return True

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        found = independent_rays(law, basis, budget.rays, budget.rng, budget.symmetrise, budget.engine)
        spread = "variance of multinomial counts" if basis.is_partition else "spread of parts"
        return _sampled(self.name, found, basis, budget, spread)


def sobol_matrix(sampler: SobolSampler, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix from at least ``budget.rays`` rays of the sampler, which continues its Sobol sequence."""
    found = sampler.sampled(budget.rays, symmetrise=budget.symmetrise, engine=budget.engine)
    return _sampled("qmc", found, basis, budget, f"spread of {PARTS} scrambled sequences")


def _sampled(
    name: MethodName, found: tuple[SampledArray, int, float], basis: Basis, budget: Budget, how: str
) -> KernelMatrix:
    array, used, unresolved = found
    if unresolved:
        how += ", plus a bound for rays that did not escape"
    return KernelMatrix(
        array.symmetric,
        basis,
        # All rays of a cell can go to one cell: then only rounding is left.
        frobenius_error(array.error + rounding(basis), "estimate", how),
        method=name,
        counts=array.counts,
        replicates=array.replicates,
        symmetrised=budget.symmetrise,
        samples=used,
        unresolved=unresolved,
        raw_defect=array.raw_defect,
    )
