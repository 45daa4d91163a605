"""Blocks of independent work on threads: compiled loops that release the lock, and that Ctrl-C ends.

Python answers a signal between two of its own instructions, in the main thread only. So while compiled loops run for
long they run on other threads, and the main one waits, a moment at a time. A loop that may take long by itself reads
a flag, a one-element array, every so often (`is_raised` in `compiled/interruption`), and ends when it is raised.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import whole_number

# Rays in one block: handing a block to a thread costs some 30 us, as much as a thousand of the cheapest rays, and one
# thread at a time does so. So blocks are large, but small enough to share them evenly, some to every thread.
LEAST_BLOCK, MOST_BLOCK = 2**13, 2**15
BLOCKS_PER_THREAD = 4
# Seconds that the main thread waits at a time: where its waiting cannot be interrupted, Ctrl-C is answered after it.
MOMENT = 0.1

Result = TypeVar("Result")


def new_flag() -> NDArray[np.int64]:
    """A flag that is not raised; ``flag[0] = 1`` raises it."""
    return np.zeros(1, np.int64)


def in_blocks(
    run: Callable[[slice], None],
    count: int,
    threads: int | None,
    block: int | None = None,
    stop: NDArray[np.int64] | None = None,
) -> None:
    """Call ``run`` with slices that cover ``range(count)``, on ``threads`` threads, by default `usable_processors`.

    What ``run`` does with an index must not depend on the slice that contains it. Where ``stop`` is given the slices
    may take long: the caller's own thread does none of them, and Ctrl-C raises that flag, which ``run`` must obey.

    Examples
    --------
    >>> in_blocks(print, 5, threads=1, block=3)
    slice(0, 3, None)
    slice(3, 5, None)
    """
    workers = usable_processors() if threads is None else whole_number("threads", threads, 1)
    if block is None:
        block = min(MOST_BLOCK, max(LEAST_BLOCK, -(-count // (BLOCKS_PER_THREAD * workers))))
    blocks = [slice(first, min(first + block, count)) for first in range(0, count, block)]
    if stop is None and (workers == 1 or len(blocks) <= 1):
        for part in blocks:
            run(part)
        return
    flag = new_flag() if stop is None else stop
    rest, turn = iter(blocks), threading.Lock()

    def work() -> None:
        while not flag[0]:
            with turn:
                part = next(rest, None)
            if part is None:
                return
            run(part)

    _wait_for([_started(work) for _ in range(min(workers, len(blocks)))], flag)


def interruptibly(call: Callable[[], Result]) -> Result:
    """The result of a compiled call that may take seconds and allocates what it returns; Ctrl-C does not wait for it.

    The call goes on where it cannot be told to stop; what it finds is lost, and it keeps no process from ending.

    Examples
    --------
    >>> interruptibly(lambda: 2 + 3)
    5
    """
    future = _started(call)
    _wait_for([future], new_flag())
    return future.result()


def _started(call: Callable[[], Result]) -> Future[Result]:
    """A call on a thread of its own, which ends with the process."""
    future: Future[Result] = Future()

    def run() -> None:
        try:
            future.set_result(call())
        except BaseException as reason:
            future.set_exception(reason)

    threading.Thread(target=run, daemon=True).start()
    return future


def _wait_for(futures: Sequence[Future[Result]], stop: NDArray[np.int64]) -> None:
    """Wait until all are done or one has failed; raise the flag and the exception in that case, and on Ctrl-C."""
    try:
        pending = set(futures)
        while pending:
            done, pending = wait(pending, MOMENT, FIRST_EXCEPTION)
            for future in done:
                future.result()
    except BaseException:
        stop[0] = 1
        raise


def usable_processors() -> int:
    """How many processors this process may use: all, unless it is pinned to some, as by a batch system."""
    # the system's: only some have it
    pinned = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if pinned else os.cpu_count() or 1
