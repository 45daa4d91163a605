"""Walls for all tests, by their names: polygons, channels, arcs, Bezier pieces, plates, islands."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from campaigns.rays.aimed_rays import WALLS as AIMED_AT

from asperity import geometry as geo
from asperity.geometry import Arc, Bezier, Segment

pi = np.pi
FLOOR = [(0.0, -0.9), (1.0, -0.9)]


def polygon(*points):
    """The sides of a polygon with these vertices."""
    return [Segment(p, q) for p, q in pairwise(points)]


def parabola_as_a_cubic(start, middle, end, bump=0.0):
    """The quadratic Bezier piece of these points as a cubic one, whose second point is raised by ``bump``."""
    start, middle, end = map(np.array, (start, middle, end))
    second = start + (middle - start) * 2 / 3 + [0.0, bump]
    return Bezier([start, second, end + (middle - end) * 2 / 3, end])


def wall_with_inflections():
    """Two pieces with an inflection each."""
    return geo.Wall(
        [
            Bezier([(0, 0), (0.8, -0.3), (-0.1, -0.6), (0.5, -0.9)]),
            Bezier([(0.5, -0.9), (1.1, -0.6), (0.2, -0.3), (1, 0)]),
        ]
    )


def over_floor(*islands):
    """An open wall: islands above a flat floor."""
    return geo.Wall(polygon(*FLOOR), period=1.0, islands=list(islands))


def square(x, y, side):
    """An island."""
    return polygon((x, y), (x + side, y), (x + side, y + side), (x, y + side), (x, y))


def flask(radius, neck=0.1):
    """A round cavity below an opening of half width ``neck`` in the middle of the cell."""
    tilt = np.arcsin(neck / radius)
    cavity = Arc((0.5, -radius * np.cos(tilt)), radius, pi / 2 + tilt, pi / 2 - tilt + 2 * pi)
    return geo.Wall([*polygon((0, 0), (0.5 - neck, 0)), cavity, *polygon((0.5 + neck, 0), (1, 0))])


def plate(face):
    """A plate without thickness: an island of a curve there and back."""
    return over_floor([face, face.reversed()])


def bumpy_floor():
    """A floor whose corners are below y = 0 under a disk."""
    floor = polygon((0.0, -0.8), (0.5, -1.0), (1.0, -0.8))
    return geo.Wall(floor, period=1.0, islands=[[Arc((0.4, -0.4), 0.2, 0.0, -2.0 * pi)]])


def several_hollows():
    """A notch, a flat top, a half circle, a trough and a flat top."""
    arc = Arc((0.5, 0.0), 0.1, pi, 2.0 * pi)
    left, right = [(0, 0), (0.1, -0.3), (0.3, 0), (0.4, 0)], [(0.6, 0), (0.65, -0.2), (0.85, -0.2), (0.9, 0), (1, 0)]
    return geo.Wall([*polygon(*left), arc, *polygon(*right)])


def valley_of_arcs():
    """One hollow of five arcs, focusing and dispersing in turn, and a line."""
    points = [(0, 0), (0.15, -0.25), (0.35, -0.4), (0.5, -0.5), (0.7, -0.35), (0.85, -0.3), (1, 0)]
    pieces = polygon(*points[:2])
    for k, (start, end) in enumerate(pairwise(points[1:])):
        (x0, y0), (x1, y1), side = start, end, 1.0 if k % 2 else -1.0
        chord, bearing, half = np.hypot(x1 - x0, y1 - y0), np.arctan2(y1 - y0, x1 - x0), 0.5
        rise = side * 0.5 * chord / np.tan(half)
        centre = 0.5 * (x0 + x1) - rise * np.sin(bearing), 0.5 * (y0 + y1) + rise * np.cos(bearing)
        middle = bearing - side * pi / 2
        pieces.append(Arc(centre, 0.5 * chord / np.sin(half), middle - side * half, middle + side * half))
    return geo.Wall(pieces)


def funnel(top, bottom, depth):
    """An isosceles trapezoid that narrows downwards, or upwards where bottom > top."""
    left, right = [(0.5 - top / 2, 0), (0.5 - bottom / 2, -depth)], [(0.5 + bottom / 2, -depth), (0.5 + top / 2, 0)]
    return geo.Wall.from_vertices([(0, 0), *left, *right, (1, 0)])


def tilted_channel(angle):
    """A channel with a flat end, tilted about its upper left joint, below an opening as wide as its mouth."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    inner = np.array([(0, 0), (0, -2.0), (0.05, -2.0), (0.05, 0)]) @ turn + np.array([0.4, -0.1])
    return geo.Wall.from_vertices([(0, 0), (0.35, 0), *inner.tolist(), (max(inner[3, 0], 0.4) + 0.05, 0.0), (1, 0)])


def random_teeth(count=400, seed=5):
    """One hollow with a ragged floor of many long and short lines, overhanging in places."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, count + 1)[1:-1] + 0.3 / count * (rng.random(count - 1) - 0.5)
    y = -0.2 - 0.6 * rng.random(count - 1) ** 3
    return geo.Wall.from_vertices([(0, 0), *zip(x, y, strict=True), (1, 0)])


def comb(count=60):
    """Parallel slots below a common opening: every line is long and runs through many cells of a grid."""
    points = [(0.0, 0.0), (0.0, -1.0)]
    for k in range(count):
        left, right = (k + 0.4) / count, (k + 0.6) / count
        points += [(left, -1.0), (left, -0.1), (right, -0.1), (right, -1.0)]
    return geo.Wall.from_vertices([*points, (1.0, -1.0), (1.0, 0.0)])


def curved_floor(count=80):
    """Many lines and two Bezier pieces in one hollow."""
    flank = [(0.3 * k / count, -0.5 * k / count - 0.01 * (k % 2)) for k in range(count)]
    x, y = flank[-1]
    curves = [Bezier([(x, y), (0.4, -0.9), (0.5, -0.4)]), Bezier([(0.5, -0.4), (0.6, -0.9), (1 - x, y)])]
    return geo.Wall([*polygon(*flank), *curves, *polygon(*((1 - px, py) for px, py in reversed(flank)))])


BUMPS = Arc((0, -0.25), 0.25, pi / 2, 0), Arc((0.5, -0.25), 0.25, pi, 0), Arc((1, -0.25), 0.25, pi, pi / 2)
CAVITIES = [(0.45, 0), (0.45, -0.1), (0, -0.1), (0, -1), (1, -1), (1, -0.1), (0.55, -0.1), (0.55, 0)]
CORNER_ON_EDGE = [(0, 0), (0, -1), (0.4, -0.4), (0, -0.4), (0, -0.2), (1, -0.2), (1, 0)]
BEGUN_BELOW = [(0, -1), (0.3, -1), (0.3, -0.5), (-0.2, -0.5), (-0.2, 0), (0.4, 0), (0.4, -1), (1, -1)]
NOTCH = [(0, -0.9), (0.4, -0.9), (0.5, -0.2), (0.4, -0.9), (1, -0.9)]
STEM = [(0, 0), (0.45, 0), (0.45, -3)], Bezier([(0.45, -3), (0.5, -2.6), (0.55, -3)]), [(0.55, -3), (0.55, 0), (1, 0)]
CAVE = [(0, 0), (0.49, 0), (0.1, -0.1), (0.3, -0.9), (0.8, -0.8), (0.93, -0.15), (0.51, 0), (1, 0)]
MIXED = Bezier([(0.2, -0.5), (0.3, -0.9), (0.5, -0.2), (0.6, -0.5)]), Bezier([(0.6, -0.5), (0.7, -0.5), (0.8, -0.3)])
CLOSED: dict[str, Callable[[], geo.Wall]] = {
    **{name: entry.build for name, entry in geo.WALLS.items()},
    # teeth
    "sharpest teeth": lambda: geo.triangular_teeth(0.02),
    "sharp teeth": lambda: geo.triangular_teeth(0.301),
    "obtuse teeth": lambda: geo.triangular_teeth(pi - 1e-4),
    "right angles": lambda: geo.triangular_teeth(pi / 2),
    "saw": lambda: geo.Wall.from_vertices([(0, 0), (0, -0.6), (1, 0)]),
    "leaning teeth": lambda: geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)]),
    "shallowest teeth": lambda: geo.Wall.from_vertices([(0, 0), (0.5, -1e-9), (1, 0)]),
    "deep teeth": lambda: geo.Wall.from_vertices([(0, 0), (0.5, -20.0), (1, 0)]),
    "large teeth": lambda: geo.triangular_teeth(1.0).scaled(3e5),
    "low teeth": lambda: geo.Wall.from_vertices([(0, -0.2), (0.1, -0.1), (0.4, -0.9), (0.7, -0.9), (1, -0.2)]),
    "profile": lambda: geo.Wall.from_profile(np.arange(300), np.random.default_rng(4).random(300)),
    "random teeth": random_teeth,
    "comb": comb,
    "koch 6": lambda: geo.koch(6),
    # channels, funnels and caves
    "deep crevices": lambda: geo.rectangular_teeth(30.0),
    "tilted channel": lambda: tilted_channel(0.3),
    "channel tilted back": lambda: tilted_channel(-0.2),
    "narrowing funnel": lambda: funnel(0.2, 0.05, 2.0),
    "widening funnel": lambda: funnel(0.05, 0.2, 2.0),
    "nearly a channel": lambda: funnel(0.1, 0.1 - 1e-9, 3.0),
    "bulging bottom": lambda: geo.Wall([*polygon(*STEM[0]), STEM[1], *polygon(*STEM[2])]),
    "overhang": lambda: geo.Wall.from_vertices([(0, 0), (0.4, 0), (0.2, -0.5), (0.9, -0.6), (0.6, 0), (1, 0)]),
    "cave": lambda: geo.Wall.from_vertices(CAVE),
    "leaning box": lambda: geo.Wall.from_vertices([(0, 0), (0.5, -1), (1.5, -1), (1, 0)]),
    "far leaning box": lambda: geo.Wall.from_vertices([(0, 0), (5, -1), (6, -1), (1, 0)]),
    "cavities that touch": lambda: geo.Wall.from_vertices([(0, 0), *CAVITIES, (1, 0)]),
    "begun in a cavity": lambda: geo.Wall.from_vertices(BEGUN_BELOW),
    "corner on an edge": lambda: geo.Wall.from_vertices(CORNER_ON_EDGE),
    "mushrooms without stem": lambda: geo.mushrooms(0.3),
    "narrowest mushrooms": lambda: geo.mushrooms(1e-8),
    "long stems": lambda: geo.mushrooms(0.1, 4.0),
    "mushrooms on mushrooms": lambda: geo.mushrooms(0.3, 0.5, 2),
    "large mushrooms": lambda: geo.mushrooms(0.4, 1.0).scaled(3e5),
    "small mushrooms": lambda: geo.mushrooms(0.3, 0.5).scaled(1e-6),
    # arcs and Bezier pieces
    "semicircles": lambda: geo.focusing_arcs(pi / 2),
    "shallow arcs": lambda: geo.focusing_arcs(0.06),
    "flattest arcs": lambda: geo.focusing_arcs(1e-8),
    "cusps": lambda: geo.dispersing_arcs(2.0),
    "bumps": lambda: geo.Wall(BUMPS),
    "caves": lambda: geo.Wall([Arc((0.25, 0), 0.25, pi, 2 * pi), Arc((0.75, 0), (0.25, 0.6), pi, 2 * pi)]),
    "flasks": lambda: flask(0.4),
    "flasks that touch": lambda: flask(0.5),
    "four arcs": lambda: AIMED_AT["four arcs"],
    "cubic bumps": lambda: AIMED_AT["cubic bumps"],
    "several hollows": several_hollows,
    "valley of arcs": valley_of_arcs,
    "nearly parabolas": lambda: geo.Wall(
        [
            parabola_as_a_cubic((0, 0), (0, -0.7), (0.5, -1.4), 1e-13),
            parabola_as_a_cubic((0.5, -1.4), (1, -0.7), (1, 0), -1e-6),
        ]
    ),
    "nearly straight": lambda: geo.Wall(
        [
            Bezier([(0, 0), (0.2, -0.3 + 1e-9), (0.3, -0.45), (0.4, -0.6)]),
            Bezier([(0.4, -0.6), (0.6, -0.4 - 2e-15), (1, 0)]),
        ]
    ),
    "nearly a cusp": lambda: geo.Wall([Bezier([(0, 0), (0.999, -1.2), (0.001, -1.2), (1, 0)])]),
    "vertical ends": lambda: geo.Wall([Bezier([(0, 0), (0, -0.6), (1, -0.6), (1, 0)])]),
    "inflections": wall_with_inflections,
    "line and cubic": lambda: geo.Wall(
        [
            Bezier([(0, 0), (0.1, -0.5), (0.5, -0.6), (0.6, 0)]),
            *polygon((0.6, 0), (0.7, 0), (0.8, -0.4)),
            Bezier([(0.8, -0.4), (0.85, -0.1), (1, 0)]),
        ]
    ),
    "mixed": lambda: geo.Wall([*polygon((0, 0), (0.2, -0.5)), *MIXED, *polygon((0.8, -0.3), (1, 0))]),
    "curved floor": curved_floor,
    "many cubics": lambda: geo.random_wall(geo.HeightCorrelation(0.1), 16, rms_slope=0.5, smooth=True, rng=3),
    # plates without thickness
    "plate in a notch": lambda: geo.Wall.from_vertices([(0, 0), *NOTCH, (1, 0)]),
    "plate along the top": lambda: geo.Wall.from_vertices([(0, 0), (0.7, 0), (0.2, 0), (0.2, -1), (1, -1), (1, 0)]),
    "floor": over_floor,
}
OPEN: dict[str, Callable[[], geo.Wall]] = {
    "floating plate": lambda: plate(Segment((0.2, -0.5), (0.7, -0.3))),
    "plate on the floor": lambda: plate(Segment((0.2, -0.9), (0.7, -0.9))),
    "plate in the opening": lambda: plate(Segment((0.2, 0.0), (0.7, 0.0))),
    "plate in a side": lambda: plate(Segment((0.0, -0.9), (0.0, -0.3))),
    "bent plate": lambda: plate(Arc((0.5, -0.6), 0.3, 2.5, 0.6)),
    "elliptical plate": lambda: plate(Arc((0.5, -0.6), (0.3, 0.2), 2.5, 0.6)),
    "cubic plate": lambda: plate(Bezier([(0.2, -0.5), (0.4, -0.1), (0.6, -0.8), (0.8, -0.4)])),
    "island": bumpy_floor,
    "squares that touch": lambda: over_floor(square(0.2, -0.5, 0.2), square(0.4, -0.5, 0.2)),
    "square on the floor": lambda: over_floor(square(0.2, -0.9, 0.2)),
}
