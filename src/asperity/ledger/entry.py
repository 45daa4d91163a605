"""The ledger: a formula as printed, its corrected form, the check that distinguishes them, and the index of entries.

The index is a table, JSON, LaTeX or a page, with an entry for every checked formula of Rudzis 2022.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from inspect import cleandoc
from pkgutil import iter_modules
from time import perf_counter
from typing import Any, Literal

import numpy as np

from ..core.errors import InputError
from ..verification.verdict import Verdict

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


FOLDERS = ("plane", "disk", "proof")


@cache
def entries() -> tuple[Entry, ...]:
    """All entries, sorted by id; new files in the ledger's folders are found automatically.

    Examples
    --------
    >>> entries()[0].id
    'S1.01'
    """
    found: dict[str, Entry] = {}
    for folder in FOLDERS:
        package = import_module(f".{folder}", __package__)
        for module in iter_modules(package.__path__):
            for value in vars(import_module(f"{package.__name__}.{module.name}")).values():
                if isinstance(value, Entry) and found.setdefault(value.id, value) is not value:
                    raise InputError(f"{value.id}: expected one entry of this id, got two")
    return tuple(found[name] for name in sorted(found))


def selected(ids: Iterable[str]) -> tuple[Entry, ...]:
    """The entries whose id equals or starts with one of ``ids``; all entries if ``ids`` is empty.

    Raises
    ------
    InputError
        If one of ``ids`` is neither the id of an entry nor the beginning of one.
    """
    wanted = tuple(ids)
    if not wanted:
        return entries()
    for prefix in wanted:
        if not any(entry.id.startswith(prefix) for entry in entries()):
            raise InputError(f"{prefix}: no such entry; ids run from {entries()[0].id} to {entries()[-1].id}")
    return tuple(entry for entry in entries() if entry.id.startswith(wanted))


def findings(chosen: Iterable[Entry]) -> Iterator[Finding]:
    """Run the checks one by one and yield their findings."""
    for entry in chosen:
        yield entry.run()


WIDTH = 66
FOUND = {None: "not checked", True: "as stated", False: "NOT AS STATED"}
# headings of the page in their order, errata first
HEADINGS = {"erratum": "Errata", "convention": "Conventions", "verified": "Verified"}
# label of the second formula of a row
AMENDED = {"erratum": "corrected", "convention": "under the convention"}


def table_of(findings: Sequence[Finding]) -> str:
    """A table with one line for each row, verdicts below rows that are not as stated, and totals."""
    lines = []
    for finding in findings:
        lines.append(_line(finding))
        if finding.as_stated is False:
            lines += [f"       right formula: {finding.right}", f"       wrong formula: {finding.wrong}"]
    return "\n".join([*lines, _totals(findings)])


def _line(finding: Finding) -> str:
    entry = finding.entry
    words = entry.statement if len(entry.statement) <= WIDTH else entry.statement[: WIDTH - 1].rstrip() + "…"
    return f"{entry.id}  {entry.status:10s}  {entry.kind:10s}  {FOUND[finding.as_stated]:13s}  {words}"


def _totals(findings: Sequence[Finding]) -> str:
    wrong = sum(finding.as_stated is False for finding in findings)
    return f"{totals_of([finding.entry for finding in findings])} {wrong} not as stated."


def totals_of(entries: Sequence[Entry]) -> str:
    """The numbers of rows by status and by kind, in two sentences."""
    status, kinds = Counter(entry.status for entry in entries), Counter(entry.kind for entry in entries)
    return (
        f"{len(entries)} rows: {status['verified']} verified, {status['erratum']} errata, "
        f"{status['convention']} conventions. {len(entries) - kinds['by reading']} checked by machine "
        f"({kinds['symbolic']} by proof, {kinds['numeric']} by numbers), {kinds['by reading']} by reading."
    )


def finding_as_dict(finding: Finding) -> dict[str, Any]:
    """One row as a JSON-ready dictionary; ``docs/command-line.md`` lists the keys."""
    entry = finding.entry
    return {
        "id": entry.id, "section": entry.section, "equation": entry.equation, "statement": entry.statement,
        "status": entry.status, "kind": entry.kind, "reason": entry.reason,
        "printed": entry.printed, "corrected": entry.corrected,
        "right": _verdict(finding.right), "wrong": _verdict(finding.wrong),
        "as_stated": finding.as_stated, "seconds": round(finding.seconds, 3),
    }  # fmt: skip


def _verdict(verdict: Verdict | None) -> dict[str, Any] | None:
    if verdict is None:
        return None
    return {
        "answer": verdict.answer, "evidence": verdict.evidence, "counterexample": dict(verdict.counterexample),
        "values": list(verdict.values) if verdict.values else None,
    }  # fmt: skip


def latex_of(entries: Iterable[Entry]) -> str:
    """The formulas in LaTeX, one paragraph for each row; the words need a LaTeX engine with Unicode."""
    return "\n\n".join(
        "\n".join(
            [
                rf"\paragraph{{{entry.id} ({entry.status}, {_source(entry)}).}} {entry.statement}",
                *(rf"{name}: \[ {latex} \]" for name, latex in _formulas(entry)),
                entry.reason,
            ]
        )
        for entry in entries
    )


def page_of(entries: Sequence[Entry]) -> str:
    """The rows as a page of Markdown with typeset formulas, errata first."""
    parts = [totals_of(entries)]
    for status, heading in HEADINGS.items():
        parts.append(f"## {heading}")
        for entry in entries:
            if entry.status == status:
                parts += [f"({entry.id})=\n**{entry.id}** ({_source(entry)}; {entry.kind}) {entry.statement}"]
                parts += [f"*{name}*\n\n$$\n{latex}\n$$" for name, latex in _formulas(entry)]
                parts.append(entry.reason)
                if entry.check is not None:
                    parts.append(f"Checked in `{entry.check.__module__}`.")
    return "\n\n".join(parts) + "\n"


def _source(entry: Entry) -> str:
    return f"section {entry.section}" + (f", {_equation(entry.equation)}" if entry.equation else "")


def _equation(equation: str) -> str:
    return f"eq. {equation}" if equation[0].isdigit() else equation


def _formulas(entry: Entry) -> list[tuple[str, str]]:
    corrected = [] if entry.corrected is None else [(AMENDED[entry.status], entry.corrected)]
    return [("printed", entry.printed), *corrected]
