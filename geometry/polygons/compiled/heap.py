"""The heap of beams, with the beam of highest priority on top, and copies of beams: compiled. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...tracing.compiled.options import inlined
from .columns import PRIORITY, VERTEX_COLUMNS


class BeamTables(NamedTuple):
    """The tables of beams, see `columns`, and the heap of slots, whose size is stored elsewhere."""

    corners: Floats
    real: Floats
    whole: NDArray[np.int64]
    heap: NDArray[np.int64]


@inlined
def push(heap, size, real, slot):
    """Put a beam on the heap; return the new size of the heap."""
    i = size
    heap[i] = slot
    while i > 0:
        parent = (i - 1) // 2
        if real[heap[parent], PRIORITY] >= real[heap[i], PRIORITY]:
            break
        heap[parent], heap[i] = heap[i], heap[parent]
        i = parent
    return size + 1


@inlined
def pop(heap, size, real):
    """Remove the beam of highest priority from the heap; return its slot and the new size of the heap."""
    top = heap[0]
    size -= 1
    heap[0] = heap[size]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and real[heap[child + 1], PRIORITY] > real[heap[child], PRIORITY]:
            child += 1
        if real[heap[i], PRIORITY] >= real[heap[child], PRIORITY]:
            break
        heap[i], heap[child] = heap[child], heap[i]
        i = child
    return top, size


@inlined
def copied(slot, real, whole, new):
    """Copy the numbers of a beam, without its polygon, to a new slot."""
    for k in range(real.shape[1]):
        real[new, k] = real[slot, k]
    for k in range(whole.shape[1]):
        whole[new, k] = whole[slot, k]


@inlined
def put(polygon, count, corners, slot):
    """Write a polygon into the tables."""
    for j in range(count):
        for k in range(VERTEX_COLUMNS):
            corners[slot, j, k] = polygon[j, k]
