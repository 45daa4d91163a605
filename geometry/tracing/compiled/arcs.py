"""The first hit of a ray on a circular or elliptic arc, and the reflection there: compiled.

A circular arc is F(r) = n0.r - kappa |r|^2 / 2 = 0, with r relative to its first joint and n0 the unit normal there,
towards the free side; kappa > 0 is focusing. The front root is (B + sqrt(D)) / (kappa |v|^2), and
2 B / (kappa |v|^2) if the ray starts on the arc. An elliptic arc is circular in stretched coordinates.
"""

from __future__ import annotations

import math

import numpy as np

from ....core.rounding import EPS
from ...scene import columns as c
from ...scene.tolerances import NEARBY_SLACKS, SMOOTH_JOINT, TANGENT_ULPS
from .options import inlined

# Bound, times B^2 + |v|^2, on the error of D that `tangent_error` gives for a ray near a tangency: there kappa |r| is
# at most |B| and the chord over the radius.
NEARLY_TANGENT = 4.0 * TANGENT_ULPS * EPS


@inlined
def tangent_error(arc, b, rx, ry, speed2):
    """-> float: the size of D up to which a tangent hit and a miss are not distinguished.

    B has rounding errors of 3 + 4 kappa |r| eps, and F of (3 + 2 kappa |r|) |r| eps; kappa |r| is about |B|. At a
    smooth joint of two arcs a ray between their tangents is tangent to neither, and D is at most the square of their
    angle.
    """
    size = abs(arc[c.CURVATURE]) * (abs(rx) + abs(ry))
    return TANGENT_ULPS * EPS * (b * b + (abs(b) + size) * math.sqrt(speed2)) + SMOOTH_JOINT * SMOOTH_JOINT * speed2


@inlined
def arc_time(arc, own, px, py, vx, vy, stretch):
    """-> (t, tangent, height): time to the front of the arc, inf if there is no hit.

    ``tangent`` is 1 if hit and miss are not distinguished. For a hit close by, ``height`` is about the distance of the
    start in front of the arc, in coordinates with a circular arc; inf for a hit on the far side of a focusing arc.
    """
    rx, ry = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    wy = stretch * vy
    curvature = arc[c.CURVATURE]
    b = arc[c.NORMAL_X] * vx + arc[c.NORMAL_Y] * wy - curvature * (rx * vx + ry * wy)
    speed2 = vx * vx + wy * wy
    if own:
        if curvature <= 0.0 or b <= 0.0:
            return np.inf, 0, np.inf
        return 2.0 * b / (curvature * speed2), 0, np.inf
    f = arc[c.NORMAL_X] * rx + arc[c.NORMAL_Y] * ry - 0.5 * curvature * (rx * rx + ry * ry)
    d = b * b + 2.0 * curvature * speed2 * f
    tangent = 0
    is_near = curvature < 0.0 and b < 0.0 and abs(d) <= NEARLY_TANGENT * (b * b + speed2)
    if is_near and abs(d) <= tangent_error(arc, b, rx, ry, speed2):
        tangent = 1
        d = 0.0
    if d < 0.0:
        return np.inf, 0, np.inf
    root = math.sqrt(d)
    if b >= 0.0:
        if curvature <= 0.0:
            return np.inf, 0, np.inf
        return (b + root) / (curvature * speed2), tangent, np.inf
    return 2.0 * f / (root - b), tangent, f


@inlined
def on_arc(arc, qx, qy, slack):
    """-> bool: whether the point q of the full circle, relative to the first joint, is on the arc."""
    return beyond_end(arc, qx, qy) <= slack


@inlined
def beyond_end(arc, qx, qy):
    """-> float: how far the point q of the full circle, relative to the first joint, is beyond an end of the arc.

    The distance is along or across the chord, inf on the far side of the circle, and at most 0 on the arc.
    """
    if arc[c.SHORT_CHORD] > 0.0:
        # up to a half angle of pi/4: by the position along the chord, on the arc's side of the circle
        along = qx * arc[c.CHORD_X] + qy * arc[c.CHORD_Y]
        nx, ny = arc[c.NORMAL_X] - arc[c.CURVATURE] * qx, arc[c.NORMAL_Y] - arc[c.CURVATURE] * qy
        facing = ny * arc[c.CHORD_X] - nx * arc[c.CHORD_Y]
        return max(-along, along - arc[c.SHORT_CHORD]) if facing > 0.0 else np.inf
    # larger half angles: by the side of the chord; the arc curves away from its free side exactly if it is focusing
    height = qy * arc[c.CHORD_X] - qx * arc[c.CHORD_Y]
    return height if arc[c.CURVATURE] > 0.0 else -height


@inlined
def on_arc_after(arc, t, px, py, vx, vy, stretch, slack):
    """-> bool: whether the point of the full circle after the time t is on the arc.

    At grazing incidence rounding moves the point along the arc by more than the slack; at a smooth joint of two arcs it
    would be on neither.
    """
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    beyond, room = beyond_end(arc, qx, qy), slack * max(1.0, stretch)
    if room < beyond <= NEARBY_SLACKS * room:
        ex, ey = arc[c.END_X] - arc[c.START_X], stretch * (arc[c.END_Y] - arc[c.START_Y])
        is_late = 2.0 * (qx * ex + qy * ey) > ex * ex + ey * ey
        is_corner = arc[c.END_CORNER if is_late else c.START_CORNER] > 0.0
        return not is_corner and beyond * arc_incidence(arc, t, px, py, vx, vy, stretch) <= room
    return beyond <= room


@inlined
def may_touch_arc(arc, t, px, py, vx, vy, stretch, slack):
    """-> bool: whether a ray whose line touches the full circle after the time t may touch the arc.

    The hits that rounding does not distinguish from a tangent one lie up to sqrt(D) / (kappa |v|) beside it.
    """
    rx, ry, wy = px - arc[c.START_X], stretch * (py - arc[c.START_Y]), stretch * vy
    b = arc[c.NORMAL_X] * vx + arc[c.NORMAL_Y] * wy - arc[c.CURVATURE] * (rx * vx + ry * wy)
    speed2 = vx * vx + wy * wy
    reach = math.sqrt(tangent_error(arc, b, rx, ry, speed2) / speed2) / abs(arc[c.CURVATURE])
    return on_arc(arc, rx + t * vx, ry + t * wy, slack * max(1.0, stretch) + reach)


@inlined
def near_end(curve, px, py, slack):
    """-> bool: whether a hit of a curve is within rounding of an end that is a corner."""
    x, y = px - curve[c.START_X], py - curve[c.START_Y]
    if curve[c.START_CORNER] > 0.0 and x * x + y * y <= slack * slack:
        return True
    x, y = px - curve[c.END_X], py - curve[c.END_Y]
    return curve[c.END_CORNER] > 0.0 and x * x + y * y <= slack * slack


@inlined
def arc_reflect(arc, t, px, py, vx, vy, stretch):
    """-> (px, py, vx, vy): the position on the arc after the time t and the reflected velocity."""
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    nx, ny = arc[c.NORMAL_X] - arc[c.CURVATURE] * qx, arc[c.NORMAL_Y] - arc[c.CURVATURE] * qy
    f = arc[c.NORMAL_X] * qx + arc[c.NORMAL_Y] * qy - 0.5 * arc[c.CURVATURE] * (qx * qx + qy * qy)
    # one Newton step on F puts the point back on the arc
    qx -= f * nx
    qy -= f * ny
    nx, ny = arc[c.NORMAL_X] - arc[c.CURVATURE] * qx, stretch * (arc[c.NORMAL_Y] - arc[c.CURVATURE] * qy)
    scale = 1.0 / math.sqrt(nx * nx + ny * ny)
    nx *= scale
    ny *= scale
    px, py = arc[c.START_X] + qx, arc[c.START_Y] + qy / stretch
    w = 2.0 * (vx * nx + vy * ny)
    return px, py, vx - w * nx, vy - w * ny


@inlined
def arc_incidence(arc, t, px, py, vx, vy, stretch):
    """-> float: sine of the angle between the velocity and the arc after the time t."""
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    nx, ny = arc[c.NORMAL_X] - arc[c.CURVATURE] * qx, stretch * (arc[c.NORMAL_Y] - arc[c.CURVATURE] * qy)
    return abs(vx * nx + vy * ny) / math.sqrt(nx * nx + ny * ny)
