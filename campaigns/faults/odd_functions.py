"""Functions of users in sweeps, ensembles, mean laws and work diagrams, which fail or give no number at some points.

Right are a reason in the place of each such value, and all other values as if no point were odd. Every third case has
no odd point.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from asperity import Estimate
from asperity import kernels as ker
from asperity import spectral as spec
from campaigns.engine import Campaign, Judged

POINTS, REALISATIONS = 6, 12


class Unspeakable(Exception):
    """An error that cannot be printed."""

    def __str__(self) -> str:
        raise ValueError("no words")


def raised(reason: Exception) -> Callable[[], Any]:
    """What raises an error when it is called."""

    def call() -> Any:
        raise reason

    return call


ODD: dict[str, Callable[[], Any]] = {
    "NaN": lambda: math.nan, "infinity": lambda: math.inf, "a complex number": lambda: 0.5 + 0.1j, "None": lambda: None,
    "text": lambda: "0.5", "an array": lambda: np.ones(2), "an object": object, "a list": lambda: [0.5],
    "a class": lambda: dict,
    "an estimate that is NaN": lambda: Estimate(math.nan, 0.0, "bound", "none"), "a generator": lambda: iter(()),
    "an estimate without words": lambda: Estimate(0.5, 0.0, "bound", None),  # type: ignore[arg-type]
    "a complex estimate": lambda: Estimate(0.5j, 0.0, "bound", "none"),  # type: ignore[arg-type]
    **{type(reason).__name__: raised(reason) for reason in (
        KeyError("k"), ValueError("bad \x00 \udcff \r\n"), ZeroDivisionError(), RecursionError(), MemoryError(),
        AssertionError(), StopIteration(), AttributeError("a"), OSError(2, "no file"), RuntimeWarning("w"),
        Unspeakable(),
        np.linalg.LinAlgError("singular"), Exception("x" * 10**5),
    )},
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Where the function stands, what it gives at the odd points, and which these are."""

    where: str
    odd: str
    at: frozenset[int]


def draw(number: int) -> Case:
    """A function that is odd at some points."""
    rng = np.random.default_rng([73, number])
    at = frozenset(rng.choice(POINTS, int(rng.integers(1, POINTS)), replace=False).tolist())
    odd = str(rng.choice(list(ODD)))
    return Case(str(rng.choice(list(PLACES))), odd, at if number % 3 else frozenset())


def in_family(case: Case) -> tuple[list[Any], list[str]]:
    """Values and messages of a sweep whose family is odd."""
    table = spec.sweep(lambda k: ODD[case.odd]() if k in case.at else ker.maxwell(0.1 * (k + 1)), {"k": range(POINTS)})
    assert spec.SweepTable.of_json(table.to_json()).rows == table.rows and table.to_csv().encode() and repr(table)
    return [row.value for row in table.rows], [row.message for row in table.rows]


def in_quantity(case: Case) -> tuple[list[Any], list[str]]:
    """Of a sweep with an odd quantity beside the gap."""
    steps = iter(range(POINTS))

    def quantity(law: Any) -> Any:
        k = next(steps)
        return ODD[case.odd]() if k in case.at else Estimate(0.1 * (k + 1), 0.0, "bound", "by hand")

    table = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.1 * (k + 1) for k in range(POINTS)]}, [quantity, "gap"])
    assert spec.SweepTable.of_json(table.to_json()).rows == table.rows and table.to_csv().encode() and repr(table)
    assert None not in [row.value for row in table.of("gap")]
    return [row.value for row in table.of("quantity")], [row.message for row in table.of("quantity")]


def in_work(case: Case) -> tuple[list[Any], list[str]]:
    """Of a work diagram with a method that is odd at some budgets."""
    problem = spec.WorkProblem("nothing", spec.ReferenceValue(0.0, 0.0, "by hand"))

    def solve(n: int) -> Any:
        return ODD[case.odd]() if n - 1 in case.at else 0.1 * n

    report = spec.work_precision(problem, [spec.WorkMethod("odd", solve)], range(1, POINTS + 1), repeats=1)
    assert spec.WorkReport.of_json(report.to_json()).rows == report.rows and report.table() and repr(report)
    return [row.error for row in report.rows], [row.note for row in report.rows]


def in_ensemble(case: Case) -> tuple[list[Any], list[str]]:
    """Of an ensemble and of a mean law, whose realisations before the last of `POINTS` may be odd."""

    def family() -> Callable[[int], Any]:
        steps = iter(range(REALISATIONS))
        return lambda rng: ODD[case.odd]() if next(steps) in case.at else ker.maxwell(0.5)

    found = spec.ensemble(family(), REALISATIONS)
    mean = spec.mean_law(family(), REALISATIONS, ker.Bins(2))
    assert abs(float(mean.symmetric.trace()) - 0.5) < 1e-6 and abs(found.of("gap").mean.value - 0.5) < 1e-12
    assert found.of("gap").refused == len(case.at) and found.to_csv().encode() and repr(found)
    rows = found.table.rows[:POINTS]
    return [row.value and 0.1 * (k + 1) for k, row in enumerate(rows)], [row.message for row in rows]


PLACES = {"family": in_family, "quantity": in_quantity, "work diagram": in_work, "ensemble": in_ensemble}


def judge(case: Case) -> Iterator[Judged]:
    """The values and messages beside those that there should be."""
    fault = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            values, messages = PLACES[case.where](case)
    except Exception as reason:  # what users must never see
        fault = f"RAW {type(reason).__name__}"
    else:
        for k, (value, message) in enumerate(zip(values, messages, strict=True)):
            is_right = (
                value is None and message if k in case.at else value is not None and abs(value - 0.1 * (k + 1)) < 1e-9
            )
            fault = fault if is_right else f"{value!r} at {k}, {message[:80]!r}"
    yield Judged(case.where, fault=f"{fault}: {case}" if fault else "", outcome="odd" if case.at else "sound")


QUESTION = "Does a function of a user's that fails at a point cost any other point its value?"
CAMPAIGNS = (Campaign("odd-functions", QUESTION, draw, judge, 2000, range(30)),)
