"""Matrices of laws: the methods that compute them, and the order in which they are tried."""
