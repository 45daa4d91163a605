"""Reflection laws: the algebra of laws, and the laws that are known in closed form without a wall."""
