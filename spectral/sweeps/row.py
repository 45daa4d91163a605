"""One row of the table of a sweep: a quantity at a point."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...core.checks import finite_number, number_between
from ...core.estimates import Estimate, Summary, finite, shown
from .points import Value

COLUMNS = ("quantity", "value", "error", "kind", "verdict", "method", "seconds", "version", "message")
# What the quantities are measured in; all others are pure numbers.
UNITS = {"relaxation_time": "collisions"}


@dataclass(frozen=True, repr=False)
class SweepRow(Summary):
    """One quantity at one point.

    Attributes
    ----------
    point : mapping of str to number or text
        The parameters.
    quantity : str
    value, error : float or None
        None where the quantity was refused; an error that is not known is ``inf``.
    kind : {"bound", "estimate", ""}
    verdict : str
        On the gap behind the quantity; empty where there is none.
    method : str
    seconds : float
        Of the computation; for several numbers of one computation, of all.
    version : str
        Of asperity.
    message : str
        Why there is no value, or empty.
    """

    point: Mapping[str, Value]
    quantity: str
    value: float | None
    error: float | None
    kind: str
    verdict: str
    method: str
    seconds: float
    version: str
    message: str
    _show = "kind verdict message"

    def _headline(self) -> str:
        return f"{self.quantity} {self.in_words()}"

    def in_words(self) -> str:
        """The value with its error, and the point."""
        number = "refused" if self.value is None else self._fact("value")
        return f"{number} at {', '.join(map(shown, self.point.values()))}"

    def cells(self) -> list[Any]:
        """What is in the columns ``quantity`` to ``message``."""
        return [getattr(self, name) for name in COLUMNS]

    def as_list(self) -> list[Any]:
        """The point and the columns as plain JSON values; an infinite error is None beside a value."""
        return [
            list(self.point.values()),
            *(finite(cell) if isinstance(cell, float) else cell for cell in self.cells()),
        ]

    @staticmethod
    def of_list(names: Sequence[str], cells: Sequence[Any]) -> SweepRow:
        """The row that `as_list` gave."""
        values, quantity, value, error, *rest = cells
        known = math.inf if value is not None and error is None else error
        return SweepRow(dict(zip(names, values, strict=True)), quantity, value, known, *rest)

    def check(self, quantity: str) -> None:
        """Refuse what is not a row of this quantity.

        Raises
        ------
        ValueError
            InputErrors among them.
        """
        number_between("seconds", self.seconds, 0.0, math.inf, closed="low")
        texts = self.kind, self.verdict, self.method, self.version, self.message
        if self.quantity != quantity or not all(isinstance(text, str) for text in texts):
            raise ValueError(f"expected a row of {quantity!r}, got {self!r}")
        if self.value is not None:
            finite_number("value", self.value)
            if not isinstance(self.error, float):
                raise ValueError(f"error: expected a number, got {self.error!r}")
            Estimate(self.value, self.error, self.kind, self.method)  # type: ignore[arg-type]
        elif self.error is not None or not self.message:
            raise ValueError(f"expected a reason why {quantity!r} has no value")
