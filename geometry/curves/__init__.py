"""Pieces of walls: segments, arcs and Bezier curves, and the test whether they cross."""
