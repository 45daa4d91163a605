"""Disks, walls under them, tables around them, and states of their invariant measures, for all tests of collisions."""

import math

import numpy as np

from asperity import geometry as geo
from asperity.geometry.disk.satellites import Satellites

DISK = geo.Disk(1.0, 0.6)
PARABOLAS = geo.double_parabola()
# an overhang, an inflection, a bump, and a corner
WAVES = geo.Wall(
    [
        geo.Bezier([(0, 0), (0.25, -0.1), (-0.05, -0.5), (0.4, -0.5)]),
        geo.Bezier([(0.4, -0.5), (0.55, -0.1), (0.75, -0.6), (0.8, -0.2)]),
        geo.Bezier([(0.8, -0.2), (0.85, 0), (1, 0)]),
    ]
)
# b' = 0 at the start: the piece begins with control points that coincide
STILL = geo.Wall(
    [geo.Bezier([(0, 0), (0, 0), (0.4, -0.7), (0.5, -0.7)]), geo.Bezier([(0.5, -0.7), (0.8, -0.7), (1, 0)])]
)
BEZIERS = {"parabolas": PARABOLAS, "waves": WAVES, "still": STILL}
WALLS = {
    "triangular": geo.triangular_teeth(1.2),
    "rectangular": geo.rectangular_teeth(0.5),
    "focusing": geo.focusing_arcs(1.2),
    "dispersing": geo.dispersing_arcs(1.0),
    "elliptical": geo.elliptical_arcs(1.0, DISK),
    "koch": geo.koch(2),
    "open": geo.Wall.from_vertices([(0, -0.1), (0.3, -0.4), (0.6, -0.15), (1, -0.1)]),
    "islands": geo.Wall([geo.Segment((0, -0.5), (1, -0.5))], islands=[[geo.Arc((0.4, -0.2), 0.1, 0.0, -2 * math.pi)]]),
}


NAMED_TABLES = {
    "circle": geo.Container.circle(1.5), "ellipse": geo.Container.ellipse(1.0, 2.0),
    "stadium": geo.Container.stadium(1.0, 0.5), "sinai": geo.Container.sinai(2.0, 0.7),
}  # fmt: skip


def states(wall, scale, n, seed=0, disk=DISK, spacing=None):
    """States of the invariant measure over one cell and one spacing."""
    rng = np.random.default_rng(seed)
    ring = Satellites.around(scale, scale * wall.depth, spacing)
    position = np.stack([rng.random(n) * scale * wall.period, (rng.random(n) - 0.5) * ring.spacing], axis=1)
    theta = np.arccos(1 - 2 * rng.random(n))
    # psi with density sin^2 by rejection
    psi = np.pi * rng.random(4 * n)
    psi = psi[rng.random(4 * n) < np.sin(psi) ** 2][:n]
    return position, -disk.from_angles(theta, psi)


def gear(teeth=40, depth=0.08):
    """A disk with triangular teeth, at unequal angles."""
    turns = 2.0 * np.pi * (np.arange(2 * teeth) + 0.3 * np.sin(np.arange(2 * teeth))) / (2 * teeth)
    return geo.SatelliteDisk(geo.Disk(), 2 * teeth, 0.0, [1.0, 1.0 - depth] * teeth, turns, joined=True)


# ---- pairs -------------------------------------------------------------------------------------------------------
PAIR = geo.Disk(1.0, 0.15), geo.Disk.from_inertia(2.0, 0.7, 1.5)
VELOCITY = np.array([[-1.6, -1.0, 0.2], [0.1, 0.3, -0.6]])
UNEQUAL = geo.SatelliteDisk(
    geo.Disk(), 5, [0.1, 0.25, 0.05, 0.3, 0.15], [1.0, 0.9, 1.1, 0.8, 1.0], [0.1, 1.0, 2.9, 4.0, 5.5]
)
TOOTHED = geo.SatelliteDisk(geo.Disk.from_inertia(2.0, 0.7, 1.5), 12, 0.02, [1.5, 1.1] * 6, joined=True)


def bodies(count):
    """Two disks with equal spacing, so that the difference of two satellites has this spacing too."""
    spacing = 2.0 * math.pi / count
    first = geo.SatelliteDisk(PAIR[0], count, 0.5 * spacing)
    return first, geo.SatelliteDisk(PAIR[1], 3 * count // 2, 0.25 * spacing)


def starts(first, second, n, seed=0):
    """The first disk just above the second at random angles."""
    position = np.zeros((n, 2, 3))
    position[:, 0, 1] = first.largest + second.largest + 2e-3 * np.pi / first.count
    position[:, :, 2] = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, (n, 2))
    return position, np.tile(VELOCITY, (n, 1, 1))
