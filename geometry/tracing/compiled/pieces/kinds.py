"""All kinds of pieces: the nearest hit on a curve, the reflection, the side on which a ray starts. Loads numba.

A kind of piece is a module beside `lines`, `arcs` and `beziers` with the same names: KIND, nearby, incidence, surface,
refined_surface, refined_row, height and ends, and of curves also TABLE, nearest, refined_hit and refined_table. Here
the kinds are tried one after another, in an order that the compiler knows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .....core.checks import Floats
from ....scene.compiled.compiling import inlined, inner, linked, linked_allocating
from ...double_double.numbers import DoubleDouble, extended
from . import arcs, beziers, lines
from .beziers import STEPS
from .formulas import mirror
from .lines import height_over_line, line_ends
from .records import FIRST_CURVE, NO_PIECE, OPENING, Hit

# Curves in the order of their tables, and all kinds.
CURVES = (arcs, beziers)
PIECES = (lines, *CURVES)


def of_kind(name, otherwise=None, pieces=PIECES, compiled=inlined):
    """Return a function of a kind and arguments: that of this name of the kind, or of no such kind ``otherwise``."""
    pieces, last = (pieces, otherwise) if otherwise else (pieces[:-1], getattr(pieces[-1], name))
    chosen = None
    for piece in reversed(pieces):
        chosen = compiled(_branch(piece.KIND, getattr(piece, name), chosen, last))
    return chosen


def _branch(kind, function, following, last):
    if following is None:
        return lambda given, arguments: function(*arguments) if given == kind else last(*arguments)
    return lambda given, arguments: function(*arguments) if given == kind else following(given, arguments)


def of_all(name):
    """Return a function that passes its first argument through the functions of this name of all curves."""
    run = getattr(CURVES[0], name)
    for piece in CURVES[1:]:
        run = _then(run, getattr(piece, name))
    return run


def _then(first, second):
    @inlined
    def both(state, scope, own, px, py, vx, vy):
        return second(first(state, scope, own, px, py, vx, vy), scope, own, px, py, vx, vy)

    return both


@inlined
def _steepness(tables, hit, px, py, vx, vy):
    return abs(vy)


@linked
def _flat_surface(tables, hit, px, py, vx, vy):
    nx, ny = (0.0, 1.0) if hit.kind == OPENING else (1.0, 0.0)
    return px + hit.time * vx, py + hit.time * vy, extended(nx), extended(ny), 0.0


# Of a kind and (scope, number, own, is_own, px, py, vx, vy), -> (t, s, tangent, is_clear): time to a hit on a piece
# close by, or inf, and the position s on the piece. The hit is clear if it is certainly ahead.
piece_nearby = of_kind("nearby")
# Of a kind and (tables, hit, px, py, vx, vy), -> (qx, qy, nx, ny, bent): in double-doubles the end of a ray segment and
# the unit normal there; the curvature, a double.
refined_surface = of_kind("refined_surface", _flat_surface)
# Of a kind and (scope, number, own, is_own, px, py, vx, vy, error), -> (t, s, undecided, clearance, near_s): time to
# the first front hit on a curve, or inf, and its parameter; time of a contact that is not decided, or inf; clearance
# for `meets`; the parameter of a hit close by that is not counted, or -1. ``error`` is the ray's transversal error.
refined_hit = of_kind("refined_hit", pieces=CURVES)
# Of a kind and (joints, face, px, py), -> (height, nx, ny): distance of a position from a piece, positive on the free
# side, and the unit normal.
height_over = of_kind("height")
# Of a kind and (joints, face), -> (x0, y0, x1, y1): the ends of a piece.
ends_of = of_kind("ends")
_nearest, _incidence, _surface = of_all("nearest"), of_kind("incidence", _steepness), of_kind("surface")
_row = of_kind("refined_row", compiled=linked_allocating)


@inlined
def nearest_curve(scope, own, px, py, vx, vy):
    """-> (Hit, contact, nearby): the first hit on a curve that is not tangent, and the time to the first tangent one.

    Both times are inf if there is none. For ``nearby`` see `rays.nearest_line`.
    """
    state = np.inf, NO_PIECE, -1, 0.0, np.inf, False
    time, kind, number, hit_s, contact, nearby = _nearest(state, scope, own, px, py, vx, vy)
    return Hit(time, kind, number, hit_s, 0), contact, nearby


@inner
def incidence(tables, hit, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the piece that is hit; of the opening and the sides |vy|."""
    return _incidence(hit.kind, (tables, hit, px, py, vx, vy))


@inlined
def reflect(scope, hit, own, px, py, vx, vy):
    """-> (px, py, vx, vy, at_corner): the ray after its reflection on a piece, and whether it is at a corner.

    At a corner the velocity is not reflected.
    """
    px, py, nx, ny, at_corner = _surface(hit.kind, (scope, hit, own, px, py, vx, vy))
    if at_corner:
        return px, py, vx, vy, True
    vx, vy = mirror(vx, vy, nx, ny)
    return px, py, vx, vy, False


class Face(NamedTuple):
    """A piece: kind, row, of a curve its numbers as in `refined_table`, and the parameter on a Bezier piece."""

    kind: int
    number: int
    row: Floats
    s: DoubleDouble


@linked_allocating
def face_of(tables, kind, number, s):
    """-> Face: a piece, given by kind, row and parameter in the tables of doubles."""
    return Face(kind, number, _row(kind, (tables, number)), extended(s))


@linked
def refined_face(tables, hit):
    """-> Face: the piece of a hit in the tables of double-doubles."""
    is_curve = hit.kind >= FIRST_CURVE
    rows = tables.curves[hit.kind - FIRST_CURVE if is_curve else 0]
    return Face(hit.kind, hit.number, rows[hit.number if is_curve else 0], hit.s)


# Error of a double-double position projected onto a curve, as a fraction of the slack (64 roundings to 16 EPS).
CURVE_NOISE = 2.0**-48
# Distance behind a face, in slacks, beyond which the last segment did not start between the face and the own piece.
BEHIND_SLACKS = 4.0


class Arrival(NamedTuple):
    """The arrival of a ray at its start: the length of the last segment and the accuracy of the position.

    ``slack`` is the distance within which pieces are nearby; ``blur`` is the error of the position along the own piece.
    If this error decides, for example if one piece stands on the other, the ray counts as in front.
    """

    flown: float
    slack: float
    blur: float


@linked
def came_through(ends, mx, my, px, py, vx, vy, arrival):
    """-> bool: whether a ray's last segment, which ended at p with the velocity v, crossed a piece from behind.

    ``ends`` are the ends of the piece, (mx, my) is its normal next to p.
    """
    x0, y0, x1, y1 = ends
    if arrival.flown * (vx * mx + vy * my) <= BEHIND_SLACKS * arrival.slack:
        return False
    return (x0 - px) * vy - (y0 - py) * vx <= 0.0 <= (x1 - px) * vy - (y1 - py) * vx


@linked
def line_in_front_of_line(joints, line, own, px, py, vx, vy, arrival):
    """-> bool: `in_front_at` for two lines, by their rows: the distance has the exact sign, see `height_over_line`."""
    if height_over_line(joints, own, line, px, py, arrival.blur) <= 0.0:
        return False
    x0, y0, x1, y1 = line_ends(joints, own)
    ex, ey = x1 - x0, y1 - y0
    w = 2.0 * (vy * ex - vx * ey) / (ex * ex + ey * ey)
    ends = line_ends(joints, line)
    x0, y0, x1, y1 = ends
    length = math.hypot(x1 - x0, y1 - y0)
    mx, my = (y0 - y1) / length, (x1 - x0) / length
    return not came_through(ends, mx, my, px.high, py.high, vx + w * ey, vy - w * ex, arrival)


@linked
def in_front_at(joints, piece, own, px, py, vx, vy, arrival):
    """-> bool: whether a ray that has just left the piece ``own`` starts in front of ``piece``, within the slack of it.

    (``px``, ``py``), double-doubles, is the position, within rounding of ``own``. At least one piece is a curve.

    The position has an error of some roundings of the hollow's size, so its distance from a piece close by means
    nothing: beside the tip of a sharp peak, in the apex of a narrow wedge, on a plate of no thickness. But the joints
    are exact, and the ray starts on its own piece. So the position is projected onto that, and the distance computed in
    double-doubles; below the error of this computation it is 0, as between coincident faces. Two faces of a plate cross
    within rounding if vertices that should lie on one line do not. Then the ray has passed through the back of one face
    to the front of the other, and the first one does not stop it after its reflection.
    """
    nx, ny = px, py
    for _ in range(STEPS):
        height, nx, ny = height_over(own.kind, (joints, own, px, py))
        px, py = px - height * nx, py - height * ny
    height, mx, my = height_over(piece.kind, (joints, piece, px, py))
    if height.high + arrival.blur * abs(mx.high * ny.high - my.high * nx.high) <= CURVE_NOISE * arrival.slack:
        return False
    w = 2.0 * (vx * nx.high + vy * ny.high)
    vx, vy = vx - w * nx.high, vy - w * ny.high
    ends = ends_of(piece.kind, (joints, piece))
    return not came_through(ends, mx.high, my.high, px.high, py.high, vx, vy, arrival)
