"""The ledger of formulas: its index, its text, and the entries in three folders."""

from .index import entries, findings, selected

__all__ = ["entries", "findings", "selected"]
