"""Files of the page: walls that the browser sends, walls and studies that it takes away or that a folder receives."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from ..core.errors import AsperityError, InputError
from ..geometry import Wall, wall_from_text
from ..study import study_wall
from .answers import Question

# Largest file that is opened, in bytes: a profile of a million points.
LARGEST = 64 * 2**20
LONGEST_NAME = 100
# Characters that stay in the names of files.
PLAIN = re.compile(r"[^A-Za-z0-9._-]+")


def opened(name: str, content: bytes, options: str = "") -> Wall:
    """The wall of a file that the browser sent: a wall file, or a profile with options as on the command line.

    Parameters
    ----------
    name : str
        Its ending tells the kind.
    content : bytes
    options : str
        Of a profile, as ``"seam=step,units=um/nm"``.

    Raises
    ------
    InputError
        If the file cannot be read, or its wall violates a condition.

    Examples
    --------
    >>> opened("wall.toml", b"period = 1.0\\nvertices = [[0, 0], [0.2, -0.4], [1, 0]]").depth
    0.4
    """
    if len(content) > LARGEST:
        raise InputError(f"{name}: expected at most {LARGEST} bytes, got {len(content)}; thin the profile out")
    # readers of instruments want a file with its own ending; this one is private and gone at once
    with TemporaryDirectory(prefix="asperity-") as folder:
        file = Path(folder) / plain_name(name)
        file.write_bytes(content)
        try:
            return wall_from_text(f"{file}:{options}" if options.strip() else str(file))
        except AsperityError as reason:
            raise InputError(str(reason).replace(str(file), name).replace(f"{folder}/", "")) from reason


def plain_name(name: str) -> str:
    """A name without folders and without characters that shells or file systems treat in their own manner.

    Examples
    --------
    >>> plain_name("../my wall:angle=0.7.toml"), plain_name("..")
    ('my-wall-angle-0.7.toml', 'wall')
    """
    last = name.replace("\\", "/").rpartition("/")[2]
    # the ending tells the kind, and file systems bear 255 bytes
    return PLAIN.sub("-", last[-LONGEST_NAME:]).strip(".-") or "wall"


def wall_as_toml(wall: Wall) -> bytes:
    """The content of a wall file.

    Examples
    --------
    >>> from asperity.geometry import triangular_teeth
    >>> opened("wall.toml", wall_as_toml(triangular_teeth(0.7))) == triangular_teeth(0.7)
    True
    """
    with TemporaryDirectory(prefix="asperity-") as folder:
        file = Path(folder) / "wall.toml"
        wall.save(file)
        return file.read_bytes()


def studied(question: Question) -> Iterator[bytes]:
    """Study the wall, and give the files of the study with the wall as one zip archive."""
    report = study_wall(question.seen, question.name, question.disk, facets=question.facets, progress=False)
    archive = io.BytesIO()
    with TemporaryDirectory(prefix="asperity-") as folder, zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as whole:
        question.seen.save(Path(folder) / "wall.toml")
        report.save(folder)
        for file in sorted(Path(folder).iterdir()):
            whole.write(file, file.name)
    yield archive.getvalue()


def new_folder(parent: Path, name: str) -> Path:
    """Make a folder of this name, or with the first free number after it: what is there stays as it is.

    Examples
    --------
    >>> with TemporaryDirectory() as parent:
    ...     new_folder(Path(parent), "teeth").name, new_folder(Path(parent), "teeth").name
    ('teeth', 'teeth-2')
    """
    number = 1
    while True:
        folder = parent / (plain_name(name) if number == 1 else f"{plain_name(name)}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
        except OSError as reason:
            raise InputError(f"{folder}: cannot write there ({reason.strerror}); choose another --out") from reason
        else:
            return folder


def unpacked(archive: bytes, parent: Path, name: str) -> Path:
    """Write the files of an archive of `studied` into a new folder."""
    folder = new_folder(parent, name)
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as whole:
            whole.extractall(folder)
    except OSError as reason:
        raise InputError(f"{folder}: cannot write there ({reason.strerror}); choose another --out") from reason
    return folder
