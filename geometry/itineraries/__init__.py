"""The itineraries of rays at one incoming angle: the entry points at which they change, and the nodes between them."""
