"""Larger copies of arrays that grow in compiled functions; plain loops, which compile faster than concatenation."""

from __future__ import annotations

import numpy as np

from .options import linked_allocating


@linked_allocating
def longer(array, size):
    """Return a copy with ``size`` entries; the new ones are not set."""
    new = np.empty(size, array.dtype)
    for i in range(array.shape[0]):
        new[i] = array[i]
    return new


@linked_allocating
def append(array, begin, source, count):
    """Copy the first ``count`` entries of ``source`` to ``array``, from ``begin`` on."""
    for i in range(count):
        array[begin + i] = source[i]


@linked_allocating
def taller(array, rows):
    """Return a copy with ``rows`` rows; the new ones are zero."""
    new = np.zeros((rows, array.shape[1]), array.dtype)
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            new[i, j] = array[i, j]
    return new


@linked_allocating
def larger(array, rows, columns):
    """Return a copy with ``rows`` rows and ``columns`` columns; the new entries are not set."""
    new = np.empty((rows, columns, array.shape[2]))
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            for k in range(array.shape[2]):
                new[i, j, k] = array[i, j, k]
    return new
