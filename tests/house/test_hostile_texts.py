"""No text and no file is executed: fifteen hostile texts at every place where a text or a file enters."""

import re
import sqlite3
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from asperity import InputError, verify
from asperity.core.checkpoints import Checkpoint
from asperity.explore.files import opened
from asperity.geometry import load_wall, read_profile, wall_from_text
from asperity.kernels import load_matrix
from asperity.kernels.inverse.named_laws import law_from_text
from asperity.ledger import selected
from asperity.spectral import SweepTable, WorkReport
from asperity.spectral.sweeps.named_families import family_and_grid, spectrum_from_text
from asperity.spectral.sweeps.running import quantities_from
from commands import run

PACKAGE = Path(__file__).parents[2]
CANARY = "module_that_nothing_should_import"
# Of this thread, because the machine and other threads may be busy; a refusal takes milliseconds.
SECONDS = 1.0

TEXTS = {
    "a file that is opened": "open('executed', 'w').write('x')",
    "an import": f"__import__('{CANARY}')",
    "an import and a call": "__import__('os').system('touch executed')",
    "a class reached from a number": "(1).__class__.__bases__[0].__subclasses__()",
    "a lambda": "(lambda: open('executed', 'w'))()",
    "a comprehension": "[open('executed', 'w') for _ in range(1)]",
    "a formatted string": "f\"{open('executed', 'w')}\"",
    "an evaluation": "eval(\"open('executed', 'w')\")",
    "an execution": "exec('import " + CANARY + "')",
    "an assignment": "(x := open('executed', 'w'))",
    "a tower of powers": "9**9**9**9",
    "nested sines": "sin(" * 3000 + "x" + ")" * 3000,
    "a number without end": "1e400",
    "a tag of a pickle": "cos\nsystem\n(S'touch executed'\ntR.",
    "a statement": f"import {CANARY}\nopen('executed', 'w')",
}  # fmt: skip

x = sp.Symbol("x", real=True)


class Printed:
    """An object whose printed form is hostile: sympy would parse what it prints."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__


def written(text: str, name: str) -> Path:
    file = Path(name)
    file.write_text(text, encoding="utf-8")
    return file


def checkpoint_of(text: str, identity: str, part: str) -> None:
    Path("run.checkpoint").unlink(missing_ok=True)
    with sqlite3.connect("run.checkpoint") as base:
        base.execute("CREATE TABLE identity (format INTEGER, value TEXT)")
        base.execute("CREATE TABLE parts (key TEXT PRIMARY KEY, value, digest TEXT)")
        base.execute("INSERT INTO identity VALUES (1, ?)", (identity,))
        base.execute("INSERT INTO parts VALUES ('0', ?, ?)", (part, text))
    base.close()
    with Checkpoint("run.checkpoint", {}) as store:
        list(store.parts())


def matrix_with(record: str) -> None:
    np.savez("matrix.npz", record=np.array(record), symmetric=np.eye(2))
    load_matrix("matrix.npz")


def matrix_of_objects(text: str) -> None:
    # numpy stores objects as pickles
    np.savez("matrix.npz", record=np.array([text], dtype=object), symmetric=np.eye(2))
    load_matrix("matrix.npz")


def command(*words: str) -> None:
    found = run(*words)
    assert isinstance(found.exception, SystemExit) and found.exit_code in (1, 2), (found.output, found.exception)
    raise InputError(found.output)


DOORS = {
    "verify: left": lambda text: verify(text, 1),
    "verify: left, without a limit": lambda text: verify(text, 1, time_limit=None),
    "verify: right": lambda text: verify(1, text),
    "verify: alone": lambda text: verify(text),
    "verify: an entry": lambda text: verify([[1, text]], [[1, 1]]),
    "verify: a text of numpy": lambda text: verify(np.str_(text), 1),
    "verify: an array of numpy": lambda text: verify(np.array([text]), [1]),
    "verify: an array of objects": lambda text: verify(np.array([text], dtype=object), [1]),
    "verify: what prints as text": lambda text: verify(Printed(text), 1),
    "verify: an assumption": lambda text: verify(x, 1, [text]),
    "verify: the assumptions": lambda text: verify(x, 1, text),
    "verify: what prints as an assumption": lambda text: verify(x, 1, [Printed(text)]),
    "verify: a lower bound": lambda text: verify(x, 1, {x: (text, 1)}),
    "verify: an upper bound": lambda text: verify(x, 1, {x: (0, text)}),
    "verify: an interval": lambda text: verify(x, 1, {x: text}),
    "verify: a bounded symbol": lambda text: verify(x, 1, {text: (0, 1)}),
    "verify: beside a relation": lambda text: verify(x <= 1, [text]),
    "verify: the time limit": lambda text: verify(x, 1, time_limit=text),
    "a wall": wall_from_text,
    "the parameters of a wall": lambda text: wall_from_text(f"focusing-arcs:{text}"),
    "a parameter of a wall": lambda text: wall_from_text(f"focusing-arcs:half_angle={text}"),
    "a whole parameter of a wall": lambda text: wall_from_text(f"koch:generations={text}"),
    "a wall file": lambda text: load_wall(written(text, "wall.toml")),
    "the period of a wall file": lambda text: load_wall(written(f"period = {text}", "wall.toml")),
    "a text in a wall file": lambda text: load_wall(written(f"period = 1.0\nvertices = [['''{text}''', 0]]", "w.toml")),
    "a profile": lambda text: read_profile(written(text, "profile.txt")),
    "a height of a profile": lambda text: read_profile(written(f"0 0\n1 {text}\n2 0\n", "profile.txt")),
    "a header of a profile": lambda text: read_profile(written(f"# x [{text}], h [um]\n0 {text}\n1 0\n", "p.csv")),
    "an option of a profile": lambda text: wall_from_text(f"{written('0 0 1', 'p.csv')}:row={text}"),
    "the units of a profile": lambda text: wall_from_text(f"{written('0 0 1', 'p.csv')}:units={text}"),
    "a file of an instrument": lambda text: read_profile(written(text, "profile.sdf")),
    "a law": law_from_text,
    "the number of a law": lambda text: law_from_text(f"maxwell:{text}"),
    "a matrix file": lambda text: load_matrix(written(text, "matrix.npz")),
    "the record of a matrix file": matrix_with,
    "an object in a matrix file": matrix_of_objects,
    "a family of walls": lambda text: family_and_grid([text], ["half_angle=1,2"], False),
    "values of a family": lambda text: family_and_grid(["focusing-arcs"], [f"half_angle={text}"], False),
    "ends of a family": lambda text: family_and_grid(["focusing-arcs"], [f"half_angle={text}:1:{text}"], False),
    "random heights": spectrum_from_text,
    "a number of random heights": lambda text: spectrum_from_text(f"gaussian:length={text}"),
    "a quantity": quantities_from,
    "a table of a sweep": SweepTable.of_json,
    "a report of work": WorkReport.of_json,
    "a checkpoint": lambda text: Checkpoint(written(text, "run.checkpoint"), {}),
    "the description in a checkpoint": lambda text: checkpoint_of("", text, "1"),
    "a part of a checkpoint": lambda text: checkpoint_of(text, "{}", text),
    "a row of the ledger": lambda text: selected([text]),
    "a file that the browser sends": lambda text: opened("wall.toml", text.encode()),
    "the options of such a file": lambda text: opened("profile.csv", b"0 0\n1 1\n", text),
    "the command study": lambda text: command("study", text),
    "the command gap": lambda text: command("gap", f"focusing-arcs:half_angle={text}"),
    "the command sweep": lambda text: command("sweep", "koch", "--over", f"generations={text}", "--out", "folder"),
    "the command ensemble": lambda text: command("ensemble", f"gaussian:length={text}", "--out", "folder"),
    "the command realise": lambda text: command("realise", f"maxwell:{text}"),
    "the command verify": lambda text: command("verify", text),
    "the command explore": lambda text: command("explore", f"koch:generations={text}", "--no-browser"),
    "the command bench": lambda text: command("bench", text),
}


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("door", DOORS)
def test_hostile_texts_are_refused_or_taken_for_what_they_spell(door, tmp_path, monkeypatch):
    (tmp_path / f"{CANARY}.py").write_text("open('executed', 'w')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    # what the place needs is loaded: sympy, the readers of instruments, the process of `verify`
    for text in ("neither a name nor a number", "1e400", "words\nin\nlines"):
        with suppress(InputError):
            DOORS[door](text)
    verify(x, x)
    for number, text in enumerate(TEXTS.values()):
        here = tmp_path / str(number)
        here.mkdir()
        monkeypatch.chdir(here)
        modules = set(sys.modules)
        start = time.thread_time()
        try:
            DOORS[door](text)
        except InputError as reason:
            assert str(reason)
        assert time.thread_time() - start < SECONDS, text[:80]
        assert not (here / "executed").exists(), text[:80]
        assert CANARY not in sys.modules
        # reading a text may load a codec of Python's
        assert not {name for name in set(sys.modules) - modules if not name.startswith("encodings.")}, text[:80]


def test_the_package_has_no_call_that_executes_text():
    calls = re.compile(
        r"(?<![\w.])(?:eval|exec|compile|__import__|parse_expr|literal_eval|lambdify)\(|sp\.(?:parse_expr|S)\("
        r"|sympify\((?!.*strict=True)|allow_pickle=True|yaml\.load"
    )
    found = [
        f"{file.relative_to(PACKAGE)}: {line.strip()}"
        for folder in ("src/asperity", "geometry", "kernels", "spectral")
        for file in sorted((PACKAGE / folder).rglob("*.py"))
        for line in file.read_text(encoding="utf-8").splitlines()
        if calls.search(line.partition("  # ")[0]) and not line.lstrip().startswith("#")
    ]
    assert found == []
