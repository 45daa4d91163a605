"""The references of the standard set, stored by `campaigns.speed.references`, and those made for a wall of the user."""

from __future__ import annotations

import json
import time
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from ..core.child import ChildProcess
from ..kernels import WallLaw
from ..kernels.walls.wall_law import FEW_PIECES
from ..spectral import ReferenceValue
from ..spectral.bounds.images import is_traced
from .problems import methods_of, value_of
from .quantities.methods import AUTO, BEAMS, CLOSED_FORM, FLIGHTS, QMC, ROWS
from .quantities.walls import wall_of
from .run import scene_of

FILE = Path(__file__).with_name("standard_references.json")
# Budgets of the reference of a user's wall: of each method the finest that is done in time. Rays are more than in rows.
FINEST = {
    CLOSED_FORM: (1.0,), BEAMS: (1e4, 1e5, 1e6), ROWS: (1e3, 1e4, 1e6, 1e8), QMC: (4.0**9, 4.0**12),
    FLIGHTS: (1e2, 1e3, 1e4),
}  # fmt: skip
RAYS = (QMC, FLIGHTS)
# A reference that is farther from that of rays, in half widths of 95 %, has this distance as its error.
DISAGREE = 3.0


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


def made_references(name: str, child: ChildProcess, seconds: float) -> tuple[ReferenceValue, ...]:
    """References of a problem on a user's wall, the most exact first: the finest run of each method within ``seconds``.

    None is for its own method, nor for the library's choice if this may use that method; rays are for all, because no
    row has the same. Every other reference is checked by that of rays.
    """
    applicable = {method.name for method, _, _ in methods_of(name)}
    found = {method: _finest(name, method, child, seconds) for method in FINEST if method in applicable}
    (rays,) = (found.pop(method) for method in RAYS if method in found)
    checked = [one if rays is None else _beside(one, rays) for one in found.values() if one is not None]
    return tuple(sorted([*checked, *([] if rays is None else [rays])], key=lambda one: one.error))


def _finest(name: str, method: str, child: ChildProcess, seconds: float) -> ReferenceValue | None:
    """The value at the largest budget that is done in time and reports an error."""
    found, made_by = None, () if method in RAYS else (method, *_chooses(scene_of(name), method))
    child.start()
    end = time.monotonic() + seconds
    for budget in FINEST[method]:
        try:
            value, error, _ = child.call(value_of, name, method, budget, seconds=max(end - time.monotonic(), 0.0))
        except Exception:  # of the method, or of its process
            break
        if error is not None:
            # the checksum tells walls apart whose errors agree
            source = f"{method} with budget {budget:g}, checksum {crc32(np.asarray(value).tobytes()):08x}"
            found = ReferenceValue(value, error, source, made_by)
    return found


def _chooses(scene: str, method: str) -> tuple[str, ...]:
    """The name of the library's choice, if this may use the method."""
    wall = wall_of(scene)
    law = WallLaw(wall)
    # of these walls it takes the closed form or beams, whatever the tolerance
    exact = not law.has_traced_parts or (len(wall.pieces) <= FEW_PIECES and not is_traced(law))
    return () if method == ROWS and exact else (AUTO,)


def _beside(found: ReferenceValue, rays: ReferenceValue) -> ReferenceValue:
    """A reference, with its distance from that of rays as its error if they disagree."""
    distance = float(np.linalg.norm(found.value - rays.value))
    if distance <= found.error + DISAGREE * rays.error:
        return found
    return ReferenceValue(found.value, distance, f"{found.source}, not confirmed by rays", found.made_by)
