"""Checkpoints: files to which a long computation adds its finished parts, so that it goes on after any end."""

from __future__ import annotations

import builtins
import dis
import functools
import hashlib
import importlib
import io
import json
import re
import sqlite3
import sys
import sysconfig
import time
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from inspect import isfunction
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZIP_STORED

import numpy as np
from numpy.typing import NDArray

from .checks import shortened
from .errors import FileExistsRefusal, InputError
from .workers import end_if_started_again

Arrays = dict[str, NDArray[Any]]

FORMAT = 3
# All that the schema of a checkpoint has; the index is SQLite's own.
TABLES = {
    "identity": "CREATE TABLE identity (format INTEGER, value TEXT)",
    "parts": "CREATE TABLE parts (key TEXT PRIMARY KEY, value, digest TEXT)",
}
SCHEMA = {*(("table", name, text) for name, text in TABLES.items()), ("index", "sqlite_autoindex_parts_1", None)}
# Seconds between two transactions at most: what ends in between is computed again.
MOMENT = 0.5
# Seconds for which another process may hold the file before it is refused.
PATIENCE = 1.0


class Checkpoint:
    """Parts of one computation by their keys, in an SQLite file that holds no pickle.

    SQLite makes a transaction whole or undoes it, whenever the process or the machine stops or the disk is full. The
    file is locked while it is open.

    Parameters
    ----------
    path : path
        Made if there is no such file.
    identity : mapping
        What the computation is: a file of another one is refused. Numbers and texts are compared as they are, all
        other values by their `content`.
    key : str, optional
        The user's own name for the computation, a part of its identity. With it functions, and objects of classes that
        are not of this or another installed package, are told apart by their names alone.
    overwrite : bool
        Whether what is in the file is thrown away, whatever it is of.

    Raises
    ------
    InputError
        If the file is of another computation, which the message compares with this one; if it is no checkpoint; if it
        cannot be written.
    FileExistsRefusal
        If another process has it open.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     with Checkpoint(Path(folder) / "a", {"wall": "flat"}) as first:
    ...         first.put("0", "done")
    ...     with Checkpoint(Path(folder) / "a", {"wall": "flat"}) as second:
    ...         print(dict(second.parts()))
    {'0': 'done'}
    """

    def __init__(
        self, path: str | Path, identity: Mapping[str, Any], *, key: str | None = None, overwrite: bool = False
    ) -> None:
        end_if_started_again()
        self.path = Path(path)
        if key is not None and (not isinstance(key, str) or not key):
            raise InputError(f"key: expected a name for the computation such as 'walls of May', got {shortened(key)}")
        named = {} if key is None else {"key": key}
        plain = {**named, **{name: told(name, value, by_name=key is not None) for name, value in identity.items()}}
        self._committed = time.monotonic()
        try:
            # transactions are ours: begun by the first part after a commit
            self._file = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None)
        except sqlite3.Error as reason:
            raise self._failure(reason) from reason
        try:
            self._begin(json.loads(json.dumps(plain)), overwrite)
        except BaseException:
            self._file.close()
            raise

    def _begin(self, identity: dict[str, Any], overwrite: bool) -> None:
        try:
            # locked until it is closed, and safe when the process is killed
            self._file.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._file.execute("PRAGMA synchronous = NORMAL")
            self._file.execute("BEGIN EXCLUSIVE")
            found = set(self._file.execute("SELECT type, name, sql FROM sqlite_master"))
            if overwrite and found == SCHEMA:
                for name in TABLES:
                    self._file.execute(f"DROP TABLE {name}")
                found = set()
            if not found:
                for text in TABLES.values():
                    self._file.execute(text)
                self._file.execute("INSERT INTO identity VALUES (?, ?)", (FORMAT, json.dumps(identity)))
            elif found != SCHEMA:
                raise InputError(f"{self.path} is a database of something else; name another file")
            rows = self._file.execute("SELECT format, value FROM identity").fetchall()
            form, text = rows[0] if len(rows) == 1 else (None, "")
            self._file.execute("COMMIT")
        except sqlite3.OperationalError as reason:
            raise self._failure(reason) from reason
        except (sqlite3.DatabaseError, UnicodeDecodeError) as reason:
            raise InputError(f"{self.path} is not a checkpoint ({reason}); name another file") from reason
        if form != FORMAT:
            raise InputError(f"{self.path} has format {form}, this asperity reads {FORMAT}; name another file")
        try:
            there = json.loads(text)
        except (ValueError, TypeError, RecursionError) as reason:
            raise self._damage("its description", reason) from reason
        others = list(differences(there, identity))
        if others:
            raise InputError(
                f"{self.path} is the checkpoint of something else; name another file or delete this one. "
                f"Differences: {'; '.join(others)}"
            )

    def parts(self, read: Callable[[str, Any], Any] = lambda _, value: value) -> Iterator[tuple[str, Any]]:
        """Every key, and what ``read`` makes of key and value; it raises an error if they are not what is expected.

        Raises
        ------
        InputError
            If a part is not what was stored, or cannot be read.
        """
        try:
            rows = self._file.execute("SELECT key, value, digest FROM parts ORDER BY key").fetchall()
        except (sqlite3.Error, UnicodeDecodeError) as reason:
            raise self._damage("the list of its parts", reason) from reason
        for key, value, digest in rows:
            if not isinstance(key, str) or not isinstance(value, (str, bytes)) or digest != _digest(key, value):
                raise self._damage(f"part {key!r}", "it is not what was stored")
            try:
                found = read(key, value)
            # numpy, json and zipfile fail each in its own way
            except Exception as reason:
                raise self._damage(f"part {shortened(key)}", reason) from reason
            yield key, found

    def put(self, key: str, value: str | bytes, *, now: bool = False) -> None:
        """Store a part, in place of an earlier one with its key; at once, or with the others of half a second."""
        try:
            if not self._file.in_transaction:
                self._file.execute("BEGIN")
            self._file.execute("INSERT OR REPLACE INTO parts VALUES (?, ?, ?)", (key, value, _digest(key, value)))
            if now or time.monotonic() - self._committed > MOMENT:
                self.commit()
        except sqlite3.Error as reason:
            raise self._failure(reason) from reason

    def commit(self) -> None:
        """Write what was stored since the last time."""
        try:
            if self._file.in_transaction:
                self._file.execute("COMMIT")
        except sqlite3.Error as reason:
            raise self._failure(reason) from reason
        self._committed = time.monotonic()

    def _failure(self, reason: sqlite3.Error) -> InputError | FileExistsRefusal:
        if "locked" in str(reason):
            return FileExistsRefusal(f"{self.path} is in use by another process; wait for it or name another file")
        return InputError(
            f"{self.path}: cannot write there ({reason}); what was written before is safe. Free space, or name "
            "another folder, and start again"
        )

    def _damage(self, what: str, reason: object) -> InputError:
        return InputError(f"{self.path} is damaged: {what} ({reason}); delete it and start again, or name another file")

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: types.TracebackType | None
    ) -> None:
        try:
            self.commit()
        except InputError:
            # the first error says more
            if error is None:
                raise
        finally:
            self._file.close()


def _digest(key: str, value: str | bytes) -> str:
    """What tells a stored part from a changed one."""
    content = value.encode() if isinstance(value, str) else value
    return hashlib.sha256(key.encode() + b"\0" + content).hexdigest()


def differences(there: Any, here: Any, name: str = "") -> Iterator[str]:
    """In what two identities differ, one line each.

    Examples
    --------
    >>> list(differences({"seed": 1, "wall": "flat"}, {"seed": 2, "wall": "flat"}))
    ['seed: 1 there, 2 here']
    """
    if isinstance(there, dict) and isinstance(here, dict):
        for key in sorted({*there, *here}):
            yield from differences(there.get(key), here.get(key), f"{name}.{key}" if name else key)
    elif there != here:
        yield f"{name}: {json.dumps(there)} there, {json.dumps(here)} here".replace('"', "'")


class Stored(NamedTuple):
    """What an array in a checkpoint must be: its kind, as numpy names it, its shape, and the range of its numbers."""

    kind: str
    shape: tuple[int, ...]
    low: float = -sys.float_info.max
    high: float = sys.float_info.max


def packed_arrays(arrays: Mapping[str, Any]) -> bytes:
    """Arrays as a file of numpy's, without pickle."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def unpacked_arrays(content: bytes, expected: Mapping[str, Stored] | None = None) -> Arrays:
    """The arrays that `packed_arrays` stored.

    Raises
    ------
    ValueError
        If they are not as expected. Numpy and zipfile raise others.

    Examples
    --------
    >>> content = packed_arrays({"times": np.array([1.0, np.nan])})
    >>> unpacked_arrays(content, {"times": Stored("f", (2,), 0.0)})
    Traceback (most recent call last):
    ValueError: times: a number outside [0, 1.79769e+308]
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        # deflated, a small file could hold more than the memory
        if any(member.compress_type != ZIP_STORED for member in file.zip.infolist()):
            raise ValueError("it is compressed")
        found = {name: file[name] for name in file.files}
    if expected is not None and set(found) != set(expected):
        raise ValueError(f"expected {', '.join(expected)}, got {', '.join(found)}")
    for name, (kind, shape, low, high) in (expected or {}).items():
        array = found[name]
        if array.dtype.kind != kind or array.shape != shape:
            raise ValueError(f"{name}: expected kind {kind} of shape {shape}, got {array.dtype} of {array.shape}")
        # NaN is in no range
        if kind in "iuf" and not np.all((array >= low) & (array <= high)):
            raise ValueError(f"{name}: a number outside [{low:g}, {high:g}]")
    return found


def told(name: str, value: Any, *, by_name: bool) -> Any:
    """A value as plain JSON: numbers and texts as they are, others by words for the reader and by their content."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return {str(key): told(f"{name}.{key}", one, by_name=by_name) for key, one in value.items()}
    if type(value) in (list, tuple):
        return [told(name, one, by_name=by_name) for one in value]
    # of functions and classes
    words = getattr(value, "__qualname__", None) or re.sub(r" at 0x[0-9a-fA-F]+", "", shortened(value))
    try:
        return f"{words} ({content(value, by_name=by_name)})"
    except (_NoContent, RecursionError) as reason:
        raise InputError(
            f'{name}: {reason} has no content that a checkpoint can compare; pass key="...", a name of your own for '
            "this computation, or no checkpoint"
        ) from reason


class _NoContent(TypeError):
    """Of a value that cannot be compared."""


def content(value: Any, *, by_name: bool = False) -> str:
    """Sixteen hexadecimal digits that tell a value from others, the same in every process.

    Arrays are compared by their bytes, objects by their class and state without cached properties, functions by their
    code, constants, defaults, closures and the globals that they read. What belongs to an installed package is compared
    by its name and the package's version. What a function reads from files is not seen.

    Parameters
    ----------
    value : object
    by_name : bool
        Whether functions and objects of the user's own classes are told by their names alone.

    Raises
    ------
    TypeError
        If something has no content, such as an open file or a C function that is in no installed package.

    Examples
    --------
    >>> content(np.zeros(2)) == content(np.zeros(2)) != content(np.zeros(3))
    True
    >>> content(lambda angle: 2.0 * angle) == content(lambda angle: 3.0 * angle)
    False
    """
    return _Contents(by_name).of(value).hex()[:16]


LITERALS = (type(None), bool, int, float, complex, str, bytes, type(...), type(NotImplemented))
# What wraps functions: the attributes in which it holds them.
WRAPPERS: dict[type, tuple[str, ...]] = {
    property: ("fget", "fset", "fdel"), classmethod: ("__func__",), staticmethod: ("__func__",),
    functools.cached_property: ("func",), types.MethodType: ("__func__", "__self__"),
    types.BuiltinMethodType: ("__name__", "__self__"), types.MethodWrapperType: ("__name__", "__self__"),
    types.MethodDescriptorType: ("__name__", "__objclass__"), types.WrapperDescriptorType: ("__name__", "__objclass__"),
    functools._lru_cache_wrapper: ("__wrapped__",),
}  # fmt: skip
# Of a code object everything but where it stands.
CODE = ("co_code", "co_argcount", "co_posonlyargcount", "co_kwonlyargcount", "co_flags", "co_consts", "co_names",
        "co_varnames", "co_freevars", "co_cellvars", "co_exceptiontable")  # fmt: skip
# Members by which a class finds the slots and the dictionary of an object.
HIDDEN = types.MemberDescriptorType, types.GetSetDescriptorType
# Methods that the decorator of dataclasses writes.
WRITTEN = {"__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__", "__lt__", "__le__", "__gt__",
           "__ge__", "__replace__"}  # fmt: skip


class _Contents:
    """Digests of values, each computed once; in a circle a value is told by how far above it is met first."""

    def __init__(self, by_name: bool) -> None:
        self.by_name = by_name
        # with the values, whose ids are not used again so long
        self.known: dict[tuple[int, tuple[str, ...]], tuple[Any, bytes]] = {}
        self.open: dict[tuple[int, tuple[str, ...]], int] = {}

    def of(self, value: Any, names: tuple[str, ...] = ()) -> bytes:
        """The digest of a value; of a module of the user's those of the attributes of these names."""
        if type(value) in LITERALS:
            text = value.hex() if type(value) is float else hex(value) if type(value) is int else repr(value)
            return _hashed([type(value).__name__, text])
        key = id(value), names if isinstance(value, types.ModuleType) else ()
        if key in self.known:
            return self.known[key][1]
        if key in self.open:
            return _hashed(["above", str(self.open[key])])
        self.open[key] = len(self.open)
        try:
            found = _hashed(self._parts(value, names))
        except _NoContent:
            if not self.by_name:
                raise
            found = _hashed(["by name", type(value).__qualname__])
        finally:
            del self.open[key]
        self.known[key] = value, found
        return found

    def _parts(self, value: Any, names: tuple[str, ...]) -> Iterable[bytes | str]:
        kind = type(value)
        known = _known_name(value)
        if known is not None:
            return ["known", known]
        if isinstance(value, types.ModuleType):
            if not names:
                raise _NoContent(shortened(value))
            found = {name: getattr(value, name) for name in names if hasattr(value, name)}
            return ["module", *self._named(found, names)]
        if kind in (list, tuple):
            return [kind.__name__, *map(self.of, value)]
        if kind in (set, frozenset):
            return [kind.__name__, *sorted(map(self.of, value))]
        if kind in (dict, types.MappingProxyType):
            return ["dict", *(self.of(one) for item in value.items() for one in item)]
        if isinstance(value, np.generic) or kind in (np.ndarray, np.memmap):
            words = f"{'array' if isinstance(value, np.ndarray) else 'scalar'} {value.dtype.descr} {value.shape}"
            return [words, self.of(value.tolist()) if value.dtype.hasobject else np.asarray(value).tobytes()]
        if isinstance(value, types.CodeType):
            return ["code", repr(sys.version_info[:2]), *(self.of(getattr(value, name, None)) for name in CODE)]
        if isinstance(value, types.CellType):
            # reading an empty one is an error
            return ["cell", *([] if value == types.CellType() else [self.of(value.cell_contents, names)])]
        return self._rest(value, kind)

    def _rest(self, value: Any, kind: type) -> Iterable[bytes | str]:
        """Of functions, classes and objects."""
        if isinstance(value, (types.FunctionType, type)):
            if self.by_name and _version(value.__module__) is None:
                return ["by name", value.__qualname__]
            return self._function(value) if isinstance(value, types.FunctionType) else self._class(value)
        if kind in WRAPPERS and not isinstance(getattr(value, "__self__", self), (types.ModuleType, type(None))):
            return [kind.__name__, *(self.of(getattr(value, name)) for name in WRAPPERS[kind])]
        if kind.__module__.startswith("numba.") and isfunction(getattr(value, "py_func", None)):
            return ["compiled", self.of(value.py_func), self.of(value.targetoptions)]
        if self.by_name and _version(kind.__module__) is None:
            return ["by name", kind.__qualname__]
        return self._object(value)

    def _named(self, values: Mapping[str, Any], names: tuple[str, ...] = ()) -> Iterator[bytes | str]:
        for name in sorted(values):
            yield from (name, self.of(values[name], names))

    def _function(self, function: Any) -> Iterator[bytes | str]:
        reached = dict(_reached(function.__code__, function.__globals__))
        names = tuple(sorted(_names(function.__code__)))
        yield from ("function", function.__qualname__, self.of(function.__code__))
        yield from map(self.of, (function.__defaults__, function.__kwdefaults__, function.__dict__))
        # outside of `known`, because of a module in it only what this code names is read
        yield from (_hashed(self._parts(cell, names)) for cell in function.__closure__ or ())
        yield from self._named(reached, names)

    def _class(self, kind: type) -> Iterator[bytes | str]:
        yield from ("class", kind.__qualname__)
        yield from map(self.of, (*kind.__bases__, type(kind)))
        written = WRITTEN if "__dataclass_params__" in vars(kind) else set()
        members = {name: member for name, member in vars(kind).items() if name not in written and name != "_abc_impl"}
        if issubclass(kind, Enum):
            yield from self._named({one.name: one.value for one in kind})
            members = {name: member for name, member in members.items() if isfunction(member)}
        for name in sorted(members):
            member = members[name]
            plain = not name.startswith("__") and not isinstance(member, HIDDEN)
            if plain or isfunction(member) or type(member) in WRAPPERS:
                yield from (name, self.of(member))

    def _object(self, value: Any) -> Iterable[bytes | str]:
        """By what pickle would make it of, which is what the class says or all its attributes."""
        try:
            made = value.__reduce_ex__(4)
        # foreign objects fail in their own way
        except Exception as reason:
            raise _NoContent(shortened(value)) from reason
        if not isinstance(made, tuple):
            raise _NoContent(shortened(value))
        function, arguments, state, entries, items, setter = (*made, None, None, None, None)[:6]
        if type(state) is dict:
            cached = {
                name for base in type(value).__mro__ for name, member in vars(base).items()
                if isinstance(member, functools.cached_property)
            }  # fmt: skip
            state = sorted((name, one) for name, one in state.items() if name not in cached)
        listed = [None if one is None else list(one) for one in (entries, items)]
        return ["object", *map(self.of, (function, arguments, state, listed, setter))]


def _hashed(parts: Iterable[bytes | str]) -> bytes:
    told = hashlib.sha256()
    for part in parts:
        coded = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        told.update(len(coded).to_bytes(8, "big") + coded)
    return told.digest()


@functools.cache
def _version(module: str | None) -> str | None:
    """The version of a module of Python or of an installed package; None of the user's own."""
    top = sys.modules.get((module or "").partition(".")[0])
    if top is None or top.__name__ == "__main__":
        return None
    file = Path(getattr(top, "__file__", None) or "/")
    if {"site-packages", "dist-packages"} & set(file.parts) or top.__name__ == __name__.partition(".")[0]:
        return getattr(top, "__version__", None)
    of_python = top.__name__ in sys.builtin_module_names or file.is_relative_to(sysconfig.get_path("stdlib"))
    return repr(sys.version_info[:2]) if of_python else None


def _known_name(value: Any) -> str | None:
    """Name and version of what stands in an installed module under its own name, and of these modules."""
    if isinstance(value, types.ModuleType):
        version = _version(value.__name__)
        return None if version is None else f"{value.__name__} {version}"
    # ufuncs of other packages know no module
    ufunc = isinstance(value, np.ufunc)
    name = getattr(value, "__name__" if ufunc else "__qualname__", None)
    for module in ("numpy", "scipy.special") if ufunc else (getattr(value, "__module__", None),):
        if isinstance(name, str) and isinstance(module, str) and (version := _version(module)) is not None:
            try:
                if attrgetter(name)(sys.modules[module]) is value:
                    return f"{module}.{name} {version}"
            except (AttributeError, KeyError):
                continue
    return None


def _names(code: types.CodeType) -> set[str]:
    """All names in a code and in those within it."""
    inner = (_names(one) for one in code.co_consts if isinstance(one, types.CodeType))
    return set(code.co_names).union(*inner)


def _reached(code: types.CodeType, known: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The globals that a function reads, and the modules that it imports."""
    before: list[Any] = [0, 0]
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            name = step.argval
            if name in known or hasattr(builtins, name):
                yield name, known[name] if name in known else getattr(builtins, name)
        elif step.opname == "IMPORT_NAME":
            level = before[-2] if isinstance(before[-2], int) else 0
            name = "." * level + step.argval
            try:
                yield f"import {name}", importlib.import_module(name, known.get("__package__"))
            except ImportError:
                continue
        before.append(step.argval)
    for one in code.co_consts:
        if isinstance(one, types.CodeType):
            yield from _reached(one, known)
