"""Kernel matrices outside of the package: as .npz files with every field, to the last bit, as .csv, as pictures."""

from __future__ import annotations

import json
import math
import warnings
import zipfile
from collections.abc import Callable
from operator import contains
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.lib import format as npy

from ...core.checks import SHOWN, Floats, check_memory, whole_number
from ...core.errors import InputError
from ...core.files import ending_in, regular_file, write_whole
from ...core.tables import axes_or_new, numbers_as_csv
from ..bases.basis import Basis, Frame
from ..bases.partitions import Bins, Panels
from ..bases.polynomials import Legendre
from ..bases.spaces import TensorBasis, Zernike

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT, VERSION = "asperity kernel matrix", 1
# Of a record, in characters; and of a byte of a deflated member, in bytes that it inflates to.
LONGEST_RECORD, DEFLATION = 2**24, 1032
# The reflection that keeps the angle, by convention.
SAME_ANGLE = {"paper": "retroreflection", "specular": "specular reflection"}
Record = dict[str, Any]
Arrays = dict[str, np.ndarray[Any, Any]]
T = TypeVar("T")


def write(path: str | Path, record: Record, arrays: Arrays, basis: Basis, *, overwrite: bool = False) -> Path:
    """Write a record of plain values, named arrays and a basis to exactly ``path``; the file appears when complete.

    Raises
    ------
    FileExistsRefusal
        If the file exists and ``overwrite`` is not given.
    InputError
        If the file cannot be written, the basis is of an unknown kind, or the record is not of plain JSON values.
    """
    target = ending_in(".npz", path)
    record = {"format": FORMAT, "version": VERSION, **record, "basis": _described(basis, arrays, "basis")}
    try:
        text = json.dumps(record)
    except (TypeError, ValueError, RecursionError) as reason:
        raise InputError(f"metadata: expected numbers, text, lists and dicts of these ({reason})") from reason
    if len(text) > LONGEST_RECORD:
        raise InputError(f"metadata: expected at most {LONGEST_RECORD} characters as JSON, got {len(text)}")
    arrays["record"] = np.array(text)
    write_whole(target, lambda stream: np.savez_compressed(stream, **arrays), overwrite=overwrite)  # type: ignore[arg-type]
    return target


def write_csv(path: str | Path, array: Floats, edges: Floats, facts: Record, *, overwrite: bool) -> Path:
    """Write probabilities between bins, with ``facts`` in comments and both edges of each bin in the first rows."""
    comments = [
        "asperity kernel matrix: probabilities of outgoing bins (columns) given the incoming bin (rows)",
        *(f"{name}: {value}" for name, value in facts.items()),
        f"convention of {facts['convention']!r}: theta_out = theta_in is {SAME_ANGLE[facts['convention']]}",
        "radians; rows: 0,0,lower edges; 0,0,upper edges; then both edges and the probabilities of each incoming bin",
    ]
    low, high = edges[:-1], edges[1:]
    heads = np.pad([low, high], ((0, 0), (2, 0)))
    rows = np.vstack([heads, np.column_stack([low, high, array])])
    write_whole(Path(path), numbers_as_csv(comments, rows.tolist()), overwrite=overwrite)
    return Path(path)


def read(path: str | Path, restored: Callable[[Record, Stored, Basis], T]) -> T:
    """What ``restored`` makes of the record, the arrays and the basis in a file that `write` wrote.

    Raises
    ------
    InputError
        If there is no such file, or it is not such a file.
    """
    source = Path(path)
    try:
        with regular_file(source).open("rb") as stream, zipfile.ZipFile(stream) as members:
            arrays = Stored(members, source.stat().st_size)
            record = json.loads(str(arrays.read("record", "U", ())))
            if not isinstance(record, dict) or record.get("format") != FORMAT:
                raise InputError(f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save")
            if record["version"] != VERSION or record["version"] is True:
                raise InputError(f"{source} has version {record['version']}, this asperity reads version {VERSION}")
            size = arrays.header("symmetric")[0][0]
            check_memory("symmetric", "the matrix", size**2)
            return restored(record, arrays, _basis_from(record["basis"], arrays, size))
    except FileNotFoundError as reason:
        raise InputError(f"cannot read {source}: {reason.strerror}") from reason
    # zipfile, zlib, json and numpy fail each in its own way on a damaged file
    except Exception as reason:
        if isinstance(reason, InputError) and str(source) in str(reason):
            raise
        raise InputError(
            f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save ({str(reason)[:SHOWN]})"
        ) from reason


class Stored:
    """The arrays in a zip archive, each inflated when it is asked for and not before its header is checked."""

    def __init__(self, members: zipfile.ZipFile, size: int) -> None:
        self._members, self._size = members, size

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._members.namelist()

    def header(self, name: str) -> tuple[tuple[int, ...], str]:
        """Shape and kind of an array, whose data are as long as they say and fit into the file."""
        info = self._members.getinfo(f"{name}.npy")
        # bzip2 and LZMA, which save does not use, inflate without limit
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name}: not an array as KernelMatrix.save writes it")
        with self._members.open(info) as stream, warnings.catch_warnings():
            # numpy and Python warn of headers that no save wrote
            warnings.simplefilter("error")
            if npy.read_magic(stream) != (1, 0):
                raise ValueError(f"{name}: not an array as KernelMatrix.save writes it")
            shape, _, dtype = npy.read_array_header_1_0(stream)
            size = math.prod(shape) * dtype.itemsize
            if info.file_size > DEFLATION * self._size or size != info.file_size - stream.tell():
                raise ValueError(f"{name}: {dtype} of shape {shape} does not have the size of its data")
        return shape, dtype.kind if dtype.kind == "U" else f"{dtype.kind}{dtype.itemsize}"

    def read(self, name: str, kinds: str, shape: tuple[int | range, ...]) -> np.ndarray[Any, Any]:
        """An array of one of the kinds and of a shape, of which a range allows several."""
        found, kind = self.header(name)
        allowed = [entry if isinstance(entry, range) else (entry,) for entry in shape]
        if kind not in kinds.split() or len(found) != len(shape) or not all(map(contains, allowed, found)):
            raise ValueError(f"{name}: expected {kinds} of shape {shape}, got {kind} of shape {found}")
        info = self._members.getinfo(f"{name}.npy")
        if kind == "U" and info.file_size > 4 * LONGEST_RECORD + npy.BUFFER_SIZE:
            raise ValueError(f"{name}: longer than any record")
        with self._members.open(info) as stream:
            return np.asarray(npy.read_array(stream, allow_pickle=False))


def _described(basis: Basis, arrays: Arrays, name: str) -> dict[str, Any]:
    if isinstance(basis, TensorBasis):
        factors = [_described(factor, arrays, f"{name}.{k}") for k, factor in enumerate(basis.factors)]
        return {"kind": "TensorBasis", "factors": factors}
    if isinstance(basis, Zernike):
        return {"kind": "Zernike", "degree": basis.degree}
    weight = basis.measure.name
    if isinstance(basis, Legendre):
        return {"kind": "Legendre", "n": basis.n, "weight": weight}
    if isinstance(basis, (Bins, Panels)):
        arrays[name] = basis.edges
        if isinstance(basis, Bins):
            return {"kind": "Bins", "edges": name, "weight": weight}
        return {"kind": "Panels", "edges": name, "degree": basis.degree, "weight": weight}
    raise InputError(f"basis: expected Bins, Legendre, Panels, a TensorBasis of these or Zernike, got {basis!r}")


def _basis_from(described: dict[str, Any], arrays: Stored, most: int) -> Basis:
    """The basis described, if it has at most so many functions."""
    kind = described["kind"]
    if kind == "TensorBasis":
        return TensorBasis(tuple(_basis_from(factor, arrays, most) for factor in described["factors"]))
    if kind == "Legendre":
        return Legendre(described["n"], described["weight"])
    if kind == "Zernike":
        return Zernike(whole_number("degree", described["degree"], 0, most=most))
    edges = arrays.read(described["edges"], "f8", (range(most + 2),))
    if kind == "Panels":
        return Panels(edges, whole_number("degree", described["degree"], 0, most=most), described["weight"])
    if kind != "Bins":
        raise ValueError(f"basis: expected Bins, Legendre, Panels, TensorBasis or Zernike, got {kind!r}")
    equal = Bins(edges.size - 1, described["weight"])
    # equal bins are shown by their number
    return equal if np.array_equal(equal.edges, edges) else Bins(edges, described["weight"])


# Atoms have densities up to the number of bins; with a square-root colour scale smaller densities remain visible.
COLOUR_POWER = 0.5
# Differences of the measures of bins below which they are equal to rounding.
EQUAL = 1e-12
TICKS = ([0.0, 0.5 * np.pi, np.pi], ["0", "π/2", "π"])


def draw_kernel(edges: Floats, density: Floats, frame: Frame, ax: Axes | None = None) -> Axes:
    """Draw the density of P(theta, d theta') with respect to the invariant measure on the cells between edges.

    A new figure is made unless ``ax`` is given. A dashed line shows retroreflection, a dotted line specular reflection.
    """
    from matplotlib.colors import PowerNorm

    ax = axes_or_new(ax, figsize=(5.6, 4.4))
    highest = float(density.max())
    norm = PowerNorm(COLOUR_POWER, vmin=0.0, vmax=highest if highest > 0.0 else 1.0)
    mesh = ax.pcolormesh(edges, edges, np.maximum(density, 0.0).T, cmap="viridis", norm=norm, rasterized=True)
    ends = np.array([0.0, np.pi])
    retro, specular = (ends, np.pi - ends) if frame == "paper" else (np.pi - ends, ends)
    ax.plot(ends, retro, color="white", alpha=0.6, linewidth=0.8, linestyle="--", label="retroreflection")
    ax.plot(ends, specular, color="white", alpha=0.6, linewidth=0.8, linestyle=":", label="specular")
    ax.set(xlim=(0.0, np.pi), ylim=(0.0, np.pi), aspect="equal")
    ax.set_xticks(*TICKS)
    ax.set_yticks(*TICKS)
    ax.set_xlabel("incoming angle θ (rad)")
    ax.set_ylabel("outgoing angle θ' (rad)")
    measure = -np.diff(np.cos(edges))
    bins = f" in {len(measure)} bins of equal measure" if np.ptp(measure) < EQUAL else ""
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(mesh, ax=ax, label=f"density{bins}\n(invariant measure sin θ' dθ'/2)")
    return ax
