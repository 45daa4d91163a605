"""Exact derivations: a difference is carried to a polynomial normal form, where zero is zero.

Imported only by functions, because it imports sympy.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from .domain import Domain


def derive_equality(left: Any, right: Any, domain: Domain) -> str | None:
    """Name the route by which left - right was derived to vanish on the domain, or return None."""
    difference = left - right
    if sp.expand(difference) == 0:
        return "expansion"
    if _normal_form(difference, domain) == 0:
        return "simplification"
    return None


def _normal_form(difference: Any, domain: Domain) -> Any:
    return sp.simplify(difference)
