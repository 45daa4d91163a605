"""Compiled march along the entry points of one angle: intervals (pieces) of equal itinerary, and nodes on each.

A node with another label than its piece reveals a missed change of itinerary; it is added to the samples.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT, SIZE
from ...scene.records import Record
from ...tracing.compiled.options import compiled, inner
from ...tracing.compiled.pointers import address_of, call_at
from .changes import (
    FIRST_LABEL,
    MOST_SAMPLES,
    add_change,
    empty_chain,
    example_task,
    is_spent,
    sample_entries,
    spread,
    task_of,
    undecided,
)
from .rules import MOST_NODES, NODE_ROOM, SPARE, integrate_piece, nested_rules

# Rounding error of a mean, as a fraction of the opening, and of the position of a change, as a fraction of the hollow's
# size. Rays have errors of a few EPS times the derivative of the map, which is seldom above some hundreds except next
# to a change (measured, not proved).
ROUNDING, EDGE_ROUNDING = 1024.0 * EPS, 64.0 * EPS
# Fractions of the tolerance for the nested rules and for all gaps.
RULE_FRACTION, GAP_FRACTION = 0.5, 0.25
# Fraction of the tolerance of the gaps for the gaps at a missed change.
LATE_FRACTION = 0.05


class Found(NamedTuple):
    """What is found angle by angle.

    Outgoing angles and masses of the nodes, and the start of each angle; first positions, last positions, labels
    and first outgoing angles of the pieces, and the start of each angle; and for each angle the error, the width of
    unresolved rays, and the numbers of rays and of ray segments.
    """

    nodes: Any
    node_starts: NDArray[np.int64]
    pieces: Any
    piece_starts: NDArray[np.int64]
    errors: Floats
    unresolved: Floats
    rays: NDArray[np.int64]
    segments: NDArray[np.int64]


class Nodes(NamedTuple):
    """Outgoing angles and masses of nodes."""

    angles: Floats
    masses: Floats


class Pieces(NamedTuple):
    """First and last positions, labels, and first outgoing angles of pieces."""

    low: Floats
    high: Floats
    label: NDArray[np.uint64]
    out: Floats


class Room(NamedTuple):
    """Work space for one angle: its samples, nodes and pieces."""

    chain: Record
    nodes: Record
    pieces: Record


@inner
def march_angle(task, goal, rules, entries, room):
    """Compute the nodes and masses of the conditional distribution at one incoming angle.

    Returns the number of nodes, the error, the width of unresolved rays, and the numbers of pieces and of rays. If the
    limit of ray segments is reached, the error includes the gaps that remain. ``pieces`` receives the first and last
    position, the label and the first outgoing angle of every piece.
    """
    chain, nodes, pieces = room.chain, room.nodes, room.pieces
    xs, outs, labels, follow = chain.entries, chain.angles, chain.labels, chain.successors
    node, mass = nodes.angles, nodes.masses
    lows, highs, names, firsts = pieces.low, pieces.high, pieces.label, pieces.out
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
    largest = 0.0
    for size in task.setting.sizes:
        largest = max(largest, size)
    error = ROUNDING * largest * whole
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
            error += undecided(j, task, chain) + EDGE_ROUNDING * hollow[SIZE] * spread(outs[j], outs[following], task)
        i = following
    return filled, error, unresolved, number, rays + count


@cache
def march_address() -> int:
    """Return the address of `march_angle`."""
    return address_of(march_angle, (example_task(), 0.0, nested_rules(0), np.empty(0), _room(0, 0)))


@compiled
def march_angles(thetas, tolerances, setting, degree, rules, seeds, seed_starts, march, first, room, found):
    """Compute the conditional distributions at incoming angles from number ``first`` on; see `marched_angles`.

    Returns the number of the angle before which an array of ``found`` is too small, or the number of angles.
    ``march`` is `march_address`.
    """
    node_starts, piece_starts = found.node_starts, found.piece_starts
    angles, masses, all_angles, all_masses = (
        room.nodes.angles,
        room.nodes.masses,
        found.nodes.angles,
        found.nodes.masses,
    )
    own_pieces, pieces = room.pieces, found.pieces
    lows, highs, labels, outs = own_pieces.low, own_pieces.high, own_pieces.label, own_pieces.out
    all_lows, all_highs, all_labels, all_outs = pieces.low, pieces.high, pieces.label, pieces.out
    hollow = setting.hollow
    whole = hollow[RIGHT] - hollow[LEFT]
    for k in range(first, thetas.shape[0]):
        begin, start = node_starts[k], piece_starts[k]
        if begin + MOST_NODES + SPARE > all_angles.shape[0] or start + MOST_SAMPLES > all_lows.shape[0]:
            return np.int64(k)
        task = task_of(setting, thetas[k], degree, found.segments[k : k + 1])
        goal = tolerances[k] * whole
        own = seeds[seed_starts[k] : seed_starts[k + 1]]
        filled, found.errors[k], found.unresolved[k], number, found.rays[k] = call_at(
            march, (np.int64(0), 0.0, 0.0, np.int64(0), np.int64(0)), (task, goal, rules, own, room)
        )
        for i in range(filled):
            all_angles[begin + i], all_masses[begin + i] = angles[i], masses[i]
        for i in range(number):
            all_lows[start + i], all_highs[start + i], all_labels[start + i] = lows[i], highs[i], labels[i]
            all_outs[start + i] = outs[i]
        node_starts[k + 1], piece_starts[k + 1] = begin + filled, start + number
    return np.int64(thetas.shape[0])


def _room(nodes: int, pieces: int) -> Record:
    arrays = _arrays(nodes, float, float), _arrays(pieces, float, float, np.uint64, float)
    return Record(Room(empty_chain(), Record(Nodes(*arrays[0])), Record(Pieces(*arrays[1]))))


def _record(found: Found) -> Record:
    return Record(found._replace(nodes=Record(Nodes(*found.nodes)), pieces=Record(Pieces(*found.pieces))))


def _arrays(size: int, *kinds: Any) -> tuple[NDArray[Any], ...]:
    return tuple(np.empty(size, kind) for kind in kinds)


def marched_angles(
    thetas: Floats,
    tolerances: Floats,
    setting: Record,
    degree: int,
    rules: Record,
    seeds: Floats,
    seed_starts: NDArray[np.int64],
) -> Found:
    """Compute the conditional distributions at incoming angles. The seeds are the first samples, which increase."""
    count = len(thetas)
    room = _room(NODE_ROOM, MOST_SAMPLES)
    found = Found(
        (np.empty(0), np.empty(0)), np.zeros(count + 1, np.int64),
        (np.empty(0), np.empty(0), np.empty(0, np.uint64), np.empty(0)), np.zeros(count + 1, np.int64),
        *_arrays(count, float, float, np.int64, np.int64),
    )  # fmt: skip
    done = 0
    while done < count:
        used, number = int(found.node_starts[done]), int(found.piece_starts[done])
        found = found._replace(
            nodes=_longer(found.nodes, used, 2 * used + MOST_NODES + SPARE),
            pieces=_longer(found.pieces, number, 2 * number + MOST_SAMPLES),
        )
        done = march_angles(
            thetas, tolerances, setting, degree, rules, seeds, seed_starts, march_address(), done, room, _record(found)
        )
    used, number = int(found.node_starts[-1]), int(found.piece_starts[-1])
    return found._replace(nodes=_longer(found.nodes, used, used), pieces=_longer(found.pieces, number, number))


def _longer(arrays: tuple[NDArray[Any], ...], used: int, size: int) -> tuple[NDArray[Any], ...]:
    """Return copies with ``size`` entries, of which the first ``used`` are set."""
    longer = _arrays(size, *(array.dtype for array in arrays))
    for old, new in zip(arrays, longer, strict=True):
        new[:used] = old[:used]
    return longer
