"""Options of the functions compiled for tracing. Loads numba.

The caller owns all arrays during a call. Counting references to arrays, an atomic operation in each function that
receives one, would cost a quarter of the time of a disk's collision. So these functions are compiled without numba's
run time: they allocate nothing, and they return arrays only to callers that count no references either. Passing an
array costs ten arguments, so small functions are inlined. Only functions that Python calls have a wrapper for it, which
takes as long to compile as the function.
"""

from __future__ import annotations

from typing import Any

from ....core.compilation import jit

OPTIONS: dict[str, Any] = {"_nrt": False}
compiled = jit(**OPTIONS)
# Options of functions that only compiled functions call.
INNER: dict[str, Any] = {**OPTIONS, "no_cpython_wrapper": True}
inner = jit(**INNER)
inlined = jit(**INNER, forceinline=True)
# With numba's run time, for functions that allocate; numba applies the option to all called functions.
ALLOCATING: dict[str, Any] = {**INNER, "_nrt": True}
allocating = jit(**ALLOCATING)
# Functions that no call by address reaches become machine code within their callers only.
linked = jit(linked=True, **INNER)
linked_allocating = jit(linked=True, **ALLOCATING)
