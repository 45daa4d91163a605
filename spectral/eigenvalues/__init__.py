"""Eigenvalues of symmetric matrices, dense and sparse: complete by proof, with sampling errors."""
