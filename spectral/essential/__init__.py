"""The essential spectrum of a law: its edge, from grazing rays, ideal parts and straight pieces."""
