"""Disks over a wall whose cell is one convex hollow, several at once. Loads numba.

When a disk has come back, the next one takes its lane. A disk's result does not depend on the others.
"""

from __future__ import annotations

import math

from ...scene import columns as c
from ...tracing.compiled.options import compiled, inlined
from ...tracing.compiled.pointers import is_raised
from ...tracing.compiled.rays import ESCAPED
from . import columns
from .contact import turning
from .lanes import (
    ANGLE,
    BESIDE,
    CONTACTS,
    DISK,
    HEIGHT,
    OMEGA,
    OWN,
    PASSED,
    ROTATION,
    SHIFT,
    SIN,
    TRAVEL,
    TWO,
    V1,
    V2,
    VERSED,
    WIDTH,
    X,
    Y,
    begin_flights,
    compare,
    enter,
    finish_flights,
    meet_arc,
    meet_line,
    reflect_at_arc,
    reflect_at_line,
)
from .rigid import unit_velocity

# Status of a disk whose contacts rounding could change, or that meets the wall in a rare way.
UNDECIDED = 255


@inlined
def begin_disk(work, lane, i, position, velocity, disk, ring, width):
    """Put disk i into a lane."""
    scale, spacing = ring.scale, ring.spacing
    _, (work[V1 + lane], work[V2 + lane], work[OMEGA + lane]) = unit_velocity(velocity, i, disk)
    entry = (position[i, columns.X1] - math.floor(position[i, columns.X1] / width) * width) / scale
    angle = position[i, columns.ALPHA] - spacing * round(position[i, columns.ALPHA] / spacing)
    sine, versed = turning(angle)
    work[X + lane], work[Y + lane], work[SIN + lane] = entry + sine / scale, versed / scale, sine
    work[VERSED + lane], work[ANGLE + lane], work[OWN + lane], work[DISK + lane] = versed, angle, -1.0, i
    for column in (BESIDE, SHIFT, HEIGHT, TRAVEL, ROTATION, PASSED, CONTACTS, TWO):
        work[column + lane] = 0.0


@inlined
def end_disk(work, lane, position, velocity, disk, scale, results):
    """Store the result of the disk in a lane."""
    i = int(work[DISK + lane])
    norm, _ = unit_velocity(velocity, i, disk)
    results.position[i, columns.X1] = position[i, columns.X1] + scale * work[TRAVEL + lane]
    results.position[i, columns.ALPHA] = position[i, columns.ALPHA] + work[ROTATION + lane]
    results.velocity[i, columns.V1] = norm * work[V1 + lane]
    results.velocity[i, columns.V2] = norm * work[V2 + lane]
    results.velocity[i, columns.OMEGA] = norm * work[OMEGA + lane]
    results.time[i] = scale * work[PASSED + lane] / norm
    results.contacts[i] = int(work[CONTACTS + lane])
    results.two_satellites[i] = work[TWO + lane] > 0.0
    results.status[i] = ESCAPED


@inlined
def line_at(joints, lines, k):
    """Return start, end, edge, normal, length and number of a line."""
    return (
        (joints[k, c.JOINT_X], joints[k, c.JOINT_Y]),
        (joints[k + 1, c.JOINT_X], joints[k + 1, c.JOINT_Y]),
        (lines[k, c.EDGE_X], lines[k, c.EDGE_Y]),
        (lines[k, c.LINE_NORMAL_X], lines[k, c.LINE_NORMAL_Y]),
        lines[k, c.LENGTH],
        float(k),
    )


@inlined
def arc_at(arcs):
    """Return start, normal, curvature and stretch of the arc."""
    return (
        (arcs[0, c.START_X], arcs[0, c.START_Y]),
        (arcs[0, c.NORMAL_X], arcs[0, c.NORMAL_Y]),
        arcs[0, c.CURVATURE],
        arcs[0, c.STRETCH],
    )


@inlined
def fly(work, disk, ring, limit, ground):
    """-> int: one flight of all lanes; see `finish_flights`."""
    joints, lines, arcs, hollow = ground.joints, ground.lines, ground.arcs, ground.hollows[0]
    first, last = int(hollow[c.FIRST_JOINT]), int(hollow[c.JOINTS_END])
    begin_flights(work, ring)
    for place in range(3):
        side = 0.0 if place == 0 else (1.0 if place == 1 else -1.0)
        if enter(work, ring, place, side, ground.cell):
            if arcs.shape[0] > 0:
                start, normal, curvature, stretch = arc_at(arcs)
                meet_arc(work, ring, place, start, normal, curvature, stretch)
            else:
                for k in range(first, last):
                    if joints[k, c.STARTS_LINE] > 0.0:
                        start, _, edge, normal, length, number = line_at(joints, lines, k)
                        meet_line(work, ring, place, start, edge, normal, length, number)
            compare(work, ring, place)
    found = finish_flights(work, ring, float(limit))
    if arcs.shape[0] > 0:
        start, normal, curvature, stretch = arc_at(arcs)
        reflect_at_arc(work, ring, disk, start, normal, curvature, stretch)
    else:
        for k in range(first, last):
            if joints[k, c.STARTS_LINE] > 0.0:
                start, end, edge, normal, length, number = line_at(joints, lines, k)
                reflect_at_line(work, ring, disk, start, end, edge, normal, length, number)
    return found


@compiled
def collide_in_waves(position, velocity, disk, ring, limit, ground, results, work):
    """Collide a block of disks into ``results``, in the work space; the others have the status `UNDECIDED`."""
    n = position.shape[0]
    width = ring.scale * ground.cell
    going, following = 0, 0
    for lane in range(WIDTH):
        begin_disk(work, lane, min(lane, n - 1), position, velocity, disk, ring, width)
        if lane < n:
            going |= 1 << lane
            following += 1
    while going != 0 and not is_raised(ground.stop):
        found = fly(work, disk, ring, limit, ground)
        over = (found | found >> WIDTH) & going
        for lane in range(WIDTH):
            if over >> lane & 1:
                if found >> lane & 1:
                    end_disk(work, lane, position, velocity, disk, ring.scale, results)
                else:
                    results.status[int(work[DISK + lane])] = UNDECIDED
                if following < n:
                    begin_disk(work, lane, following, position, velocity, disk, ring, width)
                    following += 1
                else:
                    going &= ~(1 << lane)
