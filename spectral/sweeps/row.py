"""One row of the table of a sweep: a quantity at a point."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...core.estimates import Estimate, finite
from ...core.kinds import explained_class
from .points import Point, Value

COLUMNS = ("quantity", "value", "error", "kind", "verdict", "method", "seconds", "version", "message")


@explained_class
@dataclass(frozen=True)
class SweepRow:
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

    @staticmethod
    def of(point: Point, quantity: str, found: Estimate, verdict: str, seconds: float, version: str) -> SweepRow:
        """The row of an estimate."""
        return SweepRow(
            point, quantity, found.value, found.error, found.kind, verdict, found.method, seconds, version, ""
        )

    def cells(self) -> list[Any]:
        """What is in the columns ``quantity`` to ``message``."""
        return [getattr(self, name) for name in COLUMNS]

    def as_list(self) -> list[Any]:
        """The point and the columns as plain JSON values; an infinite error is None beside a value."""
        return [list(self.point.values()), *map(_plain, self.cells())]

    @staticmethod
    def of_list(names: Sequence[str], cells: Sequence[Any]) -> SweepRow:
        """The row that `as_list` gave."""
        values, quantity, value, error, *rest = cells
        known = math.inf if value is not None and error is None else error
        return SweepRow(dict(zip(names, values, strict=True)), quantity, value, known, *rest)


def _plain(cell: Any) -> Any:
    return finite(cell) if isinstance(cell, float) else cell
