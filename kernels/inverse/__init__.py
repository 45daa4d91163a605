"""Walls made for a wanted law."""
