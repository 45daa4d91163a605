r"""Integrals of the law of a rectangular crevice near grazing, over any number of its periods at a fixed cost.

With d = 2 r cot(theta) a crevice retroreflects with probability q = distance from d to the nearest even number: a
triangle wave in d. Near grazing d runs through arbitrarily many periods while everything else is smooth. The
integral over the period number k is then a smooth function F(k), and a sum of many values of a smooth function is
done by Gauss quadrature for sums: nodes and weights from the polynomials orthogonal on 0, 1, ..., N - 1 (Gram's, or
discrete Chebyshev polynomials), exact for degree 2 n - 1.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...core.checks import Floats
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.panels import Panels

# Periods nearer to theta = pi/2 than this value of d are listed one by one; it is even, so that a period starts there.
FIRST_CROSSING = 16
# Blocks of periods are uniform in arsinh(d / 2r) with this step. The integrand is singular at d = +-2 r i only, so a
# block's half length is a quarter of the distance to the singularities or less: the Bernstein ellipse has a parameter
# of at least 7.8, and n nodes miss 7.8^(-2n), 1e-18 for 10.
BLOCK, BLOCK_NODES = 0.5, 10
# Half a period is at most 1/64 of that distance: 5 nodes leave 128^(-10).
HALF_NODES = 5
# Polynomials of degree n in cos(theta) change by a factor exp(n w) over a width w: blocks of n w <= WIDEST need this
# many nodes more, and half a period, n w <= 1/2, one more.
WIDEST, MORE_BLOCK_NODES, MORE_HALF_NODES = 4.0, 4, 1
# Beyond some d the triangle wave is replaced by its mean. Its integral differs from that of the mean by at most a
# quarter of the integrand's largest value there (the antiderivative of q - 1/2 is below 1/8 in modulus, and a
# monotone factor g gives 2 g/8); d is chosen such that this is NEGLIGIBLE.
NEGLIGIBLE = 1e-23


def sum_rule(count: Floats, nodes: int) -> tuple[Floats, Floats]:
    """Nodes and weights for sums over 0, 1, ..., count - 1, one row a count, all counts at least ``nodes``.

    Source: the recurrence of the Gram polynomials, beta_j = j^2 (N^2 - j^2) / (4 (4 j^2 - 1)), and Golub-Welsch.

    Examples
    --------
    >>> import numpy as np
    >>> node, weight = sum_rule(np.array([10.0**9]), 3)
    >>> exact = (10**9 - 1) * 10**9 // 2
    >>> abs(float((weight * node).sum()) / exact - 1.0) < 1e-14
    True
    """
    count = np.asarray(count, dtype=np.float64)[:, None]
    degree = np.arange(1.0, nodes)
    # in units of the number of terms: numbers of order one, however many terms there are
    beta = degree**2 * (1.0 - (degree / count) ** 2) / (4.0 * (4.0 * degree**2 - 1.0))
    jacobi = np.zeros((count.shape[0], nodes, nodes))
    group = np.arange(nodes - 1)
    jacobi[:, group, group + 1] = jacobi[:, group + 1, group] = np.sqrt(beta)
    node, vector = np.linalg.eigh(jacobi)
    return 0.5 * (count - 1.0) + count * node, count * vector[:, 0, :] ** 2


def first_crossing(basis: Basis) -> int:
    """The d, an even number, up to which the periods of a crevice are to be listed one by one for this basis."""
    stiffness = _stiffness(basis)
    return max(FIRST_CROSSING, stiffness + stiffness % 2)


def _stiffness(basis: Basis) -> int:
    """The number of polynomials in cos(theta) on the whole of (0, pi) that the basis has."""
    return basis.size if isinstance(basis, Legendre) else basis.polynomials_besides


def crevice_nodes(
    height_to_width: float, basis: Basis, times: int | None = None
) -> tuple[Floats, Floats, Floats, float]:
    r"""Nodes for integrals of functions of the basis against the law of a crevice, for theta < pi/2 beyond the first
    periods.

    Parameters
    ----------
    height_to_width : float
        r.
    basis : Basis
    times : int, optional
        Instead of q the probability (1 + (q - 1)^times) / 2, that of rectangular teeth so many times.

    Returns
    -------
    theta, specular, retro : arrays
        Nodes in (0, arctan(2 r / first_crossing)), and the weights with which sums over the nodes give integrals of
        (1 - q) f and of q f, sin(theta)/2 d theta, for f a product of two functions of the basis at angles
        +-theta + const.
    omitted : float
        A bound of the measure that the replacement of q by its mean moves, for functions bounded by 1.
    """
    r, begin = height_to_width, float(first_crossing(basis))
    angles, extra_block, extra_half = _cells(basis)
    # sin(theta)^3 / (4 r) d d is the measure: (2 r)^2 / d^3 / 2 far out
    mean_from = max(np.cbrt(0.125 / NEGLIGIBLE * (4.0 * r) * r), 2.0 * begin)
    # the antiderivative of any probability less its mean is below 1/4 on half a period, that of q below 1/8
    omitted = min((0.25 if times is None else 0.5) * _density(np.array([mean_from]), r)[0], 1.0)
    inside = angles[angles < np.arctan2(2.0 * r, begin)]
    crossing = 2.0 * r / np.tan(inside[inside > np.arctan2(2.0 * r, mean_from)])
    scale = np.arange(np.arcsinh(begin / (2.0 * r)), np.arcsinh(mean_from / (2.0 * r)), BLOCK)[1:]
    cuts = np.concatenate([[begin, mean_from], crossing, 2.0 * r * np.sinh(scale)])
    cuts = np.unique(cuts[(cuts >= begin) & (cuts <= mean_from)])
    low, high = cuts[:-1], cuts[1:]
    first, last = np.ceil(0.5 * low), np.floor(0.5 * high)
    whole = last > first
    half_nodes = HALF_NODES + extra_half + (times or 0) // 2
    nodes = BLOCK_NODES + extra_block
    parts = [_periods(first[whole], last[whole], nodes, half_nodes)]
    # what is left of a period at either end of a block, each within one period
    left = np.minimum(2.0 * first, high)
    right = np.maximum(2.0 * last, left)
    parts.append(_pieces(np.concatenate([low, right]), np.concatenate([left, high]), half_nodes))
    at, weight, retro = (np.concatenate(column) for column in zip(*parts, strict=True))
    weight = weight * _density(at, r)
    theta = np.arctan2(2.0 * r, at)
    # the mean, up to grazing
    end = float(np.arctan2(2.0 * r, mean_from))
    edges = np.concatenate([[0.0], inside[inside < end], [end]])
    far, fraction = SINE.quadrature(np.unique(edges), max(basis.nodes_per_interval, nodes))
    mean = 0.5
    if times is not None:
        retro, mean = 0.5 * (1.0 + (retro - 1.0) ** times), 0.5 * (1.0 + (-1.0) ** times / (times + 1.0))
    angle = np.concatenate([theta, far])
    specular = np.concatenate([weight * (1.0 - retro), fraction * (1.0 - mean)])
    return angle, specular, np.concatenate([weight * retro, fraction * mean]), float(omitted)


def _cells(basis: Basis) -> tuple[Floats, int, int]:
    """Angles below pi/2 at which blocks are cut, and the nodes that the functions of the basis need in addition."""
    number = int(np.ceil(np.pi * _stiffness(basis) / WIDEST))
    regular = np.linspace(0.0, np.pi, number + 1)[1 : (number + 1) // 2]
    if isinstance(basis, Legendre):
        return regular, MORE_BLOCK_NODES, MORE_HALF_NODES
    both = np.unique(np.concatenate([regular, basis.edges, np.pi - basis.edges]))
    cells = both[(both > 0.0) & (both < 0.5 * np.pi)]
    first = basis.local_part
    extra = first.degree if isinstance(first, Panels) else 0 if first.is_partition else first.nodes_per_interval
    if number:
        return cells, extra + MORE_BLOCK_NODES, extra + MORE_HALF_NODES
    return cells, extra + MORE_BLOCK_NODES if extra else 0, extra


def _density(crossing: Floats, r: float) -> Floats:
    """sin(theta)/2 |d theta / d d|."""
    return np.asarray(np.sin(np.arctan2(2.0 * r, crossing)) ** 3 / (4.0 * r))


def _periods(first: Floats, last: Floats, nodes: int, half_nodes: int) -> tuple[Floats, Floats, Floats]:
    """Nodes d, weights and values of q for sums over the periods (2 k, 2 k + 2), first <= k < last."""
    count = last - first
    few = count < nodes
    index = np.repeat(np.nonzero(few)[0], count[few].astype(np.int64))
    inner = np.arange(index.size) - np.searchsorted(index, index)
    period = [first[index] + inner]
    weight = [np.ones(index.size)]
    if not few.all():
        node, fraction = _sum_rules(tuple(count[~few].tolist()), nodes)
        period.append((first[~few][:, None] + node).ravel())
        weight.append(fraction.ravel())
    start, number = 2.0 * np.concatenate(period), np.concatenate(weight)
    inside, gauss = gauss_on_intervals(np.array([0.0, 1.0]), np.array([1.0, 2.0]), half_nodes)
    retro = np.where(inside <= 1.0, inside, 2.0 - inside)
    shape = (start.size, inside.size)
    return (
        (start[:, None] + inside).ravel(),
        (number[:, None] * gauss).ravel(),
        np.broadcast_to(retro, shape).ravel(),
    )


@lru_cache(maxsize=16)
def _sum_rules(count: tuple[float, ...], nodes: int) -> tuple[Floats, Floats]:
    different, group = np.unique(np.array(count), return_inverse=True)
    node, weight = sum_rule(different, nodes)
    return node[group], weight[group]


def _pieces(low: Floats, high: Floats, nodes: int) -> tuple[Floats, Floats, Floats]:
    """Nodes d, weights and values of q on intervals within one period each."""
    middle = 2.0 * np.floor(0.25 * (low + high)) + 1.0
    left = low, np.minimum(high, middle)
    right = np.maximum(low, middle), high
    low, high = (np.concatenate(pair) for pair in zip(left, right, strict=True))
    centre = np.concatenate([middle, middle])
    proper = high > low
    low, high, centre = low[proper], high[proper], centre[proper]
    # distances from the middle of the period are exact, also where d itself is only known to a few digits
    inside, weight = gauss_on_intervals(np.zeros(low.size), high - low, nodes)
    offset = np.repeat(low - centre, nodes) + inside
    return np.repeat(centre, nodes) + offset, weight, np.clip(1.0 - np.abs(offset), 0.0, 1.0)
