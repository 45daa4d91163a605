"""The law of rectangular teeth, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, positive_number
from ..bases.angles import mirrored_angle
from ..bases.basis import Basis
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.partitions import Panels
from ..laws.isometry_table import IsometryTable, crevice_breakpoints, crevice_retro, crossings_modulo_two
from ..laws.law import BranchLaw, entries

LARGEST_COUNT = 2.0**62


@dataclass(frozen=True)
class RectangularTeethLaw(BranchLaw):
    r"""The law of rectangular teeth in closed form: flat top on the first half of the period, crevice on the second.

    A ray crosses d = 2 r abs(cot theta) crevice widths on its way down and up. Specular reflection has probability
    1 - {d}/2 if floor(d) is even and 1/2 + {d}/2 if it is odd, which is
    1 - (distance from d to the nearest even number)/2. All other rays are retroreflected.

    Parameters
    ----------
    height_to_width : float
        r > 0, depth of the crevice over its width.

    Raises
    ------
    InputError
        If ``height_to_width`` is not a finite number above 0.

    Notes
    -----
    The probabilities are those of the given float64 angle, to rounding, for any number of crossings. Where d is large
    they change completely from one float64 to the next: for an angle that is not exact to its last digit, use the mean
    over a period of d, where specular reflection has probability 3/4.

    Source: Rudzis 2022, section 2.2.1, corrected (the even and odd cases are swapped in print).

    Examples
    --------
    >>> law = RectangularTeethLaw(0.5)
    >>> probability, outgoing = law.branches(np.pi / 4)      # d = 1: half of the wall, all of the crevice
    >>> probability.round(15)
    array([0.5, 0.5])
    >>> law
    RectangularTeethLaw(height_to_width=0.5)
    """

    height_to_width: float

    mirror_symmetric = True
    keeps_sine = True

    def __post_init__(self) -> None:
        self._set(height_to_width=positive_number("height_to_width", self.height_to_width))

    def crossings(self, theta: ArrayLike) -> Floats:
        """The number of crevice widths crossed between entry and exit, d = 2 r abs(cot theta)."""
        with np.errstate(over="ignore"):
            return np.asarray(2.0 * self.height_to_width / np.abs(np.tan(angles("theta", theta))))

    def _branches(self, theta: Floats) -> tuple[Floats, Floats]:
        """Probabilities and angles, shape ``theta.shape + (2,)``: specular first, then retroreflection."""
        retro = 0.5 * crevice_retro(self.height_to_width, theta)
        return np.stack([1.0 - retro, retro], axis=-1), np.stack([mirrored_angle(theta), theta], axis=-1)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles cot theta = +-k / (2 r), where d is a whole number, and the probability beyond the last one."""
        return crevice_breakpoints(self.height_to_width, limit)

    def isometry_table(self) -> IsometryTable:
        """The table of flat tops and crevices, each half of the period."""
        return IsometryTable.joined([IsometryTable.flat(0.5), IsometryTable.of_crevice(0.5, self.height_to_width)])

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle of the ray that enters at ``x`` in (0, 1), measured from the left end of the flat top."""
        x, theta = entries(x, theta)
        sides = _sides_hit(x, theta, crossings_modulo_two(self.height_to_width, theta))
        return np.where(np.mod(sides, 2.0) == 0.0, mirrored_angle(theta), theta)

    def hits(self, x: ArrayLike, theta: ArrayLike) -> NDArray[np.int64]:
        """Number of reflections, at most about 2^62; a hit of the flat top counts as one.

        The parity is always right. Beyond 2^52 the number has the rounding error of float64.
        """
        x, theta = entries(x, theta)
        rest = crossings_modulo_two(self.height_to_width, theta)
        # counted in pairs, so that the parity is right where d has more digits than a float64
        pairs = np.rint(0.5 * (np.minimum(self.crossings(theta), LARGEST_COUNT) - rest)).astype(np.int64)
        sides = 2 * pairs + _sides_hit(x, theta, rest).astype(np.int64)
        return np.asarray(1 + np.where(x <= 0.5, 0, sides))


def _sides_hit(x: Floats, theta: Floats, crossings: Floats) -> Floats:
    # Distance, in crevice widths, from the entry point to the side that the ray moves towards.
    ahead = np.where(theta < 0.5 * np.pi, 2.0 * x - 1.0, 2.0 - 2.0 * x)
    return np.where(x <= 0.5, 0.0, np.maximum(np.ceil(crossings - ahead), 0.0))


def crevice_pieces(height_to_width: float, last: int) -> IsometryTable:
    """The table of a crevice restricted to d < ``last``; its opening counts as the whole period."""
    number = np.arange(last)
    high = np.arctan2(2.0 * height_to_width, number)
    low = np.arctan2(2.0 * height_to_width, number + 1)
    # at a whole number d = k the outcome is certain: retroreflection for odd k, specular reflection for even k
    start, end = (np.where(at % 2 == 1, np.sin(angle), 0.0) for at, angle in ((number + 1, low), (number, high)))
    one, zero = np.ones(last), np.zeros(last)
    other = np.sin(low) - start, np.sin(high) - end
    right = IsometryTable(
        np.concatenate([one, -one]),
        np.concatenate([zero, np.pi * one]),
        np.concatenate([low, low]),
        np.concatenate([high, high]),
        np.concatenate([start, other[0]]),
        np.concatenate([end, other[1]]),
    )
    return IsometryTable.joined([right, right.mirrored()])


# Periods with d below this value are listed one by one. The value is even, so a period starts there.
FIRST_CROSSING = 16
# Blocks of periods are uniform in arsinh(d / 2r) with this step. The integrand is singular at d = +-2 r i only, so a
# block's half length is at most a quarter of the distance to the singularities. The Bernstein ellipse has a parameter
# of at least 7.8; the error of n nodes is 7.8^(-2n), 1e-18 for n = 10.
BLOCK, BLOCK_NODES = 0.5, 10
# Half a period is at most 1/64 of the distance to the singularities: the error of 5 nodes is 128^(-10).
HALF_NODES = 5
# A polynomial of degree n in cos(theta) changes by a factor exp(n w) over a width w. Blocks with n w <= WIDEST need 4
# additional nodes; half a period, with n w <= 1/2, needs one.
WIDEST, MORE_BLOCK_NODES, MORE_HALF_NODES = 4.0, 4, 1
# Beyond some d the triangle wave q is replaced by its mean. The integral changes by at most NEGLIGIBLE, a quarter of
# the integrand's largest value there, because the antiderivative of q - 1/2 is below 1/8 in modulus.
NEGLIGIBLE = 1e-23


def sum_rule(count: Floats, nodes: int) -> tuple[Floats, Floats]:
    """Gauss nodes and weights for sums over 0, 1, ..., count - 1, one row per count; all counts are >= ``nodes``.

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
    # in units of the number of terms, so that the matrix entries are of order one
    beta = degree**2 * (1.0 - (degree / count) ** 2) / (4.0 * (4.0 * degree**2 - 1.0))
    jacobi = np.zeros((count.shape[0], nodes, nodes))
    group = np.arange(nodes - 1)
    jacobi[:, group, group + 1] = jacobi[:, group + 1, group] = np.sqrt(beta)
    node, vector = np.linalg.eigh(jacobi)
    return 0.5 * (count - 1.0) + count * node, count * vector[:, 0, :] ** 2


def first_crossing(basis: Basis) -> int:
    """The even number d up to which the periods of a crevice are listed one by one for this basis."""
    return max(FIRST_CROSSING, basis.size + basis.size % 2) if basis.is_polynomial else FIRST_CROSSING


def crevice_nodes(height_to_width: float, basis: Basis) -> tuple[Floats, Floats, Floats, float]:
    r"""Nodes and weights for integrals over the law of a crevice, for theta < pi/2 beyond the first periods.

    Parameters
    ----------
    height_to_width : float
        r, depth over width.
    basis : Basis

    Returns
    -------
    theta, specular, retro : arrays
        Nodes in (0, arctan(2 r / first_crossing)), and weights for the integrals of (1 - q) f and of q f with
        respect to sin(theta)/2 d theta, where f is a product of two basis functions at angles +-theta + const.
    omitted : float
        A bound of the error from replacing q by its mean, for functions bounded by 1.
    """
    r, begin = height_to_width, float(first_crossing(basis))
    angles, extra_block, extra_half = _cells(basis)
    # the measure is sin(theta)^3 / (4 r) d d, for large d (2 r)^2 / d^3 / 2
    mean_from = max(np.cbrt(0.125 / NEGLIGIBLE * (4.0 * r) * r), 2.0 * begin)
    # the antiderivative of q minus its mean is below 1/8 on half a period
    omitted = min(0.25 * _density(np.array([mean_from]), r)[0], 1.0)
    inside = angles[angles < np.arctan2(2.0 * r, begin)]
    crossing = 2.0 * r / np.tan(inside[inside > np.arctan2(2.0 * r, mean_from)])
    scale = np.arange(np.arcsinh(begin / (2.0 * r)), np.arcsinh(mean_from / (2.0 * r)), BLOCK)[1:]
    cuts = np.concatenate([[begin, mean_from], crossing, 2.0 * r * np.sinh(scale)])
    cuts = np.unique(cuts[(cuts >= begin) & (cuts <= mean_from)])
    low, high = cuts[:-1], cuts[1:]
    first, last = np.ceil(0.5 * low), np.floor(0.5 * high)
    whole = last > first
    half_nodes = HALF_NODES + extra_half
    nodes = BLOCK_NODES + extra_block
    parts = [_periods(first[whole], last[whole], nodes, half_nodes)]
    # the partial periods at both ends of a block
    left = np.minimum(2.0 * first, high)
    right = np.maximum(2.0 * last, left)
    parts.append(_pieces(np.concatenate([low, right]), np.concatenate([left, high]), half_nodes))
    at, weight, retro = (np.concatenate(column) for column in zip(*parts, strict=True))
    weight = weight * _density(at, r)
    theta = np.arctan2(2.0 * r, at)
    # the mean of q, up to grazing
    end = float(np.arctan2(2.0 * r, mean_from))
    edges = np.concatenate([[0.0], inside[inside < end], [end]])
    far, fraction = SINE.quadrature(np.unique(edges), max(basis.nodes_per_interval, nodes))
    angle = np.concatenate([theta, far])
    specular = np.concatenate([weight * (1.0 - retro), fraction * 0.5])
    return angle, specular, np.concatenate([weight * retro, fraction * 0.5]), float(omitted)


def _cells(basis: Basis) -> tuple[Floats, int, int]:
    """Angles below pi/2 at which blocks are cut, and the additional nodes for blocks and half periods."""
    if basis.is_polynomial:
        number = int(np.ceil(np.pi * basis.size / WIDEST))
        return np.linspace(0.0, np.pi, number + 1)[1 : (number + 1) // 2], MORE_BLOCK_NODES, MORE_HALF_NODES
    both = np.unique(np.concatenate([basis.edges, np.pi - basis.edges]))
    cells = both[(both > 0.0) & (both < 0.5 * np.pi)]
    extra = basis.degree if isinstance(basis, Panels) else 0 if basis.is_partition else basis.nodes_per_interval
    return cells, extra + MORE_BLOCK_NODES if extra else 0, extra


def _density(crossing: Floats, r: float) -> Floats:
    """sin(theta)/2 |d theta / d d|."""
    return np.asarray(np.sin(np.arctan2(2.0 * r, crossing)) ** 3 / (4.0 * r))


def _periods(first: Floats, last: Floats, nodes: int, half_nodes: int) -> tuple[Floats, Floats, Floats]:
    """Nodes d, weights and values of q for the periods (2 k, 2 k + 2), first <= k < last."""
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
    # distances from the middle of the period are exact, also where d itself has only a few digits
    inside, weight = gauss_on_intervals(np.zeros(low.size), high - low, nodes)
    offset = np.repeat(low - centre, nodes) + inside
    return np.repeat(centre, nodes) + offset, weight, np.clip(1.0 - np.abs(offset), 0.0, 1.0)
