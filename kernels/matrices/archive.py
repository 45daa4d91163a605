"""Kernel matrices as files: an .npz archive with every field, exact to the last bit."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.lib import format as npy

from ...core.errors import InputError
from ...core.files import regular_file, write_whole
from ..bases.basis import Basis
from ..bases.bins import Bins
from ..bases.legendre import Legendre
from ..bases.panels import Panels
from ..bases.tensor import TensorBasis

FORMAT, VERSION = "asperity kernel matrix", 1

Record = dict[str, Any]
Arrays = dict[str, np.ndarray[Any, Any]]
Stored = Mapping[str, np.ndarray[Any, Any]]
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
    target = Path(path)
    record = {"format": FORMAT, "version": VERSION, **record, "basis": _described(basis, arrays, "basis")}
    try:
        arrays["record"] = np.array(json.dumps(record))
    except TypeError as reason:
        raise InputError(f"metadata: expected numbers, text, lists and dicts of these ({reason})") from reason
    write_whole(target, lambda stream: np.savez_compressed(stream, **arrays), overwrite=overwrite)  # type: ignore[arg-type]
    return target


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
            arrays = _Members(members)
            record = json.loads(str(arrays["record"]))
            if not isinstance(record, dict) or record.get("format") != FORMAT:
                raise InputError(f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save")
            if record["version"] != VERSION:
                raise InputError(f"{source} has version {record['version']}, this asperity reads version {VERSION}")
            return restored(record, arrays, _basis_from(record["basis"], arrays))
    except FileNotFoundError as reason:
        raise InputError(f"cannot read {source}: {reason.strerror}") from reason
    # zipfile, zlib, json and numpy fail each in its own way on a damaged file
    except Exception as reason:
        if isinstance(reason, InputError) and str(source) in str(reason):
            raise
        raise InputError(
            f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save ({reason})"
        ) from reason


class _Members(Mapping[str, np.ndarray[Any, Any]]):
    """The arrays in a zip archive, each inflated when it is asked for and not before its header is checked."""

    def __init__(self, members: zipfile.ZipFile) -> None:
        self._members = members

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        info = self._members.getinfo(f"{name}.npy")
        with self._members.open(info) as stream:
            if npy.read_magic(stream) != (1, 0):
                raise ValueError(f"{name}: not an array as KernelMatrix.save writes it")
            shape, _, dtype = npy.read_array_header_1_0(stream)
            if (
                dtype.kind not in ("U" if name == "record" else "iuf")
                or math.prod(shape) * dtype.itemsize != info.file_size - stream.tell()
            ):
                raise ValueError(f"{name}: {dtype} of shape {shape} does not have the size of its data")
        with self._members.open(info) as stream:
            return np.asarray(npy.read_array(stream, allow_pickle=False))

    def __iter__(self) -> Iterator[str]:
        return (name.removesuffix(".npy") for name in self._members.namelist())

    def __len__(self) -> int:
        return len(self._members.namelist())


def _described(basis: Basis, arrays: Arrays, name: str) -> dict[str, Any]:
    if isinstance(basis, TensorBasis):
        factors = [_described(factor, arrays, f"{name}.{k}") for k, factor in enumerate(basis.factors)]
        return {"kind": "TensorBasis", "factors": factors}
    weight = basis.measure.name
    if isinstance(basis, Legendre):
        return {"kind": "Legendre", "n": basis.n, "weight": weight}
    if isinstance(basis, (Bins, Panels)):
        arrays[name] = basis.edges
        if isinstance(basis, Bins):
            return {"kind": "Bins", "edges": name, "weight": weight}
        return {"kind": "Panels", "edges": name, "degree": basis.degree, "weight": weight}
    raise InputError(f"basis: expected Bins, Legendre, Panels or a TensorBasis of these, got {basis!r}")


def _basis_from(described: dict[str, Any], arrays: Stored) -> Basis:
    kind = described["kind"]
    if kind == "TensorBasis":
        return TensorBasis(tuple(_basis_from(factor, arrays) for factor in described["factors"]))
    if kind == "Legendre":
        return Legendre(described["n"], described["weight"])
    edges = arrays[described["edges"]]
    if kind == "Panels":
        return Panels(edges, described["degree"], described["weight"])
    equal = Bins(edges.size - 1, described["weight"])
    # equal bins are known by their number, which also makes finding a bin faster
    return equal if np.array_equal(equal.edges, edges) else Bins(edges, described["weight"])


def store_array(part: Any, arrays: Arrays, name: str) -> str:
    """Put a dense or sparse array among named arrays; returns its kind."""
    if isinstance(part, np.ndarray):
        arrays[name] = part
        return "dense"
    arrays[f"{name}.data"], arrays[f"{name}.indices"], arrays[f"{name}.indptr"] = part.data, part.indices, part.indptr
    arrays[f"{name}.shape"] = np.array(part.shape)
    return "sparse"


def load_array(kind: str, arrays: Stored, name: str) -> Any:
    """The array of a kind that `store_array` put there."""
    if kind == "dense":
        return arrays[name]
    from scipy.sparse import csr_array

    data, indices, indptr = (arrays[f"{name}.{field}"] for field in ("data", "indices", "indptr"))
    if indices.dtype.kind != "i" or indptr.dtype.kind != "i" or not data.size == indices.size == indptr[-1]:
        raise ValueError(f"{name}: expected as many indices as entries, {data.size}, all whole numbers")
    rows, columns = arrays[f"{name}.shape"].tolist()
    part = csr_array((data, indices, indptr), shape=(rows, columns))
    # compiled code trusts the indices
    part.check_format(full_check=True)
    return part
