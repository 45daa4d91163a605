"""Rays in curved walls as a textbook would follow them, for references that owe nothing to the library's tracer.

Arcs by the quadratic about their centre, Bezier pieces by bisection of a polynomial between its critical points, no
orientation, no run skipped.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
from numba import njit
from numpy.polynomial import Polynomial

from asperity.geometry import Arc, Bezier, Segment

MOST_HITS = 5000
# Halvings before Newton's method is tried.
HALVINGS = 8
compiled = njit(cache=True, error_model="numpy")


def table_of(wall):
    """A row a piece: kind, then what defines it; Bezier pieces are cut where they change the side they bend to."""
    rows = []
    for piece in wall.pieces:
        if isinstance(piece, Segment):
            if piece.start[1] == 0.0 == piece.end[1]:
                continue
            rows.append([0.0, *piece.start, *piece.end, 0.0, 0.0, 0.0, 0.0])
        elif isinstance(piece, Arc):
            low, high = sorted((piece.start_angle, piece.end_angle))
            rows.append([1.0, *piece.center, *piece.semi_axes, 0.5 * (low + high), 0.5 * (high - low), 0.0, 0.0])
        else:
            assert isinstance(piece, Bezier)
            control = np.array(piece.control_points)
            if len(control) == 3:
                control = np.array(
                    [control[0], (control[0] + 2 * control[1]) / 3, (2 * control[1] + control[2]) / 3, control[2]]
                )
            rest, before = Bezier(control.tolist()), 0.0
            for s in inflections(control):
                first, rest = rest.split((s - before) / (1.0 - before))
                before = s
                rows.append([2.0, *np.array(first.control_points).ravel()])
            rows.append([2.0, *np.array(rest.control_points).ravel()])
    return np.array(rows)


def inflections(control):
    """Parameters in (0, 1) where b' x b'' changes its sign."""
    s, d = Polynomial([0.0, 1.0]), np.diff(control, axis=0)
    x, y = ((1 - s) ** 2 * d[0, i] + 2 * s * (1 - s) * d[1, i] + s * s * d[2, i] for i in (0, 1))
    # terms that cancel but for rounding have no roots
    # of terms that cancel rounding remains
    roots = (x * y.deriv() - y * x.deriv()).trim(1e-12).roots()
    return sorted(root.real for root in roots if abs(root.imag) < 1e-9 and 0.0 < root.real < 1.0)


@compiled
def cubic(c0, c1, c2, c3, s):
    return (1 - s) ** 3 * c0 + 3 * s * (1 - s) ** 2 * c1 + 3 * s * s * (1 - s) * c2 + s**3 * c3


@compiled
def bezier_time(row, own, px, py, vx, vy):
    """First hit of a Bezier piece: time and parameter; the root nearest to ``own`` is the ray's start."""
    g0 = (row[1] - px) * vy - (row[2] - py) * vx
    g1 = (row[3] - px) * vy - (row[4] - py) * vx
    g2 = (row[5] - px) * vy - (row[6] - py) * vx
    g3 = (row[7] - px) * vy - (row[8] - py) * vx
    if min(g0, g1, g2, g3) > 0.0 or max(g0, g1, g2, g3) < 0.0:
        return np.inf, 0.0
    # derivative/3 = d0 (1-s)^2 + 2 d1 s(1-s) + d2 s^2
    d0, d1, d2 = g1 - g0, g2 - g1, g3 - g2
    a, b, c = d0 - 2 * d1 + d2, 2 * (d1 - d0), d0
    first = second = 1.0
    disc = b * b - 4 * a * c
    if disc > 0.0:
        q = -0.5 * (b + math.copysign(math.sqrt(disc), b))
        r0 = q / a if a != 0.0 else 2.0
        r1 = c / q if q != 0.0 else 2.0
        first = r0 if 0.0 < r0 < 1.0 else 1.0
        second = r1 if 0.0 < r1 < 1.0 else 1.0
    least, most = min(first, second), max(first, second)
    roots, count = np.empty(3), 0
    for low, high in ((0.0, least), (least, most), (most, 1.0)):
        flow, fhigh = cubic(g0, g1, g2, g3, low), cubic(g0, g1, g2, g3, high)
        if low == high or flow * fhigh > 0.0:
            continue
        for step in range(70):
            middle = 0.5 * (low + high)
            if step == HALVINGS:
                # Newton from here; where it does not settle inside, halving goes on
                new, settled = middle, False
                for _ in range(8):
                    slope = 3.0 * ((a * new + b) * new + c)
                    if slope == 0.0 or not low <= new <= high:
                        break
                    move = cubic(g0, g1, g2, g3, new) / slope
                    new -= move
                    settled = abs(move) < 1e-16
                    if settled:
                        break
                if settled and low <= new <= high:
                    low = high = new
                    break
            if high - low <= 1e-16:
                break
            value = cubic(g0, g1, g2, g3, middle)
            if (value > 0.0) == (flow > 0.0):
                low = middle
            else:
                high = middle
        roots[count] = 0.5 * (low + high)
        count += 1
    skip = -1
    if own >= 0.0:
        nearest = 1e-6
        for k in range(count):
            if abs(roots[k] - own) < nearest:
                nearest, skip = abs(roots[k] - own), k
    best, best_s = np.inf, 0.0
    for k in range(count):
        if k != skip:
            s = roots[k]
            t = (cubic(row[1], row[3], row[5], row[7], s) - px) * vx + (
                cubic(row[2], row[4], row[6], row[8], s) - py
            ) * vy
            if 1e-13 < t < best:
                best, best_s = t, s
    return best, best_s


@compiled
def arc_time(row, own, px, py, vx, vy):
    """First hit of an arc, in coordinates in which it is part of the unit circle."""
    qx, qy, wx, wy = (px - row[1]) / row[3], (py - row[2]) / row[4], vx / row[3], vy / row[4]
    a, b, c = wx * wx + wy * wy, qx * wx + qy * wy, qx * qx + qy * qy - 1.0
    if own:
        c = 0.0
    disc = b * b - a * c
    if disc <= 0.0:
        return np.inf
    root = math.sqrt(disc)
    # the two roots without cancellation
    q = -(b + math.copysign(root, b))
    first, second = q / a, c / q
    if own:
        # one root is the start
        first, second = -2.0 * b / a, np.inf
    best = np.inf
    for t in (first, second):
        if 1e-13 < t < best:
            turn = math.atan2(qy + t * wy, qx + t * wx) - row[5]
            turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
            if abs(turn) <= row[6] + 1e-15:
                best = t
    return best


@compiled
def follow(table, x, theta):
    """Outgoing angle and a hash of the pieces hit; 0 for a ray that is lost."""
    px, py, vx, vy = x, 0.0, -math.cos(theta), -math.sin(theta)
    own, own_s, label = -1, -1.0, np.uint64(1)
    for _ in range(MOST_HITS):
        time, piece, place = np.inf, -1, 0.0
        for k in range(table.shape[0]):
            row = table[k]
            t, s = np.inf, 0.0
            if row[0] == 0.0:
                if k != own:
                    ex, ey = row[3] - row[1], row[4] - row[2]
                    det = ex * vy - ey * vx
                    if det != 0.0:
                        rx, ry = row[1] - px, row[2] - py
                        fraction = (vx * ry - vy * rx) / det
                        if -1e-15 <= fraction <= 1.0 + 1e-15:
                            t = (ex * ry - ey * rx) / det
            elif row[0] == 1.0:
                t = arc_time(row, k == own, px, py, vx, vy)
            else:
                t, s = bezier_time(row, own_s if k == own else -1.0, px, py, vx, vy)
            if 1e-13 < t < time:
                time, piece, place = t, k, s
        if vy > 0.0 and own >= 0 and -py / vy <= time:
            return math.atan2(vy, vx), label
        if piece < 0:
            return theta, np.uint64(0)
        row = table[piece]
        px, py = px + time * vx, py + time * vy
        if row[0] == 0.0:
            nx, ny = row[2] - row[4], row[3] - row[1]
        elif row[0] == 1.0:
            nx, ny = (px - row[1]) / row[3] ** 2, (py - row[2]) / row[4] ** 2
        else:
            s = place
            px, py = cubic(row[1], row[3], row[5], row[7], s), cubic(row[2], row[4], row[6], row[8], s)
            nx = -((1 - s) ** 2 * (row[4] - row[2]) + 2 * s * (1 - s) * (row[6] - row[4]) + s * s * (row[8] - row[6]))
            ny = (1 - s) ** 2 * (row[3] - row[1]) + 2 * s * (1 - s) * (row[5] - row[3]) + s * s * (row[7] - row[5])
        twice = 2.0 * (vx * nx + vy * ny) / (nx * nx + ny * ny)
        vx, vy = vx - twice * nx, vy - twice * ny
        size = math.hypot(vx, vy)
        vx, vy = vx / size, vy / size
        own, own_s = piece, place
        label = label * np.uint64(6364136223846793005) + np.uint64(2 * piece + 3)
    return theta, np.uint64(0)


@compiled
def follow_all(table, x, theta):
    """Outgoing angles; nan for rays that are lost."""
    out = np.empty(x.shape[0])
    for k in range(x.shape[0]):
        angle, label = follow(table, x[k], theta[k])
        out[k] = angle if label > 0 else np.nan
    return out


def outgoing_angles(wall, x, theta):
    """Outgoing angles of rays into a wall with its islands, specular on flat tops; nan for rays that are lost."""
    flat = np.zeros(x.shape, dtype=bool)
    for piece in wall.pieces:
        if isinstance(piece, Segment) and piece.start[1] == 0.0 == piece.end[1]:
            flat |= (piece.start[0] <= x) & (x <= piece.end[0])
    pieces = [*wall.pieces, *(piece for loop in wall.islands for piece in loop)]
    out = np.pi - theta
    out[~flat] = follow_all(table_of(SimpleNamespace(pieces=pieces)), x[~flat], theta[~flat])
    return out


def legendre_functions(theta, degrees):
    """Orthonormal Legendre polynomials of the cosine, of degrees 1 to ``degrees``, shape (angles, degrees)."""
    return np.polynomial.legendre.legvander(np.cos(theta), degrees)[:, 1:] * np.sqrt(2.0 * np.arange(degrees) + 3.0)
