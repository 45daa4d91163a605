"""Counterexamples: rational points at which intervals that contain both sides are disjoint.

Imported only by functions, because it imports sympy and mpmath.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mpmath
import sympy as sp

from .enclosure import enclose
from .verdict import Verdict

# Both sides are first evaluated to this many digits; a difference beyond half of them is worth enclosing.
DIGITS = 40
SHOWN = 20


def refute_equality(left: Any, right: Any, points: Iterable[dict[Any, Any]]) -> Verdict | None:
    """Return a refutation at the first of the points where left and right differ, or None."""
    for point in points:
        a, b = _value(left, point), _value(right, point)
        if a is None or b is None or abs(a - b) <= mpmath.mpf(10) ** (-DIGITS // 2) * max(abs(a), abs(b), 1):
            continue
        one, other = enclose(left, point), enclose(right, point)
        if one is None or other is None:
            how = f"{DIGITS} and {2 * DIGITS} digits"
            again = _value(left, point, 2 * DIGITS), _value(right, point, 2 * DIGITS)
            slack = mpmath.mpf(10) ** (-DIGITS // 2)
            if None in again or abs(again[0] - a) + abs(again[1] - b) > slack * abs(a - b):
                continue
        elif one.b < other.a or other.b < one.a:
            how = "interval arithmetic"
        else:
            continue
        return Verdict(
            "refuted",
            f"counterexample, by {how}",
            {str(symbol): str(value) for symbol, value in point.items()},
            (mpmath.nstr(a, SHOWN), mpmath.nstr(b, SHOWN)),
        )
    return None


def _value(expression: Any, point: dict[Any, Any], digits: int = DIGITS) -> Any:
    try:
        value = sp.N(expression.subs(point), digits, maxn=4 * digits, strict=True)
    except (sp.core.evalf.PrecisionExhausted, ZeroDivisionError, ValueError, NotImplementedError):
        return None
    if not value.is_number or value.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
        return None
    with mpmath.workdps(digits):
        return mpmath.mpmathify(value)
