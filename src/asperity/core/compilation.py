"""The decorator of compiled functions. Loads numba.

numba compiles a function when it is first called, and stores the result beside the module, else in the user's cache
folder; NUMBA_CACHE_DIR names another one.
"""

from __future__ import annotations

import builtins
import gc
import hashlib
import importlib
import logging
import math
import multiprocessing
import operator
import sys
from collections.abc import Callable
from functools import cache, partial
from inspect import signature
from pathlib import Path
from types import CellType, FunctionType
from typing import Any, ClassVar
from weakref import WeakSet

from numba import njit, types
from numba._dynfunc import make_function
from numba.core import event
from numba.core.base import BaseContext
from numba.core.cgutils import alloca_once
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.ir import UNDEFINED
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.typing.context import Context
from numba.core.untyped_passes import InlineClosureLikes
from numba.np import linalg

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
    decorate: Any = partial(njit, pipeline_class=_LinkedPipeline if linked else _Pipeline, **{**OPTIONS, **options})

    def compiled(function: Any) -> Any:
        try:
            dispatcher = decorate(cache=not linked)(function if linked else _with_digest(function))
        except RuntimeError:
            _warn_of_no_folder()
            dispatcher = decorate()(function)
        COMPILED.add(dispatcher)
        if options.get("no_cpython_wrapper") and isinstance(dispatcher, CPUDispatcher):
            dispatcher.__class__ = _Inner
        return dispatcher

    return compiled


class _Inner(CPUDispatcher):
    """A function without a wrapper for Python, whose call from there would end the process."""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__}: only compiled functions call it; from Python call its py_func")


@cache
def digest() -> int:
    """Return a number for the sources of all compiled functions and of the constants in them."""
    package = Path(__file__).parents[1]
    sources = [Path(__file__), package / "core" / "rounding.py"]
    for folder in ("compiled", "double_double", "scene"):
        sources += sorted(package.glob(f"geometry/**/{folder}/*.py"))
    return int.from_bytes(hashlib.sha256(b"".join(source.read_bytes() for source in sources)).digest()[:8], "big")


def _with_digest(function: Any) -> Any:
    """Return the function with the digest among the variables of its closure.

    numba finds a stored function by its own source and by these variables, but not by the functions that it calls.
    """
    code = function.__code__.replace(co_freevars=(*function.__code__.co_freevars, "digest"))
    closure = (*(function.__closure__ or ()), CellType(digest()))
    made = FunctionType(code, function.__globals__, function.__name__, function.__defaults__, closure)
    made.__module__, made.__qualname__, made.__doc__ = function.__module__, function.__qualname__, function.__doc__
    return made


@cache
def _warn_of_no_folder() -> None:
    logger.warning("no folder is writable, so compiled functions are not stored; set NUMBA_CACHE_DIR")


class _Announcement(event.Listener):
    """Says once that functions are being compiled: in the log, and on a terminal."""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] in COMPILED:
            announce()

    def on_end(self, event: Any) -> None:
        pass


COMPILED: WeakSet[Any] = WeakSet()
event.register("numba:compile", _Announcement())


@cache
def announce() -> None:
    """Say that functions are being compiled."""
    text = "asperity: compiling, once (about 10 s)"
    logger.info(text)
    if sys.stderr is not None and sys.stderr.isatty() and multiprocessing.parent_process() is None:
        print(text, file=sys.stderr, flush=True)


def is_stored(function: Any) -> bool:
    """Return whether a compiled function has been stored on disk, perhaps from other sources."""
    folder = function.stats.cache_path
    name = f"{Path(function.py_func.__code__.co_filename).stem}.{function.py_func.__name__}-"
    return folder is not None and any(path.name.startswith(name) for path in Path(folder).glob("*.nbi"))
