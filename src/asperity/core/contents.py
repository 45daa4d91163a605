"""What tells a value from others, the same in every process: its content, by which checkpoints know a computation."""

from __future__ import annotations

import builtins
import dis
import functools
import hashlib
import importlib
import os
import re
import sys
import sysconfig
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from inspect import isfunction
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from .checks import State, shortened
from .errors import InputError


def told(name: str, value: Any, *, by_name: bool) -> Any:
    """A value as plain JSON: numbers and texts as they are, others by words for the reader and by their content."""
    try:
        return _told(value, by_name)
    except (_NoContent, RecursionError) as reason:
        what = "it" if isinstance(reason, RecursionError) else str(reason)
        raise InputError(
            f'{name}: {what} has no content that a checkpoint can compare; pass key="...", a name of your own for '
            "this computation, or no checkpoint"
        ) from reason


def _told(value: Any, by_name: bool) -> Any:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return {str(key): _told(one, by_name) for key, one in value.items()}
    if type(value) in (list, tuple):
        return [_told(one, by_name) for one in value]
    # of functions and classes
    words = getattr(value, "__qualname__", None) or re.sub(r" at 0x[0-9a-fA-F]+", "", shortened(value))
    return f"{words} ({content(value, by_name=by_name)})"


class _NoContent(TypeError):
    """Of a value that cannot be compared."""


def content(value: Any, *, by_name: bool = False) -> str:
    """Sixteen hexadecimal digits that tell a value from others, the same in every process.

    Arrays are compared by their bytes, objects by their class and state without cached properties, functions by their
    code, constants, defaults, closures and the globals that they read. Of a module of the user's, a function reads the
    attributes that it names; where it passes the module on, all of them. What belongs to an installed package is
    compared by its name and the package's version. What a function reads from files is not seen.

    Parameters
    ----------
    value : object
    by_name : bool
        Whether functions and objects of the user's own classes are told by their names alone.

    Raises
    ------
    TypeError
        If something has no content, such as an open file, a C function that is in no installed package, or a function
        that can read anything, as `eval` can.

    Examples
    --------
    >>> content(np.zeros(2)) == content(np.zeros(2)) != content(np.zeros(3))
    True
    >>> content(lambda angle: 2.0 * angle) == content(lambda angle: 3.0 * angle)
    False
    """
    found = _Contents(by_name).of(value)
    assert isinstance(found, bytes)  # nothing is above the value itself
    return found.hex()[:16]


LITERALS = (type(None), bool, int, float, complex, str, bytes, type(...), type(NotImplemented))
# What wraps functions: the attributes in which it holds them.
WRAPPERS: dict[type, tuple[str, ...]] = {
    property: ("fget", "fset", "fdel"), classmethod: ("__func__",), staticmethod: ("__func__",),
    functools.cached_property: ("func",), types.MethodType: ("__func__", "__self__"),
    types.BuiltinMethodType: ("__name__", "__self__"), types.MethodWrapperType: ("__name__", "__self__"),
    types.MethodDescriptorType: ("__name__", "__objclass__"), types.WrapperDescriptorType: ("__name__", "__objclass__"),
    functools._lru_cache_wrapper: ("__wrapped__",),
}  # fmt: skip
# Of a code object everything but where it stands.
CODE = ("co_code", "co_argcount", "co_posonlyargcount", "co_kwonlyargcount", "co_flags", "co_consts", "co_names",
        "co_varnames", "co_freevars", "co_cellvars", "co_exceptiontable")  # fmt: skip
# Members by which a class finds the slots and the dictionary of an object.
HIDDEN = types.MemberDescriptorType, types.GetSetDescriptorType
# Methods that the decorator of dataclasses writes.
WRITTEN = {"__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__", "__lt__", "__le__", "__gt__",
           "__ge__", "__replace__"}  # fmt: skip
# What Python writes into classes and modules; the fields of a dataclass are told by themselves.
IMPLICIT = {"__module__", "__qualname__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__annotate__",
            "__annotations_cache__", "__annotate_func__", "__conditional_annotations__", "__firstlineno__",
            "__static_attributes__", "__dataclass_fields__", "__dataclass_params__", "__match_args__",
            "__abstractmethods__", "__slotnames__", "_abc_impl", "__name__", "__package__", "__loader__", "__spec__",
            "__path__", "__file__", "__cached__", "__builtins__", "__warningregistry__"}  # fmt: skip
# Of a field of a dataclass what its class writes methods from.
FIELD = ("name", "default", "default_factory", "init", "compare", "hash", "kw_only")
# Functions and tables of Python through which a function reads what its code does not name.
ANYTHING = {
    f"{module}.{name}"
    for module, names in {
        "builtins": "eval exec globals compile __import__ breakpoint",
        "importlib": "import_module __import__ reload util machinery",
        "sys": "modules _getframe _current_frames path_hooks meta_path",
        "inspect": "currentframe stack trace getmodule getmembers getclosurevars",
        "gc": "get_objects get_referrers get_referents",
        "os": "environ environb getenv getenvb",
    }.items()
    for name in names.split()
}
ANYTHING_IN = {name.partition(".")[0] for name in ANYTHING}
# Attributes of functions and frames that are the globals of others.
GLOBALS = {"__globals__", "__builtins__", "__subclasses__", "__closure__", "f_globals", "f_builtins", "f_locals",
           "f_back", "tb_frame", "gi_frame", "cr_frame", "ag_frame"}  # fmt: skip


@dataclass(eq=False)
class _Unfinished:
    """A value whose digest is not known yet, because it is in a circle with values above it."""

    value: Any
    number: int
    least: int
    parts: list[bytes | str | _Unfinished] = field(default_factory=list)


Part = bytes | str | _Unfinished


class _Contents:
    """Digests of values, each computed once, of those in a circle together (Tarjan's algorithm)."""

    def __init__(self, by_name: bool) -> None:
        self.by_name = by_name
        # with the values, whose ids are not used again so long
        self.known: dict[int, tuple[Any, bytes]] = {}
        self.open: dict[int, _Unfinished] = {}
        self.stack: list[_Unfinished] = []

    def of(self, value: Any) -> bytes | _Unfinished:
        """The digest of a value, or the value itself if a circle leads from it to one whose parts are being told."""
        if type(value) in LITERALS:
            text = value.hex() if type(value) is float else hex(value) if type(value) is int else repr(value)
            return _hashed([type(value).__name__, text])
        key, number = id(value), len(self.stack)
        if key in self.known:
            return self.known[key][1]
        if key in self.open:
            return self.open[key]
        here = self.open[key] = _Unfinished(value, number, number)
        self.stack.append(here)
        try:
            here.parts = list(self._parts(value))
        except _NoContent:
            if not self.by_name:
                raise
            here.parts = ["by name", type(value).__qualname__]
        here.least = min([number, *(part.least for part in here.parts if isinstance(part, _Unfinished))])
        if here.least < number:
            return here
        circle = self.stack[number:]
        del self.stack[number:]
        for one, digest in zip(circle, _digests(circle), strict=True):
            self.known[id(one.value)] = one.value, digest
            del self.open[id(one.value)]
        return self.known[key][1]

    def _parts(self, value: Any) -> Iterable[Part]:
        kind = type(value)
        known = _known_name(value)
        if known is not None:
            return ["known", known]
        if isinstance(value, types.ModuleType):
            return ["module", *self._named({name: one for name, one in vars(value).items() if name not in IMPLICIT})]
        if kind in (list, tuple):
            return [kind.__name__, *map(self.of, value)]
        if kind in (set, frozenset):
            return [kind.__name__, *self._sorted(value)]
        if kind in (dict, State, types.MappingProxyType):
            return ["dict", *(self.of(one) for item in value.items() for one in item)]
        if isinstance(value, np.generic) or kind in (np.ndarray, np.memmap):
            words = f"{'array' if isinstance(value, np.ndarray) else 'scalar'} {value.dtype.descr} {value.shape}"
            return [words, self.of(value.tolist()) if value.dtype.hasobject else np.asarray(value).tobytes()]
        if isinstance(value, types.CodeType):
            return ["code", repr(sys.version_info[:2]), *(self.of(getattr(value, name, None)) for name in CODE)]
        if isinstance(value, types.CellType):
            # reading an empty one is an error
            return ["cell", *([] if value == types.CellType() else [self.of(value.cell_contents)])]
        return self._rest(value, kind)

    def _sorted(self, values: Iterable[Any]) -> list[bytes]:
        found = list(map(self.of, values))
        finished = [one for one in found if isinstance(one, bytes)]
        if len(finished) < len(found):
            raise _NoContent("a set in a circle of objects")
        return sorted(finished)

    def _rest(self, value: Any, kind: type) -> Iterable[Part]:
        """Of functions, classes and objects."""
        if isinstance(value, (types.FunctionType, type)):
            if self.by_name and not is_installed(value.__module__):
                return ["by name", value.__qualname__]
            return self._function(value) if isinstance(value, types.FunctionType) else self._class(value)
        if kind in WRAPPERS and not isinstance(getattr(value, "__self__", self), (types.ModuleType, type(None))):
            return [kind.__name__, *(self.of(getattr(value, name)) for name in WRAPPERS[kind])]
        if kind.__module__.startswith("numba.") and isfunction(getattr(value, "py_func", None)):
            return ["compiled", self.of(value.py_func), self.of(value.targetoptions)]
        if self.by_name and not is_installed(kind.__module__):
            return ["by name", kind.__qualname__]
        return self._object(value)

    def _named(self, values: Mapping[str, Any]) -> Iterator[Part]:
        for name in sorted(values):
            yield from (name, self.of(values[name]))

    def _function(self, function: Any) -> Iterator[Part]:
        code = function.__code__
        cells = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
        filled = {name: cell.cell_contents for name, cell in cells.items() if cell != types.CellType()}
        yield from ("function", function.__qualname__, function.__name__, self.of(code))
        yield from map(self.of, (function.__defaults__, function.__kwdefaults__, function.__dict__))
        # of modules what is read of them stands among what the code reaches
        yield from self._named({name: one for name, one in filled.items() if not isinstance(one, types.ModuleType)})
        yield from self._named(dict(_reached(code, function.__globals__, filled)))

    def _class(self, kind: type) -> Iterator[Part]:
        yield from ("class", kind.__qualname__)
        yield from map(self.of, (*kind.__bases__, type(kind)))
        members = dict(vars(kind))
        if "__dataclass_params__" in members:
            members = {name: member for name, member in members.items() if name not in WRITTEN}
            fields = members["__dataclass_fields__"].values()
            yield self.of([[getattr(one, name) for name in FIELD] for one in fields])
        if issubclass(kind, Enum):
            yield from self._named({one.name: one.value for one in kind})
            members = {name: member for name, member in members.items() if isfunction(member)}
        hidden = {name for name, member in members.items() if isinstance(member, HIDDEN)}
        yield from self._named({name: one for name, one in members.items() if name not in hidden | IMPLICIT})

    def _object(self, value: Any) -> Iterable[Part]:
        """By what pickle would make it of, which is what the class says, and all its attributes."""
        try:
            made = value.__reduce_ex__(4)
        # foreign objects fail in their own way
        except Exception as reason:
            raise _NoContent(shortened(value)) from reason
        if not isinstance(made, tuple):
            raise _NoContent(shortened(value))
        function, arguments, state, entries, items, setter = (*made, None, None, None, None)[:6]
        if isinstance(state, dict):
            # with nothing but cached properties it is as without any
            state = _without_cached(value, state) or None
        listed = [None if one is None else list(one) for one in (entries, items)]
        return ["object", *map(self.of, (function, arguments, state, listed, setter, _attributes(value)))]


def _attributes(value: Any) -> list[tuple[str, Any]] | None:
    """The attributes of an object of a class of the user's, those too that its class does not pickle."""
    kind = type(value)
    if is_installed(kind.__module__):
        return None
    slots = {name for base in kind.__mro__ for name, one in vars(base).items() if isinstance(one, HIDDEN[0])}
    own = {name: getattr(value, name) for name in slots if hasattr(value, name)}
    return _without_cached(value, {**own, **getattr(value, "__dict__", {})}) or None


def _without_cached(value: Any, attributes: Mapping[str, Any]) -> list[tuple[str, Any]]:
    members = (item for base in type(value).__mro__ for item in vars(base).items())
    cached = {name for name, member in members if isinstance(member, functools.cached_property)}
    return sorted((name, one) for name, one in attributes.items() if name not in cached)


def _digests(circle: Sequence[_Unfinished]) -> list[bytes]:
    """The digests of values in a circle, equal exactly if all that is reached from two values is alike.

    Each round tells a value by its parts, those in the circle by the round before. A round that divides the values no
    further is the last: its digests, all together, determine those of every round after it.
    """
    if len(circle) == 1 and not any(isinstance(part, _Unfinished) for part in circle[0].parts):
        return [_hashed(circle[0].parts)]
    found, classes, rounds = dict.fromkeys(map(id, circle), b""), 0, 0
    while len({*found.values()}) > classes:
        classes, rounds, before = len({*found.values()}), rounds + 1, found
        found = {
            id(one): _hashed([before[id(part)] if isinstance(part, _Unfinished) else part for part in one.parts])
            for one in circle
        }
    whole = _hashed([str(rounds), *sorted({*found.values()})])
    return [_hashed([whole, found[id(one)]]) for one in circle]


def _hashed(parts: Iterable[Part]) -> bytes:
    told = hashlib.sha256()
    for part in parts:
        assert not isinstance(part, _Unfinished)
        coded = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        told.update(len(coded).to_bytes(8, "big") + coded)
    return told.digest()


@functools.cache
def is_installed(module: str | None) -> bool:
    """Whether a module is one of Python or of an installed package, not of the user's."""
    top = sys.modules.get((module or "").partition(".")[0])
    if top is None or top.__name__ == "__main__":
        return False
    file = Path(getattr(top, "__file__", None) or "/")
    of_python = top.__name__ in sys.builtin_module_names or file.is_relative_to(sysconfig.get_path("stdlib"))
    of_package = {"site-packages", "dist-packages"} & set(file.parts) or top.__name__ == __name__.partition(".")[0]
    return of_python or bool(of_package)


def _version(module: str | None) -> str | None:
    """The version of a module of Python or of an installed package; None of the user's own."""
    if not is_installed(module):
        return None
    top = sys.modules[(module or "").partition(".")[0]]
    return getattr(top, "__version__", repr(sys.version_info[:2]))


def _known_name(value: Any) -> str | None:
    """Name and version of what stands in an installed module under its own name, and of these modules.

    Raises
    ------
    _NoContent
        If it is one through which anything is read.
    """
    if isinstance(value, types.ModuleType):
        if value.__name__ in ANYTHING_IN:
            raise _NoContent(f"the module {value.__name__}, passed on,")
        version = _version(value.__name__)
        return None if version is None else f"{value.__name__} {version}"
    if value is sys.modules or value is os.environ:
        raise _NoContent("sys.modules" if value is sys.modules else "os.environ")
    # ufuncs of other packages know no module
    ufunc = isinstance(value, np.ufunc)
    name = getattr(value, "__name__" if ufunc else "__qualname__", None)
    for module in ("numpy", "scipy.special") if ufunc else (getattr(value, "__module__", None),):
        if isinstance(name, str) and isinstance(module, str) and (version := _version(module)) is not None:
            if f"{module}.{name}" in ANYTHING:
                raise _NoContent(f"{module}.{name}")
            try:
                if attrgetter(name)(sys.modules[module]) is value:
                    return f"{module}.{name} {version}"
            except (AttributeError, KeyError):
                continue
    return None


def _reached(code: types.CodeType, known: Mapping[str, Any], cells: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """The globals and modules that a function reads by their names, of modules of the user's the attributes."""
    if not GLOBALS.isdisjoint(code.co_names):
        raise _NoContent(f"a function that reads {', '.join(GLOBALS & set(code.co_names))}")
    steps = [step for step in dis.get_instructions(code) if step.opname != "EXTENDED_ARG"]
    imported: dict[str, Any] = {}
    for index, step in enumerate(steps):
        rest = steps[index + 1 :]
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            name = step.argval
            if name in known or hasattr(builtins, name):
                yield _chain(name, known[name] if name in known else getattr(builtins, name), rest)
        elif step.opname == "IMPORT_NAME":
            level = steps[index - 2].argval
            name = "." * (level if isinstance(level, int) else 0) + step.argval
            try:
                module = importlib.import_module(name, known.get("__package__"))
            except ImportError:
                continue
            names = _imported_names(rest)
            yield from (_chain(f"{name}.{one}", getattr(module, one, module), []) for one in names)
            if not names:
                # `import a.b` binds a
                whole = module if level or "." not in name else sys.modules[name.partition(".")[0]]
                imported[rest[0].argval] = whole
        elif step.opname.startswith(("LOAD_FAST", "LOAD_DEREF", "LOAD_CLASSDEREF", "LOAD_FROM_DICT_OR_DEREF")):
            given = {**cells, **imported}
            # one step may load two variables, of which the second is on top
            *below, name = step.argval if isinstance(step.argval, tuple) else (step.argval,)
            yield from (_chain(one, given[one], []) for one in below if isinstance(given.get(one), types.ModuleType))
            if isinstance(given.get(name), types.ModuleType):
                yield _chain(name, given[name], rest)
    for one in code.co_consts:
        if isinstance(one, types.CodeType):
            yield from _reached(one, known, {**cells, **imported})


def _imported_names(rest: Sequence[dis.Instruction]) -> list[str]:
    """The names that follow the import of a module: from it they are taken."""
    found = []
    for step in rest:
        if step.opname == "IMPORT_FROM":
            found.append(step.argval)
        elif not found or not step.opname.startswith("STORE_"):
            break
    return found


def _chain(name: str, value: Any, rest: Sequence[dis.Instruction]) -> tuple[str, Any]:
    """A value, or the attribute of a module of the user's that the code reads next, under its name with dots."""
    for step in rest:
        of_module = isinstance(value, types.ModuleType) and step.opname in ("LOAD_ATTR", "LOAD_METHOD")
        if of_module and value.__name__ in ANYTHING_IN:
            if f"{value.__name__}.{step.argval}" in ANYTHING:
                raise _NoContent(f"{value.__name__}.{step.argval}")
            return f"{name}.{step.argval}", f"{value.__name__}.{step.argval} {_version(value.__name__)}"
        if not of_module or is_installed(value.__name__) or step.argval in IMPLICIT or not hasattr(value, step.argval):
            break
        name, value = f"{name}.{step.argval}", getattr(value, step.argval)
    return name, value
