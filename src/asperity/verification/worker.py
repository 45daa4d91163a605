"""A separate process that decides identities and can be killed at the time limit.

The process is a fresh interpreter, because a copy of this process might have threads. It ends with this process.
"""

from __future__ import annotations

import atexit
import io
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from ..core.errors import InputError
from .verdict import Verdict

# A start takes about a second; after this time it has failed.
START_SECONDS = 120.0
# Seconds after the time limit at which the process ends itself.
GRACE = 5.0
_COMMAND = (
    "import sys; sys.path[:] = {path!r}; from asperity.verification.derivation import decide; "
    "from asperity.verification.worker import serve; serve({handle}, decide)"
)


class _Worker:
    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        command = _COMMAND.format(path=sys.path, handle=theirs.fileno())
        # its own session, so that an interrupt reaches only the parent process
        self.process = subprocess.Popen(
            [sys.executable, "-c", command],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()
        self.owner = os.getpid()
        if not self.connection.poll(START_SECONDS) or self.connection.recv() != "ready":
            self.end()
            raise RuntimeError("the process that verifies identities did not start; pass time_limit=None")

    def end(self) -> None:
        self.connection.close()
        if self.owner == os.getpid():
            self.process.kill()
            self.process.wait()


def _pickled(question: Any) -> bytes:
    """The expressions as they are written: sympy's own pickles are evaluated when they are read."""
    from .constants import without_evaluation

    class Pickler(pickle.Pickler):
        def reducer_override(self, e: Any) -> Any:
            return without_evaluation(e)

    stream = io.BytesIO()
    Pickler(stream).dump(question)
    return stream.getvalue()


_lock = threading.Lock()
_worker: _Worker | None = None


def decide_in_time(claims: list[Any], relations: list[Any], seconds: float) -> Verdict:
    """The verdict of `derivation.decide`, or *undecided* after ``seconds``."""
    global _worker
    try:
        question = _pickled((claims, relations, seconds))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"lhs, rhs: expected expressions that can be pickled ({error}); pass time_limit=None"
        ) from error
    with _lock:
        if _worker is None or _worker.owner != os.getpid() or _worker.process.poll() is not None:
            if _worker is not None:
                _worker.end()
            _worker = _Worker()
        try:
            _worker.connection.send_bytes(question)
            answer = _worker.connection.recv() if _worker.connection.poll(seconds) else None
        except BaseException as error:
            _worker.end()
            _worker = None
            if isinstance(error, EOFError | OSError):
                raise RuntimeError("the process that verifies identities has ended; pass time_limit=None") from error
            raise
        if answer is None:
            _worker.end()
            _worker = None
            return Verdict("undecided", f"the time limit of {seconds:g} s was reached")
    kind, content = answer
    if kind == "verdict":
        return Verdict(*content)
    raise InputError(content) if kind == "input" else RuntimeError(content)


@atexit.register
def _end() -> None:
    if _worker is not None:
        _worker.end()


def serve(handle: int, decide: Callable[[list[Any], list[Any]], Verdict]) -> None:
    """Answer requests until the connection is closed."""
    connection: Connection[Any, Any] = Connection(handle)
    import flint  # noqa: F401
    import sympy  # noqa: F401

    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    connection.send("ready")
    while True:
        try:
            message = connection.recv_bytes()
        except EOFError:
            return
        try:
            claims, relations, seconds = pickle.loads(message)
        except Exception as error:
            connection.send(("input", f"lhs, rhs: expected expressions of sympy ({error}); pass time_limit=None"))
            continue
        signal.setitimer(signal.ITIMER_REAL, seconds + GRACE)
        try:
            found = decide(claims, relations)
            answer: tuple[str, Any] = (
                "verdict",
                (found.answer, found.evidence, dict(found.counterexample), found.values),
            )
        except InputError as error:
            answer = "input", str(error)
        except Exception as error:
            answer = "error", f"{type(error).__name__}: {error}"
        signal.setitimer(signal.ITIMER_REAL, 0)
        connection.send(answer)
