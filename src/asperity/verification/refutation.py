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
NEGLIGIBLE = mpmath.mpf(10) ** (-DIGITS // 2)
SHOWN = 20


def refute_equality(left: Any, right: Any, points: Iterable[dict[Any, Any]]) -> Verdict | None:
    """Return a refutation at the first of the points where left and right differ, or None."""
    symbols = sorted(left.free_symbols | right.free_symbols, key=str)
    try:
        sides = [sp.lambdify(symbols, side, "mpmath") for side in (left, right)]
    except NotImplementedError:
        # an integral without bounds, or another expression without a value
        return None
    for point in points:
        rationals = [point[symbol] for symbol in symbols]
        a, b = (_value(side, rationals, DIGITS) for side in sides)
        if a is None or b is None or abs(a - b) <= NEGLIGIBLE * max(abs(a), abs(b), 1):
            continue
        one, other = enclose(left, point), enclose(right, point)
        if one is None or other is None:
            again = [_value(side, rationals, 2 * DIGITS) for side in sides]
            if None in again or abs(again[0] - a) + abs(again[1] - b) > NEGLIGIBLE * abs(a - b):
                continue
            how = f"{DIGITS} and {2 * DIGITS} digits"
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


def _value(side: Any, rationals: list[Any], digits: int) -> Any:
    """The value at a rational point, computed to so many digits; None where it is undefined or not a number."""
    with mpmath.workdps(digits):
        try:
            value = side(*(mpmath.mpf(int(number.p)) / int(number.q) for number in rationals))
            return value if mpmath.isfinite(value) else None
        except (ArithmeticError, ValueError, TypeError, NameError, AttributeError):
            # a pole, or a function that mpmath does not know
            return None
