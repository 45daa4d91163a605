"""Traced conditional distributions: the entry points between which the itinerary of a ray is the same."""
