"""Walls y = f(x): Bezier pieces near a function, its slope and its second derivative."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import comb

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from ...core.checks import Floats, number_between, numbers
from ...core.errors import InputError, WallError
from ...core.given import Vectorised
from ...core.long_runs import progress_bar
from ..curves.bezier import Bezier
from ..curves.curve import Curve, Point
from ..curves.segment import Segment

# Tolerances; below the least, slopes of doubles would not be known.
LEAST_TOLERANCE, LARGEST_TOLERANCE = 1e-11, 0.01
# Chebyshev nodes of the polynomials that stand for the function, from 1 to -1, and their shortest interval, in periods.
NODES, NARROWEST = np.cos(np.pi * (np.arange(17) + 0.5) / 17), 2.0**-24
# Tolerance of the polynomials, and of their derivatives as the last four terms show it at most, as fractions.
RESOLVED, SEEN, LAST = 1e-2, 0.1, np.arange(13, 17)
# The function is compared at so many points of an interval at least, and at so many in a period.
LEAST_POINTS, POINTS = 32, 1024
# Slope and second derivative of a piece of width h may differ by so many tolerances over h, and over h^2.
SLOPES, SECONDS = 10.0, 100.0
# Parameters at which a piece is compared, and cubic Bernstein polynomials at those at which it is fitted.
COMPARED, FITTED = np.linspace(0.0, 1.0, 65), np.linspace(0.0, 1.0, 18)[1:-1]
BERNSTEIN = np.stack([comb(3, k) * FITTED**k * (1.0 - FITTED) ** (3 - k) for k in range(4)], axis=1)


def pieces_of_function(
    height: Callable[[Floats], Floats], period: float, tolerance: float, breakpoints: ArrayLike
) -> list[Curve]:
    """The pieces of `Wall.from_function`; their highest point is at y = 0."""
    if not callable(height):
        raise InputError(f"height: expected a function of arrays of positions, got {height!r}")
    step = period * number_between("tolerance", tolerance, LEAST_TOLERANCE, LARGEST_TOLERANCE, closed="low high")
    inner = numbers("breakpoints", breakpoints)
    if inner.ndim != 1 or not np.all((inner >= 0.0) & (inner <= period)):
        raise InputError(f"breakpoints: expected a list of positions in [0, {period:g}], got {breakpoints!r}")
    edges = np.unique([0.0, *inner.tolist(), period]).tolist()
    # a copy, because the function may change what it gets
    given = Vectorised(lambda x: height(x.copy()))
    mirrored = _is_mirrored(given, edges, step)
    if mirrored:
        edges = [edge for edge in edges if edge < 0.5 * period] + [0.5 * period]
    parts = [part for low, high in pairwise(edges) for part in _smooth_parts(given, low, high, period, step)]
    slopes = _slopes(parts, mirrored, step)
    pieces: list[Curve] = []
    with progress_bar(len(parts), "interval", "wall of a function") as bar:
        for part, ends in zip(parts, slopes, strict=True):
            # the function's own values, but for jumps
            own, y = given(part.domain), part(part.domain)
            y = np.where(np.abs(own - y) <= RESOLVED * step, own, y)
            pieces += _fitted(part, part.domain, y, ends, step)
            bar.update()
    if mirrored:
        pieces += [piece.stretched(-1.0, 1.0).moved(period, 0.0).reversed() for piece in reversed(pieces)]
    return _joined(pieces, step)


def _values(height: Vectorised, x: Floats) -> Floats:
    found = height(x)
    bad = ~np.isfinite(found)
    if bad.any():
        raise WallError(f"height: expected finite heights, got {found[bad][0]} at x = {x[bad][0]:.9g}")
    return found


def _is_mirrored(height: Vectorised, edges: list[float], step: float) -> bool:
    """Whether the function has the mirror axis period/2, as far as points show it."""
    period = edges[-1]
    x = (np.arange(POINTS) + 0.5) * period / (2 * POINTS)
    same = np.allclose(edges, period - np.array(edges[::-1]), rtol=0.0, atol=step)
    return same and bool(np.all(np.abs(_values(height, x) - _values(height, period - x)) <= RESOLVED * step))


def _smooth_parts(height: Vectorised, low: float, high: float, period: float, step: float) -> list[Chebyshev]:
    """Polynomials that are the function on intervals side by side."""
    from scipy.fft import dct

    middle = 0.5 * (low + high)
    level = _values(height, np.array([middle]))
    # without the level, the rounding errors are those of the differences; the transform rounds less than `interpolate`
    values = _values(height, middle + 0.5 * (high - low) * NODES) - level
    coefficients = dct(values) / len(NODES)
    coefficients[0] = 0.5 * coefficients[0] + level[0]
    found = Chebyshev(coefficients, [low, high])
    number = max(LEAST_POINTS, int(POINTS * (high - low) / period))
    x = low + (np.arange(number) + 0.5) * (high - low) / number
    off, last = float(np.abs(found(x) - _values(height, x)).max()), np.abs(coefficients[LAST])
    # at the ends, the derivatives of the k-th Chebyshev polynomial are k^2 and k^2 (k^2 - 1)/3
    slope, bend = 2.0 * last @ LAST**2, 4.0 / 3.0 * last @ (LAST**2 * (LAST**2 - 1))
    if off <= RESOLVED * step and slope <= SEEN * SLOPES * step and bend <= SEEN * SECONDS * step:
        return [found]
    if high - low < NARROWEST * period:
        raise WallError(
            f"height: expected slopes and curvatures that are continuous between breakpoints, but near x = {low:.4g} "
            f"heights differ by {off:.1g} from those of a smooth curve; pass the places of jumps as breakpoints, or a "
            "tolerance above the rounding or noise of the heights, and make an Arc where the wall is vertical"
        )
    return [*_smooth_parts(height, low, middle, period, step), *_smooth_parts(height, middle, high, period, step)]


def _slopes(parts: list[Chebyshev], mirrored: bool, step: float) -> Floats:
    """The slopes at the ends of the parts, shape (n, 2), equal at joints at which they are within the tolerance."""
    slopes = np.array([part.deriv()(part.domain) for part in parts])
    allowed = np.array([SLOPES * step / np.ptp(part.domain) for part in parts])
    for here in range(len(parts)):
        before = here - 1
        if mirrored and here == 0:
            # both ends meet their mirror images
            slopes[0, 0] *= 2.0 * abs(slopes[0, 0]) > allowed[0]
            slopes[-1, 1] *= 2.0 * abs(slopes[-1, 1]) > allowed[-1]
        elif abs(slopes[here, 0] - slopes[before, 1]) <= min(allowed[here], allowed[before]):
            slopes[here, 0] = slopes[before, 1] = 0.5 * (slopes[here, 0] + slopes[before, 1])
    return slopes


def _fitted(height: Chebyshev, x: Floats, y: Floats, slopes: Floats, step: float) -> list[Curve]:
    """Pieces that are near a polynomial: the segment, or the Bezier curve with its slopes at the ends, or halves."""
    width = float(np.ptp(x))
    if np.ptp(height.deriv()(x[0] + COMPARED * width)) * width <= RESOLVED * step:
        return [Segment((x[0], y[0]), (x[1], y[1]))]
    curve = _with_handles(height, x, y, slopes)
    if curve is not None and _is_near(curve, height, width, step):
        return [curve]
    middle = x.mean()
    here, slope = height(middle), height.deriv()(middle)
    return [
        *_fitted(height, np.array([x[0], middle]), np.array([y[0], here]), np.array([slopes[0], slope]), step),
        *_fitted(height, np.array([middle, x[1]]), np.array([here, y[1]]), np.array([slope, slopes[1]]), step),
    ]


def _with_handles(height: Chebyshev, x: Floats, y: Floats, slope: Floats) -> Bezier | None:
    """The Bezier curve with the given ends and slopes whose two handles make the least mean square distance in y."""
    from scipy.optimize import least_squares

    def control_points(handles: Floats) -> Floats:
        inner_x = x + handles * [1.0, -1.0]
        inner_y = y + slope * (inner_x - x)
        return np.array([[x[0], y[0]], [inner_x[0], inner_y[0]], [inner_x[1], inner_y[1]], [x[1], y[1]]])

    def distance(handles: Floats) -> Floats:
        at = BERNSTEIN @ control_points(handles)
        return np.asarray(at[:, 1] - height(at[:, 0]))

    third = (x[1] - x[0]) / 3.0
    found = least_squares(distance, [third, third], x_scale=third, method="lm", xtol=1e-14, ftol=1e-14)
    # so that x grows along the curve
    return Bezier(list(control_points(found.x))) if np.all(found.x > 0.0) and found.x.sum() < 3.0 * third else None


def _is_near(curve: Bezier, height: Chebyshev, width: float, step: float) -> bool:
    """Whether heights, slopes and second derivatives are within the tolerance."""
    x, y = polyval(COMPARED, curve.powers)
    vx, vy = polyval(COMPARED, polyder(curve.powers))
    ax, ay = polyval(COMPARED, polyder(curve.powers, 2))
    if np.any(vx <= 0.0):
        return False
    first = height.deriv()
    slope, bend = first(x), first.deriv()(x)
    second = (vx * ay - vy * ax) / vx**3
    return bool(
        np.all(np.abs(y - height(x)) <= step)
        and np.all(np.abs(vy / vx - slope) <= SLOPES * step / width)
        and np.all(np.abs(second - bend) <= SECONDS * step / width**2)
    )


def _joined(pieces: list[Curve], step: float) -> list[Curve]:
    """The pieces with vertical segments where heights jump, moved down from the highest point."""
    top = max(max(piece.start[1], piece.end[1], *piece.turning_values(1)) for piece in pieces)
    joined: list[Curve] = []
    here: Point = (0.0, pieces[-1].end[1] - top)
    for piece in (piece.moved(0.0, -top) for piece in pieces):
        if abs(piece.start[1] - here[1]) > RESOLVED * step:
            joined.append(Segment(here, piece.start))
            here = piece.start
        joined.append(piece.pinned(here, piece.end))
        here = piece.end
    return joined
