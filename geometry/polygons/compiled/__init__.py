"""The compiled function that splits beams, and its tables."""
