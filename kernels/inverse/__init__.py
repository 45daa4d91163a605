"""Hollows for wanted laws."""
