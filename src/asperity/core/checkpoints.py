"""Checkpoints: files to which a long computation adds its finished parts, so that it goes on after any end."""

from __future__ import annotations

import hashlib
import io
import json
import sqlite3
import sys
import time
import types
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZIP_STORED

import numpy as np
from numpy.typing import NDArray

from .checks import shortened
from .contents import told
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
    """What an array in a checkpoint must be: its kind, as numpy names it, its shape, and the range of its numbers.

    Where the shape has None, any length will do.
    """

    kind: str
    shape: tuple[int | None, ...]
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
        alike = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
        if array.dtype.kind != kind or not alike:
            raise ValueError(f"{name}: expected kind {kind} of shape {shape}, got {array.dtype} of {array.shape}")
        # NaN is in no range
        if kind in "iuf" and not np.all((array >= low) & (array <= high)):
            raise ValueError(f"{name}: a number outside [{low:g}, {high:g}]")
    return found
