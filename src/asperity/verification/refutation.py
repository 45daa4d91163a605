"""Counterexamples: exact points at which disjoint balls contain the two sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from flint import ctx

from .balls import Unclear, Undefined, Value, evaluate
from .domain import Domain
from .verdict import Verdict

SEED = 0
# Increasing bits of evaluation: MOST_BITS at the first point only, the third of BITS at the first CLOSE_LOOKS points.
BITS = (64, 256, 2048)
CLOSE_LOOKS = 4
MOST_BITS = 1 << 15
SHOWN = 20
# Factor on the number of points if a side is often undefined.
MORE = 4


@dataclass
class Search:
    """The search for a counterexample to a relation.

    Attributes
    ----------
    tried : int
        Number of points at which both sides were evaluated.
    defined : int
        Number of these points at which both sides are certainly defined.
    undefined : int
        Number of these points at which one side is certainly undefined.
    """

    left: Any
    right: Any
    relation: str
    domain: Domain
    tried: int = 0
    defined: int = 0
    undefined: int = 0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(SEED)

    def refutation(self, part: Domain, count: int, until_defined: bool = False) -> Verdict | None:
        """The first counterexample among ``count`` points of a part, or up to the first point where both are
        defined."""
        before = self.defined
        for point in part.points(self._rng, count, MORE * count):
            found = self._at(point)
            if found is not None or self.defined - before >= (1 if until_defined else count):
                return found
        return None

    def _at(self, point: dict[Any, Any]) -> Verdict | None:
        self.tried += 1
        bits_to_try = (*BITS, MOST_BITS) if self.defined == 0 else BITS if self.defined < CLOSE_LOOKS else BITS[:2]
        seen = False
        for bits in bits_to_try:
            try:
                left, right = evaluate(self.left, point, bits), evaluate(self.right, point, bits)
            except Undefined:
                self.undefined += 1
                return None
            except Unclear:
                continue
            if not seen:
                seen = True
                self.defined += 1
            if self._is_broken(left, right):
                return Verdict(
                    "refuted",
                    "counterexample, by ball arithmetic",
                    {str(symbol): str(value) for symbol, value in point.items()},
                    self._shown(point, bits),
                )
            if left.exact is not None and left.exact == right.exact:
                break
        return None

    def _is_broken(self, left: Value, right: Value) -> bool:
        if left.exact is not None and right.exact is not None and (left.exact - right.exact).is_Rational:
            sign = int(sp.sign(left.exact - right.exact))
        elif left.ball > right.ball or left.ball < right.ball:
            sign = 1 if left.ball > right.ball else -1
        else:
            return False
        return sign != 0 if self.relation == "==" else sign > 0 if self.relation == "<=" else sign >= 0

    def _shown(self, point: dict[Any, Any], bits: int) -> tuple[str, str]:
        """Both values, with enough digits to distinguish them."""
        digits = SHOWN
        while True:
            with ctx.workprec(bits):
                sides = [evaluate(side, point, bits).ball.mid() for side in (self.left, self.right)]
                left, right = (side.str(digits, radius=False) for side in sides)
            # equal sides refute a strict inequality
            if left != right or self.relation == "<" or bits >= MOST_BITS:
                return left, right
            bits, digits = 2 * bits, 2 * digits
