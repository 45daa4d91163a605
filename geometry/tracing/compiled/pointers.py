"""Calls of compiled functions by their address. Loads numba.

numba copies all called functions into a function and optimises them again, at every level. A large function that is
called from many places, or seldom, is compiled once instead and called by its address.
"""

from __future__ import annotations

from typing import Any

from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic


def address_of(function: Any, arguments: tuple[Any, ...]) -> int:
    """Return the address of a function compiled for the types of ``arguments``; compile or load it if necessary."""
    kinds = tuple(typeof(argument) for argument in arguments)
    function.compile(kinds)
    version = function.overloads[kinds]
    return int(version.library.get_pointer_to_function(version.fndesc.llvm_func_name))


@intrinsic
def call_at(context, address, result, arguments):
    """Call the function at ``address`` with a tuple of arguments; it returns a value of the type of ``result``.

    The types must be those for which the function was compiled; they are not checked.
    """
    kinds = tuple(arguments)

    def call(context, builder, signature, values):
        convention = context.call_conv
        kind = convention.get_function_type(result, kinds)
        function = builder.inttoptr(values[0], kind.as_pointer())
        parts = cgutils.unpack_tuple(builder, values[2], len(kinds))
        status, value = convention.call_function(builder, function, result, kinds, parts)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return value

    return result(types.intp, result, arguments), call
