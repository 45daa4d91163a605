"""The stored references of the standard set, which `campaigns.standard_references` writes."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..spectral import ReferenceValue

FILE = Path(__file__).with_name("standard_references.json")


@cache
def _stored() -> dict[str, Any]:
    table: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return table


def known_reference(problem: str) -> ReferenceValue | None:
    """The reference of a problem SCENE/QUANTITY, or None if no independent reference is known."""
    entry = _stored().get(problem)
    if entry is None:
        return None
    value = np.asarray(entry["value"], dtype=np.float64)
    return ReferenceValue(_whole(value) if value.ndim else value, entry["error"], entry["source"])


def _whole(upper: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The symmetric matrix with the given upper triangle, in row order."""
    size = round((np.sqrt(8.0 * upper.size + 1.0) - 1.0) / 2.0)
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = upper
    return np.asarray(matrix + np.triu(matrix, 1).T)
