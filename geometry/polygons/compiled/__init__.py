"""The compiled loop that splits beams, and its tables."""
