"""The position of a satellite of the moving disk, and its first contact with a piece of the wall: compiled.

A satellite meets a line, an upright conic or a graph, a part of a Bezier piece, at F = 0, see below.

**No root is passed.** On [t, t + ahead] the second derivative of F(D(t)) is at least c = F''(t) - L ahead, where L
bounds the third derivative. So F lies above the parabola with F(t), F'(t) and c, and the first root of the parabola is
a safe step; if the parabola has no root, F has none. The steps converge quadratically because c tends to F''. All
roots of F are visited in order, downward and upward crossings, until one lies on the piece.

**No face is met from behind.** A satellite that leaves one piece within rounding of another piece has F = 0 on both.
The exact positions of the pieces decide whether it starts in front of the other piece, see `in_front_at`. So the
opposite face of a plate of zero thickness or of a sharp peak is not hit.

Lengths are in units of the wall, so the disk's radius is 1/scale and the wall's tops are at height 0. In the time t a
disk with velocities (v1, v2) and spin omega moves a satellite at the angle a from the lowest point by

D(t) = (v1 t + (sin(a + d) - sin a)/scale, v2 t + (cos a - cos(a + d))/scale),   d = scale omega t,

which is evaluated by products, without cancellation. A line or an upright conic is F = 0 with

F(D) = f + g.D - curvature |D|^2/2     (y multiplied by the arc's stretch; curvature 0 for lines),

where f and g are constants at the start of the motion. A graph eta = h(xi) over a chord is F = eta - h(xi); the
acceleration of the satellite and the bounds on h'' bound its F'' below. The tables are those of the planar tracer, see
`scene/scene`. Loads numba.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...curves import columns as c
from ...curves.arc import Arc
from ...curves.bezier import Bezier
from ...curves.columns import range_of
from ...scene.compiled.compiling import compiled, inlined, inner
from ...tracing.compiled.pieces.arcs import arc_form, arc_normal, end_excess
from ...tracing.compiled.pieces.formulas import near_end
from ...tracing.compiled.pieces.kinds import Arrival, Face, in_front_at
from ...tracing.compiled.pieces.lines import line_at
from ...tracing.compiled.pieces.records import ARC, BEZIER, LINE, NO_PIECE, SIDE
from ...tracing.compiled.rays import BOUNCE_LIMIT, CORNER, ESCAPED, GRAZING
from ...tracing.double_double.numbers import extended
from . import graph_table as g
from .shapes import Start, height_above, in_frame, parameter_at

# Angle below which `turning` uses series up to the tenth power; the omitted terms are below 3e-18 of the sum.
SMALL_TURN = 0.1
S3, S5, S7, S9 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362880.0
V2, V4, V6, V8, V10 = 1.0 / 2.0, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0, 1.0 / 3628800.0
# Code of a contact that double precision resolves; the other codes are statuses of rays.
CLEAR = ESCAPED
# Constants with types, because numba compiles a function again for every literal argument.
NOTHING, ZERO, NO = np.int64(-1), np.int64(0), np.bool_(False)
# Largest error of a root, as a fraction of the slack of 16 rounding errors.
ROOT_FRACTION = 1.0 / 16.0
# Largest factor of the slack at shallow incidence (1e-6 radians); it keeps the slack far below the pieces' lengths.
WIDEST_SLACK = 1e6
# Limit on steps. Near a tangency a step at worst halves the distance, which takes about 100 steps from the wall's size
# to its rounding. Disks that sink slowly and rotate fast need more: a step is a few sizes of the wall along the rim.
ROOT_STEPS = 100_000
# Of each kind of piece the columns of a hollow for its first row and the row after the last.
RANGES = (LINE, c.FIRST_JOINT, c.JOINTS_END), (ARC, *range_of(Arc.table)), (BEZIER, *range_of(Bezier.table))


class Motion(NamedTuple):
    """Free motion: velocities, rate of the disk's angle, radius of the disk, and a bound on a satellite's speed."""

    v1: float
    v2: float
    omega: float
    spin: float
    radius: float
    fastest: float


class State(NamedTuple):
    """Displacement of a satellite since the start of the motion, and the sine and cosine of its angle."""

    dx: float
    dy: float
    sine: float
    cosine: float


class Touching(NamedTuple):
    """The piece that a satellite touches: kind and number of the piece, and the hollow, -1 on the tops."""

    kind: int
    piece: int
    hollow: int


class Path(NamedTuple):
    """A moving satellite: starting position, sine and cosine of the angle there, the motion, and the slack.

    The slack bounds the rounding error of the position.
    """

    x: float
    y: float
    turn: tuple[float, float]
    motion: Motion
    slack: float


class Span(NamedTuple):
    """A time interval [t, end), and the `turning` until t."""

    t: float
    end: float
    rotation: tuple[float, float]


class Touch(NamedTuple):
    """A contact: time (inf for none), piece, left end of its cell, state of the satellite, and code."""

    time: float
    on: Touching
    base: float
    state: State
    code: int


@inlined
def flight(v1, v2, omega, scale):
    """Return the free motion of a disk of radius 1/scale."""
    return Motion(v1, v2, omega, scale * omega, 1.0 / scale, math.sqrt(v1 * v1 + v2 * v2) + abs(omega))


@inlined
def turning(angle):
    """Return sin(angle) and 1 - cos(angle), without cancellation and quickly for small angles."""
    if abs(angle) < SMALL_TURN:
        z = angle * angle
        z2 = z * z
        # in pairs, for short chains of dependent products
        sine = angle + angle * z * (S3 + z * S5 + z2 * (S7 + z * S9))
        return sine, z * (V2 + z * V4 + z2 * (V6 + z * V8 + z2 * V10))
    half = math.sin(0.5 * angle)
    return 2.0 * half * math.cos(0.5 * angle), 2.0 * half * half


@inlined
def satellite_after(t, rotation, turn, motion):
    """Return the State of a satellite after the time t.

    ``turn`` is (sin a, cos a) at the start; ``rotation`` is the `turning` since the start.
    """
    sine, cosine = turn
    sin_d, versed_d = rotation
    d_sine, fall = cosine * sin_d - sine * versed_d, sine * sin_d + cosine * versed_d
    dx, dy = motion.v1 * t + d_sine * motion.radius, motion.v2 * t + fall * motion.radius
    return State(dx, dy, sine + d_sine, cosine - fall)


@inlined
def towards_line(level, g1, g2, turn, motion):
    """Return F of a line with f = level: (level, rate, a, b) for F = level + rate t + a sin d + b (1 - cos d)."""
    sine, cosine = turn
    a, b = motion.radius * (g1 * cosine + g2 * sine), motion.radius * (g2 * cosine - g1 * sine)
    return level, g1 * motion.v1 + g2 * motion.v2, a, b


@inlined
def line_after(line, t, rotation, motion):
    """Return F of a line after the time t and its first two derivatives."""
    level, rate, a, b = line
    sin_d, versed_d = rotation
    f1 = rate + motion.spin * (a + b * sin_d - a * versed_d)
    f2 = motion.spin * motion.spin * (b - b * versed_d - a * sin_d)
    return level + rate * t + a * sin_d + b * versed_d, f1, f2


@inlined
def conic_after(conic, t, rotation, turn, motion):
    """Return F of a conic after the time t, F', F'', and b0 and b1: |F'''| is at most b0 + b1 s up to t + s."""
    level, g1, g2, curvature, stretch = conic
    dx, dy, sine, cosine = satellite_after(t, rotation, turn, motion)
    dy *= stretch
    n1, n2 = g1 - curvature * dx, g2 - curvature * dy
    u1, u2 = motion.v1 + motion.omega * cosine, stretch * (motion.v2 + motion.omega * sine)
    bend, widest = motion.spin * motion.omega, max(1.0, stretch)
    f, f1 = level + 0.5 * ((g1 + n1) * dx + (g2 + n2) * dy), n1 * u1 + n2 * u2
    f2 = bend * (stretch * n2 * cosine - n1 * sine) - curvature * (u1 * u1 + u2 * u2)
    swing, bent = widest * bend * abs(motion.spin), abs(curvature) * (widest * motion.fastest)
    third = swing * (abs(n1) + abs(n2)) + 3.0 * bent * widest * bend
    return f, f1, f2, third, swing * bent


@inlined
def safe_step(f, f1, f2):
    """Return the first positive root of the parabola f + f1 t + f2 t^2/2, f >= 0, or inf; 0 only if f = 0 > f1."""
    disc = f1 * f1 - 2.0 * f2 * f
    falling, root = f1 < 0.0, math.sqrt(disc)
    step = (2.0 * f if falling else f1 + root) / (root - f1 if falling else -f2)
    return step if (falling & (disc >= 0.0)) | ((not falling) & (f2 < 0.0)) else np.inf


@inlined
def graph_after(form, t, rotation, path):
    """-> (F, F', F'', xi'): F of a graph on a path after the time t, and the speed of the abscissa."""
    graph, begin = form
    motion = path.motion
    state = satellite_after(t, rotation, path.turn, motion)
    d_xi, d_eta = in_frame(graph, state.dx, state.dy)
    f, slope, bend = height_above(graph, begin, d_xi, d_eta)
    xi1, eta1 = in_frame(graph, motion.v1 + motion.omega * state.cosine, motion.v2 + motion.omega * state.sine)
    turn = motion.spin * motion.omega
    xi2, eta2 = in_frame(graph, -turn * state.sine, turn * state.cosine)
    return f, eta1 - slope * xi1, eta2 - slope * xi2 - bend * xi1 * xi1, xi1


@inlined
def graph_bounds(sign, graph, motion, xi1, ahead):
    """-> (least, uncertainty, third): bounds on a graph's sign F ahead: its F'' is in [least, least + uncertainty].

    ``third`` bounds |F'''|.
    """
    most, least = (
        (graph[g.MOST_BEND], graph[g.LEAST_BEND]) if sign > 0.0 else (-graph[g.LEAST_BEND], -graph[g.MOST_BEND])
    )
    pull = abs(motion.spin * motion.omega)
    inertial = pull * graph[g.STEEPNESS]
    speed = min(motion.fastest, abs(xi1) + pull * ahead)
    third = speed * (graph[g.THIRD] * speed * speed + 3.0 * (most - least) * pull) + inertial * abs(motion.spin)
    return -inertial - most * speed * speed, 2.0 * inertial + (most - least) * speed * speed, third


@compiled
def next_root(sign, leaving, line, conic, graph, span, path, patience):
    """-> (t, rotation, code): first time in the span at which sign F falls through 0, inf if none; `turning` until t.

    F is given by a ``line``, see `towards_line`, by a ``conic`` (f, g1, g2, curvature, stretch), or by a ``graph`` (its
    row and the `Start`); the others are None. ``leaving`` means that F is 0 to rounding at the start of the span; this
    root is not returned. ``patience`` is the longest time for which the bounds on F are useful. After ROOT_STEPS steps
    the code is `BOUNCE_LIMIT`, and t is the time up to which there is no root.
    """
    t, end, rotation = span
    turn, motion, slack = path.turn, path.motion, path.slack
    third, growth = motion.spin * motion.spin * abs(motion.omega), 0.0
    for number in range(ROOT_STEPS):
        if conic is not None:
            f, f1, f2, third, growth = conic_after(conic, t, rotation, turn, motion)
        if line is not None:
            f, f1, f2 = line_after(line, t, rotation, motion)
        if graph is not None:
            f, f1, f2, xi1 = graph_after(graph, t, rotation, path)
        f, f1, f2 = sign * f, sign * f1, sign * f2
        if number == 0 and leaving:
            if f1 <= 0.0:
                return t, rotation, GRAZING
            f = 0.0
        elif f <= 0.0:
            # at the start, the satellite is behind the piece by a rounding error
            return t, rotation, CLEAR if number > 0 else CORNER
        ahead = min(end - t, patience)
        uncertainty = (third + growth * ahead) * ahead
        least = f2 - uncertainty
        if graph is not None:
            least, uncertainty, third = graph_bounds(sign, graph[0], motion, xi1, ahead)
            if f1 < 0.0 < f2:
                # near a tangency, where rounding decides between two roots and none
                until = -f1 / f2
                if until < ahead and abs(f + 0.5 * f1 * until) <= slack and third * until**3 <= slack:
                    return t + until, turning(motion.spin * (t + until)), GRAZING
        step = safe_step(f, f1, least)
        if step >= ahead:
            if graph is None and least > 0.0 and -f2 * ahead <= f1 < 0.0 and f - 0.5 * f1 * f1 / f2 <= slack:
                # near a tangency, as above
                t -= f1 / f2
                return t, turning(motion.spin * t), GRAZING
            if end - t <= patience:
                break
            step = ahead
        before = t
        t += step
        rotation = turning(motion.spin * t)
        # F at the new t is at most its distance from the parabola; far below the slack it counts as 0
        if step < ahead and (uncertainty * step * step <= ROOT_FRACTION * slack or t == before):
            return t, rotation, CLEAR
    else:
        return t, rotation, BOUNCE_LIMIT
    return np.inf, rotation, CLEAR


@inlined
def where_on_line(joints, lines, j, x, y, slack):
    """-> (inside, corner): whether a point of the line through segment j is on it, and within the slack of a corner."""
    along = (x - joints[j, c.JOINT_X]) * lines[j, c.EDGE_X] + (y - joints[j, c.JOINT_Y]) * lines[j, c.EDGE_Y]
    length = lines[j, c.LENGTH]
    from_start, from_end = along / length, length - along / length
    at_start, at_end = joints[j, c.IS_CORNER] > 0.0, joints[j + 1, c.IS_CORNER] > 0.0
    corner = (from_start <= slack and at_start) or (from_end <= slack and at_end)
    return from_start >= -slack and from_end >= -slack, corner


@inlined
def face_at(kind, number, x, y, ground):
    """-> Face: a piece next to a position, for double-double arithmetic."""
    arc = ground.exact_arcs[number if kind == ARC else 0]
    graph = ground.graphs[number if kind == BEZIER else 0]
    if kind != BEZIER:
        return Face(kind, number, arc, extended(0.0))
    along, _ = in_frame(graph, x - graph[c.START_X], y - graph[c.START_Y])
    curve = ground.beziers[int(graph[g.PIECE])]
    return Face(BEZIER, number, curve, extended(graph[g.FIRST_S] + parameter_at(graph, along)))


@inner
def is_in_front(kind, number, own, x, y, slack, ground):
    """-> bool: whether a satellite at (x, y) on the piece ``own`` lies in front of another piece close by."""
    # without a test for faces passed from behind on the last path
    start, piece = face_at(own.kind, own.piece, x, y, ground), face_at(kind, number, x, y, ground)
    arrival = Arrival(0.0, slack, slack)
    return in_front_at(ground.joints, piece, start, extended(x), extended(y), 0.0, 0.0, arrival)


@inlined
def piece_after(kind, line, conic, graph, t, rotation, path):
    """-> (F, F', F''): of a piece of any kind on a path after the time t."""
    if kind == LINE:
        return line_after(line, t, rotation, path.motion)
    if kind == ARC:
        return conic_after(conic, t, rotation, path.turn, path.motion)[:3]
    return graph_after(graph, t, rotation, path)[:3]


@inlined
def stays_in_front(line, span, leaving, motion, slack):
    """-> bool: whether a line is certainly not met in the span."""
    here, rate, bend = line_after(line, span.t, span.rotation, motion)
    ahead = span.end - span.t
    # F lies above a concave parabola, and so above the lower of its end values
    uncertainty = motion.spin * motion.spin * abs(motion.omega) * ahead
    lowest = here + (rate + 0.5 * min(bend - uncertainty, 0.0) * ahead) * ahead
    return lowest > slack and (here > slack or (leaving and rate > 0.0))


@inlined
def where_on_piece(kind, number, path, state, inward, ground):
    """-> (inside, corner): whether a point of the continuation of a piece is on it; see `where_on_line`.

    At shallow incidence a rounding error across the piece is a larger error along it.
    """
    x, y = path.x + state.dx, path.y + state.dy
    wide = path.slack * max(1.0, min(path.motion.fastest / abs(inward), WIDEST_SLACK))
    if kind == LINE:
        return where_on_line(ground.joints, ground.lines, number, x, y, wide)
    if kind == BEZIER:
        graph = ground.graphs[number]
        along, _ = in_frame(graph, x - graph[c.START_X], y - graph[c.START_Y])
        return -wide <= along <= graph[g.WIDTH] + wide, near_end(graph, x, y, wide)
    arc, stretch = ground.arcs[number], ground.arcs[number, c.STRETCH]
    excess = end_excess(arc, x - arc[c.START_X], stretch * (y - arc[c.START_Y]))
    return excess <= wide * max(1.0, stretch), near_end(arc, x, y, wide)


@inlined
def start_on(number, own, path, ground):
    """-> (Start, is_own): the start of a path in the frame of a graph, and whether it lies on the graph's formula."""
    graph = ground.graphs[number]
    if own.kind == BEZIER and ground.graphs[own.piece, g.PIECE] == graph[g.PIECE]:
        left = ground.graphs[own.piece]
        along, _ = in_frame(left, path.x - left[c.START_X], path.y - left[c.START_Y])
        sigma = parameter_at(left, along) + (left[g.FIRST_S] - graph[g.FIRST_S])
        if graph[g.LEAST_SIGMA] <= sigma <= graph[g.MOST_SIGMA]:
            abscissa = sigma * (graph[g.XI1] + sigma * (graph[g.XI2] + sigma * graph[g.XI3]))
            return Start(abscissa, 0.0, 0.0, sigma), True
    xi, eta = in_frame(graph, path.x - graph[c.START_X], path.y - graph[c.START_Y])
    return Start(xi, xi, eta, 0.0), False


@inlined
def piece_form(kind, number, own, path, size, ground):
    """-> (is_own, line, conic, graph, patience, reach): a piece for `next_root`, as its kind has it.

    ``is_own`` tells whether the path starts on the piece, ``reach`` is the slack of its function F.
    """
    is_own = own.kind == kind and own.piece == number
    line, conic, patience, reach = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 1.0), np.inf, path.slack
    begin = Start(0.0, 0.0, 0.0, 0.0)
    if kind == LINE:
        face = line_at(ground, number)
        level = 0.0 if is_own else face.normal_x * (path.x - face.x0) + face.normal_y * (path.y - face.y0)
        line = towards_line(level, face.normal_x, face.normal_y, path.turn, path.motion)
    else:
        patience = 2.0 * size / path.motion.fastest
        if kind == ARC:
            arc, stretch = ground.arcs[number], ground.arcs[number, c.STRETCH]
            rx, ry = path.x - arc[c.START_X], stretch * (path.y - arc[c.START_Y])
            form = n1, n2, curvature = arc_form(arc)
            g1, g2 = arc_normal(form, 1.0, rx, ry)
            conic = 0.0 if is_own else 0.5 * ((n1 + g1) * rx + (n2 + g2) * ry), g1, g2, curvature, stretch
            reach = path.slack * max(1.0, stretch)
        else:
            begin, is_own = start_on(number, own, path, ground)
            reach = path.slack * ground.graphs[number, g.STEEPNESS]
    return is_own, line, conic, (ground.graphs[number if kind == BEZIER else 0], begin), patience, reach


@inlined
def first_on_piece(kind, number, own, path, span, size, ground):
    """-> (t, state, code): first contact in the span of one satellite with the front of one piece, inf if none.

    The kind is LINE, ARC, or BEZIER for a graph. ``own`` is the piece on which the path starts, if any.
    """
    t, end, rotation = span
    motion, slack = path.motion, path.slack
    is_own, line, conic, graph, patience, reach = piece_form(kind, number, own, path, size, ground)
    here, rate, _ = piece_after(kind, line, conic, graph, t, rotation, path)
    leaving = is_own and t == 0.0
    if t == 0.0 and own.kind != NO_PIECE and not is_own and abs(here) <= reach:
        leaving = not is_in_front(kind, number, own, path.x, path.y, reach, ground)
    if kind == LINE and stays_in_front(line, span, leaving, motion, slack):
        return np.inf, satellite_after(t, rotation, path.turn, motion), CLEAR
    sign = 1.0 if here >= 0.0 or (here >= -slack and rate < 0.0) else -1.0
    if leaving:
        # the side to which the satellite moves: the front of its own piece, either side of another one
        sign = 1.0 if is_own or rate > 0.0 else -1.0
    while True:
        rest = Span(t, end, rotation)
        if kind == LINE:
            t, rotation, code = next_root(sign, leaving, line, None, None, rest, path, patience)
        elif kind == ARC:
            t, rotation, code = next_root(sign, leaving, None, conic, None, rest, path, patience)
        else:
            t, rotation, code = next_root(sign, leaving, None, None, graph, rest, path, patience)
        state, inward = satellite_after(t, rotation, path.turn, motion), 0.0
        if t >= end:
            return np.inf, state, CLEAR
        if code == BOUNCE_LIMIT:
            return t, state, code
        _, rate, bent = piece_after(kind, line, conic, graph, t, rotation, path)
        if sign > 0.0:
            inward = rate
            inside, corner = where_on_piece(kind, number, path, state, inward, ground)
            if inside:
                return t, state, CORNER if corner else code
        if code == GRAZING:
            # a tangency beside the piece: a line has no other, and the path stays outside a circle
            if kind != BEZIER:
                return np.inf, state, CLEAR
            if sign * bent <= 0.0:
                return t, state, GRAZING
            # on a graph the search goes on where F is four slacks from 0
            t += math.sqrt(8.0 * slack / (sign * bent))
            if t >= end:
                return np.inf, state, CLEAR
            rotation, leaving = turning(motion.spin * t), False
            continue
        if code == CLEAR or inward < 0.0:
            sign = -sign
        leaving = True


@inlined
def first_in_hollow(h, own, came_from, base, path, span, ground):
    """-> Touch: the first contact of one satellite with the pieces of hollow h in the cell that begins at ``base``.

    The sides of the cell of an open wall count as pieces. ``came_from`` is -1 or 1 if the satellite has just entered
    through the left or the right side.
    """
    hollows, joints, motion = ground.hollows, ground.joints, path.motion
    path = Path(path.x - base, path.y, path.turn, motion, path.slack)
    t, end, rotation = span
    none = satellite_after(t, rotation, path.turn, motion)
    touch = Touch(np.inf, Touching(ZERO, NOTHING, h), base, none, CLEAR)
    for tried, first, end_of_range in RANGES:
        for k in range(int(hollows[h, first]), int(hollows[h, end_of_range])):
            if tried != LINE or joints[k, c.STARTS_LINE] > 0.0:
                rest = Span(t, end, rotation)
                hit, there, code = first_on_piece(tried, k, own, path, rest, hollows[h, c.SIZE], ground)
                if hit < end:
                    end, touch = hit, Touch(hit, Touching(tried, k, h), base, there, code)
    if ground.is_open:
        for side in (-1, 1):
            edge = hollows[h, c.LEFT] if side < 0 else hollows[h, c.RIGHT]
            line = towards_line(side * (edge - path.x), -float(side), 0.0, path.turn, motion)
            rest = Span(t, end, rotation)
            hit, then, code = next_root(1.0, came_from == side, line, None, None, rest, path, np.inf)
            if hit < end:
                there = satellite_after(hit, then, path.turn, motion)
                end, touch = hit, Touch(hit, Touching(SIDE, side, h), base, there, code)
    return touch
