"""Kernel matrices from given pairs of incoming and outgoing angles, in memory or from a stream."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from ...core.checks import Floats, angles, check_memory, shortened
from ...core.errors import InputError
from ...core.version import __version__
from ..bases.basis import Basis, checked_basis
from ..bases.measure import SINE
from ..bases.partitions import Bins
from ..matrices.defects import invariance_z_score
from ..matrices.matrix import KernelMatrix
from .counts import BATCHES, Counts, count_pairs, matrix_from_counts, matrix_from_sums, sum_products, with_missed_events

# Pairs in a block: the stream is cut into these, whatever chunks it comes in. A multiple of the numbers of batches.
BLOCK = 2**20
# Seconds between two states of a checkpoint.
STORED_EVERY = 5.0
STATE = "state"


def estimate_stream(
    pairs: Any,
    basis: Basis,
    symmetrise: bool = False,
    *,
    invariant: bool = True,
    checkpoint: str | Path | None = None,
    key: str | None = None,
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
    Returns
    -------
    KernelMatrix
        The same to the last bit for any size of the chunks, and however often it was stopped. In a basis of cells it is
        that of `estimate` on all pairs if these follow the measure; else the two differ by rounding, or by the blocks
        in which pairs are weighted. Memory is that of the matrix, once for cells, else 32 times, and of a block.

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
    checked_basis(basis)
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for sin(theta), got {basis!r}")
    chunks_after, size = _source(pairs)
    blocks = _blocks(chunks_after(0) if chunks_after else iter(pairs))
    sums = _Sums.empty(basis, bool(invariant))
    try:
        if checkpoint is None:
            sums.add_all(blocks, basis, None)
        else:
            first = next(blocks, np.empty((2, 0)))
            identity = {
                "computation": "stream of pairs", "version": __version__, "basis": basis,
                "invariant": sums.invariant, "pairs": size, "block": BLOCK, "first pairs": first,
            }  # fmt: skip
            with Checkpoint(checkpoint, identity, key=key) as store:
                sums.restore(store)
                rest = (
                    _blocks(chunks_after(sums.number)) if chunks_after else _after(chain([first], blocks), sums.number)
                )
                sums.add_all(rest, basis, store)
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

    def restore(self, store: Checkpoint) -> None:
        """Take the sums of the checkpoint, if it has some."""
        for _, known in store.parts(self._read):
            self.number, self.stored = (int(known["number"]),) * 2
            self.totals, self.counts, self.tables, self.masses = (
                known[name] for name in ("totals", "counts", "tables", "masses")
            )

    def add_all(self, blocks: Iterable[Floats], basis: Basis, store: Checkpoint | None) -> None:
        """Add all pairs, block by block."""
        stored = time.monotonic()
        for theta, image in blocks:
            self._add(angles("theta_in", theta), angles("theta_out", image), basis)
            if store is not None and time.monotonic() - stored > STORED_EVERY:
                self._store(store)
                stored = time.monotonic()
        # not after an interrupt, which may leave half a block in the sums
        if store is not None:
            self._store(store)

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


def _source(pairs: Any) -> tuple[Callable[[int], Iterator[Any]] | None, int | None]:
    """Of an array of pairs or two arrays the function that gives the chunks after so many pairs, and their number."""
    # numpy's arrays and those of other libraries, which have a shape and are sliced
    shape = getattr(pairs, "shape", None)
    if shape is not None:
        if len(shape) != 2 or shape[1] != 2:
            raise InputError(f"pairs: expected an array of shape (n, 2), got {tuple(shape)}")
        size = int(shape[0])
        return (lambda start: (np.asarray(pairs[k : k + BLOCK]).T for k in range(start, size, BLOCK))), size
    if isinstance(pairs, Sequence) and len(pairs) == 2 and all(_is_column(column) for column in pairs):
        theta, image = pairs
        if theta.shape != image.shape:
            raise InputError(f"pairs: expected two arrays of one length, got {theta.shape} and {image.shape}")
        length = int(theta.shape[0])
        return (
            lambda start: ((theta[k : k + BLOCK], image[k : k + BLOCK]) for k in range(start, length, BLOCK))
        ), length
    if isinstance(pairs, (str, bytes)) or not isinstance(pairs, Iterable):
        raise InputError(f"pairs: expected an array of shape (n, 2) or an iterable of chunks, got {shortened(pairs)}")
    return None, None


def _is_column(column: Any) -> bool:
    shape = getattr(column, "shape", None)  # of other libraries' arrays too
    return shape is not None and len(shape) == 1


def _blocks(chunks: Iterator[Any]) -> Iterator[Floats]:
    """Incoming and outgoing angles, shape (2, ``BLOCK``), whatever chunks they come in; fewer in the last block."""
    waiting, number = [np.empty((2, 0))], 0
    for chunk in chunks:
        waiting.append(_columns(chunk))
        number += waiting[-1].shape[1]
        if number >= BLOCK:
            whole, end = np.concatenate(waiting, axis=1), number - number % BLOCK
            yield from (whole[:, start : start + BLOCK] for start in range(0, end, BLOCK))
            waiting, number = [whole[:, end:].copy()], number % BLOCK
    if number:
        yield np.concatenate(waiting, axis=1)


def _columns(chunk: Any) -> Floats:
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
    return np.stack([theta, image])


def _after(blocks: Iterator[Floats], known: int) -> Iterator[Floats]:
    """The blocks of a stream after its first pairs, so many of them: whole blocks, or all pairs that there were."""
    passed = 0
    while passed < known:
        size = next(blocks, np.empty((2, 0))).shape[1]
        passed += size
        if not size or passed > known:
            raise InputError(
                f"pairs: expected the stream whose {known} pairs the checkpoint has, got one that has "
                f"{'fewer' if passed < known else 'more'}; name another checkpoint"
            )
    return blocks


# Incoming angles count as not invariant if their totals in bins deviate from the measure by this z-score.
NOT_INVARIANT_Z = 4.0
# Number of bins for these totals if the basis is not `Bins`.
TEST_BINS = 32
# Batches of weighted pairs whose spread gives the error; in smaller batches the weights would be less even.
WEIGHTED_BATCHES = 8


def estimate(
    theta_in: ArrayLike,
    theta_out: ArrayLike,
    basis: Basis,
    symmetrise: bool = False,
    *,
    invariant: bool | None = None,
) -> KernelMatrix:
    r"""Estimate the matrix of a law from measured, traced or simulated pairs (theta, theta').

    Parameters
    ----------
    theta_in, theta_out : array_like
        Incoming and outgoing angles of independent pairs, in (0, pi), in radians, in the same shape.
    basis : Basis
        Bins, Legendre or Panels.
    symmetrise : bool
        Whether each pair counts in both directions, which is valid for reversible laws. The flux is then symmetric, but
        rows of ``array`` sum to 1 only within the sampling error; `KernelMatrix.symmetry_defect` still belongs to the
        raw pairs. If False, rows sum to 1.
    invariant : bool, optional
        Whether the incoming angles follow sin(theta) d theta. By default a test of their totals in bins decides. If
        they do not, C - C^T contains no information about reversibility, and counts are not averages over their bins.
        Every pair is then weighted by the measure of the angles that are nearer to its incoming angle than to any
        other incoming angle of its batch.

    Returns
    -------
    KernelMatrix
        The matrix, with the raw ``counts`` for Bins. Its ``error`` is the 95 % quantile of the sampling error, from
        the variance of multinomial counts or from the spread of batches (32 in bases without cells, 8 of weighted
        pairs), and at least the change by an event that none of the pairs may have met. The truncation to the basis is
        not included.

    Raises
    ------
    InputError
        If the shapes differ, an angle is outside (0, pi), or there are too few pairs.
    AccuracyError
        If a bin has no incoming pair; use more pairs or fewer bins.

    Examples
    --------
    >>> P = estimate([0.5, 1.0, 2.0, 2.5], [0.5, 2.0, 1.0, 2.5], Bins(2))
    >>> P.array.round(14).tolist(), P.counts.tolist()
    ([[0.5, 0.5], [0.5, 0.5]], [[1, 1], [1, 1]])
    """
    incoming, outgoing = angles("theta_in", theta_in), angles("theta_out", theta_out)
    if incoming.shape != outgoing.shape:
        raise InputError(
            f"theta_out: expected the shape of theta_in, {incoming.shape}, got {outgoing.shape}; pass pairs"
        )
    checked_basis(basis)
    check_memory("basis", f"the matrix in {basis!r}", basis.size**2)
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for sin(theta), got {basis!r}")
    incoming, outgoing = incoming.ravel(), outgoing.ravel()
    least = 1 if basis.is_partition else 2 * WEIGHTED_BATCHES
    if incoming.size < least:
        raise InputError(f"theta_in: expected at least {least} pairs for {basis!r}, got {incoming.size}")
    follows = _follows_measure(incoming, basis) if invariant is None else bool(invariant)
    counts = count_pairs(basis, incoming, outgoing) if basis.is_partition else None
    if counts is not None and (follows or incoming.size < 2 * WEIGHTED_BATCHES):
        return matrix_of_pairs(basis, counts, None, follows, incoming.size, symmetrise)
    means = _batch_means(basis, incoming, outgoing, follows)
    return matrix_of_pairs(basis, counts, means, follows, incoming.size, symmetrise)


def matrix_of_pairs(
    basis: Basis, counts: Counts | None, means: list[Floats] | None, follows: bool, pairs: int, symmetrise: bool
) -> KernelMatrix:
    """The matrix from counts of all pairs, or from means of e_i(theta) e_j(theta') over batches if there are any."""
    if means is None:
        found = matrix_from_counts([counts], basis, symmetrise=symmetrise, independent=True)
    elif counts is not None:
        fluxes = [mean / (basis.normalisation[:, None] * basis.normalisation) for mean in means]
        found = matrix_from_counts(fluxes, basis, symmetrise=symmetrise, independent=False)
    else:
        found = matrix_from_sums(means, basis, symmetrise=symmetrise, keeps_measure=False)
    return replace(
        with_missed_events(found, pairs),
        counts=counts,
        samples=pairs,
        method="pairs",
        reversible=True if symmetrise else None,
        metadata={"incoming_angles_follow_measure": follows},
    )


def bins_of_test(basis: Basis) -> Bins:
    """The bins in which the totals of incoming angles are tested."""
    return basis if isinstance(basis, Bins) else Bins(TEST_BINS)


def _follows_measure(incoming: Floats, basis: Basis) -> bool:
    bins = bins_of_test(basis)
    totals = np.bincount(bins.index(incoming), minlength=bins.size)
    return invariance_z_score(totals, bins.weights) < NOT_INVARIANT_Z


def _batch_means(basis: Basis, incoming: Floats, outgoing: Floats, follows: bool) -> list[Floats]:
    """Means of e_i(theta) e_j(theta') over batches of at least two pairs."""
    means, number = [], min(BATCHES, incoming.size // 2) if follows else WEIGHTED_BATCHES
    for batch in range(number):
        theta, image = incoming[batch::number], outgoing[batch::number]
        weight = np.full(theta.size, 1.0 / theta.size) if follows else nearest_measure(theta)
        means.append(sum_products(basis, theta, image, weight))
    return means


def nearest_measure(theta: Floats) -> Floats:
    """Measure of the angles nearest to each given angle, divided equally among equal angles."""
    distinct, owner, number = np.unique(theta, return_inverse=True, return_counts=True)
    middle = 0.5 * (distinct[1:] + distinct[:-1])
    mass = SINE.mass(np.concatenate(([0.0], middle)), np.concatenate((middle, [np.pi])))
    return np.asarray((mass / number)[owner])
