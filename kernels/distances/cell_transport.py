"""Bounds of W_p between measures on a square of cells, from the masses, means and covariances of their cells.

A plan between cells bounds the distance from above, a potential that is affine on each cell from below: both hold for
all measures with these moments. Of far more cells than plans allow, W_1 is bounded by flows of mass from cell to cell,
and by the integral of a potential with slopes of at most 1 (Beckmann's and Kantorovich's problems, of one value).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...core.long_runs import slices
from ...core.rounding import EPS

# Largest distance on the square, the unit of length here, so that powers neither overflow nor exceed 1.
DIAGONAL = float(np.hypot(np.pi, np.pi))
MOST_PIVOTS = 10**8
# Cells of smaller mass, mostly rounding, count as empty, and their mass as moved along the diagonal.
NO_MASS = 1e-13
# The solver stops at reduced costs of 10 eps times the largest cost; the rest is for the rounding of its sums.
SOLVER_ROUNDING = 64.0 * EPS
# A cell whose mass deviates from a line, or from a point, by less than this fraction of its radius in the root of the
# mean square counts as one there, and the deviation is paid for.
FLAT = 0.05
# Slopes of potentials are fitted to windows of so many cells. Pairs of cells nearer than this many radii choose among
# three tangents of the cost; for others that at their means is nearly the best.
WINDOW, NEAR = 3, 8.0
UNEVEN = 4
PAIRS_AT_ONCE = 2**18


@dataclass(frozen=True)
class Cells:
    """The occupied cells of a measure on the square, with all lengths in `DIAGONAL`.

    Attributes
    ----------
    size : int
        Cells along a side.
    place, mass, mean, spread : ndarray
        Row and column, shape (2, cells); mass; mean, (cells, 2); covariances xx, xy, yy, (3, cells).
    low, high, radius : ndarray
        Corners of each cell from its mean, (cells, 2), and the largest distance from it.
    along, length, line : ndarray
        Directions and half lengths of cells that count as lines, and which cells do so.
    deviation, dropped : float
        The mean distance, times the mass, of the points from the lines and points for which cells count, and the mass
        of cells that count as empty.
    """

    size: int
    place: NDArray[np.intp]
    mass: Floats
    mean: Floats
    spread: Floats
    low: Floats
    high: Floats
    radius: Floats
    along: Floats
    length: Floats
    line: NDArray[np.bool_]
    deviation: float
    dropped: float

    @staticmethod
    def of(edges: Floats, moments: Floats) -> Cells:
        """From the integrals of x^k y^l over n x n cells, shape (n, 3, n, 3), x and y from the middles of cells."""
        masses, half = moments[:, 0, :, 0], 0.5 * np.diff(edges) / DIAGONAL
        place = np.stack(np.nonzero(masses > NO_MASS))
        mass, (wide, tall) = masses[tuple(place)], half[place]
        x, y, xx, xy, yy = (
            moments[place[0], k, place[1], m] / mass for k, m in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        )
        x, y = np.clip(x, -wide, wide), np.clip(y, -tall, tall)
        xx, yy = np.clip(xx - x * x, 0.0, wide**2), np.clip(yy - y * y, 0.0, tall**2)
        most = np.sqrt(xx * yy)
        xy = np.clip(xy - x * y, -most, most)
        shift, corner = np.stack((x, y), axis=-1), half[place.T]
        low, high = -corner - shift, corner - shift
        reach = np.maximum(-low, high)
        radius, angle = np.hypot(*reach.T), 0.5 * np.arctan2(2.0 * xy, xx - yy)
        along = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
        centre, spread = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        longer, shorter = np.sqrt(centre + spread), np.sqrt(np.maximum(centre - spread, 0.0))
        line, point = shorter < FLAT * radius, longer < FLAT * radius
        length = np.where(point, 0.0, (reach * np.abs(along)).sum(axis=-1))
        deviation = float(mass @ (np.where(line, shorter, 0.0) + np.where(point, longer, 0.0)))
        mean, dropped = 0.5 * (edges[:-1] + edges[1:])[place.T] / DIAGONAL + shift, np.abs(masses[masses <= NO_MASS])
        covariance, size = np.stack((xx, xy, yy)), half.size
        return Cells(
            size, place, mass, mean, covariance, low, high, radius, along, length, line, deviation, float(dropped.sum())
        )

    def support(self, cell: NDArray[np.intp], slope: Floats) -> Floats:
        """The largest values of linear functions of the points of cells, less those at the means."""
        box = np.maximum(self.low[cell] * slope, self.high[cell] * slope).sum(axis=-1)
        flat = np.abs((self.along[cell] * slope).sum(axis=-1)) * self.length[cell]
        return np.asarray(np.where(self.line[cell], flat, box))

    def slopes(self, values: Floats, steepest: float) -> Floats:
        """Gradients of planes fitted to values at the means in a window around each cell, shape (cells, 2)."""
        from scipy.ndimage import uniform_filter

        def mean(given: Floats) -> Floats:
            table = np.zeros((self.size, self.size))
            table[tuple(self.place)] = given
            return np.asarray(uniform_filter(table, WINDOW, mode="constant")[tuple(self.place)])

        count = mean(np.ones(values.size))
        x, y, f = sides = (*self.mean.T, values)
        mx, my, mf = (mean(side) / count for side in sides)
        xx, xy, yy, xf, yf = (
            mean(a * b) / count - c * d
            for a, b, c, d in ((x, x, mx, mx), (x, y, mx, my), (y, y, my, my), (x, f, mx, mf), (y, f, my, mf))
        )
        xx, yy = xx + FLAT * EPS**0.5, yy + FLAT * EPS**0.5
        found = np.stack((yy * xf - xy * yf, xx * yf - xy * xf), axis=-1) / (xx * yy - xy * xy)[:, None]
        return np.asarray(found / np.maximum(np.hypot(*found.T) / steepest, 1.0)[:, None])


def transport_bounds(one: Cells, other: Cells, order: float) -> tuple[float, float]:
    """Bounds of W_p^p between measures of equal mass, in the unit `DIAGONAL`.

    Examples
    --------
    >>> masses = np.zeros((2, 2, 3, 2, 3))
    >>> masses[0, 0, 0, 0, 0] = masses[1, 0, 0, 1, 0] = 1.0
    >>> low, high = transport_bounds(*(Cells.of(np.array([0.0, 1.0, 2.0]), part) for part in masses), 1.0)
    >>> round(low * DIAGONAL, 12), round(high * DIAGONAL, 12)
    (1.0, 1.0)
    """
    dropped = one.dropped + other.dropped
    if not (one.mass.size and other.mass.size):
        return 0.0, dropped + float(one.mass.sum() + other.mass.sum())
    left, right, staying = one.mass.copy(), other.mass.copy(), 0.0
    if order == 1.0:  # common mass may stay
        number = (part.place[0] * part.size + part.place[1] for part in (one, other))
        _, i, j = np.intersect1d(*number, return_indices=True)
        common = np.minimum(left[i], right[j])
        staying = float(common @ _costs(one, other, i, j, order))
        left[i] -= common
        right[j] -= common
    rest = [np.flatnonzero(part > NO_MASS) for part in (left, right)]
    lacking = (
        dropped
        + abs(float(left.sum() - right.sum()))
        + sum(float(part.sum() - part[some].sum()) for part, some in zip((left, right), rest, strict=True))
    )
    if not (rest[0].size and rest[1].size):
        return 0.0, staying + lacking
    plan, above, below = _solved(_powers(one.mean[rest[0]], other.mean[rest[1]], order), left[rest[0]], right[rest[1]])
    i, j = np.nonzero(plan)
    upper = staying + lacking + float(plan[i, j] @ _costs(one, other, rest[0][i], rest[1][j], order))
    # each of the sums may lack mass, and reduced costs are zero to rounding
    if not (one.spread.any() or other.spread.any()):
        return max(upper - 2.0 * lacking - SOLVER_ROUNDING * float(left.sum()), 0.0), upper
    if order == 1.0:
        # both ends of the potentials that the plan allows: the middle is smoother
        sides = (one.mean[rest[0]], above), (other.mean[rest[1]], below)
        values = [_middle(part.mean, *sides) for part in (one, other)]
    else:
        values = [above, below]
    slopes = [part.slopes(value, order) for part, value in zip((one, other), values, strict=True)]
    cost = _least_costs(one, other, slopes, order)
    found = float(np.sum(_solved(cost, one.mass, other.mass)[0] * cost))
    # slopes differ by twice the steepest at most
    unsure = 2.0 * order * (one.deviation + other.deviation) + 2.0 * lacking
    unsure += SOLVER_ROUNDING * float(one.mass.sum() * np.abs(cost).max())
    return min(max(found - unsure, 0.0), upper), upper


def _solved(cost: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats, Floats]:
    """The best plan between masses, and potentials f and g with f_i - g_j at most the costs."""
    import ot

    log: dict[str, Any]
    plan, log = ot.emd(first / first.sum(), second / second.sum(), cost, numItermax=MOST_PIVOTS, log=True)
    if log["warning"]:
        raise AccuracyError(f"optimal transport: {log['warning']}", float("nan"))
    return np.asarray(min(first.sum(), second.sum()) * plan), log["u"], -log["v"]


def _powers(first: Floats, second: Floats, order: float) -> Floats:
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(first, second) ** order)


def _middle(points: Floats, above: tuple[Floats, Floats], below: tuple[Floats, Floats]) -> Floats:
    """The mean of the largest and the smallest 1-Lipschitz function through values below and above.

    One of them is enough if the other has far more values.
    """
    found = []
    if below[1].size <= UNEVEN * above[1].size:
        found.append((_powers(points, below[0], 1.0) + below[1]).min(axis=1))
    if above[1].size <= UNEVEN * below[1].size:
        found.append((above[1] - _powers(points, above[0], 1.0)).max(axis=1))
    return np.asarray(np.mean(found, axis=0))


def _costs(one: Cells, other: Cells, i: NDArray[np.intp], j: NDArray[np.intp], order: float) -> Floats:
    r"""Bounds of E|Z|^p for the difference Z of independent points of pairs of cells.

    Let d be the length of its mean and v the sum of its variances. For p up to 2, E|Z|^p <= (d^2 + v)^(p/2), and for
    p = 1, if the component a along the mean is at least s > 0, also |Z| <= a + b^2 / (2 s) with the component b across.
    For larger p the second derivatives of |z|^p are at most p (p - 1) |z|^(p-2).
    """
    shift, reach = one.mean[i] - other.mean[j], one.radius[i] + other.radius[j]
    length = np.hypot(*shift.T)
    xx, xy, yy = one.spread[:, i] + other.spread[:, j]
    if order > 2.0:
        bent = length**order + 0.5 * order * (order - 1.0) * (length + reach) ** (order - 2.0) * (xx + yy)
        return np.asarray(np.minimum(bent, (length + reach) ** order))
    bound = (length**2 + xx + yy) ** (0.5 * order)
    if order == 1.0:
        x, y = np.divide(shift.T, length, out=np.zeros_like(shift.T), where=length > 0.0)
        across, least = np.maximum(y * y * xx - 2.0 * x * y * xy + x * x * yy, 0.0), length - reach
        more = np.divide(0.5 * across, least, out=np.full_like(length, np.inf), where=least > 0.0)
        bound = np.minimum(bound, length + more)
    return np.asarray(bound)


def _least_costs(one: Cells, other: Cells, slopes: list[Floats], order: float) -> Floats:
    r"""Costs c_ij such that f_i - g_j <= c_ij makes affine functions of these slopes potentials of abs(x - y)^p.

    With any t, abs(z)^p >= t z - (p - 1) (abs(t) / p)^(p / (p - 1)). So c_ij is the value of this at the difference of
    the means, less the largest values of (slope_i - t) x in the one cell and of (t - slope_j) y in the other.
    """
    rows, columns = np.arange(one.mass.size)[:, None], np.arange(other.mass.size)

    def bound(i: NDArray[np.intp], j: NDArray[np.intp], chosen: Callable[[Floats, Floats], Floats]) -> Floats:
        shift = one.mean[i] - other.mean[j]
        length = np.hypot(shift[..., 0], shift[..., 1])
        tangent = chosen(shift, length)
        size = np.hypot(tangent[..., 0], tangent[..., 1]) / order
        value = (tangent * shift).sum(axis=-1)
        if order > 1.0:
            value -= (order - 1.0) * size ** (order / (order - 1.0))
        return np.asarray(value - one.support(i, slopes[0][i] - tangent) - other.support(j, tangent - slopes[1][j]))

    def at_means(shift: Floats, length: Floats) -> Floats:
        unit = np.divide(shift, length[..., None], out=np.zeros_like(shift), where=length[..., None] > 0.0)
        return order * length[..., None] ** (order - 1.0) * unit

    found = np.empty((one.mass.size, other.mass.size))
    step = max(1, PAIRS_AT_ONCE // other.mass.size)
    for some in (rows[part] for part in slices(one.mass.size, step)):
        found[some[:, 0]] = bound(some, columns, at_means)
    reach = NEAR * (one.radius[:, None] + other.radius)
    near = np.nonzero(_powers(one.mean, other.mean, 1.0) < reach)
    for part in slices(near[0].size, PAIRS_AT_ONCE):
        i, j = near[0][part], near[1][part]
        for slope in (slopes[0][i], slopes[1][j]):
            found[i, j] = np.maximum(found[i, j], bound(i, j, lambda *_, slope=slope: slope))
    return found


# Mean distance of the points of a unit square from a corner, and its diagonal: the most that mass of a cell moves on
# the way to a uniform density, and to other mass of the cell.
TO_UNIFORM, WITHIN = (math.sqrt(2.0) + math.asinh(1.0)) / 3.0, math.sqrt(2.0)
# Steps towards the best potential, how often its value is taken, and the ratio of both step lengths, of the size of a
# potential to that of a flow.
STEPS, TAKEN_EVERY, RATIO = 200, 20, 4.0
# Nodes along a side of the coarsest cells.
COARSEST = 5
# (Largest singular value of the gradients at corners, in the inverse of a cell's side)^2.
LARGEST = 32.0
CORNERS = [(i, j) for i in (0, 1) for j in (0, 1)]


def flow_cost(one: Floats, other: Floats, side: float) -> float:
    """An upper bound of W_1 between measures of which the masses of square cells are known, shape (n, n) each.

    Mass in common stays within its cell. The rest is first spread over its cell, and then flows down the gradient of
    the solution u of a discrete Poisson equation. Inside a cell each component of this flow is linear in its own
    direction, so that the mean of its length is at most that at the four corners.

    Examples
    --------
    >>> one = np.array([[0.5, 0.5], [0.0, 0.0]])
    >>> round(flow_cost(one, one[::-1], 1.0) - 2.0 * TO_UNIFORM, 12)
    1.0
    """
    from scipy.fft import dctn, idctn

    common = float(np.minimum(one, other).sum())
    difference = one - other
    wave = 2.0 - 2.0 * np.cos(np.pi / len(one) * np.arange(len(one)))
    eigenvalue = wave[:, None] + wave
    eigenvalue[0, 0] = np.inf
    u = idctn(dctn(difference) / eigenvalue)
    across, along = (np.zeros(np.add(u.shape, shape)) for shape in ((1, 0), (0, 1)))
    across[1:-1], along[:, 1:-1] = -np.diff(u, axis=0), -np.diff(u, axis=1)
    length = sum(float(np.hypot(across[i : len(u) + i], along[:, j : len(u) + j]).sum()) for i, j in CORNERS)
    return side * (0.25 * length + WITHIN * common + TO_UNIFORM * float(np.abs(difference).sum()))


def potential_value(moments: Floats, side: float) -> float:
    """A lower bound of W_1 from the difference of the moments of two measures on square cells, shape (n, 3, n, 3).

    The moments are integrals of x^k y^l, from the middles of the cells and in their sides. The potential is bilinear on
    each cell, so that its integral is known, and its slope is largest at a corner. It is found by the primal-dual
    method of Chambolle and Pock (2011), on coarse cells first, and divided by its largest slope.

    Examples
    --------
    >>> moments = np.zeros((2, 3, 2, 3))
    >>> moments[:, 0, 0, 0] = 1.0, -1.0
    >>> round(potential_value(moments, 1.0), 6)
    1.0
    """
    size = len(moments)
    load = np.zeros((size + 1, size + 1))
    for i, j in CORNERS:
        x, y = i - 0.5, j - 0.5
        # the function of a corner is (1/2 + x' x)(1/2 + y' y), with x' and y' = +-1
        part = 0.25 * moments[:, 0, :, 0] + x * moments[:, 1, :, 0] + y * moments[:, 0, :, 1]
        load[i : size + i, j : size + j] += part + 4.0 * x * y * moments[:, 1, :, 1]
    loads = [load]
    while len(loads[-1]) % 2 and len(loads[-1]) > COARSEST:
        loads.append(_halved(_halved(loads[-1]).T).T)
    size = len(loads[-1]) - 1
    best, potential, flow = 0.0, np.zeros((size + 1, size + 1)), np.zeros((2, 2, 2, size, size))
    for level, load in reversed(list(enumerate(loads))):
        value, potential, flow = _climbed(load, potential, flow)
        best = max(best, 2.0**level * value)
        # in cells of half the side slopes stay, and half of the flow passes through each
        potential, flow = 2.0 * _doubled(_doubled(potential).T).T, 0.5 * flow.repeat(2, axis=3).repeat(2, axis=4)
    return side * best


def _climbed(load: Floats, potential: Floats, flow: Floats) -> tuple[float, Floats, Floats]:
    """The largest integral of a potential of slope 1 on the way from a first one, and the last potential and flow."""
    size, norm = len(load) - 1, float(np.linalg.norm(load))
    if not norm:
        return 0.0, potential, flow
    rising, falling = LARGEST**-0.5 * RATIO / norm, LARGEST**-0.5 / RATIO * norm
    ahead, best = potential, 0.0
    for number in range(STEPS + 1):
        if number % TAKEN_EVERY == 0:
            steepest = max(float(np.hypot(*slope).max()) for _, slope in _slopes(potential))
            best = max(best, float(np.sum(load * potential)) / max(steepest, 1e-300))
        divergence = np.zeros_like(load)
        for (i, j), slope in _slopes(ahead):
            found = flow[i, j] + falling * slope
            flow[i, j] = x, y = found * np.maximum(1.0 - falling / np.maximum(np.hypot(*found), 1e-300), 0.0)
            divergence[1:, j : size + j] += x
            divergence[:-1, j : size + j] -= x
            divergence[i : size + i, 1:] += y
            divergence[i : size + i, :-1] -= y
        before, potential = potential, potential - rising * (divergence - load)
        ahead = 2.0 * potential - before
    return best, potential, flow


def _slopes(potential: Floats) -> Iterator[tuple[tuple[int, int], Floats]]:
    """The gradients at the four corners of the cells, shape (2, n, n) each."""
    x, y, size = np.diff(potential, axis=0), np.diff(potential, axis=1), len(potential) - 1
    for i, j in CORNERS:
        yield (i, j), np.stack((x[:, j : size + j], y[i : size + i]))


def _doubled(values: Floats) -> Floats:
    """Values at nodes with their means between, along the first axis."""
    found = np.repeat(values, 2, axis=0)[:-1]
    found[1::2] = 0.5 * (values[:-1] + values[1:])
    return found


def _halved(values: Floats) -> Floats:
    """The adjoint of `_doubled`."""
    found = values[::2].copy()
    found[:-1] += 0.5 * values[1::2]
    found[1:] += 0.5 * values[1::2]
    return found
