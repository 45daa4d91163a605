"""Rays through the cell of a wall: the map (x, theta) -> (x', theta'), with refinement where doubles cannot decide."""
