"""Options of the functions compiled for tracing. Loads numba.

The caller owns all arrays during a call. Counting references to arrays, an atomic operation in each function that
receives one, would cost a quarter of the time of a disk's collision. So these functions are compiled without numba's
run time: they allocate nothing, and they return arrays only to callers that count no references either. Passing an
array costs ten arguments, so small functions are inlined. Only functions that Python calls have a wrapper for it, which
takes as long to compile as the function.
"""

from __future__ import annotations

from .....core.compilation import jit

compiled = jit(_nrt=False)
# For functions that only compiled functions call.
inner = jit(_nrt=False, no_cpython_wrapper=True)
inlined = jit(_nrt=False, forceinline=True)
# With numba's run time, for functions that allocate; numba applies the option to all called functions.
allocating = jit(_nrt=True, no_cpython_wrapper=True)
# Functions that no call by address reaches become machine code within their callers only.
linked = jit(_nrt=False, linked=True)
linked_allocating = jit(_nrt=True, linked=True)
