"""Options of the functions compiled for tracing. Loads numba.

The caller owns all arrays during a call. Counting references to arrays, an atomic operation in each function that
receives one, would cost a quarter of the time of a disk's collision. So these functions are compiled without numba's
run time: they allocate nothing, and they return arrays only to callers that count no references either. Passing an
array costs ten arguments, so small functions are inlined.
"""

from __future__ import annotations

from typing import Any

from numba import njit

# A dictionary, because numba's annotations do not contain all of these options.
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
compiled = njit(**OPTIONS)
inlined = njit(**OPTIONS, forceinline=True)
# With numba's run time, for functions that allocate; numba applies the option to all called functions.
allocating = njit(**{**OPTIONS, "_nrt": True})
