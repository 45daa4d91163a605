"""The decorator of compiled functions. Loads numba.

numba compiles a function when it is first called, and stores the result beside the module, else in the user's cache
folder; NUMBA_CACHE_DIR names another one.
"""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import CellType, FunctionType
from typing import Any
from weakref import WeakSet

from numba import njit
from numba.core import event

logger = logging.getLogger("asperity")

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Options that numba's manual does not name, and that are left out where numba does not have them: without wrappers for
# calls from Python and C a function compiles in half the time; without numba's run time no references are counted.
UNDOCUMENTED = frozenset({"no_cfunc_wrapper", "no_cpython_wrapper", "_nrt"})


def jit(*, linked: bool = False, **options: Any) -> Callable[[Any], Any]:
    """Return a decorator that compiles a function and stores it on disk, with ``options`` of numba's ``njit``.

    The function releases the lock of the interpreter, and divides by zero as numpy does. A ``linked`` function, as one
    with the option ``forceinline``, is compiled and stored as a part of its callers: Python does not call it.
    """
    linked = linked or bool(options.get("forceinline"))
    wanted = OPTIONS | options | ({"no_cpython_wrapper": True} if linked else {})

    def compiled(function: Any) -> Any:
        own = {name: value for name, value in wanted.items() if name not in UNDOCUMENTED or has_option(name)}
        try:
            dispatcher = njit(cache=not linked, **own)(function if linked else _with_digest(function))
        except RuntimeError:
            _warn_of_no_folder()
            dispatcher = njit(**own)(function)
        COMPILED.add(dispatcher)
        # not with numba's switch that turns compilation off
        if own.get("no_cpython_wrapper") and not isinstance(dispatcher, FunctionType):
            kind: Any = type(dispatcher)
            dispatcher.__class__ = _inner_kind(kind)
        return dispatcher

    return compiled


@cache
def has_option(name: str) -> bool:
    """Return whether numba's compiler has an option."""
    target = getattr(njit(lambda: None), "targetdescr", None)
    return hasattr(getattr(target, "options", None), name)


@cache
def _inner_kind(kind: Any) -> Any:
    """Return the kind of functions without a wrapper for Python, whose call from there would end the process."""

    def refuse(self: Any, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__}: only compiled functions call it; from Python call its py_func")

    return type("Inner", (kind,), {"__call__": refuse})


@cache
def digest() -> int:
    """Return a number for the sources of all compiled functions and of the constants in them."""
    package = Path(__file__).parents[1]
    sources = [Path(__file__), package / "core" / "rounding.py"]
    for folder in ("compiled", "double_double", "scene"):
        sources += sorted(package.glob(f"geometry/**/{folder}/*.py"))
    return int.from_bytes(hashlib.sha256(b"".join(source.read_bytes() for source in sources)).digest()[:8], "big")


def _with_digest(function: Any) -> Any:
    """Return the function with the digest among the variables of its closure.

    numba finds a stored function by its own source and by these variables, but not by the functions that it calls.
    """
    code = function.__code__.replace(co_freevars=(*function.__code__.co_freevars, "digest"))
    closure = (*(function.__closure__ or ()), CellType(digest()))
    made = FunctionType(code, function.__globals__, function.__name__, function.__defaults__, closure)
    made.__module__, made.__qualname__, made.__doc__ = function.__module__, function.__qualname__, function.__doc__
    return made


@cache
def _warn_of_no_folder() -> None:
    logger.warning("no folder is writable, so compiled functions are not stored; set NUMBA_CACHE_DIR")


class _Announcement(event.Listener):
    """Says once that functions are being compiled: in the log, and on a terminal."""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] in COMPILED:
            announce()

    def on_end(self, event: Any) -> None:
        pass


COMPILED: WeakSet[Any] = WeakSet()
event.register("numba:compile", _Announcement())


@cache
def announce() -> None:
    """Say that functions are being compiled."""
    text = "asperity: compiling, once (about 10 s)"
    logger.info(text)
    if sys.stderr is not None and sys.stderr.isatty() and multiprocessing.parent_process() is None:
        print(text, file=sys.stderr, flush=True)


def is_stored(function: Any) -> bool:
    """Return whether a compiled function has been stored on disk, perhaps from other sources."""
    folder = function.stats.cache_path
    name = f"{Path(function.py_func.__code__.co_filename).stem}.{function.py_func.__name__}-"
    return folder is not None and any(path.name.startswith(name) for path in Path(folder).glob("*.nbi"))
