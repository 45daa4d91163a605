"""Hollows with a channel at the opening: integrals of their laws over the angles near grazing."""
