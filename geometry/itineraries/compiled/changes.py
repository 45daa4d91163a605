"""Compiled search for the entry points at which the itinerary changes, at one incoming angle.

At one incoming angle the map x -> theta' is analytic between changes of the itinerary. The search keeps a chain of
samples, each with the label of its itinerary. In each round, every gap between samples of different labels is divided.

The constants are in a `Setting`, the samples in a `Chain`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.rounding import EPS
from ...curves.columns import LEFT, POINT_X, POINT_Y, RIGHT, Struct
from ...scene.compiled.compiling import ROW, call_late, compiled, inlined, linked, named, reader_of
from ...scene.scene import Scene
from ...tracing.compiled.pieces.records import Rays, details_for, results_for
from ...tracing.compiled.rays import ABSORBED, ESCAPED, HASH_FACTOR, SLOTS, TRACE, details_at, rays_at

# Start integers as np.int64(0): a literal 0 has its own type in numba, and each function that receives it would be
# compiled twice.

# Limit on the samples of one angle; the gaps that remain count as error.
MOST_SAMPLES = 1 << 14
MOST_ROUNDS = 200
# Gaps with an error below this fraction of the worst gap's wait for a later round.
WORST_FRACTION = 0.1
# Up to this multiple of a gap's width pieces beside it tell what it may hide.
NARROW_PIECES = 4.0
# Least difference of the functions on both sides of a gap where the itineraries themselves are wanted.
LEAST_SPREAD = 0.01
# Distance beyond the interpolated position of an edge, as a multiple of the squared width of the gap over the opening:
# above the error of the interpolation where the outgoing angle has a curvature of at most 16 slopes over the opening.
BEYOND_EDGE = 2.0
# Labels below this number are statuses of rays that did not escape.
FIRST_LABEL = np.uint64(5)
# Instead of an outgoing angle, of rays that end on a curve.
NO_ANGLE = -1.0
# Number of rays traced in one call.
BLOCK = 32
# Where runs of hits are computed in one step, the segments of a ray that count in full, and the number beyond which one
# in CHEAP_STEPS counts: the segments of a long ray are short and take little time.
DEAR_STEPS, MANY_STEPS, CHEAP_STEPS = np.int64(9), np.int64(1024), np.int64(32)
# Limits of the collisions of a ray and of the segments of all rays; whether there are runs of hits between them.
Limits = tuple[int, bool, int]


class Setting(NamedTuple):
    """The data common to all angles: row of the hollow, limits, degree of the functions, outgoing cells, tracer.

    The limits at one angle are those of the collisions of a ray and of the segments of all rays. These are
    `Details.segments`, of which few count on long rays if ``has_runs``. ``edges`` are the edges between the cells, and
    ``sizes`` bounds of the functions to integrate in each cell. Of the tracer there are the addresses of the slot of
    `trace_rays`, of the `Rays` of a block, of the tables, of the details of a block and of `SLOTS`. ``spent``, with one
    entry, counts ray segments.
    """

    hollow: Floats
    collisions: int
    has_runs: bool
    segments: int
    degree: int
    edge_count: int
    edges: Floats
    sizes: Floats
    trace: int
    rays: Struct
    tables: Struct
    details: Struct
    slots: Struct
    spent: NDArray[np.int64]


class Chain(NamedTuple):
    """Samples in the order of their computation, and two lists of gaps, each given by the sample on its left."""

    entries: Floats
    angles: Floats
    labels: NDArray[np.uint64]
    predecessors: NDArray[np.int64]
    successors: NDArray[np.int64]
    gaps: NDArray[np.int64]
    fresh: NDArray[np.int64]


INTEGER, INTEGERS = types.int64, types.CPointer(types.int64)
SETTING = named(Setting, ROW, INTEGER, types.boolean, INTEGER, INTEGER, INTEGER, ROW, ROW, *[INTEGER] * 5, INTEGERS)
setting_at = reader_of(SETTING)


def setting_of(scene: Scene, hollow: int, limits: Limits, degree: int, edges: Floats, sizes: Floats) -> Struct:
    """Return the setting of hollow number ``hollow``, for use by one thread at a time."""
    entries, angles = np.empty((2, BLOCK))
    rays = Struct(Rays(entries, angles, *results_for(BLOCK), np.zeros(1, np.int64)))
    tracer = TRACE.slot, rays, scene.tables, details_for(BLOCK), SLOTS, np.zeros(1, np.int64)
    edges, sizes = (np.require(values, np.float64, ["C", "A", "W"]) for values in (edges, sizes))
    own = scene.hollows[hollow], *limits, degree, len(edges), edges, sizes
    return Struct(Setting._make((*own, *tracer)))


def empty_chain() -> Chain:
    """Return an empty chain for the samples of one angle; the last sample will have the successor -1."""
    counts = np.empty((4, MOST_SAMPLES), np.int64)
    return Chain(np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES, np.uint64), *counts)


@inlined
def set_angle(theta, setting):
    """Set the incoming angle of the rays of a block."""
    angles = rays_at(setting.rays).theta
    for k in range(BLOCK):
        angles[k] = theta


@inlined
def trace_block(count, setting):
    """Trace the first rays, at most `BLOCK`, of the block."""
    arguments = count, setting.rays, setting.tables, setting.collisions, setting.details, setting.slots
    call_late(setting.trace, None, arguments)


@inlined
def cell_of(out, edges, count):
    """Return the number of edges below an outgoing angle."""
    # instead of np.searchsorted, which would double the time of compilation of this file
    cell, high = np.int64(0), np.int64(count)
    while cell < high:
        middle = (cell + high) // 2
        if edges[middle] < out:
            cell = middle + 1
        else:
            high = middle
    return cell


@inlined
def outcome(k, setting):
    """-> (angle, label): the outgoing angle of ray k of the block, and its label.

    The label combines the itinerary and the outgoing bin. The segments of the ray are added to those spent.
    """
    rays, details = rays_at(setting.rays), details_at(setting.details)
    steps = details.segments[k]
    if setting.has_runs:
        steps = min(steps, DEAR_STEPS) + max(steps - MANY_STEPS, 0) // CHEAP_STEPS
    setting.spent[0] += steps
    if rays.status[k] == ABSORBED:
        return NO_ANGLE, HASH_FACTOR * (details.itinerary[k] + np.uint64(16))
    if rays.status[k] != ESCAPED:
        return rays.theta[k], np.uint64(rays.status[k])
    # clipped for a ray along y = 0 within rounding
    velocity = details.velocity
    out = min(max(math.atan2(velocity[k, POINT_Y], velocity[k, POINT_X]), 0.0), math.pi)
    cell = cell_of(out, setting.edges, setting.edge_count)
    return out, HASH_FACTOR * (details.itinerary[k] + np.uint64(16)) + np.uint64(cell)


@inlined
def probe(x, setting):
    """-> (angle, label): `outcome` of one ray."""
    rays_at(setting.rays).x[0] = x
    trace_block(1, setting)
    return outcome(np.int64(0), setting)


@inlined
def is_spent(setting):
    """Whether the limit of ray segments is reached."""
    return setting.spent[0] >= setting.segments


@inlined
def size_at(out, setting):
    """Return the size of the functions in the cell of an outgoing angle."""
    return setting.sizes[cell_of(out, setting.edges, setting.edge_count)]


@inlined
def spread(first, second, setting):
    """Return the largest difference of the functions between two outgoing angles.

    In one cell it is that of cos(angle), cos(k angle) and sin(k angle), with the degree k, times the functions' size;
    in two cells the sum of the sizes. If the degree is 0 and there is one cell only, the itineraries themselves are
    wanted, also where a change hardly changes the angle.
    """
    k, sizes = max(setting.degree, 1), setting.sizes
    here = cell_of(first, setting.edges, setting.edge_count)
    there = cell_of(second, setting.edges, setting.edge_count)
    if here != there:
        return sizes[here] + sizes[there]
    least = LEAST_SPREAD if setting.degree == 0 and setting.edge_count == 0 else 0.0
    return sizes[here] * max(
        least,
        abs(math.cos(first) - math.cos(second)),
        max(abs(math.cos(k * first) - math.cos(k * second)), abs(math.sin(k * first) - math.sin(k * second))),
    )


@linked
def change_near(first, steps, reach, chain):
    """Return the first sample with another label than ``first`` in the order of ``steps``, within a reach, or -1."""
    xs, labels = chain.entries, chain.labels
    k = steps[first]
    while k >= 0 and abs(xs[k] - xs[first]) <= reach:
        if labels[k] != labels[first]:
            return k
        k = steps[k]
    return np.int64(-1)


@linked
def undecided(before, setting, chain):
    """Return the contribution to the error of the gap after the sample ``before``.

    Where changes accumulate, as those of rays that leave nearly along the period, a gap hides others, between which the
    outgoing angle jumps as it does at the ends of the narrow pieces beside the gap.
    """
    xs, outs, follow = chain.entries, chain.angles, chain.successors
    after = follow[before]
    width, whole = xs[after] - xs[before], setting.hollow[RIGHT] - setting.hollow[LEFT]
    size, reach = size_at(outs[before], setting), NARROW_PIECES * width
    jump = spread(outs[before], outs[after], setting)
    last, following = change_near(before, chain.predecessors, reach, chain), change_near(after, follow, reach, chain)
    if last >= 0:
        jump = max(jump, spread(outs[last], outs[before], setting))
    if following >= 0:
        jump = max(jump, spread(outs[following], outs[after], setting))
    return 0.5 * width * (jump + size * math.sqrt(width / whole))


@inlined
def insert(x, before, count, setting, chain):
    """Insert a sample at x after the sample ``before``."""
    xs, outs, labels, follow = chain.entries, chain.angles, chain.labels, chain.successors
    xs[count] = x
    outs[count], labels[count] = probe(x, setting)
    follow[count], chain.predecessors[count] = follow[before], before
    if follow[before] >= 0:
        chain.predecessors[follow[before]] = count
    follow[before] = count


@inlined
def division(i, j, number, setting, chain):
    """Return the position in the gap from sample i to sample j at which round ``number`` divides it.

    Between samples of one itinerary in neighbouring cells the outgoing angle is smooth. The position is then that of
    the edge by linear interpolation, moved towards the middle by more than its error, so that both ends of the gap
    approach the edge and the width falls quadratically. Every third round, and other gaps, are divided in the middle.
    """
    xs, outs, labels = chain.entries, chain.angles, chain.labels
    edges, hollow = setting.edges, setting.hollow
    width, middle = xs[j] - xs[i], 0.5 * (xs[i] + xs[j])
    step = np.int64(labels[j] - labels[i])
    if number % 3 == 2 or (step != 1 and step != -1) or outs[i] == outs[j]:
        return middle
    cell = cell_of(min(outs[i], outs[j]), edges, setting.edge_count)
    if cell == setting.edge_count:
        return middle
    x = xs[i] + width * (edges[cell] - outs[i]) / (outs[j] - outs[i])
    margin = max(BEYOND_EDGE * width * width / (hollow[RIGHT] - hollow[LEFT]), 4.0 * EPS * abs(middle))
    x += margin if x < middle else -margin
    return x if xs[i] < x < xs[j] else middle


@linked
def halve_gaps(setting, chain, count, gap_count, goal, most):
    """Divide gaps until the sum of their errors is at most ``goal``; return the number of samples."""
    xs, labels, follow, gaps, fresh = chain.entries, chain.labels, chain.successors, chain.gaps, chain.fresh
    for number in range(MOST_ROUNDS):
        total, worst = 0.0, 0.0
        for g in range(gap_count):
            matter = undecided(gaps[g], setting, chain)
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
            if undecided(i, setting, chain) <= fair:
                fresh[fresh_count] = i
                fresh_count += 1
                continue
            narrow = xs[j] - xs[i] <= 2.0 * EPS * max(abs(xs[i]), abs(xs[j]))
            if narrow or count >= most or is_spent(setting):
                continue
            k = count
            insert(division(i, j, number, setting, chain), i, k, setting, chain)
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


@linked
def sample_entries(entries, setting, chain, goal):
    """Chain the samples at increasing positions and halve the gaps.

    Returns the number of samples, and the sample of largest position.
    """
    xs, outs, labels, follow, gaps = chain.entries, chain.angles, chain.labels, chain.successors, chain.gaps
    left, right, rays = setting.hollow[LEFT], setting.hollow[RIGHT], rays_at(setting.rays)
    count, gap_count = np.int64(0), np.int64(0)
    for x in entries:
        if x <= left or x >= right or (count > 0 and x <= xs[count - 1]):
            continue
        xs[count] = x
        follow[count], chain.predecessors[count] = count + 1, count - 1
        count += 1
    end = np.int64(0)
    while end < count:
        first, end = end, min(end + BLOCK, count)
        for k in range(first, end):
            rays.x[k - first] = xs[k]
        trace_block(end - first, setting)
        for k in range(first, end):
            outs[k], labels[k] = outcome(k - first, setting)
            if k > 0 and labels[k] != labels[k - 1]:
                gaps[gap_count] = k - 1
                gap_count += 1
        if is_spent(setting) and end < count - 1:
            # between these samples and the last one there is a gap, which counts as error
            xs[end], count = xs[count - 1], end + 1
    last = count - 1
    follow[last] = -1
    return halve_gaps(setting, chain, count, gap_count, goal, np.int64(3 * MOST_SAMPLES // 4)), last


@linked
def add_change(x, first, setting, chain, count, goal):
    """Insert a position x of another label into the piece that begins with ``first``, and find the changes around x."""
    xs, follow, gaps = chain.entries, chain.successors, chain.gaps
    before = first
    while xs[follow[before]] <= x:
        before = follow[before]
    insert(x, before, count, setting, chain)
    gaps[0], gaps[1] = before, count
    return halve_gaps(setting, chain, count + 1, np.int64(2), goal, np.int64(MOST_SAMPLES))


@compiled
def trace_points(entries, angles, setting, outs, labels):
    """Trace rays with incoming angles of their own; set their outgoing angles and labels.

    Of the setting the address is given. The outgoing angle is 0 for rays that do not escape.
    """
    setting = setting_at(setting)
    rays = rays_at(setting.rays)
    for first in range(0, entries.shape[0], BLOCK):
        last = min(first + BLOCK, entries.shape[0])
        for n in range(first, last):
            rays.x[n - first], rays.theta[n - first] = entries[n], angles[n]
        trace_block(last - first, setting)
        for n in range(first, last):
            out, labels[n] = outcome(n - first, setting)
            outs[n] = 0.0 if labels[n] < FIRST_LABEL else out


# Number of positions, at most the last width away from the expected middle, at which a piece is searched. Near a
# critical angle the width is proportional to the distance from this angle or to its square root; both cases are found.
POINTS_TRIED = 17
# Bisections for the ends of a piece, enough to follow its middle.
EDGE_STEPS = 5
MOST_STEPS = 80
# Difference, radians, up to which critical angles are equal; its effect through a square root is below rounding.
SAME_ANGLE = 1e-11


@linked
def edge_from(x, step, label, setting):
    """Return the end of the piece around x in the direction of ``step``, to a small fraction of its distance."""
    left, right = setting.hollow[LEFT], setting.hollow[RIGHT]
    inside, outside = x, x + step
    while left < outside < right and probe(outside, setting)[1] == label:
        inside = outside
        step *= 2.0
        outside = inside + step
    outside = min(max(outside, left), right)
    for _ in range(EDGE_STEPS):
        middle = 0.5 * (inside + outside)
        if probe(middle, setting)[1] == label:
            inside = middle
        else:
            outside = middle
    return inside


@compiled
def find_critical(label, present, absent, low, high, drift, setting):
    """Return the critical angle between ``present`` and ``absent`` of the piece [low, high] at the angle ``present``.

    ``drift`` is the estimated derivative of the piece's middle by the angle; of the setting the address is given.
    """
    setting = setting_at(setting)
    hollow = setting.hollow
    left, right = hollow[LEFT], hollow[RIGHT]
    for _ in range(MOST_STEPS):
        if abs(present - absent) <= SAME_ANGLE:
            break
        angle = 0.5 * (present + absent)
        set_angle(angle, setting)
        width, before = high - low, 0.5 * (low + high)
        centre = before + drift * (angle - present)
        found = np.nan
        for n in range(POINTS_TRIED):
            # from the middle outwards, to either side in turn
            x = centre + width * (1.0 - 2.0 * (n % 2)) * ((n + 1) // 2) / (POINTS_TRIED // 2)
            if left < x < right and probe(x, setting)[1] == label:
                found = x
                break
        if np.isnan(found):
            absent = angle
            continue
        step = max(0.25 * width, 4.0 * EPS * abs(found))
        low, high = edge_from(found, -step, label, setting), edge_from(found, step, label, setting)
        if high <= low:
            break
        drift = (0.5 * (low + high) - before) / (angle - present)
        present = angle
    return 0.5 * (present + absent)
