"""The compiled march along a row: pieces of equal itinerary, and Gauss nodes on each. Imported inside functions only.

For one incoming angle the map x -> theta' is analytic between changes of the itinerary. A row is sampled, gaps between
samples of different labels are halved, all of them once a round, and each piece between two changes is integrated by
Gauss rules in s with x = a + (b - a) s^2 (3 - 2 s): the square roots at tangencies are then analytic at both ends. A
node whose label is not that of its piece is a change that was overlooked; it is put among the samples.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .engine import ESCAPED, HASH_FACTOR, trace_ray

_compile = njit(cache=True, nogil=True, error_model="numpy")

ORDERS = (4, 7, 12, 20, 32)
# Samples that a row starts from, at irregular places so that no symmetry of the wall hides a piece from all of them.
FIRST_SAMPLES = 24
GOLDEN = 0.6180339887498949
# Samples and nodes of one row at most; what is then still undecided counts as error.
MOST_SAMPLES = 1 << 13
MOST_NODES = 1 << 17
MOST_ROUNDS = 200
EPS = 2.0**-52
# Gaps that matter less than this share of the worst one wait for a later round.
WORST_SHARE = 0.1
# Pieces are not halved below this share of the opening.
NARROWEST = 1e-9
# A Gauss rule's error is taken as the last difference times the last ratio of differences, at least this, twice.
LEAST_RATIO = 1e-3
# The share of the row's tolerance that any piece may spend, however short it is.
LEAST_SHARE = 0.02
# The share of the tolerance that all undecided gaps may take.
GAP_SHARE = 0.25


def gauss_tables() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions in (0, 1) and weights of all rules after the substitution, one after the other, and their starts."""
    places, weights, starts = [], [], [0]
    for order in ORDERS:
        node, weight = np.polynomial.legendre.leggauss(order)
        s = 0.5 * (1.0 + node)
        places.append(s * s * (3.0 - 2.0 * s))
        weights.append(0.5 * weight * 6.0 * s * (1.0 - s))
        starts.append(starts[-1] + order)
    return np.concatenate(places), np.concatenate(weights), np.array(starts)


@_compile
def probe(x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, edges, code):
    """Outgoing angle of one ray and the label of its itinerary and of the cell between ``edges`` that it goes to."""
    _, vx, vy, _, status = trace_ray(
        x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, None, code
    )
    if status != ESCAPED:
        return theta, np.uint64(status)
    out = math.atan2(vy, vx)
    # a ray along y = 0 within rounding
    out = min(max(out, 0.0), math.pi)
    cell = 0
    if edges.shape[0] > 0:
        cell = np.searchsorted(edges, out)
    return out, HASH_FACTOR * (code[0] + np.uint64(16)) + np.uint64(cell)


@_compile
def spread(first, second, degree):
    """Largest difference of cos, and of cos and sin of ``degree`` times the angle."""
    k = max(degree, 1)
    return max(
        abs(math.cos(first) - math.cos(second)),
        max(abs(math.cos(k * first) - math.cos(k * second)), abs(math.sin(k * first) - math.sin(k * second))),
    )


@_compile
def undecided(width, first, second, degree, whole):
    """What a gap of this width between these two outcomes may contribute to a row's error."""
    return 0.5 * width * (spread(first, second, degree) + math.sqrt(width / whole))


@_compile
def halve_gaps(
    theta,
    hollow,
    tables,
    period,
    limit,
    edges,
    degree,
    code,
    xs,
    outs,
    labels,
    follow,
    count,
    gaps,
    gap_count,
    goal,
    most,
):
    """Halve gaps between different labels, all of them once a round, until together they matter less than ``goal``."""
    joints, lines, circles, ellipses, beziers = tables
    whole = hollow[1] - hollow[0]
    fresh = np.empty_like(gaps)
    for _ in range(MOST_ROUNDS):
        total, worst = 0.0, 0.0
        for g in range(gap_count):
            i, j = gaps[g], follow[gaps[g]]
            matter = undecided(xs[j] - xs[i], outs[i], outs[j], degree, whole)
            total += matter
            worst = max(worst, matter)
        if total <= goal:
            break
        # the worst first, so that an accumulation of changes does not use up all samples before the others are found
        fair = max(0.25 * goal / gap_count, WORST_SHARE * worst)
        fresh_count = 0
        moved = False
        for g in range(gap_count):
            i = gaps[g]
            j = follow[i]
            width = xs[j] - xs[i]
            if undecided(width, outs[i], outs[j], degree, whole) <= fair:
                fresh[fresh_count] = i
                fresh_count += 1
                continue
            if width <= 2.0 * EPS * max(abs(xs[i]), abs(xs[j])) or count >= most:
                continue
            middle = 0.5 * (xs[i] + xs[j])
            out, label = probe(
                middle, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, edges, code
            )
            k = count
            count += 1
            moved = True
            xs[k], outs[k], labels[k] = middle, out, label
            follow[k] = j
            follow[i] = k
            if label != labels[i]:
                fresh[fresh_count] = i
                fresh_count += 1
            if label != labels[j]:
                fresh[fresh_count] = k
                fresh_count += 1
        gap_count = fresh_count
        gaps[:gap_count] = fresh[:gap_count]
        if not moved:
            break
    return count


@_compile
def integrate(
    theta,
    hollow,
    tables,
    period,
    limit,
    edges,
    degree,
    code,
    rules,
    low,
    high,
    label,
    goal,
    least,
    node,
    mass,
    filled,
    room,
    strict,
):
    """Nodes on [low, high], where all rays should have the given label.

    Returns their number, the error, and a place where a ray has another label (nan: none). Without ``strict`` labels
    do not matter, and the difference of the rules has to show what the piece hides.
    """
    joints, lines, circles, ellipses, beziers = tables
    places, weights, starts = rules
    width = high - low
    old0, old1, old2, old_step = 0.0, 0.0, 0.0, 0.0
    k = max(degree, 1)
    step, error = 2.0 * width, 2.0 * width
    used = 0
    for level in range(least, len(ORDERS)):
        first, last = starts[level], starts[level + 1]
        if last - first > room:
            return used, error, np.nan
        new0, new1, new2 = 0.0, 0.0, 0.0
        for n in range(first, last):
            x = low + width * places[n]
            out, here = probe(x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, edges, code)
            if strict and here != label:
                return used, error, x
            weight = width * weights[n]
            node[filled + n - first], mass[filled + n - first] = out, weight
            new0 += weight * math.cos(out)
            new1 += weight * math.cos(k * out)
            new2 += weight * math.sin(k * out)
        used = last - first
        if degree == 0 or label < np.uint64(4):
            return used, 0.0, np.nan
        if level > least:
            step = max(abs(new0 - old0), max(abs(new1 - old1), abs(new2 - old2))) + EPS * width
            ratio = 1.0 if level == least + 1 else step / old_step
            error = 2.0 * step * min(1.0, max(ratio, LEAST_RATIO))
            if error <= goal:
                return used, error, np.nan
            old_step = step
        old0, old1, old2 = new0, new1, new2
    return used, error, np.nan


@_compile
def march_row(
    theta,
    hollow,
    tables,
    period,
    limit,
    edges,
    degree,
    least,
    tolerance,
    seeds,
    rules,
    xs,
    outs,
    labels,
    follow,
    gaps,
    code,
    node,
    mass,
    ends,
):
    """Nodes and masses of one row; returns their number, the error, the lost width, pieces and rays.

    ``ends`` receives the middles of the pieces, seeds for the next row.
    """
    joints, lines, circles, ellipses, beziers = tables
    left, right = hollow[0], hollow[1]
    whole = right - left
    goal = tolerance * whole
    first = np.empty(FIRST_SAMPLES + 2 + seeds.shape[0])
    margin = 1e-3 * min(goal, 1e-3 * whole)
    first[0], first[1] = left + margin, right - margin
    for n in range(FIRST_SAMPLES):
        first[2 + n] = left + whole * (n + 0.25 + 0.5 * ((n * GOLDEN) % 1.0)) / FIRST_SAMPLES
    first[FIRST_SAMPLES + 2 :] = seeds
    first.sort()
    count = 0
    gap_count = 0
    for x in first:
        if x <= left or x >= right or (count > 0 and x <= xs[count - 1]):
            continue
        out, label = probe(x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, edges, code)
        xs[count], outs[count], labels[count] = x, out, label
        follow[count] = count + 1
        if count > 0 and label != labels[count - 1]:
            gaps[gap_count] = count - 1
            gap_count += 1
        count += 1
    last = count - 1
    follow[last] = -1
    rays = count
    count = halve_gaps(
        theta,
        hollow,
        tables,
        period,
        limit,
        edges,
        degree,
        code,
        xs,
        outs,
        labels,
        follow,
        count,
        gaps,
        gap_count,
        GAP_SHARE * goal,
        3 * MOST_SAMPLES // 4,
    )
    rays += count - rays
    filled, pieces = 0, 0
    # the margins count with the first and the last sample
    node[0], mass[0] = outs[0], xs[0] - left
    node[1], mass[1] = outs[last], right - xs[last]
    filled = 2
    error = 2.0 * EPS * whole + margin * (spread(outs[0], outs[1], degree) + spread(outs[last], outs[last - 1], degree))
    lost = 0.0
    stack_low, stack_high = np.empty(64), np.empty(64)
    i = 0
    while i >= 0:
        j = i
        while follow[j] >= 0 and labels[follow[j]] == labels[i]:
            j = follow[j]
        start_filled, start_error = filled, error
        uncovered = np.nan
        if j != i:
            depth = 1
            stack_low[0], stack_high[0] = xs[i], xs[j]
            while depth > 0:
                depth -= 1
                low, high = stack_low[depth], stack_high[depth]
                allowed = 0.5 * goal * max((high - low) / whole, LEAST_SHARE)
                room = MOST_NODES - filled - 2
                used, miss, uncovered = integrate(
                    theta,
                    hollow,
                    tables,
                    period,
                    limit,
                    edges,
                    degree,
                    code,
                    rules,
                    low,
                    high,
                    labels[i],
                    allowed,
                    least,
                    node,
                    mass,
                    filled,
                    room,
                    count < MOST_SAMPLES - 4,
                )
                rays += 2 * used
                if not math.isnan(uncovered):
                    break
                if miss > allowed and depth < 40 and high - low > NARROWEST * whole and room >= ORDERS[-1]:
                    middle = 0.5 * (low + high)
                    stack_low[depth], stack_high[depth] = middle, high
                    stack_low[depth + 1], stack_high[depth + 1] = low, middle
                    depth += 2
                    continue
                if used == 0:
                    node[filled], mass[filled] = outs[i], high - low
                    used = 1
                filled += used
                error += miss
            if not math.isnan(uncovered):
                # an overlooked change: it joins the samples, and the piece is walked again
                filled, error = start_filled, start_error
                before = i
                while xs[follow[before]] <= uncovered:
                    before = follow[before]
                out, label = probe(
                    uncovered, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, edges, code
                )
                xs[count], outs[count], labels[count] = uncovered, out, label
                follow[count] = follow[before]
                follow[before] = count
                gaps[0], gaps[1] = before, count
                count += 1
                rays -= count
                count = halve_gaps(
                    theta,
                    hollow,
                    tables,
                    period,
                    limit,
                    edges,
                    degree,
                    code,
                    xs,
                    outs,
                    labels,
                    follow,
                    count,
                    gaps,
                    2,
                    0.05 * GAP_SHARE * goal,
                    MOST_SAMPLES,
                )
                rays += count
                continue
            if labels[i] < np.uint64(4):
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
            error += undecided(width, outs[j], outs[following], degree, whole)
        i = following
    return filled, error, lost, pieces, rays


@_compile
def march_rows(thetas, hollow, tables, period, limit, edges, degree, least, tolerances, rules, most_seeds):
    """Rows at increasing angles: nodes and masses one after the other, where each row starts, errors, lost, rays.

    Each row starts also from the middles of its neighbour's pieces, so that a narrow piece is followed until it
    vanishes.
    """
    xs, outs = np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES)
    labels = np.empty(MOST_SAMPLES, np.uint64)
    follow, gaps = np.empty(MOST_SAMPLES, np.int64), np.empty(MOST_SAMPLES, np.int64)
    code = np.zeros(1, np.uint64)
    node, mass = np.empty(MOST_NODES + 4), np.empty(MOST_NODES + 4)
    ends = np.empty(most_seeds)
    seeds = np.empty(0)
    n = thetas.shape[0]
    starts = np.zeros(n + 1, np.int64)
    errors, lost, rays = np.empty(n), np.empty(n), np.empty(n, np.int64)
    all_node, all_mass = np.empty(1024), np.empty(1024)
    for k in range(n):
        filled, errors[k], lost[k], pieces, rays[k] = march_row(
            thetas[k],
            hollow,
            tables,
            period,
            limit,
            edges,
            degree,
            least,
            tolerances[k],
            seeds,
            rules,
            xs,
            outs,
            labels,
            follow,
            gaps,
            code,
            node,
            mass,
            ends,
        )
        seeds = ends[: min(pieces, most_seeds)].copy()
        begin = starts[k]
        if begin + filled > all_node.shape[0]:
            size = 2 * (begin + filled)
            bigger = np.empty(size)
            bigger[:begin] = all_node[:begin]
            all_node = bigger
            bigger = np.empty(size)
            bigger[:begin] = all_mass[:begin]
            all_mass = bigger
        all_node[begin : begin + filled] = node[:filled]
        all_mass[begin : begin + filled] = mass[:filled]
        starts[k + 1] = begin + filled
    return all_node[: starts[n]], all_mass[: starts[n]], starts, errors, lost, rays
