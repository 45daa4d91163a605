"""The invariant measure, angles, and the orthonormal bases of functions on them."""
