"""The library's own measurements: error against run time, extreme cases, savings of the tracer, regressions."""
