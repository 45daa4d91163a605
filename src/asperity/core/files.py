"""Files that appear whole: written beside their name and moved there when complete."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from .errors import FileExistsRefusal, InputError


@contextmanager
def moved_when_complete(folder: Path) -> Iterator[Path]:
    """A folder beside the files of ``folder``: what is written there replaces those, but only if nothing fails.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "a.txt").write_text("old")
    ...     with moved_when_complete(Path(folder)) as beside:
    ...         _ = (beside / "a.txt").write_text("new")
    ...         before = (Path(folder) / "a.txt").read_text()
    ...     before, (Path(folder) / "a.txt").read_text()
    ('old', 'new')
    """
    with TemporaryDirectory(dir=folder, prefix=".asperity-", ignore_cleanup_errors=True) as beside:
        yield Path(beside)
        files = sorted(Path(beside).iterdir())
        for file in files:
            with file.open("rb") as stream:
                os.fsync(stream.fileno())
        for file in files:
            os.replace(file, folder / file.name)


def write_whole(path: Path, content: str | Callable[[IO[bytes]], object], *, overwrite: bool) -> None:
    """Write a text, or what a function writes, in one step: if that fails, an old file stays as it is.

    Raises
    ------
    FileExistsRefusal
        If the file exists and ``overwrite`` is False.
    InputError
        If it cannot be written.
    """
    write = content if callable(content) else lambda stream: stream.write(content.encode())
    try:
        if path.exists() and not overwrite:
            raise FileExistsRefusal(f"{path} exists; pass overwrite=True to replace it")
        # of a link the file that it names is replaced
        target = path.resolve()
        if target.exists() and not target.is_file():
            # a device or a pipe cannot be replaced, and a folder is refused here
            whole = BytesIO()
            write(whole)
            target.write_bytes(whole.getvalue())
            return
        with moved_when_complete(target.parent) as beside:
            with (beside / target.name).open("xb") as stream:
                write(stream)
            if target.exists():
                (beside / target.name).chmod(target.stat().st_mode)
    except FileExistsRefusal:
        raise
    except (OSError, RuntimeError) as reason:  # the latter of links in a circle
        why = getattr(reason, "strerror", None) or reason
        raise InputError(f"{path}: cannot write there ({why}); choose a folder that is writable") from reason


def draw_whole(path: Path, draw: Callable[[IO[bytes]], object]) -> bool:
    """Write a picture as `write_whole` does. One that cannot be drawn costs a warning, and an old one is removed."""
    try:
        write_whole(path, draw, overwrite=True)
    except InputError:
        raise
    except Exception as reason:
        path.unlink(missing_ok=True)
        words = " ".join(f"{type(reason).__name__}: {reason}".split())
        warnings.warn(f"{path}: this picture cannot be drawn ({words}); all else is saved", stacklevel=2)
        return False
    return True


def regular_file(path: Path) -> Path:
    """The path, or an InputError if it names a pipe or a device, where reading may never end."""
    try:
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "a pipe or a device"
            raise InputError(f"{path}: cannot read {kind}; expected a file")
    except OSError as reason:  # of a name that is too long
        raise InputError(f"{path}: cannot read it ({reason.strerror}); expected a file") from reason
    return path


def text_of(path: Path) -> str:
    """The text of a file, or an InputError that says why there is none.

    Examples
    --------
    >>> text_of(Path("/dev/null"))
    Traceback (most recent call last):
    asperity.errors.InputError: /dev/null: cannot read a pipe or a device; expected a file
    """
    file = regular_file(path)
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", reason)
        raise InputError(f"{path}: cannot read it ({why}); expected a file of text") from reason


@contextmanager
def removed_on_failure(folder: Path | None) -> Iterator[None]:
    """Remove the folder, and those above it that were missing too, if the work in it fails and left no file there.

    Examples
    --------
    >>> with TemporaryDirectory() as parent:
    ...     try:
    ...         with removed_on_failure(Path(parent) / "a" / "b"):
    ...             (Path(parent) / "a" / "b").mkdir(parents=True)
    ...             raise KeyboardInterrupt
    ...     except KeyboardInterrupt:
    ...         list(Path(parent).iterdir())
    []
    """
    missing = [] if folder is None else [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    except BaseException:
        for path in missing:
            # a folder that holds something stays
            with suppress(OSError):
                path.rmdir()
        raise
