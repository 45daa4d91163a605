"""Compiled search for the entry points at which the itinerary changes, at one incoming angle.

For one incoming angle the map x -> theta' is analytic between changes of the itinerary. A row is a chain of samples,
each with the label of its itinerary; gaps between samples of different labels are halved, all of them once a round.

What stays the same along a row travels in two named tuples, `Task` and `Chain`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, POINT_X, POINT_Y, RIGHT
from ...scene.scene import Scene, Tables
from ...tracing.compiled.options import OPTIONS
from ...tracing.compiled.pointers import call_at
from ...tracing.compiled.rays import ESCAPED, HASH_FACTOR, nearby_address, trace_rays_address
from ...tracing.compiled.records import Results, results_for

# Functions that only compiled ones call have no wrappers: they would take as long to compile as the functions. Those
# that neither allocate nor return arrays count no references, see `options`. Integers start as np.int64(0):
# for a bare 0 type inference compiles what it is passed to once more.
_INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
inner = njit(**_INNER)
inlined = njit(**_INNER, forceinline=True)
allocating = njit(**{**_INNER, "_nrt": True})

# Samples of one row at most; what is then still undecided counts as error.
MOST_SAMPLES = 1 << 13
MOST_ROUNDS = 200
# Gaps that matter less than this fraction of the worst one wait for a later round.
WORST_FRACTION = 0.1
# Labels below this are statuses of rays that did not escape.
FIRST_LABEL = np.uint64(4)


# Rays that are traced in one call.
BLOCK = 32


class Limits(NamedTuple):
    """Limits of a row: collisions of a ray, how many of them count as flights at most, and flights of the row.

    Runs cost one flight, whatever their length. So does every cell of an open wall that a ray passes.
    """

    collisions: int
    collisions_that_count: int
    segments: int


class Tracer(NamedTuple):
    """How rays are traced: the addresses of `trace_rays` and `hit_nearby`, and room for a block of rays.

    All angles of a block are that of the row. Nothing raises ``stop``.
    """

    address: int
    nearby: int
    angles: Floats
    results: Results
    entries: Floats
    stop: NDArray[np.int64]


class Setting(NamedTuple):
    """What all rows of a hollow have in common: its row, the tables of the wall, limits, and outgoing angles at which
    cells begin, and how rays are traced.
    """

    hollow: Floats
    tables: Tables
    limits: Limits
    edges: Floats
    tracer: Tracer


class Task(NamedTuple):
    """A row: the setting, incoming angle, degree of the functions that the row is for, and flights spent."""

    setting: Setting
    theta: float
    degree: int
    segments: NDArray[np.int64]


class Chain(NamedTuple):
    """Samples in the order in which they were found, and two lists for gaps, each named by the sample on its left."""

    entries: Floats
    angles: Floats
    labels: NDArray[np.uint64]
    successors: NDArray[np.int64]
    gaps: NDArray[np.int64]
    fresh: NDArray[np.int64]


def setting_of(scene: Scene, hollow: int, limits: Limits, edges: Floats) -> Setting:
    """The setting of the rows of a hollow, by its number. It belongs to one thread at a time."""
    results, angles, stop = results_for(BLOCK, BLOCK, BLOCK), np.empty(BLOCK), np.zeros(1, np.int64)
    address = trace_rays_address()
    tracer = Tracer(address, nearby_address(), angles, results, np.empty(BLOCK), stop)
    tables = scene.tables
    return Setting(tables.hollows[hollow], tables, limits, np.require(edges, np.float64, ["C", "A", "W"]), tracer)


@allocating
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


@allocating
def task_of(setting, theta, degree, segments):
    """-> Task: a row at an angle."""
    setting.tracer.angles[:] = theta
    return Task(setting, theta, degree, segments)


@inlined
def trace_block(entries, task):
    """Trace rays, no more than `BLOCK`, into the results of the tracer."""
    setting = task.setting
    tracer = setting.tracer
    rays = entries, tracer.angles[: entries.shape[0]]
    limit = setting.limits.collisions
    call_at(tracer.address, None, (*rays, setting.tables, limit, tracer.stop, tracer.results, tracer.nearby))


@inlined
def outcome(k, x, task):
    """-> (angle, label): the outgoing angle of ray k of the block, which entered at x, and its label.

    The label is that of its itinerary and of the cell that it goes to. Its flights are added to those of the row.
    """
    hollow, limits, edges = task.setting.hollow, task.setting.limits, task.setting.edges
    results = task.setting.tracer.results
    cells = np.int64(abs(results.x[k] - x) / (hollow[RIGHT] - hollow[LEFT]))
    task.segments[0] += 1 + min(results.collisions[k], limits.collisions_that_count) + cells
    if results.status[k] != ESCAPED:
        return task.theta, np.uint64(results.status[k])
    # a ray along y = 0 within rounding
    out = min(max(math.atan2(results.velocity[k, POINT_Y], results.velocity[k, POINT_X]), 0.0), math.pi)
    cell = np.int64(0)
    # np.searchsorted would take as long to compile as all of this file
    high = edges.shape[0]
    while cell < high:
        middle = (cell + high) // 2
        if edges[middle] < out:
            cell = middle + 1
        else:
            high = middle
    return out, HASH_FACTOR * (results.itinerary[k] + np.uint64(16)) + np.uint64(cell)


@inlined
def probe(x, task):
    """-> (angle, label): `outcome` of one ray."""
    entries = task.setting.tracer.entries[:1]
    entries[0] = x
    trace_block(entries, task)
    return outcome(np.int64(0), x, task)


@inlined
def is_spent(task):
    """Whether the row has taken as many flights as it may."""
    return task.segments[0] >= task.setting.limits.segments


@inlined
def spread(first, second, degree):
    """Largest difference of cos, and of cos and sin of ``degree`` times the angle."""
    k = max(degree, 1)
    return max(
        abs(math.cos(first) - math.cos(second)),
        max(abs(math.cos(k * first) - math.cos(k * second)), abs(math.sin(k * first) - math.sin(k * second))),
    )


@inlined
def undecided(before, task, chain):
    """What the gap after a sample may contribute to a row's error."""
    xs, outs, _, follow, _, _ = chain
    after = follow[before]
    width, whole = xs[after] - xs[before], task.setting.hollow[RIGHT] - task.setting.hollow[LEFT]
    return 0.5 * width * (spread(outs[before], outs[after], task.degree) + math.sqrt(width / whole))


@inlined
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
        fair = max(0.25 * goal / gap_count, WORST_FRACTION * worst)
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
        for g in range(gap_count):
            gaps[g] = fresh[g]
        if not moved:
            break
    return count


@inner
def sample_entries(entries, task, chain, goal):
    """Chain the samples at increasing positions, and halve the gaps; returns the number of samples, and the last one.

    The last one is that with the largest position, not the one that was found last.
    """
    xs, outs, labels, follow, gaps, _ = chain
    left, right = task.setting.hollow[LEFT], task.setting.hollow[RIGHT]
    count, gap_count = np.int64(0), np.int64(0)
    for x in entries:
        if x <= left or x >= right or (count > 0 and x <= xs[count - 1]):
            continue
        xs[count] = x
        follow[count] = count + 1
        count += 1
    for first in range(0, count, BLOCK):
        end = min(first + BLOCK, count)
        trace_block(xs[first:end], task)
        for k in range(first, end):
            outs[k], labels[k] = outcome(k - first, xs[k], task)
            if k > 0 and labels[k] != labels[k - 1]:
                gaps[gap_count] = k - 1
                gap_count += 1
    last = count - 1
    follow[last] = -1
    return halve_gaps(task, chain, count, gap_count, goal, np.int64(3 * MOST_SAMPLES // 4)), last


@inner
def add_change(x, first, task, chain, count, goal):
    """A position x, in the piece that begins with the sample ``first``, has another label: find the edges around it."""
    xs, _, _, follow, gaps, _ = chain
    before = first
    while xs[follow[before]] <= x:
        before = follow[before]
    insert(x, before, count, task, chain)
    gaps[0], gaps[1] = before, count
    return halve_gaps(task, chain, count + 1, np.int64(2), goal, np.int64(MOST_SAMPLES))
