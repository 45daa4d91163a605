"""The runs and the output of ``asperity bench``."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import click

from ..core.errors import FileExistsRefusal
from ..core.files import text_of, write_whole
from .comparison import compare_runs
from .run import BenchRun, made_here, prepare_folder
from .standard_set import FULL, QUICK, problem_names, run_problems


def run_bench(
    problems: Sequence[str], *, quick: bool, extremes: bool, out: Path, force: bool, compare: Path | None
) -> int:
    """Run the requested measurements, print and write the results; return the exit code."""
    names = problem_names(problems)
    earlier = None if compare is None else BenchRun.of_json(text_of(compare))
    if extremes:
        from .extremes.report import run_extremes

        return _show(out / "extremes.md", lambda: run_extremes(quick).table(), force)
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


def _show(path: Path, make: Callable[[], str], force: bool) -> int:
    """Print and write a report; an existing file is refused before the work."""
    made_here(path.parent)
    if os.path.exists(path) and not force:
        raise FileExistsRefusal(f"--out: {path} exists; use another folder or --force to replace it")
    text = make()
    write_whole(path, text + "\n", overwrite=True)
    click.echo(text)
    click.echo(f"wrote {path}", err=True)
    return 0
