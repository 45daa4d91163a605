"""Error against run time: problems, measured runs, fitted orders, and the report."""
