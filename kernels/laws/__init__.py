"""Reflection laws: their algebra, and the laws that need no wall."""
