"""Independent tasks in this process or on the workers of dask.distributed."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from typing import Any, TypeVar

from .checks import whole_number
from .errors import AsperityError, InputError

# Tasks that the scheduler knows at a time: two for each of a thousand workers.
BACKLOG = 2000
LARGEST_TASK = "100 MB"
# Seconds to wait for a result whose worker is gone, before it is asked whether there is any other.
PATIENCE = 20.0
SCHEDULER_GONE = "the scheduler is gone, and with it the tasks that it had; start one, and this again"

Task = TypeVar("Task")
Result = TypeVar("Result")


@contextmanager
def connected(client: Any) -> Iterator[Any]:
    """A client of dask.distributed, or None for this process.

    Parameters
    ----------
    client : None, int, str or distributed.Client
        None for this process, a number of workers that are started here, a scheduler's address, or a client, which is
        used as it is.
    """
    if client is None:
        yield None
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError as reason:
        raise InputError("client: workers need dask; pip install 'asperity[distributed]'") from reason
    if isinstance(client, Client):
        yield client
        return
    with ExitStack() as stack:
        if isinstance(client, str):
            try:
                found = stack.enter_context(Client(client))
            except (OSError, ValueError) as reason:
                raise InputError(f"client: no scheduler answers at {client!r} ({reason})") from reason
        else:
            number = whole_number("client", client, 1)
            cluster = stack.enter_context(
                LocalCluster(n_workers=number, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0")
            )
            found = stack.enter_context(Client(cluster))
            _pin(found)
            # what they still compute is not wanted any more; asked to end they would finish it first
            stack.callback(_kill, cluster)
        yield found


def results(
    function: Callable[[Task], Result], tasks: Iterable[Task], client: Any, backlog: int = BACKLOG
) -> Iterator[tuple[Task, Result]]:
    """Every task with its result, in the order in which they end.

    Parameters
    ----------
    function : callable
        Of one task. It must not raise.
    tasks : iterable
    client : distributed.Client or None
        From `connected`.
    backlog : int
        Tasks that the scheduler knows at a time; fewer where tasks or results are large.

    Raises
    ------
    AsperityError
        If the scheduler is gone before the last result, or a task has ended several workers. A worker that is lost
        alone is replaced, and its tasks are computed again.

    Examples
    --------
    >>> list(results(abs, [-1, 2], None))
    [(-1, 1), (2, 2)]
    """
    if client is None:
        yield from ((task, function(task)) for task in tasks)
        return
    from dask import config

    rest = iter(tasks)

    def submit(task: Task, **where: Any) -> Any:
        # a block of pairs is longer than what dask warns of
        with config.set({"distributed.admin.large-graph-warning-threshold": LARGEST_TASK}):
            return client.submit(function, task, pure=False, **where)

    # one task on each machine first: it compiles the loops, which the other workers then find on the disk
    workers = _one_worker_a_machine(client)
    first = {
        submit(task, workers=[address], allow_other_workers=True): task
        for address, task in zip(workers, islice(rest, len(workers)), strict=False)
    }
    yield from _collected(first, lambda: {})

    def submitted(number: int) -> dict[Any, Task]:
        return {submit(task): task for task in islice(rest, number)}

    yield from _collected(submitted(backlog), lambda: submitted(1))


def in_order(found: Iterable[tuple[Task, Result]], tasks: Iterable[Task]) -> Iterator[tuple[Task, Result]]:
    """Results in the order of the tasks: one that comes too early waits for those before it.

    Examples
    --------
    >>> list(in_order([(1, "b"), (0, "a"), (2, "c")], range(3)))
    [(0, 'a'), (1, 'b'), (2, 'c')]
    """
    early: dict[Task, Result] = {}
    order = iter(tasks)
    due = next(order, None)
    for task, result in found:
        early[task] = result
        while due is not None and due in early:
            yield due, early.pop(due)
            due = next(order, None)


def _collected(waiting: dict[Any, Task], more: Callable[[], dict[Any, Task]]) -> Iterator[tuple[Task, Any]]:
    """The results of futures as they come; after each of them ``more`` are added."""
    from distributed import as_completed

    done = as_completed(list(waiting))
    # futures that are cancelled, because the scheduler is gone, do not come
    for future in done:
        if future.status == "error":
            raise _failure(future.exception())
        if future.status != "finished":
            break
        yield waiting.pop(future), _result(future)
        following = more()
        waiting |= following
        done.update(following)
    if waiting:
        raise AsperityError(SCHEDULER_GONE)


def _failure(reason: BaseException) -> AsperityError:
    """The error to raise for a task that failed on the workers."""
    from distributed import KilledWorker

    if isinstance(reason, KilledWorker):
        return AsperityError(f"a task ended every worker that tried it; perhaps it needs more memory ({reason})")
    return AsperityError(
        "the workers could not run a task; they need the same environment as this process, and the modules of your own "
        f"functions ({reason!r})"
    )


def _result(future: Any) -> Any:
    """The result of a finished future, which is computed again if its worker has been lost with it."""
    from asyncio import CancelledError

    from distributed import KilledWorker

    try:
        while True:
            try:
                return future.result(timeout=PATIENCE)
            except TimeoutError as reason:
                if not future.client.nthreads():
                    words = "the tasks ended every worker, and no other has come; perhaps they need more memory"
                    raise AsperityError(words) from reason
    except KilledWorker as reason:
        # the task ended the other workers when it was computed again
        raise _failure(reason) from None
    except (OSError, CancelledError) as reason:
        raise AsperityError(SCHEDULER_GONE) from reason


def _one_worker_a_machine(client: Any) -> list[str]:
    machines: dict[str, str] = {}
    for address in client.nthreads():
        machines.setdefault(address.rpartition(":")[0], address)
    return list(machines.values())


def _kill(cluster: Any) -> None:
    for worker in cluster.workers.values():
        if worker.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(worker.pid, signal.SIGKILL)


def _pin(client: Any) -> None:
    """Give each worker processors of its own, so that its compiled loops start no more threads than it has of them."""
    # only some systems have it
    if not hasattr(os, "sched_setaffinity"):
        return
    processors, workers = sorted(os.sched_getaffinity(0)), list(client.nthreads())
    for index, address in enumerate(workers):
        own = processors[index :: len(workers)] or [processors[index % len(processors)]]
        client.run(os.sched_setaffinity, 0, own, workers=[address])
