"""A gas of equal disks by the times of all pairs after each event, in numpy: the judge of the compiled loop."""

from __future__ import annotations

import numpy as np

from asperity import geometry as geo

# How far beyond their ends walls are met.
SLACK = 1e-11


def segment_times(curve, position, velocity, own, slack):
    """Times at which points reach a segment from its left."""
    along = curve.tangent(0.0)
    normal = np.array([-along[1], along[0]])
    relative = position - np.array(curve.start)
    distance, approach = relative @ normal, -(velocity @ normal)
    time = np.maximum(distance, 0.0) / approach
    at = (relative + velocity * time[:, None]) @ along
    hit = (approach > 0.0) & (distance >= -slack) & (at >= -slack) & (at <= curve.length + slack) & ~own
    return np.where(hit & np.isfinite(time), time, np.inf)


def arc_times(curve, position, velocity, own, slack):
    """Times at which points reach an arc from its left: roots of a quadratic equation."""
    axes = np.array(curve.semi_axes)
    start, direction = (position - np.array(curve.center)) / axes, velocity / axes
    a, b, c = np.sum(direction**2, axis=1), np.sum(start * direction, axis=1), np.sum(start**2, axis=1) - 1.0
    c = np.where(own, 0.0, c)
    root = np.sqrt(b * b - a * c)
    if curve.direction > 0:
        time = np.where(own, -2.0 * b / a, np.where(b > 0.0, -c / (b + root), (root - b) / a))
        hit = own | (time >= -slack)
    else:
        time = c / (root - b)
        hit = ~own & (b < 0.0) & (c >= -slack)
    time = np.maximum(time, 0.0)
    met = start + direction * time[:, None]
    span = abs(curve.end_angle - curve.start_angle)
    swept = curve.direction * (np.arctan2(met[:, 1], met[:, 0]) - curve.start_angle) % (2.0 * np.pi)
    within = (swept <= span + slack) | (swept >= 2.0 * np.pi - slack)
    return np.where(hit & within & np.isfinite(time), time, np.inf)


def wall_times(container, position, velocity, last):
    """Times (n, walls) to all walls, without corners and grazing; `last` is the wall on which a point is, or -1."""
    times = []
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, (point, normal) in enumerate(zip(container.points, container.normals, strict=True)):
            approach = -(velocity @ normal)
            time = np.maximum((position - point) @ normal, 0.0) / approach
            times.append(np.where((approach > 0.0) & (last != k) & np.isfinite(time), time, np.inf))
        for k, curve in enumerate(container.curves, len(container.points)):
            if isinstance(curve, geo.Bezier):
                times.append(curve.arrival(position, velocity, last == k, SLACK))
            else:
                kind = segment_times if isinstance(curve, geo.Segment) else arc_times
                times.append(kind(curve, position, velocity, last == k, SLACK))
    return np.stack(times, axis=1)


class PlainGas:
    """The present state, and the times of the next collision of every pair and of every disk with a wall.

    Velocities are (v1, v2, r omega). The laws are maps of the local velocity; see `plain_law`.
    """

    def __init__(self, container, pair, walls, diameter, position, velocity):
        self.container, self.pair, self.laws, self.diameter = container, pair, walls, diameter
        self.position, self.velocity = np.array(position, float), np.array(velocity, float)
        n = len(self.position)
        self.now, self.angle, self.last = 0.0, np.zeros(n), np.full(n, -1)
        self.pairs, self.walls = np.full((n, n), np.inf), np.full(n, np.inf)
        self.next_wall = np.full(n, -1)
        self.predict(np.arange(n))

    def predict(self, disks):
        """Compute the next collisions of these disks."""
        times = wall_times(self.container, self.position[disks], self.velocity[disks, :2], self.last[disks])
        self.next_wall[disks] = np.argmin(times, axis=1)
        self.walls[disks] = self.now + times.min(axis=1)
        for k in disks:
            times = self.now + meeting_times(
                self.position - self.position[k], self.velocity - self.velocity[k], self.diameter
            )
            times[k] = np.inf
            self.pairs[k], self.pairs[:, k] = times, times

    def next_event(self):
        """Move all disks to the next event, and collide."""
        at_wall = int(np.argmin(self.walls))
        first, second = (int(i) for i in np.unravel_index(np.argmin(self.pairs), self.pairs.shape))
        hits_wall = bool(self.walls[at_wall] <= self.pairs[first, second])
        then = float(min(self.walls[at_wall], self.pairs[first, second]))
        step = max(then - self.now, 0.0)
        self.position += self.velocity[:, :2] * step
        self.angle += self.velocity[:, 2] * step * 2.0 / self.diameter
        self.now = then
        if hits_wall:
            wall = int(self.next_wall[at_wall])
            point = self.container.touch(wall, self.position[[at_wall]])
            self.position[at_wall], self.last[at_wall] = point.position[0], wall
            self.velocity[at_wall] = self.laws[wall](self.velocity[at_wall], np.zeros(3), point.normal[0])[0]
            self.predict(np.array([at_wall]))
        else:
            normal = self.position[first] - self.position[second]
            self.velocity[first], self.velocity[second] = self.pair(
                self.velocity[first], self.velocity[second], normal / np.hypot(*normal)
            )
            self.last[[first, second]] = -1
            self.predict(np.array([first, second]))


def meeting_times(offset, velocity, distance):
    """Times (n,) at which relative positions (n, 2) approach to this distance, inf where they do not."""
    plane = velocity[:, :2]
    closing, speed = -np.sum(offset * plane, axis=1), np.sum(plane**2, axis=1)
    excess = np.sum(offset**2, axis=1) - distance**2
    across = offset[:, 0] * plane[:, 1] - offset[:, 1] * plane[:, 0]
    reach = distance * np.sqrt(speed)
    root = np.sqrt(np.maximum((reach - across) * (reach + across), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.maximum(excess, 0.0) / (closing + root)
    return np.where((closing > 0.0) & (np.abs(across) <= reach), time, np.inf)


def plain_law(kind, ratio, is_wall):
    """The collision of two disks, or of a disk and a wall, as a map of both velocities and the normal.

    ``kind`` is 1 for smooth disks and -1 for no-slip ones: the factor of the slip at the contact. ``ratio`` is
    J/(m r^2) of both disks. From the impulses along normal and tangent, in components.
    """

    def collide(one, two, normal):
        tangent = np.array([normal[1], -normal[0]])
        relative = one[:2] - two[:2]
        inverse = 1.0 if is_wall else 2.0
        up = -2.0 * (relative @ normal) / inverse
        slip = relative @ tangent + one[2] + two[2]
        along = (kind - 1.0) * slip / (inverse * (1.0 + 1.0 / ratio))
        impulse = up * normal + along * tangent
        after = np.array([*(one[:2] + impulse), one[2] + along / ratio])
        other = two if is_wall else np.array([*(two[:2] - impulse), two[2] + along / ratio])
        return after, other

    return collide
