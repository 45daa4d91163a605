"""Conditional expectations of basis functions and of piecewise polynomials."""
