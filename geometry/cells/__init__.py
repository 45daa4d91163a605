"""The cell of a periodic wall: its hollows and their shapes, validity, symmetry, measured profiles and wall files."""
