"""The runs and the output of ``asperity bench``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from .run import BenchRun, prepare_folder
from .standard_set import FULL, QUICK, problem_names, run_problems


def run_bench(problems: Sequence[str], *, quick: bool, out: Path, force: bool) -> None:
    """Run the requested measurements, print and write the results."""
    names = problem_names(problems)
    prepare_folder(out, names, force=force)
    effort = QUICK if quick else FULL
    run = BenchRun(tuple(run_problems(names, effort, out, lambda line: click.echo(line, err=True))))
    click.echo(run.summary())
    for path in run.save(out):
        click.echo(f"wrote {path}", err=True)
