"""Regions in which the centre of a disk moves, and their boundaries."""
