"""Reflection laws: the algebra of laws, and the laws that are defined without a wall."""
