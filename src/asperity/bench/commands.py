"""The runs and the output of ``asperity bench``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from ..core.files import text_of
from .comparison import compare_runs
from .run import BenchRun, prepare_folder
from .standard_set import FULL, QUICK, problem_names, run_problems


def run_bench(problems: Sequence[str], *, quick: bool, out: Path, force: bool, compare: Path | None) -> int:
    """Run the requested measurements, print and write the results; return the exit code."""
    names = problem_names(problems)
    earlier = None if compare is None else BenchRun.of_json(text_of(compare))
    prepare_folder(out, names, force=force)
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
