"""Resistance of rough surfaces and bodies, and the hollows and laws that make it least or greatest."""
