"""Theorems on spectral gaps, with certificates that python-flint alone can check."""
