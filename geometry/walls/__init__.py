"""Walls: the class `Wall`, the named walls and their catalogue, and the test for points inside the solid."""
