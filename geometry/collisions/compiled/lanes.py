"""One flight of several disks at once over a convex hollow, of lines or a focusing arc: its parts. Loads numba.

Times of contact are found as by `contact`: by safe steps, which pass no root. In a convex hollow a satellite is in
front of every piece, and the first one that it crosses, continued, is the one that it meets, unless it has left the
hollow; then it does not return, because its path is convex. Whatever rounding could change, and whatever else is rare,
sets DOUBT. A lane never reads another one, so a disk's result does not depend on the others.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ...tracing.compiled.lanes import WORD, Lanes, Table, constant, repeated
from ...tracing.compiled.trigonometry import COSINE, SINE
from .contact import ROOT_FRACTION, WIDEST_SLACK

# Number of disks at once. With eight, the processor waits for results more often.
WIDTH = 16
# Columns of the work space, of WIDTH numbers each. Of the disks: satellite 0 touches the piece OWN (-1: none yet) at
# (X, Y); satellite BESIDE, if not 0, is below the tops, too, in the cell that begins at SHIFT.
X, Y, SIN, VERSED, ANGLE, V1, V2, OMEGA, OWN, BESIDE, SHIFT, HEIGHT = (WIDTH * k for k in range(12))
TRAVEL, ROTATION, PASSED, CONTACTS, TWO, DISK = (WIDTH * k for k in range(12, 18))
# Of a flight: the first contact so far, and the satellite CHOSEN that touches the piece HIT (-1 for none) there.
END, TIME, TIE, FASTEST, HIT, CHOSEN, HIT_X, HIT_Y, DOUBT = (WIDTH * k for k in range(18, 27))
# Of the satellite whose contact is sought: the first piece that it crosses, and how: MISSED, CLEAR_HIT or UNCLEAR.
CROSSED, CROSSING, HOW, FROM, FROM_SINE, FROM_VERSED, AT_X, AT_Y = (WIDTH * k for k in range(27, 35))
ROOT, ROOT_SINE, ROOT_VERSED, FOUND = (WIDTH * k for k in range(35, 39))
# Of three satellites, see `enter`: position and direction at the start, the time from which
# on it is below the tops (inf for never), the left end of its cell, and its number, -1, 0 or 1.
SATELLITES = WIDTH * 39
AT_START_X, AT_START_Y, SINE_THERE, COSINE_THERE, BELOW_FROM, BASE, NUMBER = (WIDTH * k for k in range(7))
SATELLITE = WIDTH * 7
WORK = SATELLITES + 3 * SATELLITE
MISSED, CLEAR_HIT, UNCLEAR = 0.0, 1.0, 2.0
# The polynomials for sine and cosine hold up to pi/4.
FARTHEST_TURN = 0.75
# Limit on steps to a root; most are reached in two, and those of arcs passed at a small distance in more.
STEPS = 8
# Distances below this number of slacks are left to double-double arithmetic.
CLOSE = 4.0
INFINITE = float("inf")
# Largest error of a root, as a fraction of the slack, on arcs and after the usual number of steps to a line: far below
# rounding, because arcs and shallow incidence magnify it.
LEAST_FRACTION, USUAL_STEPS = 2.0**-10, 2


def turned(angle: Lanes) -> tuple[Lanes, Lanes]:
    """Return sine and 1 - cosine of angles up to FARTHEST_TURN, without cancellation."""
    u = angle * angle
    u2 = u * u
    p, q = ((u * k[1] + k[0]) + u2 * ((u * k[3] + k[2]) + u2 * (u * k[5] + k[4])) for k in (SINE, COSINE))
    return angle + angle * u * p, u * 0.5 - u2 * q


def doubt_after(bounds: tuple[Lanes, ...], ahead: Lanes) -> Lanes:
    """Return a bound on the change of F'' in a time s, from b0, and b1 if any: |F'''| is at most b0 + b1 s."""
    third, *growth = bounds
    return ((third + growth[0] * ahead) if growth else third) * ahead


class Flight:
    """The flights of the disks in all lanes: the work space, the satellites and the velocities."""

    def __init__(self, context: Any, builder: Any, signature: Any, values: Any) -> None:
        self.builder = builder
        self.at = Table(context, builder, signature.args[0], values[0], WIDTH).column(WORD(0))
        numbers = (repeated(builder, v, WIDTH) for v in cgutils.unpack_tuple(builder, values[1]))
        # the fields of `records.Ring`
        self.scale, self.spacing, self.reach, self.floor, self.slack, self.half_sine, self.half_cosine = numbers
        self.v1, self.v2, self.omega = self.at[V1], self.at[V2], self.at[OMEGA]
        self.spin, self.radius = self.scale * self.omega, self.number(1.0) / self.scale

    def number(self, value: float) -> Lanes:
        return constant(self.builder, value, WIDTH)

    def doubt(self, doubtful: Lanes) -> None:
        self.at[DOUBT] = doubtful.where(self.number(1.0), self.at[DOUBT])

    def replace(self, chosen: Lanes, values: dict[int, Lanes]) -> None:
        for column, value in values.items():
            self.at[column] = chosen.where(value, self.at[column])

    def moved(self, t: Lanes, rotation: Any, turn: Any) -> tuple[Lanes, Lanes, Lanes, Lanes]:
        """Return the displacement of a satellite, and its sine and cosine, as `contact.satellite_after`."""
        (sine, cosine), (sin_d, versed_d) = turn, rotation
        d_sine, fall = cosine * sin_d - sine * versed_d, sine * sin_d + cosine * versed_d
        return (
            self.v1 * t + d_sine * self.radius, self.v2 * t + fall * self.radius, sine + d_sine, cosine - fall,
        )  # fmt: skip

    def form(self, level: Lanes, g1: Lanes, g2: Lanes, turn: Any) -> Any:
        """Return F of a line, as `contact.towards_line`."""
        sine, cosine = turn
        a, b = self.radius * (g1 * cosine + g2 * sine), self.radius * (g2 * cosine - g1 * sine)
        return level, g1 * self.v1 + g2 * self.v2, a, b

    def after_line(self, line: Any) -> Any:
        """Return the function that gives F of a line, F', F'', and the bounds of `doubt_after`, after a time."""
        level, rate, a, b = line
        third = self.spin * self.spin * abs(self.omega)

        def after(t: Lanes, rotation: Any) -> Any:
            sin_d, versed_d = rotation
            f1 = rate + self.spin * (a + b * sin_d - a * versed_d)
            f2 = self.spin * self.spin * (b - b * versed_d - a * sin_d)
            return level + rate * t + a * sin_d + b * versed_d, f1, f2, (third,)

        return after

    def after_arc(self, arc: Any, turn: Any) -> Any:
        """Return the function that gives F of an arc and the other numbers, as `contact.conic_after`."""
        level, g1, g2, curvature, stretch = arc
        bend, widest = self.spin * self.omega, (stretch > 1.0).where(stretch, self.number(1.0))
        speed = abs(curvature) * widest * self.at[FASTEST]
        swing = widest * bend * abs(self.spin)

        def after(t: Lanes, rotation: Any) -> Any:
            dx, dy, sine, cosine = self.moved(t, rotation, turn)
            dy = dy * stretch
            n1, n2 = g1 - curvature * dx, g2 - curvature * dy
            u1, u2 = self.v1 + self.omega * cosine, stretch * (self.v2 + self.omega * sine)
            f2 = bend * (stretch * n2 * cosine - n1 * sine) - curvature * (u1 * u1 + u2 * u2)
            third = swing * (abs(n1) + abs(n2)) + speed * widest * bend * 3.0
            f = level + ((g1 + n1) * dx + (g2 + n2) * dy) * 0.5
            return f, n1 * u1 + n2 * u2, f2, (third, swing * speed)

        return after

    def step_to_root(self, after: Any, t: Lanes, values: Any, until: Lanes, live: Lanes, steps: int) -> None:
        """Find the first root of F before ``until`` in the lanes ``live``: ROOT, with FOUND where there is one."""
        builder = self.builder
        f, f1, f2, bounds = values
        falling, ahead = f1 < 0.0, until - t
        doubt = doubt_after(bounds, ahead)
        c = f2 - doubt
        disc = f1 * f1 - c * f * 2.0
        root = disc.root()
        step = falling.where(f * 2.0, f1 + root) / falling.where(root - f1, -c)
        has_root = (falling & (disc >= 0.0)) | (~falling & (c < 0.0))
        # near a tangency rounding decides between two roots and none
        self.doubt(live & falling & (c > 0.0) & (abs(disc) <= c * self.slack * CLOSE))
        live = live & has_root & (step < ahead)
        with builder.if_then(live.any()):
            t = t + step
            rotation = turned(self.spin * t)
            fraction = ROOT_FRACTION if len(bounds) == 1 and steps > STEPS - USUAL_STEPS else LEAST_FRACTION
            done = live & (doubt * step * step <= self.slack * fraction)
            found = {ROOT: t, ROOT_SINE: rotation[0], ROOT_VERSED: rotation[1], FOUND: self.number(1.0)}
            self.replace(done, found)
            live = live & ~done
            with builder.if_then(live.any()):
                if steps == 1:
                    self.doubt(live)
                else:
                    values = after(t, rotation)
                    # behind by the rounding error of the last step
                    behind = live & (values[0] <= 0.0)
                    self.replace(behind, found)
                    self.step_to_root(after, t, values, until, live & ~behind, steps - 1)

    def meet(self, mine: Any, after: Any, number: Lanes, reach: Lanes, where: Any) -> None:
        """Find where satellites cross a piece first, if they do so before they cross another one.

        Distances of the start up to ``reach`` are in doubt. ``where`` tells whether a position is on the piece.
        """
        at, t, rotation = self.at, self.at[FROM], (self.at[FROM_SINE], self.at[FROM_VERSED])
        until, zero = at[CROSSING], self.number(0.0)
        live, leaving = t < until, mine[NUMBER].equals(0.0) & at[OWN].equals(number)
        f, *rest = after(t, rotation)
        f1, f2, bounds = rest
        self.doubt(live & ((leaving & ~(f1 > 0.0)) | (~leaving & ~(f > reach))))
        f = leaving.where(zero, f)
        ahead = until - t
        c = f2 - doubt_after(bounds, ahead)
        lowest = f + (f1 + (c < 0.0).where(c, zero) * 0.5 * ahead) * ahead
        live = live & ~(lowest > self.slack)
        with self.builder.if_then(live.any()):
            at[FOUND] = zero
            self.step_to_root(after, t, (f, *rest), until, live, STEPS)
            found = at[FOUND] > 0.0
            with self.builder.if_then(found.any()):
                t, rotation = at[ROOT], (at[ROOT_SINE], at[ROOT_VERSED])
                dx, dy, _, _ = self.moved(t, rotation, (mine[SINE_THERE], mine[COSINE_THERE]))
                x, y = mine[AT_START_X] - mine[BASE] + dx, mine[AT_START_Y] + dy
                # at shallow incidence an error across the piece is a larger error along it
                inward = abs(after(t, rotation)[1])
                clear, out = where(x, y, inward, at[FASTEST] * reach)
                how = clear.where(self.number(CLEAR_HIT), out.where(self.number(MISSED), self.number(UNCLEAR)))
                self.replace(found, {CROSSING: t, CROSSED: number, HOW: how, AT_X: x, AT_Y: y})

    def reflect(self, here: Lanes, place: Any, normal: Any, disk: Any) -> None:
        """Reflect disks whose satellites touch a piece at a place with this normal, as `rigid.reflect`."""
        (x, y), (n1, n2), (mass, inertia) = place, normal, disk
        one = self.number(1.0)
        sine, versed = self.at[SIN], self.at[VERSED]
        cosine = one - versed
        by_mass, by_inertia = one / mass, one / inertia
        arm = n1 * cosine + n2 * sine
        inward = (self.v1 + self.omega * cosine) * n1 + (self.v2 + self.omega * sine) * n2
        impulse = inward * -2.0 / (by_mass + arm * arm * by_inertia)
        v1, v2 = self.v1 + impulse * n1 * by_mass, self.v2 + impulse * n2 * by_mass
        omega = self.omega + impulse * arm * by_inertia
        # one Newton step on the kinetic norm
        energy = mass * (v1 * v1 + v2 * v2) + inertia * omega * omega
        scale = self.number(1.5) - energy * 0.5
        height = y - versed / self.scale
        self.replace(here, {X: x, Y: y, HEIGHT: height, V1: scale * v1, V2: scale * v2, OMEGA: scale * omega})


def satellite_columns(builder: Any, context: Any, signature: Any, values: Any, place: Any) -> Table:
    """Return the columns of a satellite; ``place`` is a number of the compiled code."""
    first = builder.add(WORD(SATELLITES), builder.mul(place, WORD(SATELLITE)))
    return Table(context, builder, signature.args[0], values[0], WIDTH).column(first)


@intrinsic
def begin_flights(typing, work, ring):
    """Begin the flights of all disks: find when each ends without a contact."""

    def begin(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at, v2 = flight.at, flight.v2
        zero = flight.number(0.0)
        fastest = (flight.v1 * flight.v1 + v2 * v2).root() + abs(flight.omega)
        at[FASTEST] = fastest
        slowest = fastest * (1.0 / WIDEST_SLACK)
        at[TIE] = flight.slack / (abs(v2) > slowest).where(abs(v2), slowest)
        end = -((v2 > 0.0).where(at[HEIGHT], at[HEIGHT] + flight.floor)) / v2
        end = (end > 0.0).where(end, zero)
        limit = flight.number(FARTHEST_TURN) / abs(flight.spin)
        at[END] = end
        at[TIME] = (end < limit).where(end, limit)
        at[HIT] = flight.number(-1.0)
        at[CHOSEN] = zero
        at[DOUBT] = (v2.equals(0.0) | (abs(at[ANGLE]) > FARTHEST_TURN)).where(flight.number(1.0), zero)
        return context.get_dummy_value()

    return types.void(work, ring), begin


def far_off(flight: Flight, angle: Lanes, until: Lanes) -> Lanes:
    """Return whether a satellite is above the wall until a time, by its angle."""
    beyond = abs(angle) - flight.reach
    away = angle * flight.spin >= 0.0
    return (beyond > 0.0) & (away | (beyond >= abs(flight.spin) * until))


@intrinsic
def enter(typing, work, ring, place, side, cell):
    """-> bool: begin the search of the contacts of one satellite of each disk; whether any of them is below the tops.

    ``place`` and ``side`` are 0 for satellite 0; 1 and 1 for the neighbour that is below the tops, or comes nearer; 2
    and -1 for the other neighbour. Satellites above the tops fly until they come below them.
    """

    def begin(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at, mine = flight.at, satellite_columns(builder, context, signature, values, values[2])
        side, cell = (repeated(builder, value, WIDTH) for value in values[3:])
        zero, one = flight.number(0.0), flight.number(1.0)
        beside, until = at[BESIDE], at[TIME] + at[TIE]
        number = side * beside.equals(0.0).where((flight.spin > 0.0).where(-one, one), beside)
        inside = ((side > 0.0) & ~beside.equals(0.0)) | (side.equals(0.0) & (at[OWN] >= 0.0))
        above = ~inside & (side.equals(0.0) | ~far_off(flight, at[ANGLE] + number * flight.spacing, until))
        at[HOW], at[CROSSED], at[CROSSING] = zero, -one, until
        at[FROM] = inside.where(zero, flight.number(INFINITE))
        at[FROM_SINE], at[FROM_VERSED] = zero, zero
        mine[NUMBER], mine[BASE] = number, (inside & (side > 0.0)).where(at[SHIFT], zero)
        with builder.if_then((inside | above).any()):
            place_satellite(flight, mine)
            y, turn = mine[AT_START_Y], (mine[SINE_THERE], mine[COSINE_THERE])
            # the path is convex, so it stays above its first tangent
            rate = flight.v2 + flight.omega * turn[0]
            above = above & ~(y + (rate < 0.0).where(rate, zero) * until > flight.slack * CLOSE)
            with builder.if_then(above.any()):
                flight.doubt(above & (y <= flight.slack * CLOSE))
                tops = flight.after_line(flight.form(y, zero, one, turn))
                at[FOUND] = zero
                flight.step_to_root(tops, zero, tops(zero, (zero, zero)), until, above, STEPS)
                found = at[FOUND] > 0.0
                with builder.if_then(found.any()):
                    below_tops(flight, mine, found, cell)
        mine[BELOW_FROM] = at[FROM]
        return (at[FROM] < until).any()

    return types.boolean(work, ring, types.int64, types.float64, types.float64), begin


def place_satellite(flight: Flight, mine: Table) -> None:
    """Set the position and direction of a satellite, as `rigid.satellite_at`."""
    at, number = flight.at, mine[NUMBER]
    own, one = number.equals(0.0), flight.number(1.0)
    half_sine, half_cosine = number * flight.half_sine, own.where(one, flight.half_cosine)
    sine, cosine = at[SIN], one - at[VERSED]
    across = half_sine * 2.0 * (cosine * half_cosine - sine * half_sine)
    upward = half_sine * 2.0 * (sine * half_cosine + cosine * half_sine)
    mine[AT_START_X], mine[AT_START_Y] = at[X] + across / flight.scale, at[Y] + upward / flight.scale
    mine[SINE_THERE], mine[COSINE_THERE] = sine + across, cosine - upward


def below_tops(flight: Flight, mine: Table, found: Lanes, cell: Lanes) -> None:
    """Let satellites come below the tops at ROOT: find their cells."""
    at, t, rotation = flight.at, flight.at[ROOT], (flight.at[ROOT_SINE], flight.at[ROOT_VERSED])
    dx, _, sine, _ = flight.moved(t, rotation, (mine[SINE_THERE], mine[COSINE_THERE]))
    x = mine[AT_START_X] + dx
    base = (x / cell).floor() * cell
    entry, sinking = x - base, -(flight.v2 + flight.omega * sine)
    nearest = (entry + entry < cell).where(entry, cell - entry)
    flight.doubt(found & ~(nearest * sinking > at[FASTEST] * flight.slack * CLOSE))
    mine[BASE] = found.where(base, mine[BASE])
    flight.replace(found, {FROM: t, FROM_SINE: rotation[0], FROM_VERSED: rotation[1]})


TWO_NUMBERS, NUMBER_TYPE = types.UniTuple(types.float64, 2), types.float64


def lanes_of(builder: Any, values: Any) -> list[Any]:
    """Return numbers, and tuples of numbers, of the compiled code in all lanes."""
    return [
        [repeated(builder, part, WIDTH) for part in cgutils.unpack_tuple(builder, value)]
        if isinstance(value.type, (ir.ArrayType, ir.LiteralStructType))
        else repeated(builder, value, WIDTH)
        for value in values
    ]


@intrinsic
def meet_line(typing, work, ring, place, start, edge, normal, length, number):
    """Find where satellites cross a line first; ``start`` is its first joint."""

    def find(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        mine = satellite_columns(builder, context, signature, values, values[2])
        (x0, y0), (edge_x, edge_y), (g1, g2), length, number = lanes_of(builder, values[3:])
        x, y = mine[AT_START_X] - mine[BASE], mine[AT_START_Y]
        leaving = mine[NUMBER].equals(0.0) & flight.at[OWN].equals(number)
        level = leaving.where(flight.number(0.0), g1 * (x - x0) + g2 * (y - y0))
        after = flight.after_line(flight.form(level, g1, g2, (mine[SINE_THERE], mine[COSINE_THERE])))

        def where(x: Lanes, y: Lanes, inward: Lanes, wide: Lanes) -> tuple[Lanes, Lanes]:
            along = ((x - x0) * edge_x + (y - y0) * edge_y) / length
            return (along * inward > wide) & ((length - along) * inward > wide), y * inward > wide

        flight.meet(mine, after, number, flight.slack * CLOSE, where)
        return context.get_dummy_value()

    pairs = (TWO_NUMBERS,) * 3
    return types.void(work, ring, types.int64, *pairs, NUMBER_TYPE, NUMBER_TYPE), find


@intrinsic
def meet_arc(typing, work, ring, place, start, normal, curvature, stretch):
    """Find where satellites cross a focusing arc, number 0, with both ends at the tops."""

    def find(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        mine = satellite_columns(builder, context, signature, values, values[2])
        (x0, y0), (nx, ny), curvature, stretch = lanes_of(builder, values[3:])
        zero, one = flight.number(0.0), flight.number(1.0)
        rx, ry = mine[AT_START_X] - mine[BASE] - x0, stretch * (mine[AT_START_Y] - y0)
        g1, g2 = nx - curvature * rx, ny - curvature * ry
        leaving = mine[NUMBER].equals(0.0) & flight.at[OWN].equals(0.0)
        level = leaving.where(zero, ((nx + g1) * rx + (ny + g2) * ry) * 0.5)
        after = flight.after_arc((level, g1, g2, curvature, stretch), (mine[SINE_THERE], mine[COSINE_THERE]))
        reach = flight.slack * CLOSE * (stretch > 1.0).where(stretch, one)

        def where(_: Lanes, y: Lanes, inward: Lanes, wide: Lanes) -> tuple[Lanes, Lanes]:
            return -y * inward > wide, y * inward > wide

        flight.meet(mine, after, zero, reach, where)
        return context.get_dummy_value()

    return types.void(work, ring, types.int64, TWO_NUMBERS, TWO_NUMBERS, NUMBER_TYPE, NUMBER_TYPE), find


@intrinsic
def compare(typing, work, ring, place):
    """Compare the first contacts of satellites with the first so far."""

    def settle(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at = flight.at
        number = satellite_columns(builder, context, signature, values, values[2])[NUMBER]
        flight.doubt(at[HOW].equals(UNCLEAR))
        hits = at[HOW].equals(CLEAR_HIT)
        time = at[CROSSING]
        flight.doubt(hits & (at[HIT] >= 0.0) & (abs(time - at[TIME]) <= at[TIE]))
        flight.replace(
            hits & (time < at[TIME]),
            {TIME: time, HIT: at[CROSSED], CHOSEN: number, HIT_X: at[AT_X], HIT_Y: at[AT_Y]},
        )
        return context.get_dummy_value()

    return types.void(work, ring, types.int64), settle


def remaining_satellite(flight: Flight, columns: Any, time: Lanes) -> None:
    """Set BESIDE and SHIFT to the satellite, besides the one that touches the wall, that is below the tops."""
    at, zero = flight.at, flight.number(0.0)
    chosen, beside, shift, base = at[CHOSEN], zero, zero, zero
    rotation = turned(flight.spin * time)
    below = []
    for mine in columns:
        number, turn = mine[NUMBER], (mine[SINE_THERE], mine[COSINE_THERE])
        is_chosen = chosen.equals(number)
        base = is_chosen.where(mine[BASE], base)
        _, dy, _, _ = flight.moved(time, rotation, turn)
        y, other = mine[AT_START_Y] + dy, (mine[BELOW_FROM] < time) & ~is_chosen
        flight.doubt(other & (abs(y) <= flight.slack * CLOSE))
        below.append((number, other & (y < 0.0), mine[BASE]))
    for number, is_below, left in below:
        flight.doubt(is_below & (~beside.equals(0.0) | (abs(chosen - number) > 1.0)))
        beside, shift = is_below.where(number - chosen, beside), is_below.where(left, shift)
    at[BESIDE], at[SHIFT] = beside, shift - base


@intrinsic
def finish_flights(typing, work, ring, limit):
    """-> int: move all disks to the ends of their flights; mask of those that came back.

    The next WIDTH bits tell which disks are in doubt.
    """

    def move(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at, limit = flight.at, repeated(builder, values[2], WIDTH)
        time, chosen = at[TIME], at[CHOSEN]
        hits = at[HIT] >= 0.0
        for side in (-2.0, 2.0):
            flight.doubt(~far_off(flight, at[ANGLE] + flight.spacing * side, time + at[TIE]))
        flight.doubt((hits & (at[CONTACTS] >= limit)) | (~hits & ((time < at[END]) | ~(flight.v2 > 0.0))))
        columns = [satellite_columns(builder, context, signature, values, WORD(place)) for place in range(3)]
        turn = flight.spin * time
        at[TRAVEL] = at[TRAVEL] + flight.v1 * time
        at[ROTATION] = at[ROTATION] + turn
        at[PASSED] = at[PASSED] + time
        remaining_satellite(flight, columns, time)
        one, zero = flight.number(1.0), flight.number(0.0)
        again = (at[CONTACTS] > 0.0) & ~chosen.equals(0.0) & hits
        at[TWO] = again.where(one, at[TWO])
        at[CONTACTS] = at[CONTACTS] + hits.where(one, zero)
        angle = at[ANGLE] + (chosen * flight.spacing + turn)
        at[ANGLE] = angle
        at[SIN], at[VERSED] = turned(angle)
        at[OWN] = at[HIT]
        doubt = at[DOUBT] > 0.0
        return builder.or_((~hits & ~doubt).mask(), builder.shl(doubt.mask(), WORD(WIDTH)))

    return types.int64(work, ring, types.float64), move


@intrinsic
def reflect_at_line(typing, work, ring, disk, start, end, edge, normal, length, number):
    """Reflect the disks whose satellites touch a line; ``disk`` is (m, J)."""

    def reflect(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at = flight.at
        disk, (x0, y0), (x1, y1), (edge_x, edge_y), normal, length, number = lanes_of(builder, values[2:])
        here = at[OWN].equals(number)
        with builder.if_then(here.any()):
            fraction = ((at[HIT_X] - x0) * edge_x + (at[HIT_Y] - y0) * edge_y) / (length * length)
            late = fraction > 0.5
            fraction = late.where(fraction - 1.0, fraction)
            x, y = late.where(x1, x0) + fraction * edge_x, late.where(y1, y0) + fraction * edge_y
            flight.reflect(here, (x, y), normal, disk)
        return context.get_dummy_value()

    return types.void(work, ring, disk, *(TWO_NUMBERS,) * 4, NUMBER_TYPE, NUMBER_TYPE), reflect


@intrinsic
def reflect_at_arc(typing, work, ring, disk, start, normal, curvature, stretch):
    """Reflect the disks whose satellites touch an arc, number 0."""

    def reflect(context, builder, signature, values):
        flight = Flight(context, builder, signature, values)
        at = flight.at
        disk, (x0, y0), (nx, ny), curvature, stretch = lanes_of(builder, values[2:])
        qx, qy = at[HIT_X] - x0, stretch * (at[HIT_Y] - y0)
        n1, n2 = nx - curvature * qx, ny - curvature * qy
        f = ((nx + n1) * qx + (ny + n2) * qy) * 0.5
        qx, qy = qx - f * n1, qy - f * n2
        n1, n2 = nx - curvature * qx, stretch * (ny - curvature * qy)
        norm = flight.number(1.0) / (n1 * n1 + n2 * n2).root()
        flight.reflect(at[OWN].equals(0.0), (x0 + qx, y0 + qy / stretch), (n1 * norm, n2 * norm), disk)
        return context.get_dummy_value()

    return types.void(work, ring, disk, TWO_NUMBERS, TWO_NUMBERS, NUMBER_TYPE, NUMBER_TYPE), reflect
