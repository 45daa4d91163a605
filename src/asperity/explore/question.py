"""What the page asks: a wall, a disk, a convention; and how a dragged polygon becomes a wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ..core.checks import Floats
from ..geometry import Disk, Wall
from ..kernels import CollisionLaw, Law, WallLaw
from ..kernels.bases.basis import Frame

Points: TypeAlias = Sequence[tuple[float, float]]
# Of a wall with more vertices none can be dragged.
MOST_HANDLES = 30


@dataclass(frozen=True)
class Question:
    """A wall with a disk, and how they are regarded.

    Attributes
    ----------
    wall : Wall
    name : str
        What the wall is called in titles and files.
    disk : Disk
    convention : {"paper", "specular"}
        Of kernel, spectrum and gap.
    foreshortened : bool
        Whether they are those of the wall that the disk feels, instead of the wall itself.
    of_catalogue : bool
        Whether the wall is a named one.

    Examples
    --------
    >>> wall = Wall.from_vertices([(0, 0), (0.5, -0.25), (1, 0)])
    >>> Question(wall, "teeth", Disk(1.0, 1 / 3), foreshortened=True).seen.depth
    0.5
    """

    wall: Wall
    name: str
    disk: Disk = field(default_factory=Disk)
    convention: Frame = "paper"
    foreshortened: bool = False
    of_catalogue: bool = False

    @cached_property
    def seen(self) -> Wall:
        """The wall whose law is shown."""
        return self.wall.foreshorten(self.disk) if self.foreshortened else self.wall

    @property
    def law(self) -> Law:
        """The law in the chosen convention."""
        law = WallLaw(self.seen)
        return law.in_specular_frame() if self.convention == "specular" else law

    @property
    def handles(self) -> list[tuple[float, float]]:
        """The vertices that can be dragged, none of a foreshortened wall."""
        return [] if self.foreshortened else draggable_vertices(self.wall)

    @property
    def collision(self) -> CollisionLaw:
        """The collision law of the disk with the wall itself."""
        return CollisionLaw.from_wall(self.wall, self.disk)


def draggable_vertices(wall: Wall) -> list[tuple[float, float]]:
    """The vertices that can be dragged: those of a polygon without islands that begins at a highest point.

    Examples
    --------
    >>> from asperity.geometry import focusing_arcs, triangular_teeth
    >>> len(draggable_vertices(triangular_teeth(1.0))), draggable_vertices(focusing_arcs(1.0))
    (3, [])
    """
    if not wall.is_polygonal or wall.islands or wall.vertices[0, 1] != 0.0 or len(wall.vertices) > MOST_HANDLES:
        return []
    return [(x, y) for x, y in wall.vertices.tolist()]


def pinned(points: Points | Floats, period: float) -> list[tuple[float, float]]:
    """The vertices with both ends at y = 0, one period apart, and no vertex above y = 0.

    Examples
    --------
    >>> pinned([(0.1, -0.1), (0.5, 0.2), (0.9, 0)], 1.0)
    [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]
    """
    # 0.0 and not -0.0, which the vertices of a wall do not have
    inner = [(float(x), min(float(y), 0.0) + 0.0) for x, y in list(points)[1:-1]]
    return [(0.0, 0.0), *inner, (period, 0.0)]


def with_new_vertex(points: Points | Floats) -> list[tuple[float, float]]:
    """The vertices with the last one, which was added to the others, moved into the side of the wall next to it.

    Examples
    --------
    >>> with_new_vertex([(0, 0), (0.5, -1), (1, 0), (0.8, -0.3)])
    [(0.0, 0.0), (0.5, -1.0), (0.8, -0.3), (1.0, 0.0)]
    """
    *old, new = np.asarray(points, dtype=np.float64) @ [1.0, 1.0j]
    starts, sides = np.array(old[:-1]), np.diff(old)
    length = np.maximum(np.abs(sides) ** 2, np.finfo(float).tiny)
    fraction = np.clip(((new - starts) * sides.conj()).real / length, 0.0, 1.0)
    where = int(np.argmin(np.abs(starts + fraction * sides - new))) + 1
    *old, new = points
    return [(float(x), float(y)) for x, y in (*old[:where], new, *old[where:])]
