"""Compiled march along the entry points of one angle: intervals (pieces) of equal itinerary, and Gauss nodes on each.

A node with another label than its piece reveals a missed change of itinerary; it is added to the samples.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from ....core.compilation import jit
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT, SIZE
from ...tracing.compiled.growing import append, longer
from ...tracing.compiled.options import allocating
from ...tracing.compiled.pointers import address_of, call_at
from .changes import (
    FIRST_LABEL,
    MOST_SAMPLES,
    add_change,
    empty_chain,
    example_chain,
    example_task,
    is_spent,
    sample_entries,
    spread,
    task_of,
    undecided,
)
from .gauss import MOST_NODES, SPARE, gauss_tables, integrate_piece

_compile = jit()

# Limit on the pieces of one angle whose middles are samples of the next angle.
MOST_SEEDS = 128
# Rounding error of a mean, as a fraction of the opening, and of the position of a change, as a fraction of the hollow's
# size. Rays have errors of a few EPS times the derivative of the map, which is seldom above some hundreds except next
# to a change (measured, not proved).
ROUNDING, EDGE_ROUNDING = 1024.0 * EPS, 64.0 * EPS
# Fractions of the tolerance for the Gauss rules and for all gaps.
RULE_FRACTION, GAP_FRACTION = 0.5, 0.25
# Fraction of the tolerance of the gaps for the gaps at a missed change.
LATE_FRACTION = 0.05


@allocating
def merged(first, second):
    """Merge two increasing sequences."""
    both = np.empty(first.shape[0] + second.shape[0])
    i, j = np.int64(0), np.int64(0)
    for k in range(both.shape[0]):
        if j == second.shape[0] or (i < first.shape[0] and first[i] <= second[j]):
            both[k] = first[i]
            i += 1
        else:
            both[k] = second[j]
            j += 1
    return both


@allocating
def march_angle(task, goal, rules, entries, chain, nodes, pieces):
    """Compute the nodes and masses of the conditional distribution at one incoming angle.

    Returns the number of nodes, the error, the width of unresolved rays, and the numbers of pieces and of rays. If the
    limit of ray segments is reached, the error includes the gaps that remain. ``pieces`` receives the first and last
    position and the label of every piece.
    """
    xs, outs, labels, follow, _, _ = chain
    node, mass = nodes
    lows, highs, names = pieces
    hollow = task.setting.hollow
    left, right = hollow[LEFT], hollow[RIGHT]
    whole = right - left
    task.segments[0] = 0
    count, last = sample_entries(entries, task, chain, GAP_FRACTION * goal)
    rays = np.int64(0)
    # the first and the last sample represent the margins
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled, number, unresolved = np.int64(2), np.int64(0), 0.0
    error = ROUNDING * whole
    error += mass[0] * spread(outs[0], outs[1], task) + mass[1] * spread(outs[last], outs[last - 1], task)
    i = np.int64(0)
    while i >= 0:
        j = i
        while follow[j] >= 0 and labels[follow[j]] == labels[i]:
            j = follow[j]
        if j != i:
            ready, miss, other, spent = integrate_piece(
                (xs[i], xs[j]), (outs[i], labels[i]), RULE_FRACTION * goal, rules, task, nodes, filled,
                count < MOST_SAMPLES - 4 and not is_spent(task),
            )  # fmt: skip
            rays += spent
            if not math.isnan(other):
                # a missed change: add it to the samples, and repeat the piece
                count = add_change(other, i, task, chain, count, LATE_FRACTION * GAP_FRACTION * goal)
                continue
            filled, error = ready, error + miss
            if labels[i] < FIRST_LABEL:
                unresolved += xs[j] - xs[i]
                error += 2.0 * (xs[j] - xs[i])
        lows[number], highs[number], names[number] = xs[i], xs[j], labels[i]
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
                error += width
            error += undecided(j, task, chain) + EDGE_ROUNDING * hollow[SIZE] * spread(outs[j], outs[following], task)
        i = following
    return filled, error, unresolved, number, rays + count


@allocating
def room_for_pieces(count):
    """Return arrays for the first positions, last positions and labels of ``count`` pieces."""
    return np.empty(count), np.empty(count), np.empty(count, np.uint64)


@_compile
def wide_middles(lows, highs, least):
    """Return the middles of the pieces wider than ``least``, of the widest ones if there are more than MOST_SEEDS."""
    # double the least width until at most MOST_SEEDS pieces remain
    least, many = max(least, EPS * EPS), True
    while many:
        count = 0
        for k in range(lows.shape[0]):
            count += highs[k] - lows[k] > least
        many = count > MOST_SEEDS
        least *= 2.0
    middles = np.empty(count)
    count = 0
    for k in range(lows.shape[0]):
        if highs[k] - lows[k] > 0.5 * least:
            middles[count] = 0.5 * (lows[k] + highs[k])
            count += 1
    return middles


@cache
def march_address() -> int:
    """Return the address of `march_angle`."""
    pieces = np.empty(0), np.empty(0), np.empty(0, np.uint64)
    rules, entries, nodes = gauss_tables(0), np.empty(0), (np.empty(0), np.empty(0))
    return address_of(march_angle, (example_task(), 0.0, rules, entries, example_chain(), nodes, pieces))


@_compile
def march_angles(thetas, tolerances, setting, degree, rules, seeds, seed_starts, march):
    """Compute the conditional distributions at increasing incoming angles.

    The first samples at an angle are its seeds, which increase, and the middles of the pieces at the angle before, so
    that a narrow piece is followed until it disappears. Returns outgoing angles and masses, angle by angle, and the
    start of each angle; first positions, last positions and labels of the pieces, and the start of each angle; and for
    each angle the error, the width of unresolved rays, and the numbers of rays and of ray segments. ``march`` is
    `march_address`.
    """
    hollow = setting.hollow
    whole = hollow[RIGHT] - hollow[LEFT]
    chain, spent = empty_chain(), np.zeros(1, np.int64)
    nodes = np.empty(MOST_NODES + SPARE), np.empty(MOST_NODES + SPARE)
    angles, masses = nodes
    pieces = room_for_pieces(MOST_SAMPLES)
    lows, highs, labels = pieces
    n = thetas.shape[0]
    node_starts, piece_starts = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    errors, unresolved, rays, segments = np.empty(n), np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64)
    all_angles, all_masses = np.empty(1024), np.empty(1024)
    all_lows, all_highs, all_labels = room_for_pieces(1024)
    previous = np.empty(0)
    for k in range(n):
        task = task_of(setting, thetas[k], degree, spent)
        goal = tolerances[k] * whole
        entries = merged(previous, seeds[seed_starts[k] : seed_starts[k + 1]])
        filled, errors[k], unresolved[k], number, rays[k] = call_at(
            march,
            (np.int64(0), 0.0, 0.0, np.int64(0), np.int64(0)),
            (task, goal, rules, entries, chain, nodes, pieces),
        )
        segments[k] = spent[0]
        previous = wide_middles(lows[:number], highs[:number], goal)
        begin, end = node_starts[k], node_starts[k] + filled
        if end > all_angles.shape[0]:
            all_angles, all_masses = longer(all_angles, 2 * end), longer(all_masses, 2 * end)
        append(all_angles, begin, angles, filled)
        append(all_masses, begin, masses, filled)
        node_starts[k + 1] = end
        begin, end = piece_starts[k], piece_starts[k] + number
        if end > all_lows.shape[0]:
            all_lows, all_highs = longer(all_lows, 2 * end), longer(all_highs, 2 * end)
            all_labels = longer(all_labels, 2 * end)
        append(all_lows, begin, lows, number)
        append(all_highs, begin, highs, number)
        append(all_labels, begin, labels, number)
        piece_starts[k + 1] = end
    nodes, pieces = (all_angles, all_masses), (all_lows, all_highs, all_labels)
    return nodes, node_starts, pieces, piece_starts, errors, unresolved, rays, segments
