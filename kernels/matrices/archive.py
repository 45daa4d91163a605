"""Kernel matrices as files: an .npz archive with every field, exact to the last bit."""

from __future__ import annotations

import json
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...core.errors import FileExistsRefusal, InputError
from ..bases.basis import Basis
from ..bases.bins import Bins
from ..bases.legendre import Legendre
from ..bases.panels import Panels
from ..bases.tensor import TensorBasis

FORMAT, VERSION = "asperity kernel matrix", 1

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
    target = Path(path)
    if target.exists() and not overwrite:
        raise FileExistsRefusal(f"{target} exists; pass overwrite=True to replace it")
    record = {"format": FORMAT, "version": VERSION, **record, "basis": _described(basis, arrays, "basis")}
    try:
        arrays["record"] = np.array(json.dumps(record))
    except TypeError as reason:
        raise InputError(f"metadata: expected numbers, text, lists and dicts of these ({reason})") from reason
    try:
        _write_whole(target, arrays)
    except OSError as reason:
        raise InputError(f"cannot write {target}: {reason.strerror or reason}") from reason
    return target


def read(path: str | Path, restored: Callable[[Record, Arrays, Basis], T]) -> T:
    """What ``restored`` makes of the record, the arrays and the basis in a file that `write` wrote.

    Raises
    ------
    InputError
        If there is no such file, or it is not such a file.
    """
    source = Path(path)
    try:
        with source.open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            # numpy's: an archive has files, a single array has none
            if not hasattr(archive, "files") or "record" not in archive.files:
                raise InputError(f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save")
            arrays = {name: archive[name] for name in archive.files}
        record = json.loads(str(arrays["record"]))
        if not isinstance(record, dict) or record.get("format") != FORMAT:
            raise InputError(f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save")
        if record["version"] != VERSION:
            raise InputError(f"{source} has version {record['version']}, this asperity reads version {VERSION}")
        return restored(record, arrays, _basis_from(record["basis"], arrays))
    except InputError:
        raise
    except FileNotFoundError as reason:
        raise InputError(f"cannot read {source}: {reason.strerror}") from reason
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as reason:
        raise InputError(
            f"{source} is not a kernel matrix; expected a file written by KernelMatrix.save ({reason})"
        ) from reason


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


def _basis_from(described: dict[str, Any], arrays: Arrays) -> Basis:
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


def load_array(kind: str, arrays: Arrays, name: str) -> Any:
    """The array of a kind that `store_array` put there."""
    if kind == "dense":
        return arrays[name]
    from scipy.sparse import csr_array

    parts = tuple(arrays[f"{name}.{field}"] for field in ("data", "indices", "indptr"))
    return csr_array(parts, shape=tuple(arrays[f"{name}.shape"]))


def _write_whole(target: Path, arrays: Arrays) -> None:
    """Write beside the target and rename, so that a crash leaves no half of a file."""
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=target.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
