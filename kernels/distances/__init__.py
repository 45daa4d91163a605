"""Distances between laws, between matrices and between sequences of walls."""
