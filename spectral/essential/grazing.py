"""The limit of a law at grazing incidence, which determines part of its essential spectrum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, singledispatch

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ...geometry import Bezier, Wall, trace
from ...geometry.cells.cell import flat_tops, hollows_between
from ...geometry.curves.curve import Curve
from ...kernels import CircularArcLaw, FacetedLaw, Law, WallLaw
from ...kernels.expectations.angle_panels import GAUSS, KRONROD, NODES
from ...kernels.laws.law import entry_inside

# Grazing angles in units of the scale of the wall. At the smallest one the outgoing angle, with an error of some 1e-15,
# has seven digits.
ANGLES = 10.0 ** -np.arange(3.0, 9.0)
# Degree of the rules for means of ratios of sines.
DEGREE = 256
# A unit tangent with a smaller horizontal part counts as vertical: rounding of some ten operations.
VERTICAL = 64.0 * EPS
# The end of a hollow counts as straight until its tangent has turned by this angle; halvings to find this point.
TURN, HALVINGS = 0.1, 60
# Adaptive quadrature in the entry point: first panels, wanted error, limit on the rays, and least width of a panel.
FIRST_PANELS, QUADRATURE_TOLERANCE, MOST_RAYS, NARROWEST = 8, 1e-9, 20_000, 1e-13
# Shifted lattices for integrands with too many changes of itinerary; their spread is the error.
LATTICES, LATTICE_POINTS = 8, 2048
# If the row sums change by less than CONVERGED between three powers of ten, and the scale is known, no more are needed.
CONVERGED, FEWEST_ANGLES = 2e-8, 3
# No limit has an eigenvalue above 1, the norm of a law. If one exceeds 1 by more than its error, the limit is unknown.
NORM, UNKNOWN = 1.0, 1.0
SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])
# Number of walls in the cache.
REMEMBERED = 32
# Relative accuracy of an outgoing angle of the size of the incoming one.
ANGLE_ROUNDING = 4e-15
# An integral is not refined if more than this fraction of the rays does not escape.
MOST_LOST = 1e-3
# Rays of a wall that does not close pass a number of cells, or are reflected a number of times, that may grow like
# 1/theta. An angle at which PROBES rays have on average more than MOST_PASSED of both is not tried, nor a smaller one.
PROBES, MOST_PASSED = 16, 1000
# A wall that does not close is raised until it touches y = 0, up to this multiple of its size for rounding.
CLEARANCE = 64.0 * EPS


@dataclass(frozen=True)
class GrazingLimit:
    """The matrix lim E[sin(theta) / sin(Theta'); Theta' at end j] for theta at end i, with the ends 0 and pi.

    Attributes
    ----------
    matrix : array of shape (2, 2)
    error : float
        Estimated error of the row sums; 0 if the limit follows from the shape of the wall.
    entry_error : float
        Estimated error of the entries. In deep hollows the entries of a row may not converge although their sum does.
    resolved : bool
        False if no limit was reached; the error is then 1, the norm of a law.
    """

    matrix: Floats
    error: float
    entry_error: float
    resolved: bool = True

    @property
    def root(self) -> float:
        """The largest modulus of an eigenvalue, the edge of the essential spectrum of grazing rays."""
        return float(np.max(np.abs(np.linalg.eigvals(self.matrix))))


@singledispatch
def grazing_limit(law: Law) -> GrazingLimit:
    r"""The limit at grazing of the law's action on 1/sin(theta), for each of the ends 0 and pi.

    Notes
    -----
    If grazing rays leave at a proportional angle, theta' = c theta with a fixed distribution of c, the law acts on
    functions of ln(theta) as a convolution. The symbol of this convolution on L^2(theta d theta) is
    E[c^(-1 + i omega)], whose modulus is largest at omega = 0. Outgoing angles that are not grazing contribute nothing
    in the limit. For the semicircle a row sum is (3/8) ln 9.

    *Walls.* A ray that enters a hollow at a small angle theta meets the side of the hollow within O(theta) of its end
    on y = 0. If the side leaves this end at an angle a to the horizontal, 0 < a < pi/2, the ray leaves at the angle
    pi - 2 a, which is not grazing. If a = 0, the side has the depth c w^m at the distance w from its end, m > 1. The
    ray meets it at a depth of order theta, where w is of order theta^(1/m) and the slope of order theta^(1 - 1/m), so
    sin(theta)/sin(theta') is of order theta^(1/m). In both cases the limit is 0, and by Schur's test with the weight
    1/sin(theta) the norm of the law on functions of angles below theta tends to 0. Such sides add nothing to the
    essential spectrum; only flat tops and vertical or overhanging sides do.

    *Other ends, other laws.* The angles are powers of ten, from 1e-3 on, times the length of the straight part of the
    side over the opening. The limit is found by Aitken's extrapolation. Its error is the change of the last value by
    the extrapolation plus the errors of the quadratures and the fractions of rays that did not escape. A limit above
    the norm of a law is rejected. A wall that does not close is raised until its highest point has y = 0, which does
    not change its law; otherwise rays would first pass a number of cells proportional to 1/theta.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> grazing_limit(ker.specular()).matrix.round(6).tolist()
    [[0.0, 1.0], [1.0, 0.0]]

    The sides of shallow bumps are horizontal at their tops:

    >>> from asperity import geometry as geo
    >>> grazing_limit(ker.WallLaw(geo.dispersing_arcs(1e-9))).root
    0.0
    """
    try:
        hash(law)
    except TypeError:  # of a user's law with arrays
        return _limit(law, Grazed())
    return _limit_of_any(law)


@dataclass(frozen=True)
class Grazed:
    """Parts of the period whose grazing rays are traced, for theta near 0 and near pi, and the scale of the angles."""

    parts: tuple[tuple[tuple[float, float], ...], ...] = (((0.0, 1.0),), ((0.0, 1.0),))
    flat: float = 0.0
    scale: float | None = None


@lru_cache(maxsize=REMEMBERED)
def _limit_of_any(law: Law) -> GrazingLimit:
    return _limit(law, Grazed())


@grazing_limit.register(CircularArcLaw)
@lru_cache(maxsize=REMEMBERED)
def _limit_of_arc(law: CircularArcLaw) -> GrazingLimit:
    is_plain = _is_plain(float(np.cos(law.half_angle)))
    return GrazingLimit(np.zeros((2, 2)), 0.0, 0.0) if is_plain else _limit(law, Grazed(scale=1.0))


@grazing_limit.register(WallLaw)
@lru_cache(maxsize=REMEMBERED)
def _limit_of_wall(law: WallLaw) -> GrazingLimit:
    """The limit of a wall, cached for the gaps in both conventions and the diffusivity."""
    # the cell has the same law, and its entry points refer to its hollows
    cell = law.wall.cell if law.wall.closes else raised(law.wall)
    return _limit(law if cell is law.wall else WallLaw(cell), grazed(cell))


@grazing_limit.register(FacetedLaw)
@lru_cache(maxsize=REMEMBERED)
def _limit_of_facets(law: FacetedLaw) -> GrazingLimit:
    """The limit with the weight (1 - a)^N after N hits: diffuse rays leave at angles that are not grazing."""
    if law.diffuse_fraction is None or not law.wall.closes:
        return GrazingLimit(np.zeros((2, 2)), UNKNOWN, UNKNOWN, False)
    cell = FacetedLaw(law.wall.cell, law.facets)
    where = grazed(cell.wall)
    return _limit(cell, replace(where, flat=(1.0 - law.diffuse_fraction) * where.flat))


def _rays_of(law: Law) -> Callable[[Floats, Floats], tuple[Floats, NDArray[np.bool_] | None, Floats | float]] | None:
    """The outgoing angles of rays from entry points, which of them escaped, and their weights; None without rays."""
    if isinstance(law, FacetedLaw) and law.diffuse_fraction is not None:
        wall, kept = law.wall, 1.0 - law.diffuse_fraction

        def weighted(x: Floats, theta: Floats) -> tuple[Floats, NDArray[np.bool_], Floats]:
            rays = trace(wall, x * wall.period, theta)
            outgoing = np.where(rays.escaped, rays.theta, theta)
            return outgoing, rays.escaped, np.asarray(kept**rays.collisions, dtype=np.float64)

        return weighted
    reflect = law.random_map() if law.is_driven else None
    return None if reflect is None else lambda x, theta: (*reflect(x, theta), 1.0)


def raised(wall: Wall) -> Wall:
    """A wall with islands moved up until its highest point has y = 0; its law, with x uniform, is the same."""
    highest = max(float(piece.box[3]) for path in (wall.pieces, *wall.islands) for piece in path)
    rise = -highest - CLEARANCE * (wall.period + wall.depth)
    if rise <= 0.0:
        return wall
    paths = [[piece.moved(0.0, rise) for piece in path] for path in (wall.pieces, *wall.islands)]
    return type(wall)(paths[0], wall.period, paths[1:])


def grazed(wall: Wall) -> Grazed:
    """The hollows of a wall whose sides are vertical or overhang where grazing rays meet them."""

    highest = max((float(piece.box[3]) for loop in wall.islands for piece in loop), default=-np.inf)
    if wall.pieces[0].start[1] < 0.0 or highest >= 0.0:
        return Grazed()
    parts: tuple[list[tuple[float, float]], ...] = ([], [])
    scales = [1.0]
    for hollow in hollows_between(flat_tops(wall.pieces, wall.vertices), wall.vertices):
        sides = (wall.pieces[hollow.first], wall.pieces[hollow.last - 1].reversed())
        for part, side, forward in zip(parts, sides, (1.0, -1.0), strict=True):
            # a curve along y = 0 counts as a flat top
            if not (_is_plain(float(forward * _direction(side)[0])) and side.box[1] < 0.0):
                part.append((hollow.left / wall.period, hollow.right / wall.period))
                scales.append(_straight_depth(side) / hollow.width)
    # islands below the openings limit the scale
    scale = min(*scales, -highest / wall.period) if wall.islands else min(scales)
    return Grazed((tuple(parts[0]), tuple(parts[1])), wall.flat_top / wall.period, scale)


def _is_plain(run: float) -> bool:
    """Whether a side whose unit tangent has this horizontal part is neither vertical nor overhanging."""
    return run > VERTICAL


def _direction(side: Curve) -> Floats:
    """The unit tangent at the start, or its limit for a Bezier curve with zero velocity there."""

    points = np.array(side.control_points if isinstance(side, Bezier) else ())
    ahead = [point for point in points[1:] - points[:1] if np.any(point)] if points.size else []
    return np.asarray(ahead[0] / np.hypot(*ahead[0]) if ahead else side.tangent(0.0))


def _straight_depth(side: Curve) -> float:
    """Distance from the start up to which a curve is nearly straight."""
    start = _direction(side)

    def has_turned(s: float) -> bool:
        return bool(start @ side.tangent(s) < np.cos(TURN))

    low, high = 0.0, 1.0
    if has_turned(high):
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if has_turned(middle) else (middle, high)
    return float(np.hypot(*(side.point(high) - side.point(0.0))))


def _limit(law: Law, where: Grazed) -> GrazingLimit:
    if not any(where.parts):
        return GrazingLimit(where.flat * SWAP, 0.0, 0.0)
    limits: list[list[tuple[Floats, float]]] = []
    for angle in (1.0 if where.scale is None else where.scale) * ANGLES:
        if isinstance(law, WallLaw) and not law.wall.closes and _passed(law.wall, angle) > MOST_PASSED:
            break
        limits.append([_at_angle(law, angle, end, where.parts[end]) for end in (0, 1)])
        converged = len(limits) >= FEWEST_ANGLES and where.scale is not None
        last = limits[-FEWEST_ANGLES:]
        if converged and all(np.ptp([row[end][0].sum() for row in last]) <= CONVERGED for end in (0, 1)):
            break
    found = _extrapolated(limits)
    matrix = found.matrix + where.flat * SWAP
    limit = GrazingLimit(matrix, found.error, found.entry_error, found.error < UNKNOWN)
    if limit.resolved and limit.root <= NORM + limit.error + EPS * NORM:
        return limit
    return GrazingLimit(np.minimum(matrix, NORM), UNKNOWN, UNKNOWN, False)


def _passed(wall: Wall, angle: float) -> float:
    """The mean number of cells passed plus reflections of a few rays at this angle."""
    x = wall.period * (np.arange(PROBES) + 0.5) / PROBES
    traced = trace(wall, x, np.full(PROBES, angle))
    return float(np.mean(traced.collisions + np.abs(traced.x - x) / wall.period))


def _extrapolated(limits: list[list[tuple[Floats, float]]]) -> GrazingLimit:
    if len(limits) < 2:
        return GrazingLimit(np.zeros((2, 2)), UNKNOWN, UNKNOWN)
    values = np.array([[pair[end][0] for end in (0, 1)] for pair in limits])
    noise = np.array([max(pair[0][1], pair[1][1]) for pair in limits])
    # in deep hollows the smallest angles may be inaccurate: only the most accurate values are used
    known = noise <= max(4.0 * float(noise.min()), 1e-6)
    values, noise = values[known], noise[known]
    matrix, sums = values[-1], values.sum(axis=2)
    if len(values) < 3:
        if len(values) < 2:
            return GrazingLimit(matrix, UNKNOWN, UNKNOWN)
        spread = float(noise[-1] + np.ptp(values, axis=0).max())
        return GrazingLimit(matrix, float(noise[-1] + np.ptp(sums)), spread)
    limit = _aitken(sums[-3], sums[-2], sums[-1], float(noise[-3:].max()))
    scale = np.divide(limit, sums[-1], out=np.ones(2), where=sums[-1] > 0.0)
    moved = np.abs(limit - sums[-1]) + np.minimum(np.abs(sums[-1] - sums[-2]), np.abs(limit - sums[-1]) + noise[-1])
    error = float(np.max(moved) + noise[-3:].max())
    # entries whose change decreases from one power of ten to the next converge; alternating ones do not
    steps = np.abs(np.diff(values[-3:], axis=0)).max(axis=(1, 2))
    unconverged = float(steps[1]) if steps[1] < 0.5 * steps[0] else float(np.ptp(values, axis=0).max())
    return GrazingLimit(matrix * scale[:, None], error, max(error, unconverged))


def _aitken(first: Floats, second: Floats, third: Floats, noise: float) -> Floats:
    """The limit of geometric convergence, or the last value if the steps are noise or do not decrease."""
    before, last = second - first, third - second
    shrinks = (np.abs(last) > noise) & (np.abs(last) < 0.9 * np.abs(before)) & ((before > 0.0) == (last > 0.0))
    step = last * np.divide(last, before - last, out=np.zeros_like(last), where=shrinks)
    return np.maximum(third + step, 0.0)


def _at_angle(law: Law, angle: float, end: int, parts: tuple[tuple[float, float], ...]) -> tuple[Floats, float]:
    """E[sin(theta)/sin(Theta'); x in parts] for Theta' below and above pi/2, and its error."""
    if not parts:
        return np.zeros(2), 0.0
    theta = angle if end == 0 else np.pi - angle

    def ratio(outgoing: Floats) -> Floats:
        fraction = np.sin(angle) / np.sin(outgoing)
        near = outgoing < 0.5 * np.pi
        return np.stack([np.where(near, fraction, 0.0), np.where(near, 0.0, fraction)], axis=-1)

    rays = _rays_of(law)
    if rays is not None:

        def integrand(x: Floats) -> Floats:
            outgoing, escaped, weight = rays(x, np.full(x.shape, theta))
            lost = np.zeros(x.shape) if escaped is None else 1.0 - escaped
            return np.concatenate(((weight * ratio(outgoing).T).T, lost[:, None]), axis=-1)

        found = [_entry_integral(integrand, *part) for part in parts]
        value, error = sum((part[0] for part in found), np.zeros(3)), sum(part[1] for part in found)
        value, error = value[:2], error + float(value[2])
    else:
        # not by `apply`, whose nodes come so near to 0 and pi that laws round them there
        value, error = law.conditionals([theta], degree=DEGREE).mean(ratio)[0], 0.0
        if law.has_density:
            error = float(angle)
    return value, error + ANGLE_ROUNDING / angle


def _entry_integral(function: Callable[[Floats], Floats], first: float, last: float) -> tuple[Floats, float]:
    """The integral over entry points in (first, last) of a piecewise analytic function, and its error.

    The values are two ratios, whose integrals have this error, and the indicator of lost rays. If many rays are lost,
    the integral is not refined.
    """
    edges = np.linspace(first, last, FIRST_PANELS + 1)
    low, high = edges[:-1], edges[1:]
    total, converged, rays = np.zeros(3), 0.0, 0
    while low.size:
        half = 0.5 * (high - low)
        x = (0.5 * (low + high))[:, None] + half[:, None] * NODES
        values = function(entry_inside(x.ravel())).reshape(*x.shape, 3)
        rays += x.size
        integral = half[:, None] * np.einsum("k,pkj->pj", KRONROD, values)
        error = half * np.abs(np.einsum("k,pkj->pj", KRONROD - GAUSS, values[..., :2])).sum(axis=1)
        done = (error <= QUADRATURE_TOLERANCE * half) | (half <= NARROWEST)
        if rays > MOST_RAYS or total[2] + integral[:, 2].sum() > MOST_LOST:
            done[:] = True
        total = total + integral[done].sum(axis=0)
        converged += float(error[done].sum())
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low[~done], middle[~done]]), np.concatenate([middle[~done], high[~done]])
    if converged <= 1e-6 or total[2] > MOST_LOST:
        return total, converged
    return _lattice_integral(function, first, last, total, converged)


def _lattice_integral(
    function: Callable[[Floats], Floats], first: float, last: float, total: Floats, converged: float
) -> tuple[Floats, float]:
    """The integral by shifted lattices, if their spread is less than the error of the given total."""
    shift = (np.arange(LATTICES) + 0.5) / LATTICES * np.sqrt(2.0) % 1.0
    points = (np.arange(LATTICE_POINTS) + shift[:, None]) / LATTICE_POINTS
    values = function(entry_inside(first + (last - first) * points.ravel()))
    means = (last - first) * values.reshape(LATTICES, LATTICE_POINTS, 3).mean(axis=1)
    spread = 2.0 * float(means[:, :2].sum(axis=1).std(ddof=1)) / np.sqrt(LATTICES)
    return (means.mean(axis=0), spread) if spread < converged else (total, converged)
