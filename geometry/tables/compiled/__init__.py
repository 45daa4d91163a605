"""The compiled flight of a point to the next wall of a table; loads numba."""
