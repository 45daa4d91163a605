"""Plots of walls with rays, and of collisions of the disk."""
