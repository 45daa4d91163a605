"""The runs and the output of ``asperity bench``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from .comparison import compare_runs
from .run import BenchRun, fresh_folder
from .standard_set import FULL, QUICK, problem_names, run_problems


def run_bench(
    problems: Sequence[str], *, quick: bool, extremes: bool, savings: bool, out: Path, force: bool, compare: Path | None
) -> int:
    """Run the requested measurements, print and write the results; return the exit code."""
    names = problem_names(problems)
    earlier = None if compare is None else BenchRun.of_json(compare.read_text(encoding="utf-8"))
    fresh_folder(out, force)
    if extremes:
        from .extremes.report import run_extremes

        return _show(out / "extremes.md", run_extremes(quick).table())
    if savings:
        from .savings import savings_table

        return _show(out / "savings.md", savings_table(quick))
    effort = QUICK if quick else FULL
    reports = list(run_problems(names, effort, out, lambda line: click.echo(line, err=True)))
    run = BenchRun(tuple(reports))
    click.echo(run.summary())
    for path in run.save(out):
        click.echo(f"wrote {path}", err=True)
    if earlier is None:
        return 0
    found = compare_runs(earlier, run)
    click.echo(found.table())
    return 1 if found.is_worse else 0


def _show(path: Path, text: str) -> int:
    path.write_text(text + "\n", encoding="utf-8")
    click.echo(text)
    click.echo(f"wrote {path}", err=True)
    return 0
