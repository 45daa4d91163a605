"""Ledger entries: a formula as printed, its corrected form, and the check that distinguishes them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

from ..core.errors import InputError
from ..verification import Verdict

Status = Literal["verified", "erratum", "convention"]
Kind = Literal["symbolic", "numeric", "by reading"]
# A formula as code for its check. Code written over ``xp`` takes numbers (numpy) and symbols (sympy).
Code = Callable[..., Any]
Check = Callable[[Code], Verdict]

_ID = re.compile(r"S\d\.\d\d")


@dataclass(frozen=True)
class Formula:
    """A formula in LaTeX and, if a check calls it, as code."""

    latex: str
    code: Code | None = None


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
    printed : Formula
        The formula as printed. For an erratum the check must refute its code.
    corrected : Formula or None
        The correct formula, or the formula in the named convention; None for a verified entry.
    perturbed : callable or None
        A slightly wrong formula that the check must refute. It is needed for a verified entry, and for an erratum whose
        printed formula the audit describes but does not quote.
    status : {"verified", "erratum", "convention"}
    reason : str
        Two sentences: why the formula is right or wrong, and the consequence or the method of the check.
    kind : {"symbolic", "numeric", "by reading"}
        A symbolic check answers *proved*, a numeric check *agrees*. An entry by reading has no check.
    check : callable or None
        Takes a formula's code and returns a `Verdict`.

    Entries are written with the decorators `verified`, `erratum` and `convention`, and with `by_reading`.

    Examples
    --------
    >>> from asperity.ledger import Formula, erratum
    >>> from asperity.verification import agreement
    >>> @erratum(
    ...     id="S9.01", section="0", statement="The area of a disk of radius r.", kind="numeric",
    ...     printed=Formula(r"2\pi r", lambda r: 6.283 * r), corrected=Formula(r"\pi r^2", lambda r: 3.1416 * r**2),
    ...     reason="The printed formula is the circumference. A disk inscribed in a square has a smaller area.",
    ... )
    ... def area(formula):
    ...     return agreement(formula(1.0), 3.14159, allowed=1e-4)
    >>> area.run().as_stated
    True
    """

    id: str
    section: str
    statement: str
    printed: Formula
    status: Status
    reason: str
    kind: Kind = "symbolic"
    corrected: Formula | None = None
    perturbed: Code | None = None
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

    @property
    def right(self) -> Code | None:
        """The formula that the check must accept: corrected, or as printed in a verified entry."""
        return (self.corrected or self.printed).code

    @property
    def wrong(self) -> Code | None:
        """The formula that the check must refute: ``perturbed`` if given, else the printed formula."""
        return self.perturbed if self.perturbed is not None else self.printed.code

    def run(self) -> Finding:
        """Run the check on the right and on the wrong formula."""
        if self.check is None or self.right is None or self.wrong is None:
            return Finding(self, None, None, 0.0)
        start = perf_counter()
        right, wrong = self.check(self.right), self.check(self.wrong)
        return Finding(self, right, wrong, perf_counter() - start)


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


def _decorator(status: Status, words: str) -> Callable[..., Callable[[Check], Entry]]:
    def decorator(**row: Any) -> Callable[[Check], Entry]:
        return lambda check: Entry(status=status, check=check, **row)

    decorator.__doc__ = f"Make a check the entry of {words}; takes the fields of `Entry`."
    return decorator


verified = _decorator("verified", "a formula that is right as printed")
erratum = _decorator("erratum", "a formula that is wrong or misprinted")
convention = _decorator("convention", "a formula that is right only under a convention that the text does not name")


def by_reading(
    *, id: str, section: str, statement: str, printed: str, corrected: str, reason: str,
    status: Status = "erratum", equation: str = "",
) -> Entry:  # fmt: skip
    """The entry of a slip that only reading can show; its formulas are LaTeX without code."""
    return Entry(
        id, section, statement, Formula(printed), status, reason, "by reading", Formula(corrected), equation=equation
    )
