"""Verification of formulas: proofs of identities, comparisons of numbers, and ledger entries.

Modules that import sympy or flint are imported inside functions only, when an identity is verified.
"""

from __future__ import annotations

from .entry import Entry, Finding, Formula, by_reading, convention, erratum, verified
from .identity import verify
from .verdict import Verdict, agreement, every, holds, no_excess

__all__ = [
    "Entry",
    "Finding",
    "Formula",
    "Verdict",
    "agreement",
    "by_reading",
    "convention",
    "erratum",
    "every",
    "holds",
    "no_excess",
    "verified",
    "verify",
]
