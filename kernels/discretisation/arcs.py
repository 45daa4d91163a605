"""Matrices of the law of circular arcs in any basis, exact to rounding up to a number of hits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from ...core.rounding import EPS
from ..bases.angles import between_cuts, clipped_inside, edges_inside, joined_lists, mirrored_angle
from ..bases.assembly import add_blocks, add_masses, is_mirror_symmetric, mirror_image
from ..bases.basis import Basis
from ..bases.measure import gauss_on_intervals
from ..bases.partitions import Panels
from ..matrices.matrix import KernelMatrix
from ..walls.circular_arc import CircularArcLaw
from .method import Budget, computed, rounding

# A fraction of about xi^3 / (6 N^3 sin xi) of the rays has more than N hits, 5e-13 for MOST_HITS. They enter at xi and
# leave at pi - xi, both within 2 xi / N, and are counted at these angles. N is FEWEST_HITS times a power of 2, so that
# the error of this is at most REST_FRACTION of the tolerance, or MOST_HITS.
FEWEST_HITS, MOST_HITS, REST_FRACTION = 32, 8192, 1e-5
# Gauss nodes on pieces so short that the basis functions are as smooth there as sin(delta), and on longer pieces in
# partitions.
NODES_SHORT, NODES_CELL = 5, 14
SHORT = 0.1
NOISE_PROBES = 5
# Entries are integrals over delta in an interval of length 2 sin(xi) at most, whose ends are known to about pi eps.
ROUNDING = 4.0 * np.pi * EPS


def by_arc_polygons(law: CircularArcLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of the law of circular arcs by Gauss rules on the polygons of each number of hits."""
    symmetric, error = arc_matrix(law.half_angle, basis, budget.tolerance)
    how = "Gauss rules on the polygons of each number of hits, plus what the remaining hits can do"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


def arc_matrix(half_angle: float, basis: Basis, tolerance: float = 0.0) -> tuple[Floats, float]:
    r"""<e_i, P e_j> for focusing circular arcs of half angle xi, and an estimate of its Frobenius error.

    The error is far below the tolerance, or due to rounding and to the rays of more than MOST_HITS hits.

    Let delta be the chord's angle. S_ij is the integral of e_i(theta) e_j(theta') sin(delta) / (4 sin xi) over
    |theta - xi| < delta < min(xi + theta, 2 pi - xi - theta). Here theta' = pi + theta - 2 N delta for
    (xi + theta)/(2 N + 1) < delta < (xi + theta)/(2 N - 1) and delta < pi/2, and the mirror image of this beyond
    pi/2 (Rudzis 2022, section 2.2.3, corrected; see `CircularArcLaw`). For each N the domain is a polygon on which
    theta' is linear. The edges of the basis in theta and theta' cut the polygons into strips with smooth integrands,
    which Gauss rules integrate.
    """
    total = np.zeros((basis.size, basis.size))
    error = ROUNDING * float(np.sqrt(basis.size)) / np.sin(half_angle)
    sides = (False,) if is_mirror_symmetric(basis) else (False, True)
    most_hits = _enough_hits(half_angle, basis, tolerance)
    for mirrored in sides:
        edges = np.pi - basis.edges[::-1] if mirrored else basis.edges
        strips = _strips(half_angle, edges, most_hits)
        counted = _add_strips(total, basis, edges, strips, half_angle, mirrored)
        centre, spread = _rest(basis, half_angle, most_hits, mirrored)
        total += (0.5 - counted) * centre
        error += abs(0.5 - counted) * spread
    if len(sides) == 1:
        return total + mirror_image(total, basis), 2.0 * error
    return total, error


@dataclass(frozen=True)
class _Strips:
    """Strips: intervals of theta with one number of hits, on which delta lies between two lines a theta + b."""

    hits: Floats
    low: Floats
    high: Floats
    lower: Floats  # shape (2, strips): a, b
    upper: Floats

    def part(self, chosen: NDArray[np.intp] | NDArray[np.bool_] | slice) -> _Strips:
        return _Strips(
            self.hits[chosen], self.low[chosen], self.high[chosen], self.lower[:, chosen], self.upper[:, chosen]
        )


def _enough_hits(half_angle: float, basis: Basis, tolerance: float) -> int:
    """A number of hits such that the other rays change the matrix by much less than the tolerance, or MOST_HITS."""
    hits = FEWEST_HITS
    while hits < MOST_HITS:
        left = (half_angle / hits) ** 3 / (6.0 * np.sin(half_angle))
        spread = max(_rest(basis, half_angle, hits, mirrored)[1] for mirrored in (False, True))
        if left * spread <= REST_FRACTION * tolerance:
            break
        hits *= 2
    return hits


def _strips(half_angle: float, edges: Floats, most_hits: int) -> _Strips:
    whole = _polygons(half_angle, most_hits)
    owners, angles = [np.arange(whole.hits.size)] * 2, [whole.low, whole.high]
    # Cuts at the edges in theta, and where the outgoing angle on a side of the polygon meets an edge.
    level = np.zeros((2, whole.hits.size))
    along = [np.stack((level[0] + 1.0, level[1]))]
    for side in (whole.lower, whole.upper):
        along.append(np.stack((1.0 - 2.0 * whole.hits * side[0], np.pi - 2.0 * whole.hits * side[1])))
    for slope, offset in along:
        ends = slope * whole.low + offset, slope * whole.high + offset
        owner, edge = edges_inside(edges, np.minimum(*ends), np.maximum(*ends))
        with np.errstate(divide="ignore", invalid="ignore"):
            met = (edge - offset[owner]) / slope[owner]
        inside = (met > whole.low[owner]) & (met < whole.high[owner])
        owners.append(owner[inside])
        angles.append(met[inside])
    owner, low, high = between_cuts(np.concatenate(owners), np.concatenate(angles))
    strips = whole.part(owner)
    return _Strips(strips.hits, low, high, strips.lower, strips.upper)


def _polygons(half_angle: float, most_hits: int) -> _Strips:
    """The polygons of all numbers of hits, cut into strips at their corners."""
    hits = np.arange(1.0, most_hits + 1.0)
    one, xi = np.ones(hits.size), half_angle
    lower = np.array([[one, -one, one / (2 * hits + 1)], [-xi * one, xi * one, xi / (2 * hits + 1)]])
    upper = np.array(
        [
            [one, -one, 0.0 * one, one / (2 * hits - 1)],
            [xi * one, (2 * np.pi - xi) * one, 0.5 * np.pi * one, xi / (2 * hits - 1)],
        ]
    )
    lines = np.concatenate((lower, upper), axis=1)
    first, second = np.triu_indices(lines.shape[1], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = (lines[1, second] - lines[1, first]) / (lines[0, first] - lines[0, second])
    corners = np.where((corners > 0.0) & (corners < np.pi), corners, 0.0)
    corners = np.sort(np.concatenate((corners, [np.pi * one])), axis=0)
    low, high = corners[:-1], corners[1:]
    middle = 0.5 * (low + high)
    below, above = (side[0, :, None] * middle + side[1, :, None] for side in (lower, upper))
    rank, column = np.nonzero((below.max(axis=0) < above.min(axis=0)) & (high > low))
    lowest, highest = below.argmax(axis=0)[rank, column], above.argmin(axis=0)[rank, column]
    return _Strips(
        hits[column], low[rank, column], high[rank, column], lower[:, lowest, column], upper[:, highest, column]
    )


def _add_strips(
    total: Floats, basis: Basis, edges: Floats, strips: _Strips, half_angle: float, mirrored: bool
) -> float:
    """Add the integrals over all strips; returns their mass."""
    if basis.is_partition:
        # a node crosses a quarter of the cells or fewer
        long_nodes, cut = NODES_CELL, max(32, basis.size // 4)
        short = strips.high - strips.low < SHORT
    else:
        long_nodes, cut = basis.nodes_per_interval, 32
        short = _reach(strips, edges) * long_nodes < 1.0
    mass = 0.0
    for chosen, order in ((short, NODES_SHORT), (~short, long_nodes)):
        selected = np.flatnonzero(chosen)
        step = max(1, NUMBERS_AT_ONCE // (order * cut))
        for part in (strips.part(selected[some]) for some in slices(selected.size, step)):
            theta, weight = gauss_on_intervals(part.low, part.high, order)
            strip = part.part(np.repeat(np.arange(part.hits.size), order))
            mass += _add_cut_strips(total, basis, edges, strip, theta, weight / (4.0 * np.sin(half_angle)), mirrored)
    return mass


def _reach(strips: _Strips, edges: Floats) -> Floats:
    """Variation of incoming and outgoing angles along a strip, as a fraction of the basis' intervals around them."""
    length, middle, widths = strips.high - strips.low, 0.5 * (strips.low + strips.high), np.diff(edges)

    def interval(angle: Floats) -> Floats:
        return np.asarray(widths[np.clip(np.searchsorted(edges, angle) - 1, 0, widths.size - 1)])

    reach = length / interval(middle)
    for slope, offset in (strips.lower, strips.upper):
        outgoing = np.pi + middle - 2.0 * strips.hits * (slope * middle + offset)
        reach = np.maximum(reach, length * np.abs(1.0 - 2.0 * strips.hits * slope) / interval(outgoing))
    return reach


def _add_cut_strips(
    total: Floats, basis: Basis, edges: Floats, strips: _Strips, theta: Floats, weight: Floats, mirrored: bool
) -> float:
    lower, upper = (side[0] * theta + side[1] for side in (strips.lower, strips.upper))
    upper = np.maximum(upper, lower)
    # The outgoing angle decreases with delta; cut it at the edges.
    first = np.searchsorted(edges, np.pi + theta - 2.0 * strips.hits * upper, side="right")
    last = np.searchsorted(edges, np.pi + theta - 2.0 * strips.hits * lower, side="left")
    number = np.maximum(last - first, 0) + 1
    strip, rank = joined_lists(number)
    above = np.clip(last[strip] - rank, 0, edges.size - 1)
    cut = (np.pi + theta[strip] - edges[above]) / (2.0 * strips.hits[strip])
    low = np.where(rank == 0, lower[strip], np.clip(cut, lower[strip], upper[strip]))
    high = np.where(rank == number[strip] - 1, upper[strip], np.append(low[1:], 0.0))
    # The difference of two cosines as a product, to avoid cancellation.
    mass = 2.0 * weight[strip] * np.sin(0.5 * (low + high)) * np.sin(0.5 * (high - low))
    incoming = np.pi - theta if mirrored else theta
    if basis.is_partition:
        target = np.clip(above - 1, 0, basis.size - 1)
        target = basis.size - 1 - target if mirrored else target
        add_masses(total, basis, basis.index(incoming)[strip], target, mass)
        return float(mass.sum())
    width = np.diff(edges)[np.clip(above - 1, 0, edges.size - 2)]
    short = 2.0 * strips.hits[strip] * (high - low) * basis.nodes_per_interval < width
    for chosen, order in ((short, NODES_SHORT), (~short, basis.nodes_per_interval)):
        selected = np.flatnonzero(chosen)
        step = max(1, NUMBERS_AT_ONCE // (order * (basis.degree + 1 if isinstance(basis, Panels) else basis.size)))
        for part in (selected[some] for some in slices(selected.size, step)):
            chord, fraction = gauss_on_intervals(low[part], high[part], order)
            owner = strip[part]
            each = np.repeat(owner, order)
            outgoing = np.pi + theta[each] - 2.0 * strips.hits[each] * chord
            outgoing = mirrored_angle(outgoing) if mirrored else clipped_inside(outgoing)
            fraction = (fraction * np.sin(chord) * weight[each])[:, None]
            if isinstance(basis, Panels):
                panel, values = basis.local(outgoing)
                image = (values * fraction).reshape(part.size, order, -1).sum(axis=1)
                source, own = basis.local(incoming[owner])
                # A piece lies between edges, so all its nodes are on the panel of the middle node.
                add_blocks(total, basis, source, panel[order // 2 :: order], own, image)
            else:
                image = (basis.evaluate(outgoing) * fraction).reshape(part.size, order, -1).sum(axis=1)
                total += basis.evaluate(incoming[owner]).T @ image
    return float(mass.sum())


def _rest(basis: Basis, half_angle: float, most_hits: int, mirrored: bool) -> tuple[Floats, float]:
    """The matrix of a unit mass of rays with more hits at their limiting angles, and a bound on the error of this."""
    spread = half_angle / most_hits * np.linspace(-1.0, 1.0, NOISE_PROBES)
    sign, origin = (-1.0, np.pi) if mirrored else (1.0, 0.0)
    incoming = basis.evaluate(origin + sign * (half_angle + spread))
    outgoing = basis.evaluate(origin + sign * (np.pi - half_angle + 2.0 * spread))
    e, f = incoming[NOISE_PROBES // 2], outgoing[NOISE_PROBES // 2]
    # incoming outgoing^T - e f^T = from_e outgoing^T + e from_f^T, whose square is a sum of products of numbers
    from_e, from_f = incoming - e, outgoing - f
    square = np.outer((from_e**2).sum(axis=1), (outgoing**2).sum(axis=1)) + (e @ e) * (from_f**2).sum(axis=1)
    square += 2.0 * np.outer(from_e @ e, (outgoing * from_f).sum(axis=1))
    return np.outer(e, f), float(np.sqrt(max(square.max(), 0.0)))
