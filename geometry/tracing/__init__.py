"""Rays through the cell of a wall: the map (x, theta) -> (x', theta'), in double-double arithmetic if necessary."""
