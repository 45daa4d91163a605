"""Walls: the class, the named ones and their catalogue, and what lies inside the solid."""
