"""Sums over sampled rays, in chunks that depend on their numbers alone, and the matrix and error computed from them.

Any workers count the chunks, and the sums are stored on the way.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from ...core.checks import Floats, check_memory
from ...core.errors import AccuracyError, InputError
from ...core.long_runs import Engine, progress_bar
from ...core.version import __version__
from ...core.workers import BACKLOG, connected, in_order, results
from ..bases.assembly import LARGE, largest_square_sum, mirror_image
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import Law, outgoing_angles
from ..matrices.defects import BLOCK
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..walls.conditionals import UNRESOLVED_TOLERANCE
from .counts import matrix_from_counts, matrix_from_sums, sums_of_rows, with_missed_events

# Rays of a task for a worker, a second of work or a few. Counts in cells do not depend on it; sums of real numbers are
# added task by task, so that it is a constant.
RAYS_A_TASK = 2**22
# Seconds between two states of a checkpoint.
STORED_EVERY = 5.0
STATE = "state"
# Bytes of results that wait on the workers at most, beyond two for each worker.
MOST_WAITING = 2**28
# Sums of some consecutive tables, and the number of rays that did not escape.
Sums = tuple[NDArray[Any], int]


@dataclass(frozen=True, eq=False)
class Job(ABC):
    """Rays of a law in tasks, each of which depends on its number alone; it is sent to workers.

    Attributes
    ----------
    law : Law
    basis : Basis
    tables : int
        Number of consecutive tables to which each task adds.
    """

    law: Law
    basis: Basis
    tables: ClassVar[int]

    @property
    @abstractmethod
    def tasks(self) -> int:
        """Their number."""

    @abstractmethod
    def rays_of(self, task: int) -> int:
        """Rays of one task."""

    @abstractmethod
    def first_table(self, task: int) -> int:
        """The first table to which a task adds."""

    @abstractmethod
    def add_to(self, sums: RaySums, first: int, task: int) -> None:
        """Add the rays of a task to the tables from ``first`` on."""

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """What tells the rays from others of this law and basis."""

    @property
    def total(self) -> int:
        """Rays of all tasks."""
        return sum(map(self.rays_of, range(self.tasks)))

    def sums(self, task: int) -> Sums:
        """The sums of one task."""
        sums = RaySums(self.law, self.basis, self.tables)
        self.add_to(sums, 0, task)
        return sums.tables, sums.unresolved


@dataclass(frozen=True, eq=False)
class IndependentRays(Job):
    """Independent rays of a law with incoming angles from the invariant measure, chunk by chunk.

    Attributes
    ----------
    root : tuple of int
        The seed.
    samples : int
        Rays of each part.
    parts : int
        Tables, one for each part.
    rays_a_task : int
        Rounded to whole chunks.
    """

    root: tuple[int, ...]
    samples: int
    parts: int
    rays_a_task: int = field(default_factory=lambda: RAYS_A_TASK)
    tables = 1

    @cached_property
    def chunk(self) -> int:
        """Rays of each chunk but the last of a part."""
        return RaySums(self.law, self.basis, 0).chunk

    @cached_property
    def chunks_a_task(self) -> int:
        return max(self.rays_a_task // self.chunk, 1)

    @cached_property
    def tasks_a_part(self) -> int:
        return math.ceil(self.samples / (self.chunk * self.chunks_a_task))

    @property
    def tasks(self) -> int:
        return self.parts * self.tasks_a_part

    def rays_of(self, task: int) -> int:
        whole = self.chunk * self.chunks_a_task
        return min(whole, self.samples - task % self.tasks_a_part * whole)

    def first_table(self, task: int) -> int:
        return task // self.tasks_a_part

    def add_to(self, sums: RaySums, first: int, task: int) -> None:
        part, own = divmod(task, self.tasks_a_part)
        chunk, rays = self.chunk, self.rays_of(task)
        for number, start in enumerate(range(0, rays, chunk)):
            index = own * self.chunks_a_task + number
            theta, outgoing, escaped = self.rays(part, index, min(chunk, rays - start))
            sums.add(first, theta, outgoing)
            sums.count_unresolved(escaped)

    def rays(self, part: int, index: int, number: int) -> tuple[Floats, Floats, NDArray[np.bool_] | None]:
        """Incoming and outgoing angles of the rays of a chunk, and which of them escaped, if the law tells."""
        own = np.random.default_rng([*self.root, part, index])
        theta = SINE.sample(number, own)
        outgoing, escaped = self.law._sample_with_status(theta.copy(), own)
        return theta, outgoing_angles(outgoing, theta, self.law), escaped

    def identity(self) -> dict[str, Any]:
        return {
            "computation": "independent rays", "rays": self.samples, "seed": list(self.root), "chunk": self.chunk,
            "chunks a task": self.chunks_a_task,
        }  # fmt: skip


def count_long(sums: RaySums, job: Job, engine: Engine) -> None:
    """Add the rays of all tasks to ``sums``: in cells exact counts, in other bases sums in the order of the tasks.

    Raises
    ------
    InputError
        If the checkpoint is of other rays or cannot be written.
    KeyboardInterrupt
        After Ctrl-C; it says how many rays are stored, and how to go on.
    """
    path, client = engine.get("checkpoint"), engine.get("client")
    if path is None and client is None and sums.basis.is_partition:
        # without further tables, which can be large
        with progress_bar(job.total, "ray") as bar:
            for task in range(job.tasks):
                job.add_to(sums, job.first_table(task), task)
                bar.update(job.rays_of(task))
        return
    wide = sums.tables.astype(np.promote_types(sums.tables.dtype, np.int32))
    run = _Run(job, _State(np.zeros(job.tasks, dtype=bool), wide, sums.unresolved))
    # task by task the checkpoint says what is done: so their size belongs to it
    identity = {"version": __version__, "law": job.law, "basis": job.basis, **job.identity()}
    try:
        with ExitStack() as stack:
            store = None if path is None else stack.enter_context(Checkpoint(path, identity, key=engine.get("key")))
            bar = stack.enter_context(progress_bar(job.total, "ray"))
            run.all_tasks(store, stack.enter_context(connected(client)), bar)
    except KeyboardInterrupt as stop:
        lost = "without a checkpoint they are lost"
        how = lost if path is None else f"{path} has them: give the same call"
        raise KeyboardInterrupt(f"stopped after {run.rays_done} of {job.total} rays; {how}") from stop
    sums.tables, sums.unresolved, sums.most = run.state.tables, run.state.unresolved, job.total


class _State(NamedTuple):
    """What is counted so far: replaced as a whole, so that an interrupt leaves sums and tasks in agreement."""

    done: NDArray[np.bool_]
    tables: NDArray[Any]
    unresolved: int

    def after(self, task: int, first: int, found: Sums) -> _State:
        """With the sums of a task."""
        done, tables = self.done.copy(), self.tables.copy()
        done[task] = True
        tables[first : first + len(found[0])] += found[0]
        return _State(done, tables, self.unresolved + found[1])


@dataclass
class _Run:
    """A run through the tasks that are not done."""

    job: Job
    state: _State

    @property
    def rays_done(self) -> int:
        return sum(map(self.job.rays_of, np.flatnonzero(self.state.done).tolist()))

    def _read(self, _: str, content: bytes) -> _State:
        """A stored state, with arrays as the present one has."""
        most, tables = self.job.total, self.state.tables
        counts = Stored("i", tables.shape, 0, most) if self.job.basis.is_partition else Stored("f", tables.shape)
        expected = {"done": Stored("b", (self.job.tasks,)), "tables": counts, "unresolved": Stored("i", (), 0, most)}
        found = unpacked_arrays(content, expected)
        return _State(found["done"], found["tables"], int(found["unresolved"]))

    def _backlog(self, workers: Any) -> int:
        """Tasks at a time: results are matrices, and can come faster than they are added."""
        size = 8 * self.job.tables * self.job.basis.size**2
        return min(BACKLOG, MOST_WAITING // size + 2 * (0 if workers is None else len(workers.nthreads())))

    def all_tasks(self, store: Checkpoint | None, workers: Any, bar: Any) -> None:
        for _, state in () if store is None else store.parts(self._read):
            self.state = state
            if self.job.basis.is_partition and int(state.tables.sum()) != self.rays_done:
                raise InputError(f"checkpoint: its counts are not of the {self.rays_done} rays that it has; delete it")
        bar.update(self.rays_done)
        rest = np.flatnonzero(~self.state.done).tolist()
        found: Iterable[tuple[int, Sums]] = results(self.job.sums, rest, workers, self._backlog(workers))
        stored = time.monotonic()
        try:
            for task, own in found if self.job.basis.is_partition else in_order(found, rest):
                self.state = self.state.after(task, self.job.first_table(task), own)
                bar.update(self.job.rays_of(task))
                if store is not None and time.monotonic() - stored > STORED_EVERY:
                    store.put(STATE, packed_arrays(self.state._asdict()), now=True)
                    stored = time.monotonic()
        finally:
            if store is not None:
                store.put(STATE, packed_arrays(self.state._asdict()), now=True)


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

    def fraction_unresolved(self, used: int) -> float:
        """The fraction of so many rays that did not escape.

        Raises
        ------
        AccuracyError
            If it is more than 1e-4.
        """
        fraction = self.unresolved / used
        if fraction > UNRESOLVED_TOLERANCE:
            raise AccuracyError(
                f"{self.law!r}: {fraction:.2g} of {used} rays did not escape, more than {UNRESOLVED_TOLERANCE:g}; "
                "geometry.trace(wall, x, theta).counts() says how they ended, of a surface that of surface.trace(x, v)",
                fraction,
            )
        return fraction

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
        fraction = self.fraction_unresolved(used)
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
