"""The types of `Record` and of its tables in compiled functions. Loads numba.

A record is an address; its fields are read where they are used. A table is an address and a number of rows, a row of a
table an address. Rows and columns are counted from 0 only, so that no index is compared with 0.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer, infer_getattr, infer_global
from numba.core.typing.templates import signature as signature_of
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_builtin,
    lower_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array

from ..records import Record

WORD, NUMBER = ir.IntType(64), ir.DoubleType()
BYTES = 8
# The parts of a table.
DATA, ROWS = range(2)


class RecordType(types.Type):
    """The type of a record: its fields with their types, and the place of each among the words."""

    def __init__(self, fields: tuple[tuple[str, Any], ...]) -> None:
        self.fields, self.places, place = dict(fields), {}, 0
        for name, kind in fields:
            self.places[name] = place
            place += 2 if isinstance(kind, (TableType, types.Array)) else 1
        super().__init__(f"record({', '.join(f'{name}: {kind}' for name, kind in fields)})")


class TableType(types.Type):
    """The type of a table of float64 with a known number of columns."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        super().__init__(f"table({columns})")


class RowType(types.Type):
    """The type of a row of a table."""

    def __init__(self) -> None:
        super().__init__("row")


ROW = RowType()


class Typed:
    """In place of an argument of compiled functions: its type."""

    def __init__(self, kind: Any) -> None:
        self._numba_type_ = kind


KNOWN: dict[tuple[Any, ...], RecordType] = {}


@typeof_impl.register(Record)
def record_type(record: Record, _: Any) -> Any:
    """Return the type of a record, which is the same object for records of the same kind."""
    if record.type is None:
        if record.kind not in KNOWN:
            KNOWN[record.kind] = RecordType(
                tuple((name, _type_of(value)) for name, value in record.values._asdict().items())
            )
        record.type = KNOWN[record.kind]
    return record.type


def _type_of(value: Any) -> Any:
    kind = typeof(value)
    if isinstance(kind, types.Array):
        return TableType(value.shape[1]) if kind.ndim == 2 else types.Array(kind.dtype, 1, "C")
    return kind


@register_model(RecordType)
class _RecordModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, WORD.as_pointer())


@register_model(TableType)
class _TableModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("data", types.CPointer(types.float64)), ("rows", types.intp)])


@register_model(RowType)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, NUMBER.as_pointer())


@unbox(RecordType)
def _unbox(kind: Any, record: Any, c: Any) -> Any:
    number = c.pyapi.object_getattr_string(record, "address")
    word = c.pyapi.long_as_longlong(number)
    c.pyapi.decref(number)
    return NativeValue(c.builder.inttoptr(word, WORD.as_pointer()))


@infer_getattr
class _Fields(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, typ: Any, attr: Any) -> Any:  # type: ignore[override]
        return types.intp if attr == "address" else typ.fields.get(attr)


@infer_getattr
class _Shape(AttributeTemplate):
    key = TableType

    def resolve_shape(self, kind: Any) -> Any:
        return types.UniTuple(types.intp, 2)


@lower_getattr_generic(RecordType)
def _field(context: Any, builder: Any, kind: Any, record: Any, name: str) -> Any:
    def word(place: int) -> Any:
        found = builder.load(builder.gep(record, [WORD(place)]))
        # the words of a record never change
        found.set_metadata("invariant.load", builder.module.add_metadata([]))
        return found

    if name == "address":
        return builder.ptrtoint(record, WORD)
    field, place = kind.fields[name], kind.places[name]
    if isinstance(field, types.Array):
        data = builder.inttoptr(word(place), context.get_data_type(field.dtype).as_pointer())
        return _array(context, builder, field, data, [word(place + 1)])
    if isinstance(field, TableType):
        data = builder.inttoptr(word(place), NUMBER.as_pointer())
        return cgutils.pack_struct(builder, [data, word(place + 1)])
    if isinstance(field, RecordType):
        return builder.inttoptr(word(place), WORD.as_pointer())
    if field == types.float64:
        return builder.bitcast(word(place), NUMBER)
    return builder.trunc(word(place), ir.IntType(1)) if field == types.boolean else word(place)


def place_of(example: Record) -> Any:
    """Return a compiled function that returns the record at an address, of the type of the example.

    From Python an address is passed in a tenth of a microsecond, a record in 4.
    """
    kind = typeof(example)

    @intrinsic
    def record_at(typing, address):
        def make(context, builder, signature, values):
            return builder.inttoptr(values[0], WORD.as_pointer())

        return kind(types.intp), make

    return record_at


@lower_getattr(TableType, "shape")
def _shape(context: Any, builder: Any, kind: Any, table: Any) -> Any:
    return cgutils.pack_array(builder, [builder.extract_value(table, ROWS), WORD(kind.columns)])


@infer_global(operator.getitem)
class _Items(AbstractTemplate):
    def generic(self, arguments: Any, _: Any) -> Any:
        kind, index = arguments
        if isinstance(kind, TableType) and isinstance(index, types.BaseTuple):
            return signature_of(types.float64, kind, types.UniTuple(types.intp, 2))
        if isinstance(kind, TableType):
            return signature_of(ROW, kind, types.intp)
        return signature_of(types.float64, kind, types.intp) if isinstance(kind, RowType) else None


@infer
class _KnownItems(AbstractTemplate):
    key = "static_getitem"

    def generic(self, arguments: Any, _: Any) -> Any:
        kind, _ = arguments
        return signature_of(types.float64, kind, types.intp) if isinstance(kind, RowType) else None


@infer_global(operator.setitem)
class _NewItems(AbstractTemplate):
    def generic(self, arguments: Any, _: Any) -> Any:
        kind, _, _ = arguments
        if isinstance(kind, TableType):
            return signature_of(types.none, kind, types.UniTuple(types.intp, 2), types.float64)
        return None


def _place(builder: Any, kind: Any, table: Any, row: Any, column: Any) -> Any:
    index = builder.add(builder.mul(row, WORD(kind.columns)), column)
    return builder.gep(builder.extract_value(table, DATA), [index])


@lower_builtin(operator.getitem, TableType, types.UniTuple)
def _item(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    table, place = values
    return builder.load(_place(builder, signature.args[0], table, *cgutils.unpack_tuple(builder, place, 2)))


@lower_builtin(operator.setitem, TableType, types.UniTuple, types.Float)
def _set_item(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    table, place, number = values
    builder.store(number, _place(builder, signature.args[0], table, *cgutils.unpack_tuple(builder, place, 2)))


@lower_builtin(operator.getitem, TableType, types.Integer)
def _row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    table, row = values
    return _place(builder, signature.args[0], table, row, WORD(0))


@lower_builtin(operator.getitem, RowType, types.Integer)
def _number(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    row, column = values
    return builder.load(builder.gep(row, [column]))


@lower_builtin("static_getitem", RowType, types.Any)
def _known_number(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    row, column = values
    return builder.load(builder.gep(row, [WORD(column)]))


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    array, size = make_array(kind)(context, builder), WORD(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [builder.mul(shape[-1], size), size] if len(shape) == 2 else [size]
    populate_array(array, data, cgutils.pack_array(builder, shape), cgutils.pack_array(builder, strides), size, None)
    return array._getvalue()


@intrinsic
def array_of(typing, table):
    """A table as an array, for functions that also take arrays."""

    def make(context, builder, signature, values):
        data, rows = cgutils.unpack_tuple(builder, values[0], 2)
        return _array(context, builder, signature.return_type, data, [rows, WORD(signature.args[0].columns)])

    return types.Array(types.float64, 2, "C")(table), make
