"""Blocks of independent work on threads: compiled loops that release the lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from ..checks import whole_number

# Rays in one block: handing a block to a thread costs some 30 us, as much as a thousand of the cheapest rays, and one
# thread at a time does so. So blocks are large, but small enough to share them evenly, some to every thread.
LEAST_BLOCK, MOST_BLOCK = 2**13, 2**15
BLOCKS_PER_THREAD = 4


def in_blocks(run: Callable[[slice], None], count: int, threads: int | None, block: int | None = None) -> None:
    """Call ``run`` with slices that cover ``range(count)``, on ``threads`` threads, by default `usable_processors`.

    What ``run`` does with an index must not depend on the slice that contains it.

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
    if workers == 1 or len(blocks) <= 1:
        for part in blocks:
            run(part)
    else:
        with ThreadPoolExecutor(min(workers, len(blocks))) as pool:
            list(pool.map(run, blocks))


def usable_processors() -> int:
    """How many processors this process may use: all, unless it is pinned to some, as by a batch system."""
    pinned = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if pinned else os.cpu_count() or 1
