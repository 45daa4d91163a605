"""The ledger of formulas: its index, its text, and its entries on the plane, the disk and the proof."""

from .entry import Entry, Finding, by_reading, entries, findings, row, selected

__all__ = [
    "Entry",
    "Finding",
    "by_reading",
    "entries",
    "findings",
    "row",
    "selected",
]
