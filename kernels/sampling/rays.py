"""Sums over sampled rays, one table per replicate, and the matrix and error computed from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, check_memory
from ...core.errors import AccuracyError
from ..bases.assembly import LARGE, largest_square_sum, mirror_image
from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.defects import BLOCK
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..walls.conditionals import UNRESOLVED_TOLERANCE
from .counts import matrix_from_counts, matrix_from_sums, sums_of_rows, with_missed_events

# Memory of sums of real numbers: the tables, their means, and the replicates.
TABLES = 3
# Rays in a chunk: at least SMALLEST_CHUNK, and one for CELLS_A_RAY matrix entries, so that adding matrices is cheap.
SMALLEST_CHUNK, CELLS_A_RAY = 2**16, 16


@dataclass(frozen=True)
class _Counts:
    """A table of small integers as int64, and with its mirror image, entry by entry when they are asked for."""

    table: NDArray[Any]
    mirrored: bool

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, key: Any) -> NDArray[np.int64]:
        found: NDArray[np.int64] = self.table[key].astype(np.int64)
        return found + self.table[::-1, ::-1][key] if self.mirrored else found

    def sum(self) -> int:
        """The sum of all entries."""
        return (1 + self.mirrored) * int(self.table.sum())


class RaySums:
    """Counts of rays from cell to cell, or sums of e_i(theta) e_j(theta') over rays, in several parts.

    Attributes
    ----------
    tables : ndarray of shape (parts, n, n)
        Integers if the basis is a partition: of large ones two bytes each, or more as soon as a count needs them.
    most : int
        The largest count of a large partition.
    each : int
        Number of rays in every part.
    unresolved : int
        Number of rays in all parts that did not escape. They count as retroreflected.
    """

    def __init__(self, law: Law, basis: Basis, parts: int) -> None:
        self.law, self.basis = law, basis
        shape = parts, basis.size, basis.size
        if not basis.is_partition:
            check_memory("basis", f"sampling in {basis!r}", TABLES * math.prod(shape))
        self.is_large = basis.is_partition and basis.size**2 > BLOCK
        counts = np.uint16 if self.is_large else np.int64
        self.tables = np.zeros(shape, dtype=counts if basis.is_partition else np.float64)
        self.each, self.unresolved, self.most = 0, 0, 0

    @property
    def chunk(self) -> int:
        """Rays in a chunk: a power of two, which preserves the balance of the Sobol sequence."""
        cells = self.basis.size**2 if self.basis.is_partition else 0
        cells *= cells <= LARGE
        return max(SMALLEST_CHUNK, 1 << (cells // CELLS_A_RAY).bit_length())

    def add(self, table: int, incoming: Floats, outgoing: Floats) -> None:
        """Add rays to one of the tables."""
        self.add_rows(table, incoming[None], outgoing[None])

    def add_rows(self, first: int, incoming: Floats, outgoing: Floats) -> None:
        """Add rays, shape (rows, rays), row by row to the tables from ``first`` on."""
        rows = slice(first, first + len(incoming))
        if not self.is_large:
            self.tables[rows] += sums_of_rows(self.basis, incoming, outgoing)
            return
        needed = np.min_scalar_type(self.most + incoming.shape[1])
        self.tables = self.tables.astype(np.promote_types(self.tables.dtype, needed), copy=False)
        cells = self.basis.index(incoming) * self.basis.size + self.basis.index(outgoing)
        for table, cell in zip(self.tables[rows].reshape(len(cells), -1), cells, strict=True):
            np.add.at(table, cell, 1)
            self.most = max(self.most, int(table[cell].max(initial=0)))

    def count_unresolved(self, escaped: NDArray[np.bool_] | None) -> None:
        """Count the rays that did not escape."""
        self.unresolved += 0 if escaped is None else int(escaped.size - np.count_nonzero(escaped))

    def matrix(self, *, symmetrise: bool, mirrored: bool = False) -> KernelMatrix:
        """The matrix; if ``mirrored``, every ray counts with its mirror image.

        The error includes twice the fraction of rays that did not escape times sup |e|^2; see also
        `with_missed_events`.

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
                "geometry.trace(wall, x, theta).counts() says how they ended, of a surface that of surface.trace(x, v)",
                fraction,
            )
        if self.basis.is_partition:
            parts = [_Counts(table, mirrored) for table in self.tables]
            found = matrix_from_counts(parts, self.basis, symmetrise=symmetrise, independent=len(parts) == 1)
        else:
            means = [
                (table + mirror_image(table, self.basis)) / (2 * self.each) if mirrored else table / self.each
                for table in self.tables
            ]
            keeps_measure = bool(self.law.reversible)
            found = matrix_from_sums(means, self.basis, symmetrise=symmetrise, keeps_measure=keeps_measure)
        found = with_missed_events(found, used)
        error, how = float(found.error), found.error.method
        if fraction > 0.0:
            error += 2.0 * fraction * largest_square_sum(self.basis)
            how += ", plus a bound for rays that did not escape"
        return replace(found, error=frobenius_error(error, "estimate", how), samples=used, unresolved=fraction)
