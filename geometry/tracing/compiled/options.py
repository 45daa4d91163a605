"""How the loops over flights are compiled. Loads numba.

Arrays belong to the caller for the whole run. To count references to them, an atomic operation at each function that
takes one, took a quarter of the time of the disk's collision: such functions are compiled without numba's run time.
They allocate nothing, and they return arrays only to callers that count no references either. Passing an array costs
ten arguments, so small functions are inlined.
"""

from __future__ import annotations

from typing import Any

from numba import njit

# A dictionary, because numba's annotations do not know all of the options.
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
compiled = njit(**OPTIONS)
inlined = njit(**OPTIONS, forceinline=True)
# With numba's run time, for functions that allocate: numba hands the option down to what a function calls.
allocating = njit(**{**OPTIONS, "_nrt": True})
