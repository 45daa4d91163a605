"""The library's own measurements: error against run time, extreme cases, what scenes leave out, regressions."""
