"""The invariant measures, and orthonormal bases of functions of the angle with their quadrature rules."""
