"""Compiled Gauss rules between two neighbouring changes of itinerary.

The rules are Gauss rules in s with x = a + (b - a) s^2 (3 - 2 s), in which square roots at tangencies are analytic at
both ends. ``rules`` is the result of `gauss_tables`. ``nodes`` are the outgoing angles and masses of a conditional
distribution, with spare room.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT
from ...tracing.compiled.options import linked, linked_allocating
from .changes import FIRST_LABEL, is_spent, outcome, trace_block

ORDERS = (4, 7, 12, 20, 32)
# Limit on the nodes of one incoming angle.
MOST_NODES = 1 << 17
# Further nodes for margins and gaps.
SPARE = 4
# Least ratio of differences in the error estimate of a Gauss rule, 2 x last difference x last ratio of differences:
# smaller ratios, which also occur by chance, underestimate the error.
LEAST_RATIO = 0.03
# Width, as a fraction of the opening, below which pieces are not halved.
NARROWEST = 1e-9
MOST_HALVINGS = 40
# Least fraction of the tolerance for the rules of one piece, however narrow.
LEAST_FRACTION = 0.02


class Rules(NamedTuple):
    """Positions in (0, 1) and weights of all rules, consecutively, their starts, and the number of the first rule."""

    positions: Floats
    weights: Floats
    starts: NDArray[np.int64]
    least: int


def gauss_tables(least: int) -> Rules:
    """Return the rules after the substitution, to be used from number ``least`` on."""
    positions, weights, starts = [], [], [0]
    for order in ORDERS:
        node, weight = np.polynomial.legendre.leggauss(order)
        s = 0.5 * (1.0 + node)
        positions.append(s * s * (3.0 - 2.0 * s))
        weights.append(0.5 * weight * 6.0 * s * (1.0 - s))
        starts.append(starts[-1] + order)
    return Rules(np.concatenate(positions), np.concatenate(weights), np.array(starts), least)


@linked
def apply_rules(ends, label, goal, rules, task, nodes, filled, strict):
    """Apply rules of increasing order on an interval until the error estimate is at most ``goal``.

    Returns the number of nodes, the error, a position where a ray has another label (nan: none), and the number of
    rays. Without ``strict`` labels are ignored, and only the difference of the rules reveals a missed change.
    """
    low, high = ends
    positions, weights, starts, least = rules
    node, mass = nodes
    degree = task.degree
    width = high - low
    old0, old1, old2, old_step = 0.0, 0.0, 0.0, 0.0
    k = max(degree, 1)
    error = 2.0 * width
    used, rays = np.int64(0), np.int64(0)
    for level in range(least, len(ORDERS)):
        first, last = starts[level], starts[level + 1]
        if last - first > MOST_NODES - filled - 2 or is_spent(task):
            break
        new0, new1, new2 = 0.0, 0.0, 0.0
        block = task.setting.tracer.entries[: last - first]
        for n in range(first, last):
            block[n - first] = low + width * positions[n]
        trace_block(block, task)
        for n in range(first, last):
            x = block[n - first]
            out, here = outcome(n - first, x, task)
            rays += 1
            if strict and here != label:
                return used, error, x, rays
            weight = width * weights[n]
            node[filled + n - first], mass[filled + n - first] = out, weight
            new0 += weight * math.cos(out)
            new1 += weight * math.cos(k * out)
            new2 += weight * math.sin(k * out)
        used = last - first
        if degree == 0 or label < FIRST_LABEL:
            return used, 0.0, np.nan, rays
        if level > least:
            step = max(abs(new0 - old0), max(abs(new1 - old1), abs(new2 - old2))) + EPS * width
            ratio = 1.0 if level == least + 1 else step / old_step
            error = 2.0 * step * min(1.0, max(ratio, LEAST_RATIO))
            if error <= goal:
                break
            old_step = step
        old0, old1, old2 = new0, new1, new2
    return used, error, np.nan, rays


@linked_allocating
def integrate_piece(ends, sample, goal, rules, task, nodes, filled, strict):
    """Compute nodes on a piece, which is halved until the rules reach the tolerance.

    ``sample`` is the outgoing angle and label of a ray of the piece. Returns the total number of nodes, the error, a
    position where a ray has another label (nan: none), and the number of rays.
    """
    whole = task.setting.hollow[RIGHT] - task.setting.hollow[LEFT]
    low_stack, high_stack = np.empty(MOST_HALVINGS + 2), np.empty(MOST_HALVINGS + 2)
    low_stack[0], high_stack[0] = ends
    out, label = sample
    node, mass = nodes
    depth, error, rays = np.int64(1), 0.0, np.int64(0)
    while depth > 0:
        depth -= 1
        low, high = low_stack[depth], high_stack[depth]
        allowed = goal * max((high - low) / whole, LEAST_FRACTION)
        used, miss, other, spent = apply_rules((low, high), label, allowed, rules, task, nodes, filled, strict)
        rays += spent
        if not math.isnan(other):
            return filled, error, other, rays
        able = MOST_NODES - filled - 2 >= ORDERS[-1] and not is_spent(task)
        if miss > allowed and depth < MOST_HALVINGS and high - low > NARROWEST * whole and able:
            middle = 0.5 * (low + high)
            low_stack[depth], high_stack[depth] = middle, high
            low_stack[depth + 1], high_stack[depth + 1] = low, middle
            depth += 2
            continue
        if used == 0:
            node[filled], mass[filled] = out, high - low
            used = 1
        filled += used
        error += miss
    return filled, error, np.nan, rays
