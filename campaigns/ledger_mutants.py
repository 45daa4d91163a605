"""Mutants of the ledger's right formulas: every check must refute them.

``python -m campaigns.ledger_mutants`` changes every right formula, and its helpers, in one position at a time: a
constant by one or in its sign, + to -, * to /, sin to cos, floor to ceil, min to max, a reversed comparison, a
hypothesis that always or never holds. It also shifts each argument and each part of the result, and changes their
signs. Only the formula sees the change, not its check. ``--library`` changes the library's formulas that rows use, for
the whole ledger including the checks, and tests whether any row notices.
"""

from __future__ import annotations

import argparse
import ast
import copy
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType, FrameType, FunctionType, ModuleType
from typing import Any

import numpy as np
import sympy as sp

import asperity
from asperity.geometry.disk import disk, rolling
from asperity.kernels.walls import circular_arc, polygons
from asperity.ledger import Entry
from asperity.ledger import entry as ledger
from campaigns.cases.equivalent_mutants import EQUIVALENT, EQUIVALENT_IN_THE_LIBRARY

from .pages import print_table

ROOT = Path(asperity.__file__).parent
# Modules with the formulas' own helpers.
HELPERS = str(ROOT / "ledger")
# The library's formulas that rows use. Rectangular teeth are excluded: most of their code handles extreme numbers of
# crossings, which the tests of that law cover. The class of disks is excluded because it has its own tests.
LIBRARY = (disk, rolling, polygons, circular_arc)
# Limit in processor seconds: checks take at most one, and slower mutants are counted separately.
SECONDS = 20.0
SWAPPED_OPERATORS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult,), ast.Pow: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,), ast.BitOr: (ast.BitAnd,), ast.And: (ast.Or,), ast.Or: (ast.And,),
    ast.Lt: (ast.Gt,), ast.Gt: (ast.Lt,), ast.LtE: (ast.GtE,), ast.GtE: (ast.LtE,), ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
}  # fmt: skip
SWAPPED_NAMES = {
    "sin": "cos", "cos": "sin", "arcsin": "arccos", "arccos": "arcsin", "asin": "acos", "acos": "asin",
    "floor": "ceil", "ceil": "floor", "minimum": "maximum", "maximum": "minimum", "min": "max", "max": "min",
}  # fmt: skip
# Shift of an argument or a result: not a multiple of the periods and sizes in the checks.
STEP, SYMBOLIC_STEP = 0.00123, sp.Rational(1, 8)
# Arguments that are options, not quantities.
SETTINGS = {"axis", "keepdims", "dtype"}
LIBRARY_HEADS = "function | rows | changes | noticed | equivalent | unnoticed"
HEADS = "row | kind | mutants | refuted | undefined | equivalent | accepted"
Formula = Callable[..., Any]


def changes(function: FunctionType) -> dict[str, CodeType]:
    """The code of the function with one changed position, by the function's name and the changed line."""
    code = function.__code__
    found: dict[str, CodeType] = {}
    node = _parsed(code)
    if node is None:
        return found
    name = "formula" if isinstance(node, ast.Lambda) else f"{Path(code.co_filename).stem}.{code.co_qualname}"
    for line in _changed(node):
        changed = _compiled(node, code)
        if (changed.co_code, changed.co_consts, changed.co_names) != (code.co_code, code.co_consts, code.co_names):
            found.setdefault(f"{name}: {line}", changed)
    return found


@contextmanager
def in_place(function: FunctionType, code: CodeType) -> Iterator[None]:
    """Install the changed code in the function, for all callers."""
    kept, function.__code__ = function.__code__, code
    try:
        yield
    finally:
        function.__code__ = kept


@cache
def _tree(filename: str) -> ast.Module:
    return ast.parse(Path(filename).read_text(encoding="utf-8"))


def _parsed(code: CodeType) -> ast.FunctionDef | ast.Lambda | None:
    """The syntax tree of a code object: the function of its name and first line, the lambda around its position."""
    for node in ast.walk(_tree(code.co_filename)):
        if isinstance(node, ast.FunctionDef) and node.name == code.co_name:
            if (node.decorator_list or [node])[0].lineno == code.co_firstlineno:
                return node
        elif isinstance(node, ast.Lambda) and code.co_name == "<lambda>" and node.lineno == code.co_firstlineno:
            first = min((line, column) for line, _, column, _ in code.co_positions() if line and column)
            body = node.body
            if (body.lineno, body.col_offset) <= first <= (body.end_lineno, body.end_col_offset):
                return node
    return None


def _compiled(node: ast.FunctionDef | ast.Lambda, like: CodeType) -> CodeType:
    """The code object of a function's tree, with the free variables of the original."""
    inner: ast.stmt
    if isinstance(node, ast.Lambda):
        inner = ast.Return(node)
    else:
        inner = copy.copy(node)
        inner.decorator_list = []
    cells = [ast.Assign([ast.Name(name, ast.Store())], ast.Constant(None)) for name in like.co_freevars]
    outer = ast.FunctionDef(
        "outer", ast.arguments([], [], None, [], [], None, []), [*cells, inner], [], None, lineno=1, col_offset=0
    )
    module = ast.fix_missing_locations(ast.Module([outer], []))
    made = compile(module, like.co_filename, "exec").co_consts[0]
    return next(c for c in made.co_consts if isinstance(c, CodeType) and c.co_name == like.co_name)


def _changed(node: ast.FunctionDef | ast.Lambda) -> Iterator[str]:
    """Change one position of the tree at a time and yield the changed line; then the change is undone."""
    for line, field in _lines(node):
        whole = isinstance(line, ast.stmt) and field == "value"
        for entries, key in list(_places(vars(line), field)):
            original = entries[key]
            for new in _replacements(original):
                entries[key] = new
                yield ast.unparse(line if whole else getattr(line, field))
                entries[key] = original


def _lines(node: ast.FunctionDef | ast.Lambda) -> list[tuple[ast.AST, str]]:
    """The computing nodes and their fields, without docstrings, raised errors and the errors' conditions."""
    if isinstance(node, ast.Lambda):
        return [(node, "body")]
    found: list[tuple[ast.AST, str]] = []
    for part in ast.walk(node):
        if isinstance(part, ast.Assign | ast.AugAssign | ast.Return) and part.value is not None:
            found.append((part, "value"))
        elif isinstance(part, ast.If) and not isinstance(part.body[0], ast.Raise):
            found.append((part, "test"))
    return found


def _places(entries: Any, key: Any) -> Iterator[tuple[Any, Any]]:
    """The nodes from an entry of a list or of a node's fields on, each as such an entry; no subscripts, no options."""
    node = entries[key]
    if isinstance(node, list):
        for index in range(len(node)):
            yield from _places(node, index)
    elif isinstance(node, ast.AST) and not (isinstance(node, ast.keyword) and node.arg in SETTINGS):
        yield entries, key
        for name in node._fields:
            if not (isinstance(node, ast.Subscript) and name == "slice"):
                yield from _places(vars(node), name)


def _replacements(node: ast.AST) -> Iterator[ast.AST]:
    """Possible replacements of a node."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        yield ast.Constant(node.value + 1)
        if node.value:
            yield ast.UnaryOp(ast.USub(), node)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node.operand
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in SWAPPED_NAMES:
        yield ast.Name(SWAPPED_NAMES[node.id], ast.Load())
    elif isinstance(node, ast.Attribute) and node.attr in SWAPPED_NAMES:
        yield ast.Attribute(node.value, SWAPPED_NAMES[node.attr], node.ctx)
    elif isinstance(node, ast.Compare):
        yield ast.BinOp(node, ast.BitOr(), ast.Constant(True))
        yield ast.BinOp(node, ast.BitAnd(), ast.Constant(False))
    for other in SWAPPED_OPERATORS.get(type(node), ()):
        yield other()


@contextmanager
def _calls() -> Iterator[dict[CodeType, None]]:
    """The code that runs inside the context, in the order of its first calls."""
    called: dict[CodeType, None] = {}

    def profile(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            called.setdefault(frame.f_code)

    sys.setprofile(profile)
    try:
        yield called
    finally:
        sys.setprofile(None)


def mutants_of(entry: Entry) -> dict[str, Formula]:
    """Every change of a row's right formula, of its helpers, its arguments and its result, which only it sees."""
    called: dict[CodeType, None] = {}
    calls: list[tuple[tuple[Any, ...], Any]] = []

    def watched(*args: Any) -> Any:
        with _calls() as codes:
            result = formula(*args)
        called.update({code: None for code in codes if code.co_filename.startswith(HELPERS)})
        calls.append((args, result))
        return result

    assert entry.check is not None and entry.right is not None
    formula = entry.right
    entry.check(watched)
    found = {
        label: _within(formula, function, code)
        for function in _reached(formula)
        if function is formula or function.__code__ in called
        for label, code in changes(function).items()
    }
    args, result = calls[0]
    for index, argument in enumerate(args):
        if _turned(argument) is not None and _reads(formula, index):
            found[f"argument {index + 1} moved"] = _with_argument(formula, index)
    for name, negate in (("moved", False), ("negated", True)):
        if _turned(result, negate) is not None:
            found[f"result {name}"] = _with_result(formula, negate)
        for index, part in enumerate(result if isinstance(result, list | tuple) else ()):
            turned = _turned(part, negate)
            if turned is not None and not _is_zero(turned):
                found[f"result {index + 1} {name}"] = _with_part(formula, index, negate)
    return found


def _reached(formula: Formula) -> list[FunctionType]:
    """The ledger's functions that a formula can call, itself first: in closures, by name, or by name in a module."""
    found: list[FunctionType] = []
    waiting: list[Any] = [formula]
    while waiting:
        one = waiting.pop(0)
        if not isinstance(one, FunctionType) or one in found:
            continue
        if one is not formula and not one.__code__.co_filename.startswith(HELPERS):
            continue
        found.append(one)
        used = _names(one.__code__)
        named = [value for name, value in one.__globals__.items() if name in used]
        modules = [vars(value) for value in named if isinstance(value, ModuleType)]
        waiting += [cell.cell_contents for cell in one.__closure__ or ()] + named
        waiting += [value for names in modules for name, value in names.items() if name in used]
    return found


def _names(code: CodeType) -> set[str]:
    """The names that a function's code looks up, with those of functions inside of it."""
    return set(code.co_names).union(*(_names(part) for part in code.co_consts if isinstance(part, CodeType)))


def _reads(formula: Formula, index: int) -> bool:
    """Whether a formula uses an argument at all."""
    node = _parsed(formula.__code__) if isinstance(formula, FunctionType) else None
    if node is None:
        return True
    name = formula.__code__.co_varnames[index]
    return any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node))


def _is_zero(value: Any) -> bool:
    return isinstance(value, int | sp.Integer) and not isinstance(value, bool) and value == 0


def _within(formula: Formula, function: FunctionType, code: CodeType) -> Formula:
    """The formula as the only one that sees the changed code of a function."""

    def changed(*args: Any) -> Any:
        with in_place(function, code):
            return formula(*args)

    return changed


def _with_argument(formula: Formula, index: int) -> Formula:
    return lambda *args: formula(*args[:index], _turned(args[index]), *args[index + 1 :])


def _with_result(formula: Formula, negate: bool) -> Formula:
    return lambda *args: _turned(formula(*args), negate)


def _with_part(formula: Formula, index: int, negate: bool) -> Formula:
    def changed(*args: Any) -> Any:
        result = formula(*args)
        parts = list(result)
        parts[index] = _turned(parts[index], negate)
        return type(result)(parts)

    return changed


def _turned(value: Any, negate: bool = False) -> Any:
    """The value moved by STEP, an integer by 1, a condition that always holds; or its negative, a condition that never
    holds; None if it is not a number."""
    if isinstance(value, list | tuple):
        parts = [_turned(part, negate) for part in value]
        return None if any(part is None for part in parts) else type(value)(parts)
    if isinstance(value, sp.MatrixBase):
        return -value if negate else value.applyfunc(lambda part: part + SYMBOLIC_STEP)
    if isinstance(value, sp.Expr):
        return -value if negate else value + (1 if value.is_Integer else SYMBOLIC_STEP)
    if not isinstance(value, bool | int | float | np.generic | np.ndarray):
        return None
    kind = np.asarray(value).dtype.kind
    if kind == "b":
        return np.full_like(value, not negate)
    return -value if negate else value + (1 if kind in "iu" else STEP)


class TooSlow(Exception):
    """A check exceeded its time limit."""


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    def ring(_: int, __: Any) -> None:
        raise TooSlow

    before = signal.signal(signal.SIGVTALRM, ring)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def judged(entry: Entry, formula: Formula) -> str:
    """The answer of a row's check to a formula: accepted, refuted, undecided, raised or slow."""
    assert entry.check is not None
    try:
        with _at_most(SECONDS), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            answer: str = entry.check(formula).answer
    except TooSlow:
        return "slow"
    except Exception:
        return "raised"
    return "accepted" if answer == ("proved" if entry.kind == "symbolic" else "agrees") else answer


def library(entries: list[Entry]) -> dict[FunctionType, list[Entry]]:
    """Every function of the library's formulas, with the rows whose checks or formulas call it."""
    found: dict[CodeType, FunctionType] = {}
    for module in LIBRARY:
        classes = (value for value in vars(module).values() if isinstance(value, type) and value is not disk.Disk)
        for function in (value for owner in (module, *classes) for value in vars(owner).values()):
            here = isinstance(function, FunctionType) and function.__code__.co_filename == module.__file__
            # the code of a function that calls super() cannot be exchanged
            if here and not function.__closure__ and function.__name__ != "__post_init__":
                found[function.__code__] = function
    callers: dict[FunctionType, list[Entry]] = {function: [] for function in found.values()}
    for entry in entries:
        assert entry.check is not None
        with _calls() as called:
            entry.check(entry.right)
        for code in called:
            if code in found:
                callers[found[code]].append(entry)
    return callers


def noticed(function: FunctionType, code: CodeType, rows: list[Entry]) -> str | None:
    """The first row whose status fails with the changed function, None if all rows hold."""
    for entry in rows:
        assert entry.right is not None
        with in_place(function, code):
            if judged(entry, entry.right) != "accepted":
                return entry.id
    return None


def answers(rows: list[Entry], left: list[str]) -> Iterator[tuple[object, ...]]:
    """A line for each row: its mutants by the answers; those that are accepted without a reason go to ``left``."""
    total = Counter[str]()
    for entry in rows:
        found = Counter[str]()
        for label, formula in mutants_of(entry).items():
            answer = "equivalent" if (entry.id, label) in EQUIVALENT else judged(entry, formula)
            found[answer] += 1
            if answer in ("accepted", "slow"):
                left.append(f"{entry.id} {answer}: {label}")
        total += found
        yield entry.id, entry.kind, *_counts(found)
    yield "all", "", *_counts(total)


def _counts(found: Counter[str]) -> tuple[int, ...]:
    undefined, accepted = found["raised"] + found["undecided"], found["accepted"] + found["slow"]
    return found.total(), found["refuted"], undefined, found["equivalent"], accepted


def library_answers(rows: list[Entry], left: list[str]) -> Iterator[tuple[object, ...]]:
    """A line for each function of the library that a row calls; changes without notice or reason go to ``left``."""
    for function, callers in library(rows).items():
        if callers:
            changed = changes(function)
            unnoticed = [label for label, code in changed.items() if noticed(function, code, callers) is None]
            worse = [label for label in unnoticed if label not in EQUIVALENT_IN_THE_LIBRARY]
            left += [f"unnoticed: {label}" for label in worse]
            seen, equal = len(changed) - len(unnoticed), len(unnoticed) - len(worse)
            name = f"`{function.__module__.rpartition('.')[2]}.{function.__qualname__}`"
            yield name, len(callers), len(changed), seen, equal, len(worse)


def main(argv: list[str] | None = None) -> int:
    """Print the table; return 1 if a check accepts a wrong formula or no row notices a wrong library."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ids", nargs="*", help="rows, by the beginning of their ids")
    parser.add_argument("--library", action="store_true", help="change the library's formulas for the whole ledger")
    arguments = parser.parse_args(argv)
    if arguments.library and arguments.ids:
        parser.error("--library asks all rows")
    rows = [entry for entry in ledger.selected(arguments.ids) if entry.check is not None]
    left: list[str] = []
    if arguments.library:
        print_table(LIBRARY_HEADS, library_answers(rows, left))
    else:
        print_table(HEADS, answers(rows, left))
    for line in left:
        print(f"\n{line}")
    return int(bool(left))


if __name__ == "__main__":
    sys.exit(main())
