"""Compiled search for the entry points at which the itinerary changes, at one incoming angle.

For one incoming angle the map x -> theta' is analytic between changes of the itinerary. A row is a chain of samples,
each with the label of its itinerary; gaps between samples of different labels are halved, all of them once a round.

What stays the same along a row travels in two tuples. ``task``: incoming angle, hollow, tables of the wall, period
(None if closed), limits (see `probe` and `is_spent`), outgoing angles at which cells begin, degree of the functions
that the row is for, and an array of two uint64 for the hash of a ray and the flights spent on the row. ``chain``:
place, outgoing angle, label and successor (-1: none) of every sample, in the order in which they were found, and two
lists for gaps, each named by the sample on its left.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from ....core.rounding import EPS
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


@inner
def empty_chain():
    """Room for the samples of one row."""
    return (
        np.empty(MOST_SAMPLES),
        np.empty(MOST_SAMPLES),
        np.empty(MOST_SAMPLES, np.uint64),
        np.empty(MOST_SAMPLES, np.int64),
        np.empty(MOST_SAMPLES, np.int64),
        np.empty(MOST_SAMPLES, np.int64),
    )


@inner
def probe(x, task):
    """Outgoing angle of one ray and the label of its itinerary and of the cell that it goes to.

    The first of the limits is that of collisions, the second how many of them count as flights at most: runs cost one
    flight, whatever their length. So does every cell of an open wall that the ray passes.
    """
    theta, hollow, (joints, lines, circles, ellipses, beziers, pairs, grid), period, limits, edges, _, code = task
    last, vx, vy, bounces, status = trace_ray(
        x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limits[0], None, code, pairs, grid
    )
    code[1] += np.uint64(1 + min(bounces, limits[1]) + np.int64(abs(last - x) / (hollow[1] - hollow[0])))
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
    return out, HASH_FACTOR * (code[0] + np.uint64(16)) + np.uint64(cell)


@inner
def is_spent(task):
    """Whether the row has taken as many flights as it may: the third of the limits."""
    return task[7][1] >= np.uint64(task[4][2])


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
    width, whole = xs[after] - xs[before], task[1][1] - task[1][0]
    return 0.5 * width * (spread(outs[before], outs[after], task[6]) + math.sqrt(width / whole))


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
    left, right = task[1][0], task[1][1]
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
