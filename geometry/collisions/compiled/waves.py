"""Disks over a wall whose cell is one convex hollow, of lines or a focusing arc, many at once. Loads numba.

A work array holds one column for each quantity. The loops over a column have no branches, so the compiler vectorises
them: distances between columns are known to it, and the number of disks is not.

Times of contact are found as by `contact`: by safe steps, which pass no root. In a convex hollow a satellite is in
front of every piece, and the first one that it crosses, continued, is the one that it meets, unless it has left the
hollow; then it does not return, because its path is convex. Whatever rounding could change, and whatever else is rare,
sets UNCERTAIN. A disk's result does not depend on the others.
"""

from __future__ import annotations

import math

import numpy as np

from ...scene import columns as c
from ...tracing.compiled.options import compiled, inlined, inner
from ...tracing.compiled.pointers import is_raised
from ...tracing.compiled.rays import ESCAPED
from ...tracing.compiled.records import LINE
from ...tracing.compiled.trigonometry import COSINE as C
from ...tracing.compiled.trigonometry import SINE as S
from . import columns
from .contact import (
    ARC,
    ROOT_FRACTION,
    WIDEST_SLACK,
    Motion,
    conic_at,
    flight,
    line_after,
    safe_step,
    satellite_after,
    towards_line,
    turning,
)
from .rigid import above_the_wall, neighbour_at, reflect, surface, unit_velocity

# Number of disks in a wave.
SIZE = 64
# Columns of both work arrays, those of disks and those of satellites that move below the tops. A satellite begins the
# search of its contact at the time FROM, from a position relative to the left end of its cell, BASE, and from the piece
# OWN (-1 for none). The search ends at UNTIL.
V1, V2, OMEGA, FASTEST, NUMBER, INDEX, UNCERTAIN = (SIZE * k for k in range(7))
START_X, START_Y, SINE, COSINE, OWN, FROM, UNTIL, BASE = (SIZE * k for k in range(7, 15))
COPIED = 15
# Of satellites only: the first piece that is crossed, how and where: MISSED, CLEAR_HIT or UNCLEAR.
ROOT, SEARCH, CROSSED, HOW, AT_X, AT_Y = (SIZE * k for k in range(15, 21))
# Of disks only. Satellite 0 touches the piece TOUCHED (-1: none yet) at (X, Y), with the sine SIN of its angle and
# VERSED = 1 - cos. Satellite BESIDE, if not 0, is below the tops, too, in the cell that begins at SHIFT.
X, Y, SIN, VERSED, ANGLE, TOUCHED, BESIDE, SHIFT, HEIGHT = (SIZE * k for k in range(15, 24))
TRAVEL, ROTATION, PASSED, CONTACTS, TWO, DISK = (SIZE * k for k in range(24, 30))
# The first contact so far, and the satellite CHOSEN that touches the piece HIT (-1 for none) there; PLACE tells whether
# a satellite is searched for; NORMAL_X and NORMAL_Y are those of the wall.
END, TIME, TIE, HIT, CHOSEN, HIT_X, HIT_Y, PLACE, NORMAL_X, NORMAL_Y, STATUS = (SIZE * k for k in range(30, 41))
# Of three satellites: the time from which on it is below the tops (inf for never), and the left end of its cell.
BELOW_FROM, LEFT_END = SIZE * 41, SIZE * 44
WORK = SIZE * 47
MISSED, CLEAR_HIT, UNCLEAR = 0.0, 1.0, 2.0
IDLE, ABOVE, BELOW = 0.0, 1.0, 2.0
FOUND, UNFINISHED = 1.0, 2.0
# The polynomials for sine and cosine hold up to pi/4.
FARTHEST_TURN = 0.75
# Limit on steps to a root; most are reached in two, and those of arcs passed at a small distance in more.
STEPS = 8
# Distances below this number of slacks are left to the scalar code.
CLOSE = 4.0
# Largest error of a root, as a fraction of the slack, on arcs and after the usual number of steps to a line: far below
# rounding, because arcs and shallow incidence magnify it.
LEAST_FRACTION, USUAL_STEPS = 2.0**-10, 2
# Status of a disk whose contacts rounding could change, or that meets the wall in a rare way.
UNDECIDED = 255


@inlined
def small_turn(angle):
    """Return sine and 1 - cosine of an angle up to FARTHEST_TURN, without cancellation."""
    u = angle * angle
    u2 = u * u
    p = (u * S[1] + S[0]) + u2 * ((u * S[3] + S[2]) + u2 * (u * S[5] + S[4]))
    q = (u * C[1] + C[0]) + u2 * ((u * C[3] + C[2]) + u2 * (u * C[5] + C[4]))
    return angle + angle * u * p, u * 0.5 - u2 * q


@inlined
def form_of(w, s, line, arc, motion):
    """-> (leaving, form): whether satellite s touches the piece, and F of the line or conic as in `contact`."""
    turn, x, y = (w[SINE + s], w[COSINE + s]), w[START_X + s], w[START_Y + s]
    if line is not None:
        (x0, y0), _, (g1, g2), _, number = line
        leaving = w[OWN + s] == number
        level = g1 * (x - x0) + g2 * (y - y0)
        return leaving, towards_line(0.0 if leaving else level, g1, g2, turn, motion)
    if arc is not None:
        (x0, y0), (nx, ny), curvature, stretch = arc
        leaving = w[OWN + s] == 0.0
        rx, ry = x - x0, stretch * (y - y0)
        g1, g2 = nx - curvature * rx, ny - curvature * ry
        level = 0.5 * ((nx + g1) * rx + (ny + g2) * ry)
        return leaving, (0.0 if leaving else level, g1, g2, curvature, stretch)


@inlined
def after(form, line, arc, t, turn, motion):
    """-> (F, F', F'', b0, b1) after the time t: |F'''| is at most b0 + b1 s up to t + s."""
    rotation = small_turn(motion.spin * t)
    if line is not None:
        f, f1, f2 = line_after(form, t, rotation, motion)
        return f, f1, f2, motion.spin * motion.spin * abs(motion.omega), 0.0
    if arc is not None:
        _, _, curvature, stretch = arc
        f, f1, f2, n1, n2 = conic_at(form, t, rotation, turn, motion)
        bend, widest = motion.spin * motion.omega, max(stretch, 1.0)
        speed, swing = abs(curvature) * widest * motion.fastest, widest * bend * abs(motion.spin)
        return f, f1, f2, swing * (abs(n1) + abs(n2)) + speed * widest * bend * 3.0, swing * speed


@inlined
def motion_of(w, s, scale):
    """-> (Motion, turn) of a satellite."""
    omega = w[OMEGA + s]
    motion = Motion(w[V1 + s], w[V2 + s], omega, scale * omega, 1.0 / scale, w[FASTEST + s])
    return motion, (w[SINE + s], w[COSINE + s])


@inlined
def step_to_root(values, t, until, live, slack, fraction):
    """-> (t, live, found, uncertain): a safe step of a satellite, if ``live``, from the `after` at t."""
    f, f1, f2, third, growth = values
    ahead = until - t
    doubt = (third + growth * ahead) * ahead
    least = f2 - doubt
    step = safe_step(f, f1, least)
    # near a tangency rounding decides between two roots and none
    uncertain = live & (f1 < 0.0) & (least > 0.0) & (abs(f1 * f1 - 2.0 * least * f) <= least * slack * CLOSE)
    live = live & (step < ahead)
    found = live & (doubt * step * step <= slack * fraction)
    return t + step if live else t, live & (not found), found, uncertain


@inner
def search(w, m, line, arc, ring, last):
    """Find the ROOT at which satellites cross a line or an arc, if they do so before UNTIL.

    Satellites too close to the piece at the start are uncertain. SEARCH is 0 if there is no root. ``last`` counts steps.
    """
    slack, scale = ring.slack, ring.scale
    reach = slack * CLOSE
    fraction = ROOT_FRACTION
    if arc is not None:
        _, _, _, stretch = arc
        reach, fraction = reach * max(stretch, 1.0), LEAST_FRACTION
    for s in range(m):
        t, until = w[FROM + s], w[UNTIL + s]
        motion, turn = motion_of(w, s, scale)
        leaving, form = form_of(w, s, line, arc, motion)
        f, f1, f2, third, growth = after(form, line, arc, t, turn, motion)
        live = t < until
        unclear = live & ((leaving & (not f1 > 0.0)) | ((not leaving) & (not f > reach)))
        ahead = until - t
        least = f2 - (third + growth * ahead) * ahead
        live = live & (not f + (f1 + (least if least < 0.0 else 0.0) * 0.5 * ahead) * ahead > slack)
        t, live, found, uncertain = step_to_root((f, f1, f2, third, growth), t, until, live, slack, fraction)
        unclear = unclear | uncertain
        values = after(form, line, arc, t, turn, motion)
        f, _, _, _, _ = values
        # behind by the rounding error of the last step
        behind = live & (f <= 0.0)
        t, live, there, uncertain = step_to_root(values, t, until, live & (not behind), slack, fraction)
        w[UNCERTAIN + s] = 1.0 if unclear | uncertain else w[UNCERTAIN + s]
        w[ROOT + s] = t
        w[SEARCH + s] = UNFINISHED if live else (FOUND if found | behind | there else 0.0)
    for s in range(m):
        if w[SEARCH + s] == UNFINISHED:
            t, until, live = w[ROOT + s], w[UNTIL + s], True
            motion, turn = motion_of(w, s, scale)
            _, form = form_of(w, s, line, arc, motion)
            w[SEARCH + s] = 0.0
            for _ in range(last):
                values = after(form, line, arc, t, turn, motion)
                f, _, _, _, _ = values
                found, uncertain = f <= 0.0, False
                if not found:
                    t, live, found, uncertain = step_to_root(values, t, until, live, slack, LEAST_FRACTION)
                if uncertain:
                    w[UNCERTAIN + s] = 1.0
                if found or not live:
                    w[SEARCH + s] = FOUND if found else 0.0
                    break
            else:
                w[UNCERTAIN + s] = 1.0
            w[ROOT + s] = t


@inner
def cross(w, m, line, arc, ring, number):
    """Let satellites cross a piece at ROOT."""
    slack, scale = ring.slack, ring.scale
    reach = slack * CLOSE
    if arc is not None:
        _, _, _, stretch = arc
        reach = reach * max(stretch, 1.0)
    for s in range(m):
        t, found = w[ROOT + s], w[SEARCH + s] == FOUND
        motion, turn = motion_of(w, s, scale)
        _, form = form_of(w, s, line, arc, motion)
        there = satellite_after(t, small_turn(motion.spin * t), turn, motion)
        x, y = w[START_X + s] + there.dx, w[START_Y + s] + there.dy
        # at shallow incidence an error across the piece is a larger error along it
        _, rate, _, _, _ = after(form, line, arc, t, turn, motion)
        inward, wide = abs(rate), motion.fastest * reach
        clear = -y * inward > wide
        if line is not None:
            (x0, y0), (edge_x, edge_y), _, length, _ = line
            along = ((x - x0) * edge_x + (y - y0) * edge_y) / length
            clear = (along * inward > wide) & ((length - along) * inward > wide)
        how = CLEAR_HIT if clear else (MISSED if y * inward > wide else UNCLEAR)
        w[UNTIL + s] = t if found else w[UNTIL + s]
        w[CROSSED + s] = number if found else w[CROSSED + s]
        w[HOW + s] = how if found else w[HOW + s]
        w[AT_X + s] = x if found else w[AT_X + s]
        w[AT_Y + s] = y if found else w[AT_Y + s]


@inner
def enter(w, m, ring, cell):
    """Let satellites come below the tops at ROOT: find their cells, and set FROM, inf if they stay above."""
    for s in range(m):
        t, found = w[ROOT + s], w[SEARCH + s] == FOUND
        motion, turn = motion_of(w, s, ring.scale)
        there = satellite_after(t, small_turn(motion.spin * t), turn, motion)
        x = w[START_X + s] + there.dx
        base = math.floor(x / cell) * cell
        entry, sinking = x - base, -(motion.v2 + motion.omega * there.sine)
        nearest = entry if entry + entry < cell else cell - entry
        unclear = found & (not nearest * sinking > motion.fastest * ring.slack * CLOSE)
        w[UNCERTAIN + s] = 1.0 if unclear else w[UNCERTAIN + s]
        w[BASE + s] = base
        w[START_X + s] = w[START_X + s] - base
        w[FROM + s] = t if found else np.inf


@inlined
def satellite_number(w, i, side):
    """Return the number of a satellite: 0 for side 0, of the neighbour below the tops or nearer to them for side 1."""
    beside = w[BESIDE + i]
    return side * (beside if beside != 0.0 else (-1.0 if w[OMEGA + i] > 0.0 else 1.0))


@inlined
def satellite_start(w, i, number, ring):
    """-> (x, y, turn): the satellite of a disk with a number, 0, 1 or -1, as `rigid.satellite_at`."""
    half_sine, half_cosine = number * ring.half_sine, 1.0 if number == 0.0 else ring.half_cosine
    return neighbour_at(w[X + i], w[Y + i], (w[SIN + i], 1.0 - w[VERSED + i]), half_sine, half_cosine, ring.scale)


@inner
def begin_motion(w, n, ring):
    """Begin the motion of all disks: find when each ends without a contact."""
    for i in range(n):
        v2, height = w[V2 + i], w[HEIGHT + i]
        motion = flight(w[V1 + i], v2, w[OMEGA + i], ring.scale)
        w[FASTEST + i] = motion.fastest
        slowest = motion.fastest * (1.0 / WIDEST_SLACK)
        w[TIE + i] = ring.slack / (abs(v2) if abs(v2) > slowest else slowest)
        end = -(height if v2 > 0.0 else height + ring.floor) / v2
        end = end if end > 0.0 else 0.0
        limit = FARTHEST_TURN / abs(motion.spin)
        w[END + i] = end
        w[TIME + i] = end if end < limit else limit
        w[HIT + i], w[CHOSEN + i] = -1.0, 0.0
        w[UNCERTAIN + i] = 1.0 if (v2 == 0.0) | (abs(w[ANGLE + i]) > FARTHEST_TURN) else 0.0
        w[BELOW_FROM + i], w[BELOW_FROM + SIZE + i], w[BELOW_FROM + 2 * SIZE + i] = np.inf, np.inf, np.inf


@inner
def place_satellites(w, n, side, ring):
    """Place one satellite of each disk, see `satellite_number`: PLACE tells whether it is, or may come, below the tops."""
    for i in range(n):
        number, until = satellite_number(w, i, side), w[TIME + i] + w[TIE + i]
        beside, touched = w[BESIDE + i], w[TOUCHED + i]
        below = ((side > 0.0) & (beside != 0.0)) | ((side == 0.0) & (touched >= 0.0))
        spin = ring.scale * w[OMEGA + i]
        away = above_the_wall(w[ANGLE + i] + number * ring.spacing, spin, until, ring.reach)
        x, y, (sine, cosine) = satellite_start(w, i, number, ring)
        # the path is convex, so it stays above its first tangent
        rate = w[V2 + i] + w[OMEGA + i] * sine
        stays = y + (rate if rate < 0.0 else 0.0) * until > ring.slack * CLOSE
        above = (not below) & ((side == 0.0) | (not away)) & (not stays)
        base = w[SHIFT + i] if below & (side > 0.0) else 0.0
        w[START_X + i], w[START_Y + i], w[SINE + i], w[COSINE + i] = x - base, y, sine, cosine
        w[NUMBER + i], w[UNTIL + i], w[BASE + i], w[FROM + i], w[INDEX + i] = number, until, base, 0.0, float(i)
        w[OWN + i] = touched if number == 0.0 else -1.0
        w[PLACE + i] = BELOW if below else (ABOVE if above else IDLE)


@inlined
def move(source, i, target, k, count):
    """Copy the first columns of a place of a work array."""
    for column in range(count):
        target[column * SIZE + k] = source[column * SIZE + i]


@inlined
def satellites_below(disks, n, satellites, ring, cell):
    """-> int: put the satellites that are below the tops before the first contact so far into their work array."""
    m = 0
    for i in range(n):
        if disks[PLACE + i] == ABOVE:
            move(disks, i, satellites, m, COPIED)
            m += 1
    tops = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), 1.0, -2.0
    search(satellites, m, tops, None, ring, STEPS - USUAL_STEPS)
    enter(satellites, m, ring, cell)
    count, m = m, 0
    for s in range(count):
        disks[UNCERTAIN + int(satellites[INDEX + s])] = satellites[UNCERTAIN + s]
        if satellites[FROM + s] < satellites[UNTIL + s]:
            move(satellites, s, satellites, m, COPIED)
            m += 1
    for i in range(n):
        if disks[PLACE + i] == BELOW:
            move(disks, i, satellites, m, COPIED)
            m += 1
    for s in range(m):
        satellites[HOW + s], satellites[CROSSED + s] = MISSED, -1.0
    return m


@inner
def compare(disks, satellites, m, place):
    """Compare the first contacts of satellites with the first so far."""
    for s in range(m):
        i, time = int(satellites[INDEX + s]), satellites[UNTIL + s]
        disks[BELOW_FROM + place * SIZE + i], disks[LEFT_END + place * SIZE + i] = satellites[FROM + s], satellites[BASE + s]
        uncertain = (satellites[UNCERTAIN + s] > 0.0) | (satellites[HOW + s] == UNCLEAR)
        if satellites[HOW + s] == CLEAR_HIT:
            uncertain = uncertain | ((disks[HIT + i] >= 0.0) & (abs(time - disks[TIME + i]) <= disks[TIE + i]))
            if time < disks[TIME + i]:
                disks[TIME + i], disks[HIT + i], disks[CHOSEN + i] = time, satellites[CROSSED + s], satellites[NUMBER + s]
                disks[HIT_X + i], disks[HIT_Y + i] = satellites[AT_X + s], satellites[AT_Y + s]
        disks[UNCERTAIN + i] = 1.0 if uncertain else 0.0


@inner
def finish_motion(w, n, limit, ring):
    """Move all disks to the ends of their motions, with the STATUS: 0 for a contact, 1 for a return, 2 for uncertain.

    The satellite, besides the one that touches the wall, that is below the tops becomes BESIDE.
    """
    for i in range(n):
        time, chosen, hits = w[TIME + i], w[CHOSEN + i], w[HIT + i] >= 0.0
        motion = flight(w[V1 + i], w[V2 + i], w[OMEGA + i], ring.scale)
        uncertain = (w[UNCERTAIN + i] > 0.0) | (hits & (w[CONTACTS + i] >= limit))
        uncertain = uncertain | ((not hits) & ((time < w[END + i]) | (not motion.v2 > 0.0)))
        for side in (-2.0, 2.0):
            other, until = w[ANGLE + i] + ring.spacing * side, time + w[TIE + i]
            uncertain = uncertain | (not above_the_wall(other, motion.spin, until, ring.reach))
        turn = motion.spin * time
        w[TRAVEL + i] = w[TRAVEL + i] + motion.v1 * time
        w[ROTATION + i] = w[ROTATION + i] + turn
        w[PASSED + i] = w[PASSED + i] + time
        beside, shift, left = 0.0, 0.0, 0.0
        rotation = small_turn(turn)
        for place in range(3):
            number = satellite_number(w, i, 0.0 if place == 0 else (1.0 if place == 1 else -1.0))
            base = w[LEFT_END + place * SIZE + i]
            left = base if number == chosen else left
            _, y, turn_there = satellite_start(w, i, number, ring)
            y = y + satellite_after(time, rotation, turn_there, motion).dy
            other = (w[BELOW_FROM + place * SIZE + i] < time) & (number != chosen)
            below = other & (y < 0.0)
            uncertain = uncertain | (other & (abs(y) <= ring.slack * CLOSE))
            uncertain = uncertain | (below & ((beside != 0.0) | (abs(chosen - number) > 1.0)))
            beside, shift = number - chosen if below else beside, base if below else shift
        w[BESIDE + i], w[SHIFT + i] = beside, shift - left
        again = (w[CONTACTS + i] > 0.0) & (chosen != 0.0) & hits
        w[TWO + i] = 1.0 if again else w[TWO + i]
        w[CONTACTS + i] = w[CONTACTS + i] + (1.0 if hits else 0.0)
        angle = w[ANGLE + i] + (chosen * ring.spacing + turn)
        w[ANGLE + i] = angle
        w[SIN + i], w[VERSED + i] = small_turn(angle)
        w[TOUCHED + i] = w[HIT + i]
        w[STATUS + i] = 2.0 if uncertain else (0.0 if hits else 1.0)


@inner
def reflect_disks(w, n, disk, ring, ground):
    """Reflect disks at the pieces that their satellites touch."""
    kind = ARC if ground.arcs.shape[0] > 0 else LINE
    for i in range(n):
        if w[STATUS + i] == 0.0:
            w[X + i], w[Y + i], w[NORMAL_X + i], w[NORMAL_Y + i] = surface(
                kind, int(w[TOUCHED + i]), w[HIT_X + i], w[HIT_Y + i], ground
            )
    for i in range(n):
        v1, v2, omega, versed, goes_on = w[V1 + i], w[V2 + i], w[OMEGA + i], w[VERSED + i], w[STATUS + i] == 0.0
        turn = w[SIN + i], 1.0 - versed
        u1, u2, other = reflect(v1, v2, omega, w[NORMAL_X + i], w[NORMAL_Y + i], turn, disk)
        w[HEIGHT + i] = w[Y + i] - versed / ring.scale
        w[V1 + i] = u1 if goes_on else v1
        w[V2 + i] = u2 if goes_on else v2
        w[OMEGA + i] = other if goes_on else omega


@inner
def begin_disk(w, k, i, position, velocity, disk, ring, width):
    """Put disk i into place k."""
    scale, spacing = ring.scale, ring.spacing
    _, (w[V1 + k], w[V2 + k], w[OMEGA + k]) = unit_velocity(velocity, i, disk)
    entry = (position[i, columns.X1] - math.floor(position[i, columns.X1] / width) * width) / scale
    angle = position[i, columns.ALPHA] - spacing * round(position[i, columns.ALPHA] / spacing)
    sine, versed = turning(angle)
    w[X + k], w[Y + k], w[SIN + k], w[VERSED + k] = entry + sine / scale, versed / scale, sine, versed
    w[ANGLE + k], w[TOUCHED + k], w[DISK + k] = angle, -1.0, float(i)
    w[BESIDE + k], w[SHIFT + k], w[HEIGHT + k], w[TRAVEL + k], w[ROTATION + k] = 0.0, 0.0, 0.0, 0.0, 0.0
    w[PASSED + k], w[CONTACTS + k], w[TWO + k] = 0.0, 0.0, 0.0


@inner
def end_disk(w, k, i, position, velocity, disk, scale, results):
    """Store the result of disk i, in place k."""
    norm, _ = unit_velocity(velocity, i, disk)
    results.position[i, columns.X1] = position[i, columns.X1] + scale * w[TRAVEL + k]
    results.position[i, columns.ALPHA] = position[i, columns.ALPHA] + w[ROTATION + k]
    results.velocity[i, columns.V1] = norm * w[V1 + k]
    results.velocity[i, columns.V2] = norm * w[V2 + k]
    results.velocity[i, columns.OMEGA] = norm * w[OMEGA + k]
    results.time[i] = scale * w[PASSED + k] / norm
    results.contacts[i] = int(w[CONTACTS + k])
    results.two_satellites[i] = w[TWO + k] > 0.0
    results.status[i] = ESCAPED


@inlined
def line_at(joints, lines, k):
    """Return start, edge, normal, length and number of a line."""
    return (
        (joints[k, c.JOINT_X], joints[k, c.JOINT_Y]),
        (lines[k, c.EDGE_X], lines[k, c.EDGE_Y]),
        (lines[k, c.LINE_NORMAL_X], lines[k, c.LINE_NORMAL_Y]),
        lines[k, c.LENGTH],
        float(k),
    )


@inlined
def arc_at(arcs):
    """Return start, normal, curvature and stretch of the arc."""
    start, normal = (arcs[0, c.START_X], arcs[0, c.START_Y]), (arcs[0, c.NORMAL_X], arcs[0, c.NORMAL_Y])
    return start, normal, arcs[0, c.CURVATURE], arcs[0, c.STRETCH]


@inner
def move_disks(disks, n, satellites, disk, ring, limit, ground):
    """Move all disks of a wave to their next contacts."""
    joints, lines, arcs, hollow = ground.joints, ground.lines, ground.arcs, ground.hollows[0]
    begin_motion(disks, n, ring)
    for place in range(3):
        place_satellites(disks, n, 0.0 if place == 0 else (1.0 if place == 1 else -1.0), ring)
        m = satellites_below(disks, n, satellites, ring, ground.cell)
        if arcs.shape[0] > 0:
            search(satellites, m, None, arc_at(arcs), ring, STEPS - USUAL_STEPS)
            cross(satellites, m, None, arc_at(arcs), ring, 0.0)
        else:
            for k in range(int(hollow[c.FIRST_JOINT]), int(hollow[c.JOINTS_END])):
                if joints[k, c.STARTS_LINE] > 0.0:
                    search(satellites, m, line_at(joints, lines, k), None, ring, STEPS - USUAL_STEPS)
                    cross(satellites, m, line_at(joints, lines, k), None, ring, float(k))
        compare(disks, satellites, m, place)
    finish_motion(disks, n, float(limit), ring)
    reflect_disks(disks, n, disk, ring, ground)


@compiled
def collide_in_waves(position, velocity, disk, ring, limit, ground, results, disks, satellites):
    """Collide a block of disks into ``results``, with two work arrays; the others have the status `UNDECIDED`."""
    width = ring.scale * ground.cell
    following = min(position.shape[0], SIZE)
    n = following
    for k in range(n):
        begin_disk(disks, k, k, position, velocity, disk, ring, width)
    while n > 0 and not is_raised(ground.stop):
        move_disks(disks, n, satellites, disk, ring, limit, ground)
        for k in range(n - 1, -1, -1):
            if disks[STATUS + k] > 0.0:
                i = int(disks[DISK + k])
                if disks[STATUS + k] == 1.0:
                    end_disk(disks, k, i, position, velocity, disk, ring.scale, results)
                else:
                    results.status[i] = UNDECIDED
                if following < position.shape[0]:
                    begin_disk(disks, k, following, position, velocity, disk, ring, width)
                    following += 1
                else:
                    n -= 1
                    move(disks, n, disks, k, WORK // SIZE)
