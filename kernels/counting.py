"""From counted pairs of angles to kernel matrices: estimates, their errors, and the test of symmetry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..checks import Floats
from ..errors import AccuracyError
from .basis import Basis
from .branch_quadrature import cell_index
from .symmetry import SymmetryDefect, relative_asymmetry, replicate_z_score, reversibility_z_score

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    Replicate: TypeAlias = "Floats | csr_array[Any, tuple[int, int]]"

Counts: TypeAlias = NDArray[np.int64]

# Values of basis functions held at a time.
CHUNK = 2**21
# Beyond this the replicates are not kept: they serve error estimates of eigenvalues, for which counts do as well.
LARGEST_REPLICATES = 2**28
WORST_NAMED = 8


@dataclass(frozen=True)
class SampledArray:
    """A symmetric array from samples with its error, replicates and raw symmetry defect."""

    symmetric: Floats
    error: float
    replicates: tuple[Replicate, ...]
    raw_defect: SymmetryDefect
    counts: Counts | None


def count_pairs(basis: Basis, incoming: Floats, outgoing: Floats) -> Counts:
    """Numbers of pairs from cell i to cell j, shape (n, n)."""
    n = basis.size
    cell = cell_index(basis, incoming).ravel() * n + cell_index(basis, outgoing).ravel()
    return np.bincount(cell, minlength=n * n).reshape(n, n).astype(np.int64, copy=False)


def sum_products(basis: Basis, incoming: Floats, outgoing: Floats, weight: Floats | None = None) -> Floats:
    """Sum over the pairs of e_i(theta) e_j(theta'), shape (n, n)."""
    total = np.zeros((basis.size, basis.size))
    step = max(1, CHUNK // basis.size)
    for start in range(0, incoming.size, step):
        part = slice(start, start + step)
        values = basis.evaluate(incoming[part])
        total += (values if weight is None else weight[part, None] * values).T @ basis.evaluate(outgoing[part])
    return total


def array_from_counts(
    parts: Sequence[Counts], basis: Basis, *, symmetrise: bool, invariant: bool, independent: bool
) -> SampledArray:
    r"""The estimate from counts, one array of them for each independent randomisation.

    Parameters
    ----------
    parts : sequence of (n, n) int64 arrays
        One for pairs that are independent, several for randomised quasi-Monte Carlo.
    symmetrise : bool
        False: P[i, j] = C_ij / N_i, so that rows sum to 1. True: every pair counts both ways, and the flux is
        F_ij = (C_ij + C_ji) / (E_i + E_j) with E_i = N where the incoming angles follow the invariant measure and
        E_i = N_i / w_i where they do not, which is the maximum likelihood estimate of a symmetric flux.
    invariant : bool
        Whether the incoming angles follow the invariant measure.
    independent : bool
        Whether the pairs are independent, so that counts are multinomial; else errors come from the parts.

    Raises
    ------
    AccuracyError
        If a bin has no pairs; ``defect`` is the measure of such bins.
    """
    counts = np.sum(parts, axis=0)
    weights, rows = basis.weights, counts.sum(axis=1)
    exposure = _exposure(counts, weights, invariant)
    _check_occupied(rows + counts.sum(axis=0) if symmetrise else rows, basis)
    scale = basis.heights[:, None] * basis.heights  # from fluxes to the orthonormal basis
    if symmetrise:
        whole = exposure[:, None] + exposure
        array = _ratio(counts + counts.T, whole)
    else:
        whole = np.broadcast_to((rows / weights)[:, None], counts.shape)
        array = counts / whole
    differences = [
        scale * _ratio(len(parts) * (_numerator(part, symmetrise) - _share(part, weights, invariant, symmetrise) * array), whole)
        for part in parts
    ] if len(parts) > 1 else []
    if independent:
        error = float(np.linalg.norm(scale * np.sqrt(_variances(counts, array, whole, weights, symmetrise, invariant))))
    else:
        error = float(np.sqrt(sum(float(np.sum(d**2)) for d in differences) / (len(parts) * (len(parts) - 1))))
    raw = scale * _ratio(counts, exposure[:, None])
    if independent:
        z_score = reversibility_z_score(counts, weights, invariant)
    else:
        root = np.sqrt(np.maximum(counts + counts.T, 1))
        z_score = replicate_z_score([(part - part.T) / root for part in parts])
    symmetric = scale * array
    return SampledArray(
        symmetric, error, _kept(symmetric, differences), SymmetryDefect(relative_asymmetry(raw), z_score=z_score), counts
    )


def array_from_sums(means: Sequence[Floats], basis: Basis, *, symmetrise: bool, keeps_measure: bool) -> SampledArray:
    """The estimate from means of e_i(theta) e_j(theta') over independent randomisations, all of the same size.

    What is known is put in: P 1 = 1, and where the law keeps the measure also the same for the adjoint. Errors are
    those of the spread over the randomisations.
    """
    raw = np.mean(means, axis=0)
    scale = float(np.linalg.norm(raw)) or 1.0
    z_score = replicate_z_score([(mean - mean.T) / scale for mean in means])
    fixed = [_with_constant(mean, basis.constant, keeps_measure or symmetrise) for mean in means]
    if symmetrise:
        fixed = [0.5 * (mean + mean.T) for mean in fixed]
    symmetric = np.mean(fixed, axis=0)
    differences = [mean - symmetric for mean in fixed]
    error = float(np.sqrt(sum(float(np.sum(d**2)) for d in differences) / (len(means) * (len(means) - 1))))
    defect = SymmetryDefect(relative_asymmetry(raw), z_score=z_score)
    return SampledArray(symmetric, error, _kept(symmetric, differences), defect, None)


def _with_constant(array: Floats, constant: Floats, both: bool) -> Floats:
    array = array - np.outer(array @ constant - constant, constant)
    return array - np.outer(constant, constant @ array - constant) if both else array


def _exposure(counts: Counts, weights: Floats, invariant: bool) -> Floats:
    return np.full(weights.size, float(counts.sum())) if invariant else counts.sum(axis=1) / weights


def _numerator(counts: Counts, symmetrise: bool) -> Counts:
    return counts + counts.T if symmetrise else counts


def _share(part: Counts, weights: Floats, invariant: bool, symmetrise: bool) -> Floats:
    """The part's own denominators, so that numerators minus these times the estimate are its influence on it."""
    if not symmetrise:
        return np.asarray((part.sum(axis=1) / weights)[:, None])
    exposure = _exposure(part, weights, invariant)
    return np.asarray(exposure[:, None] + exposure)


def _variances(
    counts: Counts, flux: Floats, whole: Floats, weights: Floats, symmetrise: bool, invariant: bool
) -> Floats:
    """Variances of the estimated fluxes for multinomial counts."""
    rows = counts.sum(axis=1)
    if not symmetrise:
        share = counts / rows[:, None]
        # unbiased for two rays or more; a single ray says nothing about its spread, which is then taken as large
        spread = np.where(rows[:, None] > 1, share * (1.0 - share) / np.maximum(rows[:, None] - 1, 1), share)
        return np.asarray(weights[:, None] ** 2 * spread)
    trials = np.broadcast_to(counts.sum() if invariant else np.maximum(rows, 1)[:, None], counts.shape)
    single = counts * (1.0 - counts / trials)
    return _ratio(np.where(np.eye(weights.size, dtype=bool), 4.0 * single, single + single.T), whole**2)


def _ratio(numerator: NDArray[Any], denominator: Floats) -> Floats:
    denominator = np.broadcast_to(denominator, numerator.shape)
    return np.divide(numerator, denominator, out=np.zeros(numerator.shape), where=denominator > 0.0)


def _check_occupied(rows: Counts, basis: Basis) -> None:
    empty = np.flatnonzero(rows == 0)
    if empty.size:
        named = ", ".join(map(str, empty[:WORST_NAMED])) + (", ..." if empty.size > WORST_NAMED else "")
        raise AccuracyError(
            f"{empty.size} of {basis.size} bins have no incoming pair (bins {named}); use more samples, samples that "
            "cover all angles, or fewer bins",
            float(basis.weights[empty].sum()),
        )


def _kept(symmetric: Floats, differences: Sequence[Floats]) -> tuple[Replicate, ...]:
    """The replicates as arrays, sparse where that is smaller."""
    if not differences or symmetric.nbytes * len(differences) > LARGEST_REPLICATES:
        return ()
    replicates = [symmetric + difference for difference in differences]
    if np.count_nonzero(replicates[0]) > symmetric.size // 4:
        for replicate in replicates:
            replicate.setflags(write=False)
        return tuple(replicates)
    from scipy.sparse import csr_array

    return tuple(csr_array(replicate) for replicate in replicates)
