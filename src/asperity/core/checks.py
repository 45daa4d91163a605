"""Checks of arguments: one line where it is used, one clear message when it fails."""

from __future__ import annotations

import os
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError

Floats = NDArray[np.float64]
# What numpy.random.default_rng takes.
Rng: TypeAlias = np.random.Generator | np.random.BitGenerator | np.random.SeedSequence | int | None
# Characters of a value that a message repeats.
SHOWN = 80
# Bytes of a double.
DOUBLE = 8


def numbers(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as float64, finite or not."""
    try:
        array = np.asarray(value)
        if array.dtype.kind in "cSUmMV":
            raise TypeError("of another kind")
        return array.astype(np.float64, copy=False)
    except Exception as reason:  # foreign objects fail in their own way
        raise InputError(f"{name}: expected numbers, got {shortened(value)}") from reason


def finite_array(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as float64, or raise an InputError that names the first entry that is not finite."""
    array = numbers(name, value)
    with np.errstate(over="ignore", invalid="ignore"):
        # a sum with a term that is not finite is not finite; it takes a sixth of the time of a mask
        total = array.sum()
    if np.isfinite(total):
        return array
    bad = ~np.isfinite(array)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        index_text = f" at index {where}" if where else ""
        raise InputError(f"{name}: expected finite numbers, got {array[where]}{index_text} ({int(bad.sum())} such)")
    return array


def finite_number(name: str, value: Any) -> float:
    """Return ``value`` as a finite float."""
    array = finite_array(name, value)
    if array.ndim:
        raise InputError(f"{name}: expected one number, got an array of shape {array.shape}")
    return float(array)


def of_one_shape(**arrays: Floats) -> tuple[Floats, ...]:
    """Return the arrays in their common shape, or raise an InputError that names them.

    Examples
    --------
    >>> of_one_shape(x=np.zeros(3), theta=np.zeros(4))
    Traceback (most recent call last):
    asperity.errors.InputError: x and theta: expected equal shapes, got (3,) and (4,); for all pairs pass x[:, None]
    """
    try:
        return tuple(np.broadcast_arrays(*arrays.values()))
    except ValueError as reason:
        shapes = " and ".join(str(array.shape) for array in arrays.values())
        pairs = f"for all pairs pass {next(iter(arrays))}[:, None]"
        raise InputError(f"{' and '.join(arrays)}: expected equal shapes, got {shapes}; {pairs}") from reason


def instance(name: str, value: object, kind: type, example: str) -> None:
    """Refuse what is not of a kind; the message has an example.

    Examples
    --------
    >>> instance("count", "two", int, "2")
    Traceback (most recent call last):
    asperity.errors.InputError: count: expected an int such as 2, got 'two'
    """
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOUaeiou" else "a"
        raise InputError(f"{name}: expected {article} {kind.__name__} such as {example}, got {value!r}")


def positive_number(name: str, value: Any) -> float:
    """Return ``value`` as a finite float greater than zero."""
    number = finite_number(name, value)
    if number <= 0.0:
        raise InputError(f"{name}: expected a number greater than 0, got {number!r}")
    return number


def number_between(name: str, value: Any, low: float, high: float, *, closed: str = "") -> float:
    """Return ``value`` in (low, high); ``closed`` holds ``"low"`` and/or ``"high"`` for ends that are allowed."""
    number = finite_number(name, value)
    inside_low = number >= low if "low" in closed else number > low
    inside_high = number <= high if "high" in closed else number < high
    if not (inside_low and inside_high):
        left, right = "[" if "low" in closed else "(", "]" if "high" in closed else ")"
        raise InputError(f"{name}: expected a number in {left}{low:g}, {high:g}{right}, got {number!r}")
    return number


def whole_number(name: str, value: Any, low: int, *, most: int | None = None) -> int:
    """Return ``value`` as an int of at least ``low``, and at most ``most``."""
    # numpy counts spans of time among its integers
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))
    if not whole or value < low or (most is not None and value > most):
        allowed = f"of at least {low}" if most is None else f"from {low} to {most}"
        raise InputError(f"{name}: expected a whole number {allowed}, got {shortened(value)}")
    return int(value)


def shortened(value: object) -> str:
    """The repr of a value, or its beginning where it is long.

    Examples
    --------
    >>> shortened([1.0, 2.0]), len(shortened(10**400)), shortened(10**9999)
    ('[1.0, 2.0]', 83, 'a value of type int')
    """
    try:
        text = repr(value)
    except Exception:  # of foreign objects, and of integers with thousands of digits
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def check_memory(name: str, what: str, numbers: int) -> None:
    """Refuse an array of more doubles than this machine's memory holds, before it is asked for.

    Examples
    --------
    >>> check_memory("basis", "its matrix", 10**15)
    Traceback (most recent call last):
    asperity.errors.InputError: basis: its matrix takes 8e+06 GB of memory, more than there is; take a smaller one
    """
    if DOUBLE * numbers > os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"):
        size = f"{DOUBLE * numbers / 1e9:.2g}" if numbers < 10**30 else "too many"
        raise InputError(f"{name}: {what} takes {size} GB of memory, more than there is; take a smaller one")


def angles(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as angles in radians, every one in the open interval (0, pi)."""
    array = numbers(name, value)
    # NaN is the least and the largest number of an array that has it
    if array.size and not (array.min() > 0.0 and array.max() < np.pi):
        finite_array(name, array)
        bad = ~((array > 0.0) & (array < np.pi))
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        index_text = f" at index {where}" if where else ""
        raise InputError(
            f"{name}: expected angles in the open interval (0, pi), in radians, got {float(array[where])!r}"
            f"{index_text} "
            f"({int(bad.sum())} such)"
        )
    return array


def generator(rng: Rng, default: int | None = None) -> np.random.Generator:
    """The source of random numbers that ``rng`` means: a Generator as it is, or a new one.

    Parameters
    ----------
    rng : None, int or Generator
        What numpy.random.default_rng takes (SPEC 7).
    default : int, optional
        The seed that None stands for, where results repeat by default; else None is a fresh seed.

    Examples
    --------
    >>> generator(3).random() == np.random.default_rng(3).random() == generator(None, 3).random()
    True
    """
    if isinstance(rng, np.random.Generator):
        return rng
    try:
        if isinstance(rng, (bool, np.random.RandomState)):
            raise TypeError("it is of another kind")
        return np.random.default_rng(default if rng is None else rng)
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"rng: expected None, a whole number of at least 0 or a numpy.random.Generator, got {shortened(rng)}"
        ) from reason


def frozen(array: ArrayLike) -> Floats:
    """Return a read-only float64 copy."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy
