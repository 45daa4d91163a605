"""The curvature of segments, arcs and Bezier pieces, and its largest absolute value with a bound on the error."""

from __future__ import annotations

import math
from math import comb

import numpy as np

from ...core.checks import Floats
from ...core.rounding import EPS
from .arc import Arc
from .bezier import Bezier
from .curve import Curve
from .segment import Segment

# Relative errors of a Bezier piece's largest curvature that are tried, and limit on the intervals of a check.
WIDTHS, MOST_INTERVALS = tuple(10.0**-k for k in range(12, 1, -1)), 2000
# Rounding error of the polynomials of a Bezier piece, relative to their largest coefficient, and of a closed formula.
ROUNDED = 64.0 * EPS
# Speed, relative to the largest, below which b' = 0: a double zero of |b'|^2 is found to the root of a rounding error.
STILL = 8.0 * math.sqrt(EPS)


def curvature_at(piece: Curve, s: float) -> float:
    """Return the signed curvature at the parameter s, positive if the piece is focusing; inf where b' = 0.

    Examples
    --------
    >>> curvature_at(Arc((0, 0), 2.0, math.pi, 2 * math.pi), 0.5)
    0.5
    """
    if isinstance(piece, Arc):
        a, b = piece.semi_axes
        t = piece.start_angle + s * (piece.end_angle - piece.start_angle)
        turn = 1.0 if piece.end_angle > piece.start_angle else -1.0
        return turn / a if a == b else turn * a * b / math.hypot(a * math.sin(t), b * math.cos(t)) ** 3
    if isinstance(piece, Bezier):
        velocity, cross, _ = _polynomials(piece)
        vx, vy = (float(np.polynomial.polynomial.polyval(s, part)) for part in velocity.T)
        speed = math.hypot(vx, vy)
        if speed <= STILL * float(np.abs(velocity).sum()):
            return math.inf
        return float(np.polynomial.polynomial.polyval(s, cross)) / speed**3
    return 0.0


def largest_curvature(piece: Curve) -> tuple[float, float]:
    """Return the largest absolute curvature of a piece and a bound on its error; (inf, 0) if b' vanishes somewhere."""
    if isinstance(piece, Segment):
        return 0.0, 0.0
    if isinstance(piece, Bezier):
        return _largest_of_bezier(piece)
    assert isinstance(piece, Arc)
    a, b = piece.semi_axes
    if a == b:
        return 1.0 / a, EPS / a
    # monotone between multiples of pi/2
    low, high = sorted((piece.start_angle, piece.end_angle))
    quarters = range(math.ceil(low / (0.5 * math.pi)), math.floor(high / (0.5 * math.pi)) + 1)
    at_axes = [b / a**2 if k % 2 else a / b**2 for k in quarters]
    value = max(abs(curvature_at(piece, 0.0)), abs(curvature_at(piece, 1.0)), *at_axes, 0.0)
    # an angle is rounded, and the formula changes by at most this factor with it
    return value, ROUNDED * max(a / b, b / a) ** 2 * value


def _polynomials(piece: Bezier) -> tuple[Floats, Floats, Floats]:
    """Return b', b' x b'' and |b'|^2 as polynomials, lowest power first; b' has shape (degree, 2)."""
    velocity: Floats = (piece.powers[1:] * [[1.0], [2.0], [3.0]])[: piece.degree]
    vx, vy = velocity.T
    product = np.polynomial.polynomial.polymul
    bend = np.polynomial.polynomial.polyder(velocity)
    cross: Floats = np.polynomial.polynomial.polysub(product(vx, bend[:, 1]), product(vy, bend[:, 0]))
    return velocity, cross, np.polynomial.polynomial.polyadd(product(vx, vx), product(vy, vy))


def _largest_of_bezier(piece: Bezier) -> tuple[float, float]:
    """Return the largest curvature at the critical points, and the least of the tried errors that holds.

    With N = b' x b'' and q = |b'|^2 the curvature is at most K exactly if K^2 q^3 - N^2 is nowhere negative.
    """
    poly = np.polynomial.polynomial
    _, cross, square = _polynomials(piece)
    critical = poly.polysub(
        2.0 * poly.polymul(poly.polyder(cross), square), 3.0 * poly.polymul(cross, poly.polyder(square))
    )
    # where b' = 0 the speed is least
    roots = [poly.polyroots(np.trim_zeros(q, "b")) for q in (critical, poly.polyder(square)) if np.any(q)]
    inside = [float(s) for s in np.concatenate([[0.0, 1.0], *(np.real(r) for r in roots)]) if 0.0 <= s <= 1.0]
    found = max(abs(curvature_at(piece, s)) for s in inside)
    if found in (0.0, math.inf):
        return found, 0.0
    cube = poly.polymul(square, poly.polymul(square, square))
    turning = poly.polymul(cross, cross)
    for width in WIDTHS:
        if _is_positive(poly.polysub((found * (1.0 + width)) ** 2 * cube, turning)):
            return found, width * found
    return found, math.inf


def _is_positive(polynomial: Floats) -> bool:
    """Return whether a polynomial is positive on [0, 1], to rounding: by its Bernstein coefficients."""
    degree = len(polynomial) - 1
    room = ROUNDED * float(np.abs(polynomial).sum())
    todo = [
        np.array([sum(polynomial[k] * comb(i, k) / comb(degree, k) for k in range(i + 1)) for i in range(degree + 1)])
    ]
    for _ in range(MOST_INTERVALS):
        if not todo:
            return True
        level = todo.pop()
        if level.min() > room:
            continue
        if min(level[0], level[-1]) <= room:
            return False
        # de Casteljau's halves
        first, last = [level[0]], [level[-1]]
        while len(level) > 1:
            level = 0.5 * (level[:-1] + level[1:])
            first.append(level[0])
            last.append(level[-1])
        todo += [np.array(first), np.array(last[::-1])]
    return False
