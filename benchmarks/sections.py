"""The parts of the whole benchmark: each in a process of its own and within its time, its text kept in a file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from asperity.bench.extremes.report import run_extremes
from asperity.bench.quantities.walls import RANDOM_WALLS
from asperity.bench.run import BenchRun
from asperity.bench.savings import savings_table
from asperity.bench.standard_set import FULL, QUICK, Effort, problem_names, run_problems
from asperity.spectral import Machine

from .peers import peer_tables
from .speed import speed_and_goals

# Short ladders in any case: there are many random walls, and only the choice is asked for. But enough repeats for a
# mean of what is random: single nets are off by twice as much, or by half.
RANDOM_EFFORT = replace(QUICK, seconds=4.0, row_seconds=12.0, total_seconds=300.0)
# The sections' processes start and end outside of their own plans.
MARGIN = 30.0


@dataclass(frozen=True)
class Section:
    """One part of a page.

    Attributes
    ----------
    name, title : str
    seconds : float
        After which it is ended: together 40 minutes.
    make : callable
        ``make(quick, folder)`` gives its text.
    """

    name: str
    title: str
    seconds: float
    make: Callable[[bool, Path], str]


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _run(names: Iterable[str], effort: Effort, folder: Path) -> BenchRun:
    folder.mkdir(parents=True, exist_ok=True)
    run = BenchRun(tuple(run_problems(list(names), effort, folder, _say)))
    run.save(folder)
    return run


def _standard(quick: bool, folder: Path) -> str:
    run = _run(problem_names(), QUICK if quick else FULL, folder / "standard")
    return f"{run.summary()}\n\n### References\n\n{run.references()}"


def _random(quick: bool, folder: Path) -> str:
    names = (f"random-{number}/moment" for number in range(RANDOM_WALLS))
    return _run(names, RANDOM_EFFORT, folder / "random").summary()


def _stability(quick: bool, folder: Path) -> str:
    return f"{run_extremes(quick).table()}\n\nMachine: {Machine.here()}."


SECTIONS = (
    Section("speed", "", 380.0, lambda quick, folder: speed_and_goals(quick)),
    Section("standard", "The standard set", FULL.total_seconds + MARGIN, _standard),
    Section("random", "Twenty random walls", RANDOM_EFFORT.total_seconds + MARGIN, _random),
    Section("savings", "What the scenes leave out", 100.0, lambda quick, folder: savings_table(quick)),
    Section("peers", "Peers", 200.0, lambda quick, folder: peer_tables(folder / "peers")),
    Section("stability", "", 250.0, _stability),
)


def section_text(section: Section, quick: bool, folder: Path) -> str:
    """The text of a section: from its file if an interrupted run left it, else from a process of its own."""
    file = folder / f"{section.name}.md"
    if not file.exists():
        _say(f"measuring {section.name}, at most {section.seconds:g} s")
        flags = ["--quick"] if quick else []
        command = [sys.executable, "-m", "benchmarks", "--section", section.name, "--out", str(folder), *flags]
        ended = _within(command, section.seconds)
        if ended:
            # of what was measured until then the rows are kept, but not a half-made table
            file.write_text(f"This part {ended}.\n", encoding="utf-8")
    return file.read_text(encoding="utf-8").strip()


def write_section(name: str, quick: bool, folder: Path) -> None:
    """What the process of a section does."""
    (section,) = (one for one in SECTIONS if one.name == name)
    text = section.make(quick, folder)
    beside = folder / f"{name}.part"
    beside.write_text(f"{text}\n", encoding="utf-8")
    beside.replace(folder / f"{name}.md")


def _within(command: list[str], seconds: float) -> str:
    """Run a command with all that it starts; in words what went wrong, or nothing."""
    process = subprocess.Popen(command, start_new_session=True)
    try:
        code = process.wait(seconds)
    except subprocess.TimeoutExpired:
        _end(process)
        return f"took longer than its {seconds:g} s and was ended"
    except KeyboardInterrupt:
        _end(process)
        raise
    return f"failed with code {code}" if code else ""


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and, where the system has process groups, its children."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
