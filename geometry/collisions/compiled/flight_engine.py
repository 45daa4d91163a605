"""Compiled: where a satellite of the flying disk is, and how far from a piece of the wall. Loads numba.

Lengths are in units of the wall, so the disk's radius is 1/scale and the wall's tops are at height 0. In the time t a
disk with velocities (v1, v2) and spin omega moves a satellite at the angle a from the lowest point by

    D(t) = (v1 t + (sin(a + d) - sin a)/scale, v2 t + (cos a - cos(a + d))/scale),   d = scale omega t,

which is evaluated by products, without cancellation. A line or an upright conic is F = 0 with

    F(D) = f + g.D - curvature |D|^2/2     (y multiplied by the arc's stretch; curvature 0 for lines),

where f and g belong to the start of the flight: the rows of the planar tracer's tables, see `scene`, with circles and
ellipses in one table ``arcs``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit

# Arrays belong to the caller for the whole run. To count references to them, an atomic operation at each function that
# takes one, took a quarter of the time: these functions are compiled without numba's run time, and allocate nothing.
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
compiled = njit(**OPTIONS)
# an array that is passed costs ten arguments: small functions are inlined
inlined = njit(**OPTIONS, forceinline=True)

# The series of `turning` are cut after the tenth power: below this angle the rest is less than 3e-18 of the sum.
SMALL_TURN = 0.1
S3, S5, S7, S9 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362880.0
V2, V4, V6, V8, V10 = 1.0 / 2.0, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0, 1.0 / 3628800.0


class Motion(NamedTuple):
    """A flight: the velocities, the rate of the disk's angle, the disk's radius, and a bound of a satellite's speed."""

    v1: float
    v2: float
    omega: float
    spin: float
    radius: float
    fastest: float


@inlined
def flight(v1, v2, omega, scale):
    """The flight of a disk of radius 1/scale."""
    return Motion(v1, v2, omega, scale * omega, 1.0 / scale, math.sqrt(v1 * v1 + v2 * v2) + abs(omega))


@inlined
def turning(angle):
    """Sine of an angle and 1 - its cosine, without cancellation and quickly where it is small."""
    if abs(angle) < SMALL_TURN:
        z = angle * angle
        z2 = z * z
        # in pairs, so that no product waits for more than four others
        sine = angle + angle * z * (S3 + z * S5 + z2 * (S7 + z * S9))
        return sine, z * (V2 + z * V4 + z2 * (V6 + z * V8 + z2 * V10))
    half = math.sin(0.5 * angle)
    return 2.0 * half * math.cos(0.5 * angle), 2.0 * half * half


@inlined
def satellite_after(t, turned, turn, motion):
    """Displacement (2) of a satellite after the time t, and the sine and cosine of its angle then.

    ``turn`` is (sin a, cos a) at the start, and ``turned`` is the `turning` since then.
    """
    sine, cosine = turn
    sin_d, versed_d = turned
    d_sine, fall = cosine * sin_d - sine * versed_d, sine * sin_d + cosine * versed_d
    return (
        motion.v1 * t + d_sine * motion.radius,
        motion.v2 * t + fall * motion.radius,
        sine + d_sine,
        cosine - fall,
    )


@inlined
def towards_line(level, g1, g2, turn, motion):
    """F of a line with f = level along a flight: (level, rate, a, b) for level + rate t + a sin d + b (1 - cos d)."""
    sine, cosine = turn
    a, b = motion.radius * (g1 * cosine + g2 * sine), motion.radius * (g2 * cosine - g1 * sine)
    return level, g1 * motion.v1 + g2 * motion.v2, a, b


@inlined
def line_after(line, t, turned, motion):
    """F of a line after the time t and its first two derivatives."""
    level, rate, a, b = line
    sin_d, versed_d = turned
    f1 = rate + motion.spin * (a + b * sin_d - a * versed_d)
    f2 = motion.spin * motion.spin * (b - b * versed_d - a * sin_d)
    return level + rate * t + a * sin_d + b * versed_d, f1, f2


@inlined
def conic_after(conic, t, turned, turn, motion):
    """F of a conic after the time t, two derivatives, and b0 and b1: the third one up to t + s is at most b0 + b1 s."""
    level, g1, g2, curvature, stretch = conic
    dx, dy, sine, cosine = satellite_after(t, turned, turn, motion)
    dy *= stretch
    n1, n2 = g1 - curvature * dx, g2 - curvature * dy
    u1, u2 = motion.v1 + motion.omega * cosine, stretch * (motion.v2 + motion.omega * sine)
    bend = motion.spin * motion.omega
    f2 = bend * (stretch * n2 * cosine - n1 * sine) - curvature * (u1 * u1 + u2 * u2)
    widest = max(1.0, stretch)
    speed = widest * motion.fastest
    swing, bent = widest * bend * abs(motion.spin), abs(curvature) * speed
    third = swing * (abs(n1) + abs(n2)) + 3.0 * bent * widest * bend
    return level + 0.5 * ((g1 + n1) * dx + (g2 + n2) * dy), n1 * u1 + n2 * u2, f2, third, swing * bent
