"""The codes in `Triangulation.beyond` for edges of triangles at the opening or at a wall."""

from __future__ import annotations

# Numbers >= 0 are edges of other triangles; a wall edge e has the code FIRST_WALL - e.
OPENING = -1
FIRST_WALL = -2
