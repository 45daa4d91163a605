"""The references of the standard set, made once by ``python -m benchmarks.standard_references``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..spectral import ReferenceValue
from .kept_data import kept

FILE = Path(__file__).with_name("standard_references.json")


def known_reference(problem: str) -> ReferenceValue | None:
    """The reference of a problem SCENE/QUANTITY, or None where no independent one is known."""
    entry = kept(FILE.name).get(problem)
    if entry is None:
        return None
    value = np.asarray(entry["value"], dtype=np.float64)
    return ReferenceValue(_whole(value) if value.ndim else value, entry["error"], entry["source"])


def _whole(upper: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The symmetric matrix whose upper triangle is kept, row by row."""
    size = round((np.sqrt(8.0 * upper.size + 1.0) - 1.0) / 2.0)
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = upper
    return np.asarray(matrix + np.triu(matrix, 1).T)
