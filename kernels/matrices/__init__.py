"""Matrices of kernels in a basis: algebra, files, pictures and defects."""
