"""Odd arguments for every public callable and method of the rooms, and odd operands for every operator.

Each call is a good one with one argument replaced: by the same numbers in another kind of array (the answer must be the
same one, or an error), by what has no meaning as numbers (an error), or by other numbers (an answer without NaN, or an
error), or by an object of another kind (an answer or an error). An error is an InputError, elsewhere than in
constructors and the functions of the first pages also a TypeError or ValueError. A call that ends the process, or does
not come back, fails.
"""

from __future__ import annotations

import contextlib
import inspect
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from asperity import kernels as ker
from asperity.errors import AsperityError
from asperity.kernels.bases.measure import AngularMeasure
from asperity.kernels.collisions.collision_law import VelocityLaw
from campaigns.cases import public_calls
from campaigns.engine import Campaign, Judged

SECONDS = 60.0
SAME, REFUSED, OTHER, ODD = "same numbers", "no numbers", "other numbers", "odd objects"
# Arguments that the object at hand does not need, a text, heights, of which masked ones count as undefined, and numbers
# that may be NaN, for unknown ones.
UNUSED = re.compile(
    r"breakpoints\(limit|turning_(points|values)\(axis|Segment.flattened|made_by|\.__\w+__\(|check_wall|\(height|of_atoms\(error|^Estimate\(value"
)


class Odd(np.ndarray):  # type: ignore[type-arg]
    """Arrays whose methods lie."""

    def sum(self, *_: object, **__: object) -> Any:
        return "nothing"

    def min(self, *_: object, **__: object) -> Any:
        return 1.0

    max = min


def same_numbers(good: Any) -> dict[str, Any]:
    """The numbers in other kinds of arrays."""
    array = np.asarray(good)
    found: dict[str, Any] = {
        "big-endian": array.astype(array.dtype.newbyteorder(">")), "object": array.astype(object),
        "subclass": array.view(Odd), "mask without entries": np.ma.MaskedArray(array), "list": array.tolist(),
        "read-only": np.broadcast_to(array, array.shape), "Fortran": array.copy(order="F"),
    }  # fmt: skip
    if array.dtype.kind == "f":
        found["long double"] = array.astype(np.longdouble)
    if array.ndim:
        found["negative strides"] = array[::-1].copy()[::-1]
        found["strided"] = np.repeat(array, 2, axis=-1)[..., ::2]
    if array.ndim == 2:
        found["matrix"] = np.matrix(array)
    return found


def no_numbers(good: Any) -> dict[str, Any]:
    """The numbers with something among them that is none."""
    array = np.asarray(good)
    mask = np.zeros(array.shape, dtype=bool)
    mask.flat[:1] = True
    masked = np.ma.MaskedArray(array, mask)
    found: dict[str, Any] = {
        "masked": masked, "list with a masked array": [masked], "complex": array + 0j, "texts": array.astype(str),
        "dates": array.astype("timedelta64[s]"), "bytes": array.astype("S"), "masked constant": np.ma.masked,
        "list of texts": array.astype(str).tolist(), "records": np.zeros(array.shape, dtype=[("a", float)]),
    }  # fmt: skip
    for name, other in (("text", "0.5"), ("None", None), ("complex", 0.5 + 0j), ("numpy's complex", np.complex128(1))):
        objects = array.astype(object)
        objects.flat[:1] = [other]
        found[f"object with {name}"] = objects
    return found


def other_numbers(good: Any, rng: np.random.Generator) -> dict[str, Any]:
    """Other numbers, and other shapes."""
    array = np.asarray(good)
    shape = tuple(int(n) for n in rng.integers(0, 4, size=int(rng.integers(0, 5))))
    uniform = rng.uniform(0.01, 3.1, size=shape)
    return {
        "a matrix": np.matrix([[0.5, 1.0], [1.0, 0.5]]), "three axes": np.full((2, 3, 2), 0.5), "empty": np.empty(0),
        "no axis": np.array(0.5), "negative": -np.abs(array) - 1, "huge": np.full(array.shape, 1e308),
        "tiny": np.full(array.shape, 5e-324), "zeros": np.zeros(array.shape), "ones": np.ones(array.shape, np.int8),
        "true": np.ones(array.shape, dtype=bool), "infinite": np.full(array.shape, np.inf), "random": uniform,
        "nan": np.full(array.shape, np.nan), "half": array.astype(np.float16), "random matrix": np.matrix([[0.3]]),
        "whole": rng.integers(-3, 9, size=shape), "object of lists": np.array([[1.0], {}], dtype=object),
        "ragged": [[0.5], [0.5, 1.0]], "twice": np.concatenate([array.ravel(), array.ravel()]),
        "unsigned": np.full(array.shape, 2**64 - 1, dtype=np.uint64), "long": 10**400, "two lists": [[0.5], [0.7]],
    }  # fmt: skip


def sources(_: Any) -> dict[str, Any]:
    """What is no source of random numbers."""
    return {
        "matrix": np.matrix("1 0; 0 1"), "list": [1, 2], "object": object(), "negative": -1, "huge": 10**5000,
        "beyond 128 bits": 2**128, "true": True, "fraction": 1.5, "text": "1", "array": np.array([1, 2]),
        "array of one": np.array(1), "masked": np.ma.masked, "class": np.random.PCG64, "nan": np.nan, "dict": {},
        "old generator": np.random.RandomState(0), "span of time": np.timedelta64(1, "s"),
    }  # fmt: skip


def functions(_: Any) -> dict[str, Any]:
    """Functions whose values are no numbers, or of another shape."""
    return {
        "None": lambda *_: None, "text": lambda *_: "a", "complex": lambda *at: at[0] + 1j,
        "masked": lambda *at: np.ma.MaskedArray(at[0], True), "too long": lambda *at: np.append(at[0], 1.0),
        "texts": lambda *at: np.full(np.shape(at[0]), "0.5"), "list of objects": lambda *at: [object()],
    }  # fmt: skip


def scalars(_: Any) -> dict[str, Any]:
    """Functions of one number, and constants."""
    return {
        "constant": lambda *_: 1.0, "whole": lambda *_: 1, "true": lambda *_: True, "math": lambda *at: math.cos(at[0]),
        "branch": lambda *at: 1.0 if at[0] > 1.0 else 0.0, "float": lambda *at: float(np.mean(at[0])),
        "lists": lambda *at: np.cos(at[0]).tolist(), "matrix": lambda *at: np.matrix(np.cos(at[0]).reshape(1, -1)),
        "objects": lambda *at: np.cos(at[0]).astype(object), "axes": lambda *at: np.cos(at[0])[..., None, None],
    }  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A call with one odd argument, and the good call; operators have none."""

    name: str
    rule: str
    call: Callable[[], Any]
    good: Callable[[], Any] | None = None
    strict: bool = False


@cache
def cases(seed: int = 7) -> list[Case]:
    """All calls, in a random order."""
    rng = np.random.default_rng(seed)
    calls = {**public_calls.CALLS, **public_calls.method_calls()}
    with warnings.catch_warnings():
        # numpy's of its class of matrices
        warnings.simplefilter("ignore")
        every = [case for name, (function, good) in calls.items() for case in _of_call(name, function, good, rng)]
        every += _operators()
    return [every[k] for k in rng.permutation(len(every))]


def draw(number: int) -> Case:
    """One of all calls."""
    return cases()[number]


def _of_call(name: str, function: Callable[..., Any], good: dict[str, Any], rng: np.random.Generator) -> Iterator[Case]:
    parameters = inspect.signature(function).parameters
    kinds_of = {one: str(parameter.annotation) for one, parameter in parameters.items()}
    arrays = {
        one: np.asarray(value) if "Floats" in kinds_of.get(one, "") and _is_number(value) else value
        for one, value in good.items()
    }
    for one, value in arrays.items():
        kinds: list[tuple[str, dict[str, Any]]] = [(ODD, public_calls.wrong_kinds(name, one))]
        if UNUSED.search(f"{name}({one}"):
            pass
        elif one == "rng" and "Rng" in kinds_of.get(one, ""):
            kinds += [(REFUSED, sources(value))]
        elif one == "function":
            kinds += [(REFUSED, functions(value)), (OTHER, scalars(value))]
        elif _is_number(value):
            kinds += [(SAME, same_numbers(value)), (REFUSED, no_numbers(value)), (OTHER, other_numbers(value, rng))]
        usual, strict = partial(function, **arrays), public_calls.is_strict(name, function)
        for rule, odd in kinds:
            for kind, other in odd.items():
                yield Case(f"{name}({one} = {kind})", rule, partial(function, **{**arrays, one: other}), usual, strict)


def _is_number(value: Any) -> bool:
    """Whether a good argument is a number or an array of numbers."""
    if value is None or isinstance(value, (bool, str, dict)) or callable(value):
        return False
    try:
        array = np.asarray(value)
        return array.dtype.kind in "if" and array.size > 0
    except Exception:
        return False


BINARY = (operator.add, operator.sub, operator.mul, operator.matmul, operator.pow, operator.truediv)


def operands() -> dict[str, Any]:
    """What stands beside an operator."""
    array = np.array([0.1, 0.2, 0.3, 0.4])
    plain: dict[str, Any] = {
        "None": None, "text": "a", "bytes": b"a", "object": object(), "dict": {}, "empty list": [], "class": int,
        "complex": 1j, "nan": np.nan, "inf": np.inf, "true": True, "huge": 10**400, "whole": 2, "fraction": 0.5,
        "negative": -1, "numpy's": np.float64(0.5), "numpy's whole": np.int64(2), "big-endian": np.array(0.5, ">f8"),
        "array": array, "too short": array[:2], "square": np.eye(4), "three axes": np.ones((4, 2, 2)),
        "constant": lambda x: 1.0, "no rows": np.empty((0, 4)), "math": math.cos, "law": ker.lambertian(),
        "bins": public_calls.BINS, "kernel": public_calls.MATRIX, "disk": public_calls.DISK, "slice": slice(1),
        "other kernel": ker.discretise(ker.lambertian(), ker.Bins(3)), "collision": public_calls.COLLISION,
        "cosine": np.cos, "tuple": (1, 2),
        "ragged": [[1], [1, 2]], "span of time": np.timedelta64(1, "s"), "set": {1}, "range": range(4),
    }  # fmt: skip
    kinds = {**same_numbers(array), **no_numbers(array), **same_numbers(np.eye(4)), **no_numbers(0.5)}
    return plain | {f"{name} array": value for name, value in kinds.items()} | functions(None)


def _operators() -> Iterator[Case]:
    holders = [
        thing for thing in public_calls.OBJECTS
        if isinstance(thing, (ker.Law, ker.KernelMatrix, VelocityLaw, ker.Basis, AngularMeasure))
    ]  # fmt: skip
    for thing in holders:
        for kind, other in operands().items():
            for what in BINARY:
                label = f"{type(thing).__name__} {what.__name__} {kind}"
                yield Case(label, OTHER, partial(what, thing, other))
                yield Case(f"{label}, reflected", OTHER, partial(what, other, thing))
            yield Case(f"{type(thing).__name__} getitem {kind}", OTHER, partial(operator.getitem, thing, other))


def leaves(value: Any, depth: int = 4) -> list[Any]:
    """The arrays and numbers in an answer."""
    if isinstance(value, np.ndarray) or (isinstance(value, (float, int, np.number)) and not isinstance(value, bool)):
        return [np.asarray(value)]
    if depth and isinstance(value, (tuple, list)):
        return [leaf for part in value for leaf in leaves(part, depth - 1)]
    if depth and is_dataclass(value) and not isinstance(value, type):
        return [leaf for one in fields(value) for leaf in leaves(getattr(value, one.name, None), depth - 1)]
    return []


def has_nan(parts: list[Any]) -> bool:
    return any(part.dtype.kind == "f" and bool(np.isnan(part).any()) for part in parts)


def agree(first: list[Any], second: list[Any]) -> bool:
    return len(first) == len(second) and all(
        a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == b.dtype.kind == "f")
        for a, b in zip(first, second, strict=True)
    )


def judge(case: Case) -> Iterator[Judged]:
    """What the call ends in, in an empty folder."""
    import matplotlib

    matplotlib.use("Agg")
    with TemporaryDirectory() as folder, contextlib.chdir(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome, fault = _ended(case)
    kind = case.rule if case.good else "operands"
    yield Judged(kind, fault=f"{case.name}: {fault}"[:300] if fault else "", outcome=outcome)


def _ended(case: Case) -> tuple[str, str]:
    """The outcome, and what is wrong with it."""
    try:
        answer = leaves(case.call())
    except AsperityError:
        return "InputError", ""
    except Exception as reason:
        plain = isinstance(reason, public_calls.PLAIN) and not case.strict
        return ("plain error", "") if plain else ("exception", f"{type(reason).__name__}: {reason}")
    if case.rule == ODD:
        return "answer", ""
    if case.rule == REFUSED:
        return "answer", f"accepted, {answer}"
    wrong = f"NaN, {answer}" if has_nan(answer) else ""
    if case.good is None or (case.rule == OTHER and not wrong):
        return "answer", wrong
    try:
        usual = leaves(case.good())
    except AsperityError:
        return "answer", ""
    if case.rule == SAME and not agree(answer, usual) and agree(usual, leaves(case.good())):
        return "answer", f"{answer} instead of {usual}"
    return "answer", "" if has_nan(usual) else wrong


CAMPAIGNS = (Campaign("odd-arguments", "Is bad input refused?", draw, judge, 2400, range(200), seconds=SECONDS),)
