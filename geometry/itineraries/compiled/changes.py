"""Compiled search for the entry points at which the itinerary changes, at one incoming angle.

At one incoming angle the map x -> theta' is analytic between changes of the itinerary. The search keeps a chain of
samples, each with the label of its itinerary. In each round, every gap between samples of different labels is divided.

The constants of one angle are in a `Task`, the samples in a `Chain`.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...scene.columns import LEFT, POINT_X, POINT_Y, RIGHT
from ...scene.records import Record
from ...scene.scene import NO_TABLES, Scene
from ...tracing.compiled.options import inlined, inner, linked
from ...tracing.compiled.pointers import address_of, call_at
from ...tracing.compiled.rays import ESCAPED, HASH_FACTOR, SLOTS, trace_rays_address
from ...tracing.compiled.records import details_for, results_for

# Start integers as np.int64(0): a literal 0 has its own type in numba, and each function that receives it would be
# compiled twice.

# Limit on the samples of one angle; the gaps that remain count as error.
MOST_SAMPLES = 1 << 13
MOST_ROUNDS = 200
# Gaps with an error below this fraction of the worst gap's wait for a later round.
WORST_FRACTION = 0.1
# Least difference of the functions on both sides of a gap where the itineraries themselves are wanted.
LEAST_SPREAD = 0.01
# Distance beyond the interpolated position of an edge, as a multiple of the squared width of the gap over the opening:
# above the error of the interpolation where the outgoing angle has a curvature of at most 16 slopes over the opening.
BEYOND_EDGE = 2.0
# Labels below this number are statuses of rays that did not escape.
FIRST_LABEL = np.uint64(4)


# Number of rays traced in one call.
BLOCK = 32
# Where runs of hits are computed in one step, the segments of a ray that count in full, and the number beyond which one
# in CHEAP_STEPS counts: the segments of a long ray are short and take little time.
DEAR_STEPS, MANY_STEPS, CHEAP_STEPS = np.int64(9), np.int64(1024), np.int64(32)


class Limits(NamedTuple):
    """Limits at one angle: collisions of a ray, and segments of all rays.

    They are `Details.segments`, of which few count on long rays if ``has_runs``.
    """

    collisions: int
    has_runs: bool
    segments: int


class Tracer(NamedTuple):
    """The addresses of `trace_rays` and `halve_gaps`, the slots of late functions, and the arrays for a block of rays.

    The rays of a block have the same incoming angle. ``stop`` is never raised.
    """

    trace: int
    halve: int
    slots: Record
    angles: Floats
    results: Record
    entries: Floats
    stop: NDArray[np.int64]


class Setting(NamedTuple):
    """The data common to all angles: row of the hollow, tables of the wall, limits, outgoing cells, tracer.

    ``edges`` are the edges between the cells, and ``sizes`` bounds of the functions to integrate in each cell.
    """

    hollow: Floats
    tables: Record
    limits: Record
    edges: Floats
    sizes: Floats
    tracer: Record


class Task(NamedTuple):
    """One incoming angle: the setting, the angle, the degree of the functions to integrate, and segments spent."""

    setting: Record
    theta: float
    degree: int
    segments: NDArray[np.int64]


class Chain(NamedTuple):
    """Samples in the order of their computation, and two lists of gaps, each given by the sample on its left."""

    entries: Floats
    angles: Floats
    labels: NDArray[np.uint64]
    successors: NDArray[np.int64]
    gaps: NDArray[np.int64]
    fresh: NDArray[np.int64]


def setting_of(scene: Scene, hollow: int, limits: Limits, edges: Floats, sizes: Floats) -> Record:
    """Return the setting of hollow number ``hollow``, for use by one thread at a time."""
    results, angles, stop = results_for(BLOCK, details_for(BLOCK, BLOCK)), np.empty(BLOCK), np.zeros(1, np.int64)
    tracer = Record(Tracer(trace_rays_address(), _halve_address(), SLOTS, angles, results, np.empty(BLOCK), stop))
    tables = scene.tables
    edges, sizes = (np.require(values, np.float64, ["C", "A", "W"]) for values in (edges, sizes))
    return Record(Setting(tables.hollows[hollow], tables, Record(limits), edges, sizes, tracer))


def empty_chain() -> Record:
    """Return an empty chain for the samples of one angle; the last sample will have the successor -1."""
    counts = np.empty((3, MOST_SAMPLES), np.int64)
    return Record(Chain(np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES, np.uint64), *counts))


@linked
def task_of(setting, theta, degree, segments):
    """-> Task: the task of one incoming angle."""
    setting.tracer.angles[:] = theta
    return Task(setting, theta, degree, segments)


@inlined
def trace_block(entries, task):
    """Trace at most `BLOCK` rays into the results of the tracer."""
    setting = task.setting
    tracer = setting.tracer
    rays = entries, tracer.angles[: entries.shape[0]]
    limit, found = setting.limits.collisions, tracer.results
    results = found.x, found.theta, found.collisions, found.status
    places = found.details.address, tracer.slots.address
    call_at(tracer.trace, None, (*rays, setting.tables.address, limit, tracer.stop, results, *places))


@inlined
def cell_of(out, edges):
    """Return the number of edges below an outgoing angle."""
    # instead of np.searchsorted, which would double the time of compilation of this file
    cell, high = np.int64(0), np.int64(edges.shape[0])
    while cell < high:
        middle = (cell + high) // 2
        if edges[middle] < out:
            cell = middle + 1
        else:
            high = middle
    return cell


@inlined
def outcome(k, task):
    """-> (angle, label): the outgoing angle of ray k of the block, and its label.

    The label combines the itinerary and the outgoing bin. The segments of the ray are added to those of the task.
    """
    edges, results = task.setting.edges, task.setting.tracer.results
    steps = results.details.segments[k]
    if task.setting.limits.has_runs:
        steps = min(steps, DEAR_STEPS) + max(steps - MANY_STEPS, 0) // CHEAP_STEPS
    task.segments[0] += steps
    if results.status[k] != ESCAPED:
        return task.theta, np.uint64(results.status[k])
    # clipped for a ray along y = 0 within rounding
    velocity = results.details.velocity
    out = min(max(math.atan2(velocity[k, POINT_Y], velocity[k, POINT_X]), 0.0), math.pi)
    return out, HASH_FACTOR * (results.details.itinerary[k] + np.uint64(16)) + np.uint64(cell_of(out, edges))


@inlined
def probe(x, task):
    """-> (angle, label): `outcome` of one ray."""
    entries = task.setting.tracer.entries[:1]
    entries[0] = x
    trace_block(entries, task)
    return outcome(np.int64(0), task)


@inlined
def is_spent(task):
    """Whether the task has reached its limit of ray segments."""
    return task.segments[0] >= task.setting.limits.segments


@inlined
def size_at(out, task):
    """Return the size of the functions in the cell of an outgoing angle."""
    return task.setting.sizes[cell_of(out, task.setting.edges)]


@inlined
def spread(first, second, task):
    """Return the largest difference of the functions between two outgoing angles.

    In one cell it is that of cos(angle), cos(k angle) and sin(k angle), k = ``task.degree``, times the functions' size;
    in two cells the sum of the sizes. If the degree is 0 and there is one cell only, the itineraries themselves are
    wanted, also where a change hardly changes the angle.
    """
    k, edges, sizes = max(task.degree, 1), task.setting.edges, task.setting.sizes
    here, there = cell_of(first, edges), cell_of(second, edges)
    if here != there:
        return sizes[here] + sizes[there]
    least = LEAST_SPREAD if task.degree == 0 and edges.shape[0] == 0 else 0.0
    return sizes[here] * max(
        least,
        abs(math.cos(first) - math.cos(second)),
        max(abs(math.cos(k * first) - math.cos(k * second)), abs(math.sin(k * first) - math.sin(k * second))),
    )


@inlined
def undecided(before, task, chain):
    """Return the contribution to the error of the gap after the sample ``before``."""
    xs, outs, follow = chain.entries, chain.angles, chain.successors
    after = follow[before]
    width, whole = xs[after] - xs[before], task.setting.hollow[RIGHT] - task.setting.hollow[LEFT]
    return (
        0.5 * width * (spread(outs[before], outs[after], task) + size_at(outs[before], task) * math.sqrt(width / whole))
    )


@inlined
def insert(x, before, count, task, chain):
    """Insert a sample at x after the sample ``before``."""
    xs, outs, labels, follow = chain.entries, chain.angles, chain.labels, chain.successors
    xs[count] = x
    outs[count], labels[count] = probe(x, task)
    follow[count] = follow[before]
    follow[before] = count


@inlined
def division(i, j, number, task, chain):
    """Return the position in the gap from sample i to sample j at which round ``number`` divides it.

    Between samples of one itinerary in neighbouring cells the outgoing angle is smooth. The position is then that of
    the edge by linear interpolation, moved towards the middle by more than its error, so that both ends of the gap
    approach the edge and the width falls quadratically. Every third round, and other gaps, are divided in the middle.
    """
    xs, outs, labels = chain.entries, chain.angles, chain.labels
    edges, hollow = task.setting.edges, task.setting.hollow
    width, middle = xs[j] - xs[i], 0.5 * (xs[i] + xs[j])
    step = np.int64(labels[j] - labels[i])
    if number % 3 == 2 or (step != 1 and step != -1) or outs[i] == outs[j]:
        return middle
    cell = cell_of(min(outs[i], outs[j]), edges)
    if cell == edges.shape[0]:
        return middle
    x = xs[i] + width * (edges[cell] - outs[i]) / (outs[j] - outs[i])
    margin = max(BEYOND_EDGE * width * width / (hollow[RIGHT] - hollow[LEFT]), 4.0 * EPS * abs(middle))
    x += margin if x < middle else -margin
    return x if xs[i] < x < xs[j] else middle


@inner
def halve_gaps(task, chain, count, gap_count, goal, most):
    """Divide gaps until the sum of their errors is at most ``goal``; return the number of samples."""
    xs, labels, follow, gaps, fresh = chain.entries, chain.labels, chain.successors, chain.gaps, chain.fresh
    for number in range(MOST_ROUNDS):
        total, worst = 0.0, 0.0
        for g in range(gap_count):
            matter = undecided(gaps[g], task, chain)
            total += matter
            worst = max(worst, matter)
        if total <= goal:
            break
        # the worst gaps first, so that a point of accumulation of changes does not use up all samples
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
            insert(division(i, j, number, task, chain), i, k, task, chain)
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


def example_task() -> Task:
    """Return a task of the types of all tasks, for which functions are compiled to be called by their address."""
    results, stop = results_for(0), np.zeros(1, np.int64)
    tracer = Record(Tracer(0, 0, SLOTS, np.empty(0), results, np.empty(0), stop))
    setting = Record(Setting(np.empty(0), NO_TABLES, Record(Limits(1, False, 1)), np.empty(0), np.empty(0), tracer))
    return Task(setting, 0.0, 0, stop)


def example_chain() -> Record:
    """Return a chain of the types of all chains."""
    numbers, counts = np.empty(0), np.empty(0, np.int64)
    return Record(Chain(numbers, numbers, np.empty(0, np.uint64), counts, counts, counts))


@cache
def _halve_address() -> int:
    return address_of(halve_gaps, (example_task(), example_chain(), 0, 0, 0.0, 0))


@inlined
def halved(task, chain, count, gap_count, goal, most):
    """`halve_gaps`, called by its address."""
    return call_at(task.setting.tracer.halve, count, (task, chain, count, gap_count, goal, most))


@linked
def sample_entries(entries, task, chain, goal):
    """Chain the samples at increasing positions and halve the gaps.

    Returns the number of samples, and the sample of largest position.
    """
    xs, outs, labels, follow, gaps = chain.entries, chain.angles, chain.labels, chain.successors, chain.gaps
    left, right = task.setting.hollow[LEFT], task.setting.hollow[RIGHT]
    count, gap_count = np.int64(0), np.int64(0)
    for x in entries:
        if x <= left or x >= right or (count > 0 and x <= xs[count - 1]):
            continue
        xs[count] = x
        follow[count] = count + 1
        count += 1
    end = np.int64(0)
    while end < count:
        first, end = end, min(end + BLOCK, count)
        trace_block(xs[first:end], task)
        for k in range(first, end):
            outs[k], labels[k] = outcome(k - first, task)
            if k > 0 and labels[k] != labels[k - 1]:
                gaps[gap_count] = k - 1
                gap_count += 1
        if is_spent(task) and end < count - 1:
            # between these samples and the last one there is a gap, which counts as error
            xs[end], count = xs[count - 1], end + 1
    last = count - 1
    follow[last] = -1
    return halved(task, chain, count, gap_count, goal, np.int64(3 * MOST_SAMPLES // 4)), last


@linked
def add_change(x, first, task, chain, count, goal):
    """Insert a position x of another label into the piece that begins with ``first``, and find the changes around x."""
    xs, follow, gaps = chain.entries, chain.successors, chain.gaps
    before = first
    while xs[follow[before]] <= x:
        before = follow[before]
    insert(x, before, count, task, chain)
    gaps[0], gaps[1] = before, count
    return halved(task, chain, count + 1, np.int64(2), goal, np.int64(MOST_SAMPLES))
