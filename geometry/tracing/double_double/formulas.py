"""The formulas of a ray that serve doubles and double-doubles: openings, reflection, arcs, cubics. Loads numba.

`compiled/pieces` explains them. Loops over many rays call them, too, so they have choices by `where` in place of
branches.
"""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic

from ....core.compilation import jit
from ...scene import columns as c
from .numbers import DOUBLE_DOUBLE, cross, dot, root, scaled

# In place of a hollow's number: a flat top, and a corner at an end of an opening.
FLAT_TOP, TOP_CORNER = -1, -2
_formula = jit(forceinline=True, _nrt=False)


@intrinsic
def where(typing, condition, yes, no):
    """-> number: one of two numbers of the same type, both of which are computed, without a branch.

    A conditional expression is a branch at first. The compiler would join those of one condition, and then write to the
    columns of a wave with a mask, which is slow on many processors, or not vectorise at all.
    """
    number = DOUBLE_DOUBLE if yes == DOUBLE_DOUBLE else types.float64

    def select(context, builder, signature, values):
        return builder.select(*values)

    return number(types.boolean, number, number), select


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
