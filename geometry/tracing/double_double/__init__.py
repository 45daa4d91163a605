"""Numbers of two doubles in compiled code, and what is computed with them alone."""
