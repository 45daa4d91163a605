"""Files that are replaced whole: a reader finds the old content or the new one, whatever happens in between."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from .errors import InputError


def write_whole(path: str | Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` make a file beside ``path``, which then takes its place.

    Raises
    ------
    InputError
        If the file cannot be written; what was there before is unharmed.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_whole(Path(folder) / "a.txt", lambda path: path.write_text("new"))
    ...     sorted(file.name for file in Path(folder).iterdir())
    ['a.txt']
    """
    target = Path(path)
    temporary = None
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=target.name, suffix=".part" + target.suffix)
        os.close(handle)
        temporary = Path(name)
        write(temporary)
        # mkstemp lets nobody else read; a new file is as open as the user's mask says
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, target)
    except OSError as reason:
        raise InputError(f"{target}: cannot write there ({reason}); free space or choose another folder") from reason
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
