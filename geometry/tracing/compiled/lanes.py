"""Vectors of numbers in compiled code, for the disks in `collisions`. Loads numba.

Comparisons with NaN are false.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from ...scene.boxes import BOXES

WORD, NUMBER = ir.IntType(64), ir.DoubleType()


class Lanes:
    """A vector of numbers or truth values in compiled code, with the operations of arithmetic."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value, self.count = builder, value, value.type.count

    def _with(self, other: Any, operation: str) -> Lanes:
        other = other if isinstance(other, Lanes) else constant(self.builder, other, self.count)
        return Lanes(self.builder, getattr(self.builder, operation)(self.value, other.value))

    def __add__(self, other: Any) -> Lanes:
        return self._with(other, "fadd")

    def __sub__(self, other: Any) -> Lanes:
        return self._with(other, "fsub")

    def __mul__(self, other: Any) -> Lanes:
        return self._with(other, "fmul")

    def __truediv__(self, other: Any) -> Lanes:
        return self._with(other, "fdiv")

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Lanes:
        return Lanes(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> Lanes:
        return self._call("fabs")

    def __and__(self, other: Lanes) -> Lanes:
        return self._with(other, "and_")

    def __or__(self, other: Lanes) -> Lanes:
        return self._with(other, "or_")

    def __invert__(self) -> Lanes:
        return Lanes(self.builder, self.builder.not_(self.value))

    def __ge__(self, other: Any) -> Lanes:
        return self._compared(">=", other)

    def __gt__(self, other: Any) -> Lanes:
        return self._compared(">", other)

    def __le__(self, other: Any) -> Lanes:
        return self._compared("<=", other)

    def __lt__(self, other: Any) -> Lanes:
        return self._compared("<", other)

    def equals(self, other: Any) -> Lanes:
        return self._compared("==", other)

    def root(self) -> Lanes:
        return self._call("sqrt")

    def floor(self) -> Lanes:
        return self._call("floor")

    def where(self, yes: Lanes, no: Lanes) -> Lanes:
        return Lanes(self.builder, self.builder.select(self.value, yes.value, no.value))

    def any(self) -> Any:
        """Return a condition of the compiled code for its branches."""
        return self.builder.icmp_unsigned("!=", self.mask(), WORD(0))

    def mask(self) -> Any:
        return self.builder.zext(self.builder.bitcast(self.value, ir.IntType(self.count)), WORD)

    def _compared(self, how: str, other: Any) -> Lanes:
        other = other if isinstance(other, Lanes) else constant(self.builder, other, self.count)
        return Lanes(self.builder, self.builder.fcmp_ordered(how, self.value, other.value))

    def _call(self, name: str) -> Lanes:
        kind = ir.FunctionType(self.value.type, [self.value.type])
        function = self.builder.module.declare_intrinsic(f"llvm.{name}.v{self.count}f64", (), kind)
        return Lanes(self.builder, self.builder.call(function, [self.value]))


def repeated(builder: Any, number: Any, count: int = BOXES) -> Lanes:
    """Return a number of the compiled code in all lanes."""
    index = ir.IntType(32)
    one = builder.insert_element(ir.Constant(ir.VectorType(NUMBER, count), ir.Undefined), number, index(0))
    return Lanes(builder, builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(index, count), [0] * count)))


def constant(builder: Any, number: float, count: int = BOXES) -> Lanes:
    """Return a known number in all lanes."""
    return repeated(builder, NUMBER(number), count)


class Table:
    """The vectors that begin at a column of work space."""

    def __init__(self, context: Any, builder: Any, kind: Any, table: Any, count: int = BOXES) -> None:
        self._data = context.make_array(kind)(context, builder, table).data
        self.builder, self._lanes = builder, ir.VectorType(NUMBER, count)

    def column(self, number: Any) -> Table:
        self._start = self.builder.gep(self._data, [number])
        return self

    def __getitem__(self, place: int) -> Lanes:
        return Lanes(self.builder, self.builder.load(self._at(place), align=8))

    def __setitem__(self, place: int, value: Lanes) -> None:
        self.builder.store(value.value, self._at(place), align=8)

    def _at(self, place: int) -> Any:
        return self.builder.bitcast(self.builder.gep(self._start, [WORD(place)]), self._lanes.as_pointer())
