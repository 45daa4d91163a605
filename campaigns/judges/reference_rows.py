"""Reference rows and first moments of the random curved walls, by a second method.

``python -m campaigns.judges.reference_rows`` writes them. Nothing here is the library's but the walls and their
curves, and the angles at which the moments are cut. Rays are those of `textbook_tracer`. Rows are sampled densely,
changes of the pieces hit are bisected to rounding, and between them tanh-sinh rules take over. The first moment <u, P
u>/<u, u> is integrated over rows by Gauss rules between cuts; where pieces are too many for that, rays at a stratified
sample of (x, u) are averaged. What is written comes with an error: from coarser rules or from the spread, and for
moments from the flux E[cos Theta'] = 0. A moment is replaced only by one with a smaller error; some that stand in the
file had more rays than MOST_RAYS.
"""

from __future__ import annotations

import heapq
import json
import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from asperity.kernels import Legendre
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import panel_edges
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall
from campaigns.judges.textbook_tracer import compiled, follow, table_of

FILE = Path(__file__).with_suffix(".json")
ANGLES = (0.21, 0.83, 1.37, 1.96, 2.77)
# Samples of a row that stands for itself, and of one of many under a moment.
ROW_SAMPLES, MOMENT_SAMPLES = 16384, 1024
# Exactness of the rows of a panel of width 1, and of one so narrow that it may be coarser.
ROW_EXACTNESS, FAIR_WIDTH = 1e-8, 0.02
# The moment: Gauss's rule on a panel, the sum of what panels may miss, and the rays after which it is left at that.
RULE = tuple(0.5 * part + (0.5, 0.0)[k] for k, part in enumerate(np.polynomial.legendre.leggauss(12)))
GOAL, MOST_RAYS = 1e-10, 8_000_000
# Flights that the library may spend on finding cuts. Where its error is then above the limit, or that of a row is above
# its own, rays are averaged instead.
CUT_FLIGHTS, CUT_TOLERANCE, ROUGH, ROUGH_ROW = 1_200_000, 1e-5, 1e-2, 1e-3
# Sides of the grid of strata, and the number of replicates; in a row, of shifted midpoint sums.
STRATA, REPLICATES, MIDPOINTS = 500, 8, 1 << 16
# Walks along a row, each with the positions at which the one before met a piece that it had not seen.
ATTEMPTS = 3
# Pieces of a row at most.
MOST_PIECES = 6000
# tanh-sinh: step of the coarsest rule, number of halvings, largest argument.
FIRST_STEP, LEVELS, REACH = 0.5, 5, 3.6


@compiled
def row_integral(table, theta, low, high, samples, exactness):
    """The integral of cos theta' over the entry points, its error, and the number of rays.

    The error is what narrow gaps and the last rules leave open.

    Gaps are halved until they matter less than the exactness, as far as their ends show, and rules have to agree to it.
    """
    width = high - low
    ladder = np.empty(samples + 80)
    for n in range(samples):
        ladder[n] = low + width * (n + (0.1 + n * 0.7548776662466927 + theta * 977.0) % 1.0) / samples
    for n in range(40):
        ladder[samples + 2 * n] = low + width * 0.4 ** (n + 3)
        ladder[samples + 2 * n + 1] = high - width * 0.4 ** (n + 3)
    rays = 0
    for _ in range(ATTEMPTS):
        ladder.sort()
        total, error, strange, spent = walk(table, theta, ladder, exactness)
        rays += spent
        if strange.shape[0] == 0:
            break
        ladder = np.concatenate((ladder, strange))
    return total, error + 2.0 * (ladder[0] - low) + 2.0 * (high - ladder[-1]), rays


@compiled
def walk(table, theta, ladder, exactness):
    """Integral from the first to the last entry of the ladder, its error, positions of other labels, and the rays."""
    xs, outs, labels = np.empty(200), np.empty(200), np.empty(200, np.uint64)
    strange = [0.0 for _ in range(0)]
    last = ladder[0]
    last_out, last_label = follow(table, last, theta)
    start, total, error, gaps, pieces = last, 0.0, 0.0, 0.0, 0
    rays = ladder.shape[0]
    for k in range(1, ladder.shape[0]):
        # the positions still to be reached, the nearest one on top: the middle of a gap goes on top of its far end
        xs[0] = ladder[k]
        outs[0], labels[0] = follow(table, xs[0], theta)
        count = 1
        while count > 0:
            x, out, label = xs[count - 1], outs[count - 1], labels[count - 1]
            gap = x - last
            matter = gap * (abs(math.cos(out) - math.cos(last_out)) + math.sqrt(gap))
            if label == last_label:
                last, last_out = x, out
                count -= 1
            elif matter > exactness and gap > 4e-16 and pieces < MOST_PIECES:
                xs[count] = 0.5 * (last + x)
                outs[count], labels[count] = follow(table, xs[count], theta)
                count += 1
                rays += 1
            else:
                value, miss, other, spent = piece_integral(table, theta, start, last, last_label, exactness)
                rays += spent
                if not math.isnan(other):
                    strange.append(other)
                total += value + 0.5 * (math.cos(last_out) + math.cos(out)) * gap
                error += miss
                gaps += matter * matter
                pieces += 1
                start, last, last_out, last_label = x, x, out, label
                count -= 1
    value, miss, other, spent = piece_integral(table, theta, start, last, last_label, exactness)
    if not math.isnan(other):
        strange.append(other)
    # where in its gap a change lies is by chance
    return total + value, error + miss + 3.0 * math.sqrt(gaps), np.array(strange), rays + spent


@compiled
def piece_integral(table, theta, low, high, label, exactness):
    """tanh-sinh over a piece, finer until two rules agree; error, a position of another label (nan: none), rays.

    What such rays weigh counts as error.
    """
    half = 0.5 * (high - low)
    old, step, total, strange, miss, other = 0.0, FIRST_STEP, 0.0, 0.0, 2.0 * half, np.nan
    rays = 0
    if half <= 0.0:
        return 0.0, 0.0, np.nan, 0
    for level in range(LEVELS + 1):
        total, strange = 0.5 * total, 0.5 * strange
        number = int(REACH / step)
        for n in range(-number, number + 1):
            if level > 0 and n % 2 == 0:
                continue
            u = 0.5 * math.pi * math.sinh(n * step)
            weight = step * half * 0.5 * math.pi * math.cosh(n * step) / math.cosh(u) ** 2
            # the distance to the nearer end, without cancellation
            distance = 2.0 * half / (1.0 + math.exp(2.0 * abs(u)))
            x = low + distance if u < 0.0 else high - distance
            out, here = follow(table, x, theta)
            rays += 1
            total += weight * math.cos(out)
            if here != label and distance > 1e-13:
                strange += weight
                other = x if half > exactness**0.5 else other
        if level > 0:
            miss = abs(total - old)
            if level > 1 and miss <= exactness:
                break
        old = total
        step *= 0.5
    return total, miss + 2.0 * strange, other, rays


def opening(wall):
    """Ends of the only hollow."""
    (hollow,) = wall.hollows
    return hollow.left, hollow.right


def row_of(wall, theta):
    """E[cos Theta' | theta] and its error."""
    table, (left, right) = table_of(wall), opening(wall)
    value, error, _ = row_integral(table, theta, left, right, ROW_SAMPLES, 1e-14)
    if error > ROUGH_ROW:
        shifts = np.random.default_rng(7).random(REPLICATES)
        sums = [midpoint_sum(table, theta, left, right, shift) for shift in shifts]
        value, error = np.mean(sums), 3.0 * np.std(sums, ddof=1) / math.sqrt(REPLICATES)
    flat = wall.period - (right - left)
    return float(value - flat * math.cos(theta)) / wall.period, float(error) / wall.period


@compiled
def midpoint_sum(table, theta, left, right, shift):
    total = 0.0
    for n in range(MIDPOINTS):
        total += math.cos(follow(table, left + (right - left) * (n + shift) / MIDPOINTS, theta)[0])
    return total * (right - left) / MIDPOINTS


def moment_of(wall):
    """<u, P u>/<u, u> and its error: flat tops, which reflect u to -u, in closed form."""
    table, (left, right) = table_of(wall), opening(wall)
    edges, missed = panel_edges(wall, Legendre(2), Budget(CUT_TOLERANCE, segments=CUT_FLIGHTS))
    fraction, flat = (right - left) / wall.period, 1.0 - (right - left) / wall.period
    if missed > ROUGH:
        rng = np.random.default_rng(11)
        means = [stratified_mean(table, left, right, rng.random((STRATA, STRATA, 2))) for _ in range(REPLICATES)]
        # int u^2 du/2 = 1/3
        return 3.0 * fraction * float(np.mean(means)) - flat, 9.0 * fraction * float(np.std(means, ddof=1)) / math.sqrt(
            REPLICATES
        )
    moment, flux, error = adaptive_sums(table, left, right, edges)
    scale = 3.0 / wall.period
    return scale * moment - flat, scale * (error + 2.0 * abs(flux))


def adaptive_sums(table, left, right, edges):
    """Integrals of cos theta E[cos Theta'] and of E[cos Theta'] for sin(theta)/2 d theta, and the error of the first.

    The worst panel is halved until the differences between panels and their halves are small, or the rays are used up.
    A half is trusted no more than that difference, though what it leaves is smaller.
    """
    panels, rays = [], 0
    for low, high in pairwise(edges):
        panels.append((-np.inf, low, high, panel_sums(table, left, right, low, high, *RULE)))
        rays += panels[-1][3][3]
    while np.isinf(panels[0][0]) or (rays < MOST_RAYS and -panels[0][0] > GOAL / len(panels)):
        _, low, high, whole = heapq.heappop(panels)
        middle = 0.5 * (low + high)
        halves = [panel_sums(table, left, right, *ends, *RULE) for ends in ((low, middle), (middle, high))]
        uncertainty = 0.5 * abs(whole[0] - halves[0][0] - halves[1][0])
        heapq.heappush(panels, (-uncertainty, low, middle, halves[0]))
        heapq.heappush(panels, (-uncertainty, middle, high, halves[1]))
        rays += halves[0][3] + halves[1][3]
    sums = np.array([panel[3] for panel in panels])
    uncertainties = -sum(panel[0] for panel in panels)
    return math.fsum(sums[:, 0]), math.fsum(sums[:, 1]), uncertainties + math.fsum(sums[:, 2])


@compiled
def panel_sums(table, left, right, low, high, places, weights):
    """The integrals of cos theta E[cos Theta'] and of E[cos Theta'] over a panel, the rows' errors, and the rays."""
    moment, flux, error, rays = 0.0, 0.0, 0.0, 0
    exactness = ROW_EXACTNESS * max(1.0, FAIR_WIDTH / (high - low))
    for k in range(places.shape[0]):
        s = places[k]
        theta = low + (high - low) * s * s * (3.0 - 2.0 * s)
        weight = (high - low) * 6.0 * s * (1.0 - s) * weights[k] * 0.5 * math.sin(theta)
        value, miss, spent = row_integral(table, theta, left, right, MOMENT_SAMPLES, exactness)
        moment, flux = moment + weight * math.cos(theta) * value, flux + weight * value
        error += weight * abs(math.cos(theta)) * miss
        rays += spent
    return moment, flux, error, rays


@compiled
def stratified_mean(table, left, right, random):
    """Mean of u u' with one ray in every cell of a grid in (x, u)."""
    n, total = random.shape[0], 0.0
    for i in range(n):
        for j in range(n):
            x, u = left + (right - left) * (i + random[i, j, 0]) / n, -1.0 + 2.0 * (j + random[i, j, 1]) / n
            total += u * math.cos(follow(table, x, math.acos(u))[0])
    return total / n**2


def references():
    """The stored references by number of the wall: angles, expectations, the first moment, and their errors."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def main() -> None:
    """Compute and write the references of the walls whose numbers are given, or of all."""
    found = references()
    for kind in map(int, sys.argv[1:] or range(COUNT)):
        wall, entry = random_curved_wall(kind), found[kind]
        rows = [row_of(wall, theta) for theta in ANGLES]
        entry |= {"rows": [value.hex() for value, _ in rows], "row_errors": [error for _, error in rows]}
        moment, error = moment_of(wall)
        if error < entry["moment_error"]:
            entry |= {"moment": float(moment).hex(), "moment_error": float(error)}
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        print(entry, flush=True)


if __name__ == "__main__":
    main()
