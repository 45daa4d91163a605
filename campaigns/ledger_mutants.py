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
import gc
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import numpy as np
import sympy as sp

import asperity
from asperity.core.tables import table
from asperity.geometry.disk import disk, rolling
from asperity.kernels.walls import circular_arc, triangular
from asperity.ledger import Entry
from asperity.ledger import index as ledger
from campaigns.cases.equivalent_mutants import EQUIVALENT, EQUIVALENT_IN_THE_LIBRARY

from .pages import print_table

ROOT = Path(asperity.__file__).parent
# Modules with the formulas' own helpers.
HELPERS = ("ledger",)
# The library's formulas that rows use. Rectangular teeth are excluded: most of their code handles extreme numbers of
# crossings, which the tests of that law cover. The class of disks is excluded because it has its own tests.
LIBRARY = (disk, rolling, triangular, circular_arc)
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


Formula = Callable[..., Any]


@dataclass(frozen=True)
class Change:
    """A function changed in one position; ``label`` contains its name and the changed line."""

    label: str
    function: FunctionType
    code: CodeType

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """Install the changed code in the function, for all callers."""
        kept, self.function.__code__ = self.function.__code__, self.code
        try:
            yield
        finally:
            self.function.__code__ = kept


@dataclass(frozen=True)
class Mutant:
    """A wrong formula: a change of its code, of an argument or of its result."""

    label: str
    formula: Formula


@dataclass(frozen=True)
class Outcome:
    """A row's answer to a mutant of its formula: refused, undecided, raised, slow, or accepted."""

    row: str
    label: str
    answer: str
    evidence: str


def changes(function: FunctionType) -> list[Change]:
    """All versions of the function with one changed position."""
    name, node = _parsed(function.__code__)
    if node is None:
        return []
    found: dict[str, Change] = {}
    for changed, line in _changed(node):
        code = _compiled(changed, function.__code__)
        label = f"{name}: {line}"
        if code.co_code != function.__code__.co_code or code.co_consts != function.__code__.co_consts \
                or code.co_names != function.__code__.co_names:  # fmt: skip
            found.setdefault(label, Change(label, function, code))
    return list(found.values())


@cache
def _tree(filename: str) -> ast.Module:
    return ast.parse(Path(filename).read_text(encoding="utf-8"))


def _parsed(code: CodeType) -> tuple[str, ast.FunctionDef | ast.Lambda | None]:
    """The name and the syntax tree of a code object."""
    path = Path(code.co_filename)
    for node in ast.walk(_tree(code.co_filename)):
        if isinstance(node, ast.FunctionDef) and node.name == code.co_name:
            if min([node.lineno, *(d.lineno for d in node.decorator_list)]) == code.co_firstlineno:
                return f"{path.stem}.{code.co_qualname}", node
        elif isinstance(node, ast.Lambda) and code.co_name == "<lambda>" and node.lineno == code.co_firstlineno:
            places = [(line, column) for line, _, column, _ in code.co_positions() if line and column]
            ends = node.body.end_lineno, node.body.end_col_offset
            if places and (node.body.lineno, node.body.col_offset) <= min(places) and max(places) <= ends:
                return "formula", node
    return "", None


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
    name = "<lambda>" if isinstance(node, ast.Lambda) else node.name
    return next(c for c in made.co_consts if isinstance(c, CodeType) and c.co_name == name)


def _changed(node: ast.FunctionDef | ast.Lambda) -> Iterator[tuple[Any, str]]:
    """Copies of the function with one changed position, each with the changed line."""
    for number, (line, field) in enumerate(_lines(node)):
        start: Steps = ((field, None),)
        for path in _places(_at(line, start), start):
            for new in _replacements(_at(line, path)):
                whole = copy.deepcopy(node)
                target = _lines(whole)[number][0]
                _put(target, path, new)
                yield (
                    whole,
                    ast.unparse(target if isinstance(target, ast.stmt) and field == "value" else _at(target, start)),
                )


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


Steps = tuple[tuple[str, int | None], ...]


def _places(node: ast.AST, path: Steps) -> Iterator[Steps]:
    yield path
    for name, value in ast.iter_fields(node):
        if isinstance(node, ast.Subscript) and name == "slice":
            continue
        if isinstance(node, ast.keyword) and node.arg in SETTINGS:
            continue
        if isinstance(value, ast.AST):
            yield from _places(value, (*path, (name, None)))
        elif isinstance(value, list):
            for index, part in enumerate(value):
                if isinstance(part, ast.AST):
                    yield from _places(part, (*path, (name, index)))


def _at(node: Any, path: Steps) -> Any:
    for name, index in path:
        node = getattr(node, name) if index is None else getattr(node, name)[index]
    return node


def _put(node: Any, path: Steps, new: ast.AST) -> None:
    name, index = path[-1]
    owner = _at(node, path[:-1])
    if index is None:
        setattr(owner, name, new)
    else:
        getattr(owner, name)[index] = new


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


def mutants_of(entry: Entry) -> list[Mutant]:
    """Every mutant of a row's right formula, of its helpers, its arguments and its result."""
    called: dict[CodeType, None] = {}
    calls: list[tuple[tuple[Any, ...], Any]] = []

    def profile(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and _written_in(HELPERS, frame.f_code):
            called.setdefault(frame.f_code)

    def watched(*args: Any) -> Any:
        sys.setprofile(profile)
        try:
            result = formula(*args)
        finally:
            sys.setprofile(None)
        calls.append((args, result))
        return result

    assert entry.check is not None and entry.right is not None
    formula = entry.right
    entry.check(watched)
    functions = {id(formula): formula} if isinstance(formula, FunctionType) else {}
    # one search for all, which looks through everything that Python holds
    owners = [owner for owner in gc.get_referrers(*called) if isinstance(owner, FunctionType)]
    for code in called:
        functions.update({id(owner): owner for owner in owners if owner.__code__ is code})
    found = [
        Mutant(change.label, _within(formula, change))
        for function in functions.values()
        for change in changes(function)
    ]
    args, result = calls[0]
    for index, argument in enumerate(args):
        if _shifted(argument) is not None and _reads(formula, index):
            found.append(Mutant(f"argument {index + 1} moved", _with_argument(formula, index)))
    for name, turn in (("moved", _shifted), ("negated", _negated)):
        if turn(result) is not None:
            found.append(Mutant(f"result {name}", _with_result(formula, turn)))
        if isinstance(result, list | tuple):
            for index, part in enumerate(result):
                if turn(part) is not None and not _is_zero(turn(part)):
                    found.append(Mutant(f"result {index + 1} {name}", _with_part(formula, index, turn)))
    return found


def _reads(formula: Formula, index: int) -> bool:
    """Whether a formula uses an argument at all."""
    if not isinstance(formula, FunctionType):
        return True
    name = formula.__code__.co_varnames[index]
    node = _parsed(formula.__code__)[1]
    return node is None or any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node))


def _is_zero(value: Any) -> bool:
    return isinstance(value, int | sp.Integer) and not isinstance(value, bool) and value == 0


def _written_in(places: tuple[str, ...], code: CodeType) -> bool:
    return code.co_filename.startswith(tuple(str(ROOT / part) for part in places))


def _within(formula: Formula, change: Change) -> Formula:
    """The formula as the only function that sees the change."""

    def changed(*args: Any) -> Any:
        with change.in_place():
            return formula(*args)

    return changed


def _with_argument(formula: Formula, index: int) -> Formula:
    return lambda *args: formula(*args[:index], _shifted(args[index]), *args[index + 1 :])


def _with_result(formula: Formula, turn: Formula) -> Formula:
    return lambda *args: turn(formula(*args))


def _with_part(formula: Formula, index: int, turn: Formula) -> Formula:
    def changed(*args: Any) -> Any:
        parts = list(formula(*args))
        parts[index] = turn(parts[index])
        return type(formula(*args))(parts)

    return changed


def _shifted(value: Any) -> Any:
    """The value shifted by STEP, integers by 1, conditions set to always hold; None if it is not a number."""
    if isinstance(value, list | tuple):
        parts = [_shifted(part) for part in value]
        return None if any(part is None for part in parts) else type(value)(parts)
    if isinstance(value, sp.MatrixBase):
        return value.applyfunc(lambda part: part + SYMBOLIC_STEP)
    if isinstance(value, sp.Expr):
        return value + (1 if value.is_Integer else SYMBOLIC_STEP)
    if not isinstance(value, bool | int | float | np.generic | np.ndarray):
        return None
    kind = np.asarray(value).dtype.kind
    return np.ones_like(value) if kind == "b" else value + 1 if kind in "iu" else value + STEP


def _negated(value: Any) -> Any:
    """The value with the opposite sign, conditions set to never hold; None if it is not a number."""
    if isinstance(value, list | tuple):
        parts = [_negated(part) for part in value]
        return None if any(part is None for part in parts) else type(value)(parts)
    if isinstance(value, bool) or (isinstance(value, np.ndarray | np.generic) and np.asarray(value).dtype.kind == "b"):
        return np.zeros_like(value)
    return -value if isinstance(value, sp.MatrixBase | sp.Expr | int | float | np.generic | np.ndarray) else None


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


def judged(entry: Entry, mutant: Mutant) -> Outcome:
    """The result of a row's check for a mutant that only its formula sees."""
    assert entry.check is not None
    expected = "proved" if entry.kind == "symbolic" else "agrees"
    try:
        with _at_most(SECONDS), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found = entry.check(mutant.formula)
    except TooSlow:
        return Outcome(entry.id, mutant.label, "slow", "")
    except Exception as error:
        return Outcome(entry.id, mutant.label, "raised", repr(error))
    answer = "accepted" if found.answer == expected else found.answer
    return Outcome(entry.id, mutant.label, answer, str(found))


def outcomes_of(entry: Entry) -> list[Outcome]:
    """The results of a row's check for all mutants."""
    return [judged(entry, mutant) for mutant in mutants_of(entry)]


@dataclass(frozen=True)
class LibraryFunction:
    """A formula of the library, and the rows whose checks or formulas call it."""

    name: str
    function: FunctionType
    rows: tuple[Entry, ...]


def library(entries: list[Entry]) -> list[LibraryFunction]:
    """Every function of the library's formulas, with the rows that call it."""
    functions: dict[str, FunctionType] = {}
    for module in LIBRARY:
        for owner in (
            module,
            *(value for value in vars(module).values() if isinstance(value, type) and value is not disk.Disk),
        ):
            for function in vars(owner).values():
                here = isinstance(function, FunctionType) and function.__code__.co_filename == module.__file__
                # the code of a function that calls super() cannot be exchanged
                if here and not function.__closure__ and function.__name__ != "__post_init__":
                    functions[f"{module.__name__.rpartition('.')[2]}.{function.__qualname__}"] = function
    callers: dict[str, list[Entry]] = {name: [] for name in functions}
    for entry in entries:
        assert entry.check is not None and entry.right is not None
        with _watched(functions) as called:
            entry.check(entry.right)
        for name in called:
            callers[name].append(entry)
    return [LibraryFunction(name, function, tuple(callers[name])) for name, function in functions.items()]


@contextmanager
def _watched(functions: dict[str, FunctionType]) -> Iterator[set[str]]:
    """The names of the functions called inside the context, by any caller."""
    called: set[str] = set()
    kept = {name: function.__code__ for name, function in functions.items()}
    originals = {name: FunctionType(f.__code__, f.__globals__, name, f.__defaults__) for name, f in functions.items()}

    def noted(name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        called.add(name)
        return originals[name](*args, **kwargs)

    for name, function in functions.items():
        function.__globals__["_noted"] = noted
        source = f"lambda *args, **kwargs: _noted({name!r}, args, kwargs)"
        function.__code__ = compile(source, "<watched>", "eval").co_consts[0]
    try:
        yield called
    finally:
        for name, function in functions.items():
            function.__code__ = kept[name]
            function.__globals__.pop("_noted", None)


def noticed(function: LibraryFunction, change: Change) -> str | None:
    """The first row whose status fails with the changed function, None if all rows hold."""
    for entry in function.rows:
        with change.in_place():
            outcome = judged(entry, Mutant(change.label, entry.right))
        if outcome.answer != "accepted":
            return entry.id
    return None


def table_of(outcomes: list[Outcome], rows: list[Entry]) -> str:
    """One line for each row: its mutants, how many were refused, undecided or raised, and the accepted ones."""
    lines: list[tuple[object, ...]] = []
    totals = [0] * 5
    for entry in rows:
        mine = [outcome for outcome in outcomes if outcome.row == entry.id]
        equal = [outcome for outcome in mine if (outcome.row, outcome.label) in EQUIVALENT]
        answers = Counter(outcome.answer for outcome in mine if outcome not in equal)
        undefined = answers["raised"] + answers["undecided"]
        counts = [len(mine), answers["refuted"], undefined, len(equal)]
        counts.append(len(mine) - sum(counts[1:]))
        totals = [total + count for total, count in zip(totals, counts, strict=True)]
        lines.append((entry.id, entry.kind, *counts))
    return table("row | kind | mutants | refuted | undefined | equivalent | accepted", [*lines, ("all", "", *totals)])


def main(argv: list[str] | None = None) -> int:
    """Print the tables; return 1 if a check accepts a wrong formula or no row notices a wrong library."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ids", nargs="*", help="rows, by the beginning of their ids")
    parser.add_argument("--library", action="store_true", help="change the library's formulas for the whole ledger")
    arguments = parser.parse_args(argv)
    if arguments.library and arguments.ids:
        parser.error("--library asks all rows")
    rows = [entry for entry in ledger.selected(arguments.ids) if entry.check is not None]
    if arguments.library:
        return _print_library(rows)
    outcomes = [outcome for entry in rows for outcome in outcomes_of(entry)]
    print(table_of(outcomes, rows))
    left = [o for o in outcomes if o.answer in ("accepted", "slow") and (o.row, o.label) not in EQUIVALENT]
    for outcome in left:
        print(f"\n{outcome.row} {outcome.answer}: {outcome.label}")
    return int(bool(left))


def _print_library(rows: list[Entry]) -> int:
    left: list[str] = []

    def counts(function: LibraryFunction) -> tuple[object, ...]:
        all_changes = changes(function.function)
        unnoticed = [change.label for change in all_changes if noticed(function, change) is None]
        worse = [label for label in unnoticed if label not in EQUIVALENT_IN_THE_LIBRARY]
        left.extend(worse)
        found = len(all_changes) - len(unnoticed)
        equal = len(unnoticed) - len(worse)
        return f"`{function.name}`", len(function.rows), len(all_changes), found, equal, len(worse)

    asked = (counts(function) for function in library(rows) if function.rows)
    print_table("function | rows | changes | noticed | equivalent | unnoticed", asked)
    for label in left:
        print(f"\nunnoticed: {label}")
    return int(bool(left))


if __name__ == "__main__":
    sys.exit(main())
