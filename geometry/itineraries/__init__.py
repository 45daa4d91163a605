"""The itineraries of rays at one incoming angle: entry points at which they change, and Gauss nodes between them."""
