"""Checks of arguments: one line where it is used, one clear message when it fails."""

from __future__ import annotations

import math
import numbers as kinds_of_numbers
import os
import re
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, SupportsIndex, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError

Floats = NDArray[np.float64]
T = TypeVar("T")
# What `generator` takes.
Rng: TypeAlias = np.random.Generator | np.random.BitGenerator | np.random.SeedSequence | int | None
# Characters of a value that a message repeats, in one line.
SHOWN, LINE_ENDS = 80, re.compile(r"\s*\n\s*")
# Bytes of a double, and the number of doubles for which no machine is asked.
DOUBLE, ALWAYS_THERE = 8, 2**24
# Positive numbers below count as 0: their reciprocals overflow.
SMALLEST = 1e-300
# Whole numbers beyond do not fit into arrays.
LARGEST = 2**63 - 1
# By the wanted class and that of what was given instead: what makes the one from the other.
MAKES = {
    "Law": {
        "Wall": "ker.WallLaw(wall)", "MushroomGenerations": "ker.MushroomLaw(wall)",
        "str": "ker.WallLaw(geo.wall_from_text(text))", "ndarray": "ker.MatrixLaw(array)",
        "list": "ker.MatrixLaw(array)", "KernelMatrix": "ker.MatrixLaw(matrix)",
        "function": "ker.DensityLaw(density) or ker.InvolutionLaw(map)", "CollisionLaw": "its .law",
    },
    "Wall": {
        "str": "geo.wall_from_text(text)", "ndarray": "geo.Wall.from_vertices(points)",
        "list": "geo.Wall.from_vertices(points)", "Profile": "geo.Wall.from_profile(*profile)",
        "NamedWall": "its .build()", "WallLaw": "its .wall",
    },
    "KernelMatrix": {
        "Law": "ker.discretise(law, ker.Bins(64))", "Wall": "ker.discretise(ker.WallLaw(wall), ker.Bins(64))",
        "ndarray": "ker.discretise(ker.MatrixLaw(array), ker.Bins(len(array)))",
    },
}  # fmt: skip
# Seeds are below this number, the size of numpy's own.
SEEDS = 2**128
# Nested lists are arrays of at most so many axes, as numpy has it.
MOST_AXES = 64


def numbers(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as float64, finite or not: a plain array in the order of C and the byte order of this machine.

    Masked entries, complex numbers, texts, dates and None are refused, also in arrays of objects.

    Examples
    --------
    >>> numbers("x", [[1, 2]])
    array([[1., 2.]])
    >>> numbers("x", np.ma.array([1.0, 2.0], mask=[False, True]))    # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: x: expected numbers without a mask, got masked_array(...
    """
    try:
        array = np.asarray(value)
        # a plain array has no mask
        masked = array is not value and _is_masked(value)
        objects = array.dtype.kind == "O"
        if masked or array.dtype.kind not in "biufO" or (objects and not all(map(_is_real, array.flat))):
            raise TypeError("of another kind")
        return np.asarray(array, dtype=np.float64, order="C")
    except Exception as reason:  # foreign objects fail in their own way
        what = "numbers without a mask" if _is_masked(value) else "numbers"
        raise InputError(f"{name}: expected {what}, got {shortened(value)}") from reason


def _is_masked(value: object, depth: int = MOST_AXES) -> bool:
    """Whether an array, or one in a list, has masked entries."""
    if isinstance(value, (list, tuple)):
        # a list may contain itself
        plain = not depth or set(map(type, value)) <= {float, int}
        return not plain and any(_is_masked(one, depth - 1) for one in value)
    return bool(np.ma.is_masked(value))


def _is_real(entry: object) -> bool:
    """Whether an object is a real number; numpy converts its complex numbers, spans of time and None too."""
    if isinstance(entry, np.generic):
        return isinstance(entry, (np.floating, np.integer)) and not isinstance(entry, np.timedelta64)
    return isinstance(entry, kinds_of_numbers.Real) or hasattr(type(entry), "__float__")


def finite_array(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as float64, or raise an InputError that names the first entry that is not finite."""
    array = numbers(name, value)
    with np.errstate(over="ignore", invalid="ignore"):
        # a sum with a term that is not finite is not finite; it takes a sixth of the time of a mask
        total = array.sum()
    if np.isfinite(total):
        return array
    _refuse_entries(name, "finite numbers", array, ~np.isfinite(array))
    return array


def _refuse_entries(name: str, expected: str, array: Floats, bad: NDArray[np.bool_]) -> None:
    """Refuse an array with bad entries; the message names the first one."""
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        index = f" at index {where}" if where else ""
        raise InputError(f"{name}: expected {expected}, got {float(array[where])!r}{index} ({int(bad.sum())} such)")


def shaped(name: str, value: ArrayLike, *axes: int | str) -> Floats:
    """Return ``value`` as finite float64 of a shape: an axis is a length, or a name for any, "..." for any number.

    Examples
    --------
    >>> shaped("velocity", [1.0, 2.0], "...", 3)
    Traceback (most recent call last):
    asperity.errors.InputError: velocity: expected shape (..., 3), got (2,)
    """
    array = finite_array(name, value)
    wanted = axes[1:] if axes[0] == "..." else axes
    last = array.shape[max(array.ndim - len(wanted), 0) :]
    if (
        len(last) < len(wanted)
        or (wanted is axes and array.ndim != len(axes))
        or any(isinstance(axis, int) and axis != length for axis, length in zip(wanted, last, strict=True))
    ):
        text = ", ".join(map(str, axes)) + ("," if len(axes) == 1 else "")
        raise InputError(f"{name}: expected shape ({text}), got {array.shape}")
    return array


def finite_number(name: str, value: Any) -> float:
    """Return ``value`` as a finite float."""
    if type(value) is float and math.isfinite(value):
        return value
    return one_number(name, finite_array(name, value))


def one_number(name: str, array: Floats) -> float:
    """Return the number in an array of no dimension."""
    if array.ndim:
        raise InputError(f"{name}: expected one number, got an array of shape {array.shape}")
    return float(array)


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
        raise InputError(f"{name}: expected {article} {kind.__name__} such as {example}, got {given(value, kind)}")


def given(value: object, kind: type) -> str:
    """What was given for an object of a kind, and what makes one of it.

    Examples
    --------
    >>> given("koch", type("Wall", (), {}))
    "'koch'; take geo.wall_from_text(text)"
    """
    makes = MAKES.get(kind.__name__, {})
    found = next((makes[one.__name__] for one in type(value).__mro__ if one.__name__ in makes), None)
    got = f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else shortened(value)
    return got + (f"; take {found}" if found else "")


def sequence(name: str, value: Iterable[T], kind: type[T] | None = None, example: str = "") -> tuple[T, ...]:
    """The entries of a sequence, all of a kind where one is given.

    Examples
    --------
    >>> sequence("counts", [2, "two"], int, "2")
    Traceback (most recent call last):
    asperity.errors.InputError: counts[1]: expected an int such as 2, got 'two'
    """
    try:
        found = tuple(value)
    except TypeError as reason:
        raise InputError(f"{name}: expected a sequence, got {shortened(value)}") from reason
    if kind is not None:
        for index, entry in enumerate(found):
            instance(f"{name}[{index}]", entry, kind, example)
    return found


def choice(name: str, value: object, options: Iterable[object]) -> None:
    """Refuse what is none of the options, two or more.

    Examples
    --------
    >>> choice("which", "most", ("min", "max"))
    Traceback (most recent call last):
    asperity.errors.InputError: which: expected 'min' or 'max', got 'most'
    """
    allowed = tuple(options)
    if not np.isscalar(value) or value not in allowed:
        *first, last = map(repr, allowed)
        raise InputError(f"{name}: expected {', '.join(first)} or {last}, got {shortened(value)}")


def positive_number(name: str, value: Any) -> float:
    """Return ``value`` as a finite float greater than zero."""
    number = finite_number(name, value)
    if number < SMALLEST:
        least = f", of at least {SMALLEST:g}" if number > 0.0 else ""
        raise InputError(f"{name}: expected a number greater than 0{least}, got {number!r}")
    return number


def number_between(name: str, value: Any, low: float, high: float, *, closed: str = "") -> float:
    """Return ``value`` in (low, high); ``closed`` holds ``"low"`` and/or ``"high"`` for ends that are allowed."""
    number = finite_number(name, value)
    inside_low = number >= low if "low" in closed else (number > low if low else number >= SMALLEST)
    inside_high = number <= high if "high" in closed else number < high
    if not (inside_low and inside_high):
        left, right = "[" if "low" in closed else "(", "]" if "high" in closed else ")"
        more = "; angles are in radians" if high in (np.pi, 0.5 * np.pi) else ""
        more += f"; take at least {SMALLEST:g}" if low == 0.0 < number < SMALLEST else ""
        raise InputError(f"{name}: expected a number in {left}{low:g}, {high:g}{right}, got {number!r}{more}")
    return number


def whole_number(name: str, value: Any, low: int, *, most: int | None = None) -> int:
    """Return ``value`` as an int of at least ``low``, and at most ``most``, else the largest that arrays hold."""
    # numpy counts spans of time among its integers
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))
    if not whole or value < low or value > (LARGEST if most is None else most):
        allowed = f"of at least {low}" if most is None else f"from {low} to {most}"
        raise InputError(f"{name}: expected a whole number {allowed}, got {shortened(value)}")
    return int(value)


def indices(name: str, value: ArrayLike, size: int, low: int = 0) -> NDArray[np.int64]:
    """Return ``value`` as int64, every one a whole number from ``low`` to ``size`` - 1."""
    given = numbers(name, value)
    if not np.all((given >= low) & (given < size) & (given == np.floor(given))):
        raise InputError(f"{name}: expected whole numbers from {low} to {size - 1}, got {shortened(value)}")
    return given.astype(np.int64)


def shortened(value: object) -> str:
    """The repr of a value, or its beginning where it is long.

    Examples
    --------
    >>> shortened([1.0, 2.0]), len(shortened(10**400)), shortened(10**9999)
    ('[1.0, 2.0]', 83, 'a value of type int')
    """
    try:
        text = LINE_ENDS.sub(" ", repr(value))
    except Exception:  # of foreign objects, and of integers with thousands of digits
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def is_of_package(value: object) -> bool:
    """Whether the class of an object is one of this package, which its tests examine, not of the user's."""
    return type(value).__module__.partition(".")[0] == __name__.partition(".")[0]


def foreign(operand: object) -> Any:
    """What an operator returns for an operand that is not its own, so that Python raises a TypeError."""
    if isinstance(operand, np.ma.MaskedArray):  # it would take the other operand for an array of entries
        raise TypeError(f"a masked array is no operand here, got {shortened(operand)}")
    return NotImplemented


def check_memory(name: str, what: str, numbers: int) -> None:
    """Refuse what takes more doubles than this process can have, before it is asked for.

    Examples
    --------
    >>> check_memory("n", "a matrix", 10**15)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: n: a matrix takes 8e+06 GB of memory, more than there is (... GB); take a smaller one
    """
    if numbers > ALWAYS_THERE and DOUBLE * numbers > (left := memory_left()):
        size = f"{DOUBLE * numbers / 1e9:.2g}" if numbers < 10**30 else "too many"
        there = f"more than there is ({left / 1e9:.2g} GB)"
        raise InputError(f"{name}: {what} takes {size} GB of memory, {there}; take a smaller one")


def memory_left() -> int:
    """Bytes that this process can still have: of the machine, of its container and of a limit of its own."""
    try:
        import resource
    except ImportError:  # Windows, where numpy refuses what does not fit
        return sys.maxsize
    page = os.sysconf("SC_PAGE_SIZE")
    found = [os.sysconf("SC_PHYS_PAGES") * page]
    with suppress(OSError, ValueError, IndexError):  # not Linux, or no container
        found.append(1024 * int(re.findall(r"MemAvailable: +(\d+) kB", Path("/proc/meminfo").read_text())[0]))
        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            found.append(limit - page * int(Path("/proc/self/statm").read_text().split()[0]))
        found.append(int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return min(found)


def angles(name: str, value: ArrayLike) -> Floats:
    """Return ``value`` as angles in radians, every one in the open interval (0, pi)."""
    array = numbers(name, value)
    # NaN is the least and the largest number of an array that has it
    if array.size and not (array.min() > 0.0 and array.max() < np.pi):
        finite_array(name, array)
        bad = ~((array > 0.0) & (array < np.pi))
        _refuse_entries(name, "angles in the open interval (0, pi), in radians", array, bad)
    return array


def common_shape(**arrays: NDArray[Any]) -> tuple[int, ...]:
    """The shape to which the arrays broadcast; an InputError names those that do not.

    Examples
    --------
    >>> common_shape(x=np.ones(3), theta=np.ones(2))
    Traceback (most recent call last):
    asperity.errors.InputError: x, theta: expected shapes that broadcast, got (3,), (2,); for all pairs pass x[:, None]
    """
    shapes = [array.shape for array in arrays.values()]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as reason:
        raise InputError(
            f"{', '.join(arrays)}: expected shapes that broadcast, got {', '.join(map(str, shapes))}; for all pairs "
            f"pass {next(iter(arrays))}[:, None]"
        ) from reason


def broadcast(**arrays: Floats) -> tuple[Floats, ...]:
    """The arrays, each a view in their `common_shape`."""
    shape = common_shape(**arrays)
    return tuple(np.broadcast_to(array, shape) for array in arrays.values())


def generator(rng: Rng, default: int | None = None) -> np.random.Generator:
    """The source of random numbers that ``rng`` means: a Generator as it is, or a new one.

    Parameters
    ----------
    rng : None, int, SeedSequence, BitGenerator or Generator
        SPEC 7; an int is a seed of at least 0, below 2^128.
    default : int, optional
        The seed that None stands for, where results repeat by default; else None is a fresh seed.

    Examples
    --------
    >>> generator(3).random() == np.random.default_rng(3).random() == generator(None, 3).random()
    True
    """
    if isinstance(rng, np.random.Generator):
        return rng
    seed: Any = default if rng is None else rng
    if seed is not None and not isinstance(seed, (np.random.SeedSequence, np.random.BitGenerator)):
        try:
            seed = whole_number("rng", seed, 0, most=SEEDS - 1)
        except InputError as reason:
            raise InputError(
                f"rng: expected None, a whole number from 0 to 2^128 - 1, a numpy.random.SeedSequence, BitGenerator or "
                f"Generator, got {shortened(rng)}"
            ) from reason
    return np.random.default_rng(seed)


def new_seed(rng: np.random.Generator) -> tuple[int, ...]:
    """The words of a seed of its own for one computation, whose parts then have seeds that depend on their number."""
    return tuple(int(word) for word in rng.integers(0, 2**63, size=2))


def frozen(array: ArrayLike, dtype: type = np.float64) -> NDArray[Any]:
    """Return a read-only copy, or the array itself if it owns its numbers and nobody can write to it."""
    if isinstance(array, np.ndarray) and array.dtype == dtype and array.flags.owndata and not array.flags.writeable:
        return array
    return read_only(np.array(array, dtype=dtype))


def read_only(array: Any) -> NDArray[Any]:
    """An array of the caller's own, to which nobody can write from now on."""
    array.setflags(write=False)
    return np.asarray(array)


class Value:
    """An object with arrays, of which those that are read-only are so in its copies and pickles too.

    Those in its attributes and in tuples in them; numpy copies and pickles all arrays as writable ones.
    """

    def _set(self, **attributes: object) -> None:
        """Set attributes of an immutable object during its construction."""
        for name, value in attributes.items():
            object.__setattr__(self, name, value)

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        made = super().__reduce_ex__(protocol)
        return (*made[:2], *map(_state, made[2:3]), *made[3:]) if isinstance(made, tuple) else made


class State(dict[str, Any]):
    """The attributes of a value: a shallow copy takes them as they are, others what `_Fixed` makes of them."""

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, ({name: _fixed(value) for name, value in self.items()},)


def _state(value: Any) -> Any:
    # a pair if there are slots
    return State(value) if type(value) is dict else tuple(map(_state, value)) if type(value) is tuple else value


class _Fixed:
    """What a function makes of the copy of a value."""

    def __init__(self, function: Callable[[Any], Any], value: object) -> None:
        self.made = function, (value,)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.made


def _fixed(value: Any) -> Any:
    if isinstance(value, np.ndarray) and not value.flags.writeable:
        return _Fixed(read_only, value)
    if isinstance(value, MappingProxyType):
        return _Fixed(_mapping, {name: _fixed(one) for name, one in value.items()})
    return tuple(map(_fixed, value)) if type(value) is tuple else value


def _mapping(items: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    # pickles find no name of the class
    return MappingProxyType(items)
