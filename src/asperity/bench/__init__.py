"""Measurements of the library: error against run time, extreme cases, savings of the tracer, regressions."""
