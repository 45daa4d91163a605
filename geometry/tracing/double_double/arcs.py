"""Hits of a ray on circular and elliptic arcs in double-double arithmetic."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arithmetic import (
    LOCAL_ERROR,
    add,
    cross,
    divide,
    dot,
    multiply,
    negate,
    sine_cosine,
    square_root,
    subtract,
    two_sum,
    wide,
)

ARC_COLUMNS = 18

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def refined_arcs(arcs):
    """The table of arcs that go through both joints exactly and subtend their span exactly.

    Columns: first joint (2), then pairs: normal there (2 x 2), curvature, chord direction (2 x 2), chord length; then
    1 where the chord decides by position, stretch, last joint (2).
    """
    # at least one row, so that a wall without arcs has one to pass on
    table = np.zeros((max(1, arcs.shape[0]), ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        stretch = arcs[k, 12]
        x0, y0, x1, y1 = arcs[k, 13], arcs[k, 14], arcs[k, 15], arcs[k, 16]
        cx = two_sum(x1, -x0)
        cy = multiply(wide(stretch), two_sum(y1, -y0))
        length = square_root(dot(cx, cy, cx, cy))
        ex, ey = divide(cx, length), divide(cy, length)
        sine, cosine = sine_cosine(0.5 * arcs[k, 11])
        if arcs[k, 4] < 0.0:
            sine = negate(sine)
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx = subtract(multiply(sine, ex), multiply(cosine, ey))
        ny = add(multiply(sine, ey), multiply(cosine, ex))
        curvature = divide((2.0 * sine[0], 2.0 * sine[1]), length)
        row = table[k]
        row[0], row[1] = x0, y0
        row[2], row[3] = nx
        row[4], row[5] = ny
        row[6], row[7] = curvature
        row[8], row[9] = ex
        row[10], row[11] = ey
        row[12], row[13] = length
        row[14] = 1.0 if arcs[k, 7] > 0.0 else 0.0
        row[15] = stretch
        row[16], row[17] = x1, y1
    return table


@_compile
def arc_hit(arc, own, px, py, vx, vy, error):
    """Flight time to the front of one arc, inf if none; time of a contact that is undecided, or inf; and the height.

    The height is that of `arc_time` in `compiled/arcs`. ``error`` bounds the transversal error of the ray there.
    """
    nothing = (np.inf, 0.0)
    n0x, n0y, curvature = (arc[2], arc[3]), (arc[4], arc[5]), (arc[6], arc[7])
    stretch = wide(arc[15])
    rx, ry = subtract(px, wide(arc[0])), multiply(stretch, subtract(py, wide(arc[1])))
    wy = multiply(stretch, vy)
    b = subtract(dot(n0x, n0y, vx, wy), multiply(curvature, dot(rx, ry, vx, wy)))
    speed2 = dot(vx, wy, vx, wy)
    bend = multiply(curvature, speed2)
    undecided = np.inf
    if own:
        if curvature[0] <= 0.0 or b[0] <= 0.0:
            return nothing, undecided, np.inf
        t = divide((2.0 * b[0], 2.0 * b[1]), bend)
        height = np.inf
    else:
        r2 = multiply(curvature, dot(rx, ry, rx, ry))
        f = subtract(dot(n0x, n0y, rx, ry), (0.5 * r2[0], 0.5 * r2[1]))
        product = multiply(bend, f)
        d = add(multiply(b, b), (2.0 * product[0], 2.0 * product[1]))
        if curvature[0] < 0.0 and b[0] < 0.0:
            # d = w^2 - kappa^2 (distance of the line from the centre)^2 w^2, and kappa distance is about 1 where d is 0
            wide_stretch = max(1.0, arc[15]) ** 2
            noise = 8.0 * LOCAL_ERROR * (b[0] * b[0] + 2.0 * abs(product[0]))
            if abs(d[0]) <= noise + 4.0 * abs(curvature[0]) * wide_stretch * wide_stretch * error:
                t = divide((2.0 * f[0], 2.0 * f[1]), negate(b))
                if t[0] > 0.0 and on_arc(arc, add(rx, multiply(t, vx)), add(ry, multiply(t, wy)), error):
                    undecided = t[0]
        if d[0] < 0.0:
            return nothing, undecided, np.inf
        root = square_root(d)
        if b[0] >= 0.0:
            if curvature[0] <= 0.0:
                return nothing, undecided, np.inf
            t = divide(add(b, root), bend)
            height = np.inf
        else:
            t = divide((2.0 * f[0], 2.0 * f[1]), subtract(root, b))
            height = f[0]
    slack = error * max(1.0, arc[15])
    if not on_arc(arc, add(rx, multiply(t, vx)), add(ry, multiply(t, wy)), slack):
        return nothing, undecided, np.inf
    return t, undecided, height


@_compile
def on_arc(arc, qx, qy, slack):
    """Whether the point q on the full circle, measured from the first joint, belongs to the arc."""
    ex, ey = (arc[8], arc[9]), (arc[10], arc[11])
    if arc[14] > 0.0:
        along = dot(qx, qy, ex, ey)
        facing = (arc[4] - arc[6] * qy[0]) * ex[0] - (arc[2] - arc[6] * qx[0]) * ey[0]
        return -slack <= along[0] and subtract(along, (arc[12], arc[13]))[0] <= slack and facing > 0.0
    height = cross(ex, ey, qx, qy)[0]
    return height <= slack if arc[6] > 0.0 else height >= -slack


@_compile
def arc_height(arc, px, py):
    """Distance of a place close to an arc from it, positive on its free side, and the unit normal there."""
    n0x, n0y, curvature = (arc[2], arc[3]), (arc[4], arc[5]), (arc[6], arc[7])
    stretch = wide(arc[15])
    qx, qy = subtract(px, wide(arc[0])), multiply(stretch, subtract(py, wide(arc[1])))
    nx = subtract(n0x, multiply(curvature, qx))
    ny = multiply(stretch, subtract(n0y, multiply(curvature, qy)))
    r2 = multiply(curvature, dot(qx, qy, qx, qy))
    f = subtract(dot(n0x, n0y, qx, qy), (0.5 * r2[0], 0.5 * r2[1]))
    size = square_root(dot(nx, ny, nx, ny))
    return divide(f, size), divide(nx, size), divide(ny, size)


@_compile
def arc_place(arc, t, px, py, vx, vy):
    """Position on the arc after the time t, unit normal there, and the curvature of the arc there (a double)."""
    n0x, n0y, curvature = (arc[2], arc[3]), (arc[4], arc[5]), (arc[6], arc[7])
    stretch = wide(arc[15])
    qx = subtract(add(px, multiply(t, vx)), wide(arc[0]))
    qy = multiply(stretch, subtract(add(py, multiply(t, vy)), wide(arc[1])))
    nx, ny = subtract(n0x, multiply(curvature, qx)), subtract(n0y, multiply(curvature, qy))
    r2 = multiply(curvature, dot(qx, qy, qx, qy))
    f = subtract(dot(n0x, n0y, qx, qy), (0.5 * r2[0], 0.5 * r2[1]))
    qx, qy = subtract(qx, multiply(f, nx)), subtract(qy, multiply(f, ny))
    nx = subtract(n0x, multiply(curvature, qx))
    ny = multiply(stretch, subtract(n0y, multiply(curvature, qy)))
    size = square_root(dot(nx, ny, nx, ny))
    nx, ny = divide(nx, size), divide(ny, size)
    bent = arc[6] * (ny[0] * ny[0] + (arc[15] * nx[0]) ** 2) / size[0]
    x = add(wide(arc[0]), qx)
    y = add(wide(arc[1]), divide(qy, stretch) if arc[15] != 1.0 else qy)
    return x, y, nx, ny, bent
