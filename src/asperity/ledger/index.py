"""The index of the ledger: an entry for every checked formula of Rudzis 2022, as a table, JSON, LaTeX or a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from ..core.errors import InputError
from ..verification.verdict import Verdict
from .entry import Entry, Finding

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
