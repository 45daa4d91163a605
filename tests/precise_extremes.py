"""Rays on the extreme walls, and where they go in 50 digits: python tests/precise_extremes.py [CASE] writes the data.

The stability report reads ``src/asperity/bench/extreme_rays.json``. Walls with a closed form are judged by it
(`precise_rays`), the others by the tracer in 50 digits (`precise_tracer`); neither shares code with the library.

Of each ray the file has the place, the angle, the outgoing angle rounded once, the number of hits, the condition (1 +
the moduli of the derivatives of the outgoing state by the incoming one, places in cells), whether it is known to pass a
corner too closely, and what becomes of it when it is moved by up to 32 ulps, where that is something else.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from math import pi
from pathlib import Path

import mpmath as mp
import numpy as np

from asperity.bench import extreme_walls as walls
from asperity.bench.extreme_rays import CLEAR, DATA, IN_ANGLE, IN_WALL, TOO_FAR
from precise_rays import arc, cap, cap_clearance, crevice, tooth
from precise_tracer import DIGITS, trace_precisely

FILE = Path(__file__).parents[1] / "src/asperity/bench" / DATA
RAYS, FEW = 64, 24
LOWEST_ANGLE, ISLAND_ANGLE = 1e-12, 1e-3
EPS = mp.mpf(2) ** -52
# Where the ray goes another way than the traced one, does one moved by so many ulps go the tracer's?
MOVES = tuple((dx * 2.0**k, dt * 2.0**k) for k in range(-1, 6) for dx in (-1, 0, 1) for dt in (-1, 0, 1) if dx or dt)
AIM_ULPS = 2
STEP = mp.mpf(10) ** -30
# The wall's own rounding errors, a few in each coordinate of its joints, in units of the cell.
WALL_ERROR = 4 * EPS
# A ray that makes more than these one by one would take hours.
MOST_HITS = 10**15
# Flights after which the tracer gives a ray up (`geometry.engine.MOST_STEPS`).
MOST_FLIGHTS = 1_000_000


def spread_rays(count, low, seed):
    """Places in (0, 1); half the angles from the flux, half uniform in the logarithm from ``low``, from either side."""
    rng = np.random.default_rng(seed)
    grazing = 10.0 ** rng.uniform(np.log10(low), -2.0, count)
    grazing = np.where(rng.random(count) < 0.5, grazing, np.pi - grazing)
    theta = np.where(rng.random(count) < 0.5, np.arccos(1.0 - 2.0 * rng.random(count)), grazing)
    return rng.uniform(0.01, 0.99, count), theta


def aimed_rays(wall, count, seed):
    """Rays whose straight way ends in a joint, or a few ulps of the angle beside it."""
    rng = np.random.default_rng(seed)
    joints = wall.vertices[wall.vertices[:, 1] < 0.0]
    target = joints[rng.integers(len(joints), size=count)]
    x = wall.period * rng.random(count)
    theta = np.arctan2(-target[:, 1], x - target[:, 0])
    return x, theta + rng.integers(-AIM_ULPS, AIM_ULPS + 1, size=count) * np.spacing(theta)


class Closed:
    """The judge of a wall with a closed form for its one hollow."""

    reference = "closed form, 50 digits"

    def __init__(self, wall, ray):
        hollow = wall.hollows[0]
        self.cell, self.left, self.width = mp.mpf(wall.period), mp.mpf(hollow.left), mp.mpf(hollow.right - hollow.left)
        self.ray = ray

    def __call__(self, x, theta):
        """State on the way out (here the angle alone), hits, itinerary."""
        out, hits, itinerary = self.ray((x - self.left) / self.width, theta)
        return (out,), hits, itinerary


class Traced:
    """The judge of any wall: the tracer in 50 digits."""

    reference = "tracer in 50 digits"

    def __init__(self, wall):
        self.scene, self.cell = wall.scene, mp.mpf(wall.period)

    def __call__(self, x, theta):
        """State on the way out, hits, itinerary."""
        ray = trace_precisely(self.scene, x, theta, MOST_HITS)
        if ray.theta is None:
            raise ArithmeticError(f"x = {x}, theta = {theta}: still inside after {ray.bounces} hits")
        return (ray.theta, ray.x / self.cell), ray.bounces, ray.itinerary


def references():
    """Judge and rays of each case."""
    cases = {}
    for name, build in walls.extreme_walls().items():
        wall = build()
        kind, _, rest = name.partition(", ")
        figure = rest.rpartition(" ")[2]
        judge = Traced(wall)
        if kind == "triangular teeth" and rest.startswith("angle"):
            judge = Closed(wall, tooth(_nearest(figure, walls.TOOTH_ANGLES)))
        elif kind == "rectangular teeth" and rest.startswith("r ="):
            judge = Closed(wall, crevice(float(figure)))
        elif kind == "arcs" and rest.startswith("half"):
            judge = Closed(wall, arc(_nearest(figure, walls.ARC_ANGLES)))
        elif rest.startswith("theta") and kind in walls.GRAZED:
            form = {"triangular teeth": tooth(0.7), "rectangular teeth": crevice(1.0), "arcs": arc(1.2)}[kind]
            judge = Closed(wall, form)
        elif name == f"mushrooms of stem aspect 0, stem/cap {walls.STEMS[0]:g}":
            judge = Closed(wall, cap(walls.STEMS[0]))
        cases[name] = judge, partial(rays_of, name, wall)
    return cases


def rays_of(name, wall):
    """Places and angles of the rays of a case."""
    if name.endswith("joints"):
        return aimed_rays(wall, RAYS, 3)
    low = ISLAND_ANGLE if name.startswith("floating") else LOWEST_ANGLE
    place, theta = spread_rays(FEW if "Koch 8" in name else RAYS, low, 1)
    if "theta" in name:
        theta = np.full(len(place), pi - LOWEST_ANGLE if "pi" in name else LOWEST_ANGLE)
    if wall.closes and len(wall.hollows) == 1:
        hollow = wall.hollows[0]
        return hollow.left + (hollow.right - hollow.left) * place, theta
    return wall.period * place, theta


def judged(name, judge, x, theta):
    """One ray, as a row of the file."""
    with mp.workdps(DIGITS):
        place, angle = mp.mpf(x), mp.mpf(theta)
        if name == "floating islands, theta = 1e-12":
            # the highest point of an island is a fifth of a period below the openings
            assert 0.2 / mp.tan(angle) > MOST_FLIGHTS
            return [x.hex(), theta.hex(), None, None, 1.0, TOO_FAR, []]
        state, hits, itinerary = judge(place, angle)
        near = [judge(place + dx, angle + dt)[0] for dx, dt in ((STEP * judge.cell, 0), (0, STEP))]
        condition = 1 + sum(abs(b - a) / STEP for moved in near for a, b in zip(state, moved, strict=True))
        half_ulp = mp.mpf(float(np.spacing(theta))) / 2
        ends = {judge(place, angle + sign * half_ulp)[2] for sign in (-1, 1)}
        clearance = CLEAR if ends == {itinerary} else IN_ANGLE
        if clearance == CLEAR and "stem/cap 1e-08" in name:
            opening = (place - judge.left) / judge.width
            clearance = IN_WALL if cap_clearance(walls.STEMS[0], opening, angle) < WALL_ERROR else CLEAR
        others = {}
        if isinstance(judge, Closed):
            for dx, dt in MOVES:
                (out,), other, _ = judge(place + dx * EPS * judge.width, angle * (1 + dt * EPS))
                # what differs by no more than the ray was moved is no other way
                if other != hits and abs(out - state[0]) > 64 * EPS * condition:
                    others[float(out)] = other
        rest = [[out.hex(), other] for out, other in sorted(others.items())]
        return [x.hex(), theta.hex(), float(state[0]).hex(), hits, float(f"{float(condition):.4g}"), clearance, rest]


def _nearest(figure, values):
    """The value that was written with ten digits."""
    return min(values, key=lambda value: abs(value - float(figure)))


def main(chosen):
    """Judge the chosen cases, or all; a case takes seconds, the mushrooms some minutes."""
    data = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    cases = references()
    for name in chosen or cases:
        judge, rays = cases[name]
        rows = [judged(name, judge, float(x), float(theta)) for x, theta in zip(*rays(), strict=True)]
        data[name] = {"reference": judge.reference, "rays": rows}
        write({name: data[name] for name in cases if name in data})
        print(f"{name}: {len(rows)} rays", flush=True)


def write(data):
    """One ray a line."""
    blocks = []
    for name, case in data.items():
        rows = ",\n".join(json.dumps(row) for row in case["rays"])
        blocks.append(f'"{name}": {{"reference": "{case["reference"]}", "rays": [\n{rows}\n]}}')
    FILE.write_text("{" + ",\n".join(blocks) + "}\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
