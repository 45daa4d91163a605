"""Flights that graze: tangents to pillars, starts along sides, whispering flights, aims at corners and at joints.

The first collision of every flight is judged in 50 digits by the distances of lines from points and by mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from mpmath import mp, mpf

from asperity import geometry as geo
from asperity import kernels as ker
from campaigns.engine import Campaign, Judged

DISK = geo.Disk(1.0, 1.0)
LAWS = {"smooth": ker.smooth(DISK), "no-slip": ker.no_slip(DISK)}
FLIGHTS, DIGITS = 12, 50
# Distance from a tangent or a corner up to which the nearest double of a position may decide otherwise.
NEAR = 1e-11
# Angle to a wall that bends towards the path up to which a flight may end with a status.
SMALLEST_ANGLE = 3e-14
# Collisions of the long flights, and their permitted relative change of energy and depth outside of the table.
LONG, DRIFT, DEPTH = 200, 1e-12, 1e-11
SIDE, PILLAR = 4.0, 0.625
# Legs of the right triangles with hypotenuse 65.
TRIPLES = ((16, 63), (25, 60), (33, 56), (39, 52))


class Family:
    """Flights of one kind: the table, starts (n, 2) and velocities (n, 3), with spin 1.

    ``may_stop`` tells which of the flights may end with a status, ``first`` the time to the first collision, nan where
    it is not judged, with the tolerance ``room``.
    """

    def __init__(self, name, table, start, plane, may_stop=False, first=math.nan, room=0.0):
        self.name, self.table, self.start, self.room = name, table, start, room
        self.velocity = np.column_stack([plane, np.ones(len(plane))])
        self.may_stop, self.first = (np.broadcast_to(one, len(plane)) for one in (may_stop, first))


def room_with_pillar(radius: float) -> geo.Container:
    """A square room around a round pillar."""
    h = SIDE
    corners = [(-h, -h), (h, -h), (h, h), (-h, h)]
    sides = [geo.Segment(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    return geo.Container.from_curves([*sides, geo.Arc((0.0, 0.0), radius, 2.0 * math.pi, 0.0)])


def time_to_sides(start: np.ndarray, plane: np.ndarray) -> mpf:
    """Time to the square |x|, |y| <= SIDE, along each coordinate alone."""
    times = [(math.copysign(1, v) * mpf(SIDE) - mpf(x)) / mpf(v) for x, v in zip(start, plane, strict=True) if v != 0.0]
    return min(times)


@mp.workdps(DIGITS)
def first_times(start: np.ndarray, plane: np.ndarray, radius: float) -> list[mpf]:
    """The permitted times to the first collision in the room with a pillar."""
    x, y, u, v = (mpf(float(a)) for a in (*start, *plane[:2]))
    speed = mp.sqrt(u * u + v * v)
    foot = -(x * u + y * v) / speed
    aside = abs(x * v - y * u) / speed
    past = time_to_sides(start, plane)
    if foot <= 0 or aside - radius > NEAR:
        return [past]
    met = (foot - mp.sqrt(max(mpf(radius) ** 2 - aside**2, mpf(0)))) / speed
    return [met] if aside - radius < -NEAR else [met, past]


def tangents(n: int, rng: np.random.Generator, exact: bool) -> Family:
    """Tangents to the pillar: from Pythagorean triples, so that all numbers are doubles without error, or rounded."""
    if exact:
        radius = 65.0 / 128.0
        along = np.array([rng.permutation(TRIPLES[k]) for k in rng.integers(len(TRIPLES), size=n)], dtype=np.float64)
        along *= rng.choice([-1.0, 1.0], (n, 2))
        back = rng.integers(1, 48, n) / 1024.0
    else:
        radius, angle = PILLAR, rng.uniform(0.0, 2.0 * math.pi, n)
        along, back = np.column_stack([np.cos(angle), np.sin(angle)]), rng.uniform(0.1, 2.0, n)
    point = rng.choice([-1.0, 1.0], (n, 1)) * np.column_stack([along[:, 1], -along[:, 0]])
    point *= 1.0 / 128.0 if exact else radius
    name, start = "exact tangents" if exact else "rounded tangents", point - along * back[:, None]
    return Family(name, room_with_pillar(radius), start, along, room=1e-6)


def along_sides(n: int, rng: np.random.Generator) -> Family:
    """Starts on the flat sides of the stadium, along them: the arc bends towards the path where the side ends."""
    side, way = rng.choice([-1.0, 1.0], n), rng.choice([-1.0, 1.0], n)
    start = np.column_stack([rng.uniform(-1.0, 1.0, n), side])
    plane = np.column_stack([way * rng.uniform(0.5, 2.0, n), np.zeros(n)])
    return Family("along the flat sides of a stadium", geo.Container.stadium(2.0, 1.0), start, plane, may_stop=True)


def whispers(n: int, rng: np.random.Generator, stadium: bool) -> Family:
    """Chords of a circle or of the right arc of a stadium at angles from 0.1 to 1e-17."""
    turn = rng.uniform(-1.2, 1.0, n) if stadium else rng.uniform(0.0, 2.0 * math.pi, n)
    angle = 10.0 ** -rng.uniform(1.0, 17.0, n)
    normal = np.column_stack([-np.cos(turn), -np.sin(turn)])
    tangent = np.column_stack([-np.sin(turn), np.cos(turn)])
    plane = tangent * np.cos(angle)[:, None] + normal * np.sin(angle)[:, None]
    start = -normal + ([1.0, 0.0] if stadium else [0.0, 0.0])
    table = geo.Container.stadium(2.0, 1.0) if stadium else geo.Container.circle(1.0)
    first = np.empty(n)
    for k in range(n):
        # from the rounded numbers: the angle of the velocity to the radius through the start
        x, y = mpf(float(start[k, 0])) - int(stadium), mpf(float(start[k, 1]))
        u, v = mpf(float(plane[k, 0])), mpf(float(plane[k, 1]))
        first[k] = float(-2 * (x * u + y * v) / (u * u + v * v))
    inner = first > 4.0 * SMALLEST_ANGLE
    name = "whispering in a stadium" if stadium else "whispering in a circle"
    return Family(name, table, start, plane, ~inner, np.where(inner, first, np.nan), 1e-14)


def aims(n: int, rng: np.random.Generator, joints: bool) -> Family:
    """Aims at the corners of a hexagon, or at the joints of a stadium; none of the first can be resolved."""
    if joints:
        table = geo.Container.stadium(2.0, 1.0)
        target = np.column_stack([rng.choice([-1.0, 1.0], n), rng.choice([-1.0, 1.0], n)])
        start = np.column_stack([rng.uniform(-0.9, 0.9, n), rng.uniform(-0.9, 0.9, n)])
    else:
        turns = np.arange(6) * math.pi / 3.0
        corners = np.column_stack([np.cos(turns), np.sin(turns)])
        table = geo.Container.polygon(corners)
        target = corners[rng.integers(6, size=n)]
        start = np.where(rng.random((n, 1)) < 0.3, 0.0, rng.uniform(-0.5, 0.5, (n, 2)))
    if joints:
        return Family("aims at joints of a stadium", table, start, target - start, first=1.0, room=1e-7)
    return Family("aims at corners of a hexagon", table, start, target - start, may_stop=True)


def outside(family: Family, position: np.ndarray) -> float:
    """The largest depth outside of the table, from the distances of its formulas."""
    x, y = position[..., 0], position[..., 1]
    if "tangents" in family.name:
        radius = family.table.curves[-1].semi_axes[0]
        return float(max((np.abs(position) - SIDE).max(), (radius - np.hypot(x, y)).max()))
    if "hexagon" in family.name:
        turns = (np.arange(6) + 0.5) * math.pi / 3.0
        return float((position @ np.array([np.cos(turns), np.sin(turns)])).max() - math.cos(math.pi / 6.0))
    straight = 0.0 if "circle" in family.name else 1.0
    return float((np.hypot(np.maximum(np.abs(x) - straight, 0.0), y) - 1.0).max())


def judge(case: tuple[str, Family]) -> Iterator[Judged]:
    """Which flights are wrong, which are lost, and which stop with a status."""
    name, family = case
    law = LAWS[name]
    record = ker.play(family.table, law, family.start, family.velocity, LONG, 0)
    stopped = record.status != 0
    # of flights that may stop only their first collision is excused; later ones may meet a corner by chance
    lost = (stopped & (record.collisions == 0) & ~family.may_stop) | (record.counts()["free"] > 0)
    time, wrong = record.time[1], np.zeros(len(stopped), dtype=bool)
    for k in range(len(stopped)):
        if "tangents" in family.name:
            times = first_times(family.start[k], family.velocity[k, :2], family.table.curves[-1].semi_axes[0])
            wrong[k] = min(abs(float(t) - time[k]) for t in times) > family.room
        elif math.isfinite(family.first[k]):
            wrong[k] = abs(family.first[k] - time[k]) > family.room
    energy = np.abs(record.energy / record.energy[0] - 1.0).max(axis=0)
    wrong |= ~(energy < DRIFT) | ~np.isfinite(record.position).all(axis=(0, 2))
    wrong |= np.array([outside(family, record.position[:, k]) > DEPTH for k in range(len(stopped))])
    # the same bits without the flights that stopped
    if np.any(~stopped) and name == "smooth":
        rest = ker.play(family.table, law, family.start[~stopped], family.velocity[~stopped], LONG, 0)
        wrong[~stopped] |= (rest.position != record.position[:, ~stopped]).any(axis=(0, 2))
    for k in range(len(stopped)):
        at = f"{family.start[k].tolist()}, {family.velocity[k].tolist()}"
        fault = f"wrong from {at}" if wrong[k] else f"lost from {at}" if lost[k] else ""
        yield Judged(f"{family.name}, {name}", fault=fault, outcome="stopped" if stopped[k] else "")


FAMILIES = (
    partial(tangents, exact=True), partial(tangents, exact=False), along_sides, partial(whispers, stadium=False),
    partial(whispers, stadium=True), partial(aims, joints=False), partial(aims, joints=True),
)  # fmt: skip


@mp.workdps(DIGITS)
def draw(number: int) -> tuple[str, Family]:
    """Smooth and no-slip walls in turn, and the families in turn."""
    rng = np.random.default_rng([number // 14, number // 2 % 7])
    return list(LAWS)[number % 2], FAMILIES[number // 2 % 7](FLIGHTS, rng)


# Each family once, over smooth and no-slip walls in turn.
SMALL = (0, 3, 4, 7, 8, 11, 12)
CAMPAIGNS = (
    Campaign("grazing-flights", "Are flights decided rightly that rounding can decide?", draw, judge, 350, SMALL),
)
