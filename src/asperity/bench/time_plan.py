"""The division of run time among the parts of a run."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass
class TimePlan:
    """Divides ``seconds``, counted from construction, among ``parts``.

    If no part exceeds its fraction, the sum is at most ``seconds``. Later parts divide the time that earlier parts
    leave.

    Examples
    --------
    >>> plan = TimePlan(10.0, 2)
    >>> round(plan.next_fraction())
    5
    """

    seconds: float
    parts: int
    _begun: float = field(default_factory=lambda: time.monotonic(), init=False)
    _left: int = field(init=False)

    def __post_init__(self) -> None:
        self._left = self.parts

    @property
    def remaining(self) -> float:
        """Remaining seconds, at least 0."""
        return max(self.seconds - (time.monotonic() - self._begun), 0.0)

    def next_fraction(self, weight: float = 1.0) -> float:
        """Seconds for the next part, which counts as ``weight`` later parts."""
        fraction = weight / (weight + self._left - 1) * self.remaining
        self._left = max(self._left - 1, 1)
        return fraction
