"""The edge of the essential spectrum of a law, from grazing rays, ideal parts and straight pieces."""
