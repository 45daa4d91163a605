"""The compiled loop of the tracer in double precision: the flight of a ray, and its hit on each kind of piece."""
