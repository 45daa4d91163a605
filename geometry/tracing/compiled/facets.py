"""The compiled flight of rays from facet to facet, which leave each at an angle that the caller gives. Loads numba.

Position, piece and hit are found as in `rays`; runs of hits and closed forms hold for mirrors only, and are not used.
"""

from __future__ import annotations

import numpy as np

from ...curves import columns as c
from ...scene.compiled.tables import kind_of, reader_of
from .pieces.formulas import exit_time, with_length_one
from .pieces.kinds import reflect
from .pieces.options import compiled, inlined
from .pieces.records import BEZIER, FLYING, NO_PIECE, NO_STATES, OPENING, SIDE, Hit, Own
from .rays import (
    BOUNCE_LIMIT,
    CORNER,
    ESCAPED,
    GRAZING,
    MOST_STEPS,
    UNCERTAIN,
    meets_corner,
    nearest_piece,
    scope_of,
    slots_at,
    tables_at,
)
from .trigonometry import LAST_ANGLE, direction_angle, sine_cosine

# The least arriving angle, which a law takes: a positive normal number.
FIRST_ANGLE = 2.2250738585072014e-308
states_at = reader_of(kind_of(NO_STATES))


@inlined
def fly(scope, own, px, py, vx, vy):
    """-> (status, own, px, py, wx, wy): the next piece, with the mirrored velocity there, or the way out."""
    for _ in range(MOST_STEPS):
        hit, corner = nearest_piece(scope, own, px, py, vx, vy)
        if hit.uncertainty == UNCERTAIN:
            return CORNER, own, px, py, vx, vy
        time, kind = exit_time(scope, own, px, py, vx, vy, hit.time)
        if kind != NO_PIECE:
            hit = Hit(time, kind, hit.number, hit.s, hit.uncertainty)
        if hit.kind == NO_PIECE or meets_corner(scope, hit, corner, px, py, vx, vy):
            return CORNER, own, px, py, vx, vy
        if hit.kind == OPENING:
            return ESCAPED, own, px, py, vx, vy
        if hit.uncertainty != 0:
            return GRAZING, own, px, py, vx, vy
        if hit.kind != SIDE:
            px, py, wx, wy, at_corner = reflect(scope, hit, own, px, py, vx, vy)
            # without the length of the segment: a drawn direction does not tell from where the ray came
            own = Own(hit.kind, hit.number, hit.s if hit.kind == BEZIER else -1.0, 0.0, -1, 1)
            return CORNER if at_corner else FLYING, own, px, py, wx, wy
        py = max(py + hit.time * vy, scope.tables.joints[scope.joints[0], c.JOINT_Y])
        px = scope.left if vx > 0.0 else scope.right
        own = Own(SIDE, -1, -1.0, 0.0, -1, own.bounces)
    return BOUNCE_LIMIT, own, px, py, vx, vy


@inlined
def tangent_of(vx, vy, wx, wy):
    """-> (tx, ty): the unit tangent of a mirror, with the free side on its left, from velocities before and after."""
    # 2 (v t) t and -2 (v n) n; the longer one has no cancellation
    sx, sy, dx, dy = vx + wx, vy + wy, wx - vx, wy - vy
    if dx * dx + dy * dy > 2.0:
        scale = 1.0 / np.sqrt(dx * dx + dy * dy)
        return dy * scale, -dx * scale
    scale = 1.0 / np.sqrt(sx * sx + sy * sy)
    tx, ty = sx * scale, sy * scale
    return (-tx, -ty) if tx * wy < ty * wx else (tx, ty)


@compiled
def next_facets(first, end, states, tables, slots):
    """Let rays ``who[first:end]`` leave at their angles, and fly to the next facet, or out.

    The angle becomes the reversed arriving angle in the frame of the facet, or the outgoing angle of the wall.
    """
    who, hollow, kind, number, s, point, tangent, angle, status = states_at(states)
    tables, slots = tables_at(tables), slots_at(slots)
    for k in range(first, end):
        i = who[k]
        scope = scope_of(tables, hollow[i], slots)
        bounces = 0 if kind[i] == OPENING else 1
        own = Own(kind[i], number[i], s[i], 0.0, -1, bounces)
        tx, ty = tangent[i, c.POINT_X], tangent[i, c.POINT_Y]
        sine, cosine = sine_cosine(angle[i])
        vx, vy = with_length_one(cosine * tx - sine * ty, cosine * ty + sine * tx)
        status[i], own, px, py, wx, wy = fly(scope, own, point[i, c.POINT_X], point[i, c.POINT_Y], vx, vy)
        if status[i] == ESCAPED:
            angle[i] = min(direction_angle(vx, vy), LAST_ANGLE)
        if status[i] == FLYING:
            kind[i], number[i], s[i] = own.kind, own.number, own.s
            point[i, c.POINT_X], point[i, c.POINT_Y] = px, py
            tx, ty = tangent_of(vx, vy, wx, wy)
            tangent[i, c.POINT_X], tangent[i, c.POINT_Y] = tx, ty
            back = direction_angle(-vx * tx - vy * ty, abs(vx * ty - vy * tx))
            angle[i] = min(max(back, FIRST_ANGLE), LAST_ANGLE)
