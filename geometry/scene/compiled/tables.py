"""Tables and named tuples of them in compiled functions. Loads numba.

A table is a pointer to float64 or integers, as is a row, and a one-dimensional array a pointer to its elements: nothing
is counted, and no index is compared with 0 or with a length. So a named tuple of tables is a few numbers.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

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
