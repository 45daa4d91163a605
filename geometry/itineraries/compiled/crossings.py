"""Compiled integrals over entry points below a channel, of functions that are odd under the mirror image.

A ray changes its direction at every crossing of a channel. Its phase, in widths of the channel, is the point at which
it comes back to the channel's lower end plus the cotangent of its angle times the height; where the phase passes an
integer, the function changes its sign. On a patch the exit point and the angle are analytic functions of the incoming
angle and of the place within the piece.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....core.checks import Floats
from ...tracing.compiled.options import compiled, inlined, linked

# Steps towards a crossing, and to an extremum of the phase; the distance from an integer, relative to it, and from the
# other side that ends them.
MOST_STEPS, EXTREMUM_STEPS, AT_INTEGER, NARROW = 60, 4, 1e-10, 1e-13
# Most crossings between two places of a grid; the interval is left out beyond.
MOST_CROSSINGS = 1 << 14
AT_NODE = 1e-14
# The lines on which the phase is followed: the two ends of the piece, and the entry point whose ray meets the corner.
FIRST_END, LAST_END, CORNER = range(3)


class Rows(NamedTuple):
    """The same piece at several incoming angles; the first axis of all arrays runs over these.

    The coefficients of Chebyshev series in the place within the piece, from -1 to 1: those of the outgoing angle
    ``outs``, of the exit point ``exits``, shape (rows, terms), and those of the antiderivatives of the functions,
    ``anti``, shape (rows, functions, terms + 1). ``phases``, shape (rows, places), has the phases at the places of a
    grid; ``corners``, shape (rows,), the place behind which the functions have the opposite sign.
    """

    outs: Floats
    exits: Floats
    anti: Floats
    phases: Floats
    corners: Floats


class Strip(NamedTuple):
    """A patch, for incoming angles that cross the channel between ``number`` and ``number + 1`` times.

    ``low`` and ``high`` are the angles between which the patch lies, ``nodes`` the places of the panel's nodes in
    (0, 1) and ``weights`` their barycentric weights. ``ends``, shape (2, nodes), are the ends of the piece;
    ``outs`` and ``exits``, shape (terms, nodes), Chebyshev coefficients; ``row``, shape (nodes,), is work space.
    """

    number: float
    low: float
    high: float
    nodes: Floats
    weights: Floats
    ends: Floats
    outs: Floats
    exits: Floats
    row: Floats


@inlined
def series_at(t, coefficients):
    """Return the value of a Chebyshev series at t, by Clenshaw's recurrence."""
    one, two = 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, 0, -1):
        one, two = coefficients[k] + 2.0 * t * one - two, one
    return coefficients[0] + t * one - two


@inlined
def unstretched(v):
    """Return the place s in (0, 1) at which s^2 (3 - 2 s) is v."""
    return 0.5 - math.sin(math.asin(min(max(1.0 - 2.0 * v, -1.0), 1.0)) / 3.0)


@linked
def phase_at(t, outs, exits, height):
    """Return the phase of the ray at the place t."""
    return series_at(t, exits) + height / math.tan(series_at(t, outs))


@linked
def set_row(angle, strip):
    """Set the row that interpolates values at the nodes of the panel to an incoming angle."""
    place = unstretched((angle - strip.low) / (strip.high - strip.low))
    total = 0.0
    for k in range(strip.nodes.shape[0]):
        step = place - strip.nodes[k]
        if abs(step) < AT_NODE:
            strip.row[:] = 0.0
            strip.row[k] = 1.0
            return
        strip.row[k] = strip.weights[k] / step
        total += strip.row[k]
    for k in range(strip.nodes.shape[0]):
        strip.row[k] /= total


@inlined
def at_row(values, row):
    """Return the value at the angle of the row."""
    total = 0.0
    for k in range(row.shape[0]):
        total += values[k] * row[k]
    return total


@linked
def series_at_row(t, coefficients, row):
    """Return the value of a Chebyshev series at t and at the angle of the row."""
    one, two = 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, 0, -1):
        one, two = at_row(coefficients[k], row) + 2.0 * t * one - two, one
    return at_row(coefficients[0], row) + t * one - two


@linked
def phase_on(line, crossings, strip, height):
    """Return the phase on a line for a number of crossings, and whether the corner lies within the piece."""
    set_row(math.atan2(height, crossings), strip)
    t = -1.0 if line == FIRST_END else 1.0
    if line == CORNER:
        first, last = at_row(strip.ends[0], strip.row), at_row(strip.ends[1], strip.row)
        t = 2.0 * unstretched((strip.number + 1.0 - crossings - first) / (last - first)) - 1.0
    return series_at_row(t, strip.exits, strip.row) + height / math.tan(series_at_row(t, strip.outs, strip.row))


@inlined
def bracket_with(at, value, low, high, below, above, side):
    """-> (low, high, below, above, side): a bracket of a root with one end moved to ``at``, by the Illinois rule.

    ``below`` and ``above`` are the values at its ends. That of an end which stays for the second time in a row is
    halved; ``side`` is 1 if the upper end was the last to move, -1 if the lower one was, else 0.
    """
    if (value > 0.0) == (above > 0.0):
        return low, at, below * (0.5 if side == 1 else 1.0), value, 1
    return at, high, value, above * (0.5 if side == -1 else 1.0), -1


@linked
def kink_between(low, high, below, above, level, line, strip, height):
    """Return the number of crossings at which the phase on a line is ``level``, by the Illinois rule."""
    below, above = below - level, above - level
    side, at = 0, low
    for _ in range(MOST_STEPS):
        at = low - below * (high - low) / (above - below)
        value = phase_on(line, at, strip, height) - level
        if abs(value) < AT_INTEGER * (1.0 + abs(level)) or high - low < NARROW:
            break
        low, high, below, above, side = bracket_with(at, value, low, high, below, above, side)
    return at


@linked
def end_passed(end, low, high, strip, height):
    """Return the number of crossings at which the corner passes an end of the piece; it moves against the crossings."""
    for _ in range(MOST_STEPS):
        at = 0.5 * (low + high)
        set_row(math.atan2(height, at), strip)
        if strip.number + 1.0 - at > at_row(strip.ends[end], strip.row):
            low = at
        else:
            high = at
        if high - low < NARROW:
            break
    return 0.5 * (low + high)


@compiled
def set_kinks(strip, grid, height, kinks):
    """Set the numbers of crossings at which the integral over the piece is not smooth; return their count.

    The ends of the grid are not among them. Places where the phase has an extremum are not found exactly.
    """
    count = np.int64(0)
    last = grid.shape[0] - 1
    for end in range(2):
        kinks[count] = end_passed(end, grid[0], grid[last], strip, height)
        count += 1
    for line in range(3):
        below = phase_on(line, grid[0], strip, height)
        for k in range(last):
            above = phase_on(line, grid[k + 1], strip, height)
            first, final = math.floor(below), math.floor(above)
            number = int(abs(final - first))
            for j in range(number if count + number < kinks.shape[0] else 0):
                level = first + 1.0 + j if final > first else first - j
                kinks[count] = kink_between(grid[k], grid[k + 1], below, above, level, line, strip, height)
                count += 1
            below = above
    return count


@linked
def crossing(low, high, below, above, level, outs, exits, height):
    """Return the place between low and high, with phases below and above, at which the phase is ``level``."""
    below, above = below - level, above - level
    side, t = 0, low
    for _ in range(MOST_STEPS):
        t = low - below * (high - low) / (above - below)
        value = phase_at(t, outs, exits, height) - level
        if abs(value) < AT_INTEGER * (1.0 + abs(level)) or high - low < NARROW:
            break
        low, high, below, above, side = bracket_with(t, value, low, high, below, above, side)
    return t


@linked
def extremum(places, phases, j, outs, exits, height):
    """-> (place, phase): the extremum of the phase near place j of the grid, by repeated parabolas."""
    a, b, c = places[j - 1], places[j], places[j + 1]
    first, middle, last = phases[j - 1], phases[j], phases[j + 1]
    for _ in range(EXTREMUM_STEPS):
        left, right = (b - a) * (middle - last), (b - c) * (middle - first)
        if left == right:
            break
        t = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right)
        if not a < t < c or abs(t - b) < NARROW:
            break
        value = phase_at(t, outs, exits, height)
        # whether the new place is the better one
        better = (value > middle) == (middle - first > last - middle)
        if better:
            a, first, c, last = (b, middle, c, last) if t > b else (a, first, b, middle)
            b, middle = t, value
        elif t > b:
            c, last = t, value
        else:
            a, first = t, value
    return b, middle


@linked
def advance(t, row, rows, sign, state, total):
    """Add the integrals from the last place, ``state[0]``, to t, in parts before and behind the corner."""
    corner = rows.corners[row]
    if state[0] < corner < t:
        advance_to(corner, row, rows, sign, state, total)
        advance_to(t, row, rows, -sign, state, total)
    else:
        advance_to(t, row, rows, sign if t <= corner else -sign, state, total)


@linked
def advance_to(t, row, rows, sign, state, total):
    """Add the integrals from ``state[0]`` to t; ``state[1:]`` are the antiderivatives at the last place."""
    for j in range(total.shape[0]):
        value = series_at(t, rows.anti[row, j])
        total[j] += sign * (value - state[1 + j])
        state[1 + j] = value
    state[0] = t


@inlined
def sign_at(phase):
    """Return 1.0 or -1.0, the sign of odd functions behind a channel for a phase."""
    return 1.0 if math.floor(phase) % 2.0 == 0.0 else -1.0


@linked
def pass_interval(low, high, below, above, row, rows, height, state, total):
    """Add the integrals up to the last crossing in an interval on which the phase is monotone."""
    first, last = math.floor(below), math.floor(above)
    sign = sign_at(below)
    for k in range(int(abs(last - first))):
        level = first + 1.0 + k if last > first else first - k
        if level == below:
            t = low
        elif level == above:
            t = high
        else:
            t = crossing(low, high, below, above, level, rows.outs[row], rows.exits[row], height)
        advance(max(t, state[0]), row, rows, sign, state, total)
        sign = -sign


@linked
def begin(t, row, rows, state, total):
    """Set the last place to t."""
    state[0] = t
    for j in range(total.shape[0]):
        state[1 + j] = series_at(t, rows.anti[row, j])


@compiled
def signed_integrals(rows, places, height, state, totals, lost):
    """Set the integrals of all functions, with their signs, on each row; ``lost`` is what is left out of the piece."""
    for row in range(totals.shape[0]):
        phases, total = rows.phases[row], totals[row]
        total[:] = 0.0
        begin(places[0], row, rows, state, total)
        low, below = places[0], phases[0]
        for j in range(1, places.shape[0]):
            high, above = places[j], phases[j]
            inner = j + 1 < places.shape[0]
            if inner and (above - below) * (phases[j + 1] - above) <= 0.0:
                high, above = extremum(places, phases, j, rows.outs[row], rows.exits[row], height)
            if abs(above - below) > MOST_CROSSINGS:
                advance(low, row, rows, sign_at(below), state, total)
                begin(high, row, rows, state, total)
                lost[row] += 0.5 * (high - low)
            else:
                pass_interval(low, high, below, above, row, rows, height, state, total)
            low, below = high, above
        advance(low, row, rows, sign_at(below), state, total)
