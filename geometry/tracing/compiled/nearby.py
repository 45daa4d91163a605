"""Hits of a ray on pieces within rounding of its start: compiled.

The loop of `rays` sets such pieces aside, and a function of its own looks at them again, so that the loop has no call.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...scene.columns import (
    BEZIERS_END,
    CIRCLES_END,
    EDGE_X,
    EDGE_Y,
    ELLIPSES_END,
    FIRST_BEZIER,
    FIRST_CIRCLE,
    FIRST_ELLIPSE,
    FIRST_JOINT,
    JOINT_X,
    JOINT_Y,
    JOINTS_END,
    LENGTH,
    START_X,
    START_Y,
    STARTS_LINE,
    STRETCH,
)
from ..double_double.arcs import refined_arcs
from ..double_double.sides import ARC, in_front, line_in_front_of_line
from ..double_double.sides import BEZIER as CURVE
from .arcs import arc_time, on_arc
from .beziers import bezier_hit

NO_PIECE, LID, SIDE, LINE, CIRCLE, ELLIPSE, BEZIER = 0, 1, 2, 3, 4, 5, 6

# In place of a tangency.
DOUBTFUL = 2
# The share from a line's end is negative even where the ray meets that end: it is at least the smallest of doubles.
LEAST_SHARE = 5e-324

_compile = njit(cache=True, nogil=True, error_model="numpy")


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def line_time(joints, lines, j, c_before, c_after, px, py, vx, vy):
    """Flight time to the line that starts at joint j, and the share of it at the hit, negative from its end."""
    share = c_before / (c_before - c_after)
    near = j
    if share > 0.5:
        # from the nearer joint, and negative to say so, so that both ends keep their digits
        share = min(c_after / (c_before - c_after), -LEAST_SHARE)
        near = j + 1
    hx = joints[near, JOINT_X] + share * lines[j, EDGE_X]
    hy = joints[near, JOINT_Y] + share * lines[j, EDGE_Y]
    return (hx - px) * vx + (hy - py) * vy, share


@_compile
def arc_at(kind, index, circles, ellipses):
    """The arc of that kind and number as a row of `refined_arcs`, a row of no meaning for other kinds."""
    if circles is not None and kind == CIRCLE:
        return refined_arcs(circles[index : index + 1])[0]
    if ellipses is not None and kind == ELLIPSE:
        return refined_arcs(ellipses[index : index + 1])[0]
    return np.empty(0)


@_compile
def curve_at(kind, index, beziers):
    """The row of that Bezier piece, a row of no meaning for other kinds."""
    if beziers is not None and kind == BEZIER:
        return beziers[index]
    return np.empty(0)


@_compile
def starts_in_front(
    own_kind, own_index, own_s, kind, index, s, joints, circles, ellipses, beziers, px, py, vx, vy, flown, slack
):  # fmt: skip
    """Whether the ray's start lies in front of a piece that is nearby, or may do so; see `double_double/sides`."""
    if own_kind in (LID, SIDE):
        # no piece lies above the opening or beyond a side: one within rounding of them is met there
        return True
    if own_kind == LINE and kind == LINE:
        return line_in_front_of_line(joints, own_index, index, (px, 0.0), (py, 0.0), vx, vy, flown, slack, slack)
    if circles is None and ellipses is None and beziers is None:
        return False
    return in_front(
        joints,
        LINE if own_kind == LINE else CURVE if own_kind == BEZIER else ARC,
        own_index,
        arc_at(own_kind, own_index, circles, ellipses),
        curve_at(own_kind, own_index, beziers),
        (own_s, 0.0),
        LINE if kind == LINE else CURVE if kind == BEZIER else ARC,
        index,
        arc_at(kind, index, circles, ellipses),
        curve_at(kind, index, beziers),
        (s, 0.0),
        (px, 0.0), (py, 0.0), vx, vy, flown, slack, slack,
    )  # fmt: skip


@_compile
def arc_nearby(arc, px, py, vx, vy, slack, close):
    """Flight time to an arc that is met close by, else inf; its tangency; and whether it is ahead for certain."""
    stretch = arc[STRETCH]
    wide = slack * max(1.0, stretch)
    t, touch, height = arc_time(arc, False, px, py, vx, vy, stretch)
    if abs(t) > close or height < -wide:
        return np.inf, 0, False
    t = max(t, 0.0)
    if not on_arc(arc, px + t * vx - arc[START_X], stretch * (py + t * vy - arc[START_Y]), wide):
        return np.inf, 0, False
    return t, touch, height > wide


@_compile
def hit_nearby(
    hollow, joints, lines, circles, ellipses, beziers,
    own_kind, own_index, own_s, px, py, vx, vy, flown, slack, close,
):  # fmt: skip
    """First hit of a piece nearby that the ray starts in front of: time (inf if none), kind, number, place, doubt.

    The place is that of a line or of a Bezier piece as in the loop. The doubt is the tangency, or `DOUBTFUL` where the
    gap that the ray crosses is within the slack: doubles do not know where it goes on, in the apex of a wedge.
    """
    time, found, number, place, doubt = np.inf, NO_PIECE, -1, 0.0, 0
    if lines is not None:
        for j in range(int(hollow[FIRST_JOINT]), int(hollow[JOINTS_END]) - 1):
            if joints[j, STARTS_LINE] <= 0.0 or (own_kind == LINE and own_index == j):
                continue
            c_before = (joints[j, JOINT_X] - px) * vy - (joints[j, JOINT_Y] - py) * vx
            c_after = (joints[j + 1, JOINT_X] - px) * vy - (joints[j + 1, JOINT_Y] - py) * vx
            if c_before >= 0.0 >= c_after and c_before > c_after:
                t, share = line_time(joints, lines, j, c_before, c_after, px, py, vx, vy)
                height, reach = t * (c_before - c_after), slack * lines[j, LENGTH]
                if abs(t) > close or t >= time or height < -reach:
                    continue
                if height > reach or starts_in_front(
                    own_kind, own_index, own_s, LINE, j, share, joints, circles, ellipses, beziers,
                    px, py, vx, vy, flown, slack,
                ):  # fmt: skip
                    time, found, number, place = max(t, 0.0), LINE, j, share
                    doubt = DOUBTFUL if height <= reach and own_kind not in (LID, SIDE) else 0
    if circles is not None:
        for k in range(int(hollow[FIRST_CIRCLE]), int(hollow[CIRCLES_END])):
            if own_kind == CIRCLE and own_index == k:
                continue
            t, touch, is_clear = arc_nearby(circles[k], px, py, vx, vy, slack, close)
            if t < time and (is_clear or starts_in_front(
                own_kind, own_index, own_s, CIRCLE, k, 0.0, joints, circles, ellipses, beziers,
                px, py, vx, vy, flown, slack,
            )):  # fmt: skip
                time, found, number, place = t, CIRCLE, k, 0.0
                doubt = touch if is_clear or own_kind in (LID, SIDE) else DOUBTFUL
    if ellipses is not None:
        for k in range(int(hollow[FIRST_ELLIPSE]), int(hollow[ELLIPSES_END])):
            if own_kind == ELLIPSE and own_index == k:
                continue
            t, touch, is_clear = arc_nearby(ellipses[k], px, py, vx, vy, slack, close)
            if t < time and (is_clear or starts_in_front(
                own_kind, own_index, own_s, ELLIPSE, k, 0.0, joints, circles, ellipses, beziers,
                px, py, vx, vy, flown, slack,
            )):  # fmt: skip
                time, found, number, place = t, ELLIPSE, k, 0.0
                doubt = touch if is_clear or own_kind in (LID, SIDE) else DOUBTFUL
    if beziers is not None:
        for k in range(int(hollow[FIRST_BEZIER]), int(hollow[BEZIERS_END])):
            own = own_s if own_kind == BEZIER and own_index == k else -1.0
            _, _, _, s = bezier_hit(beziers[k], own, px, py, vx, vy, slack)
            if s >= 0.0 and time > 0.0 and starts_in_front(
                own_kind, own_index, own_s, BEZIER, k, s, joints, circles, ellipses, beziers,
                px, py, vx, vy, flown, slack,
            ):  # fmt: skip
                time, found, number, place = 0.0, BEZIER, k, s
                doubt = 0 if own_kind in (LID, SIDE) else DOUBTFUL
    return time, found, number, place, doubt
