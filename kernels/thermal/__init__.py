"""Walls that move: a plate on a spring at a temperature, and the exchange of energy with it."""
