"""The collision of the disk with satellites in 50 digits, one disk at a time, by distances from the wall.

Nothing is known of a flight but that no satellite moves faster than some speed. It advances, in doubles, by the least
time in which one of the three lowest could reach the wall, until one is near; a secant in 50 digits then finds the
contact. No root, no hollow, no sign of a path is involved. Pieces are segments and circular arcs.
"""

from __future__ import annotations

import math

import numpy as np
from mpmath import mp, mpf

from asperity.geometry import Segment

DIGITS = 50
# Distance, in units of the wall, from which on digits decide, and there; disks so near a corner are not judged.
NEAR, THERE, CORNER = 1e-9, mpf(10) ** -45, 1e-8
# Steps and contacts after which a disk is not judged.
MOST_STEPS, MOST_CONTACTS = 100_000, 2000


class PreciseCollision:
    """A disk over a wall, in units of the wall; ``position`` and ``velocity`` are doubles, or numbers of mpmath."""

    def __init__(self, disk, wall, scale, spacing, position, velocity):
        self.period, self.scale, self.spacing = mpf(wall.period), mpf(scale), mpf(spacing)
        self.masses = [mpf(disk.mass), mpf(disk.mass), mpf(disk.rim_mass)]
        self.x, self.alpha, self.height = mpf(position[0]) / self.scale, mpf(position[1]), mpf(0)
        self.v = [mpf(v) for v in velocity]
        self.contacts, self.steps, self.pieces = 0, 0, []
        for piece in (*wall.pieces, *(piece for island in wall.islands for piece in island)):
            for move in (-wall.period, 0.0, wall.period):
                if isinstance(piece, Segment):
                    ends = piece.start[0] + move, piece.start[1], piece.end[0] + move, piece.end[1]
                    self.pieces.append((False, *ends, math.hypot(ends[2] - ends[0], ends[3] - ends[1])))
                else:
                    low, high = sorted((piece.start_angle, piece.end_angle))
                    turn = math.copysign(1.0, piece.end_angle - piece.start_angle)
                    centre = piece.center[0] + move, piece.center[1]
                    self.pieces.append((True, *centre, piece.semi_axes[0], low, high - low, turn))
        self.bend = max((1.0 / piece[3] for piece in self.pieces if piece[0]), default=0.0)

    def collide(self):
        """Displacement and turn, and the outgoing velocity; an ArithmeticError where digits do not decide."""
        travel, turned, own = mpf(0), self.alpha, None
        while self.contacts <= MOST_CONTACTS:
            time, contact = self._next_contact(own)
            travel, self.x = travel + self.v[0] * time, self.x + self.v[0] * time
            self.height += self.v[1] * time
            self.alpha += self.scale * self.v[2] * time
            if contact is None:
                return [self.scale * travel, self.alpha - turned, *self.v]
            self.contacts += 1
            normal, angle = contact
            # Proposition 3.2: the covector of the contact, raised by the kinetic metric
            covector = normal[0], normal[1], normal[0] * mp.cos(angle) + normal[1] * mp.sin(angle)
            push = -2 * self._speed(normal, angle) / sum(c * c / m for c, m in zip(covector, self.masses, strict=True))
            self.v = [v + push * c / m for v, c, m in zip(self.v, covector, self.masses, strict=True)]
            own = float(angle), float(self._speed(normal, angle))
        raise ArithmeticError("contacts")

    def _next_contact(self, own):
        """Time, normal and angle of the next contact; the time back at height 0 and None.

        ``own`` has the angle of the satellite that touches the wall and the speed at which it leaves.
        """
        # x in the cell, and the angle of the satellite that is lowest
        self.x -= mp.floor(self.x / self.period) * self.period
        self.rest = self.alpha - self.spacing * mp.nint(self.alpha / self.spacing)
        exact = self.x, self.rest, self.height, *self.v, self.spacing, self.scale
        rounded = [float(number) for number in exact]
        _, rest, height, v1, v2, w, spacing, scale = rounded
        fastest, time = math.hypot(v1, v2) + abs(w), 0.0
        end = -height / v2 if v2 > 0.0 else math.inf
        touching = None if own is None else round((own[0] - rest) / spacing)
        # it is not back before its path and the piece, which bend by at most so much, bring it back
        leaving = own and own[1] / (scale * w * w + self.bend * fastest * fastest + 1e-300)
        while self.steps < MOST_STEPS:
            self.steps += 1
            lowest = -round((rest + scale * w * time) / spacing)
            # the fourth satellite is higher than the tops, and comes within reach no sooner than it is the third
            free = (height + v2 * time + 2.0 * math.sin(0.75 * spacing) ** 2 / scale) / fastest
            for k in (lowest - 1, lowest, lowest + 1):
                x, y, _ = _satellite(math, rounded, time, k)
                if y > 1.0:
                    free = min(free, y / fastest)
                    continue
                cell = math.floor(x / float(self.period))
                for piece in self.pieces:
                    away, edge = _distance(piece, x - cell * float(self.period), y)
                    if away < NEAR and time == 0.0 and k == touching:
                        # both faces of a thin plate are left at the same speed
                        free = min(free, leaving)
                        continue
                    if away < NEAR:
                        _, normal, angle = self._side(piece, exact, mpf(time), k, cell)
                        if self._speed(normal, angle) < 0:
                            if edge:
                                raise ArithmeticError("corner")
                            return self._contact(piece, exact, time, k, cell)
                    free = min(free, max(away, NEAR) / fastest)
            if time >= end:
                return -self.height / self.v[1], None
            time = min(time + free, end)
        raise ArithmeticError("steps")

    def _contact(self, piece, exact, time, k, cell):
        """The contact near a time, by secants."""
        before, here = mpf(time), mpf(time) + mpf(NEAR) / 1000
        f_before, *_ = self._side(piece, exact, before, k, cell)
        for _ in range(60):
            f, normal, angle = self._side(piece, exact, here, k, cell)
            if abs(f) < THERE or f == f_before:
                return here, (normal, angle)
            before, here, f_before = here, here - f * (here - before) / (f - f_before), f
        raise ArithmeticError("no contact")

    def _side(self, piece, exact, time, k, cell):
        """Signed distance of a satellite from the line or circle of a piece, the normal, and the satellite's angle."""
        x, y, angle = _satellite(mp, exact, time, k)
        x -= cell * self.period
        if not piece[0]:
            _, ax, ay, bx, by, _ = map(mpf, piece)
            ex, ey = bx - ax, by - ay
            size = mp.hypot(ex, ey)
            normal = -ey / size, ex / size
            return normal[0] * (x - ax) + normal[1] * (y - ay), normal, angle
        _, cx, cy, radius, _, _, turn = map(mpf, piece)
        away = mp.hypot(x - cx, y - cy)
        return turn * (radius - away), (turn * (cx - x) / away, turn * (cy - y) / away), angle

    def _speed(self, normal, angle):
        """Speed of a satellite along a normal."""
        v1, v2, w = self.v
        return normal[0] * (v1 + w * mp.cos(angle)) + normal[1] * (v2 + w * mp.sin(angle))


def _satellite(maths, state, time, k):
    """Position and angle of the k-th satellite after the one that is lowest at the start of the flight."""
    x, angle, height, v1, v2, w, spacing, scale = state
    angle = angle + scale * w * time + k * spacing
    half = maths.sin(angle / 2)
    return x + v1 * time + maths.sin(angle) / scale, height + v2 * time + 2 * half * half / scale, angle


def _distance(piece, x, y):
    """Distance of a point from a piece, and whether the nearest point is near an end."""
    if not piece[0]:
        _, ax, ay, bx, by, size = piece
        ex, ey = (bx - ax) / size, (by - ay) / size
        along, across = (x - ax) * ex + (y - ay) * ey, abs((x - ax) * ey - (y - ay) * ex)
        beyond = max(-along, along - size)
        return (math.hypot(across, beyond), True) if beyond > 0.0 else (across, beyond > -CORNER)
    _, cx, cy, radius, low, sweep, _ = piece
    dx, dy = x - cx, y - cy
    turn = (math.atan2(dy, dx) - low) % (2.0 * math.pi)
    if turn <= sweep:
        edge = sweep < 6.28 and min(turn, sweep - turn) * radius < CORNER
        return abs(math.hypot(dx, dy) - radius), edge
    return min(math.hypot(dx - radius * math.cos(a), dy - radius * math.sin(a)) for a in (low, low + sweep)), True


def collide_precisely(disk, wall, scale, spacing, position, velocity):
    """Outgoing positions (n, 2), velocities (n, 3) and contacts of disks in doubles; NaN where digits do not decide."""
    ends, contacts = np.full((len(position), 5), np.nan), np.zeros(len(position), dtype=int)
    with mp.workdps(DIGITS):
        for k, state in enumerate(zip(position, velocity, strict=True)):
            one = PreciseCollision(disk, wall, scale, spacing, *state)
            try:
                ends[k] = [float(number) for number in one.collide()]
            except ArithmeticError:
                continue
            contacts[k] = one.contacts
    return position + ends[:, :2], ends[:, 2:], contacts
