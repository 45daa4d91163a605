"""The decorator of compiled functions. Loads numba.

numba compiles a function when it is first called, and stores the result beside the module, else in the user's cache
folder; NUMBA_CACHE_DIR names another one.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any
from weakref import WeakSet

from numba import njit
from numba.core import event

from .errors import AsperityError
from .long_runs import is_heard

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
        if not linked:
            # numba finds a stored function by this name, and does not notice a change in the functions that it calls
            function.__qualname__ += f"_{digest():016x}"
        try:
            dispatcher = njit(cache=not linked, **own)(function)
        except RuntimeError:
            _warn_of_no_folder()
            dispatcher = njit(**own)(function)
        if isinstance(dispatcher, FunctionType):
            raise AsperityError("NUMBA_DISABLE_JIT is set, but rays are traced by compiled functions; unset it")
        COMPILED.add(dispatcher)
        kind: Any = type(dispatcher)
        dispatcher.__class__ = _kind(kind, bool(own.get("no_cpython_wrapper")))
        return dispatcher

    return compiled


@cache
def has_option(name: str) -> bool:
    """Return whether numba's compiler has an option."""
    target = getattr(njit(lambda: None), "targetdescr", None)
    return hasattr(getattr(target, "options", None), name)


@cache
def _kind(kind: Any, inner: bool) -> Any:
    """Return the kind of functions that are compiled again where what is stored of them is damaged.

    An inner one has no wrapper for Python, and a call from there would end the process.
    """

    def compiled(self: Any, signature: Any) -> Any:
        try:
            return kind.compile(self, signature)
        # a damaged pickle fails in any way; numba's own errors are of the function
        except Exception as reason:
            damaged = [] if type(reason).__module__.startswith("numba.") else stored_files(self)
            if not damaged:
                raise
            for path in damaged:
                path.unlink(missing_ok=True)
            logger.warning("%s: damaged (%r), compiled again", damaged[0], reason)
            return kind.compile(self, signature)

    def refuse(self: Any, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__}: only compiled functions call it; from Python call its py_func")

    return type("Kind", (kind,), {"compile": compiled, **({"__call__": refuse} if inner else {})})


@cache
def digest() -> int:
    """Return a number for the sources of all compiled functions and of the constants in them."""
    package = Path(__file__).parents[1]
    sources = [Path(__file__), package / "core" / "rounding.py"]
    for folder in ("compiled", "double_double", "scene", "curves"):
        sources += sorted(package.glob(f"geometry/**/{folder}/**/*.py"))
    return int.from_bytes(hashlib.sha256(b"".join(source.read_bytes() for source in sources)).digest()[:8], "big")


@cache
def _warn_of_no_folder() -> None:
    logger.warning("no folder is writable, so compiled functions are not stored; set NUMBA_CACHE_DIR")


class _Compilation(event.Listener):
    """Says once that functions are being compiled, and lets the collector of garbage rest meanwhile.

    The compiler makes millions of small objects that live until its end; to go through them takes 6 % of its time.
    """

    def __init__(self) -> None:
        self._depth, self._rests = 0, False

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] in COMPILED:
            announce()
        self._depth += 1
        if gc.isenabled():
            self._rests = True
            gc.disable()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0 and self._rests:
            self._rests = False
            gc.enable()


COMPILED: WeakSet[Any] = WeakSet()
event.register("numba:compile", _Compilation())


@cache
def announce() -> None:
    """Say that functions are being compiled."""
    text = "asperity: compiling, once (about 10 s)"
    logger.info(text)
    if is_heard() and sys.stderr.isatty():
        print(text, file=sys.stderr, flush=True)


def is_stored(function: Any) -> bool:
    """Return whether a compiled function has been stored on disk."""
    return any(path.suffix == ".nbi" for path in stored_files(function))


def stored_files(function: Any) -> list[Path]:
    """Return the files in which a compiled function is stored."""
    folder, python = function.stats.cache_path, function.py_func
    name = f"{Path(python.__code__.co_filename).stem}.{python.__qualname__}-"
    return [] if folder is None else [path for path in Path(folder).glob("*.nb?") if path.name.startswith(name)]
