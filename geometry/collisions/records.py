"""The wall and the satellites as arguments of the compiled collision.

Lengths are in units of the wall, so the disk's radius is 1/scale.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.rounding import EPS
from ..curves import columns as c
from ..curves.curve import Curve
from ..disk.satellites import Satellites
from ..tracing.threads import new_flag
from .compiled.graph_table import LEAST_BEND, MOST_BEND, graphs_of

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Relative allowance for rounding in bounds on the reach of satellites and on the depth of the disk.
ROOM = 1e-9
# Relative error of positions, a few rounding errors of their size, as for rays (`curves/columns`).
SLACK = 16.0 * EPS


class Ground(NamedTuple):
    """The wall: its period, whether satellites pass from cell to cell below its tops, and the tables of its scene.

    ``exact_arcs`` is the table of `refined_arcs`, ``graphs`` that of `graphs_of`; the hollows have ranges of graphs in
    the columns of Bezier pieces. ``stop`` is the flag that interrupts a collision.
    """

    cell: float
    is_open: bool
    hollows: Floats
    joints: Floats
    lines: Floats
    arcs: Floats
    exact_arcs: Floats
    beziers: Floats
    graphs: Floats
    stop: NDArray[np.int64]


class Ring(NamedTuple):
    """The satellites and their disk.

    At an angle of more than ``reach`` from the lowest point a satellite is above the wall; ``-floor`` is the least
    height of the disk; ``slack`` bounds the rounding error of a satellite's position. ``half_sine`` and ``half_cosine``
    are the sine and cosine of half the spacing. ``is_rolling`` tells that the disk is on the cylinder, where one
    satellite stays the lowest point: the contact moves with the velocity (v1 + omega, v2).
    """

    scale: float
    spacing: float
    reach: float
    floor: float
    slack: float
    half_sine: float
    half_cosine: float
    is_rolling: bool


class DiskResults(NamedTuple):
    """The arrays that the compiled collision fills, one row for each disk; see `RigidCollision`."""

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    two_satellites: NDArray[np.bool_]
    status: NDArray[np.uint8]

    def part(self, block: slice) -> DiskResults:
        """Return the results of the disks in ``block``."""
        return DiskResults._make(array[block] for array in self)


def results_for(count: int) -> DiskResults:
    """Return empty results for ``count`` disks."""
    return DiskResults(
        np.empty((count, 2)), np.empty((count, 3)), np.empty(count),
        np.empty(count, np.int64), np.empty(count, np.bool_), np.empty(count, np.uint8),
    )  # fmt: skip


def ground_of(scene: Scene) -> Ground:
    """Return the tables of a wall."""
    from ..tracing.compiled.pieces.arcs import refined_arcs

    for cls, rows in zip(Curve.traced(), scene.curves, strict=True):
        if len(rows) and not cls.meets_disks:
            raise InputError(f"wall: expected pieces that disks meet, got a {cls.__name__}; write it as Bezier curves")
    hollows = scene.hollows.copy()
    graphs = graphs_of(scene.beziers, hollows)
    return Ground(
        scene.cell, scene.is_open, hollows, scene.joints, scene.lines, scene.arcs, refined_arcs(scene.arcs),
        scene.beziers, graphs, new_flag(),
    )  # fmt: skip


def largest_bend(ground: Ground) -> float:
    """Return an upper bound on the curvature of the wall's pieces."""
    arcs = np.abs(ground.arcs[:, c.CURVATURE]) * np.maximum(ground.arcs[:, c.STRETCH], 1.0) ** 2
    bends = np.abs(ground.graphs[:, [LEAST_BEND, MOST_BEND]])
    return float(max(arcs.max(initial=0.0), bends.max(initial=0.0)))


def ring_of(satellites: Satellites, scale: float, scene: Scene) -> Ring:
    """Return the satellites above a wall of the given scale."""
    half = 0.5 * satellites.spacing
    return Ring(
        scale,
        satellites.spacing,
        satellites.reach * (1.0 + ROOM),
        satellites.lowest / scale * (1.0 + ROOM),
        position_rounding(scene, math.sin(satellites.reach) / scale),
        math.sin(half),
        math.cos(half),
        False,
    )


def rolling_ring(scale: float, depth: float, scene: Scene) -> Ring:
    """Return the one satellite of a disk on the cylinder over a wall of the given scale and depth."""
    return Ring(scale, 1.0, 0.0, depth + scene.cell, position_rounding(scene, 0.0), 0.0, 1.0, True)


def position_rounding(scene: Scene, farthest: float) -> float:
    """Return a bound on the rounding error of a satellite's position, from the wall's size and ``farthest``."""
    size = float(scene.hollows[:, c.SIZE].max()) if len(scene.hollows) else 0.0
    return SLACK * (size + scene.cell + farthest)
