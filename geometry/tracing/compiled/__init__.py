"""The compiled loop of the tracer in double precision: rays, and how each primitive is hit."""
