"""The walls of the extreme cases, by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import pi

from asperity import geometry as geo

TOOTH_ANGLES = (1e-4, 1e-2, 0.7, pi - 1e-2, pi - 1e-4)
TOOTH_RATIOS = (1e-6, 1e-3, 1.0, 1e4, 1e8)
ARC_ANGLES = (1e-8, 1e-4, 0.1, 1.2, pi / 2)
STEMS = (1e-8, 1e-4, 0.1)
FACTORS = (1e-6, 1e6)
# Walls on which every ray enters at the least angle, and at the greatest angle.
GRAZED = {
    "triangular teeth": partial(geo.triangular_teeth, 0.7),
    "rectangular teeth": partial(geo.rectangular_teeth, 1.0),
    "arcs": partial(geo.focusing_arcs, 1.2),
}
AIMED_AT = {"triangular teeth": partial(geo.triangular_teeth, 0.7), "Koch 3": partial(geo.koch, 3)}
OVERHANG = ((0.0, 0.0), (0.4, 0.0), (0.2, -0.5), (0.9, -0.6), (0.6, 0.0), (1.0, 0.0))


def extreme_walls() -> dict[str, Callable[[], geo.Wall]]:
    """A constructor for each wall; the rays and their exact results are in ``extreme_rays.json``."""
    walls: dict[str, Callable[[], geo.Wall]] = {}
    for name, build in GRAZED.items():
        walls |= {f"{name}, theta = 1e-12": build, f"{name}, theta = pi - 1e-12": build}
    walls |= {f"triangular teeth, angle {angle:.10g}": partial(geo.triangular_teeth, angle) for angle in TOOTH_ANGLES}
    walls |= {f"rectangular teeth, r = {ratio:g}": partial(geo.rectangular_teeth, ratio) for ratio in TOOTH_RATIOS}
    walls |= {f"arcs, half angle {half:.10g}": partial(geo.focusing_arcs, half) for half in ARC_ANGLES}
    walls |= {f"mushrooms of stem aspect 0, stem/cap {stem:g}": partial(geo.mushrooms, stem, 0.0) for stem in STEMS}
    walls |= {
        "mushrooms, stem/cap 0.3": _mushrooms,
        "cusp between dispersing bumps": partial(geo.dispersing_arcs, 2.0),
        "elliptical arcs, J = 1e3 m": partial(geo.elliptical_arcs, 0.9, geo.Disk(1.0, 1e3)),
        "overhangs": partial(geo.Wall.from_vertices, OVERHANG),
        "depth 1e-9": partial(_notch, 1e-9),
        "depth 1e3": partial(_notch, 1e3),
        "floating islands": _islands,
        "floating islands, theta = 1e-12": _islands,
        "Koch 8, 65536 lines": partial(geo.koch, 8),
    }
    walls |= {f"mushrooms scaled by {factor:g}": partial(_mushrooms, factor) for factor in FACTORS}
    walls |= {f"{name}, rays aimed at joints": build for name, build in AIMED_AT.items()}
    return walls


def _mushrooms(factor: float = 1.0) -> geo.Wall:
    return geo.mushrooms(0.3, 0.5).scaled(factor)


def _notch(depth: float) -> geo.Wall:
    return geo.Wall.from_vertices([(0.0, 0.0), (0.4, -depth), (1.0, 0.0)])


def _islands() -> geo.Wall:
    """Balls over a zigzag floor: no hollow is closed, so rays wrap around the period."""
    floor = [geo.Segment((0.0, -0.8), (0.5, -1.0)), geo.Segment((0.5, -1.0), (1.0, -0.8))]
    return geo.Wall(floor, period=1.0, islands=[[geo.Arc((0.4, -0.4), 0.2, 0.0, -2.0 * pi)]])
