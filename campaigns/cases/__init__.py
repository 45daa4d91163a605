"""What campaigns and tests judge: random walls and hollows, calls, scenes without an optimisation, known mutants."""
