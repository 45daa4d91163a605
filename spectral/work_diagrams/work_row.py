"""One measurement: a method at one budget, its errors and its times, or why there are none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, get_args

from ...errors import InputError

RowStatus = Literal["done", "failed", "timed out", "left out"]


@dataclass(frozen=True)
class WorkRow:
    """One row of a report on error against run time.

    Attributes
    ----------
    method : str
    budget : float
    status : {"done", "failed", "timed out", "left out"}
        ``"left out"``: a smaller budget had used up the time.
    errors : mapping of str to float
        By norm. Of a random method the root mean squares over the repeats.
    seconds : tuple of float
        Wall time of every repeat.
    reported : float or None
        The error that the method itself reports, where it reports one.
    note : str
        How the value was made, in the method's words; or the reason why there is none.

    Examples
    --------
    >>> row = WorkRow("midpoint", 8, "done", {"absolute": 1e-3}, (0.2, 0.1, 0.4))
    >>> row.least, round(row.spread, 12)
    (0.1, 3.0)
    """

    method: str
    budget: float
    status: RowStatus
    errors: Mapping[str, float] = field(default_factory=dict)
    seconds: tuple[float, ...] = ()
    reported: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if self.status not in get_args(RowStatus):
            raise InputError(f"status: expected one of {', '.join(get_args(RowStatus))}, got {self.status!r}")
        object.__setattr__(self, "budget", float(self.budget))
        object.__setattr__(self, "errors", MappingProxyType(dict(self.errors)))
        object.__setattr__(self, "seconds", tuple(map(float, self.seconds)))

    @property
    def is_done(self) -> bool:
        """Whether there is a value."""
        return self.status == "done"

    @property
    def least(self) -> float:
        """Least time of the repeats; infinite without one."""
        return min(self.seconds, default=float("inf"))

    @property
    def spread(self) -> float:
        """Greatest minus least time of the repeats as a share of the least."""
        return (max(self.seconds) - self.least) / self.least if self.seconds else 0.0

    def as_dict(self) -> dict[str, Any]:
        """What JSON holds."""
        plain = {name: getattr(self, name) for name in ("method", "budget", "status", "reported", "note")}
        return {**plain, "errors": dict(self.errors), "seconds": list(self.seconds)}

    @classmethod
    def of_dict(cls, data: Mapping[str, Any]) -> WorkRow:
        """The row that `as_dict` gave."""
        return cls(**{**data, "seconds": tuple(data["seconds"])})
