"""Verification of formulas: proofs and refutations of identities, and comparisons of numbers.

Modules that import sympy or flint are imported inside functions only, when an identity is verified.
"""

from __future__ import annotations

from .identity import verify
from .verdict import Verdict, agreement, every, holds, no_excess

__all__ = ["Verdict", "agreement", "every", "holds", "no_excess", "verify"]
