"""Verdicts from numbers: how far two computations are apart, and whether an inequality was ever broken."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .verdict import Verdict


def agreement(found: ArrayLike, expected: ArrayLike, allowed: float, **where: ArrayLike) -> Verdict:
    """Whether two arrays agree within ``allowed``, everywhere.

    Parameters
    ----------
    found, expected : array_like
        What the formula gives, and what an independent computation gives; they broadcast.
    allowed : float
        The largest difference that rounding, sampling or the order of an approximation can explain.
    **where : array_like
        The places, by name, broadcast with the values: the worst of them is the counterexample.

    Examples
    --------
    >>> agreement([1.0, 2.0], [1.0, 2.5], 1e-12, x=[0.1, 0.2]).counterexample["x"]
    0.2
    """
    left, right = np.broadcast_arrays(np.asarray(found, dtype=float), np.asarray(expected, dtype=float))
    return _judged(left, right, np.abs(left - right), allowed, f"largest difference {{worst}} of {left.size}", where)


def no_excess(small: ArrayLike, large: ArrayLike, allowed: float = 0.0, **where: ArrayLike) -> Verdict:
    """Whether ``small <= large + allowed`` everywhere: a search that tries to break an inequality.

    Examples
    --------
    >>> no_excess([1.0, 3.0], 2.0, x=[0.1, 0.2]).answer
    'refuted'
    """
    left, right = np.broadcast_arrays(np.asarray(small, dtype=float), np.asarray(large, dtype=float))
    return _judged(left, right, left - right, allowed, f"largest excess {{worst}} in {left.size} trials", where)


def holds(condition: ArrayLike, of_what: str, **where: ArrayLike) -> Verdict:
    """Whether a condition holds at every place.

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
        "refuted", evidence, _place(np.unravel_index(int(np.argmin(right)), right.shape), right.shape, where)
    )


def _judged(
    left: np.ndarray, right: np.ndarray, defect: np.ndarray, allowed: float, words: str, where: dict[str, ArrayLike]
) -> Verdict:
    broken = np.isnan(defect)
    index = np.unravel_index(int(np.argmax(np.where(broken, np.inf, defect))), defect.shape)
    place = _place(index, defect.shape, where)
    if broken.any():
        # neither for the formula nor against it
        return Verdict("undecided", f"not a number at {int(broken.sum())} of {defect.size} places", place)
    evidence = words.format(worst=f"{float(defect[index]):.2g}") + f", allowed {allowed:.2g}"
    if defect[index] <= allowed:
        return Verdict("agrees", evidence)
    return Verdict("refuted", evidence, place, (f"{float(left[index]):.6g}", f"{float(right[index]):.6g}"))


def _place(index: tuple[np.intp, ...], shape: tuple[int, ...], where: dict[str, ArrayLike]) -> dict[str, float]:
    return {name: float(np.broadcast_to(np.asarray(value), shape)[index]) for name, value in where.items()}
