"""The decorator of compiled functions, and the cache that stores them on disk. Loads numba.

numba compiles a function when it is first called, and stores the result beside the module, else in the user's cache
folder. If both are read-only, as in containers, or others can write them, it is stored in a temporary folder. A damaged
file is ignored, and written again.
"""

from __future__ import annotations

import builtins
import gc
import grp
import hashlib
import importlib
import logging
import math
import multiprocessing
import operator
import os
import pickle
import pwd
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from inspect import signature
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any, ClassVar

from numba import njit, types
from numba._dynfunc import make_function
from numba.core.base import BaseContext
from numba.core.caching import CacheImpl, CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator, _CacheLocator
from numba.core.caching import _SourceFileBackedLocatorMixin as SourceStamp
from numba.core.cgutils import alloca_once
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.ir import UNDEFINED
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.typing.context import Context
from numba.core.untyped_passes import InlineClosureLikes
from numba.np import linalg

from .errors import InputError

logger = logging.getLogger("asperity")


def _skip_blas() -> None:
    """Load numba's functions of arrays without scipy.linalg, which numba would import to learn that it is there."""
    check: Any = getattr(linalg, "ensure_blas", None)
    linalg.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = check


_skip_blas()

# Functions whose results have types that depend on the types of their arguments only.
KNOWN = frozenset(value for module in (operator, builtins, math) for value in vars(module).values() if callable(value))


class _Same(Flags):
    """The options of a function; equal options are one object, because numba compares them wherever it types a call."""

    __hash__ = object.__hash__
    known: ClassVar[dict[str, _Same]] = {}

    @classmethod
    def of(cls, flags: Flags) -> _Same:
        return cls.known.setdefault(repr(flags), cls(flags))

    def __eq__(self, other: object) -> bool:
        return self is other

    def copy(self) -> Any:
        """Return the options that numba passes on to its own functions, the same for most functions."""
        passed: Any = Flags(self)
        passed.forceinline, passed.no_cpython_wrapper = False, True
        # options that are set count as others than the same ones by default
        passed.fastmath, passed.dbg_optnone = passed.fastmath, passed.dbg_optnone
        return self.of(passed)


class _Typing(Context):
    """numba's types of calls, where all uses of an operator with operands of the same types are resolved once.

    numba would try all signatures of the operator, those for arrays among them, at each use.
    """

    # the results by the number of the operator, whose hash is slow, with the operator, so that it keeps its number
    known: ClassVar[dict[tuple[int, Any], tuple[Any, Any]]] = {}

    def __init__(self, shared: Context) -> None:
        self.__dict__ = shared.__dict__

    @classmethod
    @cache
    def of(cls, shared: Context) -> _Typing:
        """Return the same object for the same types, by which numba finds functions that it has compiled before."""
        return cls(shared)

    def resolve_function_type(self, function: Any, operands: Any, named: Any) -> Any:
        resolve = super().resolve_function_type
        if not isinstance(function, types.Function) or function.typing_key not in KNOWN or named:
            return resolve(function, operands, named)
        key = id(function), operands
        found = self.known.get(key)
        if found is None:
            found = self.known[key] = function, resolve(function, operands, named)
        return found[1]


# The methods of numba that `_Lower` and `_LinkedLibrary` replace, and those that they call: names of the arguments.
PARTS: dict[tuple[Any, str], str] = {
    (Lower, "lower_binop"): "self resty expr op",
    (Lower, "lower_getitem"): "self resty expr value index signature",
    (Lower, "alloca_lltype"): "self name lltype datamodel",
    (Lower, "loadvar"): "self name",
    (Lower, "typeof"): "self varname",
    (BaseContext, "cast"): "self builder val fromty toty",
    (BaseContext, "get_function"): "self fn sig _firstcall",
    (JITCodeLibrary, "_optimize_functions"): "self ll_module",
}


@cache
def knows_numba() -> bool:
    """Return whether numba has the methods of `PARTS`; where it has others, they are called and not replaced."""
    found = ((getattr(owner, name, None), expected) for (owner, name), expected in PARTS.items())
    return all(method and " ".join(signature(method).parameters) == expected for method, expected in found)


class _Lower(Lower):
    """numba's translation of statements to LLVM, which takes the types of operators as they were inferred.

    numba would infer them again.
    """

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._calls: dict[tuple[Any, Any], Any] = {}

    def lower_binop(self, result: Any, expression: Any, function: Any) -> Any:
        if not (expression.static_lhs is expression.static_rhs is UNDEFINED):
            return super().lower_binop(result, expression, function)
        operands = expression.lhs, expression.rhs
        return self._called(result, function, operands, self.fndesc.calltypes[expression])

    def lower_getitem(self, result: Any, expression: Any, value: Any, index: Any, signature: Any) -> Any:
        return self._called(result, operator.getitem, (value, index), signature)

    def alloca_lltype(self, name: str, kind: Any, datamodel: Any = None) -> Any:
        # without the size, which only a debugger needs, and which LLVM finds from a module of its own
        return alloca_once(self.builder, kind, name=name)

    def _called(self, result: Any, function: Any, operands: Any, signature: Any) -> Any:
        context, builder = self.context, self.builder
        values = [
            context.cast(builder, self.loadvar(operand.name), self.typeof(operand.name), kind)
            for operand, kind in zip(operands, signature.args, strict=True)
        ]
        key = function, signature.args
        call = self._calls.get(key)
        if call is None:
            typing = _Typing.of(context.typing_context)
            kind = typing.resolve_value_type(function)
            call = self._calls[key] = context.get_function(kind, typing.resolve_function_type(kind, signature.args, {}))
        return context.cast(builder, call(builder, values), signature.return_type, result)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """numba's translation to LLVM."""

    _name = "own_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lower if knows_numba() else Lower


class _Pipeline(CompilerBase):
    """numba's passes without those for closures and for expressions of whole arrays, which find nothing here.

    They make millions of objects, and almost no cycles of them: the garbage collection waits until they are done.
    """

    unused = InlineClosureLikes, InlineOverloads, NopythonRewrites
    lowering = _Lowering

    def __init__(self, typing: Any, target: Any, library: Any, arguments: Any, result: Any, flags: Any, kinds: Any):
        super().__init__(_Typing.of(typing), target, library, arguments, result, _Same.of(flags), kinds)

    def _compile_core(self) -> Any:
        collects = gc.isenabled()
        gc.disable()
        try:
            return super()._compile_core()
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        wanted = [step for step in manager.passes if step[0] not in self.unused]
        manager.passes = [(self.lowering if step is NativeLowering else step, text) for step, text in wanted]
        manager.finalize()
        return [manager]


class _LinkedLibrary(JITCodeLibrary):
    """The code of a function that becomes machine code, and is optimised, within its callers only."""

    def _optimize_functions(self, module: Any) -> None:
        if knows_numba():
            # the layout only, which numba sets here
            module.data_layout = self._codegen._data_layout
        else:
            super()._optimize_functions(module)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _LinkedLowering(_Lowering):
    """numba's translation to LLVM, which stops before it loads a function."""

    _name = "linked_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags = Flags(state.flags)
        state.flags.no_compile = True
        super().run_pass(state)
        # numba's tables name the function by this object, which nobody calls
        name = make_function(sys.modules[__name__], state.func_id.func_name, "", 0, state.cr.env, (state.library,))
        state.targetctx.insert_user_function(name, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=name)
        return True


class _LinkedPipeline(_Pipeline):
    lowering = _LinkedLowering


OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def jit(*, linked: bool = False, **options: Any) -> Callable[[Any], Any]:
    """Return a decorator that compiles a function and stores it on disk, with ``options`` of numba's ``njit``.

    Unless the options say otherwise, the function releases the lock of the interpreter, divides by zero as numpy does,
    and has no wrapper for calls from C. A ``linked`` function, as one with the option ``forceinline``, is compiled and
    stored as a part of its callers: neither Python nor a call by address reaches it.
    """
    linked = linked or bool(options.get("forceinline"))
    options |= {"no_cpython_wrapper": True} if linked else {}
    pipeline = _LinkedPipeline if linked else _Pipeline
    decorate: Any = njit(pipeline_class=pipeline, **{**OPTIONS, **options})

    def compiled(function: Any) -> Any:
        dispatcher = decorate(function)
        if options.get("no_cpython_wrapper") and isinstance(dispatcher, CPUDispatcher):
            dispatcher.__class__ = _Inner
        # not with numba's switch that turns compilation off
        if hasattr(dispatcher, "enable_caching") and not linked:
            try:
                # what the option ``cache`` does, with another cache
                dispatcher._cache = _SafeCache(function)
            except RuntimeError:
                logger.warning("no folder is writable, so compiled functions are not stored; set NUMBA_CACHE_DIR")
        return dispatcher

    return compiled


class _Inner(CPUDispatcher):
    """A function without a wrapper for Python, whose call from there would end the process."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__}: only compiled functions call it; from Python call its py_func")


@cache
def announce() -> None:
    """Say once that functions are being compiled: in the log, and on a terminal."""
    text = "asperity: compiling, once (about 10 s)"
    logger.info(text)
    if sys.stderr is not None and sys.stderr.isatty() and multiprocessing.parent_process() is None:
        print(text, file=sys.stderr, flush=True)


@cache
def temporary_folder() -> Path:
    """Return a folder of this user alone, because functions in it are executed; the same one in all processes."""
    folder = Path(gettempdir()) / f"asperity-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        if stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o077:
            logger.info("compiled functions are stored in %s; to choose a folder set NUMBA_CACHE_DIR", folder)
            return folder
    return Path(mkdtemp(prefix="asperity-"))


@cache
def why_unsafe(folder: Path, owners: frozenset[int]) -> str:
    """Return who else can put files into a folder, or replace it; empty if nobody but root and these owners can.

    A group is the owner's alone if it has the owner's name and no other member.
    """
    for path in dict.fromkeys([*(folder, *folder.parents), *(folder.resolve(), *folder.resolve().parents)]):
        for state in (path.lstat(), path.stat()):
            if state.st_uid not in owners | {0}:
                return f"{path} belongs to another user"
            # in a folder with the sticky bit, such as /tmp, nobody replaces what is another's
            if stat.S_ISLNK(state.st_mode) or (path not in (folder, folder.resolve()) and state.st_mode & stat.S_ISVTX):
                continue
            if state.st_mode & stat.S_IWOTH:
                return f"everybody may write {path}"
            if state.st_mode & stat.S_IWGRP and not _is_private(state):
                return f"a group may write {path}"
    return ""


def _is_private(state: os.stat_result) -> bool:
    try:
        group, user = grp.getgrgid(state.st_gid), pwd.getpwuid(state.st_uid)
    except KeyError:
        return False
    return group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}


def _guarded(kind: Any) -> Any:
    """A way of numba to find a folder; it passes over one that others can write, because what is there is executed."""

    class Guarded(kind):  # type: ignore[misc]
        @classmethod
        def from_function(cls, function: Any, file: str) -> Any:
            found = super().from_function(function, file)
            if found is None:
                return None
            # who owns the source can have anything executed
            source = Path(file)
            owners = {os.getuid(), *([source.stat().st_uid] if source.exists() else [])}
            folder = Path(found.get_cache_path()).absolute()
            reason = why_unsafe(folder, frozenset(owners))
            if reason:
                why_unsafe.cache_clear()
            if reason and issubclass(kind, UserProvidedCacheLocator):
                raise InputError(
                    f"NUMBA_CACHE_DIR: expected a folder that only you can write, because what is in it is executed; "
                    f"{reason}: remove that permission (chmod go-w) or name another folder"
                )
            if reason:
                logger.info("compiled functions are not stored in %s: %s", folder, reason)
            return None if reason else found

    return Guarded


class _Temporary(SourceStamp, _CacheLocator):
    """The last folder that is tried."""

    def __init__(self, function: Any, file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        self._path = str(temporary_folder() / self.get_suitable_cache_subpath(file))

    def get_cache_path(self) -> str:
        return self._path

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        try:
            return super().from_function(function, file)
        except OSError:
            return None


class _Checked(CompileResultCacheImpl):
    """Stores a function with its sha256, because damaged machine code would end the process."""

    _locator_classes = [*map(_guarded, CacheImpl._locator_classes), _Temporary]  # noqa: RUF012 - numba's base class says how

    def reduce(self, result: Any) -> tuple[bytes, bytes]:
        whole = dumps(super().reduce(result))
        return hashlib.sha256(whole).digest(), whole

    def rebuild(self, context: Any, stored: tuple[bytes, bytes]) -> Any:
        digest, whole = stored
        if hashlib.sha256(whole).digest() != digest:
            raise pickle.UnpicklingError("its sha256 is another one")
        return super().rebuild(context, pickle.loads(whole))


class _SafeCache(FunctionCache):
    """A function's files, which are written again if they are damaged."""

    _impl_class = _Checked

    def load_overload(self, signature: Any, context: Any) -> Any:
        found = None
        try:
            found = super().load_overload(signature, context)
        # a damaged pickle can raise anything
        except Exception as reason:
            self._forget(reason)
        if found is None:
            announce()
        return found

    def save_overload(self, signature: Any, result: Any) -> None:
        try:
            try:
                super().save_overload(signature, result)
            except OSError:
                raise
            except Exception as reason:
                self._forget(reason)
                super().save_overload(signature, result)
        except OSError as reason:
            logger.warning("a compiled function is not stored in %s (%s)", self.cache_path, reason)

    def _forget(self, reason: Exception) -> None:
        logger.info("a damaged file of compiled functions in %s is made again (%r)", self.cache_path, reason)
        with suppress(OSError):
            self.flush()


def is_stored(function: Any, kinds: tuple[Any, ...]) -> bool:
    """Return whether a function compiled for arguments of these numba types is on disk."""
    cache = function._cache
    if not isinstance(cache, _SafeCache):
        return False
    try:
        return cache._index_key(kinds, function.targetctx.codegen()) in cache._cache_file._load_index()
    # a damaged index can raise anything
    except Exception:
        return False
