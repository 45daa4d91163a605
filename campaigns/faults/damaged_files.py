"""Files with random damage: each must be read as it stands or be refused, without a warning and in little memory.

Bytes are cut off, changed or added, or the parsed file has an entry left out, repeated, added, or replaced by a value
of another type, NaN, an infinity, a huge or a negative number; an array gets another type, shape or entry, or inflates
to a thousand times its size. A file that is read must give what it says, and the same after saving and reading again.
"""

from __future__ import annotations

import io
import json
import math
import tomllib
import tracemalloc
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomli_w

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AsperityError
from campaigns.engine import Campaign, Judged

# Bytes that reading a small file may take, of which the search for crossings takes up to 60 MB; the files are below
# 100 kB. A bomb is an array of so many zeros a side, 128 MB.
ALLOWED, BOMB = 100 * 2**20, 4000
# What the type of an array may become, an entry of it, and any other value.
TYPES = ("f4", "f2", "c16", "U9", "S9", "O", "i8", "u8", "i2", "?", "M8[s]", "m8[s]", "V8", ">f8")
ENTRIES = (math.nan, math.inf, 1e308, -1e308, -1.0, 2.0**62)
OTHERS: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 10**30, 10**400, -1, 0, 1, True, False, "", "1", "nan", [], {},
    [1.0, 2.0], {"a": 1}, 1e-320, 0.5, 1e200, "inf", "1e400", "-1e400", "1_0", "0x10", "abc", "1;2", "1,5", "١", "#",
    "\0",
)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """Files of one format: valid contents, how to parse and write them, and the reading, which says what is wrong."""

    name: str
    contents: tuple[bytes, ...]
    parse: Callable[[bytes], Any]
    write: Callable[[Any], bytes]
    read: Callable[[Path], str | None]


def pick(rng: np.random.Generator, values: Any) -> Any:
    return values[int(rng.integers(len(values)))]


def damaged(rng: np.random.Generator, value: Any) -> Any:
    """Another value; of a list or dict mostly itself, with one entry left out, repeated, added or damaged."""
    if isinstance(value, np.ndarray):
        return damaged_array(rng, value)
    if not isinstance(value, (list, dict)) or not value or rng.random() < 0.1:
        return pick(rng, OTHERS)
    key = pick(rng, list(value) if isinstance(value, dict) else range(len(value)))
    draw = rng.integers(8)
    if draw == 0:
        del value[key]
    elif draw > 1:
        value[key] = damaged(rng, value[key])
    elif isinstance(value, dict):
        value["extra"] = damaged(rng, value[key])
    else:
        value.insert(key, value[key])
    return value


def damaged_array(rng: np.random.Generator, array: Any) -> Any:
    """Another type, shape or entry, a bomb, or the file of an array whose header promises more."""
    draw = rng.integers(5)
    if draw == 0:
        kind = pick(rng, TYPES)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return array.astype(kind)
            except (TypeError, ValueError):
                return np.zeros(array.shape, kind)
    if draw == 1:
        return pick(rng, (array.ravel()[:-1], array[..., None], array.ravel(), array.T[None], array.ravel()[:0]))
    if draw == 2:
        return np.zeros(pick(rng, ((BOMB, BOMB), BOMB**2)))
    if draw == 3:
        stream = io.BytesIO()
        np.lib.format.write_array_header_2_0(stream, {"shape": (10**6, 10**6), "fortran_order": False, "descr": "<f8"})
        return stream.getvalue() + array_file(array)
    with np.errstate(invalid="ignore"):
        array = array.copy()
        array.reshape(-1)[rng.integers(array.size)] = np.array(pick(rng, ENTRIES)).astype(array.dtype)
    return array


def damaged_bytes(rng: np.random.Generator, content: bytes) -> bytes:
    """Cut off, change or add bytes."""
    data = bytearray(content)
    at = int(rng.integers(len(data)))
    draw = rng.integers(4)
    if draw == 0:
        return bytes(data[:at])
    if draw == 1:
        data[at] ^= 1 << int(rng.integers(8))
    elif draw == 2:
        data[at : at + int(rng.integers(1, 50))] = rng.bytes(int(rng.integers(50)))
    else:
        data += rng.bytes(int(rng.integers(1, 200)))
    return bytes(data)


def saved(objects: Iterable[Any], name: str) -> tuple[bytes, ...]:
    """The contents of their files."""
    contents = []
    with TemporaryDirectory() as folder:
        for thing in objects:
            thing.save(Path(folder) / name, overwrite=True)
            contents.append((Path(folder) / name).read_bytes())
    return tuple(contents)


# matrices


def parsed_archive(content: bytes) -> dict[str, Any]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: np.load(io.BytesIO(archive.read(name))) for name in archive.namelist()}
    return {**members, "record.npy": json.loads(str(members["record.npy"]))}


def archive_of(members: Any) -> bytes:
    """The archive; anything but arrays and their files is written as a text of JSON, as the record is."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, value in members.items() if isinstance(members, dict) else ():
            text = value if isinstance(value, (np.ndarray, bytes)) else np.array(json.dumps(value))
            archive.writestr(name, text if isinstance(text, bytes) else array_file(text))
    return whole.getvalue()


def array_file(array: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def read_matrix(path: Path) -> str | None:
    matrix = ker.load_matrix(path)
    again = path.with_suffix(".again.npz")
    matrix.save(again, overwrite=True)
    there, here = zipfile.ZipFile(path), zipfile.ZipFile(again)
    for name in here.namelist():
        first, second = (np.load(io.BytesIO(file.read(name))) for file in (there, here))
        if name == "record.npy":
            mine, yours = json.loads(str(second), parse_int=float), json.loads(str(first), parse_int=float)
            # a file without "beyond", as there were, has None
            if any(repr(mine[key]) != repr(yours.get(key)) for key in mine if key != "basis"):
                return "another record"
        elif not np.array_equal(first, second):
            return f"another array {name}"
    return None


def matrices() -> Kind:
    law = ker.CircularArcLaw(0.1)
    found = (
        ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins(6)),
        ker.discretise(ker.TriangularTeethLaw(0.7), ker.Bins([0.0, 1.0, 2.5, math.pi])),
        ker.discretise(law, ker.Bins(4), method="qmc", samples=512),
        ker.discretise(law, ker.Bins(40), method="qmc", samples=512),
        ker.discretise(law, ker.Bins(4), method="monte-carlo", samples=512),
        ker.discretise(ker.lambertian(), ker.Panels([0.0, 1.0, math.pi], 2)),
        ker.discretise(ker.henyey_greenstein(0.5), ker.Legendre(4)).tensor(
            ker.discretise(ker.lambertian(), ker.Bins(2))
        ),
    )
    return Kind("matrix.npz", saved(found, "matrix.npz"), parsed_archive, archive_of, read_matrix)


# walls


def parsed_document(content: bytes) -> Any:
    return tomllib.loads(content.decode())


def document_of(document: Any) -> bytes:
    return tomli_w.dumps(document if isinstance(document, dict) else {}).encode()


def read_wall(path: Path) -> str | None:
    wall = geo.load_wall(path)
    again = path.with_suffix(".again.toml")
    wall.save(again, overwrite=True)
    if geo.load_wall(again) != wall:
        return "another wall after it was saved"
    if not (np.isfinite(wall.vertices).all() and math.isfinite(wall.arc_length) and math.isfinite(wall.depth)):
        return "no finite wall"
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    if type(document["period"]) is bool or wall.period != document["period"]:
        return "another period"
    if "vertices" in document and not np.allclose(wall.vertices, document["vertices"], rtol=1e-12, atol=1e-12):
        return "other vertices"
    return None


def walls() -> Kind:
    found = [entry.build() for name, entry in geo.WALLS.items() if name != "koch"]
    island = [geo.Arc((0.3, -0.4), (0.1, 0.2), 0, 2 * math.pi)]
    found.append(geo.Wall([geo.Segment((0, -1), (1, -1))], islands=[island]))
    bezier = geo.Bezier([(0.1, -0.7), (0.3, -2 / 3), (0.4, -1), (1, 0)])
    found.append(geo.Wall([geo.Segment((0, 0), (0.1, -0.7)), bezier], unit="µm"))
    found.append(geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (0.5, -0.1), (1, 0)]))
    return Kind("wall.toml", saved(found, "wall.toml"), parsed_document, document_of, read_wall)


# profiles


def words_of(content: bytes) -> list[list[str]]:
    return [line.split(" ") for line in content.decode().splitlines()]


def lines_of(words: Any) -> bytes:
    lines = words if isinstance(words, list) else [words]
    return "\n".join(" ".join(map(str, line)) if isinstance(line, list) else str(line) for line in lines).encode()


def read_profile(path: Path) -> str | None:
    """Positions are those that Python reads in the same lines; a height that no word of the file is, is undefined."""
    profile = geo.read_profile(path)
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    numbers = {
        value for word in text.replace(",", " ").replace(";", " ").split() if (value := number(word)) is not None
    }
    if not np.isfinite(profile.x).all() or not {*profile.x.tolist()} <= numbers:
        return "other positions"
    heights = profile.height[np.isfinite(profile.height)].tolist()
    scaled = {value / scale for value in numbers for scale in (1, 1000)}
    if not all(
        any(math.isclose(value, height, rel_tol=1e-9, abs_tol=1e-300) for value in scaled) for height in heights
    ):
        return "other heights"
    if profile.undefined and "1e400" in text:
        return "a number too large for a double is undefined"
    return None


def number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def profiles() -> Kind:
    rows = "\n".join(f"{0.5 * k} {math.sin(k):.4f}" for k in range(12))
    contents = (rows, f"# a scan\nx height\n{rows}", f"x [um], height [nm]\n{rows}", rows.replace(" ", "; "))
    return Kind("profile.txt", tuple(map(str.encode, contents)), words_of, lines_of, read_profile)


def draw(number: int) -> tuple[Kind, bytes, str]:
    """Files of each format in turn: first the valid contents, then a damaged one."""
    kind, number = kinds()[number % 3], number // 3
    if number < len(kind.contents):
        return kind, kind.contents[number], "none"
    rng = np.random.default_rng([0, number])
    content = pick(rng, kind.contents)
    if rng.random() < 0.3:
        return kind, damaged_bytes(rng, content), "of bytes"
    return kind, kind.write(damaged(rng, kind.parse(content))), "of an entry"


def judge(case: tuple[Kind, bytes, str]) -> Iterator[Judged]:
    """Whether the file is refused, or read as it stands, without a warning and in little memory."""
    kind, content, damage = case
    outcome, fault = "read", None
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        path = Path(folder) / kind.name
        path.write_bytes(content)
        warnings.simplefilter("error")
        tracemalloc.start()
        try:
            fault = kind.read(path)
        except AsperityError as reason:
            outcome = "refused"
            if damage == "none" or len(str(reason)) >= 1000:
                fault = f"{reason}"
        except UserWarning as reason:
            outcome = "read, and told how"
            if "readable in one way alone" not in str(reason):
                fault = f"{reason}"
        except Exception as reason:
            fault = f"{type(reason).__name__}: {reason}"
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
    if peak >= ALLOWED:
        fault = f"{peak / 2**20:.0f} MB of memory"
    yield Judged(kind.name, fault=f"damage {damage}: {fault}" if fault else "", outcome=outcome)


@cache
def kinds() -> tuple[Kind, Kind, Kind]:
    """The three formats."""
    return matrices(), walls(), profiles()


CAMPAIGNS = (
    Campaign("damaged-files", "Is a damaged file refused, or read as it stands?", draw, judge, 7000, range(121)),
)
