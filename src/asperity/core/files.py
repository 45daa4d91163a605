"""Files that appear whole: written beside their name and moved there when complete."""

from __future__ import annotations

import os
import stat
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

from .checks import DOUBLE, check_memory
from .errors import FileExistsRefusal, InputError

# Endings of formats in which a reader would expect a file to be.
OTHER_FORMATS = {".csv", ".dat", ".h5", ".hdf5", ".json", ".mat", ".npy", ".npz", ".pdf", ".pickle", ".pkl", ".png",
                 ".toml", ".tsv", ".txt", ".xlsx", ".yaml", ".yml"}  # fmt: skip


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
            # a device or a pipe cannot be replaced; a folder and a pipe that nothing reads are refused here
            whole = BytesIO()
            write(whole)
            handle = os.open(target, os.O_WRONLY | os.O_NONBLOCK)
            os.set_blocking(handle, True)
            with open(handle, "wb") as stream:
                stream.write(whole.getvalue())
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


def check_writable(path: Path) -> None:
    """Refuse a new file that cannot be written, before the work for it is done.

    Examples
    --------
    >>> check_writable(Path("/dev/null/wall.toml"))
    Traceback (most recent call last):
    asperity.errors.InputError: /dev/null/wall.toml: cannot write there (Not a directory); choose another folder
    """
    try:
        if not path.exists():
            TemporaryDirectory(dir=path.parent, prefix=".asperity-").cleanup()
    except OSError as reason:
        raise InputError(f"{path}: cannot write there ({reason.strerror}); choose another folder") from reason


def ending_in(suffix: str, path: str | os.PathLike[str]) -> Path:
    """The path of a file to be written, or an InputError if its name promises another format.

    Examples
    --------
    >>> ending_in(".npz", "kernel.csv")
    Traceback (most recent call last):
    asperity.errors.InputError: kernel.csv: expected a name that ends in .npz; pass 'kernel.npz'
    """
    file = Path(path)
    if file.suffix.lower() in OTHER_FORMATS - {suffix}:
        raise InputError(f"{file}: expected a name that ends in {suffix}; pass {str(file.with_suffix(suffix))!r}")
    return file


def regular_file(path: Path) -> Path:
    """The path, or an InputError if it names a pipe or a device, where reading may never end, or nothing to be read.

    Files of the system, as in /proc, have no size; reading some of them waits for ever.
    """
    if "\0" in str(path):
        raise InputError(f"path: expected the name of a file, got {str(path)!r}")
    try:
        status = path.stat() if path.exists() else None
    except OSError as reason:  # of a name that is too long
        raise InputError(f"{path}: cannot read it ({reason.strerror}); expected a file") from reason
    if status is None:
        return path
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe or a device"
        raise InputError(f"{path}: cannot read {kind}; expected a file")
    if status.st_size == 0:
        raise InputError(f"{path}: cannot read a file of 0 bytes; expected one with content")
    check_memory(str(path), "its content", status.st_size // DOUBLE)
    return path


def text_of(path: Path, encoding: str = "utf-8") -> str:
    """The text of a file, or an InputError that says why there is none.

    Examples
    --------
    >>> text_of(Path("/dev/null"))
    Traceback (most recent call last):
    asperity.errors.InputError: /dev/null: cannot read a pipe or a device; expected a file
    """
    file = regular_file(path)
    try:
        with warnings.catch_warnings():
            # some codecs warn of what they cannot read
            warnings.simplefilter("error")
            return file.read_text(encoding=encoding)
    except (OSError, UnicodeDecodeError) as reason:
        why = getattr(reason, "strerror", reason)
        raise InputError(f"{path}: cannot read it ({why}); expected a file of text") from reason
    except (LookupError, TypeError, ValueError, Warning) as reason:
        raise InputError(f"encoding: expected the name of one such as 'latin-1', got {encoding!r}") from reason


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
    missing = [] if folder is None else [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        yield
    except BaseException:
        for path in missing:
            # a folder that holds something stays
            with suppress(OSError):
                path.rmdir()
        raise
