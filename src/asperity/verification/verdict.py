"""Verdicts of checks, with evidence, and verdicts from comparisons of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from textwrap import shorten
from types import MappingProxyType
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.estimates import LONGEST, Summary

Answer = Literal["proved", "agrees", "refuted", "undecided"]
# from the answer that decides a conjunction first to the answer that decides it last
_WEIGHT: dict[Answer, int] = {"refuted": 0, "undecided": 1, "agrees": 2, "proved": 3}


@dataclass(frozen=True, repr=False)
class Verdict(Summary):
    """The answer of a check, with its evidence.

    Parameters
    ----------
    answer : {"proved", "agrees", "refuted", "undecided"}
            ``"proved"``: by an exact derivation. ``"agrees"``: by numbers, which can support a formula but not prove
            it. ``"refuted"``: there is a counterexample. ``"undecided"``: neither a proof nor a counterexample was
            found.
    evidence : str
        How the answer was found, in words and numbers.
    counterexample : mapping from str to values, optional
            The point at which a refuted formula fails. `verify` gives exact numbers as text, such as ``8/3`` or
            ``pi/2``.
    values : tuple of str, optional
        Both sides at the counterexample.

    Notes
    -----
    A verdict has no truth value, and ``bool(verdict)`` raises: ``if verify(...)`` would count *undecided* as one of the
    two. Use `answer` or `stands`.

    Examples
    --------
    >>> Verdict("agrees", "largest defect 1e-16").stands
    True
    """

    answer: Answer
    evidence: str
    counterexample: Mapping[str, Any] = field(default_factory=dict)
    values: tuple[str, str] | None = None

    def _facts(self) -> dict[str, object]:
        why = shorten(self.evidence, LONGEST) if self.answer == "undecided" else None
        return {**super()._facts(), "evidence": why}

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


def agreement(found: ArrayLike, expected: ArrayLike, allowed: float, **where: ArrayLike) -> Verdict:
    """Whether two arrays agree within ``allowed`` everywhere.

    Parameters
    ----------
    found, expected : array_like
        Values of the formula, and of an independent computation; they broadcast.
    allowed : float
        The largest difference that rounding, sampling or the order of an approximation explains.
    **where : array_like
        The points, by name, broadcast with the values; the worst point is the counterexample.

    Examples
    --------
    >>> agreement([1.0, 2.0], [1.0, 2.5], 1e-12, x=[0.1, 0.2]).counterexample["x"]
    0.2
    """
    left, right = np.broadcast_arrays(np.asarray(found, dtype=float), np.asarray(expected, dtype=float))
    return _compared(left, right, np.abs(left - right), allowed, f"largest difference {{worst}} of {left.size}", where)


def no_excess(small: ArrayLike, large: ArrayLike, allowed: float = 0.0, **where: ArrayLike) -> Verdict:
    """Whether ``small <= large + allowed`` everywhere.

    Examples
    --------
    >>> no_excess([1.0, 3.0], 2.0, x=[0.1, 0.2]).answer
    'refuted'
    """
    left, right = np.broadcast_arrays(np.asarray(small, dtype=float), np.asarray(large, dtype=float))
    return _compared(left, right, left - right, allowed, f"largest excess {{worst}} in {left.size} trials", where)


def holds(condition: ArrayLike, of_what: str, **where: ArrayLike) -> Verdict:
    """Whether a condition holds at every point.

    Examples
    --------
    >>> holds([True, True], "orders of points").evidence
    '2 of 2 orders of points'
    """
    right = np.asarray(condition, dtype=bool)
    evidence = f"{int(right.sum())} of {right.size} {of_what}"
    if right.all():
        return Verdict("agrees", evidence)
    return Verdict(
        "refuted", evidence, _point(np.unravel_index(int(np.argmin(right)), right.shape), right.shape, where)
    )


def _compared(
    left: np.ndarray, right: np.ndarray, defect: np.ndarray, allowed: float, words: str, where: dict[str, ArrayLike]
) -> Verdict:
    broken = np.isnan(defect)
    index = np.unravel_index(int(np.argmax(np.where(broken, np.inf, defect))), defect.shape)
    point = _point(index, defect.shape, where)
    if broken.any():
        # NaN neither supports nor refutes the formula
        return Verdict("undecided", f"not a number at {int(broken.sum())} of {defect.size} points", point)
    evidence = words.format(worst=f"{float(defect[index]):.2g}") + f", allowed {allowed:.2g}"
    if defect[index] <= allowed:
        return Verdict("agrees", evidence)
    return Verdict("refuted", evidence, point, (f"{float(left[index]):.6g}", f"{float(right[index]):.6g}"))


def _point(index: tuple[np.intp, ...], shape: tuple[int, ...], where: dict[str, ArrayLike]) -> dict[str, float]:
    return {name: float(np.broadcast_to(np.asarray(value), shape)[index]) for name, value in where.items()}
