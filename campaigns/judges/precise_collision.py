"""The collision of the disk with satellites in 50 digits, one disk at a time.

As in `plain_collision`, nothing is known of a flight but that no satellite moves faster than some speed: it advances by
the least time in which one could reach the wall, until one is near; then a secant finds the contact. The wall is
polygonal, its corners are doubles.
"""

from __future__ import annotations

import mpmath as mp

DIGITS, GUARD = 50, 15
# A satellite so near the wall, in units of the wall, is brought to it by secants; it is there at the second distance.
NEAR, THERE = mp.mpf(10) ** -9, mp.mpf(10) ** -45
MOST_STEPS, MOST_CONTACTS = 5_000, 40


class Flight:
    """A disk's state over a polygonal wall; lengths are in units of the wall, as in `geometry/collisions`."""

    def __init__(self, wall, disk, scale, spacing, position, velocity):
        self.corners = [(mp.mpf(float(x)), mp.mpf(float(y))) for x, y in wall.vertices]
        self.period, self.scale, self.spacing = mp.mpf(wall.period), mp.mpf(scale), mp.mpf(spacing)
        self.mass, self.inertia = mp.mpf(disk.mass), mp.mpf(disk.inertia)
        self.x, self.alpha, self.height = position[0] / self.scale, position[1], mp.mpf(0)
        self.v = list(velocity)

    def satellites(self, time):
        """Positions and angles of the three lowest ones."""
        alpha = self.alpha + self.scale * self.v[2] * time
        lowest = alpha - self.spacing * mp.nint(alpha / self.spacing)
        x, y = self.x + self.v[0] * time, self.height + self.v[1] * time
        return [
            (x + mp.sin(a) / self.scale, y + 2 * mp.sin(a / 2) ** 2 / self.scale, a)
            for a in (lowest + k * self.spacing for k in (-1, 0, 1))
        ]

    def nearest(self, x, y):
        """Distance from the wall, the segment it belongs to, its normal, and whether its foot is inside the segment."""
        x -= mp.floor(x / self.period) * self.period
        found = []
        for k in range(len(self.corners) - 1):
            (ax, ay), (bx, by) = self.corners[k], self.corners[k + 1]
            ex, ey = bx - ax, by - ay
            for shift in (-1, 0, 1):
                rx, ry = x - shift * self.period - ax, y - ay
                fraction = min(max((rx * ex + ry * ey) / (ex * ex + ey * ey), mp.mpf(0)), mp.mpf(1))
                size = mp.hypot(ex, ey)
                away = mp.hypot(rx - fraction * ex, ry - fraction * ey)
                found.append((away, k, (-ey / size, ex / size), (rx * -ey + ry * ex) / size))
        return min(found, key=lambda one: one[0]), found

    def next_contact(self, own):
        """Time of the next contact and the satellite there, or the time back at height 0 and None."""
        fastest = mp.hypot(self.v[0], self.v[1]) + abs(self.v[2])
        end = -self.height / self.v[1] if self.v[1] > 0 else mp.inf
        time = mp.mpf(0)
        for _ in range(MOST_STEPS):
            free = mp.inf
            for number, (x, y, angle) in enumerate(self.satellites(time)):
                (away, k, normal, side), every = self.nearest(x, y)
                if own is not None and time == 0 and number == own[0]:
                    # it leaves the segment that it touches at this speed, and its path bends no more than that
                    speed = normal[0] * (self.v[0] + self.v[2] * mp.cos(angle))
                    speed += normal[1] * (self.v[1] + self.v[2] * mp.sin(angle))
                    others = min(one[0] for one in every if one[1] != k)
                    free = min(free, speed / (self.scale * self.v[2] ** 2), others / fastest)
                    continue
                if away < NEAR and self._approaches(time, number, k, normal):
                    time = self._secant(time, number, k, normal, side)
                    return time, (number, normal, self.satellites(time)[number][2])
                free = min(free, max(away, NEAR) / fastest)
            if time >= end:
                return end, None
            time = min(time + free, end)
        raise ArithmeticError("too many steps")

    def _approaches(self, time, number, k, normal):
        """Whether the satellite comes nearer to the line of its segment."""
        angle = self.satellites(time)[number][2]
        u = (self.v[0] + self.v[2] * mp.cos(angle), self.v[1] + self.v[2] * mp.sin(angle))
        return normal[0] * u[0] + normal[1] * u[1] < 0

    def _side(self, time, number, k, normal):
        x, y, _ = self.satellites(time)[number]
        x -= mp.floor(x / self.period) * self.period
        return normal[0] * (x - self.corners[k][0]) + normal[1] * (y - self.corners[k][1])

    def _secant(self, time, number, k, normal, side):
        before, here = time, time + side / (mp.hypot(self.v[0], self.v[1]) + abs(self.v[2]))
        f_before, f_here = self._side(before, number, k, normal), self._side(here, number, k, normal)
        for _ in range(60):
            if abs(f_here) < THERE or f_here == f_before:
                return here
            before, here, f_before = here, here - f_here * (here - before) / (f_here - f_before), f_here
            f_here = self._side(here, number, k, normal)
        raise ArithmeticError("no contact")

    def collide(self):
        """Outgoing position (x1, alpha), velocity and the number of contacts."""
        own, contacts = None, 0
        while contacts <= MOST_CONTACTS:
            time, contact = self.next_contact(own)
            self.x += self.v[0] * time
            self.height += self.v[1] * time
            self.alpha += self.scale * self.v[2] * time
            if contact is None:
                return (self.scale * self.x, self.alpha), tuple(self.v), contacts
            own, contacts = contact, contacts + 1
            _, (n1, n2), angle = contact
            # Proposition 3.2: the covector of the contact, raised by the kinetic metric
            covector = (n1, n2, n1 * mp.cos(angle) + n2 * mp.sin(angle))
            vector = (covector[0] / self.mass, covector[1] / self.mass, covector[2] / self.inertia)
            push = 2 * mp.fdot(covector, self.v) / mp.fdot(covector, vector)
            self.v = [v - push * w for v, w in zip(self.v, vector, strict=True)]
        raise ArithmeticError("too many contacts")
