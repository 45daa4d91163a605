"""The hits of a ray on circular and elliptic arcs in double-double arithmetic."""

from __future__ import annotations

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
from .formulas import arc_normal, arc_root, arc_terms, back_on_arc, beyond_end, form_value
from .numbers import LOCAL_ERROR, dot, double_double, extended, root, scaled, sine_cosine, two_sum

_compile = jit(linked=True, _nrt=False)


@jit()
def refined_arcs(arcs):
    """Return the table of arcs that go through both joints exactly and subtend their span exactly.

    It has the columns of arcs, then the low parts of the numbers from NORMAL_X to SHORT_CHORD.
    """
    # at least one row, because `face_of` passes a row also for a wall without arcs
    table = np.zeros((max(1, arcs.shape[0]), c.REFINED_ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        arc, row = arcs[k], table[k]
        for column in range(c.ARC_COLUMNS):
            row[column] = arc[column]
        cx, cy = two_sum(arc[c.END_X], -arc[c.START_X]), arc[c.STRETCH] * two_sum(arc[c.END_Y], -arc[c.START_Y])
        length = root(dot(cx, cy, cx, cy))
        ex, ey = cx / length, cy / length
        sine, cosine = sine_cosine(0.5 * arc[c.SPAN])
        if arc[c.CURVATURE] < 0.0:
            sine = -sine
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx, ny = sine * ex - cosine * ey, sine * ey + cosine * ex
        curvature = scaled(2.0, sine) / length
        numbers = nx, ny, curvature, ex, ey, length if arc[c.SHORT_CHORD] > 0.0 else extended(0.0)
        for j in range(len(numbers)):
            row[c.NORMAL_X + j], row[c.NORMAL_X + j + c.LOWS] = numbers[j].high, numbers[j].low
    return table


@_compile
def number_at(arc, column):
    """-> number: the double-double in a column of a row of `refined_arcs`."""
    return double_double(arc[column], arc[column + c.LOWS])


@_compile
def arc_form(arc):
    """-> (n0x, n0y, curvature): the numbers of F, see `compiled/pieces`, from a row of `refined_arcs`."""
    return number_at(arc, c.NORMAL_X), number_at(arc, c.NORMAL_Y), number_at(arc, c.CURVATURE)


@_compile
def arc_hit(arc, own, px, py, vx, vy, error):
    """-> (t, undecided, height): time to the front of one arc, or inf; time of an undecided contact, or inf.

    For ``height`` see `arc_time` in `compiled/pieces`. ``error`` bounds the transversal error of the ray at the arc.
    """
    form, stretch, undecided = arc_form(arc), arc[c.STRETCH], np.inf
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
    chord = number_at(arc, c.CHORD_X), number_at(arc, c.CHORD_Y), number_at(arc, c.SHORT_CHORD)
    return beyond_end(arc_form(arc), chord, qx, qy).high <= slack


@_compile
def arc_height(arc, px, py):
    """-> (height, nx, ny): distance of a position close to an arc, positive on the free side; unit normal."""
    form, stretch = arc_form(arc), arc[c.STRETCH]
    qx, qy = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    nx, ny = arc_normal(form, stretch, qx, qy)
    size = root(dot(nx, ny, nx, ny))
    return form_value(form, qx, qy) / size, nx / size, ny / size


@_compile
def arc_point(arc, t, px, py, vx, vy):
    """-> (x, y, nx, ny, bent): the position on the arc after the time t, unit normal, and curvature (a double)."""
    form, stretch = arc_form(arc), arc[c.STRETCH]
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    qx, qy = back_on_arc(form, qx, qy)
    nx, ny = arc_normal(form, stretch, qx, qy)
    size = root(dot(nx, ny, nx, ny))
    nx, ny = nx / size, ny / size
    bent = arc[c.CURVATURE] * (ny.high * ny.high + (stretch * nx.high) ** 2) / size.high
    return arc[c.START_X] + qx, arc[c.START_Y] + (qy / stretch if stretch != 1.0 else qy), nx, ny, bent
