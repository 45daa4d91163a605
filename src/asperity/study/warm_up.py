"""Small tasks that together use the compiled functions, so that numba compiles or loads them."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np

from .. import geometry as geo
from .. import kernels as ker


def _rays() -> None:
    for wall in (geo.triangular_teeth(0.7), geo.focusing_arcs(1.2), geo.koch(3)):
        geo.trace(wall, [0.3, 0.6], 1.0)
    geo.trajectory(geo.koch(1), 0.3, 1.0)


def _difficult_rays() -> None:
    from ..geometry.tracing.compiled.rays import LATE

    for function in LATE:
        function.load()
    # this ray meets a corner, so it is traced again in double-double arithmetic
    geo.trace(geo.triangular_teeth(1.5), 0.5, pi / 2)
    ker.WallLaw(geo.rectangular_teeth(1.5)).apply(np.cos, 1e-12)


def _distributions() -> None:
    ker.discretise(ker.WallLaw(geo.dispersing_arcs(1.0)), ker.Bins(4), "quadrature", 0.01)


def _polygons() -> None:
    ker.discretise(ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.4, -0.3), (1, 0)])), ker.Bins(4), "exact", 0.01)


def _disks() -> None:
    disk = geo.Disk(1.0, 0.5)
    for wall in (geo.triangular_teeth(0.7), geo.rectangular_teeth(0.5)):
        geo.collide(disk, wall, 0.02, [[0.3, 0.1]], [[0.2, -1.0, 0.1]])


TASKS: dict[str, Callable[[], None]] = {
    "rays": _rays,
    "rays that double precision leaves open": _difficult_rays,
    "distributions of outgoing angles": _distributions,
    "exact matrices of polygons": _polygons,
    "collisions of disks": _disks,
}


def folder() -> Path:
    """Return a folder in which compiled functions are stored."""
    from ..geometry.tracing.compiled.rays import trace_rays

    return Path(trace_rays._cache.cache_path)
