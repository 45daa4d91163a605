"""The formulas of a ray that serve doubles and double-doubles: openings, reflection, arcs, cubics. Loads numba.

`compiled/pieces` explains them. Loops over many rays call them, too, so they have choices by `where` in place of
branches.
"""

from __future__ import annotations

import math
from functools import partial

from numba import types
from numba.extending import intrinsic

from ....core.compilation import jit
from ...scene import columns as c
from ...scene.tolerances import NEARBY
from .numbers import DOUBLE_DOUBLE, cross, dot, extend, root, scaled

# In place of a hollow's number: a flat top, and a corner at an end of an opening.
FLAT_TOP, TOP_CORNER = -1, -2
_formula = jit(forceinline=True, _nrt=False)


@intrinsic
def where(typing, condition, yes, no):
    """-> number: one of two numbers, a double-double if one of them is; both are computed, and there is no branch.

    A conditional expression is a branch at first. The compiler would join those of one condition, and then write to the
    columns of a wave with a mask, which is slow on many processors, or not vectorise at all.
    """
    if DOUBLE_DOUBLE not in (yes, no):
        return types.float64(types.boolean, types.float64, types.float64), lambda *given: given[1].select(*given[3])

    def select(context, builder, signature, values):
        return builder.select(values[0], *map(partial(extend, context, builder), (yes, no), values[1:]))

    return DOUBLE_DOUBLE(types.boolean, yes, no), select


@_formula
def opening_met(left, right, px, py, vx, vy):
    """-> (t, is_met): time to the level of the opening, and whether the ray passes between its ends upwards."""
    c_right, c_left = (right - px) * vy + py * vx, (left - px) * vy + py * vx
    t = -py / vy
    return where(t > 0.0, t, 0.0), (vy > 0.0) & (c_right >= 0.0) & (c_left <= 0.0)


@_formula
def mirror(vx, vy, nx, ny):
    """-> (vx, vy): the velocity after the reflection on a piece with a unit normal."""
    w = scaled(2.0, dot(vx, vy, nx, ny))
    return vx - w * nx, vy - w * ny


@_formula
def with_length_one(vx, vy):
    """-> (vx, vy): one Newton step on |v| = 1, so that errors of speed and position do not amplify each other."""
    scale = 1.5 - scaled(0.5, dot(vx, vy, vx, vy))
    return scale * vx, scale * vy


@_formula
def form_value(form, x, y):
    """-> number: F at a position relative to the first joint; ``form`` are the numbers n0 and kappa of F."""
    nx, ny, curvature = form
    return dot(nx, ny, x, y) - scaled(0.5, curvature * dot(x, y, x, y))


@_formula
def arc_normal(form, stretch, x, y):
    """-> (nx, ny): the gradient of F with its y stretched: a normal of the arc, without stretch the unit normal."""
    nx, ny, curvature = form
    return nx - curvature * x, stretch * (ny - curvature * y)


@_formula
def back_on_arc(form, x, y):
    """-> (x, y): a position next to an arc after one Newton step on F, which puts it on the arc."""
    f, (nx, ny) = form_value(form, x, y), arc_normal(form, 1.0, x, y)
    return x - f * nx, y - f * ny


@_formula
def beyond_end(form, chord, x, y):
    """-> number: how far a point of the full circle, relative to the first joint, is beyond an end of the arc.

    The distance is along or across the chord, inf on the far side of the circle, and at most 0 on the arc. ``chord`` is
    the unit vector along it, and its length, 0 for half angles beyond pi/4.
    """
    (_, _, curvature), (ex, ey, short) = form, chord
    # up to a half angle of pi/4: by the position along the chord, on the arc's side of the circle
    along, (nx, ny) = dot(x, y, ex, ey), arc_normal(form, 1.0, x, y)
    beyond = where(-along > along - short, -along, along - short)
    # larger half angles: by the side of the chord; the arc curves away from its free side exactly if it is focusing
    height = cross(ex, ey, x, y)
    height = where(curvature > 0.0, height, -height)
    return where(short > 0.0, where(cross(ex, ey, nx, ny) > 0.0, beyond, float("inf")), height)


@_formula
def arc_terms(form, x, y, vx, vy):
    """-> (b, f, d, speed2): the numbers B, F, D and |v|^2 of a ray, in coordinates with a circular arc."""
    nx, ny, curvature = form
    b = dot(nx, ny, vx, vy) - curvature * dot(x, y, vx, vy)
    f, speed2 = form_value(form, x, y), dot(vx, vy, vx, vy)
    return b, f, b * b + scaled(2.0, curvature * speed2 * f), speed2


@_formula
def arc_root(form, is_own, b, f, root_of_d, speed2):
    """-> number: time to the front of an arc, of a ray that meets it."""
    _, _, curvature = form
    # only of a focusing arc
    far = b >= where(curvature > 0.0, 0.0, float("inf"))
    top = where(is_own, scaled(2.0, b), where(far, b + root_of_d, scaled(2.0, f)))
    return top / where(is_own | far, curvature * speed2, root_of_d - b)


@_formula
def cubic(a, s):
    """-> number: the cubic with the coefficients a at s."""
    a0, a1, a2, a3 = a
    return ((a3 * s + a2) * s + a1) * s + a0


@_formula
def cubic_slope(a, s):
    """-> number: the derivative of the cubic with the coefficients a at s."""
    _, a1, a2, a3 = a
    return (3.0 * a3 * s + scaled(2.0, a2)) * s + a1


@_formula
def extrema(a):
    """-> (first, second): the extrema of a cubic in increasing order; those outside (0, 1) may be any numbers."""
    _, a1, a2, a3 = a
    disc = a2 * a2 - 3.0 * a3 * a1
    half = root(disc)
    q = -(a2 + where(a2 >= 0.0, half, -half))
    one, other = q / (3.0 * a3), a1 / q
    first, second = where(one < other, one, other), where(one < other, other, one)
    return where(disc > 0.0, first, 2.0), where(disc > 0.0, second, 2.0)


@_formula
def is_close_by(tangent, s, t, vx, vy, spread, slack):
    """-> bool: whether a hit at s on a Bezier piece after the time t (of either sign) is within the slack of the start.

    All numbers are doubles. A hit behind the start is not if the start lies beyond an end of the piece: the ray has
    left the next piece, and rounding across the two pieces does not change the end that it has passed.
    """
    tx, ty = tangent
    size = math.sqrt(tx * tx + ty * ty)
    # the height in front of the curve is t times the sine of incidence
    close = abs(t) <= NEARBY * spread and abs(t * (ty * vx - tx * vy)) <= slack * size
    behind = t * (tx * vx + ty * vy)
    return close and (t >= 0.0 or -slack * size <= s * size * size - behind <= size * size + slack * size)


@_formula
def quadratic_roots(b0, b1, b2, disc):
    """-> (first, second): the roots of b2 sigma^2 + b1 sigma + b0; inf or NaN where there is none."""
    half = root(disc)
    q = scaled(-0.5, b1 + where(b1 >= 0.0, half, -half))
    return q / b2, b0 / q


@_formula
def bezier_time(coefficients, s, px, py, vx, vy):
    """-> number: the distance along the ray to the point s of a curve."""
    ax, ay = coefficients
    return dot(cubic(ax, s) - px, cubic(ay, s) - py, vx, vy)


@_formula
def bezier_sides(coefficients, px, py, vx, vy):
    """-> (a0, a1, a2, a3): the coefficients of g, from those of both coordinates of a curve."""
    (x0, x1, x2, x3), (y0, y1, y2, y3) = coefficients
    return cross(x0 - px, y0 - py, vx, vy), cross(x1, y1, vx, vy), cross(x2, y2, vx, vy), cross(x3, y3, vx, vy)


@_formula
def last_hollow(entry, hollows, count):
    """-> int: number of the last hollow with left end <= entry, -1 if there is none."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if hollows[middle, c.LEFT] <= entry:
            low = middle + 1
        else:
            high = middle
    return low - 1


@_formula
def opening_at(entry, hollows, count):
    """-> int: number of the hollow whose opening contains a position of the cell, or `FLAT_TOP`, or `TOP_CORNER`."""
    h = last_hollow(entry, hollows, count)
    if h < 0 or entry >= hollows[h, c.RIGHT] or (entry == hollows[h, c.LEFT] and hollows[h, c.LEFT_EDGE] != c.NO_EDGE):
        # a flat top or its edge; an edge between two hollows is a corner
        at_left = h >= 0 and entry == hollows[h, c.LEFT] and hollows[h, c.LEFT_EDGE] == c.CORNER_EDGE
        at_right = h >= 0 and entry == hollows[h, c.RIGHT] and hollows[h, c.RIGHT_EDGE] == c.CORNER_EDGE
        return TOP_CORNER if at_left or at_right else FLAT_TOP
    return h
