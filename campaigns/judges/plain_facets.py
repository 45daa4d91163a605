"""Reflection by polygons with facets of their own, by formulas of this file alone: rays, and integral equations.

Rays meet segments by cross products, all segments for all rays. Diffuse walls have equations of Fredholm's second kind:
of a groove of the angle w in its sides, of a circular arc in closed form.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# A ray does not meet the segment that it leaves; other hits so near are those of the corner that it starts at.
NEAR = 1e-13
# The part of a side of a groove within e^-DEPTH of its apex is left out.
DEPTH = 25.0


def reflected(
    vertices: Floats, theta: Floats, diffuse: float, back: float, rng: np.random.Generator
) -> tuple[Floats, NDArray[np.int64]]:
    """Outgoing angles and hits of rays that enter the polygon at random points of y = 0 between its ends.

    A facet reflects diffusely with the probability ``diffuse``, back with ``back``, and else as a mirror.
    """
    incoming = -np.stack([np.cos(theta), np.sin(theta), np.zeros(len(theta))], axis=1)
    velocity, hits = flown(vertices, incoming, diffuse, back, rng)
    return np.arctan2(velocity[:, 1], velocity[:, 0]), hits


def flown(
    vertices: Floats, incoming: Floats, diffuse: float, back: float, rng: np.random.Generator, in_space: bool = False
) -> tuple[Floats, NDArray[np.int64]]:
    """Outgoing velocities of particles of speed 1 and hits on grooves along the third axis; see `reflected`.

    ``in_space`` a diffuse facet has the cosine law of the half sphere, else that of the half circle with the velocity
    along the grooves kept.
    """
    start, edge = vertices[:-1], np.diff(vertices, axis=0)
    along = edge / np.hypot(*edge.T)[:, None]
    number, width = len(incoming), vertices[-1, 0] - vertices[0, 0]
    point = np.stack([vertices[0, 0] + width * rng.random(number), np.zeros(number)], axis=1)
    velocity, along_groove = incoming[:, :2].copy(), incoming[:, 2].copy()
    own, hits = np.full(number, -1), np.zeros(number, np.int64)
    moving = np.arange(number)
    while len(moving):
        p, v = point[moving], velocity[moving]
        off = start[None] - p[:, None]
        across = v[:, None, 0] * edge[None, :, 1] - v[:, None, 1] * edge[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            time = (off[..., 0] * edge[None, :, 1] - off[..., 1] * edge[None, :, 0]) / across
            place = (off[..., 0] * v[:, None, 1] - off[..., 1] * v[:, None, 0]) / across
            exit_time = np.where(v[:, 1] > 0.0, -p[:, 1] / v[:, 1], np.inf)
        bad = ~((time > NEAR) & (place >= 0.0) & (place <= 1.0)) | (np.arange(len(edge)) == own[moving][:, None])
        time[bad] = np.inf
        first = np.argmin(time, axis=1)
        reach = time[np.arange(len(moving)), first]
        stays = reach < exit_time
        moving, p, v, first, reach = moving[stays], p[stays], v[stays], first[stays], reach[stays]
        t = along[first]
        n = np.stack([-t[:, 1], t[:, 0]], axis=1)
        vt, vn = np.sum(v * t, axis=1), np.abs(np.sum(v * n, axis=1))
        u, size = rng.random(len(moving)), np.hypot(vt, vn)
        tangential = size * (1.0 - 2.0 * rng.random(len(moving)))
        normal = np.sqrt(size**2 - tangential**2)
        is_diffuse, is_back = u < diffuse, (u >= diffuse) & (u < diffuse + back)
        if in_space:
            # tangential velocities of the cosine law are uniform on the disc
            radius, turn = np.sqrt(rng.random(len(moving))), 2.0 * pi * rng.random(len(moving))
            tangential, normal = radius * np.cos(turn), np.sqrt(1.0 - radius**2)
            along_groove[moving] = np.where(is_diffuse, radius * np.sin(turn), along_groove[moving])
        vt = np.where(is_diffuse, tangential, np.where(is_back, -vt, vt))
        vn = np.where(is_diffuse, normal, vn)
        point[moving], velocity[moving] = p + reach[:, None] * v, vt[:, None] * t + vn[:, None] * n
        own[moving] = first
        hits[moving] += 1
    return np.column_stack([velocity, along_groove]), hits


def diffuse_groove(angle: float, number: int) -> float:
    """3 E[cos theta cos theta'] of a symmetric groove with diffuse sides and this interior angle, by Nystrom's method.

    The sides have length 1. A point at the distance x from the apex sees the other side by the view factor
    K(x, y) dy = sin^2 w x y / (2 (x^2 + y^2 - 2 x y cos w)^(3/2)) dy, and the opening by the difference of cosines.
    """
    node, weight = np.polynomial.legendre.leggauss(number)
    # the kernel depends on x / y near the apex: nodes are Gauss's in ln x
    x = np.exp(-0.5 * DEPTH * (node + 1.0))
    w = 0.5 * DEPTH * weight * x
    kernel = np.sin(angle) ** 2 * x[:, None] * x / 2.0
    kernel /= (x[:, None] ** 2 + x**2 - 2.0 * x[:, None] * x * np.cos(angle)) ** 1.5
    half = 0.5 * angle
    # sides from the apex to (-+sin half, cos half); of the mean of cos(theta') of the left side at x, by directions to
    # both ends of the opening: the horizontal momentum of the cosine law between two directions
    left = np.array([-np.sin(half), np.cos(half)])
    ends = [np.array([-np.sin(half), np.cos(half)]), np.array([np.sin(half), np.cos(half)])]
    tangent, normal = -left, np.array([np.cos(half), np.sin(half)])
    moment = np.empty(number)
    for k, at in enumerate(x):
        phi = [abs(np.arctan2((end - at * left) @ normal, (end - at * left) @ tangent)) for end in ends]
        low, high = min(phi), max(phi)
        # int sin(phi)/2 (cos phi tangent_x + sin phi normal_x) dphi
        one = 0.25 * (np.sin(high) ** 2 - np.sin(low) ** 2)
        two = 0.25 * ((high - low) - 0.5 * (np.sin(2 * high) - np.sin(2 * low)))
        moment[k] = one * tangent[0] + two * normal[0]
    # the right side has the opposite moment: u = e - K u
    solution = np.linalg.solve(np.eye(number) + kernel * w, moment)
    width = 2.0 * np.sin(half)
    return float(3.0 * 2.0 / width * np.sum(w * moment * solution))


def diffuse_arc(half_angle: float) -> float:
    """3 E[cos theta cos theta'] of a focusing circular arc of this half span with diffuse facets, in closed form."""
    a = half_angle
    s = 3.0 * (pi - a) / 16.0
    c = -(s / 3.0) * sin(a) * cos(0.5 * a) ** 2 / (sin(a) + a * sin(0.5 * a) ** 2)
    return 3.0 * (pi - a) / (8.0 * sin(a)) * (s * (a - sin(a) * cos(a)) - 2.0 * c * (sin(a) - a * cos(a)))
