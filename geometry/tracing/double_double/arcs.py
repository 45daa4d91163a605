"""The hits of a ray on circular and elliptic arcs in double-double arithmetic."""

from __future__ import annotations

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
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

_compile = jit(linked=True, _nrt=False)


@jit()
def refined_arcs(arcs):
    """Return the table of arcs that go through both joints exactly and subtend their span exactly."""
    # at least one row, because `face_of` passes a row also for a wall without arcs
    table = np.zeros((max(1, arcs.shape[0]), c.WIDE_ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        stretch = arcs[k, c.STRETCH]
        x0, y0, x1, y1 = arcs[k, c.START_X], arcs[k, c.START_Y], arcs[k, c.END_X], arcs[k, c.END_Y]
        cx = two_sum(x1, -x0)
        cy = multiply(wide(stretch), two_sum(y1, -y0))
        length = square_root(dot(cx, cy, cx, cy))
        ex, ey = divide(cx, length), divide(cy, length)
        sine, cosine = sine_cosine(0.5 * arcs[k, c.SPAN])
        if arcs[k, c.CURVATURE] < 0.0:
            sine = negate(sine)
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx = subtract(multiply(sine, ex), multiply(cosine, ey))
        ny = add(multiply(sine, ey), multiply(cosine, ex))
        curvature = divide((2.0 * sine[0], 2.0 * sine[1]), length)
        row = table[k]
        row[c.START_X], row[c.START_Y] = x0, y0
        row[c.WIDE_NORMAL_X], row[c.WIDE_NORMAL_X_LOW] = nx
        row[c.WIDE_NORMAL_Y], row[c.WIDE_NORMAL_Y_LOW] = ny
        row[c.WIDE_CURVATURE], row[c.WIDE_CURVATURE_LOW] = curvature
        row[c.WIDE_CHORD_X], row[c.WIDE_CHORD_X_LOW] = ex
        row[c.WIDE_CHORD_Y], row[c.WIDE_CHORD_Y_LOW] = ey
        row[c.WIDE_CHORD], row[c.WIDE_CHORD_LOW] = length
        row[c.IS_SHORT] = 1.0 if arcs[k, c.SHORT_CHORD] > 0.0 else 0.0
        row[c.WIDE_STRETCH] = stretch
        row[c.WIDE_SPAN], row[c.WIDE_RUN_SINE] = arcs[k, c.SPAN], arcs[k, c.RUN_SINE]
        row[c.END_X], row[c.END_Y] = x1, y1
    return table


@_compile
def wide_arc(arc):
    """-> (n0x, n0y, curvature, stretch): double-doubles from a row of `refined_arcs`."""
    return (
        (arc[c.WIDE_NORMAL_X], arc[c.WIDE_NORMAL_X_LOW]),
        (arc[c.WIDE_NORMAL_Y], arc[c.WIDE_NORMAL_Y_LOW]),
        (arc[c.WIDE_CURVATURE], arc[c.WIDE_CURVATURE_LOW]),
        wide(arc[c.WIDE_STRETCH]),
    )


@_compile
def arc_hit(arc, own, px, py, vx, vy, error):
    """-> (t, undecided, height): time to the front of one arc, or inf; time of an undecided contact, or inf.

    For ``height`` see `arc_time` in `compiled/pieces`. ``error`` bounds the transversal error of the ray at the arc.
    """
    nothing = (np.inf, 0.0)
    n0x, n0y, curvature, stretch = wide_arc(arc)
    rx, ry = subtract(px, wide(arc[c.START_X])), multiply(stretch, subtract(py, wide(arc[c.START_Y])))
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
            # d = w^2 - kappa^2 (distance of the line from the centre)^2 w^2; kappa times distance is about 1 at d = 0
            wide_stretch = max(1.0, arc[c.WIDE_STRETCH]) ** 2
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
    slack = error * max(1.0, arc[c.WIDE_STRETCH])
    if not on_arc(arc, add(rx, multiply(t, vx)), add(ry, multiply(t, wy)), slack):
        return nothing, undecided, np.inf
    return t, undecided, height


@_compile
def on_arc(arc, qx, qy, slack):
    """Whether the point q of the full circle, relative to the first joint, is on the arc."""
    ex, ey = (arc[c.WIDE_CHORD_X], arc[c.WIDE_CHORD_X_LOW]), (arc[c.WIDE_CHORD_Y], arc[c.WIDE_CHORD_Y_LOW])
    if arc[c.IS_SHORT] > 0.0:
        along = dot(qx, qy, ex, ey)
        nx, ny = (
            arc[c.WIDE_NORMAL_X] - arc[c.WIDE_CURVATURE] * qx[0],
            arc[c.WIDE_NORMAL_Y] - arc[c.WIDE_CURVATURE] * qy[0],
        )
        facing = ny * ex[0] - nx * ey[0]
        beyond = subtract(along, (arc[c.WIDE_CHORD], arc[c.WIDE_CHORD_LOW]))
        return -slack <= along[0] and beyond[0] <= slack and facing > 0.0
    height = cross(ex, ey, qx, qy)[0]
    return height <= slack if arc[c.WIDE_CURVATURE] > 0.0 else height >= -slack


@_compile
def arc_height(arc, px, py):
    """-> (height, nx, ny): distance of a position close to an arc, positive on the free side; unit normal."""
    n0x, n0y, curvature, stretch = wide_arc(arc)
    qx, qy = subtract(px, wide(arc[c.START_X])), multiply(stretch, subtract(py, wide(arc[c.START_Y])))
    nx = subtract(n0x, multiply(curvature, qx))
    ny = multiply(stretch, subtract(n0y, multiply(curvature, qy)))
    r2 = multiply(curvature, dot(qx, qy, qx, qy))
    f = subtract(dot(n0x, n0y, qx, qy), (0.5 * r2[0], 0.5 * r2[1]))
    size = square_root(dot(nx, ny, nx, ny))
    return divide(f, size), divide(nx, size), divide(ny, size)


@_compile
def arc_point(arc, t, px, py, vx, vy):
    """-> (x, y, nx, ny, bent): the position on the arc after the time t, unit normal, and curvature (a double)."""
    n0x, n0y, curvature, stretch = wide_arc(arc)
    qx = subtract(add(px, multiply(t, vx)), wide(arc[c.START_X]))
    qy = multiply(stretch, subtract(add(py, multiply(t, vy)), wide(arc[c.START_Y])))
    nx, ny = subtract(n0x, multiply(curvature, qx)), subtract(n0y, multiply(curvature, qy))
    r2 = multiply(curvature, dot(qx, qy, qx, qy))
    f = subtract(dot(n0x, n0y, qx, qy), (0.5 * r2[0], 0.5 * r2[1]))
    qx, qy = subtract(qx, multiply(f, nx)), subtract(qy, multiply(f, ny))
    nx = subtract(n0x, multiply(curvature, qx))
    ny = multiply(stretch, subtract(n0y, multiply(curvature, qy)))
    size = square_root(dot(nx, ny, nx, ny))
    nx, ny = divide(nx, size), divide(ny, size)
    bent = arc[c.WIDE_CURVATURE] * (ny[0] * ny[0] + (arc[c.WIDE_STRETCH] * nx[0]) ** 2) / size[0]
    x = add(wide(arc[c.START_X]), qx)
    y = add(wide(arc[c.START_Y]), divide(qy, stretch) if arc[c.WIDE_STRETCH] != 1.0 else qy)
    return x, y, nx, ny, bent
