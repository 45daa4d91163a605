"""The compiled search for changes of itinerary, and the nested rules between them."""
