"""Matrices of laws: the methods that compute them, one in each file, and the choice between the methods."""
