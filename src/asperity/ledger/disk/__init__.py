"""Entries of the ledger on the disk: model, frame, impact and collision."""
