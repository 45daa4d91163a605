"""The entry of a ledger: a formula as it is printed, as it should be, and the check that tells them apart."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

from ..core.errors import InputError
from .verdict import Verdict

Status = Literal["verified", "erratum", "convention"]
Kind = Literal["symbolic", "numeric", "by reading"]
# A formula as code: whatever its check calls. Written over ``xp``, it serves numbers (numpy) and proofs (sympy).
Code = Callable[..., Any]
Check = Callable[[Code], Verdict]

_ID = re.compile(r"S\d\.\d\d")


@dataclass(frozen=True)
class Formula:
    """A formula in LaTeX and, where a check can call it, as code."""

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
        Where it stands in Rudzis 2022; the equation may be empty.
    statement : str
        What it says, in words.
    printed : Formula
        As it is printed. Of an erratum its code is what the check must refute.
    corrected : Formula or None
        What is right instead, or under the named convention; None for a verified row.
    perturbed : callable or None
        A formula that is slightly wrong, which the check must refute: of a verified row, and of an erratum whose
        printed formula the audit describes but does not quote.
    status : {"verified", "erratum", "convention"}
    reason : str
        Two sentences: why it is right or wrong, and what follows or how it is checked.
    kind : {"symbolic", "numeric", "by reading"}
        A symbolic check answers *proved*, a numeric one *agrees*. What rests on reading has no check.
    check : callable or None
        Takes a formula's code, returns a `Verdict`.

    Entries are written with the decorators `verified`, `erratum` and `convention`, and with `by_reading`.

    Examples
    --------
    >>> from asperity.verification import Formula, agreement, erratum
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
    kind: Kind
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
        """The formula that the check must accept: corrected, or as printed in a verified row."""
        return (self.corrected or self.printed).code

    @property
    def wrong(self) -> Code | None:
        """The formula that the check must refute: as printed where that is wrong, else perturbed."""
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
    """What the check of an entry found.

    ``right`` and ``wrong`` are the verdicts on `Entry.right` and `Entry.wrong`, None of a row by reading; ``seconds``
    is the time that both took.
    """

    entry: Entry
    right: Verdict | None
    wrong: Verdict | None
    seconds: float

    @property
    def as_stated(self) -> bool | None:
        """Whether the status is what the check finds; None of a row by reading."""
        if self.right is None or self.wrong is None:
            return None
        expected = "proved" if self.entry.kind == "symbolic" else "agrees"
        return self.right.answer == expected and self.wrong.answer == "refuted"


def verified(
    *, id: str, section: str, statement: str, printed: Formula, perturbed: Code, reason: str, kind: Kind = "symbolic",
    equation: str = "",
) -> Callable[[Check], Entry]:  # fmt: skip
    """Make a check the entry of a formula that is right as printed."""

    def entry(check: Check) -> Entry:
        return Entry(id, section, statement, printed, "verified", reason, kind, None, perturbed, equation, check)

    return entry


def erratum(
    *, id: str, section: str, statement: str, printed: Formula, corrected: Formula, reason: str,
    kind: Kind = "symbolic", equation: str = "", perturbed: Code | None = None,
) -> Callable[[Check], Entry]:  # fmt: skip
    """Make a check the entry of a formula that is wrong or misprinted."""

    def entry(check: Check) -> Entry:
        return Entry(id, section, statement, printed, "erratum", reason, kind, corrected, perturbed, equation, check)

    return entry


def convention(
    *, id: str, section: str, statement: str, printed: Formula, corrected: Formula, reason: str,
    kind: Kind = "symbolic", equation: str = "", perturbed: Code | None = None,
) -> Callable[[Check], Entry]:  # fmt: skip
    """Make a check the entry of a formula that is right only under a convention that the text does not name."""

    def entry(check: Check) -> Entry:
        return Entry(id, section, statement, printed, "convention", reason, kind, corrected, perturbed, equation, check)

    return entry


def by_reading(
    *, id: str, section: str, statement: str, printed: str, corrected: str, reason: str,
    status: Status = "erratum", equation: str = "",
) -> Entry:  # fmt: skip
    """The entry of a slip that reading shows and no computation can: its formulas are LaTeX only."""
    return Entry(
        id, section, statement, Formula(printed), status, reason, "by reading", Formula(corrected), equation=equation
    )
