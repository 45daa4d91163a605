"""The ledger of formulas: its index, its text, and its entries on the plane, the disk and the proof."""

from .entry import Entry, Finding, Formula, by_reading, convention, erratum, verified
from .index import entries, findings, selected

__all__ = [
    "Entry",
    "Finding",
    "Formula",
    "by_reading",
    "convention",
    "entries",
    "erratum",
    "findings",
    "selected",
    "verified",
]
