"""Compiled search for the entry points at which the itinerary changes, at one incoming angle.

For one incoming angle the map x -> theta' is analytic between changes of the itinerary. A row is a chain of samples,
each with the label of its itinerary; gaps between samples of different labels are halved, all of them once a round.

What stays the same along a row travels in two named tuples, `Task` and `Chain`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT
from ...tracing.compiled.rays import ESCAPED, HASH_FACTOR, trace_ray

# Functions that only compiled ones call have no wrappers: they would take as long to compile as the functions. Integers
# are born as such, np.int64(0): for a bare 0 type inference compiles what it is passed to once more.
# A dictionary, because numba's annotations do not know the two options.
_NO_WRAPPERS: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
inner = njit(cache=True, nogil=True, error_model="numpy", **_NO_WRAPPERS)

# Samples of one row at most; what is then still undecided counts as error.
MOST_SAMPLES = 1 << 13
MOST_ROUNDS = 200
# Gaps that matter less than this share of the worst one wait for a later round.
WORST_SHARE = 0.1
# Labels below this are statuses of rays that did not escape.
FIRST_LABEL = np.uint64(4)


# The two counters of a row.
HASH, FLIGHTS = 0, 1


class Limits(NamedTuple):
    """Limits of a row: collisions of a ray, how many of them count as flights at most, and flights of the row.

    Runs cost one flight, whatever their length. So does every cell of an open wall that a ray passes.
    """

    collisions: int
    collisions_that_count: int
    flights: int


class Task(NamedTuple):
    """A row: incoming angle, hollow, tables of the wall, its period (None if closed), limits, outgoing angles at which
    cells begin, degree of the functions that the row is for, and the counters: hash of a ray, flights spent.
    """

    theta: float
    hollow: Floats
    tables: Any
    period: Any
    limits: Limits
    edges: Floats
    degree: int
    counters: NDArray[np.uint64]


class Chain(NamedTuple):
    """Samples in the order in which they were found, and two lists for gaps, each named by the sample on its left."""

    places: Floats
    angles: Floats
    labels: NDArray[np.uint64]
    successors: NDArray[np.int64]
    gaps: NDArray[np.int64]
    fresh: NDArray[np.int64]


@inner
def empty_chain():
    """Room for the samples of one row; the last one has the successor -1."""
    return Chain(
        np.empty(MOST_SAMPLES),
        np.empty(MOST_SAMPLES),
        np.empty(MOST_SAMPLES, np.uint64),
        np.empty(MOST_SAMPLES, np.int64),
        np.empty(MOST_SAMPLES, np.int64),
        np.empty(MOST_SAMPLES, np.int64),
    )


@inner
def probe(x, task):
    """Outgoing angle of one ray and the label of its itinerary and of the cell that it goes to."""
    theta, hollow, limits, edges, counters = task.theta, task.hollow, task.limits, task.edges, task.counters
    joints, lines, circles, ellipses, beziers, pairs, grid = task.tables
    last, vx, vy, bounces, status = trace_ray(
        x,
        theta,
        hollow,
        joints,
        lines,
        circles,
        ellipses,
        beziers,
        task.period,
        limits.collisions,
        None,
        counters,
        pairs,
        grid,
    )
    counted = min(bounces, limits.collisions_that_count)
    counters[FLIGHTS] += np.uint64(1 + counted + np.int64(abs(last - x) / (hollow[RIGHT] - hollow[LEFT])))
    if status != ESCAPED:
        return theta, np.uint64(status)
    # a ray along y = 0 within rounding
    out = min(max(math.atan2(vy, vx), 0.0), math.pi)
    cell = np.int64(0)
    # np.searchsorted would take as long to compile as all of this file
    high = edges.shape[0]
    while cell < high:
        middle = (cell + high) // 2
        if edges[middle] < out:
            cell = middle + 1
        else:
            high = middle
    return out, HASH_FACTOR * (counters[HASH] + np.uint64(16)) + np.uint64(cell)


@inner
def is_spent(task):
    """Whether the row has taken as many flights as it may."""
    return task.counters[FLIGHTS] >= np.uint64(task.limits.flights)


@inner
def spread(first, second, degree):
    """Largest difference of cos, and of cos and sin of ``degree`` times the angle."""
    k = max(degree, 1)
    return max(
        abs(math.cos(first) - math.cos(second)),
        max(abs(math.cos(k * first) - math.cos(k * second)), abs(math.sin(k * first) - math.sin(k * second))),
    )


@inner
def undecided(before, task, chain):
    """What the gap after a sample may contribute to a row's error."""
    xs, outs, _, follow, _, _ = chain
    after = follow[before]
    width, whole = xs[after] - xs[before], task.hollow[RIGHT] - task.hollow[LEFT]
    return 0.5 * width * (spread(outs[before], outs[after], task.degree) + math.sqrt(width / whole))


@inner
def insert(x, before, count, task, chain):
    """Put a sample at x behind another one."""
    xs, outs, labels, follow, _, _ = chain
    xs[count] = x
    outs[count], labels[count] = probe(x, task)
    follow[count] = follow[before]
    follow[before] = count


@inner
def halve_gaps(task, chain, count, gap_count, goal, most):
    """Halve gaps until together they matter less than ``goal``; returns the number of samples."""
    xs, _, labels, follow, gaps, fresh = chain
    for _ in range(MOST_ROUNDS):
        total, worst = 0.0, 0.0
        for g in range(gap_count):
            matter = undecided(gaps[g], task, chain)
            total += matter
            worst = max(worst, matter)
        if total <= goal:
            break
        # the worst first, so that an accumulation of changes does not use up all samples before the others are found
        fair = max(0.25 * goal / gap_count, WORST_SHARE * worst)
        fresh_count = np.int64(0)
        moved = False
        for g in range(gap_count):
            i = gaps[g]
            j = follow[i]
            if undecided(i, task, chain) <= fair:
                fresh[fresh_count] = i
                fresh_count += 1
                continue
            narrow = xs[j] - xs[i] <= 2.0 * EPS * max(abs(xs[i]), abs(xs[j]))
            if narrow or count >= most or is_spent(task):
                continue
            k = count
            insert(0.5 * (xs[i] + xs[j]), i, k, task, chain)
            count += 1
            moved = True
            if labels[k] != labels[i]:
                fresh[fresh_count] = i
                fresh_count += 1
            if labels[k] != labels[j]:
                fresh[fresh_count] = k
                fresh_count += 1
        gap_count = fresh_count
        gaps[:gap_count] = fresh[:gap_count]
        if not moved:
            break
    return count


@inner
def sample_row(places, task, chain, goal):
    """Chain the samples at increasing places, and halve the gaps; returns the number of samples, and the last one.

    The last one is that with the largest place, not the one that was found last.
    """
    xs, outs, labels, follow, gaps, _ = chain
    left, right = task.hollow[LEFT], task.hollow[RIGHT]
    count, gap_count = np.int64(0), np.int64(0)
    for x in places:
        if x <= left or x >= right or (count > 0 and x <= xs[count - 1]):
            continue
        xs[count] = x
        outs[count], labels[count] = probe(x, task)
        follow[count] = count + 1
        if count > 0 and labels[count] != labels[count - 1]:
            gaps[gap_count] = count - 1
            gap_count += 1
        count += 1
    last = count - 1
    follow[last] = -1
    return halve_gaps(task, chain, count, gap_count, goal, np.int64(3 * MOST_SAMPLES // 4)), last


@inner
def add_change(x, first, task, chain, count, goal):
    """A place x, in the piece that begins with the sample ``first``, has another label: find the edges around it."""
    xs, _, _, follow, gaps, _ = chain
    before = first
    while xs[follow[before]] <= x:
        before = follow[before]
    insert(x, before, count, task, chain)
    gaps[0], gaps[1] = before, count
    return halve_gaps(task, chain, count + 1, np.int64(2), goal, np.int64(MOST_SAMPLES))
