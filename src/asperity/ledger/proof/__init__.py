"""Entries of the ledger on the proof of the limit theorem."""
