"""The tables of a wall for the compiled loops, their tolerances, and the plan of a trace."""
