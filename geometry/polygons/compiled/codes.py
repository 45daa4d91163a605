"""Codes of an edge of a triangle of a hollow beyond which the opening or a wall lies."""

from __future__ import annotations

# Codes in `Triangulation.beyond`: at least 0 another triangle's edge; else the opening, or `FIRST_WALL - edge`.
OPENING = -1
FIRST_WALL = -2
