"""Polygonal hollows sorted exactly into beams that are reflected alike."""
