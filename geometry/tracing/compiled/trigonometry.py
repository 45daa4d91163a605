"""Sine and cosine of an angle, and the angle of a direction, by polynomials without branches.

The compiler vectorises loops over rays that call these functions, unlike calls of the mathematical library. The
functions use sums, products, quotients and selections only, so a ray's result does not depend on other rays. The
coefficients come from ``campaigns/judges/precise_polynomials.py``; errors are below 2 ulp of the result, at all angles.
"""

from __future__ import annotations

from ....core.compilation import jit

# pi as the sum of two doubles
PI, PI_REST = 3.141592653589793, 1.2246467991473532e-16
# The largest double below PI, for outgoing angles that round to PI. Incoming angles are below PI, too, so every
# outgoing ray can be reversed.
LAST_ANGLE = 3.1415926535897927
HALF_PI, HALF_PI_REST = 0.5 * PI, 0.5 * PI_REST
QUARTER_PI = 0.25 * PI

# (sin z - z) / z^3 and (cos z - 1 + z^2 / 2) / z^4 up to z = pi/4, (arcsin z - z) / z^3 up to sqrt(1/2), in u = z^2
SINE = (
    -0.16666666666666666,
    0.008333333333330946,
    -0.000198412698367542,
    2.7557316100283695e-06,
    -2.5051131372218632e-08,
    1.5918095236696272e-10,
)
COSINE = (
    0.041666666666666664,
    -0.0013888888888887395,
    2.480158729876295e-05,
    -2.755731727031051e-07,
    2.087614597263508e-09,
    -1.1382611119025631e-11,
)
ARCSINE = (
    0.1666666666666666,
    0.07500000000009026,
    0.044642857123497116,
    0.030381946085155785,
    0.022372086000675934,
    0.017354738454250354,
    0.013929692795945648,
    0.011987098944218101,
    0.005879021572263626,
    0.033903765800568045,
    -0.11784389466837264,
    0.4670595090986631,
    -1.2618508569211755,
    2.579394702947496,
    -3.749367186721465,
    3.738541117958722,
    -2.281678089758424,
    0.6638457554315355,
)

_compile = jit(forceinline=True, no_cpython_wrapper=True)


@_compile
def sine_cosine(theta):
    """Return sine and cosine of an angle in [0, pi]."""
    # angles from the vertical and from the nearer horizontal
    off = (theta - HALF_PI) - HALF_PI_REST
    upright = -off if off < 0.0 else off
    flat = theta if off < 0.0 else (PI - theta) + PI_REST
    steep = upright < QUARTER_PI
    z = upright if steep else flat
    u = z * z
    p = SINE[0] + u * (SINE[1] + u * (SINE[2] + u * (SINE[3] + u * (SINE[4] + u * SINE[5]))))
    q = COSINE[0] + u * (COSINE[1] + u * (COSINE[2] + u * (COSINE[3] + u * (COSINE[4] + u * COSINE[5]))))
    small = z + z * u * p
    large = 1.0 - (0.5 * u - u * u * q)
    cosine = small if steep else large
    return (large if steep else small), (cosine if off < 0.0 else -cosine)


@_compile
def mirrored(theta):
    """Return pi - theta, at most `LAST_ANGLE`."""
    angle = (PI - theta) + PI_REST
    return angle if angle < LAST_ANGLE else LAST_ANGLE


@_compile
def arcsine(z):
    """Return the arcsine of a number in [0, sqrt(1/2)]."""
    # Estrin's scheme: short chains of operations, so that the processor computes several rays at once
    u = z * z
    u2 = u * u
    u4 = u2 * u2
    a0, a1 = ARCSINE[0] + u * ARCSINE[1], ARCSINE[2] + u * ARCSINE[3]
    a2, a3 = ARCSINE[4] + u * ARCSINE[5], ARCSINE[6] + u * ARCSINE[7]
    a4, a5 = ARCSINE[8] + u * ARCSINE[9], ARCSINE[10] + u * ARCSINE[11]
    a6, a7 = ARCSINE[12] + u * ARCSINE[13], ARCSINE[14] + u * ARCSINE[15]
    a8 = ARCSINE[16] + u * ARCSINE[17]
    low = (a0 + u2 * a1) + u4 * (a2 + u2 * a3)
    high = (a4 + u2 * a5) + u4 * (a6 + u2 * a7)
    p = low + (u4 * u4) * (high + (u4 * u4) * a8)
    return z + z * (u * p)


@_compile
def direction_angle(vx, vy):
    """Return the angle in [-pi, pi] of a unit vector; its error is at most the relative error of the length."""
    ax = -vx if vx < 0.0 else vx
    ay = -vy if vy < 0.0 else vy
    flat = ay < ax
    small = arcsine(ay if flat else ax)
    angle = small if flat else HALF_PI - small
    angle = PI - angle if vx < 0.0 else angle
    return -angle if vy < 0.0 else angle
