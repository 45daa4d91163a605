"""What a check answers: never a bare yes or no."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, NoReturn

from ..errors import InputError

Answer = Literal["proved", "agrees", "refuted", "undecided"]

# from the answer that decides a conjunction to the one that decides it least
_WEIGHT: dict[Answer, int] = {"refuted": 0, "undecided": 1, "agrees": 2, "proved": 3}


@dataclass(frozen=True)
class Verdict:
    """The answer of a check, with its evidence.

    Parameters
    ----------
    answer : {"proved", "agrees", "refuted", "undecided"}
        ``"proved"``: by an exact derivation. ``"agrees"``: by numbers, which can support a formula but not prove it.
        ``"refuted"``: there is a counterexample. ``"undecided"``: neither a proof nor a counterexample was found.
    evidence : str
        How the answer was found, in words and numbers.
    counterexample : mapping from str to values, optional
        The point at which a refuted formula fails; of `verify` exact numbers as text, such as ``8/3`` or ``pi/2``.
    values : tuple of str, optional
        Both sides at the counterexample.

    Notes
    -----
    A verdict has no truth value: ``if verify(...)`` would read *undecided* as one or the other, so it raises. Ask for
    `answer`, or for `stands`.

    Examples
    --------
    >>> Verdict("agrees", "largest defect 1e-16").stands
    True
    """

    answer: Answer
    evidence: str
    counterexample: Mapping[str, Any] = field(default_factory=dict)
    values: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        if self.answer not in _WEIGHT:
            raise InputError(f"answer: expected one of {', '.join(_WEIGHT)}, got {self.answer!r}")
        object.__setattr__(self, "counterexample", MappingProxyType(dict(self.counterexample)))

    def __bool__(self) -> NoReturn:
        raise InputError(f"a verdict is not true or false but {self.answer!r}: ask for .answer, or for .stands")

    @property
    def stands(self) -> bool:
        """Whether the formula was proved or agrees with the numbers."""
        return self.answer in ("proved", "agrees")

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value}" for name, value in self.counterexample.items())
        sides = f": {self.values[0]} against {self.values[1]}" if self.values else ""
        return f"{self.answer} ({self.evidence})" + (f" at {where}{sides}" if where else sides)


def every(*verdicts: Verdict) -> Verdict:
    """The verdict on a conjunction: refuted if one is, proved only if all are.

    Examples
    --------
    >>> every(Verdict("proved", "algebra"), Verdict("agrees", "defect 1e-16")).answer
    'agrees'
    """
    if not verdicts:
        raise InputError("every: expected at least one verdict")
    first = min(verdicts, key=lambda verdict: _WEIGHT[verdict.answer])
    if not first.stands:
        return first
    evidence = "; ".join(dict.fromkeys(verdict.evidence for verdict in verdicts))
    return Verdict(first.answer, evidence)
