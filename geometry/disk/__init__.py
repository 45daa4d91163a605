"""The disk: its masses and frame, how it rolls, its satellites, its charts, and the same in symbols."""
