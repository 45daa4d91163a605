"""The hits of a ray on circular and elliptic arcs in double-double arithmetic."""

from __future__ import annotations

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
from .formulas import arc_normal, arc_root, arc_terms, back_on_arc, form_value
from .numbers import LOCAL_ERROR, cross, dot, double_double, extended, root, scaled, sine_cosine, two_sum

_compile = jit(linked=True, _nrt=False)


@jit()
def refined_arcs(arcs):
    """Return the table of arcs that go through both joints exactly and subtend their span exactly."""
    # at least one row, because `face_of` passes a row also for a wall without arcs
    table = np.zeros((max(1, arcs.shape[0]), c.REFINED_ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        arc, row = arcs[k], table[k]
        cx, cy = two_sum(arc[c.END_X], -arc[c.START_X]), arc[c.STRETCH] * two_sum(arc[c.END_Y], -arc[c.START_Y])
        length = root(dot(cx, cy, cx, cy))
        ex, ey = cx / length, cy / length
        sine, cosine = sine_cosine(0.5 * arc[c.SPAN])
        if arc[c.CURVATURE] < 0.0:
            sine = -sine
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx, ny = sine * ex - cosine * ey, sine * ey + cosine * ex
        curvature = scaled(2.0, sine) / length
        row[c.START_X], row[c.START_Y], row[c.END_X], row[c.END_Y] = arc[: c.END_Y + 1]
        row[c.REFINED_NORMAL_X], row[c.REFINED_NORMAL_X_LOW] = nx.high, nx.low
        row[c.REFINED_NORMAL_Y], row[c.REFINED_NORMAL_Y_LOW] = ny.high, ny.low
        row[c.REFINED_CURVATURE], row[c.REFINED_CURVATURE_LOW] = curvature.high, curvature.low
        row[c.REFINED_CHORD_X], row[c.REFINED_CHORD_X_LOW] = ex.high, ex.low
        row[c.REFINED_CHORD_Y], row[c.REFINED_CHORD_Y_LOW] = ey.high, ey.low
        row[c.REFINED_CHORD], row[c.REFINED_CHORD_LOW] = length.high, length.low
        row[c.IS_SHORT] = 1.0 if arc[c.SHORT_CHORD] > 0.0 else 0.0
        row[c.REFINED_STRETCH], row[c.REFINED_SPAN], row[c.REFINED_RUN_SINE] = (
            arc[c.STRETCH],
            arc[c.SPAN],
            arc[c.RUN_SINE],
        )
    return table


@_compile
def arc_form(arc):
    """-> (n0x, n0y, curvature): the numbers of F, see `compiled/arcs`, from a row of `refined_arcs`."""
    return (
        double_double(arc[c.REFINED_NORMAL_X], arc[c.REFINED_NORMAL_X_LOW]),
        double_double(arc[c.REFINED_NORMAL_Y], arc[c.REFINED_NORMAL_Y_LOW]),
        double_double(arc[c.REFINED_CURVATURE], arc[c.REFINED_CURVATURE_LOW]),
    )


@_compile
def arc_hit(arc, own, px, py, vx, vy, error):
    """-> (t, undecided, height): time to the front of one arc, or inf; time of an undecided contact, or inf.

    For ``height`` see `arc_time` in `compiled/pieces`. ``error`` bounds the transversal error of the ray at the arc.
    """
    form, stretch, undecided = arc_form(arc), arc[c.REFINED_STRETCH], np.inf
    rx, ry, wy = px - arc[c.START_X], stretch * (py - arc[c.START_Y]), stretch * vy
    b, f, d, speed2 = arc_terms(form, rx, ry, vx, wy)
    _, _, curvature = form
    if not own and curvature < 0.0 and b < 0.0:
        # d = w^2 - kappa^2 (distance of the line from the centre)^2 w^2; kappa times distance is about 1 at d = 0
        widest = max(1.0, stretch) ** 2
        noise = 8.0 * LOCAL_ERROR * (b.high * b.high + 2.0 * abs((curvature * speed2 * f).high))
        if abs(d.high) <= noise + 4.0 * abs(curvature.high) * widest * widest * error:
            t = arc_root(form, own, b, f, extended(0.0), speed2)
            if t > 0.0 and on_arc(arc, rx + t * vx, ry + t * wy, error):
                undecided = t.high
    far = own or b >= 0.0
    if (far and curvature <= 0.0) or (own and b <= 0.0) or (not own and d < 0.0):
        return extended(np.inf), undecided, np.inf
    t = arc_root(form, own, b, f, root(d), speed2)
    if not on_arc(arc, rx + t * vx, ry + t * wy, error * max(1.0, stretch)):
        return extended(np.inf), undecided, np.inf
    return t, undecided, np.inf if far else f.high


@_compile
def on_arc(arc, qx, qy, slack):
    """Whether the point q of the full circle, relative to the first joint, is on the arc."""
    ex = double_double(arc[c.REFINED_CHORD_X], arc[c.REFINED_CHORD_X_LOW])
    ey = double_double(arc[c.REFINED_CHORD_Y], arc[c.REFINED_CHORD_Y_LOW])
    if arc[c.IS_SHORT] > 0.0:
        along = dot(qx, qy, ex, ey)
        nx = arc[c.REFINED_NORMAL_X] - arc[c.REFINED_CURVATURE] * qx.high
        ny = arc[c.REFINED_NORMAL_Y] - arc[c.REFINED_CURVATURE] * qy.high
        beyond = along - double_double(arc[c.REFINED_CHORD], arc[c.REFINED_CHORD_LOW])
        return -slack <= along.high and beyond.high <= slack and ny * ex.high - nx * ey.high > 0.0
    height = cross(ex, ey, qx, qy).high
    return height <= slack if arc[c.REFINED_CURVATURE] > 0.0 else height >= -slack


@_compile
def arc_height(arc, px, py):
    """-> (height, nx, ny): distance of a position close to an arc, positive on the free side; unit normal."""
    form, stretch = arc_form(arc), arc[c.REFINED_STRETCH]
    qx, qy = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    nx, ny = arc_normal(form, stretch, qx, qy)
    size = root(dot(nx, ny, nx, ny))
    return form_value(form, qx, qy) / size, nx / size, ny / size


@_compile
def arc_point(arc, t, px, py, vx, vy):
    """-> (x, y, nx, ny, bent): the position on the arc after the time t, unit normal, and curvature (a double)."""
    form, stretch = arc_form(arc), arc[c.REFINED_STRETCH]
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    qx, qy = back_on_arc(form, qx, qy)
    nx, ny = arc_normal(form, stretch, qx, qy)
    size = root(dot(nx, ny, nx, ny))
    nx, ny = nx / size, ny / size
    bent = arc[c.REFINED_CURVATURE] * (ny.high * ny.high + (stretch * nx.high) ** 2) / size.high
    return arc[c.START_X] + qx, arc[c.START_Y] + (qy / stretch if stretch != 1.0 else qy), nx, ny, bent
