"""The disk: masses and frame, rolling, satellites, charts, and the same formulas as sympy objects."""
