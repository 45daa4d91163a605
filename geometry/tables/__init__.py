"""Regions with straight walls in which the centre of a disk moves."""
