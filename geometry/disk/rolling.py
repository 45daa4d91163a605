"""The formulas of a disk that rolls about one of its satellites, for arrays and for symbols.

A configuration is (x1, x2, alpha): the centre, with height 0 if the lowest point of the rim touches the tops, and the
angle. Lengths are in units of ``scale``, and so is ``alpha`` as an arc length of the rim. With ``scale`` 1 these are
the coordinates of Rudzis 2022, sections 1.3 and 4, with ``scale`` eps the zoomed coordinates of section 5.3. Heights
of satellites are relative to the tops; the paper's heights are smaller by 1/scale (its ``W^c + e_2`` is our wall).
``bar`` is alpha minus the nearest multiple of the spacing (alpha-bar, alpha-bar*). ``xp`` is the arithmetic: ``numpy``
for arrays, real or complex, ``sympy`` for expressions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Angle below which x - sin x is summed as a series; the difference would lose 3 bits at this angle and all bits at 0.
SERIES_ANGLE = 1.0
# x - sin x = x^3/6 (1 - x^2/20 (1 - x^2/42 (...))): at x = 1 the first omitted term is 5e-17 of the sum.
SLIP_DENOMINATORS = (20.0, 42.0, 72.0, 110.0, 156.0, 210.0, 272.0)

Vector = tuple[Any, ...]
Matrix = tuple[Vector, ...]


def rise(angle: Any, xp: Any = np) -> Any:
    """Return 1 - cos: the height of the rim above its lowest point, at an angle from it."""
    return 2 * xp.sin(angle / 2) ** 2


def slip(angle: Any, xp: Any = np) -> Any:
    """Return x - sin x: the difference in x1 between rolling along the line and rolling about a satellite."""
    if xp is not np:
        return angle - xp.sin(angle)
    square = angle * angle
    series = np.ones_like(square)
    for denominator in reversed(SLIP_DENOMINATORS):
        series = 1.0 - square / denominator * series
    return np.where(np.abs(angle) < SERIES_ANGLE, angle * square / 6.0 * series, angle - np.sin(angle))


def satellite(x1: Any, x2: Any, bar: Any, scale: Any, xp: Any = np) -> Vector:
    """Return S_k + e_2 (eq. 1.38) for bar = alpha + k rho: the satellite; G_eps (eq. 3.60') for the nearest satellite.

    G_eps as printed equals G_0 o H_eps^(-1) on Z^0* only; elsewhere the product has k rho/eps more in x1. The formula
    here maps M* onto the free part of the plane.
    """
    return x1 + xp.sin(scale * bar) / scale, x2 + rise(scale * bar, xp) / scale


def satellite_differential(bar: Any, scale: Any, xp: Any = np) -> Matrix:
    """Return the differential of `satellite` in (x1, x2, alpha): dG_eps (eq. 3.66)."""
    return (1, 0, xp.cos(scale * bar)), (0, 1, xp.sin(scale * bar))


def roll(s1: Any, s2: Any, bar: Any, scale: Any, xp: Any = np) -> Vector:
    """Return the centre of the disk with contact satellite at (s1, s2): F (eq. 4.4), f* (eq. 3.56, corrected)."""
    return s1 - xp.sin(scale * bar) / scale, s2 - rise(scale * bar, xp) / scale


def roll_linear(s1: Any, s2: Any, alpha: Any) -> Vector:
    """Return f_lin: the linear part of `roll` at alpha = 0, with alpha; the chart of M_cyl (section 4.2)."""
    return s1 - alpha, s2, alpha


def straight_contact(x1: Any, x2: Any, alpha: Any) -> Vector:
    """Return G_0, the inverse of `roll_linear` for each alpha (section 4.2; section 1.3.3 prints (x1 + alpha, alpha)).

    A configuration is in M_cyl if its image is in the free part of the plane.
    """
    return x1 + alpha, x2


def bend(y1: Any, y2: Any, bar: Any, scale: Any, xp: Any = np) -> Vector:
    """Return the centre of H_1 (eq. 4.43) or H_eps (eq. 3.54) at a point of the cylinder; alpha is invariant."""
    return y1 + slip(scale * bar, xp) / scale, y2 - rise(scale * bar, xp) / scale


def straighten(x1: Any, x2: Any, bar: Any, scale: Any, xp: Any = np) -> Vector:
    """Return the inverse of `bend`."""
    return x1 - slip(scale * bar, xp) / scale, x2 + rise(scale * bar, xp) / scale


def bend_differential(bar: Any, scale: Any, xp: Any = np) -> Matrix:
    """Return the differential of H_1 or H_eps in (x1, x2, alpha)."""
    return (1, 0, rise(scale * bar, xp)), (0, 1, -xp.sin(scale * bar)), (0, 0, 1)


def project(x1: Any, x2: Any, alpha: Any, v1: Any, v2: Any, omega: Any) -> Vector:
    """Return (x1, alpha) at x2 = 0 on the line along the velocity: the position of Psi (eq. 4.66)."""
    return x1 - x2 / v2 * v1, alpha - x2 / v2 * omega


def project_differential(x2: Any, v1: Any, v2: Any, omega: Any) -> Matrix:
    """Return the differential of `project` in (x1, x2, alpha, v1, v2, omega)."""
    time = x2 / v2
    return (1, -v1 / v2, 0, -time, time * v1 / v2, 0), (0, -omega / v2, 1, 0, time * omega / v2, -time)


def transfer(x1: Any, alpha: Any, bar: Any, velocity: Vector, scale: Any, xp: Any = np) -> Vector:
    """Return phi_w, the position of eta = Psi o H_1 (eq. 4.75; section 5.2 prints all terms in bar with wrong sign)."""
    y1, y2 = bend(x1, 0, bar, scale, xp)
    return project(y1, y2, alpha, *velocity)


def transfer_differential(bar: Any, velocity: Vector, scale: Any, xp: Any = np) -> Matrix:
    """Return the differential of `transfer` in (x1, alpha, v1, v2, omega); columns 1 and 2 are d phi_w (corrected)."""
    v1, v2, omega = velocity
    up, sin = rise(scale * bar, xp), xp.sin(scale * bar)
    time = up / scale / v2
    return (
        (1, up + sin * v1 / v2, time, -time * v1 / v2, 0),
        (0, 1 + sin * omega / v2, 0, -time * omega / v2, time),
    )


def gap_radius(depth: Any, spacing: Any, xp: Any = np) -> Any:
    """Return delta_0, beyond which from odd multiples of rho/2 adjacent heights differ by more than ``depth``.

    The heights of adjacent satellites differ by 2 sin(rho/2) sin(rho/2 - bar), so the radius delta_0 is sharp (section
    4.1, Claim 4.2.1).
    """
    return xp.asin(depth / (2 * xp.sin(spacing / 2)))


def good_half_width(scale: Any, depth: Any, spacing: Any, length: Any) -> Any:
    """Return the half-width of the angles of the set Xi in units of ``scale`` (section 5.3.5, corrected).

    A first flight of length L log(1/rho) + 1 and log(1/rho)/(4 log log(1/rho)) more of length L log(1/rho), which begin
    at such an angle, end before a second satellite comes below the tops.
    """
    ell = np.log(1 / spacing)
    free = (spacing / 2 - gap_radius(depth, spacing)) / scale
    return free - (length * ell + 1) - length * ell**2 / (4 * np.log(ell))
