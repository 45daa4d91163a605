"""Identities of a user's own: proved, refuted with a counterexample, or undecided."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import InputError
from .verdict import Verdict, every

SEED = 0


def verify(lhs: Any, rhs: Any, assumptions: Iterable[Any] | Mapping[Any, tuple[Any, Any]] = ()) -> Verdict:
    """Decide whether two expressions are equal wherever both are defined.

    Parameters
    ----------
    lhs, rhs : sympy expressions, numbers, matrices or nested sequences of them
        Both of one shape; they are compared entry by entry. Decimal numbers are taken as the fractions that they are
        in binary.
    assumptions : sympy relation, iterable of them, or mapping from symbols to open intervals
        Inequalities such as ``0 < theta`` or ``theta < sympy.pi``, or ``{theta: (0, sympy.pi)}``, beside what the
        symbols themselves carry (``positive=True``). Symbols stand for real numbers.

    Returns
    -------
    Verdict
        ``"proved"`` rests on an exact derivation. ``"refuted"`` has a rational counterexample that meets the
        assumptions, and both values there. ``"undecided"`` means that neither was found: no counterexample among the
        points tried, no proof among the routes known.

    Raises
    ------
    InputError
        If the shapes differ, an assumption is not an inequality, or no point meets the assumptions.

    Notes
    -----
    Sums and products of sines take tenths of a second. Roots and absolute values of sums of angles are factored, which
    may take a minute before the answer is *undecided*; bounds for the angles and fewer of them help.

    Examples
    --------
    >>> import sympy
    >>> theta, m = sympy.Symbol("theta"), sympy.Symbol("m", positive=True)
    >>> verify(sympy.sqrt(m**2 * sympy.sin(theta) ** 2), m * sympy.sin(theta), [0 < theta, theta < sympy.pi]).answer
    'proved'
    >>> verdict = verify(sympy.sqrt(m**2), -m)
    >>> verdict.answer, sorted(verdict.counterexample)
    ('refuted', ['m'])
    """
    import sympy as sp

    left, right = _entries(sp, lhs), _entries(sp, rhs)
    if len(left) != len(right):
        raise InputError(f"lhs, rhs: expected one shape, got {len(left)} and {len(right)} entries")
    if isinstance(lhs, sp.MatrixBase) and isinstance(rhs, sp.MatrixBase) and lhs.shape != rhs.shape:
        raise InputError(f"lhs, rhs: expected matrices of one shape, got {lhs.shape} and {rhs.shape}")
    given = _relations(sp, assumptions)
    return every(*(_decided(a, b, given) for a, b in zip(left, right, strict=True)))


def _entries(sp: Any, side: Any) -> list[Any]:
    if isinstance(side, sp.MatrixBase | list | tuple):
        return [entry for part in side for entry in _entries(sp, part)]
    return [sp.sympify(side, rational=False).replace(lambda e: e.is_Float, lambda e: sp.Rational(e))]


def _relations(sp: Any, assumptions: Any) -> list[Any]:
    if isinstance(assumptions, Mapping):
        return [side for symbol, (low, high) in assumptions.items() for side in (low < symbol, symbol < high)]
    return [assumptions] if isinstance(assumptions, sp.Basic) else list(assumptions)


def _decided(left: Any, right: Any, assumptions: list[Any]) -> Verdict:
    import numpy as np

    from .derivation import derive_equality
    from .domain import Domain
    from .refutation import refute_equality

    domain = Domain.of(left.free_symbols | right.free_symbols, assumptions)
    refuted = refute_equality(left, right, domain.points(np.random.default_rng(SEED)))
    if refuted is not None:
        return refuted
    route = derive_equality(left, right, domain)
    if route is not None:
        return Verdict("proved", route)
    return Verdict("undecided", "no counterexample among the points tried, and no proof among the routes known")
