"""Checkpoints: files to which a long computation adds its finished parts, so that it goes on after any end."""

from __future__ import annotations

import hashlib
import json
import sqlite3
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from .errors import FileExistsRefusal, InputError

FORMAT = 2
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
        What the computation is, of plain JSON values: a file of another one is refused.
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

    def __init__(self, path: str | Path, identity: Mapping[str, Any], *, overwrite: bool = False) -> None:
        self.path = Path(path)
        self._committed = time.monotonic()
        try:
            # transactions are ours: begun by the first part after a commit
            self._file = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None)
        except sqlite3.Error as reason:
            raise self._failure(reason) from reason
        try:
            self._begin(json.loads(json.dumps(dict(identity))), overwrite)
        except BaseException:
            self._file.close()
            raise

    def _begin(self, identity: dict[str, Any], overwrite: bool) -> None:
        try:
            # locked until it is closed, and safe when the process is killed
            self._file.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._file.execute("PRAGMA synchronous = NORMAL")
            self._file.execute("BEGIN EXCLUSIVE")
            tables = {name for (name,) in self._file.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if overwrite:
                for name in tables & {"identity", "parts"}:
                    self._file.execute(f"DROP TABLE {name}")
                tables -= {"identity", "parts"}
            if not tables:
                self._file.execute("CREATE TABLE identity (format INTEGER, value TEXT)")
                self._file.execute("CREATE TABLE parts (key TEXT PRIMARY KEY, value, digest TEXT)")
                self._file.execute("INSERT INTO identity VALUES (?, ?)", (FORMAT, json.dumps(identity)))
            elif tables != {"identity", "parts"}:
                raise InputError(f"{self.path} is a database of something else; name another file")
            form, text = self._file.execute("SELECT format, value FROM identity").fetchone() or (None, "")
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
        found = list(differences(there, identity))
        if found:
            raise InputError(
                f"{self.path} is the checkpoint of something else; name another file or delete this one. "
                f"Differences: {'; '.join(found)}"
            )

    def parts(self) -> Iterator[tuple[str, Any]]:
        """Every key and its value.

        Raises
        ------
        InputError
            If a part is not what was stored.
        """
        try:
            rows = self._file.execute("SELECT key, value, digest FROM parts ORDER BY key").fetchall()
        except (sqlite3.Error, UnicodeDecodeError) as reason:
            raise self._damage("the list of its parts", reason) from reason
        for key, value, digest in rows:
            if not isinstance(key, str) or not isinstance(value, (str, bytes)) or digest != _digest(key, value):
                raise self._damage(f"part {key!r}", "it is not what was stored")
            yield key, value

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
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
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
