"""Sums over sampled rays, one table per replicate, and the matrix and error computed from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, check_memory
from ...core.errors import AccuracyError
from ..bases.assembly import LARGE, largest_square_sum
from ..bases.basis import Basis
from ..bases.mirror import reflection_matrix
from ..laws.law import Law
from ..walls.traced_map import UNRESOLVED_TOLERANCE
from .counts import SampledArray, array_from_counts, array_from_sums, sums_of_rows

# Rays in a chunk: at least SMALLEST_CHUNK, and one for CELLS_A_RAY matrix entries, so that adding matrices is cheap.
SMALLEST_CHUNK, CELLS_A_RAY = 2**16, 16
# Memory in which a sampled matrix is computed, in matrices of doubles.
MOST_MATRICES = 8


@dataclass(frozen=True)
class _WithImages(Sequence[Any]):
    """Tables to which their mirror images are added when they are asked for, so that no copy is kept."""

    tables: NDArray[Any]
    image: Callable[[Any], Any]

    def __len__(self) -> int:
        return len(self.tables)

    def __getitem__(self, number: Any) -> Any:
        table = self.tables[int(number)]
        return table + self.image(table)


class RaySums:
    """Counts of rays from cell to cell, or sums of e_i(theta) e_j(theta') over rays, in several parts.

    Attributes
    ----------
    tables : ndarray of shape (parts, n, n)
        Integers if the basis is a partition.
    each : int
        Number of rays in every part.
    unresolved : int
        Number of rays in all parts that did not escape. They count as retroreflected.
    """

    def __init__(self, law: Law, basis: Basis, parts: int) -> None:
        self.law, self.basis = law, basis
        shape = parts, basis.size, basis.size
        check_memory("basis", f"sampling in {basis!r}", MOST_MATRICES * basis.size**2)
        counts = np.int32 if parts > 1 and self._is_large else np.int64
        self.tables = np.zeros(shape, dtype=counts if basis.is_partition else np.float64)
        self.each, self.unresolved = 0, 0

    @property
    def _is_large(self) -> bool:
        return self.basis.size**2 > LARGE

    @property
    def chunk(self) -> int:
        """Rays in a chunk: a power of two, which preserves the balance of the Sobol sequence."""
        cells = 0 if self._is_large or not self.basis.is_partition else self.basis.size**2
        return max(SMALLEST_CHUNK, 1 << (cells // CELLS_A_RAY).bit_length())

    def add(self, table: int, incoming: Floats, outgoing: Floats) -> None:
        """Add rays to one of the tables."""
        self.add_rows(table, incoming[None], outgoing[None])

    def add_rows(self, first: int, incoming: Floats, outgoing: Floats) -> None:
        """Add rays, shape (rows, rays), row by row to the tables from ``first`` on."""
        tables = self.tables[first : first + len(incoming)]
        if not (self._is_large and self.basis.is_partition):
            tables += sums_of_rows(self.basis, incoming, outgoing)
            return
        for table, sources, targets in zip(tables, self.basis.index(incoming), self.basis.index(outgoing), strict=True):
            np.add.at(table, (sources, targets), 1)

    def count_unresolved(self, escaped: NDArray[np.bool_] | None) -> None:
        """Count the rays that did not escape."""
        self.unresolved += 0 if escaped is None else int(escaped.size - np.count_nonzero(escaped))

    def array(self, *, symmetrise: bool, mirrored: bool = False) -> tuple[SampledArray, int, float]:
        """The matrix, the number of rays used, and the fraction of rays that did not escape.

        The error includes twice this fraction times sup |e|^2; see also `SampledArray.with_missed_events`. If
        ``mirrored``, every ray counts with its mirror image.

        Raises
        ------
        AccuracyError
            If more than 1e-4 of the rays did not escape, or a bin has no ray.
        """
        used = len(self.tables) * self.each
        fraction = self.unresolved / used
        if fraction > UNRESOLVED_TOLERANCE:
            raise AccuracyError(
                f"{self.law!r}: {fraction:.2g} of {used} rays did not escape, more than {UNRESOLVED_TOLERANCE:g}; "
                "geometry.trace(wall, x, theta).counts() says how they ended",
                fraction,
            )
        parts: Any = _WithImages(self.tables, self._mirror_image) if mirrored else self.tables
        if self.basis.is_partition:
            array = array_from_counts(parts, self.basis, symmetrise=symmetrise, independent=len(parts) == 1)
        else:
            means = [part / (2 * self.each if mirrored else self.each) for part in parts]
            keeps_measure = bool(self.law.reversible)
            array = array_from_sums(means, self.basis, symmetrise=symmetrise, keeps_measure=keeps_measure)
        array = array.with_missed_events(used)
        if fraction > 0.0:
            extra = 2.0 * fraction * largest_square_sum(self.basis)
            array = SampledArray(array.symmetric, array.error + extra, array.replicates, array.raw_defect, array.counts)
        return array, used, fraction

    def _mirror_image(self, table: Any) -> Any:
        """The table of the rays (pi - theta, pi - theta')."""
        if self.basis.is_partition:
            return table[::-1, ::-1]
        flip = reflection_matrix(self.basis)
        return flip @ table @ flip.T
