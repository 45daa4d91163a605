"""The compiled march along entry points, changes of itinerary, and Gauss rules between them."""
