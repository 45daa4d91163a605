"""The compiled loop over the events of a gas of equal disks. Loads numba.

Every disk has one event: it meets another disk or a wall, or it enters a neighbouring cell of a grid. An indexed heap
orders the events. The event with a partner that has collided since is predicted anew. A disk moves only in its events,
and has a time of its own. Cells are numbered modulo the size of the grid, so containers without bounds need no others.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np
from numba import types

from ....core.rounding import EPS
from ...curves import columns as c
from ...scene.compiled.compiling import Table, call_late, compiled, inlined, linked, named, reader_of
from ...tables.compiled.flights import FLYING, frame, next_wall
from ...tracing.compiled.rays import ESCAPED
from ...tracing.compiled.trigonometry import LAST_ANGLE

# Numbers of a disk: centre, arc along which the rim has turned, velocities of the centre and the rim at its own time;
# the times of its next event and of the next wall.
X, Y, ARC, V1, V2, RIM, OWN, NEXT, WALL_TIME = 0, 1, 2, 3, 4, 5, 6, 7, 8
FLOATS = 9
# The wall on which it is or -1; collisions; the next event, see below, and how many collisions its partner then had;
# place in the heap, and disk at the place of this row; cell, and neighbours in its list; periods passed; the next wall
# and the `FlightStatus` there.
LAST, STAMP, KIND, WANTED, PLACE, HEAP, CELL_X, CELL_Y, AFTER, BEFORE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
IMAGE_X, IMAGE_Y, WALL, STATUS = 10, 11, 12, 13
INTS = 14
# Kinds of events beside the number of the partner: NO_EVENT, CROSSING - side for the left, right, lower or upper side
# of the cell, and -1 - w for wall w.
NO_EVENT, CROSSING = -(2**40), -(2**40) + 8
# Terms of a law: probability of the terms up to this one, period of a wall; kind and address of the tables of the wall.
UPPER, PERIOD, FORM, ADDRESS = 0, 1, 0, 1
SPECULAR, RETRO, LAMBERT, TRACED, ASKED = 0, 1, 2, 3, 4
# Sums: present time; of the squares of the rims, and of fourth powers; the root mean square velocity; the question
# asked of Python and its answer; then integrals over time and the counts of a record, of each wall two impulses.
NOW, RIM2, V4, RIM4, SPEED, THETA, UNIFORM, ANSWER, GAP, INTEGRALS = 0, 1, 2, 3, 4, 5, 6, 7, 12, 13
RIM2_TIME, V4_TIME, RIM4_TIME, PAIRS, WALLS, VIRIAL, IMPULSE = 13, 14, 15, 16, 17, 18, 19
# Integers: events made, number of the next uniform number, answer that is there, disks to be predicted, the law and
# the term that are asked; disk, partner and wall of the last event; cells entered since then.
EVENTS, DRAWN, ANSWERED, FIRST, SECOND, LAW, TERM, EVENT_DISK, EVENT_PARTNER, EVENT_WALL = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
CROSSED, FLOW = 10, 11
NO_ANSWER, AN_ANGLE, A_VELOCITY = 0, 1, 2
# Why `advance` returns.
DONE, TIME, UNIFORMS, QUESTION, FLIGHTS, FREE, UNRESOLVED = 0, 1, 2, 3, 4, 5, 6
# Disks within this fraction of the squared diameter touch; they do not collide if they approach by rounding only, which
# is a fraction of the root mean square velocity.
TOUCHING, RESTING = 4e-12, 16.0 * EPS
# Cells entered without an event, half a second of work, after which no disk is taken to meet anything any more.
MOST_CROSSED = 2**23
# A squared relative velocity along the normal above this fraction may be positive but for rounding.
NEARLY = -1e-9
SQRT_HALF, TINIEST = math.sqrt(0.5), 5e-324


# The state of a gas, its grid, walls and laws, and the addresses that `trace_rays` takes. A torus has periods, a
# container 0; ``across`` and ``root`` are (1/m + 1/I)^(-1/2) and m^(1/2), with I = J/r^2 the rim's mass.
Gas = namedtuple(
    "Gas",
    "floats ints heads walls corners weights forms first_terms sums flow uniforms ray_x ray_theta ray_out ray_status "
    "size wall_count corner_count cells_x cells_y uniform_count asks_walls tracer rays details slots "
    "left bottom cell_width cell_height period_x period_y diameter slack mass rim_mass across root",
)
number, integer = types.float64, types.int64
gas_at = reader_of(
    named(
        Gas, Table(FLOATS), Table(INTS, integer), types.CPointer(integer), Table(c.WALL_COLUMNS), Table(2), Table(2),
        Table(2, integer), types.CPointer(integer), types.CPointer(number), types.CPointer(integer),
        *[types.CPointer(number)] * 4, types.CPointer(types.uint8), *[integer] * 11, *[number] * 12,
    )
)  # fmt: skip


@linked
def sift_up(gas, place):
    """-> int: the place to which the event at a place of the heap rises."""
    floats, ints = gas.floats, gas.ints
    disk = ints[place, HEAP]
    time = floats[disk, NEXT]
    while place > 0:
        above = (place - 1) >> 1
        other = ints[above, HEAP]
        if floats[other, NEXT] <= time:
            break
        ints[place, HEAP], ints[other, PLACE] = other, place
        place = above
    ints[place, HEAP], ints[disk, PLACE] = disk, place
    return place


@linked
def sift_down(gas, place):
    """Let the event at a place of the heap sink."""
    floats, ints = gas.floats, gas.ints
    disk = ints[place, HEAP]
    time = floats[disk, NEXT]
    while True:
        below = 2 * place + 1
        if below >= gas.size:
            break
        if below + 1 < gas.size and floats[ints[below + 1, HEAP], NEXT] < floats[ints[below, HEAP], NEXT]:
            below += 1
        other = ints[below, HEAP]
        if floats[other, NEXT] >= time:
            break
        ints[place, HEAP], ints[other, PLACE] = other, place
        place = below
    ints[place, HEAP], ints[disk, PLACE] = disk, place


@inlined
def cell_of(gas, i):
    """-> int: the cell in whose list a disk is."""
    return (gas.ints[i, CELL_X] % gas.cells_x) * gas.cells_y + gas.ints[i, CELL_Y] % gas.cells_y


@inlined
def link(gas, i):
    """Put a disk into the list of its cell."""
    cell = cell_of(gas, i)
    other = gas.heads[cell]
    gas.ints[i, BEFORE], gas.ints[i, AFTER] = -1, other
    if other >= 0:
        gas.ints[other, BEFORE] = i
    gas.heads[cell] = i


@inlined
def unlink(gas, i):
    """Take a disk from the list of its cell."""
    before, after = gas.ints[i, BEFORE], gas.ints[i, AFTER]
    if before >= 0:
        gas.ints[before, AFTER] = after
    else:
        gas.heads[cell_of(gas, i)] = after
    if after >= 0:
        gas.ints[after, BEFORE] = before


@inlined
def move(gas, i, now):
    """Move a disk to the present."""
    floats = gas.floats
    step = now - floats[i, OWN]
    floats[i, X] += floats[i, V1] * step
    floats[i, Y] += floats[i, V2] * step
    floats[i, ARC] += floats[i, RIM] * step
    floats[i, OWN] = now


@inlined
def between(gas, dx, dy):
    """-> (dx, dy): the vector to the nearest image in a torus."""
    if gas.period_x > 0.0:
        dx -= gas.period_x * np.rint(dx / gas.period_x)
        dy -= gas.period_y * np.rint(dy / gas.period_y)
    return dx, dy


@inlined
def neighbour(k, count):
    """-> int: a number from -1 to ``count``, modulo ``count``."""
    return k + count if k < 0 else (k - count if k >= count else k)


@inlined
def next_side(gas, i, x, y, vx, vy, best, kind):
    """-> (time, kind): the next crossing of a side of the cell, if it comes before the best event so far."""
    cell_x, cell_y = gas.ints[i, CELL_X], gas.ints[i, CELL_Y]
    if vx != 0.0:
        side = gas.left + gas.cell_width * (cell_x + 1 if vx > 0.0 else cell_x)
        time = max((side - x) / vx, 0.0)
        if time < best:
            best, kind = time, CROSSING - 1 if vx > 0.0 else CROSSING
    if vy != 0.0:
        side = gas.bottom + gas.cell_height * (cell_y + 1 if vy > 0.0 else cell_y)
        time = max((side - y) / vy, 0.0)
        if time < best:
            best, kind = time, CROSSING - 3 if vy > 0.0 else CROSSING - 2
    return best, kind


@inlined
def meeting(gas, dx, dy, ux, uy, best):
    """-> float: the time after which disks at this distance and relative velocity touch; inf if not before ``best``."""
    closing = -(dx * ux + dy * uy)
    if not closing > 0.0:
        return math.inf
    excess, square = dx * dx + dy * dy - gas.diameter * gas.diameter, ux * ux + uy * uy
    # first a test without a cross product, which most pairs fail
    rest = closing * closing - square * excess
    if rest <= NEARLY * closing * closing or excess >= best * (closing + math.sqrt(max(rest, 0.0))):
        return math.inf
    across, reach = dx * uy - dy * ux, gas.diameter * math.sqrt(square)
    if abs(across) > reach:
        return math.inf
    is_touching = excess <= TOUCHING * gas.diameter * gas.diameter
    if is_touching and closing <= RESTING * gas.sums[SPEED] * gas.diameter:
        return math.inf
    return max(excess, 0.0) / (closing + math.sqrt(max((reach - across) * (reach + across), 0.0)))


@linked
def predict(gas, i, now):
    """Find the next event of a disk, whose next wall is known, and give it its place in the heap."""
    floats, ints = gas.floats, gas.ints
    step, vx, vy = now - floats[i, OWN], floats[i, V1], floats[i, V2]
    x, y = floats[i, X] + vx * step, floats[i, Y] + vy * step
    best, kind = next_side(gas, i, x, y, vx, vy, floats[i, WALL_TIME] - now, ints[i, WALL])
    cell_x, cell_y = ints[i, CELL_X] % gas.cells_x, ints[i, CELL_Y] % gas.cells_y
    for a in range(-1, 2):
        row = neighbour(cell_x + a, gas.cells_x) * gas.cells_y
        for b in range(-1, 2):
            j = gas.heads[row + neighbour(cell_y + b, gas.cells_y)]
            while j >= 0:
                if j != i:
                    other = now - floats[j, OWN]
                    ux, uy = vx - floats[j, V1], vy - floats[j, V2]
                    dx, dy = x - (floats[j, X] + floats[j, V1] * other), y - (floats[j, Y] + floats[j, V2] * other)
                    dx, dy = between(gas, dx, dy)
                    time = meeting(gas, dx, dy, ux, uy, best)
                    if time < best:
                        best, kind = time, j
                j = ints[j, AFTER]
    floats[i, NEXT], ints[i, KIND] = now + best, kind
    ints[i, WANTED] = ints[kind, STAMP] if kind >= 0 else 0


@linked
def renew(gas, i, now):
    """Predict a disk, and give its event its place in the heap."""
    predict(gas, i, now)
    sift_down(gas, sift_up(gas, gas.ints[i, PLACE]))


@linked
def predict_collided(gas):
    """Predict the disks of the last collision, with their next walls."""
    floats, ints = gas.floats, gas.ints
    for k in range(FIRST, SECOND + 1):
        i = gas.flow[k]
        if i >= 0:
            now = floats[i, OWN]
            if gas.wall_count > 0 and gas.asks_walls == 0:
                position, velocity = (floats[i, X], floats[i, Y]), (floats[i, V1], floats[i, V2])
                time, wall, ints[i, STATUS] = next_wall(
                    gas.walls, gas.wall_count, gas.corners, gas.corner_count, gas.slack, *position, *velocity,
                    ints[i, LAST], math.inf, -1,
                )  # fmt: skip
                floats[i, WALL_TIME], ints[i, WALL] = now + time, -1 - wall if wall >= 0 else NO_EVENT
            renew(gas, i, now)
            gas.flow[k] = -1


@linked
def cross(gas, i, now, side):
    """Move a disk into a neighbouring cell."""
    floats, ints = gas.floats, gas.ints
    move(gas, i, now)
    unlink(gas, i)
    ints[i, CELL_X] += (1 if side == 1 else 0) - (1 if side == 0 else 0)
    ints[i, CELL_Y] += (1 if side == 3 else 0) - (1 if side == 2 else 0)
    if gas.period_x > 0.0:
        turns = (1 if ints[i, CELL_X] == gas.cells_x else 0) - (1 if ints[i, CELL_X] < 0 else 0)
        ints[i, CELL_X] -= turns * gas.cells_x
        ints[i, IMAGE_X] += turns
        floats[i, X] -= turns * gas.period_x
        turns = (1 if ints[i, CELL_Y] == gas.cells_y else 0) - (1 if ints[i, CELL_Y] < 0 else 0)
        ints[i, CELL_Y] -= turns * gas.cells_y
        ints[i, IMAGE_Y] += turns
        floats[i, Y] -= turns * gas.period_y
    link(gas, i)


@linked
def outcome(gas, law, theta, u):
    """-> float: the outgoing angle for a uniform number; nan if Python is to say, for the term that is stored."""
    term, low = gas.first_terms[law], 0.0
    while u >= gas.weights[term, UPPER] and term + 1 < gas.first_terms[law + 1]:
        low = gas.weights[term, UPPER]
        term += 1
    u = min(max((u - low) / (gas.weights[term, UPPER] - low), TINIEST), 1.0 - 0.5 * EPS)
    form = gas.forms[term, FORM]
    if form == SPECULAR:
        return min(math.pi - theta, LAST_ANGLE)
    if form == RETRO:
        return theta
    if form == LAMBERT:
        return 2.0 * math.asin(math.sqrt(u))
    if form == TRACED:
        gas.ray_x[0], gas.ray_theta[0] = u * gas.weights[term, PERIOD], theta
        arguments = np.int64(1), gas.rays, gas.forms[term, ADDRESS], np.int64(2**62), gas.details, gas.slots
        call_late(gas.tracer, None, arguments)
        if gas.ray_status[0] == ESCAPED:
            return gas.ray_out[0]
    gas.flow[LAW], gas.flow[TERM], gas.sums[THETA], gas.sums[UNIFORM] = law, term, theta, u
    return math.nan


@inlined
def add_moments(gas, i, sign):
    """Add the powers of the velocities of a disk to the sums, or subtract them."""
    v1, v2, rim = gas.floats[i, V1] ** 2, gas.floats[i, V2] ** 2, gas.floats[i, RIM] ** 2
    gas.sums[RIM2] += sign * rim
    gas.sums[V4] += sign * (v1 * v1 + v2 * v2)
    gas.sums[RIM4] += sign * rim * rim


@linked
def push(gas, i, j, px, py, turn):
    """-> float: the factor of an impulse on disk i, and the opposite one on j, with which the energy is kept.

    The impulse is applied. s L + s^2 Q = 0 for the energies L and Q that it adds to first and second order.
    """
    floats = gas.floats
    linear = px * floats[i, V1] + py * floats[i, V2] + turn * floats[i, RIM]
    square = 0.5 * ((px * px + py * py) / gas.mass + turn * turn / gas.rim_mass)
    add_moments(gas, i, -1.0)
    if j >= 0:
        linear += turn * floats[j, RIM] - px * floats[j, V1] - py * floats[j, V2]
        square *= 2.0
        add_moments(gas, j, -1.0)
    factor = -linear / square if square > 0.0 else 1.0
    px, py, turn = factor * px, factor * py, factor * turn
    floats[i, V1] += px / gas.mass
    floats[i, V2] += py / gas.mass
    floats[i, RIM] += turn / gas.rim_mass
    add_moments(gas, i, 1.0)
    if j >= 0:
        floats[j, V1] -= px / gas.mass
        floats[j, V2] -= py / gas.mass
        floats[j, RIM] += turn / gas.rim_mass
        add_moments(gas, j, 1.0)
    return factor


@linked
def count(gas, i, j, wall, now, normal, along, distance):
    """Add the time since the last event to the integrals, and a collision with its impulses to the counts."""
    sums, ints, flow = gas.sums, gas.ints, gas.flow
    if j >= 0:
        ints[j, STAMP] += 1
        ints[j, LAST] = -1
        sums[PAIRS] += 1.0
        sums[VIRIAL] += distance * normal
        sums[GAP] = min(sums[GAP], distance / gas.diameter - 1.0)
    else:
        sums[WALLS] += 1.0
        sums[IMPULSE + 2 * wall] += normal
        sums[IMPULSE + 2 * wall + 1] += along
    ints[i, STAMP] += 1
    ints[i, LAST] = wall
    flow[EVENT_DISK], flow[EVENT_PARTNER], flow[EVENT_WALL] = i, j, wall
    flow[FIRST], flow[SECOND] = i, j
    flow[ANSWERED] = NO_ANSWER
    flow[DRAWN] += 1
    flow[EVENTS] += 1
    flow[CROSSED] = 0


@linked
def collide(gas, i, kind, now):
    """-> bool: whether the collision of a disk with another one or a wall is made; else Python is asked."""
    floats, sums = gas.floats, gas.sums
    wall, j = (-1, kind) if kind >= 0 else (-1 - kind, -1)
    ux, uy, rim, distance, share = floats[i, V1], floats[i, V2], floats[i, RIM], gas.diameter, 1.0
    if j >= 0:
        dx, dy = between(gas, floats[i, X] - floats[j, X], floats[i, Y] - floats[j, Y])
        distance = math.sqrt(dx * dx + dy * dy)
        nx, ny, share = dx / distance, dy / distance, SQRT_HALF
        ux, uy, rim = ux - floats[j, V1], uy - floats[j, V2], rim + floats[j, RIM]
    else:
        floats[i, X], floats[i, Y], nx, ny = frame(gas.walls, wall, floats[i, X], floats[i, Y])
    if gas.flow[ANSWERED] == A_VELOCITY:
        nx, ny = sums[ANSWER + 3], sums[ANSWER + 4]
        px, py = gas.mass * (sums[ANSWER] - ux), gas.mass * (sums[ANSWER + 1] - uy)
        turn = gas.rim_mass * (sums[ANSWER + 2] - rim)
    else:
        across, root = share * gas.across, share * gas.root
        along, up = across * (ux * ny - uy * nx + rim), root * (ux * nx + uy * ny)
        after = sums[ANSWER]
        if gas.flow[ANSWERED] == NO_ANSWER:
            theta = min(max(math.atan2(abs(up), -along), TINIEST), LAST_ANGLE)
            after = outcome(gas, 0 if j >= 0 else 1 + wall, theta, gas.uniforms[gas.flow[DRAWN]])
            if math.isnan(after):
                return False
        size = math.sqrt(along * along + up * up)
        turn, normal = (size * math.cos(after) - along) * across, (size * math.sin(after) - up) * root
        px, py = turn * ny + normal * nx, normal * ny - turn * nx
    step = now - sums[NOW]
    sums[RIM2_TIME] += step * sums[RIM2]
    sums[V4_TIME] += step * sums[V4]
    sums[RIM4_TIME] += step * sums[RIM4]
    sums[NOW] = now
    factor = push(gas, i, j, px, py, turn)
    count(gas, i, j, wall, now, factor * (px * nx + py * ny), factor * (px * ny - py * nx), distance)
    return True


@compiled
def advance(address, events, until):
    """-> int: make events, up to a number in all or to a time, until Python is needed; why it ends."""
    gas = gas_at(address)
    while True:
        if gas.flow[FIRST] >= 0:
            predict_collided(gas)
        if gas.flow[EVENTS] >= events:
            return DONE
        i = gas.ints[0, HEAP]
        now, kind = gas.floats[i, NEXT], gas.ints[i, KIND]
        if now == math.inf or gas.flow[CROSSED] > MOST_CROSSED:
            return FREE
        if now > until:
            return TIME
        if kind <= CROSSING:
            gas.flow[CROSSED] += 1
            cross(gas, i, now, CROSSING - kind)
            renew(gas, i, now)
        elif kind >= 0 and gas.ints[kind, STAMP] != gas.ints[i, WANTED]:
            renew(gas, i, now)
        elif kind < 0 and gas.ints[i, STATUS] != FLYING:
            return UNRESOLVED
        elif gas.flow[DRAWN] >= gas.uniform_count:
            return UNIFORMS
        else:
            move(gas, i, now)
            if kind >= 0:
                move(gas, kind, now)
            if not collide(gas, i, kind, now):
                return QUESTION
            if gas.asks_walls > 0:
                return FLIGHTS


@compiled
def start(address):
    """Put the disks, whose next walls are known, into cells, and their events into the heap."""
    gas = gas_at(address)
    floats, ints = gas.floats, gas.ints
    for cell in range(gas.cells_x * gas.cells_y):
        gas.heads[cell] = -1
    for i in range(gas.size):
        ints[i, CELL_X] = math.floor((floats[i, X] - gas.left) / gas.cell_width)
        ints[i, CELL_Y] = math.floor((floats[i, Y] - gas.bottom) / gas.cell_height)
        if gas.period_x > 0.0:
            ints[i, CELL_X] = min(ints[i, CELL_X], gas.cells_x - 1)
            ints[i, CELL_Y] = min(ints[i, CELL_Y], gas.cells_y - 1)
        link(gas, i)
        ints[i, HEAP] = ints[i, PLACE] = i
    for i in range(gas.size):
        predict(gas, i, 0.0)
    for place in range(gas.size // 2, -1, -1):
        sift_down(gas, place)
