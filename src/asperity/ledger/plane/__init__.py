"""Entries of the ledger on the reflection of a point in the plane."""
