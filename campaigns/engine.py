"""One engine for all campaigns: draw cases, judge each in a child process with a time limit, and count the judgements.

    python -m campaigns                        list the campaigns
    python -m campaigns NAME                   run one; --first, --count, --jobs, --record FILE

A campaign tries to refute one statement of the library. It draws a case from a number, so that a case can be run again
alone, and compares what the library says of it with an independent judge. The tests run the ``small`` numbers of each
campaign in their own process.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from threading import local
from typing import Any, Literal

from scipy.stats import binomtest

from asperity.core.child import ChildProcess, OutOfTime

from .pages import print_table

Verdict = Literal["holds", "fails", "open"]
HEADS = "kind | cases | fail | open | held | median of reported/true | largest true/reported | outcomes"


@dataclass(frozen=True)
class Judged:
    """One statement of the library beside its judge.

    Attributes
    ----------
    kind : str
        The row of the table.
    claimed, true, judge_error : float
        Reported error, distance from the judge's value, and error of that value. Without numbers the case fails by
        ``fault`` alone.
    fault : str
        What is wrong, if anything.
    outcome : str
        A word that is counted, such as "refused".
    number : int
        How many alike statements this one stands for, such as all rays of a case that agree.
    """

    kind: str
    claimed: float = 0.0
    true: float = 0.0
    judge_error: float = 0.0
    fault: str = ""
    outcome: str = ""
    number: int = 1

    @property
    def verdict(self) -> Verdict:
        """Whether the statement holds, certainly fails, or is left open by the judge's error."""
        if self.fault or not self.true <= self.claimed + self.judge_error:
            return "fails"
        return "holds" if self.true + self.judge_error <= self.claimed or self.judge_error == 0.0 else "open"

    @property
    def ratio(self) -> float | None:
        """Reported over true error, if the judge resolves a ratio of 100."""
        return self.claimed / max(self.true, 1e-16) if 0.0 <= self.judge_error < 0.01 * self.claimed else None


@dataclass(frozen=True)
class Campaign:
    """A question to the library, with the cases and the judge that answer it.

    Attributes
    ----------
    name, question : str
    draw : callable
        ``draw(number)`` is a case, the same for ever.
    judge : callable
        ``judge(case)`` yields `Judged`.
    cases : int
        Number of cases in full size.
    small : sequence of int
        Numbers of the cases that the tests judge.
    level : float
        Fraction of the statements of a kind that must hold: 1 for bounds, .95 for half widths of 95 %.
    seconds : float
        Time limit of a case; one that exceeds it fails.
    """

    name: str
    question: str
    draw: Callable[[int], Any]
    judge: Callable[[Any], Iterable[Judged]]
    cases: int
    small: Sequence[int]
    level: float = 1.0
    seconds: float = 600.0

    def judged(self, number: int) -> list[Judged]:
        """The judgements of one case, in this process."""
        return list(self.judge(self.draw(number)))

    def run(self, numbers: Iterable[int], jobs: int, record: Path | None = None) -> Iterator[tuple[int, list[Judged]]]:
        """The judgements of these cases in child processes, in order; those in the record are not repeated.

        The processes end with the iterator, also where it is closed or fails.
        """
        done = _recorded(record)
        owned, children = local(), list[ChildProcess]()

        def one(number: int) -> list[Judged]:
            if number in done:
                return done[number]
            if not hasattr(owned, "child"):
                owned.child = ChildProcess()
                children.append(owned.child)
            try:
                found: list[Judged] = owned.child.call(judged, self.name, number, seconds=self.seconds)
            except OutOfTime:
                return [Judged("time limit", fault=f"not judged within {self.seconds:g} s")]
            except Exception as reason:
                return [Judged("exception", fault=f"{type(reason).__name__}: {reason}")]
            return found

        with ThreadPoolExecutor(jobs) as pool:
            cases = [(number, pool.submit(one, number)) for number in numbers]
            try:
                for number, case in cases:
                    found = case.result()
                    if record is not None and number not in done:
                        with record.open("a", encoding="utf-8") as file:
                            file.write(json.dumps([number, [asdict(each) for each in found]]) + "\n")
                    yield number, found
            finally:
                # of an unfinished run: no other case begins, and the judges at work end, also those that just begin
                pool.shutdown(wait=False, cancel_futures=True)
                while not all(case.done() for _, case in cases):
                    _end(children)
                    time.sleep(0.01)
                _end(children)


def _end(children: Iterable[ChildProcess]) -> None:
    for child in children:
        child.end()


def _recorded(record: Path | None) -> dict[int, list[Judged]]:
    if record is None or not record.exists():
        return {}
    lines = map(json.loads, record.read_text(encoding="utf-8").splitlines())
    return {number: [Judged(**each) for each in found] for number, found in lines}


def judged(name: str, number: int) -> list[Judged]:
    """The judgements of one case of the campaign of this name."""
    return campaigns()[name].judged(number)


@cache
def campaigns() -> dict[str, Campaign]:
    """All campaigns by name: those in the tuple CAMPAIGNS of the modules beside this one."""
    found: dict[str, Campaign] = {}
    for path in sorted(Path(__file__).parent.glob("*/*.py")):
        if "CAMPAIGNS = (" in path.read_text(encoding="utf-8"):
            found |= {each.name: each for each in import_module(f"campaigns.{path.parent.name}.{path.stem}").CAMPAIGNS}
    return found


def faults(number: int, found: Iterable[Judged]) -> list[str]:
    """The judgements of a case that fail, in words."""
    return [
        f"case {number}, {each.kind}: {each.fault or f'error {each.true:.3g}, reported {each.claimed:.3g}'}"
        for each in found
        if each.verdict == "fails"
    ]


def rows(found: Sequence[Judged]) -> Iterator[tuple[object, ...]]:
    """A row of HEADS for each kind; ``held`` is the fraction that holds, with its 95 % interval by Wilson."""
    for kind in dict.fromkeys(each.kind for each in found):
        some = [each for each in found if each.kind == kind]
        verdicts, outcomes = Counter[str](), Counter[str]()
        for each in some:
            verdicts[each.verdict] += each.number
            outcomes[each.outcome] += each.number if each.outcome else 0
        ratios = sorted(each.ratio for each in some if each.ratio is not None)
        worst = max((each.true / each.claimed for each in some if each.claimed > 0.0), default=None)
        yield (
            kind, verdicts.total(), verdicts["fails"], verdicts["open"],
            "{:.3f} ({:.3f} to {:.3f})".format(*held(some)),
            f"{ratios[len(ratios) // 2]:.2g}" if ratios else "-", "-" if worst is None else f"{worst:.2g}",
            ", ".join(f"{count} {word}" for word, count in outcomes.most_common() if count),
        )  # fmt: skip


def held(some: Sequence[Judged]) -> tuple[float, float, float]:
    """The fraction that does not fail, with the ends of its 95 % interval."""
    number, total = (sum(each.number for each in some if each.verdict != "fails"), sum(each.number for each in some))
    interval = binomtest(number, total).proportion_ci(method="wilson")
    return number / total, float(interval.low), float(interval.high)


def refuted(campaign: Campaign, found: Sequence[Judged]) -> list[str]:
    """The kinds of which fewer statements hold than the campaign's level, beyond chance."""
    kinds = dict.fromkeys(each.kind for each in found)
    fractions = {kind: held([each for each in found if each.kind == kind]) for kind in kinds}
    bound = campaign.level == 1.0
    return [kind for kind, (value, _, high) in fractions.items() if (value if bound else high) < campaign.level]


def print_run(campaign: Campaign, first: int, count: int | None, jobs: int, record: Path | None) -> bool:
    """Run a campaign, print what fails at once and the table at the end; whether the library stands."""
    begun, found = time.monotonic(), list[Judged]()
    for number, each in campaign.run(range(first, campaign.cases if count is None else first + count), jobs, record):
        found += each
        for line in faults(number, each):
            print(line, flush=True)
    print(f"\n{campaign.question}\n")
    print_table(HEADS, rows(found))
    failing = refuted(campaign, found)
    print(f"\n{'Refuted: ' + ', '.join(failing) if failing else 'Not refuted'}; {time.monotonic() - begun:.0f} s.")
    return not failing
