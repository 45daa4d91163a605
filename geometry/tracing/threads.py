"""Blocks of independent work on threads, for compiled functions that release the lock and end at Ctrl-C.

Python handles signals between its own instructions, in the main thread only. So long compiled functions run on other
threads, while the main thread waits in short intervals. A function that may take long reads a flag, a one-element
array, at intervals (`is_raised` in `scene/compiled/compiling`), and ends when the flag is raised.
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

# Rays in one block. Passing a block to a thread costs about 30 us, as much as a few thousand of the cheapest rays, and
# is serial; smaller blocks balance the threads better.
LEAST_BLOCK, MOST_BLOCK = 2**13, 2**17
BLOCKS_PER_THREAD = 2
# Seconds of one wait of the main thread, the largest delay of Ctrl-C if waiting cannot be interrupted.
MOMENT = 0.1

Result = TypeVar("Result")


def new_flag() -> NDArray[np.int64]:
    """Return a flag that is not raised; ``flag[0] = 1`` raises it."""
    return np.zeros(1, np.int64)


def in_blocks(
    run: Callable[[slice], None],
    count: int,
    threads: int | None,
    block: int | None = None,
    stop: NDArray[np.int64] | None = None,
) -> None:
    """Call ``run`` with slices that cover ``range(count)``, on ``threads`` threads, by default `usable_processors`.

    The result of ``run`` for an index must not depend on the slice that contains the index. If ``stop`` is given, no
    slice runs on the caller's thread, and Ctrl-C raises the flag ``stop``, at which ``run`` must end.

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
    """Return the result of a compiled call that may take seconds; Ctrl-C does not wait for the call.

    The call must allocate its result. After Ctrl-C the call continues on its thread and its result is dropped; the
    process can end nevertheless.

    Examples
    --------
    >>> interruptibly(lambda: 2 + 3)
    5
    """
    future = _started(call)
    _wait_for([future], new_flag())
    return future.result()


def _started(call: Callable[[], Result]) -> Future[Result]:
    """Start a call on a new thread, for which the end of the process does not wait."""
    future: Future[Result] = Future()

    def serve() -> None:
        try:
            future.set_result(call())
        except BaseException as reason:
            future.set_exception(reason)

    threading.Thread(target=serve, daemon=True).start()
    return future


def _wait_for(futures: Sequence[Future[Result]], stop: NDArray[np.int64]) -> None:
    """Wait for all futures; at the first failure and at Ctrl-C set the flag and raise the exception."""
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
    """Return the number of processors that this process may use, fewer than all if a batch system restricts it."""
    # where the operating system does not say, all
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
