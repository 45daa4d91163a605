"""Consequences of a spectrum: mixing times, diffusion in a channel, conductance, the billiard Laplacian."""
