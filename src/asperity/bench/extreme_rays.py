"""Extreme rays and walls: single rays against closed forms in 50 digits, or against the double-double twin."""

from __future__ import annotations

from functools import partial
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from .. import geometry as geo
from ..checks import Floats
from .exact_rays import ExactRay, arc, cap, condition, crevice, exact_angle, spread_rays, tooth
from .extreme_row import ExtremeRow

if TYPE_CHECKING:
    from collections.abc import Callable

EPS = float(np.finfo(np.float64).eps)
UNIT = "eps x condition"
# The tracer's error in these units is below 5 wherever it was measured; a margin of six.
UNITS = 32.0
# Where the exact ray goes another way than the traced one, does one moved by so many ulps go the tracer's?
MOVES = tuple((dx * 2.0**k, dt * 2.0**k) for k in range(-1, 6) for dx in (-1, 0, 1) for dt in (-1, 0, 1) if dx or dt)
LOWEST_ANGLE = 1e-12
# Collisions after which the twin, which takes every step, is not asked.
TWIN_COLLISIONS = 2_000
AIM_ULPS = 2


def ray_cases(rays: int) -> dict[str, Callable[[], ExtremeRow]]:
    """The cases by name; each traces ``rays`` rays."""
    cases: dict[str, Callable[[], ExtremeRow]] = {}
    for angle in (1e-4, 1e-2, 0.7, pi - 1e-2, pi - 1e-4):
        name = f"triangular teeth, angle {angle:.10g}"
        cases[name] = partial(_closed, name, partial(geo.triangular_teeth, angle), tooth(angle), rays)
    for ratio in (1e-6, 1e-3, 1.0, 1e4, 1e8):
        name = f"rectangular teeth, r = {ratio:g}"
        # a tooth as wide as its crevice, which is half a cell
        cases[name] = partial(_closed, name, partial(geo.rectangular_teeth, ratio), crevice(ratio), rays)
    for half in (1e-8, 1e-4, 0.1, 1.2, pi / 2):
        name = f"arcs, half angle {half:.10g}"
        cases[name] = partial(_closed, name, partial(geo.focusing_arcs, half), arc(half), rays)
    for stem in (1e-8, 1e-4, 0.1):
        name = f"mushrooms without a stem, stem/cap {stem:g}, rays of one hit"
        cases[name] = partial(_closed, name, partial(geo.mushrooms, stem, 0.0), cap(stem), rays, single=True)
    twins: dict[str, Callable[[], geo.Wall]] = {
        "cusp between dispersing bumps": partial(geo.dispersing_arcs, 2.0),
        "mushrooms, stem/cap 0.3": partial(geo.mushrooms, 0.3, 0.5),
        "elliptical arcs, J = 1e3 m": partial(geo.elliptical_arcs, 0.9, geo.Disk(1.0, 1e3)),
        "Koch 8, 65536 lines": partial(geo.koch, 8),
    }
    for name, build in twins.items():
        cases[name] = partial(_against_twin, name, build, rays)
    for factor in (1e-6, 1e6):
        name = f"mushrooms scaled by {factor:g}"
        cases[name] = partial(_against_twin, name, partial(_scaled, factor), rays)
    for name, build in {"triangular teeth": partial(geo.triangular_teeth, 0.7), "Koch 3": partial(geo.koch, 3)}.items():
        cases[f"{name}, rays aimed at joints"] = partial(_aimed, f"{name}, rays aimed at joints", build, rays)
    return cases


def _scaled(factor: float) -> geo.Wall:
    return geo.mushrooms(0.3, 0.5).scaled(factor)


def _closed(name: str, build: Callable[[], geo.Wall], exact: ExactRay, rays: int, single: bool = False) -> ExtremeRow:
    """Rays into the first hollow against a closed form."""
    wall = build()
    place, theta = spread_rays(rays, LOWEST_ANGLE, 1)
    hollow = wall.hollows[0]
    traced = geo.trace(wall, hollow.left + (hollow.right - hollow.left) * place, theta)
    chosen = np.flatnonzero(traced.escaped & (traced.collisions == 1 if single else True))
    worst, moved = 0.0, 0
    for k in chosen:
        error, was_moved = _error(exact, float(place[k]), float(theta[k]), float(traced.theta[k]))
        hits = float(traced.collisions[k])
        worst = max(worst, error / (EPS * (1.0 + hits) * condition(exact, float(place[k]), float(theta[k]))))
        moved += was_moved
    note = f"{len(chosen)} rays compared, {moved} of them next to where the number of hits jumps"
    return ExtremeRow(name, "closed form, 50 digits", worst, UNITS, UNIT, counts=traced.counts(), note=note)


def _error(exact: ExactRay, place: float, theta: float, found: float) -> tuple[float, bool]:
    """Distance of the found angle from the exact one, and whether the exact ray had to be moved by a few ulps."""
    first = abs(exact_angle(exact, place, theta)[0] - found)
    if first <= UNITS * EPS * condition(exact, place, theta):
        return first, False
    moved = min(abs(exact_angle(exact, place, theta, move)[0] - found) for move in MOVES)
    return (moved, True) if moved < first else (first, False)


def _against_twin(name: str, build: Callable[[], geo.Wall], rays: int) -> ExtremeRow:
    """Rays over the whole cell against the double-double twin."""
    wall = build()
    place, theta = spread_rays(rays, LOWEST_ANGLE, 2)
    return _compared(name, wall, wall.period * place, theta)


def _aimed(name: str, build: Callable[[], geo.Wall], rays: int) -> ExtremeRow:
    """Rays whose straight way ends in a joint, or a few ulps of the angle beside it."""
    wall = build()
    rng = np.random.default_rng(3)
    joints = wall.vertices[wall.vertices[:, 1] < 0.0]
    target = joints[rng.integers(len(joints), size=rays)]
    x = wall.period * rng.random(rays)
    theta = np.arctan2(-target[:, 1], x - target[:, 0])
    return _compared(name, wall, x, theta + rng.integers(-AIM_ULPS, AIM_ULPS + 1, size=rays) * np.spacing(theta))


def _compared(name: str, wall: geo.Wall, x: Floats, theta: Floats) -> ExtremeRow:
    from ..geometry.refinement import refined_trace

    traced = geo.trace(wall, x, theta, max_collisions=TWIN_COLLISIONS)
    twin = refined_trace(wall.scene, x, theta, TWIN_COLLISIONS)
    gone = traced.escaped & (twin.status == geo.Status.ESCAPED)
    same = gone & (traced.collisions == twin.collisions)
    error = np.abs((traced.theta - twin.theta[:, 0]) - twin.theta[:, 1])
    units = error / (EPS * (1.0 + twin.collisions) * twin.amplification)
    note = f"{int(same.sum())} rays compared; {int((gone & ~same).sum())} took another number of hits"
    return ExtremeRow(
        name, "double-double twin", float(units[same].max(initial=0.0)), UNITS, UNIT, counts=traced.counts(), note=note
    )
