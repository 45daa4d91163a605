"""Sectors of escape of the lines of a hollow: rays in them meet nothing, and few others escape."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.geometry.curves.columns import ESCAPE_LEFT, ESCAPE_RIGHT, JOINT_X, JOINT_Y
from asperity.geometry.scene import scene
from asperity.geometry.scene.closed_forms import ESCAPE_MARGIN, MOST_LINES, escape_sectors

SLOT = [(0, 0), (0.2, -0.6), (0.5, -0.1), (0.5, -0.5), (0.51, -0.5), (0.51, -0.1), (0.9, -0.4), (1, 0)]
NOTCH = [(0, 0), (0.1, -0.95), (0.45, -0.9), (0.55, -0.3), (0.5, -0.5), (0.47, -0.2), (1, 0)]
CAVE = [(0, 0), (0.3, -0.1), (0.1, -0.3), (0.2, -0.9), (0.8, -0.8), (0.93, -0.35), (0.6, -0.2), (1, 0)]

MIRRORED = [(1 - x, y) for x, y in reversed(NOTCH)]


def rough(count, seed):
    """A random polygonal valley."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, count + 1) + np.r_[0.0, rng.uniform(-0.4, 0.4, count - 1) / count, 0.0]
    return np.stack([x, np.r_[0.0, -rng.uniform(0.05, 0.5, count - 1), 0.0]], axis=1)


def spiral(seed):
    """A random simple chain with overhangs: the outline of a star, cut open at its top."""
    rng = np.random.default_rng(seed)
    turn = np.sort(rng.uniform(0.1, 2.0 * np.pi - 0.1, 40))
    radius = rng.uniform(0.15, 0.45, 40)
    points = np.stack([0.5 - radius * np.sin(turn), -0.5 + radius * np.cos(turn)], axis=1)
    return np.concatenate([[(0.4, 0.0)], points, [(0.6, 0.0)]])


def is_met(points, line, start, velocity):
    """Return whether a ray that leaves a line meets another piece below the opening, by plain crossing of segments."""
    a, b = np.delete(points[:-1], line, axis=0), np.delete(points[1:], line, axis=0)
    side_a, side_b = (velocity[0] * (part[:, 1] - start[1]) - velocity[1] * (part[:, 0] - start[0]) for part in (a, b))
    crosses = side_a * side_b <= 0.0
    place = np.divide(side_a, side_a - side_b, out=np.zeros(len(a)), where=side_a != side_b)
    there = a + place[:, np.newaxis] * (b - a)
    return bool(np.any(crosses & ((there - start) @ velocity > 0.0)))


@pytest.mark.parametrize(
    "points",
    [
        *(np.array(points, float) for points in (SLOT, CAVE, NOTCH, MIRRORED)),
        rough(30, 1),
        rough(200, 2),
        *map(spiral, range(6)),
    ],
    ids=["slot", "cave", "notch", "mirrored notch", "valley", "long valley", *map("star {}".format, range(6))],
)
def test_a_ray_in_the_sector_of_its_line_meets_no_piece(points):
    rng, sectors, seen = np.random.default_rng(7), escape_sectors(points, 1.0), 0
    for line in np.flatnonzero(sectors[:, 0] > 0.0):
        a, b = points[line], points[line + 1]
        for fraction in (1e-3, *rng.random(10), 1.0 - 1e-3):
            # up to the very edges of the sector
            for share in (-1.0 + 1e-9, *rng.uniform(-1.0, 1.0, 5), 1.0 - 1e-9):
                velocity = np.array([share * sectors[line, 0 if share > 0.0 else 1], 1.0])
                seen += 1
                assert not is_met(points, line, a + fraction * (b - a), velocity)
                assert velocity @ (a[1] - b[1], b[0] - a[0]) > 0.0
    assert seen > 0


def test_the_sector_of_a_valley_of_two_lines_ends_at_their_own_directions():
    points = np.array([(0.0, 0.0), (0.5, -1.0), (1.0, 0.0)])
    limit = 1.0 / (2.0 + 5.0 * ESCAPE_MARGIN)
    assert np.allclose(escape_sectors(points, 1.0), limit, rtol=1e-12)


def test_lines_below_an_overhang_and_at_narrow_slots_have_no_sector():
    narrow = np.array(SLOT, float)
    narrow[4:6, 0] = 0.5 + 1e-9
    sectors = escape_sectors(narrow, 1.0)
    assert np.all(sectors[1:6] == 0.0) and np.all(sectors[[0, 6]] > 0.0)
    assert np.all(escape_sectors(np.array(CAVE, float), 1.0)[1:6] == 0.0)


def test_long_hollows_have_no_sectors():
    assert np.all(escape_sectors(rough(MOST_LINES, 3), 1.0).max(axis=1) >= 0.0)
    assert np.any(escape_sectors(rough(MOST_LINES, 3), 1.0) > 0.0)
    assert not np.any(escape_sectors(rough(MOST_LINES + 1, 3), 1.0))


def test_most_rays_leave_a_flat_profile_in_a_sector():
    wall = geo.Wall.from_vertices(rough(400, 4) * (1.0, 0.1))
    lines, joints = wall.scene.lines, wall.scene.joints
    assert np.mean(lines[:-1, [ESCAPE_LEFT, ESCAPE_RIGHT]] > 0.0) == 1.0
    sectors = escape_sectors(joints[:, [JOINT_X, JOINT_Y]], 1.0)
    assert np.array_equal(sectors, lines[:-1, [ESCAPE_RIGHT, ESCAPE_LEFT]])


def test_rays_at_the_edges_of_a_sector_have_the_bits_of_a_search_of_all_lines(monkeypatch):
    count = 100
    points = rough(count, 5)
    rng = np.random.default_rng(6)
    sectors = escape_sectors(points, 1.0)
    line = rng.integers(count, size=5_000)
    a, b = points[line], points[line + 1]
    start = a + rng.random(5_000)[:, np.newaxis] ** 6 * (b - a)
    # rays that come in against directions near the edge; sent back, they leave in these directions
    offset = 10.0 ** rng.uniform(-14.0, -1.0, 5_000) * rng.choice([-1.0, 1.0], 5_000)
    side = rng.integers(2, size=5_000)
    cotangent = np.where(side == 0, sectors[line, 0], -sectors[line, 1]) + offset
    x, theta = start[:, 0] - start[:, 1] * cotangent, np.arctan2(1.0, cotangent)
    found = []
    for least in (scene.TREE_LINES, 10**6):
        monkeypatch.setattr(scene, "TREE_LINES", least)
        wall = geo.Wall.from_vertices(points)
        out = geo.trace(wall, x, theta)
        back = geo.trace(wall, out.x, np.clip(out.theta, 1e-12, np.pi - 1e-12))
        found.append((out.x, out.theta, out.collisions, out.status, back.x, back.theta, back.collisions, back.status))
    for mine, right in zip(*found, strict=True):
        assert np.array_equal(mine, right)
