"""The ledger in words: as a table, as JSON, in LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from .verification.entry import Entry, Finding
from .verification.verdict import Verdict

WIDTH = 56


def table_of(findings: Sequence[Finding]) -> str:
    """One line a row, the verdicts beneath those that are not as stated, and the totals."""
    lines = []
    for finding in findings:
        lines.append(_line(finding))
        if finding.as_stated is False:
            lines += [f"       right formula: {finding.right}", f"       wrong formula: {finding.wrong}"]
    return "\n".join([*lines, _totals(findings)])


def _line(finding: Finding) -> str:
    entry = finding.entry
    found = {None: "not run", True: "as stated", False: "NOT AS STATED"}[finding.as_stated]
    words = entry.statement if len(entry.statement) <= WIDTH else entry.statement[: WIDTH - 1].rstrip() + "…"
    return f"{entry.id}  {entry.status:10s}  {entry.kind:10s}  {found:13s}  {words}"


def _totals(findings: Sequence[Finding]) -> str:
    status = Counter(finding.entry.status for finding in findings)
    kinds = Counter(finding.entry.kind for finding in findings)
    machine = len(findings) - kinds["by reading"]
    wrong = sum(finding.as_stated is False for finding in findings)
    return (
        f"{len(findings)} rows: {status['verified']} verified, {status['erratum']} errata, "
        f"{status['convention']} conventions. {machine} checked by machine ({kinds['symbolic']} by proof, "
        f"{kinds['numeric']} by numbers), {kinds['by reading']} by reading; {wrong} not as stated."
    )


def latex_of(entries: Sequence[Entry]) -> str:
    """The formulas in LaTeX, one paragraph a row."""
    paragraphs = []
    for entry in entries:
        lines = [rf"\paragraph{{{entry.id} ({entry.status}, section {entry.section})}} {entry.statement}"]
        lines.append(rf"\[ {entry.printed.latex} \]")
        if entry.corrected is not None:
            lines.append(rf"corrected: \[ {entry.corrected.latex} \]")
        paragraphs.append("\n".join([*lines, entry.reason]))
    return "\n\n".join(paragraphs)


def finding_as_dict(finding: Finding) -> dict[str, Any]:
    """One row, ready for JSON; ``docs/command-line.md`` lists the keys."""
    entry = finding.entry
    return {
        "id": entry.id, "section": entry.section, "equation": entry.equation, "statement": entry.statement,
        "status": entry.status, "kind": entry.kind, "reason": entry.reason,
        "printed": entry.printed.latex, "corrected": entry.corrected.latex if entry.corrected else None,
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
