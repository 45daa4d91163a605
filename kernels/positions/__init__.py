"""Laws that depend on the position along a wall, the displacement of rays, and their distance."""
