"""The essential spectrum: what grazing rays, ideal parts and straight pieces keep of it."""
