"""The ledger of formulas: its index, its text, and its entries on the plane, the disk and the proof."""

from .index import entries, findings, selected

__all__ = ["entries", "findings", "selected"]
