"""Kernels as matrices in a basis: algebra, files, pictures and defects."""
