"""What follows from spectra: mixing, diffusion, channels, conductance, the billiard Laplacian."""
