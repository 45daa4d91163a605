"""A separate process that can be killed, which is the only safe way to stop a compiled loop or an algebra system.

The process is a fresh interpreter: a copy of this one would hold its threads' locks, and one that is started by
`multiprocessing` would run the user's script again.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

# Limit for a process to exit by itself.
LEAVE_SECONDS = 5.0
# Seconds after the time limit at which a process without parent ends itself.
GRACE = 5.0
_COMMAND = "import sys; sys.path[:] = {path!r}; from asperity.core.child import serve; serve({handle})"


class OutOfTime(Exception):
    """A call exceeded its time limit; its process was killed."""


class ChildCrashed(Exception):
    """The process ended by itself during a call."""


@dataclass
class ChildProcess:
    """Calls functions in another process, one at a time, also in a ``with`` statement.

    The process starts with the first call, and again with the first call after a process ended. It ends with this
    process.

    Parameters
    ----------
    prepare : callable, optional
        Called without arguments in every new process, before its first call and outside the time limit.
    """

    prepare: Callable[[], object] | None = None
    _process: subprocess.Popen[bytes] | None = field(default=None, init=False)
    _pipe: Any = field(default=None, init=False)
    _owner: int = field(default=0, init=False)
    _lock: Any = field(default_factory=threading.Lock, init=False)

    def call(self, function: Callable[..., Any], *arguments: Any, seconds: float) -> Any:
        """``function(*arguments)`` in the process, by pickling; raises the function's errors, or `OutOfTime`."""
        with self._lock:
            self._start()
            good, result = self._answer(function, arguments, seconds)
        if good:
            return result
        raise result

    def start(self) -> None:
        """Start and prepare the process if there is none."""
        with self._lock:
            self._start()

    def _start(self) -> None:
        # a process of the process that forked this one cannot be used
        if self._process is not None and self._owner == os.getpid() and self._process.poll() is None:
            return
        self.end()
        self._pipe, other = Pipe()
        # its own session, so that an interrupt reaches only the parent process
        self._process = subprocess.Popen(
            [sys.executable, "-c", _COMMAND.format(path=sys.path, handle=other.fileno())],
            pass_fds=[other.fileno()],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        other.close()
        self._owner = os.getpid()
        atexit.register(self.end)
        if self.prepare is not None:
            good, result = self._answer(self.prepare, (), None)
            if not good:
                self.end()
                raise result

    def _answer(self, function: Callable[..., Any], arguments: tuple[Any, ...], seconds: float | None) -> Any:
        assert self._process is not None
        question = pickle.dumps((function, arguments, seconds))
        try:
            self._pipe.send_bytes(question)
            if self._pipe.poll(seconds):
                return self._pipe.recv()
        except (EOFError, OSError) as reason:
            raise ChildCrashed(f"the process ended with code {self.end(kindly=True)}") from reason
        except BaseException:
            self.end()
            raise
        self.end()
        raise OutOfTime

    def end(self, kindly: bool = False) -> int | None:
        """End the process and return its exit code; kindly: close its pipe and let it exit by itself first."""
        process, self._process = self._process, None
        if process is None:
            return None
        atexit.unregister(self.end)
        with closing(self._pipe):
            if self._owner != os.getpid():
                return None
            if kindly:
                self._pipe.close()
                with suppress(subprocess.TimeoutExpired):
                    process.wait(LEAVE_SECONDS)
            # before its pipe is closed, so that a call in another thread sees the end
            process.kill()
            return process.wait()

    def __enter__(self) -> ChildProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end(kindly=True)


def serve(handle: int) -> None:
    """Answer calls until the pipe is closed."""
    pipe: Connection[Any, Any] = Connection(handle)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    while True:
        try:
            question = pipe.recv_bytes()
        except EOFError:
            return
        try:
            function, arguments, seconds = pickle.loads(question)
            signal.setitimer(signal.ITIMER_REAL, 0 if seconds is None else seconds + GRACE)
            answer = (True, function(*arguments))
        except Exception as reason:  # passed to the caller
            answer = (False, reason)
        signal.setitimer(signal.ITIMER_REAL, 0)
        pipe.send(answer)
