"""How functions are compiled for tracing, and called by their address. Loads numba.

The caller owns all arrays during a call. Counting references to arrays, an atomic operation in each function that
receives one, would cost a quarter of the time of a disk's collision. So these functions are compiled without numba's
run time: they allocate nothing, and they return arrays only to callers that count no references either. Passing an
array costs ten arguments, so small functions are inlined.

numba copies all called functions into a function and optimises them again, at every level. A large function that is
called from many places, or seldom, is compiled once instead and called by its address. A function that few walls need
is not compiled before the first call: compiled code then calls back into Python, which compiles or loads it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .....core.compilation import is_stored, jit

compiled = jit(_nrt=False)
# For functions that only compiled functions call.
inner = jit(_nrt=False, no_cpython_wrapper=True)
inlined = jit(_nrt=False, forceinline=True)
# With numba's run time, for functions that allocate; numba applies the option to all called functions.
allocating = jit(_nrt=True, no_cpython_wrapper=True)
# Functions that no call by address reaches become machine code within their callers only.
linked = jit(_nrt=False, linked=True)
linked_allocating = jit(_nrt=True, linked=True)

Result = TypeVar("Result")


class Late:
    """A function that is compiled or loaded, for arguments of some types, when compiled code first calls it.

    ``slot`` is the address of two numbers in memory: the address of the function, 0 before the first call, and the
    address of the call into Python that finds it.

    Compiled code cannot pass on an exception of that call, as of Ctrl-C during the compilation. It goes on with wrong
    results then, and `checked` raises the exception.
    """

    failures: ClassVar[list[BaseException]] = []

    def __init__(self, function: Any, *kinds: Any) -> None:
        self._function, self._kinds = function, kinds
        self._callback = ctypes.CFUNCTYPE(ctypes.c_int64)(self.load)
        self._words = np.array([0, ctypes.cast(self._callback, ctypes.c_void_p).value], np.int64)
        self._uses, self._stored = 0, False
        self.slot = int(self._words.ctypes.data)

    def is_worth(self, uses: int, enough: int) -> bool:
        """Return whether to call the function ``uses`` times: once it is loaded, stored, or wanted ``enough`` times.

        So no compilation takes longer than the work for which the function is wanted.
        """
        self._uses += uses
        if self._words[0] == 0 and self._uses < enough and not self._stored:
            self._stored = is_stored(self._function)
        return bool(self._words[0] != 0 or self._stored or self._uses >= enough)

    def load(self) -> int:
        """Compile or load the function now; return its address, 0 if that failed, now or before `checked`."""
        if not self.failures:
            try:
                self._function.compile(self._kinds)
                version = self._function.overloads[self._kinds]
                self._words[0] = version.library.get_pointer_to_function(version.fndesc.llvm_func_name)
            except BaseException as reason:
                self.failures.append(reason)
        return int(self._words[0])


def checked(call: Callable[[], Result]) -> Result:
    """Return the result of a call of a compiled function; raise what went wrong when it loaded a `Late` function."""
    result = call()
    if Late.failures:
        raise Late.failures.pop()
    return result


@intrinsic
def call_late(context, slot, failed, arguments):
    """Call the function of a `Late` with a tuple of arguments, of the types for which it is compiled.

    ``failed`` is returned, and has the type of the result, if the function could not be loaded.
    """
    kinds = tuple(arguments)

    def call(context, builder, signature, values):
        word, convention = ir.IntType(64), context.call_conv
        words = builder.inttoptr(values[0], word.as_pointer())
        found = cgutils.alloca_once_value(builder, builder.load_atomic(words, "acquire", 8))
        with cgutils.if_unlikely(builder, builder.icmp_unsigned("==", builder.load(found), word(0))):
            finder = builder.load(builder.gep(words, [word(1)]))
            builder.store(builder.call(builder.inttoptr(finder, ir.FunctionType(word, []).as_pointer()), []), found)
        result = cgutils.alloca_once_value(builder, values[1])
        with cgutils.if_likely(builder, builder.icmp_unsigned("!=", builder.load(found), word(0))):
            kind = convention.get_function_type(failed, kinds).as_pointer()
            parts = cgutils.unpack_tuple(builder, values[2], len(kinds))
            function = builder.inttoptr(builder.load(found), kind)
            status, value = convention.call_function(builder, function, failed, kinds, parts)
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            builder.store(value, result)
        return builder.load(result)

    return failed(types.intp, failed, arguments), call


@intrinsic
def is_raised(context, flag):
    """Whether the first number of an array of integers, or at a pointer, is not 0, read from memory at every call.

    The compiler would move an ordinary read out of a loop that does not write to the array.
    """

    def read(context, builder, signature, arguments):
        [data] = arguments
        if isinstance(flag, types.Array):
            data = context.make_array(flag)(context, builder, data).data
        number = builder.load_atomic(data, "monotonic", 8)
        return builder.icmp_signed("!=", number, number.type(0))

    return types.boolean(flag), read
