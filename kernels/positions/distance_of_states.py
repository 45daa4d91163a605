"""The paper's pseudometric with test functions of the position and of the angle, for laws and for traced walls."""

from __future__ import annotations

import math

import numpy as np

from ...core.checks import Floats, Rng, generator, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, student_95
from ...geometry import Wall
from ..bases.measure import SINE
from ..bases.polynomials import Legendre
from ..discretisation.discretisation import discretise
from ..distances.distances import flux_means
from .position_law import PositionLaw

# Means of products of four cosines of orders up to this one at most are compared; the rest is less than 1.3e-4.
MOST_ORDERS = 17
# Independent sequences of rays.
REPETITIONS = 8


def position_distance(
    first: PositionLaw | Wall, second: PositionLaw | Wall, tolerance: float = 1e-2, *, rays: int = 2**12, rng: Rng = 0
) -> Estimate:
    r"""The pseudometric of laws of states (x, theta) -> (x', theta'), with test functions of all four variables.

    Parameters
    ----------
    first, second : PositionLaw or Wall
        On pieces of the same length. A wall stands for its deterministic law of rays that enter at x in (0, period),
        such as `geometry.join_walls`; for a PositionLaw x' = x.
    tolerance : float
        Wanted size of the omitted rest of the sum, at least 1e-3.
    rays : int
        Rays of one repetition for a wall, rounded up to a power of two; there are 8 repetitions.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Estimate
        Zero if and only if the laws are equal for almost every state. The value is a mean of absolute values: below its
        error it is sampling noise. The error is the sum of those of the means and of the rest.

    Raises
    ------
    InputError
        If the pieces have different lengths, or a number is out of range.

    Notes
    -----
    The sum over j, k, l, m >= 0 of 2^(-j - k - l - m - 4) times the absolute difference of the means of
    cos(j pi s) cos(k theta) cos(l theta') cos(m pi s'), with s = x/length, under dx sin(theta)/2 d theta. Displacements
    beyond the piece are reflected by the cosine. The products span a dense subspace of the continuous functions, so the
    distance tends to 0 exactly if the laws converge weakly: Theorem 1.7 of the paper measured.

    Source: Rudzis 2022, remarks 1.4 to 1.6, section 6.2.3 (corrected: f(y, x) G(y, dx) nu(dy)).

    Examples
    --------
    Exchanging both halves of a wall does not alter the mean law, only the law of states:

    >>> from asperity import kernels as ker
    >>> halves = ker.PositionLaw([0, 1, 2], [ker.specular(), ker.retroreflection()])
    >>> other = ker.PositionLaw([0, 1, 2], [ker.retroreflection(), ker.specular()])
    >>> round(float(ker.distance(halves.mean(), other.mean(), kind="pseudometric")), 9)
    0.0
    >>> float(ker.position_distance(halves, other)) > 0.01
    True
    """
    # cosines of each variable for which the rest is below the tolerance
    orders = min(max(math.ceil(math.log2(8.0 / positive_number("tolerance", tolerance))), 2), MOST_ORDERS)
    power = math.ceil(math.log2(whole_number("rays", rays, 1)))
    source = generator(rng)
    spans = [_span(one) for one in (first, second)]
    if abs(spans[0] - spans[1]) > 1e-9 * max(spans):
        raise InputError(f"second: expected a piece of length {spans[0]:g}, got one of {spans[1]:g}")
    tables, errors = zip(*(_means(one, orders, power, source) for one in (first, second)), strict=True)
    weight = 0.5 ** (np.arange(orders) + 1.0)
    joint = np.multiply.outer(np.multiply.outer(weight, weight), np.multiply.outer(weight, weight))
    value = float(np.sum(joint * np.abs(tables[0] - tables[1])))
    rest = 2.0 * (1.0 - (1.0 - 0.5**orders) ** 4)
    noise = float(np.sum(joint * (errors[0] + errors[1])))
    return Estimate(value, noise + rest, "estimate", f"cosines of order below {orders} in x, theta, theta', x'")


def _span(one: PositionLaw | Wall) -> float:
    if isinstance(one, PositionLaw):
        return float(one.edges[-1] - one.edges[0])
    if isinstance(one, Wall):
        return one.period
    raise InputError(f"first, second: expected a PositionLaw or a Wall, got {one!r}")


def _means(one: PositionLaw | Wall, orders: int, power: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Means of the products, shape (orders,) * 4 in the order s, theta, theta', s', and their errors."""
    if isinstance(one, PositionLaw):
        return _means_of_law(one, orders)
    found, unresolved = zip(*(_means_of_rays(one, orders, power, rng) for _ in range(REPETITIONS)), strict=True)
    runs = np.stack(found)
    error = student_95(REPETITIONS) * runs.std(axis=0, ddof=1) / math.sqrt(REPETITIONS)
    return runs.mean(axis=0), error + 2.0 * float(np.mean(unresolved))


def _means_of_law(law: PositionLaw, orders: int) -> tuple[Floats, Floats]:
    ends = (law.edges - law.edges[0]) / (law.edges[-1] - law.edges[0])
    in_space = _cosine_integrals(ends, orders)
    tables: dict[int, tuple[Floats, float]] = {}
    total, error = np.zeros((orders,) * 4), np.zeros((orders,) * 4)
    for k, part in enumerate(law.laws):
        if id(part) not in tables:
            matrix = discretise(part, Legendre(orders), tolerance=1e-6)
            tables[id(part)] = flux_means(matrix, orders - 1), float(matrix.error)
        means, uncertainty = tables[id(part)]
        total += np.einsum("jm,kl->jklm", in_space[k], means)
        error += np.abs(in_space[k])[:, None, None, :] * uncertainty
    return total, error


def _cosine_integrals(ends: Floats, orders: int) -> Floats:
    """The integrals of cos(j pi s) cos(m pi s) over every interval, shape (intervals, orders, orders)."""
    numbers = np.arange(orders)
    found = np.zeros((len(ends) - 1, orders, orders))
    for frequency in (numbers[:, None] + numbers, numbers[:, None] - numbers):
        # the integral of cos(f pi s) from 0 to s is s sinc(f s)
        up_to = ends[:, None, None] * np.sinc(frequency * ends[:, None, None])
        found += 0.5 * np.diff(up_to, axis=0)
    return found


def _means_of_rays(wall: Wall, orders: int, power: int, rng: np.random.Generator) -> tuple[Floats, float]:
    """The means over one scrambled Sobol sequence, and the fraction of rays that did not escape."""
    from scipy.stats.qmc import Sobol

    from ...geometry import trace

    uniform = np.clip(Sobol(2, rng=rng).random_base2(power), 2.0**-54, 1.0 - 2.0**-53)
    s, theta = uniform[:, 0], SINE.quantile(uniform[:, 1])
    ray = trace(wall, s * wall.period, theta)
    # a ray that does not escape counts as retroreflected where it entered, as in `WallLaw`
    outgoing = np.where(ray.escaped, ray.theta, theta)
    after = np.where(ray.escaped, ray.x / wall.period, s)
    before = _cosines(np.pi * s, orders)[:, None, :] * _cosines(theta, orders)[None, :, :]
    behind = _cosines(outgoing, orders)[:, None, :] * _cosines(np.pi * after, orders)[None, :, :]
    size = len(s)
    table = before.reshape(-1, size) @ behind.reshape(-1, size).T / size
    return np.asarray(table.reshape((orders,) * 4)), 1.0 - float(ray.escaped.mean())


def _cosines(angle: Floats, orders: int) -> Floats:
    return np.asarray(np.cos(np.arange(orders)[:, None] * angle))
