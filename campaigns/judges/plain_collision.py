"""The collision of the disk with satellites by brute force, for many disks at once: a twin of `geo.collide`.

A satellite moves at most ``fastest`` times as fast as time goes by, so that it cannot meet the wall sooner than its
distance from the wall divided by that: each flight advances by the least such time until a satellite is within
``CLOSE`` of the wall. Distances are those from all pieces in three cells. No sign, no root, no hollow is involved.
"""

from __future__ import annotations

import numpy as np

from asperity import geometry as geo

CLOSE = 1e-11
MOST_STEPS = 20_000


def distances(wall, points):
    """Distances of points (..., 2) from every piece in three cells, shape (..., pieces * 3)."""
    cell = np.floor(points[..., :1] / wall.period) * wall.period
    local = points - np.concatenate([cell, np.zeros_like(cell)], axis=-1)
    away = [_away(piece, local - [shift * wall.period, 0.0]) for piece in _pieces(wall) for shift in (-1, 0, 1)]
    return np.stack([np.hypot(vector[..., 0], vector[..., 1]) for vector in away], axis=-1)


def _pieces(wall):
    return [*wall.pieces, *(piece for island in wall.islands for piece in island)]


def _away(piece, points):
    """Vector from the nearest point of a segment or circular arc."""
    start, end = np.array(piece.start), np.array(piece.end)
    if isinstance(piece, geo.Segment):
        edge = end - start
        fraction = np.clip((points - start) @ edge / (edge @ edge), 0.0, 1.0)
        return points - start - fraction[..., None] * edge
    radius, outward = piece.semi_axes[0], points - np.array(piece.center)
    low, high = sorted((piece.start_angle, piece.end_angle))
    inside = (np.arctan2(outward[..., 1], outward[..., 0]) - low) % (2 * np.pi) <= high - low
    onto = outward * (1.0 - radius / np.hypot(outward[..., 0], outward[..., 1]))[..., None]
    from_start, from_end = points - start, points - end
    nearer = np.hypot(*np.moveaxis(from_start, -1, 0)) < np.hypot(*np.moveaxis(from_end, -1, 0))
    return np.where(inside[..., None], onto, np.where(nearer[..., None], from_start, from_end))


def front_normal(wall, points):
    """Unit normal towards free space of the piece that is nearest to each point, shape (n, 2)."""
    nearest = distances(wall, points).argmin(axis=-1)
    local = points - np.stack([np.floor(points[:, 0] / wall.period) * wall.period, np.zeros(len(points))], axis=-1)
    normal = np.empty_like(points)
    for number, piece in enumerate(_pieces(wall)):
        for k, shift in enumerate((-1, 0, 1)):
            here = nearest == 3 * number + k
            if isinstance(piece, geo.Segment):
                edge = np.array(piece.end) - piece.start
                normal[here] = [-edge[1], edge[0]] / np.hypot(*edge)
            else:
                radial = local[here] - [shift * wall.period, 0.0] - np.array(piece.center)
                turn = np.sign(piece.end_angle - piece.start_angle)
                normal[here] = -turn * radial / np.hypot(radial[:, 0], radial[:, 1])[:, None]
    return normal


def collide_plainly(disk, wall, scale, spacing, position, velocity, most_contacts=40):
    """Outgoing positions, velocities and contacts; rows that need more steps or contacts are NaN."""
    n = len(position)
    x, alpha = position[:, 0] / scale, position[:, 1].copy()
    height, moving = np.zeros(n), velocity.astype(float)
    contacts = np.zeros(n, dtype=int)
    out_position, out_velocity = np.full((n, 2), np.nan), np.full((n, 3), np.nan)
    active = np.arange(n)
    for _ in range(most_contacts):
        fly = _Flight(wall, scale, spacing, x[active], alpha[active], height[active], moving[active])
        time, which, satellites, angles = fly.until_contact()
        back = which < 0
        rows = active[back]
        x[active] += moving[active, 0] * time
        alpha[active] += scale * moving[active, 2] * time
        height[active] += moving[active, 1] * time
        out_position[rows] = np.stack([scale * x[rows], alpha[rows]], axis=-1)
        out_velocity[rows] = moving[rows]
        lost = which == -2
        out_velocity[active[lost]] = np.nan
        hit = which >= 0
        active = active[hit]
        if not len(active):
            break
        contacts[active] += 1
        touching = np.arange(len(active)), which[hit]
        k, angle = front_normal(wall, satellites[hit][touching]), angles[hit][touching]
        # the covector (k1, k2, k1 cos + k2 sin) of the contact, raised by the kinetic metric: Proposition 3.2
        covector = np.stack([k[:, 0], k[:, 1], k[:, 0] * np.cos(angle) + k[:, 1] * np.sin(angle)], axis=-1)
        vector = covector / [disk.mass, disk.mass, disk.inertia]
        w = moving[active]
        fraction = np.sum(covector * w, axis=1) / np.sum(covector * vector, axis=1)
        moving[active] = w - 2.0 * fraction[:, None] * vector
    return out_position, out_velocity, contacts


class _Flight:
    """One flight of several disks from their positions, in units of the wall."""

    def __init__(self, wall, scale, spacing, x, alpha, height, velocity):
        self.wall, self.scale, self.spacing = wall, scale, spacing
        self.x, self.alpha, self.height, self.velocity = x, alpha, height, velocity
        self.fastest = np.hypot(velocity[:, 0], velocity[:, 1]) + np.abs(velocity[:, 2])

    def satellites(self, rows, time):
        """Positions (rows, 3, 2) and angles (rows, 3) of the three lowest satellites."""
        v = self.velocity[rows]
        alpha = self.alpha[rows] + self.scale * v[:, 2] * time
        lowest = alpha - self.spacing * np.round(alpha / self.spacing)
        angles = lowest[:, None] + self.spacing * np.array([-1.0, 0.0, 1.0])
        x = (self.x[rows] + v[:, 0] * time)[:, None] + np.sin(angles) / self.scale
        y = (self.height[rows] + v[:, 1] * time)[:, None] + 2.0 * np.sin(0.5 * angles) ** 2 / self.scale
        return np.stack([x, y], axis=-1), angles

    def until_contact(self):
        n = len(self.x)
        time, which = np.zeros(n), np.full(n, -2)
        end = np.where(self.velocity[:, 1] > 0, -self.height / self.velocity[:, 1], np.inf)
        here, angles = self.satellites(np.arange(n), time)
        distance = distances(self.wall, here)
        least = distance.min(axis=-1)
        touching = least.min(axis=1) <= 2.0 * CLOSE
        if touching.any():
            # a satellite on a piece moves away from it, and is not back before its path, which bends by at most
            # scale omega^2, and the piece's curvature bring it back; all other distances bound the time as ever
            which_one = least[touching].argmin(axis=1)
            pick = np.arange(touching.sum()), which_one
            normal, angle, v = (
                front_normal(self.wall, here[touching][pick]),
                angles[touching][pick],
                self.velocity[touching],
            )
            speed = normal[:, 0] * (v[:, 0] + v[:, 2] * np.cos(angle)) + normal[:, 1] * (
                v[:, 1] + v[:, 2] * np.sin(angle)
            )
            bend = self.scale * v[:, 2] ** 2 + self._curvature() * self.fastest[touching] ** 2
            rest = distance[touching]
            # both faces of a thin plate are left at the same speed
            rest[pick] = np.where(rest[pick] <= 2.0 * CLOSE, self.wall.period, rest[pick])
            free = rest.min(axis=(1, 2)) / self.fastest[touching]
            time[touching] = np.minimum(np.minimum(np.abs(speed) / bend, free), end[touching])
        rows = np.arange(n)
        final, final_angles = here, angles
        for _ in range(MOST_STEPS):
            places, turned = self.satellites(rows, time[rows])
            distance = np.minimum(distances(self.wall, places).min(axis=-1), self.wall.period)
            nearest = distance.argmin(axis=1)
            least = distance[np.arange(len(rows)), nearest]
            close = least <= CLOSE
            which[rows[close]] = nearest[close]
            final[rows], final_angles[rows] = places, turned
            away = ~close & (time[rows] >= end[rows])
            which[rows[away]] = -1
            rows, least = rows[~(close | away)], least[~(close | away)]
            if not len(rows):
                break
            # the fourth satellite is higher than the tops, and comes within reach no sooner than it is the third
            step = np.minimum(least / self.fastest[rows], self._fourth(rows, time[rows]))
            time[rows] = np.minimum(time[rows] + step, end[rows])
        return time, which, final, final_angles

    def _curvature(self):
        arcs = [1.0 / p.semi_axes[0] for p in _pieces(self.wall) if isinstance(p, geo.Arc)]
        return max(arcs, default=0.0)

    def _fourth(self, rows, time):
        v = self.velocity[rows]
        up = self.height[rows] + v[:, 1] * time + 2.0 * np.sin(0.75 * self.spacing) ** 2 / self.scale
        return up / self.fastest[rows]
