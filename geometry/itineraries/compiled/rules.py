"""Compiled nested rules between two neighbouring changes of itinerary.

The rules are Fejér's second rules in s with x = a + (b - a) s^2 (3 - 2 s), in which square roots at tangencies are
analytic at both ends. ``rules`` is the result of `nested_rules`. ``nodes`` are the outgoing angles and masses of a
conditional distribution, with spare room.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT
from ...scene.compiled.tables import ROW, Table, named, reader_of
from ...scene.structs import Struct
from ...tracing.compiled.options import linked
from .changes import BLOCK, FIRST_LABEL, is_spent, outcome, probe, size_at, trace_block

# Number of rules, and of the positions of the finest.
LEVELS = 5
MOST_POSITIONS = 2 ** (LEVELS + 1) - 1
# Limit on the nodes of one incoming angle.
MOST_NODES = 1 << 17
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


class Rules(NamedTuple):
    """Nested rules: the positions in (0, 1) of the finest, the weights of every rule, and the number of the first rule.

    The rule of number ``level`` has the first 2^(level + 2) - 1 positions.
    """

    positions: Floats
    weights: Floats
    least: int


class Nodes(NamedTuple):
    """Outgoing angles and masses of nodes."""

    angles: Floats
    masses: Floats


NODES = named(Nodes, ROW, ROW)
rules_at = reader_of(named(Rules, ROW, Table(MOST_POSITIONS), types.int64))


def nested_rules(least: int) -> Struct:
    """Return the rules after the substitution, to be used from number ``least`` on."""
    positions, weights = np.empty(0), np.zeros((LEVELS, MOST_POSITIONS))
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
    s = np.sin(0.5 * np.pi * positions) ** 2
    return Struct(Rules(s * s * (3.0 - 2.0 * s), 2.0 * weights * 3.0 * s * (1.0 - s), least))


@linked
def apply_rules(ends, label, goal, rules, task, nodes, filled, strict):
    """Apply rules of increasing order on an interval until the error estimate is at most ``goal``.

    Returns the number of nodes, the error, a position where a ray has another label (nan: none), and the number of
    rays. Without ``strict`` labels are ignored, and only the difference of the rules reveals a missed change.
    """
    low, high = ends
    positions, weights, least = rules.positions, rules.weights, rules.least
    node, mass = nodes.angles, nodes.masses
    setting = task.setting
    degree, entries = setting.degree, setting.tracer.entries
    width = high - low
    old0, old1, old2, old_step = 0.0, 0.0, 0.0, 0.0
    k = max(degree, 1)
    error = 2.0 * width
    traced, used = np.int64(0), np.int64(0)
    for level in range(LEVELS):
        count = (4 << level) - 1
        if count > MOST_NODES - filled - 2 or is_spent(setting):
            break
        for first in range(traced, count, BLOCK):
            last = min(first + BLOCK, count)
            for n in range(first, last):
                entries[n - first] = low + width * positions[n]
            trace_block(last - first, setting)
            for n in range(first, last):
                x = entries[n - first]
                out, here = outcome(n - first, task)
                if strict and here != label:
                    return used, error, x, np.int64(last)
                node[filled + n] = out
        traced = count
        if level < least:
            continue
        used = count
        new0, new1, new2 = 0.0, 0.0, 0.0
        for n in range(count):
            weight, out = width * weights[level, n], node[filled + n]
            mass[filled + n] = weight
            new0 += weight * math.cos(out)
            new1 += weight * math.cos(k * out)
            new2 += weight * math.sin(k * out)
        if degree == 0 or label < FIRST_LABEL:
            return used, 0.0, np.nan, traced
        if level > least:
            step = max(abs(new0 - old0), max(abs(new1 - old1), abs(new2 - old2))) + EPS * width
            ratio = 1.0 if level == least + 1 else step / old_step
            error = 2.0 * step * min(1.0, max(ratio, LEAST_RATIO))
            if error <= goal:
                break
            old_step = step
        old0, old1, old2 = new0, new1, new2
    return used, error, np.nan, traced


@linked
def integrate_piece(ends, sample, goal, rules, task, nodes, filled, strict):
    """Compute nodes on a piece, which is halved until the rules reach the tolerance.

    ``sample`` is the outgoing angle and label of a ray of the piece. Returns the total number of nodes, the error, a
    position where a ray has another label (nan: none), and the number of rays.
    """
    setting = task.setting
    whole = setting.hollow[RIGHT] - setting.hollow[LEFT]
    out, label = sample
    node, mass = nodes.angles, nodes.masses
    node[STACK], mass[STACK] = ends
    if setting.degree == 0 and ends[1] - ends[0] < NARROW * whole and strict and MOST_NODES - filled > 2:
        middle = 0.5 * (ends[0] + ends[1])
        out, here = probe(middle, task)
        if here != label:
            return filled, 0.0, middle, np.int64(1)
        node[filled], mass[filled] = out, ends[1] - ends[0]
        return filled + 1, 0.0, np.nan, np.int64(1)
    size = size_at(out, setting)
    depth, error, rays = np.int64(1), 0.0, np.int64(0)
    while depth > 0:
        depth -= 1
        low, high = node[STACK + depth], mass[STACK + depth]
        allowed = goal / size * max((high - low) / whole, LEAST_FRACTION)
        used, miss, other, spent = apply_rules((low, high), label, allowed, rules, task, nodes, filled, strict)
        rays += spent
        if not math.isnan(other):
            return filled, error, other, rays
        able = MOST_NODES - filled - 2 >= MOST_POSITIONS and not is_spent(setting)
        if miss > allowed and depth < MOST_HALVINGS and high - low > NARROWEST * whole and able:
            middle = 0.5 * (low + high)
            node[STACK + depth], mass[STACK + depth] = middle, high
            node[STACK + depth + 1], mass[STACK + depth + 1] = low, middle
            depth += 2
            continue
        if used == 0:
            node[filled], mass[filled] = out, high - low
            used = 1
        filled += used
        error += size * miss
    return filled, error, np.nan, rays
