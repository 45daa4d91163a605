"""The compiled functions of the tracer in double precision: the path of a ray and its hits on all kinds of pieces."""
