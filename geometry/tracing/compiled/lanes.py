"""Vectors of eight numbers in compiled code: eight boxes or lines against a ray, or eight rays against a piece.

Loads numba, whose compiler does not vectorise such loops by itself. Every number is computed by the same operations as
by `lines`, `arcs` and `rays`, so with the same rounding. Comparisons with NaN, as in an empty place, are false.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from ...scene.boxes import ANCHOR_X, ANCHOR_Y, BOXES, OTHER_X, OTHER_Y
from ...scene.compiled.records import DATA, TableType
from .arcs import NEARLY_TANGENT

WORD, NUMBER, BIT = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
LANES = ir.VectorType(NUMBER, BOXES)
# Least absolute value of a fraction from a line's end, so that it is negative even if the ray meets that end.
LEAST_FRACTION = 5e-324


class Eight(types.Type):
    """The type of eight numbers in a register."""

    def __init__(self) -> None:
        super().__init__("eight numbers")


@register_model(Eight)
class EightModel(models.PrimitiveModel):
    """Eight numbers are a vector in compiled code."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, LANES)


EIGHT = Eight()


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
    """The vectors that begin at a place of an array of numbers: at ``row`` of a table, or at a column of work space."""

    def __init__(self, context: Any, builder: Any, kind: Any, table: Any, count: int = BOXES) -> None:
        if isinstance(kind, TableType):
            self._data, self._columns = builder.extract_value(table, DATA), WORD(kind.columns)
        else:
            self._data = context.make_array(kind)(context, builder, table).data
        self.builder, self._lanes = builder, ir.VectorType(NUMBER, count)
        self._features: str = context.codegen().magic_tuple()[-1]

    def row(self, number: Any) -> Table:
        self._start = self.builder.gep(self._data, [self.builder.mul(number, self._columns)])
        return self

    def column(self, number: Any) -> Table:
        self._start = self.builder.gep(self._data, [number])
        return self

    def __getitem__(self, place: int) -> Lanes:
        return Lanes(self.builder, self.builder.load(self._at(place), align=8))

    def __setitem__(self, place: int, value: Lanes) -> None:
        self.builder.store(value.value, self._at(place), align=8)

    def pack(self, place: int, value: Lanes, chosen: Lanes) -> None:
        """Store the chosen lanes one after the other; the following places, eight in all, may then have any value."""
        builder, bits = self.builder, ir.VectorType(BIT, BOXES)
        if "+avx512f" in self._features:
            # some processors take a hundred cycles for the instruction that also stores
            kind = ir.FunctionType(LANES, [LANES, LANES, bits])
            compress = builder.module.declare_intrinsic(f"llvm.x86.avx512.mask.compress.v{BOXES}f64", (), kind)
            packed = builder.call(compress, [value.value, ir.Constant(LANES, ir.Undefined), chosen.value])
            self[place] = Lanes(builder, packed)
        else:
            start = builder.gep(self._start, [WORD(place)])
            kind = ir.FunctionType(ir.VoidType(), [LANES, NUMBER.as_pointer(), bits])
            store = builder.module.declare_intrinsic(f"llvm.masked.compressstore.v{BOXES}f64", (), kind)
            builder.call(store, [value.value, start, chosen.value])

    def number(self, place: int) -> Lanes:
        """Return one number of the table in all lanes."""
        return repeated(self.builder, self.builder.load(self.builder.gep(self._start, [WORD(place)])))

    def _at(self, place: int) -> Any:
        return self.builder.bitcast(self.builder.gep(self._start, [WORD(place)]), self._lanes.as_pointer())


def cross(ax: Lanes, ay: Lanes, bx: Lanes, by: Lanes) -> Lanes:
    """Return the cross product."""
    return ax * by - ay * bx


def dot(ax: Lanes, ay: Lanes, bx: Lanes, by: Lanes) -> Lanes:
    """Return the dot product."""
    return ax * bx + ay * by


@intrinsic
def boxes_met(typing, table, row, px, py, vx, vy, least, most):
    """-> int: mask of the boxes in a row of a tree that a ray meets between the times ``least`` and ``most``.

    Bit k tells about box k.
    """

    def met(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).row(values[1])
        px, py, vx, vy, least, most = (repeated(builder, value) for value in values[2:])
        dx, dy, width, height = at[ANCHOR_X] - px, at[ANCHOR_Y] - py, at[OTHER_X], at[OTHER_Y]
        # of the middle: its distance from the ray's line and its position along it; and those of the box about it
        middle, along = abs(cross(dx, dy, vx, vy)), dot(dx, dy, vx, vy)
        reach, length = dot(width, height, abs(vy), abs(vx)), dot(width, height, abs(vx), abs(vy))
        return ((middle <= reach) & (along + length >= least) & (along - length <= most)).mask()

    return types.int64(table, types.int64, *[types.float64] * 6), met


@intrinsic
def lines_met(typing, table, row, px, py, vx, vy, slack):
    """-> int: mask of the lines in a row of a tree that a ray's line crosses from their free side.

    Bits 8 to 15 tell whether an end of the line is within the slack of the ray's line.
    """

    def met(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).row(values[1])
        px, py, vx, vy, slack = (repeated(builder, value) for value in values[2:])
        before = cross(at[ANCHOR_X] - px, at[ANCHOR_Y] - py, vx, vy)
        after = cross(at[OTHER_X] - px, at[OTHER_Y] - py, vx, vy)
        crossed = (before >= 0.0) & (after <= 0.0) & (before > after)
        at_end = (abs(before) <= slack) | (abs(after) <= slack)
        return builder.or_(crossed.mask(), builder.shl(at_end.mask(), WORD(BOXES)))

    return types.int64(table, types.int64, *[types.float64] * 5), met


def chosen(builder: Any, condition: Any, values: list[Any], compute: Callable[[], list[Any]]) -> list[Any]:
    """Return the values that ``compute`` returns where a condition of the compiled code holds, else ``values``."""
    before = builder.block
    with builder.if_then(condition):
        computed = compute()
        after = builder.block
    return [joined(builder, (old, before), (new, after)) for old, new in zip(values, computed, strict=True)]


def joined(builder: Any, *choices: tuple[Any, Any]) -> Any:
    """Return the value that comes with the block of the compiled code from which it is reached."""
    first = choices[0][0]
    if isinstance(first, Lanes):
        return Lanes(builder, joined(builder, *((value.value, block) for value, block in choices)))
    one = builder.phi(first.type)
    for value, block in choices:
        one.add_incoming(value, block)
    return one


def least(values: Lanes) -> Any:
    """Return the least of eight numbers, in compiled code."""
    builder, index, rest = values.builder, ir.IntType(32), values
    while rest.count > 1:
        half = rest.count // 2
        low, high = (
            Lanes(
                builder, builder.shuffle_vector(rest.value, rest.value, ir.Constant(ir.VectorType(index, half), places))
            )
            for places in (list(range(half)), list(range(half, 2 * half)))
        )
        rest = (low < high).where(low, high)
    return builder.extract_element(rest.value, index(0))


@intrinsic
def nearest_of_lines(typing, table, row, own, px, py, vx, vy, slack, close):
    """-> (time, fraction, line, masks): the first hit of a ray on the lines in a row of a tree after a time ``close``.

    Without a hit the time is inf. The fraction is that of `lines.line_time`, the line its place in the row; ``own`` is
    the place of the line on which the ray starts. Bit k of the masks tells whether an end of line k is within the slack
    of the ray's line, bit 8 + k whether line k is hit within the time ``close`` of the start.
    """

    def met(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).row(values[1])
        own = repeated(builder, builder.sitofp(values[2], NUMBER))
        px, py, vx, vy, slack, close = (repeated(builder, value) for value in values[3:])
        lane = Lanes(builder, ir.Constant(LANES, [float(k) for k in range(BOXES)]))
        x0, y0, x1, y1 = at[ANCHOR_X], at[ANCHOR_Y], at[OTHER_X], at[OTHER_Y]
        before, after = cross(x0 - px, y0 - py, vx, vy), cross(x1 - px, y1 - py, vx, vy)
        crossed = (before >= 0.0) & (after <= 0.0) & (before > after) & ~lane.equals(own)
        at_end = (abs(before) <= slack) | (abs(after) <= slack)
        nothing = [NUMBER(float("inf")), NUMBER(0.0), WORD(0), WORD(0)]

        def first_hit() -> list[Any]:
            across = before - after
            late = before > across * 0.5
            fraction = late.where(after, before) / across
            x, y = late.where(x1, x0) + fraction * (x1 - x0), late.where(y1, y0) + fraction * (y1 - y0)
            time = dot(x - px, y - py, vx, vy)
            ahead = (crossed & (time > close)).where(time, constant(builder, float("inf")))
            first = least(ahead)
            # of equal times the first; some lane has the least time
            place = builder.cttz(ahead.equals(repeated(builder, first)).mask(), BIT(1))
            most = constant(builder, -LEAST_FRACTION)
            fraction = (late & (fraction > most)).where(most, fraction)
            near = builder.shl((crossed & (abs(time) <= close)).mask(), WORD(BOXES))
            return [first, builder.extract_element(fraction.value, place), place, near]

        time, fraction, place, near = chosen(builder, crossed.any(), nothing, first_hit)
        found = [time, fraction, place, builder.or_(near, at_end.mask())]
        return context.make_tuple(builder, signature.return_type, found)

    number, integer = types.float64, types.int64
    result = types.Tuple((number, number, integer, integer))
    return result(table, integer, integer, *[number] * 6), met


@intrinsic
def first_bit(typing, mask):
    """-> int: the number of the lowest bit of a mask that is not 0."""

    def count(context, builder, signature, values):
        return builder.cttz(values[0], BIT(1))

    return types.int64(types.int64), count


@intrinsic
def last_bit(typing, mask):
    """-> int: the number of the highest bit of a mask that is not 0."""

    def count(context, builder, signature, values):
        return builder.sub(WORD(63), builder.ctlz(values[0], BIT(1)))

    return types.int64(types.int64), count


# Rays of a wave, and the columns of its work space where the numbers of these rays begin: eight more fit in.
WAVE = 512
ROOM = WAVE + BOXES
PX, PY, VX, VY, OWN, BEFORE, BOUNCES, RAY = (ROOM * k for k in range(8))
TIME, PIECE, HIT_X, HIT_Y, FACE_X, FACE_Y, UNCERTAIN, DOUBT = (ROOM * k for k in range(8, 16))
OUT_X, OUT_VX, OUT_VY, OUT_BOUNCES, OUT_RAY, OUT_ANGLE, HIT_S = (ROOM * k for k in range(16, 23))
# Of rays in trees of boxes: times of the nearest hits so far, fractions on their lines, times at which to stop.
NEAREST, FRACTION, MOST = (ROOM * k for k in range(23, 26))
WORK = ROOM * 26
# Columns of whole numbers of the rays in trees; the last two are lists of rays. Columns are not close to each other
# modulo 4 kB, where the processor takes a number that it reads for one that it has just written.
WALK_ROOM = WAVE + 7 * BOXES
ROW, LEVEL, WAITING, FOUND, LEAF, AT_NODES, AT_LEAVES = (WALK_ROOM * k for k in range(7))
WALKS = WALK_ROOM * 7
# Values of UNCERTAIN.
BEFORE_RUN, AT_CORNER = 1.0, 2.0
# Numbers of pieces in OWN, PIECE and BEFORE: of lines their rows, of the opening -1; -2 for no line;
# circle k has -3 - k, Bezier piece k has -2^40 - k. After a hit on a Bezier piece, BEFORE is the parameter HIT_S there.
NO_PIECE, NO_LINE, CIRCLE_NUMBERS, BEZIER_NUMBERS = -1.0, -2.0, -3.0, -(2.0**40)


class Ray:
    """Eight rays of a wave, and the nearest hits so far."""

    def __init__(self, context: Any, builder: Any, signature: Any, values: Any) -> None:
        self.at = Table(context, builder, signature.args[0], values[0]).column(values[1])
        self.px, self.py, self.vx, self.vy = self.at[PX], self.at[PY], self.at[VX], self.at[VY]
        self.own = self.at[OWN]

    def doubt(self, doubtful: Lanes) -> None:
        builder = self.at.builder
        with builder.if_then(doubtful.any(), likely=False):
            self.at[DOUBT] = doubtful.where(constant(builder, 1.0), self.at[DOUBT])

    def hit(self, nearer: Lanes, piece: Lanes, time: Lanes, place: Any, normal: Any, at_corner: Lanes) -> None:
        """Put hits, none of which begins a run, in the place of those that are farther."""
        zero, at_end = constant(self.at.builder, 0.0), constant(self.at.builder, AT_CORNER)
        flag = at_corner.where(at_end, zero)
        for column, value in zip(HIT_COLUMNS, (time, piece, *place, *normal, flag), strict=True):
            self.at[column] = nearer.where(value, self.at[column])


@intrinsic
def clear_hits(typing, work, first):
    """Begin the search of the nearest hits of eight rays."""

    def clear(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).column(values[1])
        at[TIME] = constant(builder, float("inf"))
        at[DOUBT] = constant(builder, 0.0)
        return context.get_dummy_value()

    return types.void(work, types.int64), clear


# The nearest hits so far of eight rays, in registers: time, piece, position, unit normal and UNCERTAIN.
HIT_COLUMNS = TIME, PIECE, HIT_X, HIT_Y, FACE_X, FACE_Y, UNCERTAIN
HITS = types.UniTuple(EIGHT, len(HIT_COLUMNS))
# Their nearest hits on arcs so far: time and piece; start, end, normal at the start, curvature and sine of that arc.
ARCS = types.UniTuple(EIGHT, 10)


def unpacked(builder: Any, value: Any) -> list[Lanes]:
    """Return vectors, or numbers in all lanes, from a tuple in compiled code."""
    parts = cgutils.unpack_tuple(builder, value)
    return [Lanes(builder, part) if part.type == LANES else repeated(builder, part) for part in parts]


def packed(context: Any, builder: Any, kind: Any, parts: Any) -> Any:
    """Return vectors as a tuple in compiled code."""
    return context.make_tuple(builder, kind, [part.value for part in parts])


def either(condition: Lanes, yes: Any, no: Any) -> list[Lanes]:
    """Return vectors of one or of the other list, lane by lane."""
    return [condition.where(new, old) for new, old in zip(yes, no, strict=True)]


def uncertainty(at_corner: Lanes, before_run: Lanes) -> Lanes:
    """Return the numbers UNCERTAIN of hits."""
    builder = at_corner.builder
    flag = before_run.where(constant(builder, BEFORE_RUN), constant(builder, 0.0))
    return at_corner.where(constant(builder, AT_CORNER), flag)


@intrinsic
def hits_at(typing, work, first):
    """-> HITS: the nearest hits so far of eight rays of a wave."""

    def read(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).column(values[1])
        return packed(context, builder, HITS, [at[column] for column in HIT_COLUMNS])

    return HITS(work, types.int64), read


@intrinsic
def keep_hits(typing, work, first, hits):
    """Store the nearest hits so far of eight rays of a wave."""

    def store(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).column(values[1])
        for column, value in zip(HIT_COLUMNS, unpacked(builder, values[2]), strict=True):
            at[column] = value
        return context.get_dummy_value()

    return types.void(work, types.int64, HITS), store


@intrinsic
def no_hits(typing):
    """-> HITS: of rays that have met nothing so far."""
    return HITS(), lambda context, builder, signature, values: nothing_met(context, builder, HITS)


def nothing_met(context: Any, builder: Any, kind: Any) -> Any:
    """Return HITS or ARCS of rays that have met nothing so far."""
    zeros = [constant(builder, 0.0)] * (kind.count - 1)
    return packed(context, builder, kind, [constant(builder, float("inf")), *zeros])


@intrinsic
def no_arcs(typing):
    """-> ARCS: of rays that have met no arc so far."""
    return ARCS(), lambda context, builder, signature, values: nothing_met(context, builder, ARCS)


@intrinsic
def meet_corner(typing, work, first, x, y, slack):
    """Doubt those of eight rays that meet a corner."""

    def meet(context, builder, signature, values):
        ray = Ray(context, builder, signature, values)
        x, y, slack = (repeated(builder, value) for value in values[2:])
        doubt_at_corner(ray, x - ray.px, y - ray.py, slack)
        return context.get_dummy_value()

    return types.void(work, types.int64, *[types.float64] * 3), meet


def doubt_at_corner(ray: Ray, dx: Lanes, dy: Lanes, slack: Lanes) -> Lanes:
    """Doubt rays that meet the corner at (dx, dy) from them; return its side of the rays."""
    side = cross(dx, dy, ray.vx, ray.vy)
    near = abs(side) <= slack
    with ray.at.builder.if_then(near.any(), likely=False):
        # at entry the corners of the opening are behind the ray
        behind = ray.own.equals(NO_PIECE) & dy.equals(0.0)
        ray.doubt(near & (dot(dx, dy, ray.vx, ray.vy) > slack) & ~behind)
    return side


@intrinsic
def meet_line(typing, work, first, hits, start, end, edge, normal, length, close, numbers):
    """-> HITS: with those of eight rays on a line that are nearer.

    ``start`` and ``end`` are joints (x, y, slack), where the slack is negative if the joint is no corner; a hit before
    the time ``close`` is in doubt. ``numbers`` are that of the line, and the
    same if runs of hits begin on it, else `NO_LINE`.
    """

    def meet(context, builder, signature, values):
        ray, hits = Ray(context, builder, signature, values), unpacked(builder, values[2])
        (x0, y0, corner0), (x1, y1, corner1), (edge_x, edge_y), normal = (unpacked(builder, v) for v in values[3:7])
        length, close = (repeated(builder, value) for value in values[7:9])
        number, with_runs = unpacked(builder, values[9])
        before = doubt_at_corner(ray, x0 - ray.px, y0 - ray.py, corner0)
        after = cross(x1 - ray.px, y1 - ray.py, ray.vx, ray.vy)
        crossed = (before >= 0.0) & (after <= 0.0) & (before > after) & ~ray.own.equals(number)

        def nearer_hits() -> list[Lanes]:
            across = before - after
            late = before > across * 0.5
            fraction = late.where(after, before) / across
            x, y = late.where(x1, x0) + fraction * edge_x, late.where(y1, y0) + fraction * edge_y
            time = dot(x - ray.px, y - ray.py, ray.vx, ray.vy)
            ray.doubt(crossed & (abs(time) <= close))
            at_corner = abs(fraction) * length <= late.where(corner1, corner0)
            nearer = crossed & (time > close) & (time < hits[0])
            flag = uncertainty(at_corner, ray.at[BEFORE].equals(with_runs))
            return either(nearer, (time, number, x, y, *normal, flag), hits)

        return packed(context, builder, HITS, chosen(builder, crossed.any(), hits, nearer_hits))

    number = types.float64
    three, two = types.UniTuple(number, 3), types.UniTuple(number, 2)
    return HITS(work, types.int64, HITS, three, three, two, two, number, number, two), meet


@intrinsic
def meet_circle(typing, work, first, arcs, ends, normal, curvature, chord, sine, close, number):
    """-> ARCS: with the hits of eight rays on an arc that are nearer, as `arcs` does for one ray.

    ``ends`` are the start and the end of the arc, ``chord`` the direction and SHORT_CHORD; the one sine is that below
    which a run may begin. A hit before the time ``close`` is in doubt.
    """

    def meet(context, builder, signature, values):
        ray, arcs = Ray(context, builder, signature, values), unpacked(builder, values[2])
        px, py, vx, vy = ray.px, ray.py, ray.vx, ray.vy
        (x0, y0, x1, y1), (nx, ny) = (unpacked(builder, values[k]) for k in (3, 4))
        *chord, short = cgutils.unpack_tuple(builder, values[6])
        chord_x, chord_y = (repeated(builder, value) for value in chord)
        k, run_sine, close, number = (repeated(builder, values[k]) for k in (5, 7, 8, 9))
        focusing, own = k > 0.0, ray.own.equals(number)
        rx, ry = px - x0, py - y0
        b = dot(nx, ny, vx, vy) - k * dot(rx, ry, vx, vy)
        speed2 = dot(vx, vy, vx, vy)
        f = dot(nx, ny, rx, ry) - k * 0.5 * dot(rx, ry, rx, ry)
        d = b * b + k * 2.0 * speed2 * f
        ray.doubt(~focusing & ~own & (b < 0.0) & (abs(d) <= (b * b + speed2) * NEARLY_TANGENT))
        possible = (own & focusing & (b > 0.0)) | (~own & (d >= 0.0) & (focusing | (b < 0.0)))

        def nearer_arcs() -> list[Lanes]:
            root, far = d.root(), focusing & (b >= 0.0)
            top = own.where(b * 2.0, far.where(b + root, f * 2.0))
            time = top / (own | far).where(k * speed2, root - b)
            ray.doubt(possible & ~own & (abs(time) <= close))
            qx, qy = px + time * vx - x0, py + time * vy - y0
            # at grazing incidence rounding moves the point along the arc by more than the slack
            with builder.if_else(builder.fcmp_ordered(">", short, NUMBER(0.0))) as (is_short, is_long):
                with is_short:
                    along = dot(qx, qy, chord_x, chord_y)
                    on_near_half = cross(ny - k * qy, nx - k * qx, chord_y, chord_x) > 0.0
                    on_short = (along >= -close) & (along <= repeated(builder, short) + close) & on_near_half
                    short_end = builder.block
                with is_long:
                    height = cross(qy, qx, chord_y, chord_x)
                    on_long = (focusing & (height <= close)) | (~focusing & (height >= -close))
                    long_end = builder.block
            on_arc = joined(builder, (on_short, short_end), (on_long, long_end))
            nearer = possible & on_arc & (time >= 0.0) & (time < arcs[0])
            return either(nearer, (time, number, x0, y0, x1, y1, nx, ny, k, run_sine), arcs)

        return packed(context, builder, ARCS, chosen(builder, possible.any(), arcs, nearer_arcs))

    number_, pairs = types.float64, types.UniTuple
    four, three, two = (pairs(number_, size) for size in (4, 3, 2))
    return ARCS(work, types.int64, ARCS, four, two, number_, three, number_, number_, number_), meet


@intrinsic
def hits_on_arcs(typing, work, first, arcs, close):
    """-> HITS: those of eight rays on arcs, put back on them by one Newton step.

    A hit within the distance ``close`` of an end is uncertain.
    """

    def put(context, builder, signature, values):
        ray, hits = Ray(context, builder, signature, values), unpacked(builder, nothing_met(context, builder, HITS))
        time, number, x0, y0, x1, y1, nx, ny, k, run_sine = unpacked(builder, values[2])
        px, py, vx, vy = ray.px, ray.py, ray.vx, ray.vy
        close, met = repeated(builder, values[3]), time < hits[0]

        def hits_there() -> list[Lanes]:
            qx, qy = px + time * vx - x0, py + time * vy - y0
            mx, my = nx - k * qx, ny - k * qy
            f = dot(nx, ny, qx, qy) - k * 0.5 * dot(qx, qy, qx, qy)
            qx, qy = qx - f * mx, qy - f * my
            mx, my = nx - k * qx, ny - k * qy
            scale = constant(builder, 1.0) / dot(mx, my, mx, my).root()
            mx, my, x, y = mx * scale, my * scale, x0 + qx, y0 + qy
            from_start, from_end = dot(x - x0, y - y0, x - x0, y - y0), dot(x - x1, y - y1, x - x1, y - y1)
            at_end = (from_start <= close * close * 4.0) | (from_end <= close * close * 4.0)
            begins_run = (run_sine > 0.0) & (abs(dot(vx, vy, mx, my)) <= run_sine)
            return [time, number, x, y, mx, my, uncertainty(at_end, begins_run)]

        return packed(context, builder, HITS, chosen(builder, met.any(), hits, hits_there))

    return HITS(work, types.int64, ARCS, types.float64), put


@intrinsic
def advance(typing, work, first, count, kept, left_out, opening, slack, limit):
    """-> int: let eight rays leave through the opening, or reflect them at their hits, and pack those that go on.

    ``count`` is the number of rays of the wave; ``kept`` and ``left_out``, where rays that go on and rays that have
    left are written. Rays in doubt, or with ``limit`` hits, are dropped. The result is the number of rays that go on,
    plus 256 times that of rays that have left.
    """

    def move(context, builder, signature, values):
        ray = Ray(context, builder, signature, values)
        at, px, py, vx, vy = ray.at, ray.px, ray.py, ray.vx, ray.vy
        rest = repeated(builder, builder.sitofp(builder.sub(values[2], values[1]), NUMBER))
        left, right = (repeated(builder, v) for v in cgutils.unpack_tuple(builder, values[5]))
        slack, limit = repeated(builder, values[6]), repeated(builder, values[7])
        lane = Lanes(builder, ir.Constant(LANES, [float(k) for k in range(BOXES)]))
        time, bounces, own, zero = at[TIME], at[BOUNCES], at[OWN], constant(builder, 0.0)
        certain = (lane < rest) & at[DOUBT].equals(0.0)
        to_right, to_left = dot(right - px, py, vy, vx), dot(left - px, py, vy, vx)
        upward = -py / vy
        upward = (upward > 0.0).where(upward, zero)
        leaves = (vy > 0.0) & (to_right >= 0.0) & (to_left <= 0.0) & ((time - upward) * vy > slack)
        out = certain & leaves
        goes_on = certain & ~leaves & at[UNCERTAIN].equals(0.0) & (time < float("inf")) & (bounces < limit)
        index = at[RAY]
        nx, ny, x, y, piece = at[FACE_X], at[FACE_Y], at[HIT_X], at[HIT_Y], at[PIECE]
        w = dot(vx, vy, nx, ny) * 2.0
        wx, wy = vx - w * nx, vy - w * ny
        scale = constant(builder, 1.5) - dot(wx, wy, wx, wy) * 0.5
        before = (own >= 0.0).where(own, constant(builder, NO_PIECE))
        before = (piece <= BEZIER_NUMBERS).where(at[HIT_S], before)
        end = Table(context, builder, signature.args[0], values[0]).column(values[4])
        for column, value in {
            OUT_X: px + upward * vx, OUT_VX: vx, OUT_VY: vy, OUT_BOUNCES: bounces, OUT_RAY: index
        }.items():  # fmt: skip
            end.pack(column, value, out)
        goal = Table(context, builder, signature.args[0], values[0]).column(values[3])
        for column, value in {
            PX: x, PY: y, VX: wx * scale, VY: wy * scale, OWN: piece, BEFORE: before, BOUNCES: bounces + 1.0, RAY: index
        }.items():  # fmt: skip
            goal.pack(column, value, goes_on)
        both = builder.shl(builder.ctpop(out.mask()), WORD(8))
        return builder.or_(builder.ctpop(goes_on.mask()), both)

    number = types.float64
    return types.int64(work, *[types.int64] * 4, types.UniTuple(number, 2), number, number), move


@intrinsic
def before_runs(typing, work, first):
    """-> int: mask of those of eight rays whose hits may begin runs."""

    def read(context, builder, signature, values):
        at = Table(context, builder, signature.args[0], values[0]).column(values[1])
        return (at[UNCERTAIN].equals(BEFORE_RUN) & (at[TIME] < float("inf"))).mask()

    return types.int64(work, types.int64), read
