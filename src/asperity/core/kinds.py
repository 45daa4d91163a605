"""Arguments of a wrong kind: failures that come from one are explained by its name, and become InputErrors.

A function is called as it is. Only if it fails with an exception that is not asperity's, its arguments are held against
its annotations: where one is of another kind an InputError names it, and where none is the exception goes on as it
came, because then the fault is not the caller's.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, Literal, ParamSpec, TypeVar, get_args, get_origin

import numpy as np

from .checks import LARGEST, finite_array, shortened
from .errors import AsperityError, InputError

P = ParamSpec("P")
T = TypeVar("T")
C = TypeVar("C", bound=type)

# Methods that operators and brackets call.
OPERATORS = ("__call__", "__getitem__", "__matmul__", "__add__", "__sub__", "__mul__", "__rmul__", "__pow__")
NUMBERS = ("ArrayLike", "Floats")
FUNCTIONS = ("AngleFunction", "DensityFunction", "CostFunction", "Objective")
# What is asked for last: numbers of other kinds, such as fractions, and lists do where they are converted.
PLAIN: dict[Any, Any] = {"Floats": np.ndarray, "float": (float, int, np.number)}
PATHS = ("PathLike[str]", "Path")
ARTICLES = {
    "float": "a number", "int": "a whole number", "bool": "True or False", "str": "a text", "None": "None",
    "ArrayLike": "finite numbers", "Floats": "finite numbers", "PathLike[str]": "a path", "Path": "a path",
    "Wall": "a Wall such as geo.flat()", "Disk": "a Disk such as geo.Disk(mass=1.0, inertia=0.5)",
    "Law": "a Law such as ker.lambertian()", "Basis": "a basis such as ker.Bins(64)",
    "KernelMatrix": "a KernelMatrix such as ker.discretise(law, basis) gives",
    "CollisionLaw": "a CollisionLaw such as ker.CollisionLaw(law, disk)",
    "Container": "a Container such as geo.Container.strip()", "Spectrum": "a Spectrum",
    "Axes": "axes of matplotlib", "VelocityLaw": "a CollisionLaw such as ker.smooth(disk)",
    "Estimate": "an Estimate", "WorkProblem": "a WorkProblem",
    "WorkMethod": "a WorkMethod", "ReferenceValue": "a ReferenceValue",
}  # fmt: skip


def explained(function: Callable[P, T]) -> Callable[P, T]:
    """The function, whose failures on arguments of a wrong kind are InputErrors.

    Examples
    --------
    >>> @explained
    ... def half(count: int) -> float:
    ...     return count / 2
    >>> half(3)
    1.5
    >>> half("three")
    Traceback (most recent call last):
    asperity.errors.InputError: count: expected a whole number, got 'three'
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> T:
        try:
            return function(*arguments, **named)
        except AsperityError:
            raise
        except Exception as reason:
            try:
                bound = signature.bind(*arguments, **named)
            except TypeError:
                raise reason from None
            names = getattr(function, "__globals__", {})  # dunder of functions
            for name, value in bound.arguments.items():
                kind = signature.parameters[name].annotation
                known = isinstance(kind, str) and signature.parameters[name].kind is not inspect.Parameter.VAR_KEYWORD
                if known and not _is_kind(value, kind, names):
                    raise InputError(f"{name}: expected {_words(kind, names)}, got {shortened(value)}") from reason
            for name, value in bound.arguments.items():
                kind = PLAIN.get(signature.parameters[name].annotation)
                if kind is not None and not isinstance(value, kind):
                    what = "an array of numpy" if kind is np.ndarray else "a float"
                    raise InputError(f"{name}: expected {what}, got {shortened(value)}") from reason
            if isinstance(reason, MemoryError):
                raise InputError(f"{function.__qualname__}: {reason or 'not enough memory'}; ask for less") from reason
            raise

    return call


def explained_class(kind: C) -> C:
    """The class, whose constructor and public methods are `explained`.

    Examples
    --------
    >>> @explained_class
    ... class Counter:
    ...     def more(self, count: int) -> int:
    ...         return 1 + count
    >>> Counter().more("two")
    Traceback (most recent call last):
    asperity.errors.InputError: count: expected a whole number, got 'two'
    """
    for name, member in list(vars(kind).items()):
        held = isinstance(member, (classmethod, staticmethod))
        function = member.__func__ if held else member
        public = name in OPERATORS or not name.startswith("_")
        if public and inspect.isfunction(function) and not hasattr(function, "__wrapped__"):
            setattr(kind, name, type(member)(explained(function)) if held else explained(function))
    if not getattr(kind, "_is_protocol", False):
        kind.__init__ = explained(kind.__init__)  # type: ignore[misc]
    return kind


def _is_kind(value: object, kind: str, names: dict[str, Any]) -> bool:
    """Whether the value fits the annotation; what is not known fits."""
    kind = kind.strip()
    options = _split(kind, "|")
    if len(options) > 1:
        return any(_is_kind(value, option, names) for option in options)
    head, _, inner = kind.removesuffix("]").partition("[")
    if head in ("Sequence", "tuple", "list", "Iterable"):
        return _are_kinds(value, inner, names)
    if head in ("Mapping", "dict"):
        return isinstance(value, dict)
    if head == "NDArray":
        return isinstance(value, np.ndarray)
    if head == "Callable":
        return callable(value)
    choices = _choices(kind, names)
    if choices:
        return isinstance(value, str) and value in choices
    return _is_plain(value, kind, names)


def _is_plain(value: object, kind: str, names: dict[str, Any]) -> bool:
    if kind in ("float", *NUMBERS):
        try:
            array = finite_array("value", value)  # type: ignore[arg-type]
        except InputError:
            return False
        return kind != "float" or array.ndim == 0
    if kind == "int":
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))
        return whole and abs(int(value)) <= LARGEST  # type: ignore[call-overload]
    plain = {"bool": (bool, np.bool_), "str": str, "None": type(None), **dict.fromkeys(PATHS, os.PathLike)}
    if kind == "str" and isinstance(value, str):
        # neither goes into the name of a file
        return "\0" not in value and not any("\ud800" <= letter <= "\udfff" for letter in value)
    if kind in plain:
        return isinstance(value, plain[kind])  # type: ignore[arg-type]
    if _is_function(kind, names):
        return callable(value)
    # classes are known by their names: the annotation need not be importable here
    known = kind in ARTICLES or (inspect.isclass(names.get(kind)) and not getattr(names[kind], "_is_protocol", False))
    return not known or kind in _class_names(value)


def _are_kinds(value: object, inner: str, names: dict[str, Any]) -> bool:
    if isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable):
        return False
    try:
        entries = list(value)
    except TypeError:
        return False
    kinds = _split(inner, ",")
    if len(kinds) > 1 and kinds[-1].strip() != "...":
        return len(entries) == len(kinds) and all(map(lambda v, k: _is_kind(v, k, names), entries, kinds))
    return all(_is_kind(entry, kinds[0], names) for entry in entries)


def _choices(kind: str, names: dict[str, Any]) -> tuple[Any, ...]:
    """The texts of a Literal, written out or by the name of its alias."""
    if kind.startswith("Literal["):
        return tuple(word.strip().strip("'\"") for word in kind[len("Literal[") : -1].split(","))
    alias = names.get(kind)
    return get_args(alias) if get_origin(alias) is Literal else ()


def _is_function(kind: str, names: dict[str, Any]) -> bool:
    """Whether this is the name of a kind of functions."""
    return kind in FUNCTIONS or get_origin(names.get(kind)) is Callable


def _class_names(value: object) -> set[str]:
    return {base.__name__ for base in type(value).__mro__}


def _split(kind: str, separator: str) -> list[str]:
    """Split where no bracket is open."""
    parts, depth, start = [], 0, 0
    for position, character in enumerate(kind):
        depth += (character in "[(") - (character in "])")
        if character == separator and depth == 0:
            parts.append(kind[start:position])
            start = position + 1
    return [*parts, kind[start:]]


def _words(kind: str, names: dict[str, Any]) -> str:
    """The annotation in words.

    Examples
    --------
    >>> _words("int | None", {}), _words("Sequence[Law]", {}), _words("Literal['min', 'max']", {})
    ('a whole number or None', 'a sequence, each entry a Law such as ker.lambertian()', "one of 'min', 'max'")
    """
    options = [option.strip() for option in _split(kind, "|")]
    if len(options) > 1:
        return " or ".join(dict.fromkeys(_words(option, names) for option in options))
    head, _, inner = kind.strip().removesuffix("]").partition("[")
    if head in ("Sequence", "list", "Iterable") or inner.endswith("..."):
        return f"a sequence, each entry {_words(_split(inner, ',')[0], names)}"
    if head == "tuple":
        return f"({', '.join(_words(part, names) for part in _split(inner, ','))})"
    if head == "NDArray":
        return "an array of numpy"
    choices = _choices(kind.strip(), names)
    if choices:
        return f"one of {', '.join(map(repr, choices))}"
    if head == "Callable" or _is_function(kind.strip(), names):
        return "a function"
    return ARTICLES.get(kind.strip(), f"a {kind.strip()}")
