"""The tables of a wall for the compiled functions, their tolerances, and the plan of a trace."""
