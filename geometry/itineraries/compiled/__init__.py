"""The compiled search for changes of itinerary, and the Gauss rules between them."""
