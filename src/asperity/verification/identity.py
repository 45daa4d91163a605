"""Decide identities and inequalities given by a user: proved, refuted with a counterexample, or undecided."""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from ..core.checks import positive_number
from ..core.child import ChildCrashed, ChildProcess, OutOfTime
from ..core.errors import InputError
from .verdict import Verdict

TIME_LIMIT = 10.0


def verify(
    lhs: Any,
    rhs: Any = None,
    assumptions: Iterable[Any] | Mapping[Any, tuple[Any, Any]] = (),
    *,
    time_limit: float | None = TIME_LIMIT,
) -> Verdict:
    """Decide whether two expressions are equal wherever both are defined and real, or whether an inequality holds.

    Parameters
    ----------
    lhs, rhs : sympy expressions, numbers, matrices, arrays or nested sequences of them
            Both have the same shape and are compared entry by entry. Decimal numbers are read as their exact binary
            fractions. Text is refused, because sympy would execute it. ``lhs`` may be a relation such as ``a <= b`` or
            a sequence of relations. Then there is no ``rhs``, and the assumptions may be the second argument.
        assumptions : sympy relation, iterable of them, or mapping from symbols to open intervals
            Inequalities such as ``0 < theta`` or ``x <= y``, also with ``|`` and ``~``, or ``{theta: (0, sympy.pi)}``,
            in addition to the properties of the symbols (``positive=True``, ``integer=True``). Symbols stand for real
            numbers.
        time_limit : float or None
            Seconds after which the answer is ``"undecided"``. The work runs in a separate process, which is killed at
            the limit. The process starts with the first call, which takes about a second, and serves later calls. None:
            no limit, and no separate process.

    Returns
    -------
    Verdict
            ``"proved"`` rests on an exact derivation. ``"refuted"`` has a counterexample: an exact point that meets the
            assumptions and at which both sides are defined. Balls that contain the two values show that the relation
            fails. ``"undecided"`` names the reason. Integrals over one symbol are refuted but never
            proved; derivatives, sums and limits are not evaluated.

    Raises
    ------
    InputError
            If a side or an assumption is text or another object than these, the shapes differ, an assumption is not an
            inequality, two symbols have one name, a side has the imaginary unit, no point meets the assumptions, or at
            each examined point of the domain one side is undefined or not real.

    Notes
    -----
    An expression is defined at a point if it and all its parts are real there, with the conventions of sympy: 0**0 is
    1, the cube root of -1 is not real, sign(0) is 0, and ``acot`` jumps at 0.

    The signs of constants come from ball arithmetic, because some that sympy believes are wrong. What sympy evaluates
    when an expression is written, before it is given here, stays evaluated: ``Abs(x * csc(exp(11) + 58 * pi / 125))``
    becomes ``-x * csc(...)`` for a positive x, although the factor is positive. Write such functions, and bounds such
    as ``x > csc(...)``, with ``evaluate=False``.

    Examples
    --------
    >>> import sympy
    >>> theta, m = sympy.Symbol("theta"), sympy.Symbol("m", positive=True)
    >>> verify(sympy.sqrt(m**2 * sympy.sin(theta) ** 2), m * sympy.sin(theta), [0 < theta, theta < sympy.pi]).answer
    'proved'
    >>> verdict = verify(sympy.sqrt(m**2), -m)
    >>> verdict.answer, sorted(verdict.counterexample)
    ('refuted', ['m'])
    >>> verify(2 * m <= m**2 + 1).answer
    'proved'
    """
    from .derivation import claims_of

    claims, relations = claims_of(lhs, rhs, assumptions)
    if time_limit is not None:
        return _decided_in_time(claims, relations, positive_number("time_limit", time_limit))
    from .derivation import decide

    return decide(claims, relations)


def _decided_in_time(claims: list[Any], relations: list[Any], seconds: float) -> Verdict:
    """The verdict of `derivation.decide` in a process, or *undecided* after ``seconds``."""
    from .constants import Pickler

    question = io.BytesIO()
    try:
        Pickler(question).dump((claims, relations))
    except (pickle.PicklingError, AttributeError, TypeError, RecursionError) as error:
        raise InputError(
            f"lhs, rhs: expected expressions that can be pickled ({error}); pass time_limit=None"
        ) from error
    try:
        return Verdict(*_child.call(_answer, question.getvalue(), seconds=seconds))
    except OutOfTime:
        return Verdict("undecided", f"the time limit of {seconds:g} s was reached")
    except ChildCrashed as error:
        return Verdict("undecided", f"{error}, perhaps for lack of memory")


def _load() -> None:
    import_module(".derivation", __package__)


# It starts with the first question, in about a second.
_child = ChildProcess(_load)


def _answer(question: bytes) -> tuple[Any, ...]:
    """The parts of a verdict; in the other process."""
    from .derivation import decide

    try:
        claims, relations = pickle.loads(question)
    except Exception as error:
        raise InputError(f"lhs, rhs: expected expressions of sympy ({error}); pass time_limit=None") from error
    found = decide(claims, relations)
    # a mapping proxy cannot be pickled
    return found.answer, found.evidence, dict(found.counterexample), found.values
