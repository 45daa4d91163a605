"""The rays into polygonal hollows, divided exactly into beams of equal itinerary."""
