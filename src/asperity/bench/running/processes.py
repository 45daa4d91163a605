"""Processes that can be killed, which is the only safe way to stop a compiled loop, and the division of run time."""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

# Limit for a process to exit by itself.
LEAVE_SECONDS = 5.0


class OutOfTime(Exception):
    """A call exceeded its time limit; its process was killed."""


class ChildCrashed(Exception):
    """The process ended by itself during a call."""


@dataclass
class ChildProcess:
    """Calls functions in another process, one at a time; use it in a ``with`` statement.

    The process starts with the first call, and again with the first call after a process ended.

    Parameters
    ----------
    prepare : callable, optional
        Called without arguments in every new process, before its first call and outside the time limit.
    """

    prepare: Callable[[], object] | None = None
    _process: Any = field(default=None, init=False)
    _pipe: Connection | None = field(default=None, init=False)

    def call(self, function: Callable[..., Any], *arguments: Any, seconds: float) -> Any:
        """``function(*arguments)`` in the process, by pickling; raises the function's errors, or `OutOfTime`."""
        self.start()
        assert self._pipe is not None
        self._pipe.send((function, arguments))
        return self._answer(seconds)

    def start(self) -> None:
        """Start and prepare the process if there is none."""
        if self._process is not None:
            return
        # a fresh interpreter: a copy of this one would hold its threads' locks
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other,), daemon=True)
        self._process.start()
        other.close()
        if self.prepare is not None:
            self._pipe.send((self.prepare, ()))
            self._answer(None)

    def _answer(self, seconds: float | None) -> Any:
        assert self._pipe is not None
        try:
            if not self._pipe.poll(seconds):
                self._end()
                raise OutOfTime
            good, result = self._pipe.recv()
        except EOFError as reason:
            self._process.join(LEAVE_SECONDS)
            code = self._process.exitcode
            self._end()
            raise ChildCrashed(f"the process ended with code {code}") from reason
        if good:
            return result
        raise result

    def _end(self, kindly: bool = False) -> None:
        """End the process; kindly: close its pipe and let it exit by itself first."""
        if self._process is None:
            return
        assert self._pipe is not None
        if kindly:
            self._pipe.close()
            self._process.join(LEAVE_SECONDS)
        self._process.kill()
        self._process.join(LEAVE_SECONDS)
        self._pipe.close()
        self._process = self._pipe = None

    def __enter__(self) -> ChildProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end(kindly=True)


def _serve(pipe: Connection) -> None:
    """Answer calls until the pipe is closed."""
    from tqdm import tqdm

    # tqdm's default lock is shared between processes, and a killed process would leave it locked
    tqdm.set_lock(threading.RLock())
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            answer = (True, function(*arguments))
        except Exception as reason:  # passed to the caller
            answer = (False, reason)
        pipe.send(answer)


@dataclass
class TimePlan:
    """Divides ``seconds``, counted from construction, among ``parts``.

    If no part exceeds its fraction, the sum is at most ``seconds``. Later parts divide the time that earlier parts
    leave.

    Examples
    --------
    >>> plan = TimePlan(10.0, 2)
    >>> round(plan.next_fraction())
    5
    """

    seconds: float
    parts: int
    _begun: float = field(default_factory=lambda: time.monotonic(), init=False)
    _left: int = field(init=False)

    def __post_init__(self) -> None:
        self._left = self.parts

    @property
    def remaining(self) -> float:
        """Remaining seconds, at least 0."""
        return max(self.seconds - (time.monotonic() - self._begun), 0.0)

    def next_fraction(self, weight: float = 1.0) -> float:
        """Seconds for the next part, which counts as ``weight`` later parts."""
        fraction = weight / (weight + self._left - 1) * self.remaining
        self._left = max(self._left - 1, 1)
        return fraction
