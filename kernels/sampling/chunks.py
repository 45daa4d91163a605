"""Independent rays in chunks that depend on their number alone, counted by any workers and stored on the way."""

from __future__ import annotations

import io
import math
import time
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checkpoints import Checkpoint
from ...core.checks import Floats
from ...core.long_runs import Engine
from ...core.version import __version__
from ...core.workers import connected, results
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import DrivenLaw, Law, entry_inside
from ..walls.identity import law_digest
from .rays import RaySums, progress_bar

# Rays of a task for a worker, a second of work or a few. Counts in cells do not depend on it; sums of real numbers are
# added task by task, so that it is a constant.
RAYS_A_TASK = 2**22
# Seconds between two states of a checkpoint, of n^2 counts each.
STORED_EVERY = 5.0
STATE = "state"


@dataclass(frozen=True)
class RayChunks:
    """The rays of a law with incoming angles from the invariant measure, chunk by chunk.

    Attributes
    ----------
    law : Law
    root : tuple of int
        The seed.
    chunk : int
        Rays of each chunk but the last.
    """

    law: Law
    root: tuple[int, ...]
    chunk: int

    def rays(self, part: int, index: int, number: int) -> tuple[Floats, Floats, NDArray[np.bool_] | None]:
        """Incoming and outgoing angles of so many rays, and which of them escaped, if the law tells."""
        own = np.random.default_rng([*self.root, part, index])
        theta = SINE.sample(number, own)
        # the map of a driven law tells besides which rays escaped
        driven = isinstance(self.law, DrivenLaw) and self.law.closed_form is None
        reflect = self.law.random_map() if driven else None
        if reflect is None:
            return theta, self.law.sample(theta, own), None
        outgoing, escaped = reflect(entry_inside(own.random(theta.shape)), theta)
        return theta, outgoing, escaped


@dataclass(frozen=True)
class _Counting:
    """What a worker is sent: it counts the rays of some chunks in cells."""

    chunks: RayChunks
    basis: Basis
    samples: int
    chunks_a_task: int

    @property
    def tasks(self) -> int:
        """Their number."""
        return math.ceil(self.samples / (self.chunks.chunk * self.chunks_a_task))

    def rays_of(self, task: int) -> int:
        """Rays of one task."""
        whole = self.chunks.chunk * self.chunks_a_task
        return min(whole, self.samples - task * whole)

    def counted(self, task: int) -> tuple[NDArray[np.int64], int]:
        """Counts in cells, and the rays that did not escape."""
        sums = RaySums(self.chunks.law, self.basis, 1)
        chunk, rays = self.chunks.chunk, self.rays_of(task)
        for number, start in enumerate(range(0, rays, chunk)):
            index = task * self.chunks_a_task + number
            theta, outgoing, escaped = self.chunks.rays(0, index, min(chunk, rays - start))
            sums.add(0, theta, outgoing)
            sums.count_unresolved(escaped)
        return sums.tables[0], sums.unresolved


@dataclass(frozen=True)
class _Summing:
    """What a worker is sent: it adds e_i(theta) e_j(theta') over the rays of some chunks of one part."""

    chunks: RayChunks
    basis: Basis
    samples: int
    chunks_a_task: int

    @property
    def tasks_a_part(self) -> int:
        """Number of tasks of each part."""
        return math.ceil(self.samples / (self.chunks.chunk * self.chunks_a_task))

    def rays_of(self, task: int) -> int:
        """Rays of one task."""
        whole = self.chunks.chunk * self.chunks_a_task
        return min(whole, self.samples - task % self.tasks_a_part * whole)

    def summed(self, task: int) -> tuple[Floats, int]:
        """Sums over the rays, and the rays that did not escape."""
        sums = RaySums(self.chunks.law, self.basis, 1)
        part, own = divmod(task, self.tasks_a_part)
        chunk, rays = self.chunks.chunk, self.rays_of(task)
        for number, start in enumerate(range(0, rays, chunk)):
            index = own * self.chunks_a_task + number
            theta, outgoing, escaped = self.chunks.rays(part, index, min(chunk, rays - start))
            sums.add(0, theta, outgoing)
            sums.count_unresolved(escaped)
        return sums.tables[0], sums.unresolved


def count_long(sums: RaySums, chunks: RayChunks, engine: Engine) -> None:
    """Add the rays of all parts of ``sums``: in cells exact counts, in other bases sums in the order of the chunks.

    Raises
    ------
    InputError
        If the checkpoint is of other rays or cannot be written.
    """
    together = max(RAYS_A_TASK // chunks.chunk, 1)
    job = (_Counting if sums.basis.is_partition else _Summing)(chunks, sums.basis, sums.each, together)
    path = engine.get("checkpoint")
    with ExitStack() as stack:
        store = None if path is None else stack.enter_context(Checkpoint(path, _identity(job)))
        if isinstance(job, _Counting):
            _run(job, sums, store, engine.get("client"))
        else:
            _run_in_order(job, sums, store, engine.get("client"))


def _identity(job: _Counting | _Summing) -> dict[str, Any]:
    # task by task the checkpoint says what is done: so their size belongs to it
    return {
        "computation": "independent rays", "version": __version__, "law": law_digest(job.chunks.law),
        "basis": repr(job.basis), "rays": job.samples, "seed": list(job.chunks.root), "chunk": job.chunks.chunk,
        "chunks a task": job.chunks_a_task,
    }  # fmt: skip


class _State(NamedTuple):
    """What is counted so far: replaced as a whole, so that an interrupt leaves counts and tasks in agreement."""

    done: NDArray[np.bool_]
    counts: NDArray[np.int64]
    unresolved: int

    def after(self, task: int, counts: NDArray[np.int64], unresolved: int) -> _State:
        """With the result of a task."""
        done = self.done.copy()
        done[task] = True
        return _State(done, self.counts + counts, self.unresolved + unresolved)

    def packed(self) -> bytes:
        """As a file of numpy's, without pickle."""
        file = io.BytesIO()
        np.savez(file, **self._asdict())
        return file.getvalue()

    @staticmethod
    def unpacked(content: bytes) -> _State:
        """The state that `packed` gave."""
        with np.load(io.BytesIO(content), allow_pickle=False) as known:
            return _State(known["done"], known["counts"], int(known["unresolved"]))


def _run(job: _Counting, sums: RaySums, store: Checkpoint | None, client: Any) -> None:
    known = [] if store is None else [_State.unpacked(content) for _, content in store.parts()]
    state = known[0] if known else _State(np.zeros(job.tasks, dtype=bool), sums.tables[0], 0)
    stored = time.monotonic()
    try:
        with connected(client) as workers, progress_bar(job.samples) as bar:
            bar.update(sum(job.rays_of(task) for task in np.flatnonzero(state.done).tolist()))
            for task, found in results(job.counted, np.flatnonzero(~state.done).tolist(), workers):
                state = state.after(task, *found)
                bar.update(job.rays_of(task))
                if store is not None and time.monotonic() - stored > STORED_EVERY:
                    store.put(STATE, state.packed(), now=True)
                    stored = time.monotonic()
    finally:
        if store is not None:
            store.put(STATE, state.packed(), now=True)
    sums.tables[0], sums.unresolved = state.counts, state.unresolved


def _run_in_order(job: _Summing, sums: RaySums, store: Checkpoint | None, client: Any) -> None:
    """Real sums are added in the order of the tasks; a result that comes too early waits for those before it."""
    done, tasks = 0, len(sums.tables) * job.tasks_a_part

    def keep() -> None:
        if store is not None:
            file = io.BytesIO()
            np.savez(file, done=done, tables=sums.tables, unresolved=sums.unresolved)
            store.put(STATE, file.getvalue(), now=True)

    for _, content in () if store is None else store.parts():
        with np.load(io.BytesIO(content), allow_pickle=False) as known:
            done, sums.unresolved = int(known["done"]), int(known["unresolved"])
            sums.tables[:] = known["tables"]
    stored = time.monotonic()
    early: dict[int, tuple[Floats, int]] = {}
    with connected(client) as workers, progress_bar(len(sums.tables) * job.samples) as bar:
        bar.update(sum(map(job.rays_of, range(done))))
        for task, found in results(job.summed, range(done, tasks), workers):
            early[task] = found
            while done in early:
                table, unresolved = early.pop(done)
                sums.tables[done // job.tasks_a_part] += table
                sums.unresolved += unresolved
                bar.update(job.rays_of(done))
                done += 1
            if time.monotonic() - stored > STORED_EVERY:
                keep()
                stored = time.monotonic()
    # not after an interrupt, which may come between table and number
    keep()
