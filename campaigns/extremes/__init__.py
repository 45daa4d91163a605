"""Stiff and extreme cases: each is right, or says that it is not."""
