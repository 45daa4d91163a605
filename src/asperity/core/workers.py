"""Independent tasks in this process, in processes at the ends of its pipes, or on the workers of dask.distributed."""

from __future__ import annotations

import copyreg
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import MISSING
from functools import lru_cache
from importlib.machinery import ExtensionFileLoader
from itertools import islice
from multiprocessing.connection import Connection, wait
from pickle import PicklingError
from types import ModuleType
from typing import Any, TypeVar

from .checks import shortened, whole_number
from .contents import content, is_installed
from .errors import AsperityError, InputError

# Tasks that the scheduler knows at a time: two for each of a thousand workers.
BACKLOG = 2000
LARGEST_TASK = "100 MB"
# Seconds to wait for a result whose worker is gone, before it is asked whether there is any other.
PATIENCE = 20.0
# Processes that a task may end: another task of the machine may have taken the memory of the first ones.
MOST_ENDED = 3
# Exit code of a process that reads a script which starts processes again.
STARTED_AGAIN = 79
SCHEDULER_GONE = "the scheduler is gone, and with it the tasks that it had; start one, and this again"
COULD_NOT_RUN = "the workers could not run a task; they need the same environment as this process ({})"
ARRIVED_CHANGED = (
    "client: a worker would compute something else than this process, because {} arrives there with another content. A "
    "class pickles only a part of its objects, a function imports its module inside of itself or is compiled by numba, "
    "or the versions of Python or of packages differ; import at the top of the module, or compute without client"
)
STARTED_FROM_A_SCRIPT = (
    "client: each worker reads the script that starts it, and so would start workers again; put what is computed below "
    'the line `if __name__ == "__main__":`'
)

# The fields of a class that returns from a worker, or from pickling, must have the mark itself, not a copy of it.
copyreg.pickle(type(MISSING), lambda _: "MISSING")

Task = TypeVar("Task")
Result = TypeVar("Result")


@contextmanager
def connected(client: Any) -> Iterator[Any]:
    """Workers, a client of dask.distributed, or None for this process.

    Parameters
    ----------
    client : None, int, str, distributed.Client or Workers
        None for this process, a number of workers that are started here, a scheduler's address, or a client or
        workers, which are used as they are.
    """
    if client is None or isinstance(client, Workers):
        yield client
        return
    try:
        from distributed import Client
    except ImportError as reason:
        raise InputError("client: workers need dask; pip install 'asperity[distributed]'") from reason
    if isinstance(client, Client):
        yield client
        return
    if not isinstance(client, str):
        workers = Workers(whole_number("client", client, 1))
        try:
            yield workers
        finally:
            workers.end()
        return
    try:
        found = Client(client)
    except (OSError, ValueError) as reason:
        raise InputError(f"client: no scheduler answers at {client!r} ({reason})") from reason
    with found:
        yield found


class _Worker:
    """A process at the other end of a pipe; it has some of the processors."""

    def __init__(self, processors: list[int]) -> None:
        self.processors = processors
        context = multiprocessing.get_context("spawn")
        self.channel, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, processors), daemon=True)
        self.process.start()
        theirs.close()

    def end(self) -> None:
        """End the process, whatever it computes."""
        self.process.kill()
        self.process.join()
        self.channel.close()


def end_if_started_again() -> None:
    """End a worker that is being started and reads the script of the process that starts it, up to a long run."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(STARTED_AGAIN)


class Workers:
    """Processes of this machine. Each is at the end of a pipe that no other process has: nothing listens.

    They are started with the first task. Each has processors of its own, so that its compiled loops start no more
    threads than it has of them.
    """

    def __init__(self, number: int) -> None:
        end_if_started_again()
        usable = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
        self._processors = [usable[k::number] or usable[k % len(usable) :][:1] if usable else [] for k in range(number)]
        self._workers: list[_Worker] = []

    def nthreads(self) -> dict[str, int]:
        """The workers, each with one thread, as a client of dask gives them."""
        return {f"worker {k}": 1 for k in range(len(self._processors))}

    def end(self) -> None:
        """End them; what they compute is not wanted any more."""
        while self._workers:
            self._workers.pop().end()

    def results(self, function: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[tuple[Task, Result]]:
        """Every task with its result; the tasks of a process that is lost are computed again by another."""
        from cloudpickle import loads

        self._workers = self._workers or [_Worker(own) for own in self._processors]
        packed, rest = packed_function(function), iter(tasks)
        running: dict[_Worker, tuple[Task, int]] = {}

        def give(worker: _Worker, task: Task, tries: int) -> None:
            running[worker] = task, tries
            # one that is gone is noticed below
            with suppress(OSError):
                worker.channel.send_bytes(by_value((packed, task)))

        try:
            # one task first: it compiles the loops, which the other workers then find on the disk
            for task in islice(rest, 1):
                give(self._workers[0], task, 1)
            while running:
                for channel in wait([worker.channel for worker in running]):
                    worker = next(one for one in running if one.channel is channel)
                    task, tries = running.pop(worker)
                    try:
                        error, result = loads(worker.channel.recv_bytes())
                    except (EOFError, OSError):
                        give(self._replacement(worker, tries), task, tries + 1)
                        continue
                    if error is not None:
                        refused, words = error
                        raise InputError(words) if refused else AsperityError(words)
                    yield task, result
                    idle = [one for one in self._workers if one not in running]
                    for one, task in zip(idle, islice(rest, len(idle)), strict=False):
                        give(one, task, 1)
        except BaseException:
            # what still runs would come as the results of the next call
            self.end()
            raise

    def _replacement(self, lost: _Worker, tries: int) -> _Worker:
        lost.process.join(PATIENCE)
        lost.end()
        if lost.process.exitcode == STARTED_AGAIN:
            raise InputError(STARTED_FROM_A_SCRIPT) from None
        if tries > MOST_ENDED:
            raise AsperityError("a task ended every worker that tried it; perhaps it needs more memory") from None
        new = _Worker(lost.processors)
        self._workers[self._workers.index(lost)] = new
        return new


def _work(channel: Connection, processors: list[int]) -> None:
    """Compute what comes through the pipe until its other end is closed."""
    from cloudpickle import dumps, loads

    # Ctrl-C in a terminal reaches every process; the one that started this one ends it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if processors:
        os.sched_setaffinity(0, processors)
    # the other end is closed when the process there ends
    with suppress(EOFError, OSError):
        while True:
            packed, task = loads(channel.recv_bytes())
            try:
                answer = dumps((None, run_packed(packed, task)))
            except InputError as reason:
                answer = dumps(((True, str(reason)), None))
            except Exception as reason:
                answer = dumps(((False, COULD_NOT_RUN.format(repr(reason))), None))
            channel.send_bytes(answer)


def by_value(value: Any) -> bytes:
    """A value for workers, with the functions, classes and modules of the user's as they are in this process.

    Other packers send the names of functions, whose modules a worker would read from the disk anew.
    """
    import cloudpickle

    own = [module for name, module in list(sys.modules.items()) if _travels_by_value(name, module)]
    added = [module for module in own if module.__name__ not in cloudpickle.list_registry_pickle_by_value()]
    for module in added:
        cloudpickle.register_pickle_by_value(module)
    try:
        packed: bytes = cloudpickle.dumps(value)
    except (TypeError, ValueError, RecursionError, PicklingError) as reason:
        raise InputError(
            f"client: {shortened(value)} cannot be sent to workers ({reason}); keep open files, locks and the like out "
            "of what your functions use, or compute without client"
        ) from reason
    finally:
        for module in added:
            cloudpickle.unregister_pickle_by_value(module)
    return packed


def _travels_by_value(name: str, module: Any) -> bool:
    loader = getattr(getattr(module, "__spec__", None), "loader", None)
    own = isinstance(module, ModuleType) and module.__name__ == name and not is_installed(name)
    return own and not name.startswith("__") and not isinstance(loader, ExtensionFileLoader)


def packed_function(function: Callable[[Any], Any]) -> bytes:
    """A function for `run_packed`, with its content if it has one."""
    try:
        told = content(function)
    except (TypeError, RecursionError):
        told = None
    return by_value((by_value(function), told, shortened(function)))


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Callable[[Any], Any]:
    from cloudpickle import loads

    inner, told, words = loads(packed)
    function: Callable[[Any], Any] = loads(inner)
    if told is not None and content(function) != told:
        raise InputError(ARRIVED_CHANGED.format(words))
    return function


def run_packed(packed: bytes, task: Any) -> Any:
    """The result of a task, in a worker."""
    return _unpacked(packed)(task)


def results(
    function: Callable[[Task], Result], tasks: Iterable[Task], client: Any, backlog: int = BACKLOG
) -> Iterator[tuple[Task, Result]]:
    """Every task with its result, in the order in which they end.

    Parameters
    ----------
    function : callable
        Of one task. It must not raise.
    tasks : iterable
    client : Workers, distributed.Client or None
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
    if isinstance(client, Workers):
        yield from client.results(function, tasks)
        return
    from dask import config

    packed, rest = packed_function(function), iter(tasks)

    def submit(task: Task, **where: Any) -> Any:
        # a block of pairs is longer than what dask warns of
        with config.set({"distributed.admin.large-graph-warning-threshold": LARGEST_TASK}):
            return client.submit(run_packed, packed, task, pure=False, **where)

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

    if isinstance(reason, InputError):
        return reason
    if isinstance(reason, KilledWorker):
        return AsperityError(f"a task ended every worker that tried it; perhaps it needs more memory ({reason})")
    return AsperityError(COULD_NOT_RUN.format(repr(reason)))


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
