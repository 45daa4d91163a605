"""Rays on the extreme walls, and disks at all scales, and where they go in 50 digits.

``python -m campaigns.extremes.references [CASE]`` writes ``extreme_rays.json`` and ``extreme_disks.json`` beside it.
Walls with a closed form are judged by it (`precise_rays`), the others by the tracer in 50 digits (`plain_tracer`);
neither shares code with the library.

Of each ray the file has the position, the angle, the outgoing angle rounded once, the number of hits, the condition (1
+ the moduli of the derivatives of the outgoing state by the incoming one, positions in cells), whether it is known to
pass a corner too closely, and what becomes of it when it is moved by up to 32 ulps, where that is something else. Of
each disk it has the state before, the velocity after, rounded once, contacts, and condition.
"""

from __future__ import annotations

import json
import sys
from math import pi

import mpmath as mp
import numpy as np

from asperity.geometry.disk.satellites import Satellites
from campaigns.judges.plain_tracer import DIGITS, GUARD, trace_precisely
from campaigns.judges.precise_collision import PreciseCollision
from campaigns.judges.precise_rays import arc, cap, cap_clearance, crevice, tooth

from . import disks, walls
from .rays import CLEAR, DATA, IN_ANGLE, IN_WALL, TOO_FAR

RAYS, FEW, FEWEST, DISKS = 64, 24, 4, 12
# Stems so narrow that none of the rays misses them after its first hit, the one that the closed form is about.
SMALL_STEMS = walls.STEMS[:2]
# The least angle, from either side, in the names of cases.
ENDS = ("1e-12", "pi - 1e-12")
LOWEST_ANGLE, ISLAND_ANGLE = 1e-12, 1e-3
EPS = mp.mpf(2) ** -52
# Where the ray goes another way than the traced one, does one moved by so many ulps go the tracer's?
MOVES = tuple((dx * 2.0**k, dt * 2.0**k) for k in range(-1, 6) for dx in (-1, 0, 1) for dt in (-1, 0, 1) if dx or dt)
FEW_MOVES = tuple(
    (dx * size, dt * size) for size in (0.5, 2.0, 8.0) for dx in (-1, 0, 1) for dt in (-1, 0, 1) if dx or dt
)
# An error of this size is enough to look at the ray's neighbours, where that takes the tracer.
SEEN = 1e-6
AIM_ULPS = 2
STEP, DISK_STEP = mp.mpf(10) ** -30, mp.mpf(10) ** -28
# The wall's own rounding errors, a few in each coordinate of its joints, in units of the cell.
WALL_ERROR = 4 * EPS
# A ray that makes more than these one by one would take hours.
MOST_HITS = 10**15
# Of rays that the rounding of the wall decides, those that leave later are left unknown.
MOST_STORED_HITS = 100_000
# Flights after which the tracer gives a ray up (MOST_STEPS of `geometry/tracing/compiled/rays.py`).
MOST_FLIGHTS = 1_000_000


def spread_rays(count, low, seed):
    """Positions in (0, 1); half the angles from the flux, half log-uniform from ``low``, from either side."""
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
        self.ray, self.stored = ray, Traced(wall, MOST_STORED_HITS)

    def __call__(self, x, theta):
        """State on the way out (here the angle alone), hits, itinerary."""
        out, hits, itinerary = self.ray((x - self.left) / self.width, theta)
        return (out,), hits, itinerary


class Traced:
    """The judge of any wall: the tracer in 50 digits."""

    reference = "tracer in 50 digits"

    def __init__(self, wall, most_hits=MOST_HITS):
        self.wall, self.cell = wall, mp.mpf(wall.period)
        self.width, self.most_hits = self.cell, most_hits

    def __call__(self, x, theta):
        """State on the way out, hits, itinerary."""
        ray = trace_precisely(self.wall, x, theta, self.most_hits)
        if ray is None:
            raise ArithmeticError(f"x = {x}, theta = {theta}: still inside")
        return (ray.theta, ray.x / self.cell), ray.hits, ray.path


CLOSED_FORMS = {
    **{f"triangular teeth, angle {angle:.10g}": tooth(angle) for angle in walls.TOOTH_ANGLES},
    **{f"rectangular teeth, r = {ratio:g}": crevice(ratio) for ratio in walls.TOOTH_RATIOS},
    **{f"arcs, half angle {half:.10g}": arc(half) for half in walls.ARC_ANGLES},
    **{f"mushrooms of stem aspect 0, stem/cap {stem:g}": cap(stem) for stem in SMALL_STEMS},
    **{f"triangular teeth, theta = {end}": tooth(0.7) for end in ENDS},
    **{f"rectangular teeth, theta = {end}": crevice(1.0) for end in ENDS},
    **{f"arcs, theta = {end}": arc(1.2) for end in ENDS},
}


def judge_of(name, wall):
    """What knows where the rays of a case go."""
    return Closed(wall, CLOSED_FORMS[name]) if name in CLOSED_FORMS else Traced(wall)


def rays_of(name, wall):
    """Positions and angles of the rays of a case."""
    if name.endswith("joints"):
        return aimed_rays(wall, RAYS, 3)
    low = ISLAND_ANGLE if name.startswith("floating") else LOWEST_ANGLE
    number = FEW if "Koch 8" in name else FEWEST if name.startswith("floating") and "theta" in name else RAYS
    place, theta = spread_rays(number, low, 1)
    if "theta" in name:
        theta = np.full(len(place), pi - LOWEST_ANGLE if "pi" in name else LOWEST_ANGLE)
    if wall.closes and len(wall.hollows) == 1:
        hollow = wall.hollows[0]
        return hollow.left + (hollow.right - hollow.left) * place, theta
    return wall.period * place, theta


def judged_ray(name, judge, x, theta):
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
        if clearance == CLEAR and "aspect 0" in name and isinstance(judge, Closed):
            opening, stem = (place - judge.left) / judge.width, float(name.rpartition(" ")[2])
            assert cap_clearance(stem, opening, angle) > 0
            clearance = IN_WALL if cap_clearance(stem, opening, angle) < WALL_ERROR else CLEAR
        others = {}
        # a ray whose error may be seen at all may also have jumped
        if isinstance(judge, Closed) or condition * (1 + hits) * EPS > SEEN:
            for dx, dt in MOVES if isinstance(judge, Closed) else FEW_MOVES:
                (out, *_), other, _ = judge(place + dx * EPS * judge.width, angle * (1 + dt * EPS))
                # what differs by no more than the ray was moved is no other way
                if other != hits and abs(out - state[0]) > 64 * EPS * condition:
                    others[float(out)] = other
        if clearance == IN_WALL:
            # the wall that is traced is that of the rounded coordinates, and their rounding decides this ray
            try:
                (out, *_), other, _ = judge.stored(place, angle)
                others[float(out)] = other
            except ArithmeticError:
                pass
        rest = [[out.hex(), other] for out, other in sorted(others.items())]
        return [x.hex(), theta.hex(), float(state[0]).hex(), hits, float(f"{float(condition):.4g}"), clearance, rest]


def judged_disk(scale, position, velocity):
    """One disk, as a row of the file: state in, velocity out rounded once, contacts, condition."""
    spacing = Satellites.around(scale, scale * disks.WALL.depth).spacing

    def judged(state):
        one = PreciseCollision(disks.DISK, disks.WALL, scale, spacing, state[:2], state[2:])
        return one.collide()[2:], one.contacts

    with mp.workdps(DIGITS + GUARD):
        state = [mp.mpf(float(number)) for number in (*position, *velocity)]
        out, contacts = judged(state)
        condition = mp.mpf(1)
        # positions matter on the scale of the wall's cell and of the satellites' distance
        for k, size in enumerate((scale, spacing, 1, 1, 1)):
            moved = [number + (k == at) * DISK_STEP * size for at, number in enumerate(state)]
            condition += max(abs(a - b) for a, b in zip(out, judged(moved)[0], strict=True)) / DISK_STEP
        start = [float(number).hex() for number in state]
        return [start, [float(v).hex() for v in out], contacts, float(f"{float(condition):.4g}")]


def disks_of(scale):
    """Random disks over one cell and one spacing."""
    rng = np.random.default_rng(11)
    spacing = Satellites.around(scale, scale * disks.WALL.depth).spacing
    position = np.stack([rng.random(DISKS) * scale, (rng.random(DISKS) - 0.5) * spacing], axis=1)
    return position, -disks.DISK.from_angles(np.arccos(1 - 2 * rng.random(DISKS)), np.arccos(1 - 2 * rng.random(DISKS)))


def main(chosen):
    """Judge the chosen cases, or all and the disks; a case takes seconds, the mushrooms some minutes."""
    data = json.loads(DATA.read_text(encoding="utf-8")) if DATA.exists() else {}
    builders = walls.extreme_walls()
    for name in chosen or builders:
        wall = builders[name]()
        judge = judge_of(name, wall)
        rows = [judged_ray(name, judge, float(x), float(theta)) for x, theta in zip(*rays_of(name, wall), strict=True)]
        data[name] = {"reference": judge.reference, "rays": rows}
        heads = {case: f'{{"reference": "{data[case]["reference"]}", "rays": ' for case in builders if case in data}
        _write(DATA, {case: (head, data[case]["rays"], "}") for case, head in heads.items()})
        print(f"{name}: {len(rows)} rays", flush=True)
    if not chosen:
        found = {f"{scale:g}": [judged_disk(scale, *state) for state in zip(*disks_of(scale), strict=True)]
                 for scale in disks.SCALES}  # fmt: skip
        _write(disks.DATA, {scale: ("", rows, "") for scale, rows in found.items()})


def _write(file, blocks):
    """One ray or disk a line."""
    lines = (
        f'"{name}": {head}[\n' + ",\n".join(map(json.dumps, rows)) + f"\n]{end}"
        for name, (head, rows, end) in blocks.items()
    )
    file.write_text("{" + ",\n".join(lines) + "}\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
