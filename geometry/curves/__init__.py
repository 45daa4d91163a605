"""Pieces of walls: segments, arcs and Bezier curves, and whether they cross."""
