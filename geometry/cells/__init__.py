"""The cell of a periodic wall: its hollows and their shapes, its validity and symmetry, profiles and files."""
