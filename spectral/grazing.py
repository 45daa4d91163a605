"""What a law does to grazing rays, on which its essential spectrum depends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..checks import Floats
from ..kernels import CircularArcLaw, DensityLaw, DrivenLaw, Law, WallLaw
from ..kernels.angle_panels import GAUSS, KRONROD, NODES
from ..kernels.responses import entry_inside, responder

# Grazing angles, down to where the outgoing angle, good to some 1e-15, still has seven digits.
ANGLES = 10.0 ** -np.arange(3.0, 9.0)
# Adaptive quadrature in the entry point: first panels, error asked for, and rays that it may take.
FIRST_PANELS, QUADRATURE_TOLERANCE, MOST_RAYS, NARROWEST = 8, 1e-9, 20_000, 1e-13
# Shifted lattices where there are too many changes of itinerary: their spread is the error.
LATTICES, LATTICE_POINTS = 8, 2048
# Two powers of ten between which the sums of rows change by less than this are enough.
SETTLED = 2e-8
# Walls whose limits are kept.
REMEMBERED = 32
# Relative accuracy of an outgoing angle of the size of the incoming one.
ANGLE_ROUNDING = 4e-15


@dataclass(frozen=True)
class GrazingLimit:
    """The matrix lim E[sin(theta) / sin(Theta'); Theta' at end j] for theta at end i; ends are 0 and pi.

    Attributes
    ----------
    matrix : array of shape (2, 2)
    error : float
        Estimated error of the sums of rows.
    entry_error : float
        Estimated error of the entries: in deep hollows the ends share a row in a way that never settles.
    """

    matrix: Floats
    error: float
    entry_error: float

    @property
    def root(self) -> float:
        """The largest eigenvalue: how far the essential spectrum reaches on account of grazing rays."""
        return float(np.max(np.abs(np.linalg.eigvals(self.matrix))))


def grazing_limit(law: Law) -> GrazingLimit:
    r"""The limit at grazing of the law's action on 1/sin(theta), end by end.

    Notes
    -----
    Where grazing rays come back at an angle proportional to their own, theta' = c theta with c of a fixed
    distribution, the law acts on functions of ln(theta) as a convolution, and the symbol of this convolution on
    L^2(theta d theta) is E[c^(-1 + i omega)], whose modulus is largest at omega = 0. An outgoing angle that does not
    graze contributes nothing in the limit. For the semicircle the sum of a row is (3/8) ln 9.

    The angles run through powers of ten; Aitken's extrapolation gives the limit, and how far it moved the last value,
    with the errors of the quadratures, its error.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> grazing_limit(ker.specular()).matrix.round(6).tolist()
    [[0.0, 1.0], [1.0, 0.0]]
    """
    return _limit_of_wall(law) if isinstance(law, (CircularArcLaw, WallLaw)) else _limit(law)


@lru_cache(maxsize=REMEMBERED)
def _limit_of_wall(law: Law) -> GrazingLimit:
    """The gaps in both conventions and the diffusivity ask for the same limit."""
    return _limit(law)


def _limit(law: Law) -> GrazingLimit:
    rows: list[list[tuple[Floats, float]]] = []
    for angle in ANGLES:
        rows.append([_row(law, angle, end) for end in (0, 1)])
        if len(rows) >= 3 and all(abs(rows[-1][end][0].sum() - rows[-2][end][0].sum()) <= SETTLED for end in (0, 1)):
            break
    values = np.array([[pair[end][0] for end in (0, 1)] for pair in rows])
    noise = np.array([max(pair[0][1], pair[1][1]) for pair in rows])
    # of deep hollows only small angles are out of reach: the best-known angles decide
    known = noise <= max(4.0 * float(noise.min()), 1e-6)
    values, noise = values[known], noise[known]
    matrix, sums = values[-1], values.sum(axis=2)
    if len(values) < 3:
        spread = float(noise[-1] + np.ptp(values, axis=0).max())
        return GrazingLimit(matrix, float(noise[-1] + np.ptp(sums)), spread)
    limit = _aitken(sums[-3], sums[-2], sums[-1], float(noise[-3:].max()))
    scale = np.divide(limit, sums[-1], out=np.ones(2), where=sums[-1] > 0.0)
    moved = np.abs(limit - sums[-1]) + np.minimum(np.abs(sums[-1] - sums[-2]), np.abs(limit - sums[-1]) + noise[-1])
    error = float(np.max(moved) + noise[-3:].max())
    # what shrinks from one power of ten to the next is settled; what does not, as rays that alternate, is not
    steps = np.abs(np.diff(values[-3:], axis=0)).max(axis=(1, 2))
    unsettled = float(steps[1]) if steps[1] < 0.5 * steps[0] else float(np.ptp(values, axis=0).max())
    return GrazingLimit(matrix * scale[:, None], error, max(error, unsettled))


def _aitken(first: Floats, second: Floats, third: Floats, noise: float) -> Floats:
    """The limit of a geometric approach; the last value where the steps are noise or do not shrink."""
    before, last = second - first, third - second
    shrinks = (np.abs(last) > noise) & (np.abs(last) < 0.9 * np.abs(before)) & (before * last > 0.0)
    step = np.divide(last * last, before - last, out=np.zeros_like(last), where=shrinks)
    return np.maximum(third + step, 0.0)


def _row(law: Law, angle: float, end: int) -> tuple[Floats, float]:
    """E[sin(theta)/sin(Theta')] with Theta' nearer to 0 and to pi, and its error."""
    theta = angle if end == 0 else np.pi - angle

    def ratio(outgoing: Floats) -> Floats:
        share = np.sin(angle) / np.sin(outgoing)
        near = outgoing < 0.5 * np.pi
        return np.stack([np.where(near, share, 0.0), np.where(near, 0.0, share)], axis=-1)

    respond = responder(law) if isinstance(law, DrivenLaw) else None
    if respond is not None:
        value, error = _entry_mean(lambda x: ratio(respond(x, np.full(x.shape, theta))[0]))
    else:
        value, error = law.apply(ratio, np.array([theta]))[0], 0.0
        if isinstance(law, DensityLaw):
            error = float(angle)
    return value, error + ANGLE_ROUNDING / angle


def _entry_mean(function: Callable[[Floats], Floats]) -> tuple[Floats, float]:
    """The mean over entry points in (0, 1) of a function that is analytic between jumps, and its error."""
    edges = np.linspace(0.0, 1.0, FIRST_PANELS + 1)
    low, high = edges[:-1], edges[1:]
    total, settled, rays = np.zeros(2), 0.0, 0
    while low.size:
        half = 0.5 * (high - low)
        x = (0.5 * (low + high))[:, None] + half[:, None] * NODES
        values = function(entry_inside(x.ravel())).reshape(*x.shape, 2)
        rays += x.size
        integral = half[:, None] * np.einsum("k,pkj->pj", KRONROD, values)
        error = half * np.abs(np.einsum("k,pkj->pj", KRONROD - GAUSS, values)).sum(axis=1)
        done = (error <= QUADRATURE_TOLERANCE * half) | (half <= NARROWEST)
        if rays > MOST_RAYS:
            done[:] = True
        total = total + integral[done].sum(axis=0)
        settled += float(error[done].sum())
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low[~done], middle[~done]]), np.concatenate([middle[~done], high[~done]])
    if settled <= 1e-6:
        return total, settled
    return _lattice_mean(function, total, settled)


def _lattice_mean(function: Callable[[Floats], Floats], total: Floats, settled: float) -> tuple[Floats, float]:
    """Shifted lattices, if their spread is smaller than the error of what they replace."""
    shift = (np.arange(LATTICES) + 0.5) / LATTICES * np.sqrt(2.0) % 1.0
    points = (np.arange(LATTICE_POINTS) + shift[:, None]) / LATTICE_POINTS
    means = function(points.ravel()).reshape(LATTICES, LATTICE_POINTS, 2).mean(axis=1)
    spread = 2.0 * float(means.sum(axis=1).std(ddof=1)) / np.sqrt(LATTICES)
    return (means.mean(axis=0), spread) if spread < settled else (total, settled)
