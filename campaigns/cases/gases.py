"""Starts of gases for campaigns and tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# Containers with all kinds of walls, in which a few disks of radius 1 have room.
ROOMS = {
    "polygon": geo.Container.polygon([(-4, -3), (5, -3), (5, 3), (-4, 3)]),
    "segments": geo.Container.polygon([(-4, -3), (5, -3), (5, 3), (-4, 3)]).closed(),
    "circle": geo.Container.circle(5.0), "ellipse": geo.Container.ellipse(6.0, 4.0),
    "stadium": geo.Container.stadium(6.0, 3.5), "Sinai": geo.Container.sinai(12.0, 2.0),
    "Bezier": geo.Container.from_curves(
        [geo.Bezier([(-6, 0), (0, -6), (6, 0)]), geo.Bezier([(6, 0), (5, 4), (0, 5)]), geo.Segment((0, 5), (-6, 0))]
    ),
}  # fmt: skip


def pair_of(law: ker.Law, ratio: float = 0.5, radius: float = 1.0) -> ker.PairLaw:
    """The law of two equal disks of mass 1 with this J/(m r^2)."""
    return ker.PairLaw(law, geo.Disk(1.0, ratio, radius))


def scattered(room: Any, number: int, rng: np.random.Generator, distance: float = 2.0) -> tuple[Any, Any]:
    """Random centres in a container at this distance at least, and normal velocities."""
    boxes = np.array([[*room.points.T.min(axis=1), *room.points.T.max(axis=1)]] if len(room.points) else
                     [curve.box for curve in room.curves])  # fmt: skip
    seats: list[Any] = []
    while len(seats) < number:
        seat = rng.uniform(boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0))
        if room.contains([seat])[0] and all(math.dist(seat, other) > distance for other in seats):
            seats.append(seat)
    return np.array(seats), rng.standard_normal((number, 3))


def on_a_lattice(number: int, fraction: float, ratio: float, rng: np.random.Generator, spin: bool = True) -> Any:
    """Side of a square, centres of disks of radius 1 on a square lattice, and velocities with k T = 1 and momentum 0.

    The disks fill this fraction of the square. The third velocity is r omega.
    """
    side, rows = math.sqrt(number * math.pi / fraction), math.ceil(math.sqrt(number))
    seats = side / rows * np.array([(i + 0.5, j + 0.5) for i in range(rows) for j in range(rows)])[:number]
    velocity = rng.standard_normal((number, 3)) * [1.0, 1.0, spin * ratio**-0.5]
    return side, seats, velocity - [*velocity[:, :2].mean(axis=0), 0.0]
