"""Walls, disks and tracing: curves, walls by name, profile or file, and where rays go in them."""

from .arc import Arc
from .bezier import Bezier
from .catalogue import WALLS, NamedWall, wall_from_text
from .curve import Curve
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

__all__ = [
    "WALLS",
    "Arc",
    "Bezier",
    "Curve",
    "Disk",
    "Hollow",
    "NamedWall",
    "RigidCollision",
    "Segment",
    "Status",
    "Trace",
    "TracePlan",
    "Wall",
    "collide",
    "dispersing_arcs",
    "double_parabola",
    "draw_wall",
    "elliptical_arcs",
    "flat",
    "focusing_arcs",
    "koch",
    "load_wall",
    "mushrooms",
    "read_profile",
    "rectangular_teeth",
    "trace",
    "trajectory",
    "triangular_teeth",
    "wall_from_text",
]
