"""One row of the stability report."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

ExtremeVerdict = Literal["met", "degraded as reported", "refused", "not met", "timed out"]


@dataclass(frozen=True)
class ExtremeRow:
    """The result of one extreme case.

    Attributes
    ----------
    case : str
    reference : str
        The reference of the error.
    error, allowed : float
        Largest error and its limit, in ``unit``.
    unit : str
        "eps x condition" for rays: rounding errors times the derivative of the exact map and the number of hits.
    reported : float
        The library's own error estimate in ``unit``; 0 if it has none.
    counts : mapping of str to int
        Rays by status; empty if no ray is traced.
    flagged_rightly : int
        Number of rays that did not escape and whose exact result agrees.
    note : str
    seconds : float
    ended : str
        "", or the reason why there is no error: "refused", "timed out", "failed".

    Examples
    --------
    >>> ExtremeRow("gap of 1e-12", "g", 1e-16, 1e-15).verdict, ExtremeRow("gap", "g", 1e-3, 1e-15, reported=0.1).verdict
    ('met', 'degraded as reported')
    """

    case: str
    reference: str
    error: float = 0.0
    allowed: float = 0.0
    unit: str = ""
    reported: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)
    flagged_rightly: int = 0
    note: str = ""
    seconds: float = 0.0
    ended: str = ""

    @property
    def verdict(self) -> ExtremeVerdict:
        """Whether the case meets its limit, reports that it does not, is refused, or fails."""
        if self.ended == "timed out":
            return "timed out"
        if self.ended:
            return "refused" if self.ended == "refused" else "not met"
        if not self.error <= max(self.allowed, self.reported):
            return "not met"
        flagged = sum(number for status, number in self.counts.items() if status != "escaped")
        return "degraded as reported" if self.error > self.allowed or flagged > self.flagged_rightly else "met"


@cache
def stored(file: Path) -> dict[str, Any]:
    """The table in a JSON file, read once in each process."""
    table: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return table
