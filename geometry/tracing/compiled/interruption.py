"""Test of the flag that ends a long compiled function."""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic


@intrinsic
def is_raised(context, flag):
    """Whether the first number of an array of integers is not 0, read from memory at every call.

    The compiler would move an ordinary read out of a loop that does not write to the array.
    """

    def read(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        number = builder.load_atomic(array.data, "monotonic", 8)
        return builder.icmp_signed("!=", number, number.type(0))

    return types.boolean(flag), read
