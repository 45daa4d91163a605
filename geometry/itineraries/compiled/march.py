"""Compiled march along the entry points of one angle: intervals (pieces) of equal itinerary, and nodes on each.

The nodes are those of nested rules between two neighbouring changes of itinerary: Fejér's second rules in s with
x = a + (b - a) s^2 (3 - 2 s), in which square roots at tangencies are analytic at both ends. A node with another label
than its piece reveals a missed change of itinerary; it is added to the samples. For functions with many cuts in the
outgoing angle this is interpolated between the nodes, and Gauss's rule has nodes between the cuts, without more rays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...curves.columns import LEFT, RIGHT, SIZE, Struct
from ...scene.compiled.compiling import ROW, Table, compiled, kind_of, linked, named, reader_of
from ...tracing.compiled.rays import rays_at
from . import changes
from .changes import BLOCK, FIRST_LABEL, MOST_SAMPLES, Chain

# Number of rules, and of the positions of the finest.
LEVELS = 5
MOST_POSITIONS = 2 ** (LEVELS + 1) - 1
# Limit on the nodes of one incoming angle.
MOST_NODES = 1 << 18
# Least ratio of differences in the error estimate of a rule, 2 x last difference x last ratio of differences:
# smaller ratios, which also occur by chance, underestimate the error.
LEAST_RATIO = 0.03
# Width, as a fraction of the opening, below which pieces are not halved.
NARROWEST = 1e-9
# Width, as a fraction of the opening, below which one ray checks a piece on which the functions are constant.
NARROW = 1.0 / 32.0
MOST_HALVINGS = 40
# A stack of intervals lies behind the nodes and those of margins and gaps, so that nothing is allocated.
STACK = MOST_NODES + 4
NODE_ROOM = STACK + MOST_HALVINGS + 2
# Least fraction of the tolerance for the rules of one piece, however narrow.
LEAST_FRACTION = 0.05
# Rounding error of a mean, as a fraction of the opening, and of the position of a change, as a fraction of the hollow's
# size. Rays have errors of a few EPS times the derivative of the map, which is seldom above some hundreds except next
# to a change (measured, not proved).
ROUNDING, EDGE_ROUNDING = 1024.0 * EPS, 64.0 * EPS
# Fractions of the tolerance for the nested rules and for all gaps.
RULE_FRACTION, GAP_FRACTION = 0.5, 0.25
# Fraction of the tolerance of the gaps for the gaps at a missed change.
LATE_FRACTION = 0.05
# Gauss's rule between cuts on (0, 1), and secant steps to a cut, at which functions jump by little. For errors of a
# piece, if it were the whole opening, from `ROUGH` on the rule does without every other stop; the difference was below
# this fraction of the error.
GAUSS_NODES, GAUSS_WEIGHTS = 0.5 * (np.polynomial.legendre.leggauss(5) + np.array([[1.0], [0.0]]))
SECANT_STEPS = 12
ROUGH, GAUSS_FRACTION = 1e-8, 0.05
# Distance from a node at which its value is that of the interpolation.
AT_NODE = 1e-14


class Rules(NamedTuple):
    """Nested rules: the positions in (0, 1) of the finest, the weights of every rule, and the number of the first rule.

    The rule of number ``level`` has the first 2^(level + 2) - 1 positions. At ``places`` are the positions in s, in
    which a rule interpolates by its ``barycentric`` weights; ``order`` has the numbers of its increasing positions.
    Outgoing angles are interpolated if there are ``cuts``.
    """

    positions: Floats
    weights: Floats
    least: int
    places: Floats
    barycentric: Floats
    order: Floats
    cuts: Floats
    cut_count: int


class Nodes(NamedTuple):
    """Outgoing angles and masses of nodes."""

    angles: Floats
    masses: Floats


TABLE = Table(MOST_POSITIONS)
rules_at = reader_of(named(Rules, ROW, TABLE, types.int64, ROW, TABLE, TABLE, ROW, types.int64))


def nested_rules(least: int, cuts: Floats) -> Struct:
    """Return the rules after the substitution, to be used from number ``least`` on, with cuts of the outgoing angle."""
    positions = np.empty(0)
    weights, barycentric, order = np.zeros((3, LEVELS, MOST_POSITIONS))
    for level in range(LEVELS):
        intervals = 2 ** (level + 2)
        number = np.arange(1, intervals)
        fresh = number if level == 0 else number[::2]
        positions = np.append(positions, fresh / intervals)
        # Fejer's second rule: interpolation at the inner extrema of Chebyshev's polynomials
        odd = np.arange(1, intervals, 2)
        angle = np.pi * positions
        weights[level, : len(angle)] = (
            2.0 / intervals * np.sin(angle) * np.sum(np.sin(np.outer(angle, odd)) / odd, axis=1)
        )
        barycentric[level, : len(angle)] = (-1.0) ** np.rint(intervals * positions) * np.sin(angle) ** 2
        order[level, : len(angle)] = np.argsort(positions)
    s = np.sin(0.5 * np.pi * positions) ** 2
    rules = s * s * (3.0 - 2.0 * s), 2.0 * weights * 3.0 * s * (1.0 - s), least
    return Struct(Rules(*rules, s, barycentric, order, cuts, len(cuts)))


@linked
def interpolated(s, level, rules, nodes, first):
    """Return the outgoing angle at s by the polynomial through those of a rule, whose nodes begin at ``first``."""
    above, below = 0.0, 0.0
    for n in range((4 << level) - 1):
        step = s - rules.places[n]
        if abs(step) < AT_NODE:
            return nodes.angles[first + n]
        ratio = rules.barycentric[level, n] / step
        above += ratio * nodes.angles[first + n]
        below += ratio
    return above / below


@linked
def change_by_level(level, width, rules, nodes, first):
    """Return the integral of the distance between the angles of a rule and the polynomial of the rule before."""
    total = 0.0
    for n in range((2 << level) - 1, (4 << level) - 1):
        miss = abs(nodes.angles[first + n] - interpolated(rules.places[n], level - 1, rules, nodes, first))
        # these nodes have half of the weight
        total += 2.0 * width * rules.weights[level, n] * miss
    return total


@linked
def divide_at_cuts(level, rough, width, rules, nodes, first):
    """Replace the nodes of a rule, the last ones, by those of Gauss's rule between its stops and the cuts.

    Stops are the positions of rule ``rough``. Without a cut, or where they are too many, the nodes stay. Returns the
    number of all nodes, or -1 in the latter case.
    """
    count, stops = (4 << level) - 1, (4 << rough) - 1
    needed = np.int64(0)
    before = changes.cell_of(interpolated(0.0, level, rules, nodes, first), rules.cuts, rules.cut_count)
    for n in range(stops):
        cell = changes.cell_of(nodes.angles[first + np.int64(rules.order[rough, n])], rules.cuts, rules.cut_count)
        needed += abs(cell - before)
        before = cell
    cell = changes.cell_of(interpolated(1.0, level, rules, nodes, first), rules.cuts, rules.cut_count)
    needed += abs(cell - before)
    if needed == 0:
        return first + count
    if first + count + GAUSS_NODES.shape[0] * (needed + stops + 1) > MOST_NODES - 2:
        return np.int64(-1)
    low, at_low, filled = 0.0, interpolated(0.0, level, rules, nodes, first), first + count
    for n in range(stops + 1):
        high = rules.places[np.int64(rules.order[rough, n])] if n < stops else 1.0
        at_high = interpolated(high, level, rules, nodes, first)
        cell = changes.cell_of(at_low, rules.cuts, rules.cut_count)
        last = changes.cell_of(at_high, rules.cuts, rules.cut_count)
        step = np.int64(1 if last > cell else -1)
        while low < high:
            s, edge = high, at_high
            if cell != last:
                edge = rules.cuts[cell if step > 0 else cell - 1]
                s = place_of(edge, low, high, at_low, at_high, level, rules, nodes, first)
            for g in range(GAUSS_NODES.shape[0]):
                t = low + (s - low) * GAUSS_NODES[g]
                nodes.angles[filled] = interpolated(t, level, rules, nodes, first)
                nodes.masses[filled] = width * (s - low) * GAUSS_WEIGHTS[g] * 6.0 * t * (1.0 - t)
                filled += 1
            if cell == last:
                break
            low, at_low, cell = s, edge, cell + step
        low, at_low = high, at_high
    for n in range(first, filled - count):
        nodes.angles[n], nodes.masses[n] = nodes.angles[n + count], nodes.masses[n + count]
    return filled - count


@linked
def place_of(edge, low, high, at_low, at_high, level, rules, nodes, first):
    """Return where between two places the interpolated angle is that of a cut."""
    s = 0.5 * (low + high)
    for _ in range(SECANT_STEPS):
        if at_high == at_low:
            break
        s = min(max(low + (high - low) * (edge - at_low) / (at_high - at_low), low), high)
        here = interpolated(s, level, rules, nodes, first)
        if (here > edge) == (at_high > at_low):
            high, at_high = s, here
        else:
            low, at_low = s, here
    return s


@linked
def apply_rules(ends, label, goal, rules, setting, nodes, filled, strict):
    """Apply rules of increasing order on an interval until the error estimate is at most ``goal``.

    Returns the number of nodes, the error, a position where a ray has another label (nan: none), and the number of
    rays. Without ``strict`` labels are ignored, and only the difference of the rules reveals a missed change.
    """
    low, high = ends
    positions, weights, least = rules.positions, rules.weights, rules.least
    node, mass = nodes.angles, nodes.masses
    degree, entries = setting.degree, rays_at(setting.rays).x
    width = high - low
    old0, old1, old2, old_step = 0.0, 0.0, 0.0, 0.0
    k = max(degree, 1)
    error = 2.0 * width
    traced, used = np.int64(0), np.int64(0)
    for level in range(LEVELS):
        count = (4 << level) - 1
        if count > MOST_NODES - filled - 2 or changes.is_spent(setting):
            break
        for first in range(traced, count, BLOCK):
            last = min(first + BLOCK, count)
            for n in range(first, last):
                entries[n - first] = low + width * positions[n]
            changes.trace_block(last - first, setting)
            for n in range(first, last):
                x = entries[n - first]
                out, here = changes.outcome(n - first, setting)
                if strict and here != label:
                    return used, error, x, np.int64(last)
                node[filled + n] = out
        traced = count
        if level < least:
            continue
        used = count
        for n in range(count):
            mass[filled + n] = width * weights[level, n]
        if degree == 0 or label < FIRST_LABEL:
            return used, 0.0, np.nan, traced
        new0, new1, new2 = 0.0, 0.0, 0.0
        if rules.cut_count == 0:
            for n in range(count):
                weight, out = mass[filled + n], node[filled + n]
                new0 += weight * math.cos(out)
                new1 += weight * math.cos(k * out)
                new2 += weight * math.sin(k * out)
        if level > least:
            if rules.cut_count > 0:
                step = change_by_level(level, width, rules, nodes, filled) + EPS * width
            else:
                step = max(abs(new0 - old0), max(abs(new1 - old1), abs(new2 - old2))) + EPS * width
            ratio = 1.0 if level == least + 1 else step / old_step
            error = 2.0 * step * min(1.0, max(ratio, LEAST_RATIO))
            if error <= goal:
                break
            old_step = step
        old0, old1, old2 = new0, new1, new2
    return used, error, np.nan, traced


@linked
def integrate_piece(ends, sample, goal, rules, setting, nodes, filled, strict):
    """Compute nodes on a piece, which is halved until the rules reach the tolerance.

    ``sample`` is the outgoing angle and label of a ray of the piece. Returns the total number of nodes, the error, a
    position where a ray has another label (nan: none), and the number of rays.
    """
    whole = setting.hollow[RIGHT] - setting.hollow[LEFT]
    out, label = sample
    node, mass = nodes.angles, nodes.masses
    node[STACK], mass[STACK] = ends
    if setting.degree == 0 and ends[1] - ends[0] < NARROW * whole and strict and MOST_NODES - filled > 2:
        middle = 0.5 * (ends[0] + ends[1])
        out, here = changes.probe(middle, setting)
        if here != label:
            return filled, 0.0, middle, np.int64(1)
        node[filled], mass[filled] = out, ends[1] - ends[0]
        return filled + 1, 0.0, np.nan, np.int64(1)
    size = changes.size_at(out, setting)
    depth, error, rays = np.int64(1), 0.0, np.int64(0)
    while depth > 0:
        depth -= 1
        low, high = node[STACK + depth], mass[STACK + depth]
        allowed = goal / size * max((high - low) / whole, LEAST_FRACTION)
        used, miss, other, spent = apply_rules((low, high), label, allowed, rules, setting, nodes, filled, strict)
        rays += spent
        if not math.isnan(other):
            return filled, error, other, rays
        able = MOST_NODES - filled - 2 >= MOST_POSITIONS and not changes.is_spent(setting)
        if miss > allowed and depth < MOST_HALVINGS and high - low > NARROWEST * whole and able:
            middle = 0.5 * (low + high)
            node[STACK + depth], mass[STACK + depth] = middle, high
            node[STACK + depth + 1], mass[STACK + depth + 1] = low, middle
            depth += 2
            continue
        if used == 0 and filled > MOST_NODES - 2:
            # no room for another node
            mass[filled - 1] += high - low
            miss = 2.0 * (high - low)
        elif used == 0:
            node[filled], mass[filled] = out, high - low
            used = 1
        elif rules.cut_count > 0 and label >= FIRST_LABEL:
            level = np.int64(round(math.log2((used + 1) / 4)))
            rough = max(level - 1, np.int64(0)) if goal >= ROUGH * whole else level
            divided = divide_at_cuts(level, rough, high - low, rules, nodes, filled)
            if divided >= 0:
                used = divided - filled
                miss = max(miss, GAUSS_FRACTION * goal / size * (high - low) / whole)
            else:
                miss = 2.0 * (high - low)
        filled += used
        error += size * miss
    return filled, error, np.nan, rays


class Pieces(NamedTuple):
    """First and last positions, labels, and first outgoing angles of pieces."""

    low: Floats
    high: Floats
    label: NDArray[np.uint64]
    out: Floats


class Room(NamedTuple):
    """Work space for one angle: its samples, nodes and pieces."""

    chain: Chain
    nodes: Nodes
    pieces: Pieces


class Found(NamedTuple):
    """What is found at one angle.

    Nodes and pieces, the error, the width of unresolved rays, and the numbers of rays and of ray segments.
    """

    nodes: Nodes
    pieces: Pieces
    error: float
    unresolved: float
    rays: int
    segments: int


def new_room() -> Room:
    """Return the work space for the angles of one call."""
    low, high, out = np.empty((3, MOST_SAMPLES))
    pieces = Pieces(low, high, np.empty(MOST_SAMPLES, np.uint64), out)
    return Room(changes.empty_chain(), Nodes(*np.empty((2, NODE_ROOM))), pieces)


room_at = reader_of(kind_of(new_room()))


@compiled
def march_angle(theta, goal, setting, rules, entries, room):
    """Compute the nodes and masses of the conditional distribution at one incoming angle.

    Returns the number of nodes, the error, the width of unresolved rays, and the numbers of pieces and of rays. If the
    limit of ray segments is reached, the error includes the gaps that remain. ``entries`` are the first samples, which
    increase; of the setting, the rules and the room the addresses are given.
    """
    setting, rules, room = changes.setting_at(setting), rules_at(rules), room_at(room)
    changes.set_angle(theta, setting)
    chain, nodes, pieces = room.chain, room.nodes, room.pieces
    xs, outs, labels, follow = chain.entries, chain.angles, chain.labels, chain.successors
    node, mass = nodes.angles, nodes.masses
    lows, highs, names, firsts = pieces.low, pieces.high, pieces.label, pieces.out
    hollow = setting.hollow
    left, right = hollow[LEFT], hollow[RIGHT]
    whole = right - left
    setting.spent[0] = 0
    count, last = changes.sample_entries(entries, setting, chain, GAP_FRACTION * goal)
    rays = np.int64(0)
    # the first and the last sample represent the margins
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled, number, unresolved = np.int64(2), np.int64(0), 0.0
    largest = 0.0
    for cell in range(setting.edge_count + 1):
        largest = max(largest, setting.sizes[cell])
    error = ROUNDING * largest * whole
    first_change = mass[0] * changes.spread(outs[0], outs[1], setting)
    error += first_change + mass[1] * changes.spread(outs[last], outs[last - 1], setting)
    i = np.int64(0)
    while i >= 0:
        j = i
        while follow[j] >= 0 and labels[follow[j]] == labels[i]:
            j = follow[j]
        if j != i:
            ready, miss, other, spent = integrate_piece(
                (xs[i], xs[j]), (outs[i], labels[i]), RULE_FRACTION * goal, rules, setting, nodes, filled,
                count < MOST_SAMPLES - 4 and not changes.is_spent(setting),
            )  # fmt: skip
            rays += spent
            if not math.isnan(other):
                # a missed change: add it to the samples, and repeat the piece
                count = changes.add_change(other, i, setting, chain, count, LATE_FRACTION * GAP_FRACTION * goal)
                continue
            filled, error = ready, error + miss
            if labels[i] < FIRST_LABEL:
                unresolved += xs[j] - xs[i]
                error += 2.0 * largest * (xs[j] - xs[i])
        lows[number], highs[number], names[number], firsts[number] = xs[i], xs[j], labels[i], outs[i]
        number += 1
        following = follow[j]
        if following >= 0:
            width = xs[following] - xs[j]
            if filled + 2 < MOST_NODES:
                node[filled], mass[filled] = outs[j], 0.5 * width
                node[filled + 1], mass[filled + 1] = outs[following], 0.5 * width
                filled += 2
            else:
                mass[filled - 1] += width
                error += 2.0 * largest * width
            change = EDGE_ROUNDING * hollow[SIZE] * changes.spread(outs[j], outs[following], setting)
            error += changes.undecided(j, setting, chain) + change
        i = following
    return filled, error, unresolved, number, rays + count


def marched_angles(
    thetas: Floats, tolerances: Floats, setting: Struct, rules: Struct, seeds: list[Floats]
) -> list[Found]:
    """Compute the conditional distributions at incoming angles. The seeds are the first samples, which increase."""
    room, found = Struct(new_room()), []
    hollow, spent = setting.values.hollow, setting.values.spent
    places = setting.address, rules.address
    for theta, tolerance, entries in zip(thetas.tolist(), tolerances.tolist(), seeds, strict=True):
        goal = tolerance * float(hollow[RIGHT] - hollow[LEFT])
        filled, error, unresolved, number, rays = march_angle(theta, goal, *places, entries, room.address)
        own_nodes = Nodes._make(part[:filled].copy() for part in room.values.nodes)
        own_pieces = Pieces._make(part[:number].copy() for part in room.values.pieces)
        found.append(Found(own_nodes, own_pieces, error, unresolved, rays, int(spent[0])))
    return found
