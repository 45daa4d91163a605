"""Eigenvalues of symmetric matrices, dense and sparse, with checks of completeness and sampling errors."""
