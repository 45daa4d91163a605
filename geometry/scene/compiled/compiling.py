"""How functions of rays are compiled, called by their address, and given tables. Loads numba.

The caller owns all arrays during a call. Counting references to arrays, an atomic operation in each function that
receives one, would cost a quarter of the time of a disk's collision. So these functions are compiled without numba's
run time: they allocate nothing, and they return arrays only to callers that count no references either. Passing an
array costs ten arguments, so small functions are inlined.

numba copies all called functions into a function and optimises them again, at every level. A large function that is
called from many places, or seldom, is compiled once instead and called by its address. A function that few walls need
is not compiled before the first call: compiled code then calls back into Python, which compiles or loads it.

A table is a pointer to float64 or integers, as is a row, and a one-dimensional array a pointer to its elements: nothing
is counted, and no index is compared with 0 or with a length. So a named tuple of tables is a few numbers.
"""

from __future__ import annotations

import ctypes
import operator
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, TypeVar

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from ....core.compilation import is_stored, jit

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


WORD, NUMBER = ir.IntType(64), types.float64
ROW = types.CPointer(NUMBER)
PLACE = types.UniTuple(types.intp, 2)


class Table(types.Type):
    """The type of a table of numbers with a known number of columns."""

    def __init__(self, columns: int, element: Any = NUMBER) -> None:
        self.columns, self.element = columns, element
        super().__init__(f"table({columns}, {element})")


@register_model(Table)
class _TableModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager[kind.element].get_value_type().as_pointer())


@type_callable(operator.getitem)
def _read(context: Any) -> Any:
    def typed(table, index):
        if isinstance(table, Table):
            if isinstance(index, types.BaseTuple):
                return table.element(table, PLACE)
            return types.CPointer(table.element)(table, types.intp)
        return None

    return typed


@type_callable(operator.setitem)
def _written(context: Any) -> Any:
    def typed(table, index, value):
        return types.none(table, PLACE, table.element) if isinstance(table, Table) else None

    return typed


def _pointer(builder: Any, signature: Any, values: Any) -> Any:
    row, column = (builder.extract_value(values[1], k) for k in range(2))
    return builder.gep(values[0], [builder.add(builder.mul(row, WORD(signature.args[0].columns)), column)])


@lower_builtin(operator.getitem, Table, types.UniTuple)
def _read_number(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.load(_pointer(builder, signature, values))


@lower_builtin(operator.setitem, Table, types.UniTuple, types.Number)
def _write_number(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    builder.store(values[2], _pointer(builder, signature, values))


@lower_builtin(operator.getitem, Table, types.Integer)
def _row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.gep(values[0], [builder.mul(values[1], WORD(signature.args[0].columns))])


def named(form: Any, *kinds: Any) -> Any:
    """Return the type of a named tuple of values of some types."""
    if len(kinds) != len(form._fields):
        raise ValueError(f"expected {len(form._fields)} types, one for each field, got {len(kinds)}")
    return types.BaseTuple.from_types(kinds, form)


def kind_of(value: Any) -> Any:
    """Return the type of a value of a `Struct` in compiled functions."""
    if isinstance(value, tuple):
        kinds = tuple(map(kind_of, value))
        return named(type(value), *kinds) if hasattr(value, "_fields") else types.BaseTuple.from_types(kinds)
    if isinstance(value, np.ndarray):
        element = typeof(value).dtype
        return Table(value.shape[1], element) if value.ndim == 2 else types.CPointer(element)
    return typeof(value)


def reader_of(kind: Any) -> Any:
    """Return a compiled function that reads a named tuple of a type from the address of a `Struct`."""

    def words_at(builder: Any, address: Any) -> Iterator[Any]:
        pointer, place = builder.inttoptr(address, WORD.as_pointer()), 0
        while True:
            yield builder.load(builder.gep(pointer, [WORD(place)]))
            place += 1

    def value_of(context: Any, builder: Any, kind: Any, words: Iterator[Any]) -> Any:
        if isinstance(kind, types.BaseTuple):
            parts: Any = kind
            return context.make_tuple(builder, kind, [value_of(context, builder, part, words) for part in parts])
        word, form = next(words), context.get_value_type(kind)
        if isinstance(form, ir.PointerType):
            return builder.inttoptr(word, form)
        if kind == NUMBER:
            return builder.bitcast(word, form)
        return builder.trunc(word, form) if form != WORD else word

    @intrinsic
    def read_at(typing, address):
        def make(context, builder, signature, values):
            return value_of(context, builder, kind, words_at(builder, values[0]))

        return kind(types.intp), make

    return read_at
