"""The compiled collision of the disk with satellites: free motion and reflections until its return to height 0.

Loads numba. Lengths are in units of the wall, see `contact`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...scene import columns as c
from ...tracing.compiled.pieces.arcs import arc_form, arc_point
from ...tracing.compiled.pieces.formulas import opening_at
from ...tracing.compiled.pieces.lines import line_at
from ...tracing.compiled.pieces.options import compiled, inlined, inner
from ...tracing.compiled.pieces.pointers import is_raised
from ...tracing.compiled.pieces.records import BEZIER, LINE, NO_PIECE, SIDE
from ...tracing.compiled.rays import BOUNCE_LIMIT, CORNER, ESCAPED, GRAZING
from . import contact
from .contact import CLEAR, NO, NOTHING, WIDEST_SLACK, ZERO, Path, Span, Touch, Touching, turning
from .shapes import graph_surface

# Columns of the positions of disks, in units of the radius: x of the centre and angle; and of their velocities.
X1, ALPHA = 0, 1
V1, V2, OMEGA = 0, 1, 2
TOP = 7
# Limit on the cells that one satellite passes, and on the satellites that pass the lowest point, between two contacts.
MOST_CELLS = 1_000_000

# Cells, or satellites, between two reads of the flag that interrupts a disk: a power of 2.
CELLS_A_CHECK = 1024

# A time longer than any motion, but finite, because bounds are multiplied by it.
FOREVER = 1e30


class Below(NamedTuple):
    """A satellite below the tops: its number, its hollow (negative: none such), and the left end of its cell."""

    number: int
    hollow: int
    base: float


class Chosen(NamedTuple):
    """A satellite that touches the wall: its number, its position, and the sine and cosine of its angle."""

    number: int
    x: float
    y: float
    turn: tuple[float, float]


@inlined
def near_edge(hollows, entry, slack):
    """Whether a position at height 0 is within the slack of an end of a hollow that is a corner."""
    for h in range(hollows.shape[0]):
        if abs(entry - hollows[h, c.LEFT]) <= slack and hollows[h, c.LEFT_EDGE] == c.CORNER_EDGE:
            return True
        if abs(entry - hollows[h, c.RIGHT]) <= slack and hollows[h, c.RIGHT_EDGE] == c.CORNER_EDGE:
            return True
    return False


@inner
def descent(path, span, ground):
    """-> (t, rotation, h, base, code): the time at which a satellite comes below the tops in the span, or inf.

    Also the `turning` until t, the hollow (negative at a flat top), and the left end of its cell.
    """
    x, y, turn, motion, slack = path
    t, end, rotation = span
    dx, dy, sine, _ = contact.satellite_after(t, rotation, turn, motion)
    if y + dy > 0.0:
        tops = contact.towards_line(y, 0.0, 1.0, turn, motion)
        t, rotation, code = contact.next_root(1.0, NO, tops, None, None, span, path, np.inf)
        if t >= end or code == GRAZING:
            return np.inf, rotation, -1, 0.0, CLEAR
        if code != CLEAR:
            return t, rotation, -1, 0.0, code
        dx, dy, sine, _ = contact.satellite_after(t, rotation, turn, motion)
    base = math.floor((x + dx) / ground.cell) * ground.cell
    if ground.is_open:
        return t, rotation, 0, base, CLEAR
    entry = x + dx - base
    rising = motion.v2 + motion.omega * sine
    # at shallow incidence a rounding error of the height is a larger error along the tops
    near = near_edge(ground.hollows, entry, slack * max(1.0, motion.fastest / abs(rising)))
    h = opening_at(entry, ground.hollows, ground.hollows.shape[0])
    # a satellite that rises below the tops did not enter from above: it and another one touch at the same time
    return t, rotation, h, base, CORNER if near or rising >= 0.0 else CLEAR


@inner
def first_contact(own, base, path, t, end, ground):
    """-> (Touch, h, base): the first contact in [t, end) of one satellite with the wall, its hollow and cell.

    The path starts on ``own``. Its hollow, -1 above the tops, is in the cell that begins at ``base``.
    """
    x, y, turn, motion, slack = path
    rotation = turning(motion.spin * t) if t > 0.0 else (0.0, 0.0)
    state = contact.satellite_after(t, rotation, turn, motion)
    h = own.hollow
    if own.kind == TOP:
        # the satellite rises, and its path is convex
        return Touch(np.inf, NO_PIECE, -1, state, CLEAR), -1, base
    if h < 0:
        t, rotation, h, base, code = descent(path, Span(t, end, rotation), ground)
        state = contact.satellite_after(t, rotation, turn, motion)
        if t >= end:
            return Touch(np.inf, NO_PIECE, -1, state, CLEAR), -1, base
        if h < 0 or code != CLEAR:
            return Touch(t, TOP, -1, state, code), -1, base
    came_from = ZERO
    for cell in range(MOST_CELLS):
        if cell & (CELLS_A_CHECK - 1) == CELLS_A_CHECK - 1 and is_raised(ground.stop):
            break
        shifted = Path(x - base, y, turn, motion, slack)
        touch = contact.first_in_hollow(h, own, came_from, shifted, Span(t, end, rotation), ground)
        t, state = touch.time, touch.state
        if touch.kind != SIDE or touch.code == BOUNCE_LIMIT:
            return touch, h, base
        if y + state.dy > 0.0 and motion.v2 + motion.omega * state.sine > 0.0:
            return Touch(np.inf, NO_PIECE, -1, state, CLEAR), -1, base
        rotation = turning(motion.spin * t)
        base += touch.piece * ground.cell
        came_from = -touch.piece
        own = Touching(ZERO, NOTHING, h)
    return Touch(t, NO_PIECE, -1, state, BOUNCE_LIMIT), h, base


@inlined
def on_line(k, x, y, ground):
    """Return the point (x, y) projected onto a line, and the unit normal towards the free side."""
    line = line_at(ground, k)
    fraction = ((x - line.x0) * line.edge_x + (y - line.y0) * line.edge_y) / (line.length * line.length)
    # from the nearer end
    late = fraction > 0.5
    x0, y0, fraction = (line.x1, line.y1, fraction - 1.0) if late else (line.x0, line.y0, fraction)
    return x0 + fraction * line.edge_x, y0 + fraction * line.edge_y, line.normal_x, line.normal_y


@inlined
def surface(kind, index, x, y, ground):
    """Return the point (x, y) projected onto the piece that is hit, and the unit normal towards the free side."""
    if kind == BEZIER:
        return graph_surface(ground.graphs[index], x, y)
    if kind == LINE:
        return on_line(index, x, y, ground)
    arc = ground.arcs[index]
    return arc_point(arc_form(arc), arc, arc[c.STRETCH], 0.0, x, y, 0.0, 0.0)


@inlined
def satellite_at(x, y, turn, j, ring):
    """Return the position and (sine, cosine) of the j-th satellite after the one at (x, y) and ``turn``.

    The position is computed from a chord, without cancellation of numbers of the size of the disk. For neighbours, by
    far the most frequent case, no sine is computed.
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
    """Return a lower bound on a satellite's height until ``time``.

    The satellite starts at ``angle``, which increases in absolute value if ``away``. The disk's lowest point starts at
    ``height``, and 1 - cos a >= a^2/2 - a^4/24.
    """
    nearest = abs(angle) if away else max(abs(angle) - abs(motion.spin) * time, 0.0)
    square = nearest * nearest
    return height + min(motion.v2, 0.0) * time + motion.radius * square * (0.5 - square / 24.0)


@inlined
def out_of_reach_after(angle, motion, ring):
    """Return when a satellite at ``angle`` is out of reach by a spacing; after a full turn it counts as another one."""
    if motion.spin == 0.0:
        return np.inf
    ahead = -angle if motion.spin > 0.0 else angle
    return (ring.reach + ring.spacing + ahead) / abs(motion.spin)


@inlined
def first_of_all(own, below, path, height, angle, end, ring, ground):
    """-> (t, Touching, base, Chosen, code): the first contact of any satellite before ``end``; t is ``end`` if none.

    ``path`` is the path of satellite 0, which starts on ``own``; the disk is at ``height``.
    """
    x, y, turn, motion, slack = path
    reach, rate = ring.reach, abs(motion.spin)
    passed = out_of_reach_after(angle, motion, ring)
    touch, hollow, base = first_contact(own, 0.0, path, 0.0, min(end, passed), ground)
    state, code = touch.state, touch.code
    hit = Touching(touch.kind, touch.piece, hollow)
    chosen = Chosen(0, x + state.dx, y + state.dy, (state.sine, state.cosine))
    time = min(touch.time, end)
    # the others in the order in which they come within reach of the wall
    step = -1 if motion.spin > 0.0 else 1
    # numba's floor is a float
    j = -step * int(math.floor((reach + step * angle) / ring.spacing))  # noqa: RUF046
    for count in range(MOST_CELLS):
        if count & (CELLS_A_CHECK - 1) == CELLS_A_CHECK - 1 and is_raised(ground.stop):
            break
        other = angle + j * ring.spacing
        away = other * motion.spin >= 0.0
        beyond = abs(other) - reach
        if beyond > 0.0 and (away or beyond >= rate * time):
            break
        if j != 0 and lowest_until(time, other, away, height, motion) <= 2.0 * slack:
            # two contacts are simultaneous if the disk falls less than the slack between them
            tie = slack / max(abs(motion.v2), motion.fastest / WIDEST_SLACK) if hit.kind != NO_PIECE else 0.0
            until = min(time + tie, out_of_reach_after(other, motion, ring))
            start = beyond / rate if beyond > 0.0 else 0.0
            x_other, y_other, turn_other = satellite_at(x, y, turn, j, ring)
            sine_other, _ = turn_other
            # the path is convex, so it stays above its first tangent
            if start > 0.0 or y_other <= 0.0 or y_other + (motion.v2 + motion.omega * sine_other) * until < 0.0:
                inside, left = (below.hollow, below.base) if j == below.number else (NOTHING, 0.0)
                there = Path(x_other, y_other, turn_other, motion, slack)
                touch, hollow, left = first_contact(Touching(ZERO, NOTHING, inside), left, there, start, until, ground)
                tied = hit.kind != NO_PIECE and abs(touch.time - time) <= tie
                if touch.time < time:
                    time, hit, base, code = touch.time, Touching(touch.kind, touch.piece, hollow), left, touch.code
                    state = touch.state
                    chosen = Chosen(j, x_other + state.dx, y_other + state.dy, (state.sine, state.cosine))
                if tied:
                    code = CORNER
        j += step
    else:
        code = BOUNCE_LIMIT
    return time, hit, base, chosen, code


@inner
def left_below(own, below, path, angle, time, chosen, ring, ground):
    """-> Below: the neighbour, if any, that is below the tops when the satellite ``chosen`` touches the wall.

    Its hollow follows from the position where it came below the tops, not from its present position, which may be under
    an overhang. At most one satellite besides ``chosen`` is below the tops.
    """
    if ground.is_open:
        return Below(ZERO, NOTHING, 0.0)
    motion = path.motion
    later = angle + motion.spin * time + chosen.number * ring.spacing
    for side in (-1, 1):
        if abs(later + side * ring.spacing) <= ring.reach:
            _, height, _ = satellite_at(chosen.x, chosen.y, chosen.turn, side, ring)
            if height <= 0.0:
                j = chosen.number + side
                if j == 0 and own.hollow >= 0:
                    return Below(j, own.hollow, 0.0)
                if j == below.number and below.hollow >= 0:
                    return below
                other = angle + j * ring.spacing
                x_other, y_other, turn_other = satellite_at(path.x, path.y, path.turn, j, ring)
                start = 0.0
                if abs(other) > ring.reach:
                    # the satellite came within reach after the start
                    start = (abs(other) - ring.reach) / abs(motion.spin)
                there = Path(x_other, y_other, turn_other, motion, path.slack)
                t, _, h, base, _ = descent(there, Span(start, time, turning(motion.spin * start)), ground)
                if t < time:
                    return Below(j, h, base)
    return Below(ZERO, NOTHING, 0.0)


@inlined
def reflect(v1, v2, omega, n1, n2, turn, disk):
    """Return the velocities after an impulse along the wall normal n at a satellite: specular in the kinetic metric."""
    mass, inertia = disk
    sine, cosine = turn
    by_mass, by_inertia = 1.0 / mass, 1.0 / inertia
    arm = n1 * cosine + n2 * sine
    inward = (v1 + omega * cosine) * n1 + (v2 + omega * sine) * n2
    impulse = -2.0 * inward / (by_mass + arm * arm * by_inertia)
    v1 += impulse * n1 * by_mass
    v2 += impulse * n2 * by_mass
    omega += impulse * arm * by_inertia
    # one Newton step on the kinetic norm prevents rounding errors from adding up
    energy = mass * (v1 * v1 + v2 * v2) + inertia * omega * omega
    scale = 1.5 - 0.5 * energy
    return scale * v1, scale * v2, scale * omega


@inlined
def longest_flight(height, motion, ring):
    """-> float: a time by which the disk is back or lower than possible without contact; -inf if there is none."""
    if motion.v2 > 0.0:
        return max(-height / motion.v2, 0.0)
    if motion.v2 < 0.0:
        return -(height + ring.floor) / motion.v2
    if motion.omega != 0.0:
        return MOST_CELLS * ring.spacing / abs(motion.spin)
    return -np.inf


@inlined
def collide_disk(entry, angle, velocity, disk, ring, limit, ground):
    """-> (displacement, rotation, time, velocity, contacts, two, status): one collision of an incoming disk.

    The disk starts at height 0, its lowest satellite at ``angle`` from the lowest point. ``disk`` is (m, J) with
    m + J = 1. The velocities have kinetic norm 1. ``two`` tells whether more than one satellite touched the wall.
    """
    scale, spacing = ring.scale, ring.spacing
    v1, v2, omega = velocity
    travel, rotation, passed, contacts, two = 0.0, 0.0, 0.0, 0, False
    sine, versed = turning(angle)
    x, y, height = entry + sine / scale, versed / scale, 0.0
    own, below = Touching(ZERO, NOTHING, NOTHING), Below(ZERO, NOTHING, 0.0)
    status = BOUNCE_LIMIT
    while not is_raised(ground.stop):
        path = Path(x, y, (sine, 1.0 - versed), contact.flight(v1, v2, omega, scale), ring.slack)
        end = longest_flight(height, path.motion, ring)
        if end == -np.inf:
            break
        time, hit, base, chosen, code = first_of_all(own, below, path, height, angle, end, ring, ground)
        travel += v1 * time
        rotation += path.motion.spin * time
        passed += time
        if code != CLEAR:
            status = code
            break
        if hit.kind == NO_PIECE:
            status = ESCAPED if v2 > 0.0 else BOUNCE_LIMIT
            break
        if contacts >= limit:
            break
        left = left_below(own, below, path, angle, time, chosen, ring, ground)
        below = Below(left.number - chosen.number, left.hollow, left.base - base)
        two = two or (contacts > 0 and chosen.number != 0)
        contacts += 1
        angle += chosen.number * spacing + path.motion.spin * time
        sine, versed = turning(angle)
        own, x, y, n1, n2 = hit, chosen.x - base, 0.0, 0.0, 1.0
        if hit.kind != TOP:
            x, y, n1, n2 = surface(hit.kind, hit.piece, x, chosen.y, ground)
        height = y - versed / scale
        v1, v2, omega = reflect(v1, v2, omega, n1, n2, (sine, 1.0 - versed), disk)
    return travel, rotation, passed, (v1, v2, omega), contacts, two, status


@inlined
def unit_velocity(velocity, i, disk):
    """-> (norm, unit): the kinetic norm of a disk's velocity, and the velocity divided by its norm."""
    mass, inertia = disk
    norm = math.sqrt(mass * (velocity[i, V1] ** 2 + velocity[i, V2] ** 2) + inertia * velocity[i, OMEGA] ** 2)
    return norm, (velocity[i, V1] / norm, velocity[i, V2] / norm, velocity[i, OMEGA] / norm)


@inlined
def start_of(position, i, width, ring):
    """-> (entry, angle): where disk i meets the tops in its cell, and the angle of its lowest satellite."""
    entry = (position[i, X1] - math.floor(position[i, X1] / width) * width) / ring.scale
    return entry, position[i, ALPHA] - ring.spacing * round(position[i, ALPHA] / ring.spacing)


@inlined
def store(results, i, position, norm, path, velocity, contacts, two, status):
    """Store the result of disk i; ``path`` is (displacement, rotation, time), the unit of velocities is ``norm``."""
    travel, rotation, time = path
    v1, v2, omega = velocity
    results.position[i, X1], results.position[i, ALPHA] = position[i, X1] + travel, position[i, ALPHA] + rotation
    results.velocity[i, V1], results.velocity[i, V2], results.velocity[i, OMEGA] = norm * v1, norm * v2, norm * omega
    results.time[i], results.contacts[i] = time / norm, contacts
    results.two_satellites[i], results.status[i] = two, status


@compiled
def collide_disks(position, velocity, disk, ring, limit, ground, results):
    """Collide a block of disks into ``results``, see `DiskResults`."""
    scale = ring.scale
    for i in range(position.shape[0]):
        if is_raised(ground.stop):
            break
        norm, unit = unit_velocity(velocity, i, disk)
        entry, angle = start_of(position, i, scale * ground.cell, ring)
        travel, rotation, time, end, contacts, two, status = collide_disk(entry, angle, unit, disk, ring, limit, ground)
        path = scale * travel, rotation, scale * time
        store(results, i, position, norm, path, end, contacts, two, status)


@inlined
def roll_disk(entry, velocity, disk, rolling, limit, ground):
    """-> (displacement, rotation, time, velocity, contacts, status): one collision on the cylinder.

    The contact moves on a straight line with the velocity (v1 + omega, v2) and starts at (position, 0).
    """
    v1, v2, omega = velocity
    travel, rotation, passed, contacts = 0.0, 0.0, 0.0, 0
    x, y = entry, 0.0
    own, status = Touching(ZERO, NOTHING, NOTHING), BOUNCE_LIMIT
    while not is_raised(ground.stop):
        path = Path(x, y, (0.0, 1.0), contact.flight(v1 + omega, v2, 0.0, 1.0), rolling.slack)
        end = FOREVER
        if v2 > 0.0:
            end = -y / v2
        elif v2 < 0.0:
            end = min(2.0 * (y + rolling.deepest + ground.cell) / -v2, FOREVER)
        touch, hollow, base = first_contact(own, 0.0, path, 0.0, end, ground)
        kind, state, code = touch.kind, touch.state, touch.code
        time = min(touch.time, end)
        travel += v1 * time
        rotation += omega * time
        passed += time
        if code != CLEAR:
            status = code
            break
        if kind == NO_PIECE:
            status = ESCAPED if v2 > 0.0 else BOUNCE_LIMIT
            break
        if contacts >= limit:
            break
        contacts += 1
        own, x, y, n1, n2 = Touching(kind, touch.piece, hollow), x + state.dx - base, y + state.dy, 0.0, 1.0
        if kind == TOP:
            y = 0.0
        else:
            x, y, n1, n2 = surface(kind, touch.piece, x, y, ground)
        v1, v2, omega = reflect(v1, v2, omega, n1, n2, (0.0, 1.0), disk)
    return travel, rotation, passed, (v1, v2, omega), contacts, status


@compiled
def roll_disks(position, velocity, disk, rolling, limit, ground, results):
    """Collide a block of disks on the cylinder into ``results``, see `DiskResults`."""
    scale = rolling.scale
    for i in range(position.shape[0]):
        if is_raised(ground.stop):
            break
        norm, unit = unit_velocity(velocity, i, disk)
        entry = (position[i, X1] + position[i, ALPHA]) / scale
        entry -= math.floor(entry / ground.cell) * ground.cell
        travel, rotation, time, end, contacts, status = roll_disk(entry, unit, disk, rolling, limit, ground)
        path = scale * travel, scale * rotation, scale * time
        store(results, i, position, norm, path, end, contacts, NO, status)
