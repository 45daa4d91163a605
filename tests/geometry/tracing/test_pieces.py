"""Every kind of piece in both number types: hits, times, reflections, and hits from the piece itself."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numba import njit

from asperity.core.rounding import EPS
from asperity.geometry import Arc, Bezier
from asperity.geometry.tracing.compiled import refined_tracing as twin
from asperity.geometry.tracing.compiled.pieces import records
from asperity.geometry.tracing.compiled.pieces.formulas import mirror, with_length_one
from asperity.geometry.tracing.compiled.pieces.kinds import refined_surface, reflect
from asperity.geometry.tracing.compiled.rays import SLOTS, nearest_piece, slots_at, tables_at
from asperity.geometry.tracing.compiled.rays import scope_of as scope_in_doubles
from asperity.geometry.tracing.double_double.numbers import extended
from asperity.geometry.tracing.refinement import tables_of
from wall_shapes import CLOSED

# The tracer counts no references to arrays, nor may its callers.
compiled = njit(error_model="numpy", _nrt=False)
RAYS = 300
# Of walls that close.
NO_BANDS = np.empty((0, 2))
# A wall of each kind of piece, without pieces of other kinds, and whether a ray can hit a piece twice in a row.
KINDS = {
    "line": ("triangular-teeth", False),
    "focusing arc": ("focusing-arcs", True),
    "dispersing arc": ("dispersing-arcs", False),
    "elliptic arc": ("elliptical-arcs", True),
    "parabola": ("double-parabola", True),
    "cubic": ("vertical ends", True),
}
# Bound on all errors, each of a few roundings of numbers of order one; a time has more at grazing incidence.
ERROR = 32.0 * EPS
# No hit from the own piece is as near as this, but the start itself.
NEAR = 1e-5


@compiled
def trace_in_doubles(tables, slots, rays, found):
    """Two hits of each ray: the time, the number of the piece, the position s, the point and the new velocity."""
    scope = scope_in_doubles(tables_at(tables), 0, slots_at(slots))
    for i in range(rays.shape[0]):
        (px, py, vx, vy), own = rays[i], records.Own(records.OPENING, -1, -1.0, 0.0, -1, 0)
        for k in range(2):
            hit, _ = nearest_piece(scope, own, px, py, vx, vy)
            if hit.kind == records.NO_PIECE:
                break
            px, py, vx, vy, _ = reflect(scope, hit, own, px, py, vx, vy)
            vx, vy = with_length_one(vx, vy)
            found[i, k] = hit.time, float(hit.number), hit.s, px, py, vx, vy
            own = records.Own(hit.kind, hit.number, hit.s if hit.kind == records.BEZIER else -1.0, hit.time, -1, k + 1)


@compiled
def trace_in_double_doubles(tables, bands, rays, found):
    """The same in double-double arithmetic."""
    scope = twin.scope_of(tables, bands, 0)
    for i in range(rays.shape[0]):
        px, py, vx, vy = extended(rays[i, 0]), extended(rays[i, 1]), extended(rays[i, 2]), extended(rays[i, 3])
        own = records.Hit(extended(0.0), records.OPENING, -1, extended(-1.0), 0)
        sizes = records.Sizes(1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, EPS)
        for k in range(2):
            hit, _ = twin.nearest_line(scope, own, sizes, px, py, vx, vy)
            hit, _ = twin.nearest_curve(scope, own, hit, px, py, vx, vy, twin.error_of(scope, sizes))
            if hit.kind == records.NO_PIECE:
                break
            px, py, nx, ny, _ = refined_surface(hit.kind, (tables, hit, px, py, vx, vy))
            vx, vy = mirror(vx, vy, nx, ny)
            vx, vy = with_length_one(vx, vy)
            found[i, k] = hit.time.high, float(hit.number), hit.s.high, px.high, py.high, vx.high, vy.high
            s = hit.s if hit.kind == records.BEZIER else extended(-1.0)
            own = records.Hit(hit.time, hit.kind, hit.number, s, 0)


TYPES = ("doubles", "double-doubles")


@cache
def hits(kind, number_type):
    """The wall, the rays as start and velocity, and their hits."""
    wall, rng = CLOSED[KINDS[kind][0]](), np.random.default_rng(11)
    angle = rng.uniform(0.05, np.pi - 0.05, RAYS)
    rays = np.column_stack([rng.uniform(0.01, 0.99, RAYS), np.zeros(RAYS), -np.cos(angle), -np.sin(angle)])
    found = np.full((RAYS, 2, 7), np.nan)
    if number_type == "doubles":
        trace_in_doubles(wall.scene.tables.address, SLOTS.address, rays, found)
    else:
        trace_in_double_doubles(tables_of(wall.scene), NO_BANDS, rays, found)
    return wall, rays, found


def place_on(piece, s, point):
    """How far a point is from a piece, and the unit normal there, both from the piece's own description."""
    if isinstance(piece, Arc):
        x, y = np.subtract(point, piece.center) / piece.semi_axes
        normal = np.array([x, y]) / piece.semi_axes
        return x * x + y * y - 1.0, normal / np.hypot(*normal)
    tx, ty = piece.tangent(s)
    away = piece.point(s) - point if isinstance(piece, Bezier) else np.subtract(point, piece.start)
    normal = np.array([-ty, tx]) / np.hypot(tx, ty)
    return np.hypot(*away) if isinstance(piece, Bezier) else away @ normal, normal


@pytest.mark.parametrize("number_type", TYPES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_hit_is_on_the_piece_and_on_the_ray_and_obeys_the_law_of_reflection(kind, number_type):
    wall, rays, found = hits(kind, number_type)
    assert not np.isnan(found[:, 0]).any()
    for ray, both in zip(rays, found, strict=True):
        start, velocity = ray[:2], ray[2:]
        for time, number, s, *numbers in both[~np.isnan(both[:, 0])]:
            point, reflected = np.array(numbers[:2]), np.array(numbers[2:])
            distance, normal = place_on(wall.pieces[int(number)], abs(s), point)
            (dx, dy), incidence = point - start, abs(velocity @ normal)
            assert abs(distance) <= ERROR
            assert abs(dx * velocity[1] - dy * velocity[0]) <= ERROR
            assert abs(dx * velocity[0] + dy * velocity[1] - time) * incidence <= ERROR
            assert abs(np.hypot(*reflected) - 1.0) <= ERROR
            assert np.max(np.abs(reflected - velocity + 2.0 * (velocity @ normal) * normal)) <= ERROR
            start, velocity = point, reflected


@pytest.mark.parametrize("number_type", TYPES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_next_hit_on_the_same_piece_is_not_the_start(kind, number_type):
    _, _, found = hits(kind, number_type)
    is_own = found[:, 1, 1] == found[:, 0, 1]
    assert np.any(is_own) == KINDS[kind][1]
    assert np.all(found[is_own, 1, 0] > NEAR)


@pytest.mark.parametrize("kind", KINDS)
def test_both_number_types_find_the_same_hits(kind):
    wall, rays, found = hits(kind, "doubles")
    _, _, judge = hits(kind, "double-doubles")
    assert np.array_equal(found[:, :, 1], judge[:, :, 1], equal_nan=True)
    for (*_, vx, vy), one, other in zip(rays, found[:, 0], judge[:, 0], strict=True):
        _, normal = place_on(wall.pieces[int(other[1])], abs(other[2]), other[3:5])
        assert abs(one[0] - other[0]) * abs(normal @ (vx, vy)) <= ERROR
