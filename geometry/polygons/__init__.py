"""Exact division of the rays into polygonal hollows into beams of equal itinerary."""
