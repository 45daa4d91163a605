"""The compiled collision of the disk with satellites: free motion and reflections until its return to height 0.

Loads numba. Lengths are in units of the wall, see `contact`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...curves import columns as c
from ...scene.compiled.compiling import compiled, inlined, inner, is_raised
from ...tracing.compiled.pieces.arcs import arc_form, arc_point
from ...tracing.compiled.pieces.formulas import opening_at
from ...tracing.compiled.pieces.lines import LEAST_FRACTION, line_at, line_point
from ...tracing.compiled.pieces.records import ARC, BEZIER, NO_PIECE, SIDE
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
    """-> Touch: the first contact in [t, end) of one satellite with the wall.

    The path starts on ``own``. Its hollow, -1 above the tops, is in the cell that begins at ``base``.
    """
    turn, motion = path.turn, path.motion
    rotation = turning(motion.spin * t) if t > 0.0 else (0.0, 0.0)
    h, state = own.hollow, contact.satellite_after(t, rotation, turn, motion)
    if own.kind == TOP:
        # the satellite rises, and its path is convex
        return Touch(np.inf, Touching(NO_PIECE, -1, -1), base, state, CLEAR)
    if h < 0:
        t, rotation, h, base, code = descent(path, Span(t, end, rotation), ground)
        if t >= end:
            return Touch(np.inf, Touching(NO_PIECE, -1, -1), base, state, CLEAR)
        state = contact.satellite_after(t, rotation, turn, motion)
        if h < 0 or code != CLEAR:
            return Touch(t, Touching(TOP, -1, -1), base, state, code)
    came_from = ZERO
    for cell in range(MOST_CELLS):
        if cell & (CELLS_A_CHECK - 1) == CELLS_A_CHECK - 1 and is_raised(ground.stop):
            break
        touch = contact.first_in_hollow(h, own, came_from, base, path, Span(t, end, rotation), ground)
        t, state, side = touch.time, touch.state, touch.on.piece
        if touch.on.kind != SIDE or touch.code == BOUNCE_LIMIT:
            return touch
        if path.y + state.dy > 0.0 and motion.v2 + motion.omega * state.sine > 0.0:
            return Touch(np.inf, Touching(NO_PIECE, -1, -1), base, state, CLEAR)
        rotation = turning(motion.spin * t)
        base += side * ground.cell
        came_from = -side
        own = Touching(ZERO, NOTHING, h)
    return Touch(t, Touching(NO_PIECE, -1, h), base, state, BOUNCE_LIMIT)


@inlined
def surface(kind, index, x, y, ground):
    """Return the point (x, y) projected onto the piece that is hit, and the unit normal towards the free side."""
    if kind == TOP:
        return x, 0.0, 0.0, 1.0
    if kind == BEZIER:
        return graph_surface(ground.graphs[index], x, y)
    if kind == ARC:
        arc = ground.arcs[index]
        return arc_point(arc_form(arc), arc, arc[c.STRETCH], 0.0, x, y, 0.0, 0.0)
    line = line_at(ground, index)
    fraction = ((x - line.x0) * line.edge_x + (y - line.y0) * line.edge_y) / (line.length * line.length)
    # from the nearer end
    x, y = line_point(line, min(fraction - 1.0, -LEAST_FRACTION) if fraction > 0.5 else max(fraction, 0.0))
    return x, y, line.normal_x, line.normal_y


@inlined
def moved(path, state):
    """-> Path: the path of a satellite that goes on after a displacement."""
    return Path(path.x + state.dx, path.y + state.dy, (state.sine, state.cosine), path.motion, path.slack)


@inlined
def neighbour(path, j, ring):
    """-> Path: the path of the j-th satellite after the one on ``path``.

    The position is computed from a chord, without cancellation of numbers of the size of the disk. For neighbours, by
    far the most frequent case, no sine is computed.
    """
    half_sine, half_cosine = j * ring.half_sine, ring.half_cosine
    if abs(j) != 1:
        half = 0.5 * j * ring.spacing
        half_sine, half_cosine = math.sin(half), math.cos(half)
    sine, cosine = path.turn
    across = 2.0 * half_sine * (cosine * half_cosine - sine * half_sine)
    upward = 2.0 * half_sine * (sine * half_cosine + cosine * half_sine)
    turn = sine + across, cosine - upward
    return Path(path.x + across / ring.scale, path.y + upward / ring.scale, turn, path.motion, path.slack)


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
def within_reach_after(angle, motion, ring):
    """Return when a satellite at ``angle`` comes within reach of the wall, 0 if it is; the angle must decrease."""
    beyond = abs(angle) - ring.reach
    return beyond / abs(motion.spin) if beyond > 0.0 else 0.0


@inlined
def first_of_all(own, below, path, height, angle, end, ring, ground):
    """-> (Touch, code, number, Path): the first contact of any satellite before ``end``, and the satellite's path.

    ``path`` is the path of satellite 0, which starts on ``own``; the disk is at ``height``.
    """
    motion, slack = path.motion, path.slack
    touch = first_contact(own, 0.0, path, 0.0, min(end, out_of_reach_after(angle, motion, ring)), ground)
    time, code, number, chosen = min(touch.time, end), touch.code, 0, path
    # the others in the order in which they come within reach of the wall
    step = -1 if motion.spin > 0.0 else 1
    # numba's floor is a float
    j = -step * int(math.floor((ring.reach + step * angle) / ring.spacing))  # noqa: RUF046
    for count in range(MOST_CELLS):
        if count & (CELLS_A_CHECK - 1) == CELLS_A_CHECK - 1 and is_raised(ground.stop):
            break
        other = angle + j * ring.spacing
        away = other * motion.spin >= 0.0
        if abs(other) > ring.reach and (away or abs(other) - ring.reach >= abs(motion.spin) * time):
            break
        if j != 0 and lowest_until(time, other, away, height, motion) <= 2.0 * slack:
            # two contacts are simultaneous if the disk falls less than the slack between them
            is_met = touch.on.kind != NO_PIECE
            tie = slack / max(abs(motion.v2), motion.fastest / WIDEST_SLACK) if is_met else 0.0
            until = min(time + tie, out_of_reach_after(other, motion, ring))
            start, there = within_reach_after(other, motion, ring), neighbour(path, j, ring)
            sine, _ = there.turn
            # the path is convex, so it stays above its first tangent
            if start > 0.0 or there.y <= 0.0 or there.y + (motion.v2 + motion.omega * sine) * until < 0.0:
                inside, base = (below.hollow, below.base) if j == below.number else (NOTHING, 0.0)
                hit = first_contact(Touching(ZERO, NOTHING, inside), base, there, start, until, ground)
                tied = is_met and abs(hit.time - time) <= tie
                if hit.time < time:
                    touch, time, code, number, chosen = hit, hit.time, hit.code, j, there
                if tied:
                    code = CORNER
        j += step
    else:
        code = BOUNCE_LIMIT
    return touch, code, number, chosen


@inlined
def left_below(own, below, path, angle, time, number, chosen, ring, ground):
    """-> Below: the neighbour, if any, that is below the tops when the satellite ``number`` touches the wall.

    ``chosen`` is the path of this satellite from the contact. The hollow of the neighbour follows from the position
    where it came below the tops, not from its present position, which may be under an overhang. At most one satellite
    besides ``number`` is below the tops.
    """
    if ground.is_open:
        return Below(ZERO, NOTHING, 0.0)
    motion = path.motion
    for j in (number - 1, number + 1):
        other = angle + j * ring.spacing
        if abs(other + motion.spin * time) <= ring.reach and neighbour(chosen, j - number, ring).y <= 0.0:
            if j == 0 and own.hollow >= 0:
                return Below(j, own.hollow, 0.0)
            if j == below.number and below.hollow >= 0:
                return below
            start = within_reach_after(other, motion, ring)
            span = Span(start, time, turning(motion.spin * start))
            t, _, h, base, _ = descent(neighbour(path, j, ring), span, ground)
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
    """-> float: a time by which the disk is back, lower than possible, or beyond `MOST_CELLS`, without contact."""
    if motion.v2 > 0.0:
        return max(-height / motion.v2, 0.0)
    time = -(height + ring.floor) / motion.v2 if motion.v2 < 0.0 else MOST_CELLS * ring.spacing / abs(motion.spin)
    return min(time, FOREVER)


@inlined
def collide_disk(entry, angle, velocity, disk, ring, limit, ground):
    """-> (displacement, rotation, time, velocity, contacts, two, status): one collision of an incoming disk.

    The disk starts at height 0, its lowest satellite at ``angle`` from the lowest point. ``disk`` is (m, J) with
    m + J = 1. The velocities have kinetic norm 1. ``two`` tells whether more than one satellite touched the wall.
    """
    scale = ring.scale
    v1, v2, omega = velocity
    travel, rotation, passed, contacts, two = 0.0, 0.0, 0.0, 0, False
    sine, versed = turning(angle)
    x, y, height = entry + sine / scale, versed / scale, 0.0
    own, below = Touching(ZERO, NOTHING, NOTHING), Below(ZERO, NOTHING, 0.0)
    status = BOUNCE_LIMIT
    while not is_raised(ground.stop):
        plane, spin = (v1 + omega, 0.0) if ring.is_rolling else (v1, omega)
        path = Path(x, y, (sine, 1.0 - versed), contact.flight(plane, v2, spin, scale), ring.slack)
        end = longest_flight(height, path.motion, ring)
        touch, code, number, chosen = first_of_all(own, below, path, height, angle, end, ring, ground)
        time = min(touch.time, end)
        travel += v1 * time
        rotation += scale * omega * time
        passed += time
        if code != CLEAR:
            status = code
            break
        if touch.on.kind == NO_PIECE:
            status = ESCAPED if v2 > 0.0 else BOUNCE_LIMIT
            break
        if contacts >= limit:
            break
        chosen = moved(chosen, touch.state)
        left = left_below(own, below, path, angle, time, number, chosen, ring, ground)
        below = Below(left.number - number, left.hollow, left.base - touch.base)
        two = two or (contacts > 0 and number != 0)
        contacts += 1
        angle += number * ring.spacing + path.motion.spin * time
        sine, versed = turning(angle)
        own = touch.on
        x, y, n1, n2 = surface(own.kind, own.piece, chosen.x - touch.base, chosen.y, ground)
        height = y - versed / scale
        v1, v2, omega = reflect(v1, v2, omega, n1, n2, (sine, 1.0 - versed), disk)
    return travel, rotation, passed, (v1, v2, omega), contacts, two, status


@inlined
def start_of(x, alpha, width, ring):
    """-> (entry, angle): where a disk meets the tops in its cell, and the angle of its lowest satellite."""
    if ring.is_rolling:
        x, alpha = x + alpha, 0.0
    return (x - math.floor(x / width) * width) / ring.scale, alpha - ring.spacing * round(alpha / ring.spacing)


@compiled
def collide_disks(position, velocity, disk, ring, limit, ground, results):
    """Collide a block of disks into ``results``, see `DiskResults`."""
    (mass, inertia), scale = disk, ring.scale
    for i in range(position.shape[0]):
        if is_raised(ground.stop):
            break
        x, alpha = position[i, X1], position[i, ALPHA]
        v1, v2, omega = velocity[i, V1], velocity[i, V2], velocity[i, OMEGA]
        norm = math.sqrt(mass * (v1**2 + v2**2) + inertia * omega**2)
        entry, angle = start_of(x, alpha, scale * ground.cell, ring)
        unit = v1 / norm, v2 / norm, omega / norm
        travel, rotation, time, end, contacts, two, status = collide_disk(entry, angle, unit, disk, ring, limit, ground)
        v1, v2, omega = end
        results.position[i, X1], results.position[i, ALPHA] = x + scale * travel, alpha + rotation
        results.velocity[i, V1], results.velocity[i, V2] = norm * v1, norm * v2
        results.velocity[i, OMEGA] = norm * omega
        results.time[i], results.contacts[i] = scale * time / norm, contacts
        results.two_satellites[i], results.status[i] = two, status
