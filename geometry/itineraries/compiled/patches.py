"""Compiled masses of cells of outgoing angles on patches: parts of the phase space with one itinerary.

On a patch the outgoing angle is an analytic function of two variables in [0, 1], the position within the piece of entry
points and the position within the panel of incoming angles. It is given at the positions of a nested rule and at the
nodes of the panel, and interpolated in between by the barycentric formula. At one incoming angle the mass of a cell is
the distance of two crossings of its edges, so no integral over the entry point is needed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...scene.compiled.compiling import compiled, linked
from .changes import cell_of

# Steps towards a crossing of an edge, and towards an extremum of the outgoing angle.
MOST_STEPS, EXTREMUM_STEPS = 60, 3
# Least distance from a node at which the barycentric formula is used.
AT_NODE = 1e-14
# Gauss's rules with these numbers of nodes on (0, 1), and two null rules of the same size for each, for polynomials of
# degree n - 2 and n - 3. The second rule is used where the error of the first is too large.
NUMBERS = (5, 10)
GAUSS_NODES, GAUSS_WEIGHTS, FINE_NULL, COARSE_NULL = np.zeros((4, len(NUMBERS), max(NUMBERS)))
for _rule, _n in enumerate(NUMBERS):
    _nodes, _weights = np.polynomial.legendre.leggauss(_n)
    GAUSS_NODES[_rule, :_n], GAUSS_WEIGHTS[_rule, :_n] = 0.5 * (1.0 + _nodes), 0.5 * _weights
    _null = _weights[:, None] * np.polynomial.legendre.legvander(_nodes, _n - 1)[:, -2:]
    _null *= 0.5 * np.linalg.norm(_weights) / np.linalg.norm(_null, axis=0)
    COARSE_NULL[_rule, :_n], FINE_NULL[_rule, :_n] = _null.T
# Limit on the depth of parts of a panel; on the first level parts are not divided yet.
MOST_DEPTH = 12
# Columns of the ends of a piece: the middles of the gaps before and after it, between them its first and last sample.
START, LOW, HIGH, STOP = range(4)
# Rows of the marks, columns of the stack of parts of a panel, and the only node of a piece at one angle.
PLACE, VALUE = range(2)
BEGIN, END, LEVEL = range(3)
ALONE = FIRST = 0
# Most crossings of edges at one angle; the rest of the piece then counts for the last cell.
MOST_CROSSINGS = 1 << 14


class Grid(NamedTuple):
    """Increasing nodes in (0, 1) and their barycentric weights."""

    nodes: Floats
    weights: Floats


class Cells(NamedTuple):
    """The edges between the cells, and the norms of the functions in them."""

    edges: Floats
    sizes: Floats


class Room(NamedTuple):
    """Work space: crossings, their cells and slopes; cuts; ends of a piece; values at positions, at nodes, in cells.

    ``marks``, of shape (2, positions + 4), are those of `set_marks`.
    """

    marks: Floats
    found: Floats
    cells: NDArray[np.int64]
    slopes: Floats
    cuts: Floats
    ends: Floats
    values: Floats
    edge_values: Floats
    samples: Floats
    stack: Floats


def room_for(cells: int, nodes: int, positions: int) -> Room:
    """Return work space for patches in so many cells."""
    most, marks = MOST_CROSSINGS, np.empty((2, max(nodes, positions) + 4))
    found, crossed, slopes, cuts = np.empty(most), np.empty(most + 1, np.int64), np.empty(most), np.empty(2 * most + 2)
    ends, values, edge_values = np.empty(STOP + 1), np.empty(positions), np.empty(nodes)
    samples, stack = np.empty((max(NUMBERS), cells)), np.empty((MOST_DEPTH + 2, LEVEL + 1))
    return Room(marks, found, crossed, slopes, cuts, ends, values, edge_values, samples, stack)


@linked
def value_at(t, grid, values):
    """Return the value of the polynomial through ``values`` at t."""
    nodes, weights = grid
    above, below = 0.0, 0.0
    for j in range(nodes.shape[0]):
        step = t - nodes[j]
        if abs(step) < AT_NODE:
            return values[j]
        ratio = weights[j] / step
        above += ratio * values[j]
        below += ratio
    return above / below


@linked
def crossing_between(low, high, below, above, edge, grid, values):
    """Return where the polynomial, with values on both sides of the edge at low and at high, crosses it."""
    at_low, at_high = below - edge, above - edge
    t = low
    side = np.int64(0)
    for _ in range(MOST_STEPS):
        t = (at_high * low - at_low * high) / (at_high - at_low)
        if not (low < t < high):
            t = 0.5 * (low + high)
        if high - low < 1e-13:
            break
        here = value_at(t, grid, values) - edge
        if abs(here) < 1e-14:
            break
        if (here > 0.0) == (at_high > 0.0):
            high, at_high = t, here
            if side == 1:
                at_low *= 0.5
            side = np.int64(1)
        else:
            low, at_low = t, here
            if side == -1:
                at_high *= 0.5
            side = np.int64(-1)
    return t


@linked
def vertex_of(a, at_a, b, at_b, c, at_c):
    """Return the extremum of the parabola through three points, or b if they lie on a line."""
    first, second = (b - a) * (at_b - at_c), (b - c) * (at_b - at_a)
    if first == second:
        return b
    return b - 0.5 * ((b - a) * first - (b - c) * second) / (first - second)


@linked
def set_marks(grid, values, room):
    """Set positions from 0 to 1, and the values there, between which the polynomial is monotone; return their number.

    They are the ends, and the nodes, of which an extremum nearby takes the place. Extrema between an end and the first
    or last node are added.
    """
    nodes, marks = grid.nodes, room.marks
    m = nodes.shape[0]
    last, at_last = 1.0, value_at(1.0, grid, values)
    marks[PLACE, FIRST], marks[VALUE, FIRST] = 0.0, value_at(0.0, grid, values)
    count = np.int64(1)
    for i in range(m + 1):
        right, at_right = (nodes[i], values[i]) if i < m else (last, at_last)
        left, at_left = marks[PLACE, count - 1], marks[VALUE, count - 1]
        if i == 0 or i == m:
            other = 1 if i == 0 else m - 2
            vertex = vertex_of(left, at_left, right, at_right, nodes[other], values[other])
            if left < vertex < right:
                marks[PLACE, count], marks[VALUE, count] = vertex, value_at(vertex, grid, values)
                count += 1
        if i == m:
            break
        t, at_t = right, at_right
        right, at_right = (nodes[i + 1], values[i + 1]) if i + 1 < m else (last, at_last)
        left, at_left = marks[PLACE, count - 1], marks[VALUE, count - 1]
        sign = at_t - at_left
        if sign * (at_right - at_t) < 0.0:
            for _ in range(EXTREMUM_STEPS):
                vertex = vertex_of(left, at_left, t, at_t, right, at_right)
                at_vertex = value_at(vertex, grid, values)
                if not (left < vertex < right) or abs(vertex - t) < 1e-9 or (at_vertex - at_t) * sign < 0.0:
                    break
                if vertex < t:
                    right, at_right = t, at_t
                else:
                    left, at_left = t, at_t
                t, at_t = vertex, at_vertex
        marks[PLACE, count], marks[VALUE, count] = t, at_t
        count += 1
    marks[PLACE, count], marks[VALUE, count] = last, at_last
    return count + 1


@linked
def find_crossings(grid, values, edges, room):
    """Find the crossings of edges by the polynomial through ``values`` on [0, 1], in increasing order.

    Sets their positions, the cells before, between and after them, and |dt / df| there in ``room``. Returns their
    number.
    """
    marks, found, cells, slopes = room.marks, room.found, room.cells, room.slopes
    number = set_marks(grid, values, room)
    count, most = np.int64(0), found.shape[0]
    cell = cell_of(marks[VALUE, FIRST], edges, edges.shape[0])
    cells[0] = cell
    for i in range(1, number):
        last, at_last, t, at_t = marks[PLACE, i - 1], marks[VALUE, i - 1], marks[PLACE, i], marks[VALUE, i]
        rise = at_t - at_last
        slope = (t - last) / max(abs(rise), 1e-300)
        while count < most:
            if rise > 0.0 and cell < edges.shape[0] and edges[cell] < at_t:
                edge, following = edges[cell], cell + 1
            elif rise < 0.0 and cell > 0 and edges[cell - 1] >= at_t:
                edge, following = edges[cell - 1], cell - 1
            else:
                break
            last = crossing_between(last, t, at_last, at_t, edge, grid, values)
            at_last = edge
            found[count], slopes[count] = last, slope
            cell = following
            count += 1
            cells[count] = cell
    return count


@linked
def sizes_at_ends(grid, values, cells):
    """-> (first, last): the norms of the functions in the cells of the outgoing angles at both ends."""
    edges, count = cells.edges, cells.edges.shape[0]
    first = cell_of(value_at(0.0, grid, values), edges, count)
    last = cell_of(value_at(1.0, grid, values), edges, count)
    return cells.sizes[first], cells.sizes[last]


@linked
def row_masses(ends, grid, values, cells, masses, room):
    """Add the widths of the entry points that lead to the cells at one angle.

    Returns the change of the masses by a shift of the outgoing angle of 1 / (4 s (1 - s)) at position s, and the error
    due to the gaps at the ends, both as norms of the functions' integrals.
    ``ends`` are the middle of the gap before the piece, its first and last sample, and the middle of the gap after it.
    """
    start, low, high, end = ends[START], ends[LOW], ends[HIGH], ends[STOP]
    edges, sizes = cells
    count = find_crossings(grid, values, edges, room)
    change, last = 0.0, start
    for k in range(count):
        s = room.found[k]
        x = low + (high - low) * s * s * (3.0 - 2.0 * s)
        before, after = room.cells[k], room.cells[k + 1]
        masses[before] += x - last
        last = x
        change += 1.5 * room.slopes[k] * (high - low) * math.hypot(sizes[before], sizes[after])
    masses[room.cells[count]] += end - last
    return change, (low - start) * sizes[room.cells[0]] + (end - high) * sizes[room.cells[count]]


@compiled
def masses_of_rows(grid, ends, outs, owners, uncertainties, cells, masses, errors, room):
    """Add the masses of pieces, each at one angle, to those of the angles' numbers ``owners``, and their errors."""
    for i in range(owners.shape[0]):
        k = owners[i]
        change, gaps = row_masses(ends[i, ALONE], grid, outs[i, ALONE], cells, masses[k], room)
        errors[k] += uncertainties[i] * change + gaps


@linked
def interpolate(s, grid, rows, found):
    """Set ``found`` to the row at position s of the panel, of which ``rows`` are those at the nodes."""
    total = 0.0
    found[:] = 0.0
    for k in range(grid.nodes.shape[0]):
        # cuts may be nodes
        step = s - grid.nodes[k]
        ratio = grid.weights[k] / (step if abs(step) > AT_NODE else AT_NODE)
        total += ratio
        for j in range(found.shape[0]):
            found[j] += ratio * rows[k, j]
    for j in range(found.shape[0]):
        found[j] /= total


@linked
def cut_patch(row_grid, grid, outs, edges, room):
    """Set the positions in the panel where an edge reaches an end of the piece, with 0 and 1; return their number."""
    cuts = room.cuts
    number = np.int64(1)
    cuts[0] = 0.0
    for side in range(2):
        for k in range(row_grid.nodes.shape[0]):
            room.edge_values[k] = value_at(float(side), grid, outs[k])
        count = find_crossings(row_grid, room.edge_values, edges, room)
        for k in range(count):
            cuts[number] = room.found[k]
            number += 1
    for k in range(1, number):
        here, m = cuts[k], k
        while m > 0 and cuts[m - 1] > here:
            cuts[m] = cuts[m - 1]
            m -= 1
        cuts[m] = here
    cuts[number] = 1.0
    return number + 1


@linked
def gauss_masses(rule, begin, end, panel, row_grid, grid, ends, outs, cells, room):
    """Compute the masses per position at Gauss's nodes on a part of the panel, times the weight of the measure.

    Returns the squared error of the rule, and the integral of the change by a shift of the outgoing angle.
    """
    low, high = panel
    samples, sizes, moved = room.samples, cells.sizes, 0.0
    samples[:, :] = 0.0
    for k in range(NUMBERS[rule]):
        s = begin + (end - begin) * GAUSS_NODES[rule, k]
        interpolate(s, row_grid, ends, room.ends)
        interpolate(s, row_grid, outs, room.values)
        change, _ = row_masses(room.ends, grid, room.values, cells, samples[k], room)
        # the density of the measure is sin(theta) / 2
        theta = low + (high - low) * s * s * (3.0 - 2.0 * s)
        weight = 3.0 * (high - low) * s * (1.0 - s) * math.sin(theta) * (end - begin)
        moved += GAUSS_WEIGHTS[rule, k] * weight * change
        for j in range(sizes.shape[0]):
            samples[k, j] *= weight
    fine, coarse = 0.0, 0.0
    for j in range(sizes.shape[0]):
        first, second = 0.0, 0.0
        for k in range(NUMBERS[rule]):
            first += FINE_NULL[rule, k] * samples[k, j]
            second += COARSE_NULL[rule, k] * samples[k, j]
        fine += (first * sizes[j]) ** 2
        coarse += (second * sizes[j]) ** 2
    return fine + coarse, moved


@linked
def patch_masses(panel, row_grid, grid, ends, outs, cells, goal, masses, room):
    """Add the integrals over a patch to ``masses``; return the squared error, and the change as in `gauss_masses`."""
    samples, stack = room.samples, room.stack
    squares, moved = 0.0, 0.0
    number = cut_patch(row_grid, grid, outs, cells.edges, room)
    for part in range(number - 1):
        if room.cuts[part + 1] - room.cuts[part] <= AT_NODE:
            continue
        depth = np.int64(1)
        stack[0, BEGIN], stack[0, END], stack[0, LEVEL] = room.cuts[part], room.cuts[part + 1], 0.0
        while depth > 0:
            depth -= 1
            begin, end, level = stack[depth, BEGIN], stack[depth, END], stack[depth, LEVEL]
            rule = 0 if level == 0.0 else 1
            error, change = gauss_masses(rule, begin, end, panel, row_grid, grid, ends, outs, cells, room)
            if error > goal * goal and level < MOST_DEPTH:
                # the second rule takes the whole part first
                middle = 0.5 * (begin + end) if rule == 1 else end
                if middle < end:
                    stack[depth, BEGIN], stack[depth, END], stack[depth, LEVEL] = middle, end, level + 1.0
                    depth += 1
                stack[depth, BEGIN], stack[depth, END], stack[depth, LEVEL] = begin, middle, level + 1.0
                depth += 1
            else:
                squares += error
                moved += change
                for j in range(masses.shape[0]):
                    for k in range(NUMBERS[rule]):
                        masses[j] += GAUSS_WEIGHTS[rule, k] * samples[k, j]
    return squares, moved


@compiled
def masses_of_patches(panels, row_grid, grid, strips, uncertainties, limits, goals, cells, found, room):
    """Add the integrals over patches to those of their panels, and their errors.

    ``panels`` are the lower and upper ends, and the measures of the panels; ``strips`` the ends, the outgoing angles
    and the panel of every patch; ``uncertainties`` the errors of the angles at single nodes, of the interpolated
    angles, and of the interpolated ends. A patch whose error is above the limit of its panel is not integrated: the
    masses at its nodes are added to ``rest``. ``found`` are ``rest``, the integrals and their squared errors, the
    errors of the means due to gaps, and the squared ones due to the outgoing angles at the nodes.
    """
    lows, highs, measures = panels
    rest, integrals, squares, errors, node_squares = found
    all_ends, all_outs, owners = strips
    at_nodes, between, of_ends = uncertainties
    middle = row_grid.nodes.shape[0] // 2
    for i in range(owners.shape[0]):
        p = owners[i]
        ends, outs = all_ends[i], all_outs[i]
        change, _ = row_masses(ends[middle], grid, outs[middle], cells, room.samples[0], room)
        first, last = sizes_at_ends(grid, outs[middle], cells)
        at_ends = of_ends[i] * (first + last)
        if (at_nodes[i] + between[i]) * change + at_ends <= limits[p]:
            panel = lows[p], highs[p]
            error, moved = patch_masses(panel, row_grid, grid, ends, outs, cells, goals[p], integrals[p], room)
            squares[p] += error + (between[i] * moved) ** 2 + (at_ends * measures[p]) ** 2
            for k in range(row_grid.nodes.shape[0]):
                first, last = sizes_at_ends(grid, outs[k], cells)
                errors[p, k] += (ends[k, LOW] - ends[k, START]) * first + (ends[k, STOP] - ends[k, HIGH]) * last
                node_squares[p, k] += (at_nodes[i] * moved / measures[p]) ** 2
        else:
            for k in range(row_grid.nodes.shape[0]):
                change, gaps = row_masses(ends[k], grid, outs[k], cells, rest[p, k], room)
                errors[p, k] += gaps
                node_squares[p, k] += (at_nodes[i] * change) ** 2
