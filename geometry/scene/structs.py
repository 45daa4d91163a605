"""Named tuples in memory, which compiled functions read by one address.

numba passes an array as seven numbers or more, and this took most of the time of a compilation.
"""

from __future__ import annotations

from array import array
from ctypes import addressof, c_char
from typing import Any

import numpy as np


class Struct:
    """A named tuple of numbers, arrays, structs and named tuples, laid out in memory; see `compiled.tables`.

    The numbers in an array may change, the tuple may not.

    Attributes
    ----------
    values : named tuple
    address : int
        Of the words of 8 bytes in memory: of a number its bits, of an array the address of its data, of a struct its
        address, of a named tuple its words.

    Raises
    ------
    ValueError
        If an array is not contiguous.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> class Corner(NamedTuple):
    ...     x: float
    ...     is_smooth: bool
    >>> Struct(Corner(0.25, True)).values.x
    0.25
    """

    def __init__(self, values: Any) -> None:
        self.values = values
        self._words = array("q", _words(values))
        self.address, _ = self._words.buffer_info()

    def __reduce__(self) -> tuple[Any, ...]:
        # an address holds in one process only
        return Struct, (self.values,)


def _words(values: Any) -> list[int]:
    words = []
    for value in values:
        if isinstance(value, np.ndarray):
            if not value.flags.carray:
                raise ValueError("expected a contiguous array, got one with gaps; use numpy.require")
            # in a third of the time of the attribute ctypes of an array
            words.append(addressof(c_char.from_buffer(value.data)) if value.size else 0)
        elif isinstance(value, Struct):
            words.append(value.address)
        elif isinstance(value, tuple):
            words += _words(value)
        else:
            words.append(int(np.float64(value).view(np.int64)) if isinstance(value, float) else value)
    return words
