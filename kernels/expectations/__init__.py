"""Conditional expectations E[f(Theta') | theta] of basis functions and of piecewise polynomials."""
