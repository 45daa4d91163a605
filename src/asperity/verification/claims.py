"""Claims and assumptions as a user writes them, in the form in which they are decided.

A claim is a triple (left, right, "==", "<=" or "<"). Text is refused, because sympy would execute it.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

import sympy as sp

from ..core.errors import InputError

Claim = tuple[Any, Any, str]
_RELATIONS = {sp.Eq: "==", sp.Le: "<=", sp.Ge: "<=", sp.Lt: "<", sp.Gt: "<"}


def claims_of(lhs: Any, rhs: Any, assumptions: Any) -> tuple[list[Claim], list[Any]]:
    """The claims and the relations of the arguments of `verify`."""
    if rhs is not None and not _are_relations(lhs):
        return _equations(lhs, rhs), _assumed(assumptions)
    if rhs is not None and assumptions != ():
        raise InputError("rhs: expected none beside a relation; assumptions are the second argument then")
    return _related(lhs), _assumed(assumptions if rhs is None else rhs)


def _are_relations(side: Any) -> bool:
    if isinstance(side, list | tuple):
        return bool(side) and all(_are_relations(part) for part in side)
    return isinstance(side, sp.logic.boolalg.Boolean | bool) and not isinstance(side, sp.Symbol)


def _related(given: Any) -> list[Claim]:
    if isinstance(given, list | tuple):
        return [claim for part in given for claim in _related(part)]
    if isinstance(given, sp.And):
        return [claim for part in given.args for claim in _related(part)]
    if isinstance(given, bool):
        # of expressions that are written differently == is False, whatever they are
        raise InputError(f"lhs: Python has made {given} of this formula; pass both sides, or sympy.Eq(lhs, rhs)")
    if given is sp.true or given is sp.false:
        # sympy has already decided it
        return [(sp.Integer(0), sp.Integer(0 if given else 1), "==")]
    if type(given) not in _RELATIONS:
        raise InputError(f"lhs: expected two sides, or a relation such as a <= b, got {given!r} alone")
    if isinstance(given, sp.Eq):
        return _equations(*given.args)
    left, right = (_exact("lhs", side) for side in given.args)
    sides = (right, left) if isinstance(given, sp.Ge | sp.Gt) else (left, right)
    return [(*sides, _RELATIONS[type(given)])]


def _equations(lhs: Any, rhs: Any) -> list[Claim]:
    left, right = _entries(lhs), _entries(rhs)
    if len(left) != len(right) or not left:
        raise InputError(f"lhs, rhs: expected one shape, not empty, got {len(left)} and {len(right)} entries")
    if isinstance(lhs, sp.MatrixBase) and isinstance(rhs, sp.MatrixBase) and lhs.shape != rhs.shape:
        raise InputError(f"lhs, rhs: expected matrices of one shape, got {lhs.shape} and {rhs.shape}")
    return [(a, b, "==") for a, b in zip(left, right, strict=True)]


def _entries(side: Any) -> list[Any]:
    # of arrays and matrices, of numpy or of sympy
    side = side.tolist() if hasattr(side, "tolist") else side
    if isinstance(side, sp.Tuple | list | tuple):
        return [entry for part in side for entry in _entries(part)]
    return [_exact("lhs, rhs", side)]


def _exact(name: str, given: Any, kind: type = sp.Expr) -> Any:
    """The sympy object; text is refused, because sympy would execute it."""
    try:
        found = sp.sympify(given, strict=True)
    except sp.SympifyError:
        found = None
    if isinstance(found, kind) and not getattr(found, "is_Matrix", False):
        return found
    raise InputError(
        f"{name}: expected expressions, equations or inequalities of sympy, or numbers, got {reprlib.repr(given)}; "
        "build expressions from sympy.Symbol"
    )


def _assumed(assumptions: Any) -> list[Any]:
    if isinstance(assumptions, Mapping):
        try:
            bounds = [(symbol, low, high) for symbol, (low, high) in assumptions.items()]
        except (TypeError, ValueError) as reason:
            raise InputError(
                f"assumptions: expected an interval (low, high) for each symbol, got {reprlib.repr(assumptions)}"
            ) from reason
        exact = [[_exact("assumptions", part) for part in bound] for bound in bounds]
        return [sp.Lt(*side, evaluate=False) for symbol, low, high in exact for side in ((low, symbol), (symbol, high))]
    given = [assumptions] if isinstance(assumptions, sp.Basic | bool | str) else assumptions
    try:
        found = [_exact("assumptions", one, sp.Basic) for one in given]
    except TypeError as reason:
        raise InputError(f"assumptions: expected relations, got {reprlib.repr(assumptions)}") from reason
    if any(isinstance(one, bool) for one in given):
        raise InputError("assumptions: Python has made True or False of one; write sympy.Ne(x, 1) for x != 1")
    return found
