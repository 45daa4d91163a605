"""A total time shared among parts that come one after the other, so that it is kept whatever the parts do."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass
class TimePlan:
    """Shares ``seconds``, counted from its making, among ``parts``.

    If no part takes more than its share the sum is at most ``seconds``: a share is never more than what is left, and
    what a part leaves the later ones have.

    Examples
    --------
    >>> plan = TimePlan(10.0, 2)
    >>> round(plan.next_share())
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
        """Seconds that are left, at least 0."""
        return max(self.seconds - (time.monotonic() - self._begun), 0.0)

    def next_share(self, weight: float = 1.0) -> float:
        """Seconds that the next part may take, if it counts as ``weight`` of the later ones."""
        share = weight / (weight + self._left - 1) * self.remaining
        self._left = max(self._left - 1, 1)
        return share
