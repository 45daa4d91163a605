"""Rays along the tangent at a smooth joint of two pieces: the number of hits as in 50 digits."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_precisely

from asperity import geometry as geo
from asperity.geometry.tracing import tracing

RAYS, STEEPEST = 8, 1.2
# Rays with more hits run along a focusing piece.
MOST_HITS = 25


def smooth_chain(kinds, rng, flattest):
    """Pieces from left to right with a common tangent at each joint, and points on them or of their control polygons.

    A piece is its kind, its points or the centre of an arc, and of an arc the radius and the angles of the ends. The
    radii of arcs of length 1 are from 1 to ``flattest``.
    """
    place, angle, parts, ends = np.zeros(2), rng.uniform(-0.9, 0.9), [], [np.zeros(2)]
    for kind in kinds:
        size, goal = 10.0 ** rng.uniform(-0.5, 0.3), rng.uniform(-STEEPEST, STEEPEST)
        along = np.array([np.cos(angle), np.sin(angle)])
        if kind == "line":
            points = np.array([place, place + size * along])
            parts.append((kind, points, ()))
        elif kind == "arc":
            radius = max(size / abs(goal - angle), 10.0 ** rng.uniform(0.0, np.log10(flattest)))
            goal = angle + np.copysign(size / radius, goal - angle)
            side = np.sign(goal - angle)
            centre = place + side * radius * np.array([-along[1], along[0]])
            first, last = angle - side * np.pi / 2, goal - side * np.pi / 2
            points = np.array([place, centre + radius * np.array([np.cos(last), np.sin(last)])])
            parts.append((kind, centre, (radius, first, last)))
        else:
            rise = 0.5 * size * (np.tan(angle) + np.tan(goal)) * rng.uniform(0.5, 1.5)
            end, after = place + np.array([size, rise]), np.array([np.cos(goal), np.sin(goal)])
            handles = size * rng.uniform(0.1, 0.45, 2) / np.array([along[0], after[0]])
            points = np.array([place, place + handles[0] * along, end - handles[1] * after, end])
            parts.append((kind, points, ()))
        angle, place = (angle if kind == "line" else goal), points[-1]
        ends.extend(points[1:])
    return parts, np.array(ends)


def smooth_wall(kinds, rng, flattest):
    """A hollow with a chain of pieces between two straight sides."""
    parts, points = smooth_chain(kinds, rng, flattest)
    scale = 0.8 / points[-1, 0]
    move = np.array([0.1, -0.2 - scale * points[:, 1].max()])
    pieces = []
    for kind, place, (*rest,) in parts:
        placed = scale * place + move
        if kind == "line":
            pieces.append(geo.Segment(*placed))
        elif kind == "arc":
            pieces.append(geo.Arc(placed, scale * rest[0], *rest[1:]))
        else:
            pieces.append(geo.Bezier(placed))
    sides = geo.Segment((0, 0), scale * points[0] + move), geo.Segment(scale * points[-1] + move, (1, 0))
    return geo.Wall([sides[0], *pieces, sides[1]])


def tangent_rays(wall, rng):
    """Rays along the tangents at joints that nothing hides, from 1e-17 to 1e-12 beside, also in the angle."""
    pieces = wall.pieces[1:-1]
    outline = np.concatenate([piece.point(np.linspace(0.0, 1.0, 200)) for piece in wall.pieces])
    rays = []
    for before, after in pairwise(pieces):
        joint, along = np.array(after.start), before.tangent(1.0)
        along = np.copysign(1.0, -along[1]) * along / np.hypot(*along)
        start = joint - along * joint[1] / along[1] if along[1] < -1e-3 else np.array([-1.0, 0.0])
        path = (outline - start) @ along, (outline - start) @ [-along[1], along[0]] * np.sign(along[0])
        hides = (path[0] > 0.0) & (path[0] < (joint - start) @ along + 0.01) & (path[1] > 1e-9)
        if 0.0 < start[0] < 1.0 and not hides.any():
            beside = rng.choice([-1.0, 1.0], (2, RAYS)) * 10.0 ** rng.uniform(-17.0, -12.0, (2, RAYS))
            angle = np.arctan2(-along[1], -along[0]) + beside[0]
            rays.append(np.array([joint[0] - joint[1] / np.tan(angle) + beside[1] / abs(along[1]), angle]))
    return np.concatenate(rays, axis=1) if rays else np.empty((2, 0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinds", "flattest", "seeds"),
    [
        # the seeds are of rays that had a hit too many or too few when only extrema within a piece were contacts
        (["curve"] * 4, 1.0, (20, 205)),
        (["line", "curve"] * 2, 1.0, (318,)),
        (["arc"] * 4, 1.0, (107,)),
        (["arc"] * 4, 30.0, (384,)),
        (["arc", "curve"] * 2, 1.0, (196,)),
    ],
)
def test_rays_along_the_tangent_at_a_smooth_joint_hit_what_50_digits_say(kinds, flattest, seeds, monkeypatch):
    for seed in seeds:
        rng = np.random.default_rng(seed)
        wall = smooth_wall(kinds, rng, flattest)
        x, theta = tangent_rays(wall, rng)
        found = []
        for in_waves in (False, True):
            monkeypatch.setattr(tracing, "_goes_in_waves", lambda scene, rays, waves=in_waves: waves)
            found.append(geo.trace(wall, x, theta, max_collisions=MOST_HITS))
        for i in np.flatnonzero(found[0].escaped | found[1].escaped):
            bounces = trace_precisely(wall, x[i], theta[i], MOST_HITS).hits
            assert all(one.collisions[i] == bounces for one in found if one.escaped[i])


def test_a_ray_that_leaves_a_line_away_from_the_curve_joined_to_it_does_not_hit_the_curve():
    # it leaves the line 2.5e-9 beyond the joint, and its line met the bump 7.4e-9 before, 1e-15 below the joint
    joint, bump = (0.3630046248162585, -0.15667392007609374), (0.46326412897069547, -0.21654692885660887)
    start, handles = (
        (0.1, -0.2575073835284527),
        [(0.3804122570205817, -0.15), (0.4268948512243287, -0.15689090503182399)],
    )
    wall = geo.Wall(
        [
            geo.Segment((0, 0), start),
            geo.Segment(start, joint),
            geo.Bezier([joint, *handles, bump]),
            geo.Segment(bump, (0.9, -1.0174602992946238)),
            geo.Segment((0.9, -1.0174602992946238), (1, 0)),
        ]
    )
    x, theta = 0.7716582203553766, 0.36610638681898505
    assert geo.trace(wall, x, theta).collisions == trace_precisely(wall, x, theta, MOST_HITS).hits == 2
