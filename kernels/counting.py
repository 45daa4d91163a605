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
from .products import add_products, cell_index
from .symmetry import SymmetryDefect, relative_asymmetry, replicate_z_score, reversibility_z_score

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    Replicate: TypeAlias = "Floats | csr_array[Any, tuple[int, int]]"

Counts: TypeAlias = NDArray[np.int64]

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
    add_products(total, basis, incoming, outgoing, np.ones(incoming.size) if weight is None else weight)
    return total


def array_from_counts(
    parts: Sequence[Counts | Floats], basis: Basis, *, symmetrise: bool, independent: bool
) -> SampledArray:
    r"""The estimate from counts C of pairs whose incoming angles follow the invariant measure.

    Parameters
    ----------
    parts : sequence of (n, n) arrays
        One array for pairs that are independent; several, of batches of the same size or parts of a randomised net,
        for others. Weights may stand for counts in the latter case.
    basis : Basis
        The partition that was counted in.
    symmetrise : bool
        False: P[i, j] = C_ij / N_i, so that rows sum to 1. True: every pair counts both ways, and the flux is
        (C_ij + C_ji) / (2 N).
    independent : bool
        Whether the pairs are independent, so that counts are multinomial; else errors come from the parts.

    Raises
    ------
    AccuracyError
        If a bin has no pairs; ``defect`` is the measure of such bins.
    """
    counts = parts[0] if len(parts) == 1 else _summed(parts)
    number, rows = float(counts.sum()), counts.sum(axis=1)
    _check_occupied(rows + counts.sum(axis=0) if symmetrise else rows, basis)
    scale = basis.heights[:, None] * basis.heights  # from fluxes to the orthonormal basis
    flux = (counts + counts.T) / (2.0 * number) if symmetrise else counts * (basis.weights / rows)[:, None]
    symmetric = scale * flux
    replicates = _Replicates(symmetric, len(parts))
    if independent:
        error = float(np.linalg.norm(scale * np.sqrt(_variances(counts, basis.weights, symmetrise))))
        z_score = reversibility_z_score(np.asarray(counts, dtype=np.int64))
    else:
        for part in parts:
            # the part's influence on the estimate: its numerators minus its denominators times the whole estimate
            if symmetrise:
                excess = (part + part.T) / (2.0 * number) - float(part.sum()) / number * flux
            else:
                excess = (part - (part.sum(axis=1) / rows)[:, None] * counts) * (basis.weights / rows)[:, None]
            replicates.add(len(parts) * scale * excess)
        error = replicates.standard_error()
        pairs = np.nonzero(np.triu(counts + counts.T, 1))
        root = np.sqrt((counts + counts.T)[pairs])
        z_score = replicate_z_score([(part[pairs] - part.T[pairs]) / root for part in parts])
    raw = relative_asymmetry(scale * counts / number)
    whole = np.asarray(counts, dtype=np.int64) if np.issubdtype(counts.dtype, np.integer) else None
    return SampledArray(symmetric, error, replicates.kept(), SymmetryDefect(raw, z_score=z_score), whole)


def array_from_sums(means: Sequence[Floats], basis: Basis, *, symmetrise: bool, keeps_measure: bool) -> SampledArray:
    """The estimate from means of e_i(theta) e_j(theta') over batches of the same size or parts of a net.

    What is known is put in: P 1 = 1, and where the law keeps the measure also the same for the adjoint. Errors are
    those of the spread over these.
    """
    raw = np.mean(means, axis=0)
    scale = float(np.linalg.norm(raw)) or 1.0
    z_score = replicate_z_score([(mean - mean.T) / scale for mean in means])
    fixed = [_with_constant(mean, basis.constant, keeps_measure or symmetrise) for mean in means]
    if symmetrise:
        fixed = [0.5 * (mean + mean.T) for mean in fixed]
    symmetric = np.asarray(np.mean(fixed, axis=0))
    replicates = _Replicates(symmetric, len(means))
    for mean in fixed:
        replicates.add(mean - symmetric)
    defect = SymmetryDefect(relative_asymmetry(raw), z_score=z_score)
    return SampledArray(symmetric, replicates.standard_error(), replicates.kept(), defect, None)


class _Replicates:
    """The arrays of the parts, collected one by one; sparse where that is smaller, dropped if too large."""

    def __init__(self, symmetric: Floats, number: int) -> None:
        self.symmetric, self.number = symmetric, number
        self.squares = 0.0
        self.arrays: list[Replicate] = []

    def add(self, difference: Floats) -> None:
        self.squares += float(np.sum(difference**2))
        if self.symmetric.nbytes * self.number > LARGEST_REPLICATES:
            return
        replicate = self.symmetric + difference
        if 4 * np.count_nonzero(replicate) > replicate.size:
            replicate.setflags(write=False)
            self.arrays.append(replicate)
            return
        from scipy.sparse import csr_array

        self.arrays.append(csr_array(replicate))

    def standard_error(self) -> float:
        return float(np.sqrt(self.squares / (self.number * (self.number - 1))))

    def kept(self) -> tuple[Replicate, ...]:
        return tuple(self.arrays)


def _with_constant(array: Floats, constant: Floats, both: bool) -> Floats:
    array = array - np.outer(array @ constant - constant, constant)
    return array - np.outer(constant, constant @ array - constant) if both else array


def _summed(parts: Sequence[Counts | Floats]) -> Counts | Floats:
    total = parts[0].copy()
    for part in parts[1:]:
        total += part
    return total


def _variances(counts: Counts | Floats, weights: Floats, symmetrise: bool) -> Floats:
    """Variances of the estimated fluxes for multinomial counts."""
    rows = counts.sum(axis=1)[:, None]
    if not symmetrise:
        share = counts / rows
        # unbiased for two rays or more; a single ray says nothing about its spread, which is then taken as large
        spread = np.where(rows > 1, share * (1.0 - share) / np.maximum(rows - 1, 1), share)
        return np.asarray(weights[:, None] ** 2 * spread)
    number = float(counts.sum())
    both = np.where(np.eye(weights.size, dtype=bool), counts, counts + counts.T) / number
    # a pair on the diagonal counts fully, one off it by half at each of its two places
    return np.asarray(np.where(np.eye(weights.size, dtype=bool), 1.0, 0.25) * both * (1.0 - both) / number)


def _check_occupied(rows: Counts | Floats, basis: Basis) -> None:
    empty = np.flatnonzero(rows <= 0)
    if empty.size:
        named = ", ".join(map(str, empty[:WORST_NAMED])) + (", ..." if empty.size > WORST_NAMED else "")
        raise AccuracyError(
            f"{empty.size} of {basis.size} bins have no incoming pair (bins {named}); use more samples, samples that "
            "cover all angles, or fewer bins",
            float(basis.weights[empty].sum()),
        )
