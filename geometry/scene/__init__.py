"""What the tracer reads of a wall: tables of its pieces, the plan of what is left out, and tolerances."""
