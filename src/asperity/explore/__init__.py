"""A page in the browser on which a wall is dragged, and its law, spectrum and collision follow."""
