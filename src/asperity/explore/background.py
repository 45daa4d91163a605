"""A computation in another process, which is dropped as soon as its question is out of date."""

from __future__ import annotations

import multiprocessing
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from tempfile import TemporaryDirectory
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


def end_all() -> None:
    """End every computation of this process, and remove the private folders."""
    for computation in multiprocessing.active_children():
        computation.kill()
    for folder in tuple(_folders):
        folder.cleanup()


def private_folder() -> TemporaryDirectory[str]:
    """A folder of this user alone, until its ``cleanup`` or `end_all`."""
    folder = TemporaryDirectory(prefix="asperity-", ignore_cleanup_errors=True)
    _folders.add(folder)
    return folder


_folders: set[TemporaryDirectory[str]] = set()


def _work(channel: Connection, job: Job, arguments: tuple[Any, ...], folder: str) -> None:
    # Ctrl-C in a terminal reaches every process; the page ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # files of its own are removed by the process that ends this one
    tempfile.tempdir = folder
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

    A computation whose first results have not come is left to finish them, so that a wall that is dragged has answers,
    but for `PATIENCE` seconds at most.

    Examples
    --------
    >>> background = Background()
    >>> background.busy
    False
    """

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._channel: Connection | None = None
        self._next: tuple[Job, tuple[Any, ...], int] | None = None
        self._begun, self._missing = 0.0, 0
        self._folder: TemporaryDirectory[str] | None = None

    @property
    def busy(self) -> bool:
        """Whether a computation runs or waits."""
        return self._process is not None or self._next is not None

    @property
    def outdated(self) -> bool:
        """Whether what is being computed waits to be replaced."""
        return self._next is not None

    def ask(self, job: Job, *arguments: Any, first: int = 1) -> None:
        """Compute ``job(*arguments)``, an iterator of results, in place of what is being computed.

        ``first`` is the number of results that the computation is left to give before another may replace it.
        """
        self._next = (job, arguments, first)
        self._proceed()

    def collect(self) -> list[tuple[str | None, Any]]:
        """The results since the last call, each a pair of an error or None and a result."""
        found: list[tuple[str | None, Any]] = []
        channel = self._channel
        try:
            while channel is not None and channel.poll():
                found.append(channel.recv())
                self._missing -= 1
        except (EOFError, ConnectionResetError):
            assert self._process is not None
            self._process.join()
            if self._process.exitcode:
                found.append((GONE, None))
            self.drop(waiting=False)
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
        if self._folder is not None:
            self._folder.cleanup()
            _folders.discard(self._folder)
        self._process = self._channel = self._folder = None
        if waiting:
            self._next = None

    def _proceed(self) -> None:
        if self._next is None:
            return
        if self._process is not None and self._missing > 0 and time.monotonic() - self._begun < PATIENCE:
            return
        (job, arguments, first), self._next = self._next, None
        self.drop()
        context = _context()
        self._channel, theirs = context.Pipe(duplex=False)
        self._folder = private_folder()
        self._process = context.Process(target=_work, args=(theirs, job, arguments, self._folder.name), daemon=True)
        self._process.start()
        theirs.close()
        self._begun, self._missing = time.monotonic(), first
