"""The compiled collision of the disk with satellites: flights and reflections until it is back at height 0.

Only `collisions/rigid` and `collisions/cylinder` import this file, inside functions, because it loads numba. Lengths
are in units of the wall, see `contact`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...scene.columns import (
    CORNER_EDGE,
    CURVATURE,
    EDGE_X,
    EDGE_Y,
    JOINT_X,
    JOINT_Y,
    LEFT,
    LEFT_EDGE,
    LENGTH,
    LINE_NORMAL_X,
    LINE_NORMAL_Y,
    NORMAL_X,
    NORMAL_Y,
    RIGHT,
    RIGHT_EDGE,
    START_X,
    START_Y,
    STRETCH,
)
from ...tracing.compiled.interruption import is_raised
from ...tracing.compiled.options import compiled, inlined
from ...tracing.compiled.rays import BOUNCE_LIMIT, CORNER, ESCAPED, GRAZING, last_hollow
from ...tracing.compiled.records import LINE, NO_PIECE, SIDE
from .columns import ALPHA, OMEGA, V1, V2, X1
from .contact import (
    CLEAR,
    NO,
    NOTHING,
    WIDEST_SLACK,
    ZERO,
    first_in_hollow,
    flight,
    next_root,
    satellite_after,
    towards_line,
    turning,
)

TOP = 7
# Cells that one satellite may pass, and satellites that may pass the lowest point, in one flight.
MOST_CELLS = 1_000_000

# Cells, or satellites, between two looks at the flag that tells a disk to end: a power of 2.
CELLS_A_LOOK = 1024

# A time that no flight takes, but that is not infinite: bounds are multiplied by it.
FOREVER = 1e30


class Place(NamedTuple):
    """Where a satellite touches the wall: kind and number of the piece, and the hollow, -1 on the tops."""

    kind: int
    piece: int
    hollow: int


class Below(NamedTuple):
    """A satellite that is below the tops: its number, its hollow (-1: there is none), and its cell's left end."""

    number: int
    hollow: int
    base: float


class Touch(NamedTuple):
    """Where a satellite is when it touches the wall, and the sine and cosine of its angle then."""

    x: float
    y: float
    turn: tuple[float, float]


@inlined
def hollow_at(hollows, place):
    """The hollow over which a place of the cell lies, or -1 over a flat top."""
    h = last_hollow(place, hollows)
    return h if h >= 0 and place < hollows[h, RIGHT] else -1


@inlined
def near_edge(hollows, place, slack):
    """Whether a place at height 0 is within the slack of an end of a hollow that is a corner."""
    for h in range(hollows.shape[0]):
        if abs(place - hollows[h, LEFT]) <= slack and hollows[h, LEFT_EDGE] == CORNER_EDGE:
            return True
        if abs(place - hollows[h, RIGHT]) <= slack and hollows[h, RIGHT_EDGE] == CORNER_EDGE:
            return True
    return False


@compiled
def dive(x, y, t, end, turned, turn, motion, slack, ground):
    """When and where a satellite comes below the tops in [t, end).

    Returns the time (inf if it does not), the turning until then, hollow (-1 where it meets a flat top), its cell's
    left end and code.
    """
    dx, dy, sine, _ = satellite_after(t, turned, turn, motion)
    if y + dy > 0.0:
        lid = towards_line(y, 0.0, 1.0, turn, motion)
        t, turned, code = next_root(1.0, NO, lid, None, t, end, turned, turn, motion, np.inf, slack)
        if t >= end or code == GRAZING:
            return np.inf, turned, -1, 0.0, CLEAR
        if code != CLEAR:
            return t, turned, -1, 0.0, code
        dx, dy, sine, _ = satellite_after(t, turned, turn, motion)
    base = math.floor((x + dx) / ground.cell) * ground.cell
    if ground.is_open:
        return t, turned, 0, base, CLEAR
    place = x + dx - base
    rising = motion.v2 + motion.omega * sine
    # at a shallow incidence a rounding error of the height is a longer way along the tops
    near = near_edge(ground.hollows, place, slack * max(1.0, motion.fastest / abs(rising)))
    # one that rises from below the tops has not come in by a known way: it touches them together with another one
    return t, turned, hollow_at(ground.hollows, place), base, CORNER if near or rising >= 0.0 else CLEAR


@compiled
def first_contact(own_kind, own_index, h, base, x, y, t, end, turn, motion, slack, ground):
    """First contact in [t, end) of one satellite with the wall.

    (x, y) is where it was at the start of the flight: on the piece ``own_kind``, ``own_index`` (or NO_PIECE), and
    in the hollow ``h`` of the cell that begins at ``base``, or above the tops if h is -1. Returns time (inf if none),
    kind, index, hollow, its cell's left end, state and code.
    """
    turned = turning(motion.spin * t) if t > 0.0 else (0.0, 0.0)
    state = satellite_after(t, turned, turn, motion)
    if own_kind == TOP:
        # it rises, and its path bends upward
        return np.inf, NO_PIECE, -1, -1, base, state, CLEAR
    if h < 0:
        t, turned, h, base, code = dive(x, y, t, end, turned, turn, motion, slack, ground)
        state = satellite_after(t, turned, turn, motion)
        if t >= end:
            return np.inf, NO_PIECE, -1, -1, base, state, CLEAR
        if h < 0 or code != CLEAR:
            return t, TOP, -1, -1, base, state, code
    came_from = ZERO
    for cell in range(MOST_CELLS):
        if cell & (CELLS_A_LOOK - 1) == CELLS_A_LOOK - 1 and is_raised(ground.stop):
            break
        t, kind, index, state, code = first_in_hollow(
            h, own_kind, own_index, came_from, x - base, y, t, end, turned, turn, motion, slack, ground
        )
        if kind != SIDE or code == BOUNCE_LIMIT:
            return t, kind, index, h, base, state, code
        if y + state.dy > 0.0 and motion.v2 + motion.omega * state.sine > 0.0:
            return np.inf, NO_PIECE, -1, -1, base, state, CLEAR
        turned = turning(motion.spin * t)
        base += index * ground.cell
        came_from = -index
        own_kind = ZERO
    return t, NO_PIECE, -1, h, base, state, BOUNCE_LIMIT


@inlined
def surface(kind, index, x, y, ground):
    """The point (x, y) put back on the piece that it hit, and the unit normal there, towards the free side."""
    joints, lines, arcs = ground.joints, ground.lines, ground.arcs
    if kind == LINE:
        n1, n2 = lines[index, LINE_NORMAL_X], lines[index, LINE_NORMAL_Y]
        ex, ey, length = lines[index, EDGE_X], lines[index, EDGE_Y], lines[index, LENGTH]
        share = ((x - joints[index, JOINT_X]) * ex + (y - joints[index, JOINT_Y]) * ey) / (length * length)
        near = index if share <= 0.5 else index + 1
        if near != index:
            share -= 1.0
        return joints[near, JOINT_X] + share * ex, joints[near, JOINT_Y] + share * ey, n1, n2
    curvature, stretch = arcs[index, CURVATURE], arcs[index, STRETCH]
    qx, qy = x - arcs[index, START_X], stretch * (y - arcs[index, START_Y])
    n1, n2 = arcs[index, NORMAL_X] - curvature * qx, arcs[index, NORMAL_Y] - curvature * qy
    f = 0.5 * ((arcs[index, NORMAL_X] + n1) * qx + (arcs[index, NORMAL_Y] + n2) * qy)
    qx -= f * n1
    qy -= f * n2
    n1, n2 = arcs[index, NORMAL_X] - curvature * qx, stretch * (arcs[index, NORMAL_Y] - curvature * qy)
    norm = 1.0 / math.sqrt(n1 * n1 + n2 * n2)
    return arcs[index, START_X] + qx, arcs[index, START_Y] + qy / stretch, n1 * norm, n2 * norm


@inlined
def satellite_at(x, y, turn, j, ring):
    """Where the j-th satellite after the one at (x, y) and the angle (sine, cosine) is, and its angle alike.

    It is a chord away, so that its place is not the difference of two of the disk's size. For neighbours, nearly all
    that are asked for, no sine is computed.
    """
    half_sine, half_cosine = j * ring.half_sine, ring.half_cosine
    if abs(j) != 1:
        half = 0.5 * j * ring.spacing
        half_sine, half_cosine = math.sin(half), math.cos(half)
    sine, cosine = turn
    across = 2.0 * half_sine * (cosine * half_cosine - sine * half_sine)
    upward = 2.0 * half_sine * (sine * half_cosine + cosine * half_sine)
    return x + across / ring.scale, y + upward / ring.scale, (sine + across, cosine - upward)


@inlined
def lowest_until(time, angle, away, height, motion):
    """A bound from below of a satellite's height until then; it starts at ``angle``, which grows if it turns ``away``.

    The disk's lowest point starts at ``height``, and 1 - cos a is at least a^2/2 - a^4/24.
    """
    nearest = abs(angle) if away else max(abs(angle) - abs(motion.spin) * time, 0.0)
    square = nearest * nearest
    return height + min(motion.v2, 0.0) * time + motion.radius * square * (0.5 - square / 24.0)


@inlined
def out_of_reach_after(angle, motion, ring):
    """When a satellite now at ``angle`` is out of reach, with a spacing to spare; after a turn it comes as another."""
    if motion.spin == 0.0:
        return np.inf
    ahead = -angle if motion.spin > 0.0 else angle
    return (ring.reach + ring.spacing + ahead) / abs(motion.spin)


@inlined
def first_of_all(own, below, x, y, height, angle, turn, motion, end, ring, ground):
    """First contact of any satellite before ``end``.

    The satellite 0 is at (x, y), the disk at ``height``, and ``own`` is its (kind, index, hollow); ``below`` is the
    (number, hollow, base) of another one that is below the tops, with hollow -1 for none. Returns the time, which is
    ``end`` if there is none, (kind, index, hollow), base, the satellite's number, its place with the sine and cosine
    of its angle, and code.
    """
    reach, slack, rate = ring.reach, ring.slack, abs(motion.spin)
    passed = out_of_reach_after(angle, motion, ring)
    time, kind, index, hollow, base, state, code = first_contact(
        own.kind, own.piece, own.hollow, 0.0, x, y, 0.0, min(end, passed), turn, motion, slack, ground
    )
    hit, chosen, touched = Place(kind, index, hollow), 0, Touch(x + state.dx, y + state.dy, (state.sine, state.cosine))
    time = min(time, end)
    # the others in the order in which they come within reach of the wall
    step = -1 if motion.spin > 0.0 else 1
    # numba's floor is a float
    j = -step * int(math.floor((reach + step * angle) / ring.spacing))  # noqa: RUF046
    for count in range(MOST_CELLS):
        if count & (CELLS_A_LOOK - 1) == CELLS_A_LOOK - 1 and is_raised(ground.stop):
            break
        other = angle + j * ring.spacing
        away = other * motion.spin >= 0.0
        beyond = abs(other) - reach
        if beyond > 0.0 and (away or beyond >= rate * time):
            break
        if j != 0 and lowest_until(time, other, away, height, motion) <= 2.0 * slack:
            # two contacts are at one time if the disk falls less than the slack between them
            tie = slack / max(abs(motion.v2), motion.fastest / WIDEST_SLACK) if hit.kind != NO_PIECE else 0.0
            until = min(time + tie, out_of_reach_after(other, motion, ring))
            start = beyond / rate if beyond > 0.0 else 0.0
            x_other, y_other, turn_other = satellite_at(x, y, turn, j, ring)
            sine_other, _ = turn_other
            # the path bends upward, so that it stays above its first tangent
            if start > 0.0 or y_other <= 0.0 or y_other + (motion.v2 + motion.omega * sine_other) * until < 0.0:
                inside, left = (below.hollow, below.base) if j == below.number else (NOTHING, 0.0)
                t, kind, index, hollow, left, state, unclear = first_contact(
                    ZERO, NOTHING, inside, left, x_other, y_other, start, until, turn_other, motion, slack, ground
                )
                tied = hit.kind != NO_PIECE and abs(t - time) <= tie
                if t < time:
                    time, hit, base, code, chosen = t, Place(kind, index, hollow), left, unclear, j
                    touched = Touch(x_other + state.dx, y_other + state.dy, (state.sine, state.cosine))
                if tied:
                    code = CORNER
        j += step
    else:
        code = BOUNCE_LIMIT
    return time, hit, base, chosen, touched, code


@compiled
def left_below(own, below, x, y, angle, turn, time, chosen, touched, motion, ring, ground):
    """The neighbour of the satellite ``chosen`` that is below the tops when that one touches the wall, as ``below``.

    Under an overhang its place does not tell its hollow; where it came in does. At most one satellite is below the
    tops beside the one that touches.
    """
    if ground.is_open:
        return Below(ZERO, NOTHING, 0.0)
    later = angle + motion.spin * time + chosen * ring.spacing
    for side in (-1, 1):
        if abs(later + side * ring.spacing) <= ring.reach:
            _, height, _ = satellite_at(touched.x, touched.y, touched.turn, side, ring)
            if height <= 0.0:
                j = chosen + side
                if j == 0 and own.hollow >= 0:
                    return Below(j, own.hollow, 0.0)
                if j == below.number and below.hollow >= 0:
                    return below
                other = angle + j * ring.spacing
                x_other, y_other, turn_other = satellite_at(x, y, turn, j, ring)
                start = 0.0
                if abs(other) > ring.reach:
                    # it came within reach on the way
                    start = (abs(other) - ring.reach) / abs(motion.spin)
                t, _, h, base, _ = dive(
                    x_other, y_other, start, time, turning(motion.spin * start), turn_other, motion, ring.slack, ground
                )
                if t < time:
                    return Below(j, h, base)
    return Below(ZERO, NOTHING, 0.0)


@inlined
def reflect(v1, v2, omega, n1, n2, turn, disk):
    """Velocities after an impulse along the wall's normal n at a satellite: specular in the kinetic metric."""
    mass, inertia = disk
    sine, cosine = turn
    by_mass, by_inertia = 1.0 / mass, 1.0 / inertia
    arm = n1 * cosine + n2 * sine
    inward = (v1 + omega * cosine) * n1 + (v2 + omega * sine) * n2
    impulse = -2.0 * inward / (by_mass + arm * arm * by_inertia)
    v1 += impulse * n1 * by_mass
    v2 += impulse * n2 * by_mass
    omega += impulse * arm * by_inertia
    # one Newton step on the kinetic norm keeps rounding errors from adding up
    energy = mass * (v1 * v1 + v2 * v2) + inertia * omega * omega
    scale = 1.5 - 0.5 * energy
    return scale * v1, scale * v2, scale * omega


@inlined
def collide_disk(place, angle, v1, v2, omega, disk, ring, limit, ground):
    """One collision of a disk that comes down at height 0, its lowest satellite at ``angle`` from the lowest point.

    ``disk`` is (m, J) with m + J = 1. The velocities have kinetic norm 1. Returns the disk's displacement, its turn,
    the time, the velocities, contacts, whether two satellites took part, and the status.
    """
    scale, spacing = ring.scale, ring.spacing
    travel, turned, passed, contacts, two = 0.0, 0.0, 0.0, 0, False
    sine, versed = turning(angle)
    x, y, height = place + sine / scale, versed / scale, 0.0
    own, below = Place(ZERO, NOTHING, NOTHING), Below(ZERO, NOTHING, 0.0)
    while not is_raised(ground.stop):
        turn, motion = (sine, 1.0 - versed), flight(v1, v2, omega, scale)
        # by then it is back, or would be lower than it can be
        if v2 > 0.0:
            end = max(-height / v2, 0.0)
        elif v2 < 0.0:
            end = -(height + ring.floor) / v2
        elif omega != 0.0:
            end = MOST_CELLS * spacing / abs(motion.spin)
        else:
            return travel, turned, passed, v1, v2, omega, contacts, two, BOUNCE_LIMIT
        time, hit, base, chosen, touched, code = first_of_all(
            own, below, x, y, height, angle, turn, motion, end, ring, ground
        )
        travel += v1 * time
        turned += motion.spin * time
        passed += time
        if code != CLEAR:
            return travel, turned, passed, v1, v2, omega, contacts, two, code
        if hit.kind == NO_PIECE:
            return travel, turned, passed, v1, v2, omega, contacts, two, ESCAPED if v2 > 0.0 else BOUNCE_LIMIT
        if contacts >= limit:
            return travel, turned, passed, v1, v2, omega, contacts, two, BOUNCE_LIMIT
        left = left_below(own, below, x, y, angle, turn, time, chosen, touched, motion, ring, ground)
        below = Below(left.number - chosen, left.hollow, left.base - base)
        two = two or (contacts > 0 and chosen != 0)
        contacts += 1
        angle += chosen * spacing + motion.spin * time
        sine, versed = turning(angle)
        own, x, y, n1, n2 = hit, touched.x - base, 0.0, 0.0, 1.0
        if hit.kind != TOP:
            x, y, n1, n2 = surface(hit.kind, hit.piece, x, touched.y, ground)
        height = y - versed / scale
        v1, v2, omega = reflect(v1, v2, omega, n1, n2, (sine, 1.0 - versed), disk)
    return travel, turned, passed, v1, v2, omega, contacts, two, BOUNCE_LIMIT


@compiled
def collide_disks(
    position, velocity, disk, ring, limit, ground, out_position, out_velocity, times, contacts, two_satellites, status,
):  # fmt: skip
    """Collide a block of disks; fills the output arrays."""
    mass, inertia = disk
    scale, spacing = ring.scale, ring.spacing
    width = scale * ground.cell
    for i in range(position.shape[0]):
        if is_raised(ground.stop):
            break
        norm = math.sqrt(mass * (velocity[i, V1] ** 2 + velocity[i, V2] ** 2) + inertia * velocity[i, OMEGA] ** 2)
        place = (position[i, X1] - math.floor(position[i, X1] / width) * width) / scale
        angle = position[i, ALPHA] - spacing * round(position[i, ALPHA] / spacing)
        travel, turned, time, v1, v2, omega, contacts[i], two_satellites[i], status[i] = collide_disk(
            place,
            angle,
            velocity[i, V1] / norm,
            velocity[i, V2] / norm,
            velocity[i, OMEGA] / norm,
            disk,
            ring,
            limit,
            ground,
        )
        out_position[i, X1] = position[i, X1] + scale * travel
        out_position[i, ALPHA] = position[i, ALPHA] + turned
        out_velocity[i, V1], out_velocity[i, V2], out_velocity[i, OMEGA] = norm * v1, norm * v2, norm * omega
        times[i] = scale * time / norm


@inlined
def roll_disk(place, v1, v2, omega, disk, deepest, slack, limit, ground):
    """One collision on the cylinder: the contact moves on a straight line with the velocity (v1 + omega, v2).

    It starts at (place, 0); ``deepest`` is the wall's depth. Returns the disk's displacement, its turn, the time, the
    velocities, contacts and status.
    """
    travel, turned, passed, contacts = 0.0, 0.0, 0.0, 0
    x, y = place, 0.0
    own = Place(ZERO, NOTHING, NOTHING)
    while not is_raised(ground.stop):
        motion = flight(v1 + omega, v2, 0.0, 1.0)
        end = FOREVER
        if v2 > 0.0:
            end = -y / v2
        elif v2 < 0.0:
            end = min(2.0 * (y + deepest + ground.cell) / -v2, FOREVER)
        time, kind, index, hollow, base, state, code = first_contact(
            own.kind, own.piece, own.hollow, 0.0, x, y, 0.0, end, (0.0, 1.0), motion, slack, ground
        )
        time = min(time, end)
        travel += v1 * time
        turned += omega * time
        passed += time
        if code == CLEAR and kind == NO_PIECE:
            code = ESCAPED if v2 > 0.0 else BOUNCE_LIMIT
            return travel, turned, passed, v1, v2, omega, contacts, code
        if code == CLEAR and contacts >= limit:
            code = BOUNCE_LIMIT
        if code != CLEAR:
            return travel, turned, passed, v1, v2, omega, contacts, code
        contacts += 1
        own, x, y, n1, n2 = Place(kind, index, hollow), x + state.dx - base, y + state.dy, 0.0, 1.0
        if kind == TOP:
            y = 0.0
        else:
            x, y, n1, n2 = surface(kind, index, x, y, ground)
        v1, v2, omega = reflect(v1, v2, omega, n1, n2, (0.0, 1.0), disk)
    return travel, turned, passed, v1, v2, omega, contacts, BOUNCE_LIMIT


@compiled
def roll_disks(
    position, velocity, disk, scale, deepest, slack, limit, ground, out_position, out_velocity, times, contacts, status,
):  # fmt: skip
    """Collide a block of disks on the cylinder; fills the output arrays."""
    mass, inertia = disk
    for i in range(position.shape[0]):
        if is_raised(ground.stop):
            break
        norm = math.sqrt(mass * (velocity[i, V1] ** 2 + velocity[i, V2] ** 2) + inertia * velocity[i, OMEGA] ** 2)
        place = (position[i, X1] + position[i, ALPHA]) / scale
        travel, turned, time, v1, v2, omega, contacts[i], status[i] = roll_disk(
            place - math.floor(place / ground.cell) * ground.cell, velocity[i, V1] / norm, velocity[i, V2] / norm,
            velocity[i, OMEGA] / norm, disk, deepest, slack, limit, ground,
        )  # fmt: skip
        out_position[i, X1] = position[i, X1] + scale * travel
        out_position[i, ALPHA] = position[i, ALPHA] + scale * turned
        out_velocity[i, V1], out_velocity[i, V2], out_velocity[i, OMEGA] = norm * v1, norm * v2, norm * omega
        times[i] = scale * time / norm
