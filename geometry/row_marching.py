"""The compiled march along rows: pieces of equal itinerary, and Gauss nodes on each. Imported inside functions only.

A node whose label is not that of its piece is a change that was overlooked; it is put among the samples.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .itineraries import (
    EPS,
    FIRST_LABEL,
    MOST_SAMPLES,
    add_change,
    empty_chain,
    sample_row,
    spread,
    undecided,
)
from .piece_rules import MOST_NODES, SPARE, integrate_piece

_compile = njit(cache=True, nogil=True, error_model="numpy")

# Samples that a row starts from, at irregular places so that no symmetry of the wall hides a piece from all of them.
FIRST_SAMPLES = 32
GOLDEN = 0.6180339887498949
# Neighbouring rows have other places: any large number without pattern does.
ROW_SHIFT = 12345.6789
# More of them at either end, each nearer to it by this ratio.
END_SAMPLES, END_RATIO = 10, 0.3
# Pieces of a row that its neighbours start from.
MOST_SEEDS = 128
# Rounding of the mean of a row, and of the place of a change as a share of the opening. Rays are good to a few units of
# EPS times the derivative of their map, seldom above some hundreds except next to a change: measured, not proved.
ROUNDING, EDGE_ROUNDING = 1024.0 * EPS, 64.0 * EPS
# The first and the last sample are this share of the row's tolerance, or of the opening, away from the ends.
MARGIN = 1e-3
# The share of the tolerance that the Gauss rules may spend, and that all undecided gaps may take.
RULE_SHARE, GAP_SHARE = 0.5, 0.25
# The share of what the rules may spend that any piece may, however short it is.
LEAST_SHARE = 0.02
# The share of what the gaps may take for those of a change that was overlooked.
LATE_SHARE = 0.05


@_compile
def first_places(theta, hollow, goal, seeds):
    """Places of the samples that a row starts from, in increasing order.

    They lie elsewhere in every row, so that the rows together leave no large part of all rays unseen, and crowd at the
    ends of the opening, where the pieces of a smooth hollow become ever narrower.
    """
    left, right = hollow[0], hollow[1]
    whole = right - left
    margin = MARGIN * min(goal, MARGIN * whole)
    first = np.empty(FIRST_SAMPLES + 2 * (END_SAMPLES + 1) + seeds.shape[0])
    shift = (theta * ROW_SHIFT) % 1.0
    for n in range(FIRST_SAMPLES):
        first[n] = left + whole * (n + 0.25 + 0.5 * ((n * GOLDEN + shift) % 1.0)) / FIRST_SAMPLES
    share = 1.0 / FIRST_SAMPLES
    count = FIRST_SAMPLES
    for _ in range(END_SAMPLES):
        share *= END_RATIO
        first[count], first[count + 1] = left + share * whole, right - share * whole
        count += 2
    first[count], first[count + 1] = left + margin, right - margin
    first[count + 2 :] = seeds
    first.sort()
    return first


@_compile
def march_row(task, goal, rules, least, seeds, chain, nodes, pieces):
    """Nodes and masses of one row; returns their number, the error, the lost width, the number of pieces and of rays.

    ``pieces`` receives first and last place and label of every piece.
    """
    xs, outs, labels, follow, _, _ = chain
    node, mass = nodes
    hollow, degree = task[1], task[6]
    left, right = hollow[0], hollow[1]
    whole = right - left
    count, last = sample_row(first_places(task[0], hollow, goal, seeds), task, chain, GAP_SHARE * goal)
    rays = 0
    # the margins count with the first and the last sample
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled, number, lost = 2, 0, 0.0
    error = ROUNDING * whole
    error += mass[0] * spread(outs[0], outs[1], degree) + mass[1] * spread(outs[last], outs[last - 1], degree)
    i = 0
    while i >= 0:
        j = i
        while follow[j] >= 0 and labels[follow[j]] == labels[i]:
            j = follow[j]
        if j != i:
            ready, miss, other, spent = integrate_piece(
                (xs[i], xs[j]), outs[i], labels[i], RULE_SHARE * goal, LEAST_SHARE, rules, least, task, nodes, filled,
                count < MOST_SAMPLES - 4,
            )  # fmt: skip
            rays += spent
            if not math.isnan(other):
                # an overlooked change: it joins the samples, and the piece is walked again
                count = add_change(other, i, task, chain, count, LATE_SHARE * GAP_SHARE * goal)
                continue
            filled, error = ready, error + miss
            if labels[i] < FIRST_LABEL:
                lost += xs[j] - xs[i]
                error += 2.0 * (xs[j] - xs[i])
        pieces[0][number], pieces[1][number], pieces[2][number] = xs[i], xs[j], labels[i]
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
            error += undecided(j, task, chain) + EDGE_ROUNDING * whole * spread(outs[j], outs[following], degree)
        i = following
    return filled, error, lost, number, rays + count


@_compile
def room_for_pieces(count):
    """First places, last places and labels."""
    return np.empty(count), np.empty(count), np.empty(count, np.uint64)


@_compile
def longer(array, size):
    """The array with room for so many entries."""
    bigger = np.empty(size, array.dtype)
    bigger[: array.shape[0]] = array
    return bigger


@_compile
def wide_middles(lows, highs, least):
    """The middles of the pieces wider than that: of the widest ones, if they are many."""
    wide = highs - lows > least
    if wide.sum() > MOST_SEEDS:
        wide = highs - lows >= np.sort(highs - lows)[-MOST_SEEDS]
    return 0.5 * (lows[wide] + highs[wide])


@_compile
def march_rows(thetas, tolerances, scene, degree, rules, least, seeds, seed_starts):
    """Rows at increasing angles.

    ``scene``: hollow, tables, period, limit of collisions, edges of cells. A row starts also from its seeds, and from
    the middles of the pieces of the row before, so that a narrow piece is followed until it vanishes. Returns outgoing
    angles and masses, one row after the other, and where each row starts; the same of first places, last places and
    labels of the pieces; and the error, the width lost and the number of rays of each row.
    """
    hollow, tables, period, limit, edges = scene
    whole = hollow[1] - hollow[0]
    chain, code = empty_chain(), np.zeros(1, np.uint64)
    nodes = np.empty(MOST_NODES + SPARE), np.empty(MOST_NODES + SPARE)
    pieces = room_for_pieces(MOST_SAMPLES)
    n = thetas.shape[0]
    node_starts, piece_starts = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    errors, lost, rays = np.empty(n), np.empty(n), np.empty(n, np.int64)
    all_nodes = np.empty(1024), np.empty(1024)
    all_pieces = room_for_pieces(1024)
    previous = np.empty(0)
    for k in range(n):
        task = (thetas[k], hollow, tables, period, limit, edges, degree, code)
        goal = tolerances[k] * whole
        places = np.concatenate((previous, seeds[seed_starts[k] : seed_starts[k + 1]]))
        filled, errors[k], lost[k], number, rays[k] = march_row(task, goal, rules, least, places, chain, nodes, pieces)
        previous = wide_middles(pieces[0][:number], pieces[1][:number], goal)
        begin, end = node_starts[k], node_starts[k] + filled
        if end > all_nodes[0].shape[0]:
            all_nodes = longer(all_nodes[0], 2 * end), longer(all_nodes[1], 2 * end)
        all_nodes[0][begin:end], all_nodes[1][begin:end] = nodes[0][:filled], nodes[1][:filled]
        node_starts[k + 1] = end
        begin, end = piece_starts[k], piece_starts[k] + number
        if end > all_pieces[0].shape[0]:
            all_pieces = longer(all_pieces[0], 2 * end), longer(all_pieces[1], 2 * end), longer(all_pieces[2], 2 * end)
        all_pieces[0][begin:end], all_pieces[1][begin:end] = pieces[0][:number], pieces[1][:number]
        all_pieces[2][begin:end] = pieces[2][:number]
        piece_starts[k + 1] = end
    return all_nodes, node_starts, all_pieces, piece_starts, errors, lost, rays
