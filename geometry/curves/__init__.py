"""The curves that make up walls: segments, arcs and Bezier curves, and the test for crossings."""
