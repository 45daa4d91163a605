"""A computation in another process, which is dropped as soon as its question is out of date."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from ..core.errors import AsperityError

# Seconds after which a computation without first answer is dropped for a new question.
PATIENCE = 2.0
GONE = "the computation ended without an answer, perhaps for want of memory; change the wall to try again"

Job = Callable[..., Iterator[Any]]


def _context() -> Any:
    """Processes are forked from one that has loaded everything and has one thread."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["asperity.explore.warm"])
    return context


def _work(channel: Connection, job: Job, arguments: tuple[Any, ...]) -> None:
    # Ctrl-C in a terminal reaches every process; the page ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        for result in job(*arguments):
            channel.send((None, result))
    except AsperityError as reason:
        channel.send((str(reason), None))
    except (BrokenPipeError, ConnectionResetError):
        return
    except Exception as reason:
        channel.send((f"{type(reason).__name__}: {reason}", None))
    channel.close()


class Background:
    """One computation at a time: a new one replaces the old one, which is ended.

    A computation whose first result has not come is left to finish it, so that a wall that is dragged has answers, but
    for `PATIENCE` seconds at most.

    Examples
    --------
    >>> background = Background()
    >>> background.busy
    False
    """

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._channel: Connection | None = None
        self._next: tuple[Job, tuple[Any, ...]] | None = None
        self._begun, self._answered = 0.0, False

    @property
    def busy(self) -> bool:
        """Whether a computation runs or waits."""
        return self._process is not None or self._next is not None

    def ask(self, job: Job, *arguments: Any) -> None:
        """Compute ``job(*arguments)``, an iterator of results, in place of what is being computed."""
        self._next = (job, arguments)
        self._proceed()

    def collect(self) -> list[tuple[str | None, Any]]:
        """The results since the last call, each a pair of an error or None and a result."""
        found: list[tuple[str | None, Any]] = []
        channel = self._channel
        try:
            while channel is not None and channel.poll():
                found.append(channel.recv())
                self._answered = True
        except (EOFError, ConnectionResetError):
            answered = self._answered
            self.drop(waiting=False)
            if not answered:
                found.append((GONE, None))
        self._proceed()
        return found

    def drop(self, *, waiting: bool = True) -> None:
        """End the computation, and forget the one that waits."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
        if self._channel is not None:
            self._channel.close()
        self._process = self._channel = None
        if waiting:
            self._next = None

    def _proceed(self) -> None:
        if self._next is None:
            return
        if self._process is not None and not (self._answered or time.monotonic() - self._begun > PATIENCE):
            return
        (job, arguments), self._next = self._next, None
        self.drop()
        context = _context()
        self._channel, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(theirs, job, arguments), daemon=True)
        self._process.start()
        theirs.close()
        self._begun, self._answered = time.monotonic(), False
