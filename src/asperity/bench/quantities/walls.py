"""The walls of the standard set, random walls outside it, and walls of the user."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise
from math import pi

import numpy as np

from ... import geometry as geo
from ...core.checks import Floats
from ...core.errors import InputError
from ...geometry.curves.curve import Curve

Point = tuple[float, float]

METRES_PER_DEGREE = 111_200.0
TRANSECT_ROW, EXAGGERATION = 170, 3.0
RANDOM_WALLS = 20


def terrain_profile() -> tuple[Floats, Floats]:
    """Distance along one row of matplotlib's elevation model, and height there, both in metres.

    The model shows the Jacksboro fault, from the U.S. Geological Survey's National Elevation Dataset.
    """
    from matplotlib import cbook

    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as model:
        height = np.asarray(model["elevation"], dtype=np.float64)[TRANSECT_ROW]
        spacing = METRES_PER_DEGREE * float(model["dx"]) * np.cos(np.radians(float(model["ymin"])))
    return spacing * np.arange(len(height)), height


def _measured() -> geo.Wall:
    x, height = terrain_profile()
    return geo.Wall.from_profile(x, EXAGGERATION * height, seam="mirror")


def _mixed() -> geo.Wall:
    lines = geo.Segment.path(np.array([(0.0, 0.0), (0.2, -0.3), (0.35, 0.0), (0.45, 0.0)]))
    arc = geo.Arc((0.6, 0.0), 0.15, pi, 2.0 * pi)
    return geo.Wall([*lines, arc, geo.Bezier([(0.75, 0.0), (0.8, -0.4), (0.95, -0.4), (1.0, 0.0)])], period=1.0)


def random_wall(number: int) -> geo.Wall:
    """Random wall ``number``: the first valid wall from its own generator.

    The generator is ``numpy.random.default_rng([8, number])``. One to four joints have positions uniform in (0.1, 0.9)
    and depths uniform in (0.05, 0.8). Walls of even number are polygons. On the others every piece is, with equal
    probability, a segment, a circular arc whose height over its chord is 0.05 to 0.3 chords, to either side, or a cubic
    whose inner control points are off the chord by up to 0.35 chords. Every third wall has an additional flat top of
    length 0.25.
    """
    rng = np.random.default_rng([8, number])
    while True:
        inner = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 5))))
        joints = [(0.0, 0.0), *((float(x), -float(rng.uniform(0.05, 0.8))) for x in inner), (1.0, 0.0)]
        try:
            pieces = [_piece(start, end, number % 2 == 1, rng) for start, end in pairwise(joints)]
            if number % 3 == 0:
                pieces.append(geo.Segment((1.0, 0.0), (1.25, 0.0)))
            return geo.Wall(pieces, period=1.25 if number % 3 == 0 else 1.0)
        except InputError:
            # its pieces cross; draw again
            continue


def _piece(start: Point, end: Point, curved: bool, rng: np.random.Generator) -> Curve:
    kind = int(rng.integers(0, 3)) if curved else 0
    if kind == 0:
        return geo.Segment(start, end)
    first, last = np.array(start), np.array(end)
    along = last - first
    chord = float(np.hypot(*along))
    normal = np.array([along[1], -along[0]])
    if kind == 1:
        side = float(rng.choice([-1.0, 1.0]))
        height = float(rng.uniform(0.05, 0.3)) * chord
        radius = (0.25 * chord**2 + height**2) / (2.0 * height)
        center = 0.5 * (first + last) + side * (height - radius) / chord * normal
        begin, finish = (float(np.arctan2(*(point - center)[::-1])) for point in (first, last))
        if side * (finish - begin) < 0.0:
            finish += side * 2.0 * pi
        return geo.Arc(tuple(center), radius, begin, finish).pinned(start, end)
    bends = rng.uniform(-0.35, 0.35, 2)
    control = [tuple(first + (k + 1) / 3 * along + bends[k] * normal) for k in range(2)]
    return geo.Bezier([start, *control, end])


_STANDARD: dict[str, Callable[[], geo.Wall]] = {
    "triangular-teeth": partial(geo.triangular_teeth, 0.7),
    "rectangular-teeth": partial(geo.rectangular_teeth, 2.0),
    "focusing-arc": partial(geo.focusing_arcs, 1.2),
    "cusps": partial(geo.dispersing_arcs, 2.0),
    "mushroom": partial(geo.mushrooms, 0.3, 0.5),
    "koch": partial(geo.koch, 4),
    "profile": _measured,
    "mixed": _mixed,
}
_RANDOM = {f"random-{number}": partial(random_wall, number) for number in range(RANDOM_WALLS)}


def scenes() -> tuple[str, ...]:
    """Names of the walls with stored references: the standard set and the random walls."""
    return (*_STANDARD, *_RANDOM)


def standard_names() -> tuple[str, ...]:
    """Names of the scenes of the standard set."""
    return tuple(_STANDARD)


@cache
def wall_of(scene: str) -> geo.Wall:
    """The wall of a scene, or of a text as `wall_from_text` reads it, constructed once in each process."""
    build = (_STANDARD | _RANDOM).get(scene)
    return geo.wall_from_text(scene) if build is None else build()
