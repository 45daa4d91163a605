"""Bounds of the spectral gap of dispersing arcs from their curvature: rays that are reflected once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, number_between, whole_number
from ...core.estimates import Estimate
from ...kernels import Legendre, WallLaw, discretise

# Curvatures up to this one; the arcs of curvature 2 are semicircles, which meet in cusps.
LARGEST_CURVATURE = 1.5
# Angles below this one are treated together.
GRAZING = 1e-4
# Ratio of the angles at the ends of a bin near grazing, at most.
RATIO = 1.08
# Bound of the rounding of an eigenvalue of a matrix of some hundred rows with entries below 1.
ROUNDING = 1e-12
# Tolerance of the matrix element in the upper bound.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class GapBounds:
    """Bounds of the gap of dispersing arcs in Feres' convention.

    Attributes
    ----------
    lower : float
        The gap is at least this number, by the theorem in the notes of `curvature_gap_bounds`, to rounding.
    upper : Estimate
        1 - <e, P e> with e proportional to cos(theta): the gap is at most this number.
    curvature : float
    """

    lower: float
    upper: Estimate
    curvature: float


def curvature_gap_bounds(curvature: float, bins: int = 400) -> GapBounds:
    r"""Bound the gap of `geometry.dispersing_arcs` from both sides by the curvature of its exposed arcs.

    Parameters
    ----------
    curvature : float
        K, in (0, 1.5].
    bins : int
        Bins of the lower bound, at least 50; it increases with their number in the long run.

    Returns
    -------
    GapBounds

    Raises
    ------
    InputError
        If a number is out of range.

    Notes
    -----
    A ray that enters at theta, is reflected once at the slope phi, and leaves at eta in Feres' convention satisfies
    phi = (theta - eta)/2. These rays have the symmetric density sin((theta + eta)/2)/(4 K) in d theta d eta, where the
    point of slope phi sees both directions. All other rays add a non-negative form. On bins the density, divided by
    that of the invariant measure, is replaced by its least value: functions split into bin means, for which a matrix
    decides, and rests, for which the row sums do. Grazing angles are added by a bound for their block. The lower bound
    and its proof are the library's own; the upper bound is the observation of R. Feres and H.-K. Zhang, J. Stat. Phys.
    141 (2010) 1039, that the second moment of scattering is close to the gap.

    Examples
    --------
    >>> found = curvature_gap_bounds(1.0, 200)
    >>> 0.2 < found.lower < float(found.upper) < 0.4
    True
    """
    K = number_between("curvature", curvature, 0.0, math.nextafter(LARGEST_CURVATURE, 2.0))
    number = whole_number("bins", bins, 50)
    inner = _lower_of_inner_angles(K, _edges(number))
    return GapBounds(max(_with_grazing_angles(K, inner), 0.0), _upper(K), K)


def _edges(bins: int) -> Floats:
    """Edges from GRAZING to pi - GRAZING: geometric near both ends, then equal."""
    width = math.pi / bins
    # widths grow with the angle up to the common one
    geometric = [GRAZING]
    while geometric[-1] * (RATIO - 1.0) < width:
        geometric.append(geometric[-1] * RATIO)
    start = np.array(geometric)
    middle = np.linspace(start[-1], math.pi - start[-1], bins + 1)
    return np.concatenate((start[:-1], middle, (math.pi - start[:-1])[::-1]))


def lowest_seen(K: float, slope: Floats) -> Floats:
    """The least elevation at which the point of this slope sees the sky on the right."""
    down = np.minimum(slope, 0.0)
    x, y = -np.sin(down) / K, -2.0 * np.sin(0.5 * down) ** 2 / K
    # the tangent to the next arc on the right
    to_centre = np.arctan2(-1.0 / K - y, 1.0 - x)
    distance = np.hypot(1.0 - x, 1.0 / K + y)
    tangent = to_centre + np.arcsin(np.minimum(1.0 / (K * distance), 1.0))
    return np.where(slope >= 0.0, slope, tangent)


def _lower_of_inner_angles(K: float, edges: Floats) -> float:
    """The bound for angles between the first and the last edge."""
    weight = 0.5 * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    density = least_density(K, edges)
    rows = density @ weight
    root = np.sqrt(weight)
    values = np.linalg.eigvalsh(np.diag(rows) - root[:, None] * density * root)
    return min(float(values[1]), float(rows.min())) - ROUNDING


def least_density(K: float, edges: Floats) -> Floats:
    """The least density of rays that are reflected once, from bin to bin, over that of the invariant measure."""
    low, high = edges[:-1], edges[1:]
    # least and greatest slope of a point that sends the first bin to the second
    first, last = 0.5 * (low[:, None] - high), 0.5 * (high[:, None] - low)
    right = np.maximum(lowest_seen(K, first), lowest_seen(K, last))
    left = np.maximum(lowest_seen(K, -first), lowest_seen(K, -last))
    steepest = math.asin(0.5 * K)
    exposed = (first >= -steepest) & (last <= steepest)
    exposed &= (low[:, None] >= right) & (high[:, None] <= math.pi - left)
    exposed &= (low >= left) & (high <= math.pi - right)
    least = np.minimum(np.sin(0.5 * (low[:, None] + low)), np.sin(0.5 * (high[:, None] + high)))
    most = np.where((low <= 0.5 * math.pi) & (high >= 0.5 * math.pi), 1.0, np.maximum(np.sin(low), np.sin(high)))
    return np.where(exposed, least / (K * most[:, None] * most), 0.0)


def _with_grazing_angles(K: float, inner: float) -> float:
    """The bound for all angles, from that for angles between GRAZING and pi - GRAZING."""
    eps, reach = GRAZING, 2.0 * math.asin(0.5 * K) + GRAZING
    # Hilbert-Schmidt norm of the block of grazing angles; (eta - theta)^2 < width theta where eta is seen
    width = 8.0 * K * (math.tan(eps) / eps) / (math.sin(0.25 * eps) / (0.25 * eps)) ** 2
    squares = (8.0 / 3.0 * math.sqrt(width) * eps**1.5 + 0.5 * width * eps) / (8.0 * (K * math.sin(eps) / eps) ** 2)
    block = math.sqrt(squares)
    # rays that graze and are reflected once; the probability to graze next
    once = 1.0 - math.tan(0.5 * eps) / K
    entering = 0.5 * eps / K * (1.0 if reach <= 0.5 * math.pi else 2.0 / math.sin(reach))
    share = once - block - inner
    return min(inner, inner - (1.0 / share - 1.0) * entering) if share > 0.0 else 0.0


def _upper(K: float) -> Estimate:
    from ...geometry import dispersing_arcs

    matrix = discretise(WallLaw(dispersing_arcs(K)).in_specular_frame(), Legendre(2), tolerance=TOLERANCE)
    error = float(matrix.error)
    return Estimate(1.0 - float(matrix.symmetric[1, 1]), error, matrix.error.kind, "second moment of scattering")
