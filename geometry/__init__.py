"""Walls, disks and tracing: curves, walls by name, profile or file, and where rays go in them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..verification.identity import verify
from .arc import Arc
from .bezier import Bezier
from .catalogue import WALLS, NamedWall, wall_from_text
from .charts import RollingCharts, plane_crossing, plane_crossing_differential
from .collision_drawing import collision_path, draw_collision, draw_configurations
from .configuration import ConfigurationSpace
from .container import Container
from .curve import Curve
from .cylinder import CylinderCollision, ModifiedCollision, collide_cylinder, collide_modified
from .disk import Disk
from .drawing import draw_wall
from .hollow import Hollow
from .koch_curve import koch
from .mushroom import mushrooms
from .named import (
    dispersing_arcs,
    double_parabola,
    elliptical_arcs,
    flat,
    focusing_arcs,
    rectangular_teeth,
    triangular_teeth,
)
from .plan import TracePlan
from .profile import read_profile
from .rigid import RigidCollision, collide
from .segment import Segment
from .tracing import Status, Trace, trace, trajectory
from .wall import Wall
from .wallfile import load_wall

if TYPE_CHECKING:
    from . import symbolic

__all__ = [
    "WALLS",
    "Arc",
    "Bezier",
    "ConfigurationSpace",
    "Container",
    "Curve",
    "CylinderCollision",
    "Disk",
    "Hollow",
    "ModifiedCollision",
    "NamedWall",
    "RigidCollision",
    "RollingCharts",
    "Segment",
    "Status",
    "Trace",
    "TracePlan",
    "Wall",
    "collide",
    "collide_cylinder",
    "collide_modified",
    "collision_path",
    "dispersing_arcs",
    "double_parabola",
    "draw_collision",
    "draw_configurations",
    "draw_wall",
    "elliptical_arcs",
    "flat",
    "focusing_arcs",
    "koch",
    "load_wall",
    "mushrooms",
    "plane_crossing",
    "plane_crossing_differential",
    "read_profile",
    "rectangular_teeth",
    "symbolic",
    "trace",
    "trajectory",
    "triangular_teeth",
    "verify",
    "wall_from_text",
]


def __getattr__(name: str) -> Any:
    # sympy is loaded when it is first asked for
    if name == "symbolic":
        return import_module(".symbolic", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
