"""Collisions that amplify rounding: masses over inertias from 1e-4 to 1e6, judged in 50 digits.

The judge knows of a flight only that no satellite moves faster than some speed. It advances by the least time in which
a satellite could reach the wall, until one is near; a secant in 50 digits then finds the contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpmath import mp, mpf

from asperity import geometry as geo
from asperity.geometry.disk.satellites import Satellites
from campaigns.engine import Campaign, Judged

WALLS = {
    "triangular teeth": geo.triangular_teeth(0.7),
    "rectangular teeth": geo.rectangular_teeth(0.5),
    "deep notch": geo.Wall.from_vertices([(0, 0), (0, -1.5), (1, -1.5), (1, 0)]),
    "focusing arcs": geo.focusing_arcs(1.2),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "islands": geo.Wall([geo.Segment((0, -0.5), (1, -0.5))], islands=[[geo.Arc((0.4, -0.2), 0.1, 0.0, -2 * math.pi)]]),
}
# Bound on the errors of a disk that is not amplified.
ACCURACY = 1e-6
DIGITS = 50
# Mass over inertia and scales, log-uniform between these.
RATIOS, SCALES = (1e-4, 1e6), (1e-4, 1e-1)
# Distance, in units of the wall, from which on digits decide; disks so near a corner are not judged.
NEAR, CORNER = 1e-9, 1e-8
# Steps and contacts after which a disk is not judged.
MOST_STEPS, MOST_CONTACTS = 100_000, 2000
# Disks over islands whose masses are 10^3 to 2 10^4 times their inertias; rounding decides the last.
SMALL = (89, 185, 203, 221, 449, 509)


class Judge:
    """A disk over a wall of segments and circular arcs, in units of the wall."""

    def __init__(self, wall, disk, scale, spacing, position, velocity):
        self.period, self.scale, self.spacing = mpf(wall.period), mpf(scale), mpf(spacing)
        self.masses = [mpf(disk.mass), mpf(disk.mass), mpf(disk.inertia)]
        self.x, self.alpha, self.height = mpf(float(position[0])) / self.scale, mpf(float(position[1])), mpf(0)
        self.v = [mpf(float(v)) for v in velocity]
        self.pieces = []
        for piece in (*wall.pieces, *(piece for island in wall.islands for piece in island)):
            for shift in (-1.0, 0.0, 1.0):
                move = shift * wall.period
                if isinstance(piece, geo.Segment):
                    ends = piece.start[0] + move, piece.start[1], piece.end[0] + move, piece.end[1]
                    self.pieces.append((False, *ends, math.hypot(ends[2] - ends[0], ends[3] - ends[1])))
                else:
                    low, high = sorted((piece.start_angle, piece.end_angle))
                    turn = 1.0 if piece.end_angle > piece.start_angle else -1.0
                    centre = piece.center[0] + move, piece.center[1]
                    self.pieces.append((True, *centre, piece.semi_axes[0], low, high - low, turn))
        self.bend = max((1.0 / piece[3] for piece in self.pieces if piece[0]), default=0.0)

    def distance(self, piece, x, y):
        """Distance of a point from the piece, and whether the nearest point is near an end."""
        if not piece[0]:
            _, ax, ay, bx, by, size = piece
            ex, ey = (bx - ax) / size, (by - ay) / size
            along = (x - ax) * ex + (y - ay) * ey
            across = abs((x - ax) * ey - (y - ay) * ex)
            beyond = max(-along, along - size)
            return (math.hypot(across, beyond), True) if beyond > 0.0 else (across, beyond > -CORNER)
        _, cx, cy, radius, low, sweep, _ = piece
        dx, dy = x - cx, y - cy
        turn = (math.atan2(dy, dx) - low) % (2.0 * math.pi)
        if turn <= sweep:
            edge = sweep < 6.28 and min(turn, sweep - turn) * radius < CORNER
            return abs(math.hypot(dx, dy) - radius), edge
        ends = (low, low + sweep)
        return min(math.hypot(dx - radius * math.cos(a), dy - radius * math.sin(a)) for a in ends), True

    def begin(self):
        """Round the state at the start of a flight: x in the cell, angle of the lowest satellite."""
        self.x -= mp.floor(self.x / self.period) * self.period
        self.rest = self.alpha - self.spacing * mp.nint(self.alpha / self.spacing)
        numbers = self.x, self.rest, self.height, *self.v, self.spacing, self.scale, self.period
        self.rounded = [float(number) for number in numbers]

    def satellite(self, time, k, exact):
        """Position and angle of the k-th satellite after the one that is lowest at the start of the flight."""
        kind = mp if exact else math
        if exact:
            x, a, h, v1, v2, w, spacing, scale = self.x, self.rest, self.height, *self.v, self.spacing, self.scale
        else:
            x, a, h, v1, v2, w, spacing, scale, _ = self.rounded
        angle = a + scale * w * time + k * spacing
        half = kind.sin(angle / 2)
        return x + v1 * time + kind.sin(angle) / scale, h + v2 * time + 2 * half * half / scale, angle

    def side(self, piece, time, k, cell):
        """Signed distance from the line or circle of a piece, and the normal towards the disk."""
        x, y, _ = self.satellite(time, k, True)
        x -= cell * self.period
        if not piece[0]:
            _, ax, ay, bx, by, _ = map(mpf, piece)
            ex, ey = bx - ax, by - ay
            size = mp.hypot(ex, ey)
            normal = -ey / size, ex / size
            return normal[0] * (x - ax) + normal[1] * (y - ay), normal
        _, cx, cy, radius, _, _, turn = map(mpf, piece)
        away = mp.hypot(x - cx, y - cy)
        return turn * (radius - away), (turn * (cx - x) / away, turn * (cy - y) / away)

    def speed(self, normal, angle):
        """Speed of a satellite along a normal."""
        v1, v2, w = self.v
        return normal[0] * (v1 + w * mp.cos(angle)) + normal[1] * (v2 + w * mp.sin(angle))

    def next_contact(self, own):
        """Time, satellite, normal and piece of the next contact; the time back at height 0 and None."""
        self.begin()
        _, rest, height, v1, v2, w, spacing, scale, period = self.rounded
        fastest = math.hypot(v1, v2) + abs(w)
        end = -height / v2 if v2 > 0.0 else math.inf
        time, touching, leaving = 0.0, None, 0.0
        if own is not None:
            touching = round((own[0] - rest) / spacing)
            leaving = own[1] / (scale * w * w + self.bend * fastest * fastest + 1e-300)
        while self.steps < MOST_STEPS:
            self.steps += 1
            lowest = -round((rest + scale * w * time) / spacing)
            free = (height + v2 * time + 2.0 * math.sin(0.75 * spacing) ** 2 / scale) / fastest
            for k in (lowest - 1, lowest, lowest + 1):
                x, y, _ = self.satellite(time, k, False)
                if y > 1.0:
                    free = min(free, y / fastest)
                    continue
                cell = math.floor(x / period)
                starts = time == 0.0 and k == touching
                for piece in self.pieces:
                    away, edge = self.distance(piece, x - cell * period, y)
                    if starts and away < NEAR:
                        free = min(free, leaving)
                        continue
                    if away < NEAR:
                        _, normal = self.side(piece, mpf(time), k, cell)
                        if self.speed(normal, self.satellite(mpf(time), k, True)[2]) < 0:
                            if edge:
                                raise ArithmeticError("corner")
                            return self.contact(piece, time, k, cell)
                    free = min(free, max(away, NEAR) / fastest)
            if time >= end:
                return -self.height / self.v[1], None
            time = min(time + free, end)
        raise ArithmeticError("steps")

    def contact(self, piece, time, k, cell):
        """The contact near a time, by secants."""
        before, here = mpf(time), mpf(time) + mpf(NEAR) / 1000
        f_before, _ = self.side(piece, before, k, cell)
        for _ in range(60):
            f, normal = self.side(piece, here, k, cell)
            if abs(f) < mpf(10) ** -45 or f == f_before:
                return here, (normal, self.satellite(here, k, True)[2])
            before, here, f_before = here, here - f * (here - before) / (f - f_before), f
        raise ArithmeticError("no contact")

    def collide(self):
        """Outgoing position, relative to the incoming one, and velocity."""
        travel, turned, own, self.steps = mpf(0), self.alpha, None, 0
        for _ in range(MOST_CONTACTS):
            time, found = self.next_contact(own)
            travel, self.x = travel + self.v[0] * time, self.x + self.v[0] * time
            self.height += self.v[1] * time
            self.alpha += self.scale * self.v[2] * time
            if found is None:
                return [self.scale * travel, self.alpha - turned, *self.v]
            normal, angle = found
            # impulse along the normal that reverses the satellite's normal speed and keeps the energy
            covector = normal[0], normal[1], normal[0] * mp.cos(angle) + normal[1] * mp.sin(angle)
            push = -2 * self.speed(normal, angle) / sum(c * c / m for c, m in zip(covector, self.masses, strict=True))
            self.v = [v + push * c / m for v, c, m in zip(self.v, covector, self.masses, strict=True)]
            own = float(angle), float(self.speed(normal, angle))
        raise ArithmeticError("contacts")


@dataclass(frozen=True)
class FallingDisk:
    """A disk of mass 1 on its way to a wall; ``ratio`` is its mass over its inertia."""

    name: str
    scale: float
    ratio: float
    position: np.ndarray
    velocity: np.ndarray


def draw(number: int) -> FallingDisk:
    """The walls in turn."""
    rng, name = np.random.default_rng([1, number]), list(WALLS)[number % len(WALLS)]
    ratio, scale = (math.exp(rng.uniform(*np.log(bounds))) for bounds in (RATIOS, SCALES))
    spacing = Satellites.around(scale, scale * WALLS[name].depth).spacing
    position = np.array([rng.random() * scale * WALLS[name].period, (rng.random() - 0.5) * spacing])
    angles = np.arccos(1.0 - 2.0 * rng.random(2))
    return FallingDisk(name, scale, ratio, position, -geo.Disk(1.0, 1.0 / ratio).from_angles(*angles))


def judge(case: FallingDisk) -> Iterator[Judged]:
    """Whether the outgoing state is right or has the status."""
    wall, disk, scale = WALLS[case.name], geo.Disk(1.0, 1.0 / case.ratio), case.scale
    decade = 2 * math.floor(0.5 * math.log10(case.ratio))
    kind = f"m/J 1e{decade} to 1e{decade + 2}"
    hit = geo.collide(disk, wall, scale, case.position[None], case.velocity[None])
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    with mp.workdps(DIGITS):
        try:
            end = Judge(wall, disk, scale, spacing, case.position, case.velocity).collide()
        except ArithmeticError as reason:
            yield Judged(kind, outcome=f"not judged: {reason}")
            return
        found = [mpf(float(a)) - mpf(float(b)) for a, b in zip(hit.position[0], case.position, strict=True)]
        found += map(mpf, map(float, hit.velocity[0]))
        apart = np.array([float(a - b) for a, b in zip(found, end, strict=True)])
    speeds = math.sqrt(float(disk.inner(case.velocity, case.velocity))) / np.sqrt([disk.mass, disk.mass, disk.inertia])
    error = float(np.abs(np.concatenate([apart[:2], apart[2:] / speeds])).max())
    if hit.status[0] == geo.DiskStatus.AMPLIFIED:
        yield Judged(kind, outcome="amplified" if error > ACCURACY else "amplified needlessly")
    elif hit.escaped[0]:
        yield Judged(kind, ACCURACY, error)
    else:
        yield Judged(kind, outcome="not escaped")


CAMPAIGNS = (
    Campaign("amplified-collisions", "Does the status show which disks rounding has changed?", draw, judge, 800,
             SMALL),
)  # fmt: skip
