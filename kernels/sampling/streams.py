"""Kernel matrices from streams of pairs of angles that do not fit into memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from ...core.checks import Floats, angles, check_memory, instance, shortened
from ...core.errors import InputError
from ...core.version import __version__
from ...core.workers import connected, in_order, results
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..matrices.defects import invariance_z_score
from ..matrices.matrix import KernelMatrix
from .counts import BATCHES, count_pairs, sum_products
from .estimation import NOT_INVARIANT_Z, WEIGHTED_BATCHES, bins_of_test, matrix_of_pairs, nearest_measure

# Pairs in a block: the stream is cut into these, whatever chunks it comes in. A multiple of the numbers of batches.
BLOCK = 2**20
# Seconds between two states of a checkpoint.
STORED_EVERY = 5.0
STATE = "state"
# Blocks that are on their way to or at a worker.
BLOCKS_A_WORKER = 3

# Its number, and the incoming and outgoing angles.
Block: TypeAlias = tuple[int, Floats, Floats]


def estimate_stream(
    pairs: Any,
    basis: Basis,
    symmetrise: bool = False,
    *,
    invariant: bool = True,
    checkpoint: str | Path | None = None,
    key: str | None = None,
    client: Any = None,
) -> KernelMatrix:
    """Estimate the matrix of a law from more pairs (theta, theta') than memory holds.

    Parameters
    ----------
    pairs : array of shape (n, 2), two arrays of shape (n,), or iterable of chunks
        Incoming and outgoing angles of independent pairs, in (0, pi), in radians. Arrays of numpy.memmap, h5py and zarr
        are read slice by slice; an iterable gives chunks (theta_in, theta_out) of any sizes.
    basis : Basis
    symmetrise : bool
        As of `estimate`.
    invariant : bool
        Whether the incoming angles follow sin(theta) d theta, which is tested in the end. If not, pairs are weighted as
        in `estimate`, within blocks of 2^20 pairs.
    checkpoint : path, optional
        A file in which the sums are stored every few seconds. The same call, with the same pairs from the first on,
        goes on with it: arrays are read from where they were, an iterable is advanced to there.
    key : str, optional
        A name for the computation, needed for a basis of one's own that a checkpoint cannot compare.
    client : int, str or distributed.Client, optional
        As of `discretise`: this process reads the stream, and workers count or add up its blocks. That is of use where
        this takes longer than to send a block, so for many functions of a basis without cells.

    Returns
    -------
    KernelMatrix
        The same to the last bit for any size of the chunks and any workers, and however often it was stopped. In a
        basis of cells it is that of `estimate` on all pairs if these follow the measure; else the two differ by
        rounding, or by the blocks in which pairs are weighted. Memory is that of the matrix, once for cells, else 32
        times, and of a block; with workers of three blocks, and as many such sums, for each of them.

    Raises
    ------
    InputError
        If an angle is outside (0, pi), there are too few pairs, or the incoming angles do not follow the measure; if
        the checkpoint is of other pairs or cannot be written.
    AccuracyError
        If a bin has no incoming pair.

    Examples
    --------
    >>> from asperity.kernels import Bins
    >>> chunks = iter([([0.5], [0.5]), ([1.0, 2.0, 2.5], [2.0, 1.0, 2.5])])
    >>> estimate_stream(chunks, Bins(2)).counts.tolist()
    [[1, 1], [1, 1]]
    """
    instance("basis", basis, Basis, "ker.Bins(64)")
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for sin(theta), got {basis!r}")
    source = _source(pairs)
    sums = _Sums.empty(basis, bool(invariant))
    try:
        if checkpoint is None:
            sums.add_all(source, basis, None, client)
        else:
            identity = {
                "computation": "stream of pairs", "version": __version__, "basis": basis,
                "invariant": sums.invariant, "pairs": source.size, "block": BLOCK,
                "first pairs": np.stack(source.first()),
            }  # fmt: skip
            with Checkpoint(checkpoint, identity, key=key) as store:
                sums.add_all(source, basis, store, client)
    except KeyboardInterrupt as stop:
        lost = "without a checkpoint their sums are lost"
        how = lost if checkpoint is None else f"{checkpoint} has {sums.stored} of them: give the same call"
        raise KeyboardInterrupt(f"stopped after {sums.number} pairs; {how}") from stop
    return sums.matrix(basis, bool(symmetrise))


@dataclass
class _Sums:
    """What is added up: counts or sums by batches, and totals of incoming angles in bins."""

    invariant: bool
    number: int
    totals: NDArray[np.int64]
    counts: NDArray[np.int64]
    tables: Floats
    masses: Floats
    stored: int = 0

    @staticmethod
    def empty(basis: Basis, invariant: bool) -> _Sums:
        """Nothing added yet."""
        batches = 0 if basis.is_partition and invariant else BATCHES if invariant else WEIGHTED_BATCHES
        check_memory("basis", f"the sums in {basis!r}", (batches + 2) * basis.size**2)
        cells = basis.size if basis.is_partition else 0
        return _Sums(
            invariant, 0, np.zeros(bins_of_test(basis).size, dtype=np.int64), np.zeros((cells, cells), dtype=np.int64),
            np.zeros((batches, basis.size, basis.size)), np.zeros(batches),
        )  # fmt: skip

    def add_all(self, source: _Source, basis: Basis, store: Checkpoint | None, client: Any) -> None:
        """Add all pairs of a source, or those that the checkpoint does not have; block by block."""
        if store is not None:
            for _, known in store.parts(self._read):
                self.number, self.stored = (int(known["number"]),) * 2
                self.totals, self.counts, self.tables, self.masses = (
                    known[name] for name in ("totals", "counts", "tables", "masses")
                )
        blocks = (
            (number, angles("theta_in", theta), angles("theta_out", image))
            for number, (theta, image) in enumerate(source.blocks(self.number))
        )
        stored = time.monotonic()
        with connected(client) as workers:
            for _ in self._add_each(blocks, basis, workers):
                if store is not None and time.monotonic() - stored > STORED_EVERY:
                    self._store(store)
                    stored = time.monotonic()
        # not after an interrupt, which may leave half a block in the sums
        if store is not None:
            self._store(store)

    def _add_each(self, blocks: Iterator[Block], basis: Basis, workers: Any) -> Iterator[None]:
        """Add the blocks in their order."""
        if workers is None:
            for _, theta, image in blocks:
                self._add(theta, image, basis)
                yield
            return
        backlog = BLOCKS_A_WORKER * max(len(workers.nthreads()), 1)
        found = results(_Adding(basis, self.invariant).sums, blocks, workers, backlog)
        for _, own in in_order(((number, own) for (number, *_), own in found), count()):
            self._merge(own)
            yield

    def _merge(self, other: _Sums) -> None:
        self.totals += other.totals
        self.counts += other.counts
        self.tables += other.tables
        self.masses += other.masses
        self.number += other.number

    def _add(self, theta: Floats, image: Floats, basis: Basis) -> None:
        bins, batches = bins_of_test(basis), len(self.tables)
        self.totals += np.bincount(bins.index(theta), minlength=bins.size)
        if basis.is_partition:
            self.counts += count_pairs(basis, theta, image)
        for batch in range(min(batches, theta.size)):
            own, other = theta[batch::batches], image[batch::batches]
            weight = np.ones(own.size) if self.invariant else own.size * nearest_measure(own)
            self.tables[batch] += sum_products(basis, own, other, weight)
            self.masses[batch] += own.size
        self.number += theta.size

    def _store(self, store: Checkpoint) -> None:
        kept = {name: value for name, value in vars(self).items() if name not in ("invariant", "stored")}
        store.put(STATE, packed_arrays(kept), now=True)
        self.stored = self.number

    def matrix(self, basis: Basis, symmetrise: bool) -> KernelMatrix:
        """The matrix, once everything is added."""
        least = 1 if basis.is_partition and self.invariant else 2 * BATCHES
        if self.number < least:
            raise InputError(f"pairs: expected at least {least} pairs for {basis!r}, got {self.number}")
        if self.invariant and invariance_z_score(self.totals, bins_of_test(basis).weights) >= NOT_INVARIANT_Z:
            raise InputError(
                "pairs: expected incoming angles that follow sin(theta) d theta, got others; pass invariant=False"
            )
        means = [table / mass for table, mass in zip(self.tables, self.masses, strict=True)] or None
        counts = self.counts if basis.is_partition else None
        return matrix_of_pairs(basis, counts, means, self.invariant, self.number, symmetrise)

    def _read(self, _: str, content: bytes) -> dict[str, NDArray[Any]]:
        """The stored arrays, of the shapes of those here."""
        found = unpacked_arrays(
            content,
            {
                "number": Stored("i", (), 0), "totals": Stored("i", self.totals.shape, 0),
                "counts": Stored("i", self.counts.shape, 0), "tables": Stored("f", self.tables.shape),
                "masses": Stored("f", self.masses.shape, 0.0),
            },
        )  # fmt: skip
        sums = [
            found["totals"].sum(),
            *([found["counts"].sum()] if self.counts.size else []),
            *([found["masses"].sum()] if self.masses.size else []),
        ]
        if any(one != found["number"] for one in sums):
            raise ValueError("its sums are not of the number of pairs that it has")
        return found


@dataclass(frozen=True)
class _Adding:
    """What a worker is sent."""

    basis: Basis
    invariant: bool

    def sums(self, block: Block) -> _Sums:
        """The sums of one block."""
        _, theta, image = block
        found = _Sums.empty(self.basis, self.invariant)
        found._add(theta, image, self.basis)
        return found


class _Source:
    """Pairs in blocks of ``BLOCK``, whatever chunks they come in.

    Parameters
    ----------
    chunks : iterable, or callable
        Of a stream its chunks; of arrays a function that gives the chunks after so many pairs.
    size : int or None
        Number of pairs of arrays.
    """

    def __init__(self, chunks: Iterable[Any] | Callable[[int], Iterator[Any]], size: int | None) -> None:
        self.size = size
        self._after = chunks if callable(chunks) else None
        self._chunks: Iterator[Any] = chunks(0) if callable(chunks) else iter(chunks)
        self._waiting: list[tuple[Floats, Floats]] = []

    def first(self) -> tuple[Floats, Floats]:
        """The first block, which is not taken away."""
        block = self._next()
        self._waiting.insert(0, block)
        return block

    def blocks(self, known: int) -> Iterator[tuple[Floats, Floats]]:
        """All blocks after the first pairs, so many of them: whole blocks, or all pairs that there were."""
        if self._after is not None:
            self._chunks, self._waiting = self._after(known), []
        passed = 0 if self._after is None else known
        while passed < known:
            block = self._next()
            passed += block[0].size
            if not block[0].size or passed > known:
                raise InputError(
                    f"pairs: expected the stream whose {known} pairs the checkpoint has, got one that has "
                    f"{'fewer' if passed < known else 'more'}; name another checkpoint"
                )
        while (block := self._next())[0].size:
            yield block

    def _next(self) -> tuple[Floats, Floats]:
        """The next block, shorter at the end of the stream."""
        number = sum(theta.size for theta, _ in self._waiting)
        while number < BLOCK and (chunk := next(self._chunks, None)) is not None:
            theta, image = _columns(chunk)
            self._waiting.append((theta, image))
            number += theta.size
        columns = [np.concatenate([np.empty(0), *(chunk[k] for chunk in self._waiting)]) for k in (0, 1)]
        rest = columns[0][BLOCK:], columns[1][BLOCK:]
        self._waiting = [rest] if rest[0].size else []
        return columns[0][:BLOCK], columns[1][:BLOCK]


def _columns(chunk: Any) -> tuple[Floats, Floats]:
    try:
        theta, image = (np.asarray(column, dtype=np.float64).ravel() for column in chunk)
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"pairs: expected chunks (theta_in, theta_out), got one of something else: {reason}"
        ) from reason
    if theta.shape != image.shape:
        raise InputError(
            f"pairs: expected as many outgoing as incoming angles in a chunk, got {image.size} and {theta.size}"
        )
    return theta, image


def _source(pairs: Any) -> _Source:
    """The blocks of an array of pairs, of two arrays, or of an iterable of chunks."""
    # numpy's arrays and those of other libraries, which have a shape and are sliced
    shape = getattr(pairs, "shape", None)
    if shape is not None:
        if len(shape) != 2 or shape[1] != 2:
            raise InputError(f"pairs: expected an array of shape (n, 2), got {tuple(shape)}")
        size = int(shape[0])
        return _Source(lambda start: (np.asarray(pairs[k : k + BLOCK]).T for k in range(start, size, BLOCK)), size)
    if isinstance(pairs, Sequence) and len(pairs) == 2 and all(_is_column(column) for column in pairs):
        theta, image = pairs
        if theta.shape != image.shape:
            raise InputError(f"pairs: expected two arrays of one length, got {theta.shape} and {image.shape}")
        length = int(theta.shape[0])
        return _Source(
            lambda start: ((theta[k : k + BLOCK], image[k : k + BLOCK]) for k in range(start, length, BLOCK)), length
        )
    if isinstance(pairs, (str, bytes)) or not isinstance(pairs, Iterable):
        raise InputError(f"pairs: expected an array of shape (n, 2) or an iterable of chunks, got {shortened(pairs)}")
    return _Source(pairs, None)


def _is_column(column: Any) -> bool:
    shape = getattr(column, "shape", None)  # of other libraries' arrays too
    return shape is not None and len(shape) == 1
