"""The parts of the whole benchmark: each runs in its own process and time, and its text is stored in a file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from asperity.bench.quantities.walls import RANDOM_WALLS
from asperity.bench.run import BenchRun
from asperity.bench.standard_set import FULL, QUICK, Effort, problem_names, run_problems

from .peers import peer_tables
from .savings import savings_table
from .speed import speed_and_goals

# Short ladders always: there are many random walls, and only the library's choice matters. The repeats suffice for a
# mean of random errors, because single Sobol sequences differ by a factor of two.
RANDOM_EFFORT = replace(QUICK, seconds=4.0, row_seconds=12.0, total_seconds=300.0)
# Seconds for the start and the end of a section's processes, outside their own plans.
MARGIN = 30.0


@dataclass(frozen=True)
class Section:
    """One part of a page.

    Attributes
    ----------
    name, title : str
    seconds : float
        Time limit; the limits of all sections sum to 43 minutes.
    make : callable
        ``make(quick, folder)`` returns the text.
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


SECTIONS = (
    Section("speed", "", 590.0, lambda quick, folder: speed_and_goals(quick)),
    Section("standard", "The standard set", FULL.total_seconds + MARGIN, _standard),
    Section("random", "Twenty random walls", RANDOM_EFFORT.total_seconds + MARGIN, _random),
    Section("savings", "What the scenes leave out", 100.0, lambda quick, folder: savings_table(quick)),
    Section("peers", "Peers", 200.0, lambda quick, folder: peer_tables(folder / "peers")),
)


def section_text(section: Section, quick: bool, folder: Path) -> str:
    """The text of a section: from the file of an interrupted run, else from a new process."""
    file = folder / f"{section.name}.md"
    if not file.exists():
        _say(f"measuring {section.name}, at most {section.seconds:g} s")
        flags = ["--quick"] if quick else []
        command = [sys.executable, "-m", "campaigns", "--section", section.name, "--out", str(folder), *flags]
        ended = _within(command, section.seconds)
        if ended:
            # the rows measured so far are stored, but not an incomplete table
            file.write_text(f"This part {ended}.\n", encoding="utf-8")
    return file.read_text(encoding="utf-8").strip()


def write_section(name: str, quick: bool, folder: Path) -> None:
    """Write the text of a section; this runs in the section's process."""
    (section,) = (one for one in SECTIONS if one.name == name)
    text = section.make(quick, folder)
    beside = folder / f"{name}.part"
    beside.write_text(f"{text}\n", encoding="utf-8")
    beside.replace(folder / f"{name}.md")


def _within(command: list[str], seconds: float) -> str:
    """Run a command and its child processes; return the reason of a failure in words, or an empty string."""
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
    """End a process and, if the system has process groups, its children."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
