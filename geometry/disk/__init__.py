"""The disk: its masses and frame, rolling, satellites and charts, and the same formulas as sympy objects."""
