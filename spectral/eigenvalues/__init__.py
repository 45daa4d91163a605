"""Eigenvalues of symmetric matrices, dense and sparse, with proofs of completeness and sampling errors."""
