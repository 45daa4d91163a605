"""Error against run time: problems, runs, orders, and the report."""
