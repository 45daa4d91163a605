"""Rays through the cell of a wall: the map of (x, theta), on threads, and again in double-double arithmetic."""
