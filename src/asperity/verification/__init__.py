"""Verification of formulas: identities by proof, numbers by comparison, and the entry that holds both.

Names are imported when they are first used; sympy and flint only when an identity is asked about.
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
