"""Tables and named tuples in compiled functions."""
