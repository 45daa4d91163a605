"""Records: numbers and arrays that compiled functions find by one address.

numba passes an array as seven numbers or more, and a named tuple as those of all its arrays, to every function that
receives it; this took most of the time of a compilation. A record is passed as one address.
"""

from __future__ import annotations

from typing import Any

import numpy as np


class Record:
    """The fields of a named tuple, laid out in memory for compiled functions.

    In Python the fields are attributes, as those of the tuple. In compiled functions, too, and ``address``; there a
    record has the type that `compiled.records` gives it, and keeps in ``type``. Fields are numbers, contiguous arrays
    of one axis, contiguous tables of float64, and records. The numbers in an array may change, the fields may not.

    Attributes
    ----------
    values : named tuple
    kind : tuple
        What the type depends on: the class of the tuple, and for every field the class of a number, the kind of a
        record, or the element, the number of axes and the last length (0 with one axis) of an array.
    address : int
        Of the words of 8 bytes in memory: for a number its bits, for a record its address, and for an array the address
        of its data and the length of its first axis.

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
    >>> Record(Corner(0.25, True)).x
    0.25
    """

    values: Any
    kind: tuple[Any, ...]
    address: int
    type: Any = None

    def __init__(self, values: Any) -> None:
        words: list[Any] = []
        kinds: list[Any] = [type(values)]
        for value in values:
            if isinstance(value, np.ndarray):
                if not value.flags.carray:
                    raise ValueError("expected a contiguous array, got one with gaps; use numpy.require")
                words += (value.ctypes.data, len(value))
                kinds.append((value.dtype.char, value.ndim, value.shape[1] if value.ndim == 2 else 0))
            elif isinstance(value, Record):
                words.append(value.address)
                kinds.append(value.kind)
            else:
                words.append(np.float64(value).view(np.int64) if isinstance(value, float) else value)
                kinds.append(type(value))
        self.values, self.kind = values, tuple(kinds)
        self._words = np.array(words, np.int64)
        self.address = self._words.ctypes.data

    def __getattr__(self, name: str) -> Any:
        if name == "values":
            # before it is set, as in a copy
            raise AttributeError(name)
        return getattr(self.values, name)

    def __reduce__(self) -> tuple[Any, ...]:
        # an address holds in one process only
        return Record, (self.values,)
