"""Long runs in parts: each depends on its number alone, is computed by any worker, and stored when it is finished.

The progress bars and reports of everything that takes long are here too.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, TypedDict, TypeVar

from .checkpoints import Arrays, Checkpoint, Stored, packed_arrays, unpacked_arrays
from .errors import AsperityError, InputError
from .version import __version__
from .workers import connected, results

T = TypeVar("T")

# Seconds after which a faster method with a larger error takes over. They are counted from the work, at nominal speeds,
# so that results depend neither on the machine nor on its load.
TIME_LIMIT = 10.0
# Numbers in memory at a time, 16 MB, where an array would have a number for every pair of two long lists.
NUMBERS_AT_ONCE = 2**21
# Before that no progress bar appears.
SLOW_SECONDS = 2.0
# Seconds between two reports, and after which the rate of the first part of the work predicts the rest.
REPORTED_SECONDS, PREDICTED_SECONDS = 10.0, 1.0
# The variable of the environment that silences bars and reports.
QUIET = "ASPERITY_QUIET"
# Least seconds between two pictures of a bar.
RENEWED_SECONDS = 0.1
# Of fewer items no bar is made, and the bar of more is renewed after so many.
MANY = 10_000


def slices(number: int, step: int) -> Iterator[slice]:
    """A sequence of so many entries, at most ``step`` of them at a time.

    Examples
    --------
    >>> list(slices(3, 2))
    [slice(0, 2, None), slice(2, 4, None)]
    """
    return (slice(start, start + step) for start in range(0, number, step))


class Engine(TypedDict, total=False):
    """Where a long run stores what it has, and who computes.

    Attributes
    ----------
    checkpoint : path
        A file to which finished parts are added; the same call goes on with it.
    key : str
        A name of the user's own for the computation, as of `asperity.spectral.sweep`.
    client : int, str or distributed.Client
        As of `asperity.spectral.sweep`.
    """

    checkpoint: str | Path | None
    key: str | None
    client: Any


def _packed_part(function: Callable[[int], Mapping[str, Any]], number: int) -> bytes | tuple[str, str]:
    """The arrays of a part as a file of numpy without pickle, or the class and the words of the error that ended it."""
    try:
        return packed_arrays(function(number))
    except AsperityError as reason:  # a task must not raise
        return type(reason).__name__, str(reason)


def all_parts(
    function: Callable[[int], Mapping[str, Any]],
    number: int,
    identity: Mapping[str, Any],
    engine: Engine,
    expected: Callable[[int], Mapping[str, Stored] | None] = lambda part: None,
) -> list[Arrays]:
    """The arrays of the parts 0, ..., number - 1, in this order.

    Parameters
    ----------
    function : callable
        From the number of a part to its arrays by name. It is sent to workers.
    number : int
    identity : mapping
        What tells this run from others, for the checkpoint.
    engine : Engine
    expected : callable
        From the number of a part to what its arrays must be, by which those of a checkpoint are checked.

    Raises
    ------
    InputError
        If the checkpoint is of another run or cannot be written.
    KeyboardInterrupt
        After Ctrl-C; it says how many parts are stored, and how to go on.

    Examples
    --------
    >>> [part["square"].item() for part in all_parts(lambda k: {"square": k**2}, 3, {}, {})]
    [0, 1, 4]
    """
    path = engine.get("checkpoint")
    packed: dict[int, bytes] = {}

    def read(key: str, content: bytes) -> bytes:
        if int(key) not in range(number):
            raise ValueError(f"expected the number of a part below {number}")
        unpacked_arrays(content, expected(int(key)))
        return content

    try:
        with ExitStack() as stack:
            store = None if path is None else stack.enter_context(Checkpoint(path, identity, key=engine.get("key")))
            if store is not None:
                packed |= {int(key): content for key, content in store.parts(read)}
            workers = stack.enter_context(connected(engine.get("client")))
            rest = [part for part in range(number) if part not in packed]
            progress = stack.enter_context(progress_bar(len(rest), "part", str(identity.get("computation", "run"))))
            for part, content in results(partial(_packed_part, function), rest, workers):
                if isinstance(content, tuple):
                    raise (InputError if content[0] == "InputError" else AsperityError)(content[1])
                packed[part] = content
                progress.update()
                if store is not None:
                    store.put(str(part), content)
    except KeyboardInterrupt as stop:
        done = f"stopped after {len(packed)} of {number} parts"
        lost = "without a checkpoint they are lost"
        raise KeyboardInterrupt(f"{done}; {lost if path is None else f'{path} has them: give the same call'}") from stop
    return [unpacked_arrays(packed[part]) for part in range(number)]


def identity_of(computation: str, job: Any) -> dict[str, Any]:
    """What tells a run from others: its name, the version, and the fields of the dataclass whose methods compute it."""
    given = {one.name: getattr(job, one.name) for one in fields(job)}
    return {"computation": computation, "version": __version__, **given}


class OutOfTime(Exception):
    """The time of `time_limited` is used up; another method takes over, so that no user sees this exception."""


_seconds_left: ContextVar[list[float] | None] = ContextVar("seconds_left", default=None)


@contextmanager
def time_limited(seconds: float) -> Iterator[None]:
    """Limit the nominal time of conditional distributions; a limit within another one counts against both.

    Raises
    ------
    OutOfTime
        If more time is counted.

    Examples
    --------
    >>> with time_limited(1.0):
    ...     count_time(2.0)
    Traceback (most recent call last):
    asperity.core.long_runs.OutOfTime: 2 seconds, 1 allowed
    """
    outer = _seconds_left.get()
    allowed = seconds if outer is None else min(seconds, outer[0])
    left = [allowed]
    token = _seconds_left.set(left)
    try:
        yield
    finally:
        _seconds_left.reset(token)
        if outer is not None:
            outer[0] -= allowed - left[0]


def count_time(seconds: float) -> None:
    """Count nominal time against the limit in force."""
    left = _seconds_left.get()
    if left is None:
        return
    allowed = left[0]
    # what is counted is spent, also beyond the limit
    left[0] -= seconds
    if seconds > allowed:
        raise OutOfTime(f"{seconds:.3g} seconds, {allowed:.3g} allowed")


class Progress:
    """What is known of a piece of work: a bar shows it on a terminal and in a notebook, else lines report it.

    A thread writes the lines, so that they come also during a long call of compiled code.
    """

    running: ClassVar[list[Progress]] = []

    def __init__(self, total: int | None, unit: str, text: str | None, bar: Any = None) -> None:
        self.total, self.unit, self.text, self.bar = total, unit, text, bar
        self.done, self.detail, self.begun, self.ended = 0, "", time.monotonic(), threading.Event()

    def update(self, number: int = 1) -> None:
        """Count what has been done."""
        self.done += number
        if self.bar is not None:
            self.bar.update(number)

    def describe(self, detail: str) -> None:
        """Say how far an iteration is."""
        self.detail = detail
        if self.bar is not None:
            self.bar.set_postfix_str(detail, refresh=False)

    def __enter__(self) -> Progress:
        if is_heard():
            self.running.append(self)
            if self.running[0] is self:
                threading.Thread(target=self._report, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.set()
        if self in self.running:
            self.running.remove(self)
        if self.bar is not None:
            self.bar.close()

    def _report(self) -> None:
        """Write every ten seconds how far the work is, and as soon as its first part predicts more than ten."""
        due, predicted = REPORTED_SECONDS, False
        while not self.ended.wait(PREDICTED_SECONDS):
            # the first of those that run that counts, for the others are its parts
            running = tuple(self.running)
            last, spent = next((one for one in running if one.done), self), time.monotonic() - self.begun
            left = (last.total / last.done - 1.0) * (time.monotonic() - last.begun) if last.total and last.done else 0.0
            if spent < due and (predicted or left < REPORTED_SECONDS):
                continue
            predicted = predicted or left > 0.0
            due += REPORTED_SECONDS * (spent >= due)
            # a bar that counts says more
            if not any(one.done and one.bar is not None and not one.bar.disable for one in running):
                counts = f"{last.done} of {last.total} {last.unit}s" if last.total else f"{last.done} {last.unit}s"
                told = (
                    f"{spent:.0f} s",
                    counts * bool(last.unit),
                    last.detail,
                    f"about {left:.0f} s left" * (left > 0.0),
                )
                report(f"{self.text or self.unit}: {', '.join(filter(None, told))}")


def is_heard() -> bool:
    """Whether this process may write reports: no worker, and not with the variable `QUIET` in its environment."""
    return sys.stderr is not None and multiprocessing.parent_process() is None and not os.environ.get(QUIET)


def report(text: str) -> None:
    """Write a line to standard error."""
    if is_heard():
        print(f"asperity: {text}", file=sys.stderr, flush=True)


@contextmanager
def reported(text: str, seconds: float = 0.0, memory: float = 0.0) -> Iterator[Progress]:
    """Report a call, before it begins if more than ten ``seconds`` are predicted, and every ten seconds.

    Parameters
    ----------
    text : str
        The name of the call.
    seconds, memory : float
        What its size predicts; the memory in bytes.
    """
    if seconds > REPORTED_SECONDS and not Progress.running:
        report(f"{text}: about {seconds:.0f} s and {memory / 1e9:.1f} GB of memory")
    with Progress(None, "", text) as progress:
        yield progress


def progress_bar(total: int | None, unit: str, text: str | None = None, *, shown: bool = True) -> Progress:
    """The progress of a piece of work, whose bar of tqdm appears after SLOW_SECONDS and leaves no trace.

    There is no bar where standard error is no terminal, nor in the processes of workers.

    Parameters
    ----------
    total : int or None
        None where it is not known.
    unit : str
        What is counted, in the singular.
    text : str, optional
        What stands before the bar.
    shown : bool
        Without it there is no bar anywhere.

    Examples
    --------
    >>> with progress_bar(2, "part", shown=False) as bar:
    ...     bar.update()
    >>> bar.done
    1
    """
    if not shown or not is_heard():
        return Progress(total, unit, text)
    from tqdm.auto import tqdm

    # tqdm.auto takes the bar for notebooks only in one, where standard error is no terminal
    notebook = sys.modules.get("tqdm.notebook")
    in_notebook = notebook is not None and issubclass(tqdm, notebook.tqdm_notebook)
    bar = tqdm(
        desc=text, total=total, unit=unit, unit_scale=unit == "ray", delay=SLOW_SECONDS, leave=False,
        mininterval=RENEWED_SECONDS, disable=False if in_notebook else None,
    )  # fmt: skip
    return Progress(total, unit, text, bar)


def counted(items: Sequence[T], unit: str, text: str) -> Iterator[T]:
    """The items of a long sequence, counted by a progress bar.

    Examples
    --------
    >>> sum(counted(range(3), "number", "sum"))
    3
    """
    if len(items) < MANY:
        yield from items
        return
    with progress_bar(len(items), unit, text) as bar:
        for start in range(0, len(items), MANY):
            part = items[start : start + MANY]
            yield from part
            bar.update(len(part))
