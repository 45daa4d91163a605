"""Measurements of the library: error against run time, extreme cases, regressions."""
