"""Walls and disks, the tracing of rays, and the collision of a disk with a rough wall.

- Make a wall: WALLS, HeightCorrelation, SelfAffine, Wall, dispersing_arcs, double_parabola, elliptical_arcs, flat,
  focusing_arcs, join_walls, koch, load_wall, mushrooms, notched_angle, random_wall, rectangular_teeth,
  sinusoid, triangular_teeth, tube, wall_from_text, Profile, read_profile, Arc, Bezier, Segment.
- Make a surface that is rough in two directions: Surface, read_surface.
- Trace rays: MushroomGenerations, Status, billiard_map, nested_reflection, trace, trajectory.
- Draw walls: draw_wall.
- Collide disks: Disk, InnerDisk, RollingCharts, SatelliteDisk, ConfigurationSpace, DiskStatus, collide,
  collide_cylinder, collide_modified, collide_pair, collide_rim, collision_path, good_fraction, shadow, Container,
  Torus.
- Verify a formula, and the formulas of a disk: verify, symbolic.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..verification.identity import verify
from .cells.measured import Profile
from .cells.profile import read_profile
from .collisions.configuration_space import ConfigurationSpace, collision_path
from .collisions.cylinder import collide_cylinder, collide_modified
from .collisions.encounter import collide_rim
from .collisions.pair import collide_pair
from .collisions.rigid import DiskStatus, collide
from .collisions.transversality import good_fraction, shadow
from .curves.arc import Arc
from .curves.bezier import Bezier
from .curves.segment import Segment
from .disk.disk import Disk, InnerDisk, SatelliteDisk
from .disk.satellites import RollingCharts
from .plotting.walls import draw_wall
from .surfaces.reading import read_surface
from .surfaces.surface import Surface
from .tables.container import Container, Torus
from .tracing.boundary_map import billiard_map, nested_reflection
from .tracing.generations import MushroomGenerations
from .tracing.tracing import Status, trace, trajectory
from .walls.catalogue import WALLS, wall_from_text
from .walls.mushroom import mushrooms
from .walls.named import (
    dispersing_arcs,
    double_parabola,
    elliptical_arcs,
    flat,
    focusing_arcs,
    join_walls,
    koch,
    notched_angle,
    rectangular_teeth,
    sinusoid,
    triangular_teeth,
    tube,
)
from .walls.random_heights import HeightCorrelation, SelfAffine, random_wall
from .walls.wall import Wall, load_wall

if TYPE_CHECKING:
    from .disk import symbolic

__all__ = [
    "WALLS",
    "Arc",
    "Bezier",
    "ConfigurationSpace",
    "Container",
    "Disk",
    "DiskStatus",
    "HeightCorrelation",
    "InnerDisk",
    "MushroomGenerations",
    "Profile",
    "RollingCharts",
    "SatelliteDisk",
    "Segment",
    "SelfAffine",
    "Status",
    "Surface",
    "Torus",
    "Wall",
    "billiard_map",
    "collide",
    "collide_cylinder",
    "collide_modified",
    "collide_pair",
    "collide_rim",
    "collision_path",
    "dispersing_arcs",
    "double_parabola",
    "draw_wall",
    "elliptical_arcs",
    "flat",
    "focusing_arcs",
    "good_fraction",
    "join_walls",
    "koch",
    "load_wall",
    "mushrooms",
    "nested_reflection",
    "notched_angle",
    "random_wall",
    "read_profile",
    "read_surface",
    "rectangular_teeth",
    "shadow",
    "sinusoid",
    "symbolic",
    "trace",
    "trajectory",
    "triangular_teeth",
    "tube",
    "verify",
    "wall_from_text",
]


def __getattr__(name: str) -> Any:
    # sympy is loaded when it is first asked for
    if name == "symbolic":
        return import_module(".disk.symbolic", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
