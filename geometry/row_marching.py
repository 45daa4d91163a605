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
FIRST_SAMPLES = 24
GOLDEN = 0.6180339887498949
# The first and the last sample are this share of the row's tolerance, or of the opening, away from the ends.
MARGIN = 1e-3
# The share of the tolerance that the Gauss rules may spend, and that all undecided gaps may take.
RULE_SHARE, GAP_SHARE = 0.5, 0.25
# The share of what the rules may spend that any piece may, however short it is.
LEAST_SHARE = 0.02
# The share of what the gaps may take for those of a change that was overlooked.
LATE_SHARE = 0.05


@_compile
def first_places(hollow, goal, seeds):
    """Places of the samples that a row starts from, in increasing order."""
    left, right = hollow[0], hollow[1]
    whole = right - left
    margin = MARGIN * min(goal, MARGIN * whole)
    first = np.empty(FIRST_SAMPLES + 2 + seeds.shape[0])
    first[0], first[1] = left + margin, right - margin
    for n in range(FIRST_SAMPLES):
        first[2 + n] = left + whole * (n + 0.25 + 0.5 * ((n * GOLDEN) % 1.0)) / FIRST_SAMPLES
    first[FIRST_SAMPLES + 2 :] = seeds
    first.sort()
    return first


@_compile
def march_row(task, goal, rules, least, seeds, chain, nodes, ends):
    """Nodes and masses of one row; returns their number, the error, the lost width, pieces and rays.

    ``ends`` receives the middles of the pieces, seeds for the next row.
    """
    xs, outs, labels, follow, _, _ = chain
    node, mass = nodes
    hollow, degree = task[1], task[6]
    left, right = hollow[0], hollow[1]
    whole = right - left
    count, last = sample_row(first_places(hollow, goal, seeds), task, chain, GAP_SHARE * goal)
    rays = 0
    # the margins count with the first and the last sample
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled, pieces, lost = 2, 0, 0.0
    error = 2.0 * EPS * whole
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
        if pieces < ends.shape[0]:
            ends[pieces] = 0.5 * (xs[i] + xs[j])
        pieces += 1
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
            error += undecided(j, task, chain)
        i = following
    return filled, error, lost, pieces, rays + count


@_compile
def longer(array, used, least):
    """The array with room for ``least`` entries, of which the first ``used`` are kept."""
    if least <= array.shape[0]:
        return array
    bigger = np.empty(2 * least)
    bigger[:used] = array[:used]
    return bigger


@_compile
def march_rows(thetas, tolerances, scene, degree, rules, least, most_seeds):
    """Rows at increasing angles: nodes and masses one after the other, where each row starts, errors, lost, rays.

    ``scene``: hollow, tables, period, limit of collisions, edges of cells. Each row starts also from the middles of its
    neighbour's pieces, so that a narrow piece is followed until it vanishes.
    """
    hollow, tables, period, limit, edges = scene
    chain, code = empty_chain(), np.zeros(1, np.uint64)
    nodes = np.empty(MOST_NODES + SPARE), np.empty(MOST_NODES + SPARE)
    ends, seeds = np.empty(most_seeds), np.empty(0)
    n = thetas.shape[0]
    starts = np.zeros(n + 1, np.int64)
    errors, lost, rays = np.empty(n), np.empty(n), np.empty(n, np.int64)
    all_node, all_mass = np.empty(1024), np.empty(1024)
    for k in range(n):
        task = (thetas[k], hollow, tables, period, limit, edges, degree, code)
        goal = tolerances[k] * (hollow[1] - hollow[0])
        filled, errors[k], lost[k], pieces, rays[k] = march_row(task, goal, rules, least, seeds, chain, nodes, ends)
        seeds = ends[: min(pieces, most_seeds)].copy()
        begin, end = starts[k], starts[k] + filled
        all_node, all_mass = longer(all_node, begin, end), longer(all_mass, begin, end)
        all_node[begin:end], all_mass[begin:end] = nodes[0][:filled], nodes[1][:filled]
        starts[k + 1] = end
    return all_node[: starts[n]], all_mass[: starts[n]], starts, errors, lost, rays
