"""Names of what is no file: every function and command that takes a path answers at once, with one clear error."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import FileExistsRefusal, InputError
from asperity.kernels.inverse.named_laws import law_from_text
from commands import environment, run

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
# Seconds in which any of these must answer.
LIMIT = 60
WALL, MATRIX = geo.flat(), ker.discretise(ker.lambertian(), ker.Bins(4))
PROBLEM = spec.WorkProblem("a", (spec.ReferenceValue(0.0, 0.0, "by hand"),))


def command(*words):
    """What the command line prints, as an error if it failed."""
    result = run(*words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.output.count("\n") == 1 or result.exit_code != 1
    if result.exit_code:
        raise InputError(result.output)


def swept(path):
    return spec.sweep(lambda g: ker.lambertian(), {"g": [1.0]}, quantities=["gap"], checkpoint=path)


READERS = {
    "load_wall": geo.load_wall,
    "read_profile": geo.read_profile,
    "wall_from_text": lambda path: geo.wall_from_text(str(path)),
    "load_matrix": ker.load_matrix,
    "law_from_text": lambda path: law_from_text(str(path)),
    "work_precision": lambda path: spec.work_precision(
        PROBLEM, [spec.WorkMethod("b", float)], [1.0], repeats=1, path=path
    ),
    "asperity gap": lambda path: command("gap", path),
    "asperity realise": lambda path: command("realise", path),
}
WRITERS = {
    "Wall.save": lambda path: WALL.save(path, overwrite=True),
    "KernelMatrix.save": lambda path: MATRIX.save(path, overwrite=True),
    "sweep": swept,
    "asperity walls": lambda path: command("walls", "--out", path),
    "asperity study": lambda path: command("study", "flat", "--bins", 4, "--out", path),
    "asperity sweep": lambda path: command("sweep", "flat", "--out", path),
    "asperity realise": lambda path: command("realise", "lambertian", "--moments", 3, "--out", path),
    "asperity bench": lambda path: command("bench", "koch/law", "--out", path),
}


@contextmanager
def at_once():
    def late(*_):
        pytest.fail(f"no answer within {LIMIT} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def special(kind, folder):
    if kind == "pipe":
        os.mkfifo(folder / "pipe")
        return folder / "pipe"
    if kind == "folder":
        return folder
    if kind == "loop":
        (folder / "loop").symlink_to(folder / "loop")
    elif kind in ("no UTF-8", "deep"):
        (folder / kind).write_bytes(b"\xff" if kind == "no UTF-8" else b"[" * 100_000)
    if kind in ("loop", "no UTF-8", "deep"):
        return folder / kind
    return {"long name": folder / ("n" * 300), "no folder": folder / "missing" / "file"}.get(kind, Path(kind))


@pytest.mark.parametrize(
    "kind",
    ["pipe", "folder", "loop", "no UTF-8", "deep", "/dev/zero", "/proc/kmsg", "/proc/self/status", "long name"],
)
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file_is_refused_by_every_reader(name, kind, tmp_path):
    path = special(kind, tmp_path)
    if kind.startswith("/") and not path.exists():
        pytest.skip("not on this system")
    with at_once(), pytest.raises(InputError) as refused:
        READERS[name](path)
    assert str(refused.value).strip()


@pytest.mark.parametrize("kind", ["pipe", "/dev/full", "/dev/null/file", "long name"])
@pytest.mark.parametrize("name", WRITERS)
def test_where_nothing_can_be_written_every_writer_says_so_before_its_work(name, kind, tmp_path):
    path = special(kind, tmp_path)
    if kind == "/dev/full" and not path.exists():
        pytest.skip("not on this system")
    with at_once(), pytest.raises((InputError, FileExistsRefusal)):
        WRITERS[name](path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="not on this system")
@pytest.mark.parametrize("words", [["walls"], ["gap", "flat"], ["walls", "--help"]])
def test_an_answer_that_cannot_be_printed_is_told_in_one_line(words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "asperity", *words], stdout=full, stderr=subprocess.PIPE, text=True, timeout=300,
            env=environment(),
        )  # fmt: skip
    assert done.returncode == 1 and done.stderr.startswith("asperity: cannot print the answer (No space left")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(not Path("/proc/kcore").exists(), reason="not on this system")
def test_a_file_larger_than_the_memory_is_not_read():
    if Path("/proc/kcore").stat().st_size < 2**45:
        pytest.skip("small here")
    with at_once(), pytest.raises(InputError, match="more than there is"):
        geo.load_wall("/proc/kcore")
