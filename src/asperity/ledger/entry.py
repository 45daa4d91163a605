"""Ledger entries: a formula as printed, its corrected form, and the check that distinguishes them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from inspect import cleandoc
from time import perf_counter
from typing import Any, Literal

import numpy as np

from ..core.errors import InputError
from ..verification import Verdict

Status = Literal["verified", "erratum", "convention"]
Kind = Literal["symbolic", "numeric", "by reading"]
# A formula as code for its check. Code written over ``xp`` takes numbers (numpy) and symbols (sympy).
Code = Callable[..., Any]
Check = Callable[[Code], Verdict]

_ID = re.compile(r"S\d\.\d\d")


@dataclass(frozen=True)
class Entry:
    r"""One row of the ledger.

    Parameters
    ----------
    id : str
        ``S<section>.<number>``, stable.
    section, equation : str
        The position in Rudzis 2022; the equation may be empty.
    statement : str
        The statement in words.
    printed : str
        The formula as printed, in LaTeX.
    corrected : str or None
        The correct formula, or the formula in the named convention, in LaTeX; None for a verified entry.
    right, wrong : callable or None
        The formula that the check must accept, and one that it must refute, as code. The right one is the corrected
        formula, or the printed one of a verified entry. The wrong one is the printed formula of an erratum or
        convention, or a slightly perturbed formula if the printed one is right, or described but not quoted.
    status : {"verified", "erratum", "convention"}
    reason : str
        Two sentences: why the formula is right or wrong, and the consequence or the method of the check.
    kind : {"symbolic", "numeric", "by reading"}
        A symbolic check answers *proved*, a numeric check *agrees*. An entry by reading has no check.
    check : callable or None
        Takes a formula's code and returns a `Verdict`.

    Entries are written with the decorator `row`, and with `by_reading`.

    Examples
    --------
    >>> from asperity.ledger import row
    >>> from asperity.verification import agreement
    >>> @row(
    ...     id="S9.01", section="0", kind="numeric",
    ...     printed=r"2\pi r", wrong=lambda r: 6.283 * r,
    ...     corrected=r"\pi r^2", right=lambda r: 3.1416 * r**2,
    ... )
    ... def area(formula):
    ...     '''The area of a disk of radius r.
    ...
    ...     The printed formula is the circumference. A disk inscribed in a square has a smaller area.
    ...     '''
    ...     return agreement(formula(1.0), 3.14159, allowed=1e-4)
    >>> area.run().as_stated
    True
    """

    id: str
    section: str
    statement: str
    printed: str
    status: Status
    reason: str
    kind: Kind = "symbolic"
    corrected: str | None = None
    right: Code | None = None
    wrong: Code | None = None
    equation: str = ""
    check: Check | None = None

    def __post_init__(self) -> None:
        if not _ID.fullmatch(self.id):
            raise InputError(f"id: expected an S, a section, a dot and two digits such as S1.05, got {self.id!r}")
        if (self.status == "verified") == (self.corrected is not None):
            raise InputError(
                f"{self.id}: expected a corrected formula of an erratum or convention, and of no other row"
            )
        if self.kind != "by reading" and None in (self.check, self.right, self.wrong):
            raise InputError(f"{self.id}: expected a check, a formula that it accepts and one that it refutes, as code")

    def negated(self, *arguments: Any) -> Any:
        """The right formula with the opposite sign and the opposite conditions, code to try ``check`` on.

        Raises
        ------
        InputError
            If the value is neither numbers nor conditions, such as a wall.
        """
        return _opposite(self.right and self.right(*arguments))

    def run(self) -> Finding:
        """Run the check on the right and on the wrong formula."""
        if self.check is None or self.right is None or self.wrong is None:
            return Finding(self, None, None, 0.0)
        start = perf_counter()
        right, wrong = self.check(self.right), self.check(self.wrong)
        return Finding(self, right, wrong, perf_counter() - start)


def _opposite(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return type(value)(map(_opposite, value))
    if np.asarray(value).dtype == bool:
        return np.logical_not(value)
    try:
        return -value
    except TypeError as reason:
        raise InputError(f"negated: expected numbers or conditions, got {value!r}; write the wrong code") from reason


@dataclass(frozen=True)
class Finding:
    """The result of an entry's check.

    ``right`` and ``wrong`` are the verdicts on `Entry.right` and `Entry.wrong`, None for an entry by reading.
    ``seconds`` is the time for both.
    """

    entry: Entry
    right: Verdict | None
    wrong: Verdict | None
    seconds: float

    @property
    def as_stated(self) -> bool | None:
        """Whether the verdicts confirm the entry's status; None for an entry by reading."""
        if self.right is None or self.wrong is None:
            return None
        expected = "proved" if self.entry.kind == "symbolic" else "agrees"
        return self.right.answer == expected and self.wrong.answer == "refuted"


def row(*, status: Status | None = None, **fields: Any) -> Callable[[Check], Entry]:
    """Make a check the entry of a formula; takes the other fields of `Entry`.

    The statement and the reason are the first and the second part of the check's docstring. The status of an entry with
    a corrected formula is *erratum* if it is not given.
    """
    known: Status = status or ("erratum" if "corrected" in fields else "verified")

    def decorator(check: Check) -> Entry:
        statement, _, reason = cleandoc(check.__doc__ or "").partition("\n\n")
        words: dict[str, Any] = {"statement": " ".join(statement.split()), "reason": " ".join(reason.split())}
        return Entry(status=known, check=check, **words, **fields)

    return decorator


def by_reading(
    *, id: str, section: str, statement: str, printed: str, corrected: str, reason: str,
    status: Status = "erratum", equation: str = "",
) -> Entry:  # fmt: skip
    """The entry of a slip that only reading can show; its formulas are LaTeX without code."""
    return Entry(id, section, statement, printed, status, reason, "by reading", corrected, equation=equation)
