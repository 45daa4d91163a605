"""The extreme cases of the stability report."""
