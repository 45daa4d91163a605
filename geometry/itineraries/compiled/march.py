"""Compiled march along the entry points of one angle: intervals (pieces) of equal itinerary, and nodes on each.

A node with another label than its piece reveals a missed change of itinerary; it is added to the samples.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT, SIZE
from ...scene.compiled.tables import ROW, named, reader_of
from ...scene.structs import Struct
from ...tracing.compiled.options import compiled
from .changes import (
    CHAIN,
    FIRST_LABEL,
    LABELS,
    MOST_SAMPLES,
    Chain,
    add_change,
    empty_chain,
    is_spent,
    sample_entries,
    setting_at,
    spread,
    task_of,
    undecided,
)
from .rules import MOST_NODES, NODE_ROOM, NODES, Nodes, integrate_piece, rules_at

# Rounding error of a mean, as a fraction of the opening, and of the position of a change, as a fraction of the hollow's
# size. Rays have errors of a few EPS times the derivative of the map, which is seldom above some hundreds except next
# to a change (measured, not proved).
ROUNDING, EDGE_ROUNDING = 1024.0 * EPS, 64.0 * EPS
# Fractions of the tolerance for the nested rules and for all gaps.
RULE_FRACTION, GAP_FRACTION = 0.5, 0.25
# Fraction of the tolerance of the gaps for the gaps at a missed change.
LATE_FRACTION = 0.05


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


room_at = reader_of(named(Room, CHAIN, NODES, named(Pieces, ROW, ROW, LABELS, ROW)))


@compiled
def march_angle(theta, goal, setting, rules, entries, room):
    """Compute the nodes and masses of the conditional distribution at one incoming angle.

    Returns the number of nodes, the error, the width of unresolved rays, and the numbers of pieces and of rays. If the
    limit of ray segments is reached, the error includes the gaps that remain. ``entries`` are the first samples, which
    increase; of the setting, the rules and the room the addresses are given.
    """
    setting, rules, room = setting_at(setting), rules_at(rules), room_at(room)
    task = task_of(setting, theta)
    chain, nodes, pieces = room.chain, room.nodes, room.pieces
    xs, outs, labels, follow = chain.entries, chain.angles, chain.labels, chain.successors
    node, mass = nodes.angles, nodes.masses
    lows, highs, names, firsts = pieces.low, pieces.high, pieces.label, pieces.out
    hollow = setting.hollow
    left, right = hollow[LEFT], hollow[RIGHT]
    whole = right - left
    setting.tracer.spent[0] = 0
    count, last = sample_entries(entries, task, chain, GAP_FRACTION * goal)
    rays = np.int64(0)
    # the first and the last sample represent the margins
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled, number, unresolved = np.int64(2), np.int64(0), 0.0
    largest = 0.0
    for cell in range(setting.edge_count + 1):
        largest = max(largest, setting.sizes[cell])
    error = ROUNDING * largest * whole
    error += mass[0] * spread(outs[0], outs[1], setting) + mass[1] * spread(outs[last], outs[last - 1], setting)
    i = np.int64(0)
    while i >= 0:
        j = i
        while follow[j] >= 0 and labels[follow[j]] == labels[i]:
            j = follow[j]
        if j != i:
            ready, miss, other, spent = integrate_piece(
                (xs[i], xs[j]), (outs[i], labels[i]), RULE_FRACTION * goal, rules, task, nodes, filled,
                count < MOST_SAMPLES - 4 and not is_spent(setting),
            )  # fmt: skip
            rays += spent
            if not math.isnan(other):
                # a missed change: add it to the samples, and repeat the piece
                count = add_change(other, i, task, chain, count, LATE_FRACTION * GAP_FRACTION * goal)
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
            change = EDGE_ROUNDING * hollow[SIZE] * spread(outs[j], outs[following], setting)
            error += undecided(j, setting, chain) + change
        i = following
    return filled, error, unresolved, number, rays + count


def marched_angles(
    thetas: Floats, tolerances: Floats, setting: Struct, rules: Struct, seeds: list[Floats]
) -> list[Found]:
    """Compute the conditional distributions at incoming angles. The seeds are the first samples, which increase."""
    nodes = Nodes(*np.empty((2, NODE_ROOM)))
    low, high, out = np.empty((3, MOST_SAMPLES))
    pieces = Pieces(low, high, np.empty(MOST_SAMPLES, np.uint64), out)
    room, found = Struct(Room(empty_chain(), nodes, pieces)), []
    hollow, spent = setting.values.hollow, setting.values.tracer.spent
    places = setting.address, rules.address
    for theta, tolerance, entries in zip(thetas.tolist(), tolerances.tolist(), seeds, strict=True):
        goal = tolerance * float(hollow[RIGHT] - hollow[LEFT])
        filled, error, unresolved, number, rays = march_angle(theta, goal, *places, entries, room.address)
        own_nodes = Nodes._make(part[:filled].copy() for part in nodes)
        own_pieces = Pieces._make(part[:number].copy() for part in pieces)
        found.append(Found(own_nodes, own_pieces, error, unresolved, rays, int(spent[0])))
    return found
