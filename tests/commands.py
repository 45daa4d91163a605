"""The command line, fresh interpreters that import the same asperity as the tests, and what checkpoints hold."""

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from click.testing import CliRunner, Result

import asperity
from asperity.cli import main

# What a fresh interpreter imports from: the same asperity, and this folder.
HERE = Path(asperity.__file__).resolve().parents[1], Path(__file__).resolve().parent


def run(*words: object) -> Result:
    """What a command answers in this process."""
    return CliRunner().invoke(main, [str(word) for word in words])


def refused(*words: object) -> str:
    """The single line on standard error of a command that must end with exit code 1 and print no result."""
    result = run(*words)
    lines = result.stderr.splitlines()
    assert (result.exit_code, result.stdout, len(lines)) == (1, "", 1), result.output
    assert lines[0].startswith("asperity: ")
    return lines[0]


def environment(*folders: Path, **variables: str) -> dict[str, str]:
    """That of a fresh interpreter, which imports from these folders too."""
    path = [*map(str, (*folders, *HERE)), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path), **variables}


def started(*words: str, env: dict[str, str] | None = None, **options: object) -> subprocess.Popen[str]:
    """A fresh interpreter that runs a script, a module or a text."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, *words], env=env or environment(), **pipes, **options)


def ended(*words: str, env: dict[str, str] | None = None, **options: object) -> subprocess.CompletedProcess[str]:
    """The same when it has ended, with what it printed."""
    asked = [sys.executable, *words]
    return subprocess.run(asked, env=env or environment(), capture_output=True, text=True, timeout=600, **options)


def parts_in(path: Path) -> list[tuple]:
    """The parts of a checkpoint, read as any other program would: key, value and the type of the value."""
    with closing(sqlite3.connect(path)) as file:
        return file.execute("SELECT key, value, typeof(value) FROM parts").fetchall()
