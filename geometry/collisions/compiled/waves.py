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
from ...tracing.compiled.options import compiled, inlined, linked
from ...tracing.compiled.pointers import is_raised
from ...tracing.compiled.rays import ESCAPED
from ...tracing.compiled.trigonometry import COSINE as C
from ...tracing.compiled.trigonometry import SINE as S
from .contact import (
    ROOT_FRACTION,
    WIDEST_SLACK,
    ZERO,
    Motion,
    arc_of,
    conic_at,
    conic_form,
    flight,
    line_after,
    line_form,
    line_of,
    safe_step,
    satellite_after,
    turning,
)
from .rigid import above_the_wall, neighbour_at, on_conic, on_line, reflect, start_of, store, unit_velocity

# Number of disks in a wave, and most numbers of a vector. Loops over satellites compute whole vectors, whose last
# satellites may not exist, so a column has room for one vector more. Columns at distances of powers of 2 are slow.
WAVE, VECTOR = 200, 8
SIZE = WAVE + VECTOR
# All bits of an index within a column.
POSITIVE = 2**10 - 1
# Columns of the work arrays of disks and of satellites. The first satellite of a disk, or the one whose contact is
# sought, is at (X, Y) and touches the piece OWN (-1 for none). Its motion is searched from FROM, inf if it stays above
# the tops, to UNTIL; BASE is the left end of its cell.
V1, V2, OMEGA, FASTEST, X, Y, SINE, COSINE, OWN, NUMBER, INDEX, FROM, UNTIL, BASE, UNCERTAIN = range(0, 15 * SIZE, SIZE)
COPIED = 15
# Of satellites: the first root of F and the state of its SEARCH; the first piece that is CROSSED, HOW and where.
ROOT, SEARCH, CROSSED, HOW, AT_X, AT_Y = range(15 * SIZE, 21 * SIZE, SIZE)
ENDED, SEARCHING, FOUND = 0.0, 1.0, 2.0
MISSED, CLEAR_HIT, UNCLEAR = 0.0, 1.0, 2.0
# Of disks: VERSED is 1 - cos of the ANGLE; satellite BESIDE, if not 0, is below the tops, too, in the cell at SHIFT.
VERSED, ANGLE, BESIDE, SHIFT, HEIGHT, TRAVEL, ROTATION, PASSED, CONTACTS, TWO, DISK = range(15 * SIZE, 26 * SIZE, SIZE)
# Of their motions: the first contact so far, of the satellite CHOSEN with the piece HIT (-1 for none), and the normal.
END, TIME, TIE, HIT, CHOSEN, HIT_X, HIT_Y, NORMAL_X, NORMAL_Y, SOUGHT, STATUS = range(26 * SIZE, 37 * SIZE, SIZE)
UNSOUGHT, ABOVE, BELOW = 0.0, 1.0, 2.0
GOES_ON, BACK, UNSURE = 0.0, 1.0, 2.0
# Of three satellites: the time from which on it is below the tops (inf for never), and the left end of its cell.
BELOW_FROM, LEFT_END = 37 * SIZE, 40 * SIZE
WORK = 43 * SIZE
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
def state_after(w, s, t, scale):
    """-> (State, Motion, turn, rotation) of a satellite after the time t; see `satellite_after`."""
    omega, turn = w[OMEGA + s], (w[SINE + s], w[COSINE + s])
    motion = Motion(w[V1 + s], w[V2 + s], omega, scale * omega, 1.0 / scale, w[FASTEST + s])
    rotation = small_turn(motion.spin * t)
    return satellite_after(t, rotation, turn, motion), motion, turn, rotation


@inlined
def after(w, s, line, arc, t, scale):
    """-> (F, F', F'', b0, b1) of a line or an arc after the time t: |F'''| is at most b0 + b1 s up to t + s."""
    _, motion, turn, rotation = state_after(w, s, t, scale)
    x, y, own = w[X + s], w[Y + s], w[OWN + s]
    if line is not None:
        start, _, _, number = line
        f, f1, f2 = line_after(line_form(start, own == number, x, y, turn, motion), t, rotation, motion)
        return f, f1, f2, motion.spin * motion.spin * abs(motion.omega), 0.0
    if arc is not None:
        _, _, _, _, curvature, stretch = arc
        f, f1, f2, n1, n2 = conic_at(conic_form(arc, own == 0.0, x, y), t, rotation, turn, motion)
        bend, widest = motion.spin * motion.omega, max(stretch, 1.0)
        speed, swing = abs(curvature) * widest * motion.fastest, widest * bend * abs(motion.spin)
        return f, f1, f2, swing * (abs(n1) + abs(n2)) + speed * widest * bend * 3.0, swing * speed


@inlined
def approach(w, s, line, arc, slack, fraction, scale):
    """Move the ROOT of a satellite by a safe step if it is SEARCHING; then it may be FOUND, or the search has ENDED."""
    t, state = w[ROOT + s], w[SEARCH + s]
    f, f1, f2, third, growth = after(w, s, line, arc, t, scale)
    # behind by the rounding error of the last step
    behind = (state == SEARCHING) & (f <= 0.0) & (t > w[FROM + s])
    live = (state == SEARCHING) & (not behind)
    ahead = w[UNTIL + s] - t
    uncertainty = (third + growth * ahead) * ahead
    least = f2 - uncertainty
    step = safe_step(f, f1, least)
    # near a tangency rounding decides between two roots and none
    unclear = live & (f1 < 0.0) & (least > 0.0) & (abs(f1 * f1 - 2.0 * least * f) <= least * slack * CLOSE)
    live = live & (step < ahead)
    found = (state == FOUND) | behind | (live & (uncertainty * step * step <= slack * fraction))
    w[UNCERTAIN + s] = 1.0 if unclear else w[UNCERTAIN + s]
    w[ROOT + s] = t + step if live else t
    w[SEARCH + s] = FOUND if found else (SEARCHING if live else ENDED)


@inlined
def filled(m):
    """Return a number of satellites, with those that fill up the last vector."""
    return (m + VECTOR - 1) & -VECTOR


@linked
def search(w, m, line, arc, number, reach, ring):
    """Find the ROOT at which satellites cross a line or an arc, if they do so before UNTIL.

    Satellites that start within ``reach`` of the piece are uncertain.
    """
    slack, scale, fraction = ring.slack, ring.scale, LEAST_FRACTION
    if line is not None:
        fraction = ROOT_FRACTION
    for s in range(filled(m)):
        t, leaving = w[FROM + s], w[OWN + s] == number
        f, f1, f2, third, growth = after(w, s, line, arc, t, scale)
        ahead = w[UNTIL + s] - t
        least = f2 - (third + growth * ahead) * ahead
        lowest = f + (f1 + (least if least < 0.0 else 0.0) * 0.5 * ahead) * ahead
        unclear = (leaving & (not f1 > 0.0)) | ((not leaving) & (not f > reach))
        w[UNCERTAIN + s] = 1.0 if (ahead > 0.0) & unclear else w[UNCERTAIN + s]
        w[ROOT + s] = t
        w[SEARCH + s] = SEARCHING if (ahead > 0.0) & (not lowest > slack) else ENDED
        approach(w, s, line, arc, slack, fraction, scale)
    for s in range(filled(m)):
        approach(w, s, line, arc, slack, fraction, scale)
    for s in range(m):
        steps = USUAL_STEPS
        while w[SEARCH + s] == SEARCHING and steps < STEPS:
            approach(w, s, line, arc, slack, LEAST_FRACTION, scale)
            steps += 1
        if w[SEARCH + s] == SEARCHING:
            w[UNCERTAIN + s] = 1.0


@linked
def meet(w, m, line, arc, number, widest, ring):
    """Find where satellites cross a line or an arc first, if they do so before they cross another piece."""
    reach = ring.slack * CLOSE * widest
    search(w, m, line, arc, number, reach, ring)
    for s in range(filled(m)):
        t, found = w[ROOT + s], w[SEARCH + s] == FOUND
        there, motion, _, _ = state_after(w, s, t, ring.scale)
        _, rate, _, _, _ = after(w, s, line, arc, t, ring.scale)
        x, y = w[X + s] + there.dx, w[Y + s] + there.dy
        # at shallow incidence an error across the piece is a larger error along it
        inward, wide = abs(rate), motion.fastest * reach
        clear = -y * inward > wide
        if line is not None:
            (x0, y0, _, _), (edge_x, edge_y), length, _ = line
            along = ((x - x0) * edge_x + (y - y0) * edge_y) / length
            clear = (along * inward > wide) & ((length - along) * inward > wide)
        how = CLEAR_HIT if clear else (MISSED if y * inward > wide else UNCLEAR)
        w[UNTIL + s] = t if found else w[UNTIL + s]
        w[CROSSED + s] = number if found else w[CROSSED + s]
        w[HOW + s] = how if found else w[HOW + s]
        w[AT_X + s] = x if found else w[AT_X + s]
        w[AT_Y + s] = y if found else w[AT_Y + s]


@linked
def enter(w, m, ring, cell):
    """Find when satellites come below the tops, FROM, and in which cell."""
    search(w, m, ((0.0, 0.0, 0.0, 1.0), (1.0, 0.0), 1.0, -2.0), None, -2.0, ring.slack * CLOSE, ring)
    for s in range(filled(m)):
        found = w[SEARCH + s] == FOUND
        there, motion, _, _ = state_after(w, s, w[ROOT + s], ring.scale)
        x = w[X + s] + there.dx
        base = math.floor(x / cell) * cell
        entry, sinking = x - base, -(motion.v2 + motion.omega * there.sine)
        nearest = entry if entry + entry < cell else cell - entry
        unclear = found & (not nearest * sinking > motion.fastest * ring.slack * CLOSE)
        w[UNCERTAIN + s] = 1.0 if unclear else w[UNCERTAIN + s]
        w[X + s], w[BASE + s] = w[X + s] - base, base
        w[FROM + s] = w[ROOT + s] if found else np.inf


@inlined
def number_of(w, i, side):
    """Return the number of a satellite: 0 for side 0, of the neighbour below the tops or nearer to them for side 1."""
    beside = w[BESIDE + i]
    return side * (beside if beside != 0.0 else (-1.0 if w[OMEGA + i] > 0.0 else 1.0))


@inlined
def satellite_of(w, i, number, ring):
    """-> (x, y, turn): the satellite with a number, 0, 1 or -1, as `rigid.satellite_at`."""
    half_sine, half_cosine = number * ring.half_sine, 1.0 if number == 0.0 else ring.half_cosine
    return neighbour_at(w[X + i], w[Y + i], (w[SINE + i], w[COSINE + i]), half_sine, half_cosine, ring.scale)


@linked
def begin_motion(w, n, ring):
    """Begin the motion of all disks: find when each ends without a contact."""
    for i in range(n):
        v2, height = w[V2 + i], w[HEIGHT + i]
        motion = flight(w[V1 + i], v2, w[OMEGA + i], ring.scale)
        slowest = motion.fastest * (1.0 / WIDEST_SLACK)
        end = -(height if v2 > 0.0 else height + ring.floor) / v2
        end, limit = end if end > 0.0 else 0.0, FARTHEST_TURN / abs(motion.spin)
        w[FASTEST + i], w[TIE + i] = motion.fastest, ring.slack / (abs(v2) if abs(v2) > slowest else slowest)
        w[END + i], w[TIME + i] = end, end if end < limit else limit
        w[HIT + i], w[CHOSEN + i], w[INDEX + i], w[FROM + i] = -1.0, 0.0, float(i), 0.0
        w[UNCERTAIN + i] = 1.0 if (v2 == 0.0) | (abs(w[ANGLE + i]) > FARTHEST_TURN) else 0.0
        w[BELOW_FROM + i], w[BELOW_FROM + SIZE + i], w[BELOW_FROM + 2 * SIZE + i] = np.inf, np.inf, np.inf


@inlined
def move(source, i, target, k, count):
    """Copy the first columns of work arrays from the index i to k."""
    # so the compiler knows that no index counts from the end
    i, k = i & POSITIVE, k & POSITIVE
    for column in range(count):
        target[column * SIZE + k] = source[column * SIZE + i]


@linked
def collect(disks, n, satellites, side, ring):
    """-> (int, int): collect one satellite of each disk, see `number_of`, if it is below the tops or may come there.

    The number of those above the tops, which are the first and fill up vectors, and of all.
    """
    for i in range(n):
        number, until = number_of(disks, i, side), disks[TIME + i] + disks[TIE + i]
        below = ((side > 0.0) & (disks[BESIDE + i] != 0.0)) | ((side == 0.0) & (disks[OWN + i] >= 0.0))
        angle, spin = disks[ANGLE + i] + number * ring.spacing, ring.scale * disks[OMEGA + i]
        away = (side != 0.0) & above_the_wall(angle, spin, until, ring.reach)
        disks[NUMBER + i], disks[UNTIL + i] = number, until
        disks[BASE + i] = disks[SHIFT + i] if below & (side > 0.0) else 0.0
        disks[SOUGHT + i] = BELOW if below else (UNSOUGHT if away else ABOVE)
    above, m = ZERO, ZERO
    for sought in (ABOVE, BELOW):
        above, m = m, filled(m)
        for i in range(n):
            if disks[SOUGHT + i] == sought:
                move(disks, i, satellites, m, COPIED)
                m += 1
    for s in range(filled(m)):
        number = satellites[NUMBER + s]
        x, y, (sine, cosine) = satellite_of(satellites, s, number, ring)
        # the path is convex, so it stays above its first tangent
        rate = satellites[V2 + s] + satellites[OMEGA + s] * sine
        stays = y + (rate if rate < 0.0 else 0.0) * satellites[UNTIL + s] > ring.slack * CLOSE
        satellites[X + s], satellites[Y + s] = x - satellites[BASE + s], y
        satellites[SINE + s], satellites[COSINE + s] = sine, cosine
        satellites[OWN + s] = satellites[OWN + s] if number == 0.0 else -1.0
        satellites[FROM + s] = np.inf if stays else 0.0
        satellites[HOW + s], satellites[CROSSED + s] = MISSED, -1.0
    return above, m


@linked
def compare(disks, satellites, m, which):
    """Compare the first contacts of satellites with the first so far."""
    for s in range(m):
        i, time, how = int(satellites[INDEX + s]) & POSITIVE, satellites[UNTIL + s], satellites[HOW + s]
        disks[BELOW_FROM + which * SIZE + i] = satellites[FROM + s]
        disks[LEFT_END + which * SIZE + i] = satellites[BASE + s]
        tied = (disks[HIT + i] >= 0.0) & (abs(time - disks[TIME + i]) <= disks[TIE + i])
        if (satellites[UNCERTAIN + s] > 0.0) | (how == UNCLEAR) | ((how == CLEAR_HIT) & tied):
            disks[UNCERTAIN + i] = 1.0
        if (how == CLEAR_HIT) & (time < disks[TIME + i]):
            disks[TIME + i], disks[HIT + i] = time, satellites[CROSSED + s]
            disks[CHOSEN + i] = satellites[NUMBER + s]
            disks[HIT_X + i], disks[HIT_Y + i] = satellites[AT_X + s], satellites[AT_Y + s]


@inlined
def still_below(w, i, which, side, found, motion, ring):
    """-> (beside, shift, left, uncertain): those ``found`` so far, with one satellite at the end of the motion.

    The satellite that is below the tops, besides the one that touches the wall, and the left ends of their cells.
    """
    beside, shift, left, uncertain = found
    time, chosen, number = w[TIME + i], w[CHOSEN + i], number_of(w, i, side)
    base, since = w[LEFT_END + which * SIZE + i], w[BELOW_FROM + which * SIZE + i]
    _, y, turn = satellite_of(w, i, number, ring)
    y = y + satellite_after(time, small_turn(motion.spin * time), turn, motion).dy
    other = (since < time) & (number != chosen)
    below = other & (y < 0.0)
    uncertain = uncertain | (other & (abs(y) <= ring.slack * CLOSE))
    uncertain = uncertain | (below & ((beside != 0.0) | (abs(chosen - number) > 1.0)))
    return number - chosen if below else beside, base if below else shift, left if number != chosen else base, uncertain


@linked
def finish_motion(w, n, limit, ring):
    """Move all disks to the ends of their motions, and set STATUS and the satellite BESIDE."""
    for i in range(n):
        time, chosen, hits = w[TIME + i], w[CHOSEN + i], w[HIT + i] >= 0.0
        motion = flight(w[V1 + i], w[V2 + i], w[OMEGA + i], ring.scale)
        angle, until, turn = w[ANGLE + i], time + w[TIE + i], motion.spin * time
        before = above_the_wall(angle - 2.0 * ring.spacing, motion.spin, until, ring.reach)
        behind = above_the_wall(angle + 2.0 * ring.spacing, motion.spin, until, ring.reach)
        uncertain = (w[UNCERTAIN + i] > 0.0) | (not (before & behind)) | (hits & (w[CONTACTS + i] >= limit))
        uncertain = uncertain | ((not hits) & ((time < w[END + i]) | (not motion.v2 > 0.0)))
        found = 0.0, 0.0, 0.0, uncertain
        found = still_below(w, i, 0, 0.0, found, motion, ring)
        found = still_below(w, i, 1, 1.0, found, motion, ring)
        beside, shift, left, uncertain = still_below(w, i, 2, -1.0, found, motion, ring)
        again = (w[CONTACTS + i] > 0.0) & (chosen != 0.0) & hits
        angle = angle + (chosen * ring.spacing + turn)
        sine, versed = small_turn(angle)
        w[TRAVEL + i], w[ROTATION + i] = w[TRAVEL + i] + motion.v1 * time, w[ROTATION + i] + turn
        w[PASSED + i], w[CONTACTS + i] = w[PASSED + i] + time, w[CONTACTS + i] + (1.0 if hits else 0.0)
        w[BESIDE + i], w[SHIFT + i], w[TWO + i] = beside, shift - left, 1.0 if again else w[TWO + i]
        w[ANGLE + i], w[SINE + i], w[VERSED + i], w[COSINE + i] = angle, sine, versed, 1.0 - versed
        w[OWN + i] = w[HIT + i]
        w[STATUS + i] = UNSURE if uncertain else (GOES_ON if hits else BACK)


@linked
def reflect_disks(w, n, disk, ring, ground):
    """Reflect disks at the pieces that their satellites touch."""
    is_arc = ground.arcs.shape[0] > 0
    for i in range(n):
        if w[STATUS + i] == GOES_ON:
            k, x, y = int(w[OWN + i]), w[HIT_X + i], w[HIT_Y + i]
            x, y, n1, n2 = on_conic(k, x, y, ground) if is_arc else on_line(k, x, y, ground)
            w[X + i], w[Y + i], w[NORMAL_X + i], w[NORMAL_Y + i] = x, y, n1, n2
    for i in range(n):
        v1, v2, omega, turn = w[V1 + i], w[V2 + i], w[OMEGA + i], (w[SINE + i], w[COSINE + i])
        u1, u2, other = reflect(v1, v2, omega, w[NORMAL_X + i], w[NORMAL_Y + i], turn, disk)
        goes_on = w[STATUS + i] == GOES_ON
        w[V1 + i], w[V2 + i] = u1 if goes_on else v1, u2 if goes_on else v2
        w[OMEGA + i] = other if goes_on else omega
        w[HEIGHT + i] = w[Y + i] - w[VERSED + i] / ring.scale


@inlined
def begin_disk(w, k, i, position, velocity, disk, ring, ground):
    """Put disk i at the index k."""
    _, (w[V1 + k], w[V2 + k], w[OMEGA + k]) = unit_velocity(velocity, i, disk)
    entry, angle = start_of(position, i, ring.scale * ground.cell, ring)
    sine, versed = turning(angle)
    w[X + k], w[Y + k], w[SINE + k], w[COSINE + k] = entry + sine / ring.scale, versed / ring.scale, sine, 1.0 - versed
    w[ANGLE + k], w[OWN + k], w[DISK + k] = angle, -1.0, float(i)
    for column in (BESIDE, SHIFT, HEIGHT, TRAVEL, ROTATION, PASSED, CONTACTS, TWO):
        w[column + k] = 0.0


@inlined
def end_disk(w, k, i, position, velocity, disk, scale, results):
    """Store the result of disk i, at the index k."""
    norm, _ = unit_velocity(velocity, i, disk)
    path = scale * w[TRAVEL + k], w[ROTATION + k], scale * w[PASSED + k]
    end, contacts, two = (w[V1 + k], w[V2 + k], w[OMEGA + k]), int(w[CONTACTS + k]), w[TWO + k] > 0.0
    store(results, i, position, norm, path, end, contacts, two, ESCAPED)


@linked
def meet_wall(w, m, ring, ground):
    """Find where satellites below the tops meet the wall first."""
    lines, hollow = ground.lines, ground.hollows[0]
    if ground.arcs.shape[0] > 0:
        meet(w, m, None, arc_of(ground, 0), 0.0, max(ground.arcs[0, c.STRETCH], 1.0), ring)
    for k in range(int(hollow[c.FIRST_JOINT]), int(hollow[c.JOINTS_END])):
        if ground.joints[k, c.STARTS_LINE] > 0.0:
            edge = lines[k, c.EDGE_X], lines[k, c.EDGE_Y]
            meet(w, m, (line_of(ground, k), edge, lines[k, c.LENGTH], float(k)), None, float(k), 1.0, ring)


@linked
def move_disks(disks, n, satellites, disk, ring, limit, ground):
    """Move all disks of a wave to their next contacts."""
    begin_motion(disks, n, ring)
    for which in range(3):
        above, m = collect(disks, n, satellites, 0.0 if which == 0 else (1.0 if which == 1 else -1.0), ring)
        enter(satellites, above, ring, ground.cell)
        for s in range(filled(above) - 1, -1, -1):
            if s >= above or not satellites[FROM + s] < satellites[UNTIL + s]:
                if s < above and satellites[UNCERTAIN + s] > 0.0:
                    disks[UNCERTAIN + int(satellites[INDEX + s])] = 1.0
                m -= 1
                move(satellites, m, satellites, s, COPIED)
        meet_wall(satellites, m, ring, ground)
        compare(disks, satellites, m, which)
    finish_motion(disks, n, float(limit), ring)
    reflect_disks(disks, n, disk, ring, ground)


@compiled
def collide_in_waves(position, velocity, disk, ring, limit, ground, results, disks, satellites):
    """Collide a block of disks into ``results``, with two work arrays; the others have the status `UNDECIDED`."""
    following = min(position.shape[0], WAVE)
    n = following
    for k in range(n):
        begin_disk(disks, k, k, position, velocity, disk, ring, ground)
    while n > 0 and not is_raised(ground.stop):
        move_disks(disks, n, satellites, disk, ring, limit, ground)
        for k in range(n - 1, -1, -1):
            if disks[STATUS + k] != GOES_ON:
                i = int(disks[DISK + k])
                results.status[i] = UNDECIDED
                if disks[STATUS + k] == BACK:
                    end_disk(disks, k, i, position, velocity, disk, ring.scale, results)
                if following < position.shape[0]:
                    begin_disk(disks, k, following, position, velocity, disk, ring, ground)
                    following += 1
                else:
                    n -= 1
                    move(disks, n, disks, k, WORK // SIZE)
