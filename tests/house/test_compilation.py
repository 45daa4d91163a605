"""Compiled functions on disk: outdated code, folders that are read-only, and what is said about it."""

import ast
import importlib.util
import logging
import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

import asperity
from asperity.core import compilation
from commands import ended, environment

TWICE = "from asperity.core.compilation import jit\n@jit()\ndef twice(x):\n    return 2.0 * x\n"
SOURCE = Path(asperity.__file__).parent


@pytest.fixture
def module(tmp_path):
    (tmp_path / "doubling.py").write_text(TWICE)
    return tmp_path / "doubling.py"


def loaded(path):
    """The compiled function of a module, as a fresh process would have it."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found.twice


def hits_after_a_call(path):
    function = loaded(path)
    assert function(1.5) == 3.0
    return sum(function.stats.cache_hits.values())


def test_a_compiled_function_is_loaded_from_disk(module):
    assert [hits_after_a_call(module) for _ in range(2)] == [0, 1]


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("content", [b"", b"damaged", None])
def test_a_function_whose_stored_files_are_damaged_is_compiled_again(module, kind, content, caplog):
    assert hits_after_a_call(module) == 0
    (path,) = module.parent.glob(f"**/*.{kind}")
    path.write_bytes(path.read_bytes()[:100] if content is None else content)
    with caplog.at_level(logging.WARNING, logger="asperity"):
        assert [hits_after_a_call(module) for _ in range(2)] == [0, 1]
    assert str(path.parent) in caplog.text and "damaged" in caplog.text


def test_numbas_switch_that_turns_compilation_off_is_refused():
    done = ended("-c", TWICE, env=environment(NUMBA_DISABLE_JIT="1"))
    assert "AsperityError: NUMBA_DISABLE_JIT is set, but rays are traced by compiled functions; unset it" in done.stderr


def test_code_from_other_sources_is_not_run(module, monkeypatch):
    assert [hits_after_a_call(module) for _ in range(2)] == [0, 1]
    with monkeypatch.context() as changed:
        changed.setattr(compilation, "digest", lambda: 1)
        assert [hits_after_a_call(module) for _ in range(2)] == [0, 1]
    assert hits_after_a_call(module) == 1


def test_the_digest_has_every_module_from_which_compiled_code_takes_a_name(monkeypatch):
    read = set()
    bytes_of = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: read.add(self.resolve()) or bytes_of(self))
    compilation.digest.__wrapped__()
    # types only
    read.add((SOURCE / "core" / "checks.py").resolve())
    compiled = [path for path in read if {"compiled", "double_double"} & set(path.parts)]
    assert len(compiled) > 30
    for path in compiled:
        for statement in ast.parse(path.read_text()).body:
            if isinstance(statement, ast.ImportFrom) and statement.level:
                # the rooms are links in the package
                start = SOURCE / path.relative_to(SOURCE.parents[1]) if SOURCE not in path.parents else path
                module = start.parents[statement.level - 1].joinpath(*(statement.module or "").split("."))
                for name in statement.names:
                    files = [module.with_suffix(".py"), module / f"{name.name}.py"]
                    assert any(file.resolve() in read for file in files), (path, module, name.name)


def test_compiling_is_announced_once_in_the_log(module, caplog):
    compilation.announce.cache_clear()
    with caplog.at_level(logging.INFO, "asperity"):
        function = loaded(module)
        function(1.5)
        function(1)
    assert [record.message for record in caplog.records] == ["asperity: compiling, once (about 10 s)"]
    caplog.clear()
    compilation.announce.cache_clear()
    with caplog.at_level(logging.INFO, "asperity"):
        loaded(module)(1.5)
    assert caplog.records == []


@pytest.fixture
def read_only(tmp_path):
    """A copy of the package and an environment in which no folder takes compiled functions.

    Files stand where the folders for compiled functions would be, which keeps out root, too.
    """
    package = tmp_path / "install" / "asperity"
    shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__", "*.nb[ic]"))
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").write_text("")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "XDG"))}
    return environment | {"HOME": "/dev/null", "PYTHONPATH": str(package.parent)}


TRACE = "from asperity import geometry as geo; print(geo.trace(geo.flat(), [0.2], [1.0]).counts()['escaped'])"


def test_in_a_read_only_install_functions_are_compiled_with_one_warning_and_not_stored(read_only):
    done = ended("-c", TRACE, env=read_only)
    assert (done.returncode, done.stdout.strip()) == (0, "1")
    [warning] = done.stderr.splitlines()
    assert "NUMBA_CACHE_DIR" in warning


def test_a_terminal_shows_that_functions_are_compiled(tmp_path, module):
    reader, writer = pty.openpty()
    command = f"import sys; sys.path[:0] = {[str(SOURCE.parent), str(tmp_path)]}; import doubling; doubling.twice(1.0)"
    shown = []
    for _ in range(2):
        heard = os.environ | {"ASPERITY_QUIET": ""}
        done = subprocess.run([sys.executable, "-c", command], stderr=writer, timeout=300, env=heard)
        assert done.returncode == 0
        os.write(writer, b"end\n")
        text = ""
        while not text.endswith("end\r\n"):
            text += os.read(reader, 4096).decode()
        shown.append(text.split())
    assert shown == [["asperity:", "compiling,", "once", "(about", "10", "s)", "end"], ["end"]]


COMMANDS = """
import logging, sys
from asperity.cli import main
logging.basicConfig(level=logging.INFO, stream=sys.stdout)
for command in sys.argv[1:]:
    main(command.split(), standalone_mode=False)
"""


@pytest.mark.slow
def test_after_the_warm_up_a_study_compiles_nothing():
    def printed(*commands):
        done = ended("-c", COMMANDS, *commands)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "stored in " in printed("warm-up")
    walls = ("focusing-arcs", "triangular-teeth")
    text = printed(*(f"study {wall} --bins 16 --tolerance 0.01" for wall in walls))
    assert text.count("\ngap ") == 2 and "compiling" not in text


def test_ctrl_c_during_a_late_compilation_is_not_lost():
    from asperity.geometry.scene.compiled import compiling

    class Interrupted:
        def compile(self, kinds):
            raise KeyboardInterrupt

    late = compiling.Late(Interrupted())
    # compiled code gets 0 from this call, and goes on
    with pytest.raises(KeyboardInterrupt):
        compiling.checked(lambda: late.load())
    assert compiling.Late.failures == []


def test_an_inner_function_is_refused_from_python_and_called_by_compiled_ones():
    @compilation.jit(no_cpython_wrapper=True)
    def inner(x):
        return 2.0 * x

    @compilation.jit()
    def outer(x):
        return inner(x)

    assert outer(1.5) == 3.0
    with pytest.raises(TypeError, match="py_func"):
        inner(1.5)


def test_a_linked_function_is_a_part_of_its_callers_and_its_errors_reach_python():
    @compilation.jit(linked=True)
    def root(x):
        if x < 0.0:
            raise ValueError("negative")
        return x**0.5

    @compilation.jit(linked=True)
    def next_root(x):
        return root(x + 1.0)

    @compilation.jit()
    def both(x):
        return next_root(x), root(x)

    assert both(8.0) == (3.0, 8.0**0.5)
    with pytest.raises(ValueError, match="negative"):
        both(-0.5)
    assert both.stats.cache_path and root.stats.cache_path is None
    with pytest.raises(TypeError, match="py_func"):
        root(4.0)


def polygon_area():
    @compilation.jit(linked=True)
    def cross(points, i, j):
        return points[i, 0] * points[j, 1] - points[i, 1] * points[j, 0]

    @compilation.jit(_nrt=False)
    def area(points):
        total = 0.0
        for i in range(points.shape[0]):
            total += cross(points, i, i - 1) if i > 0 else cross(points, 0, points.shape[0] - 1)
        return abs(total) / 2

    return area(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])), area.targetoptions


def test_options_that_numba_does_not_have_are_left_out(monkeypatch, tmp_path):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    found, options = polygon_area()
    assert found == 6.0 and options["_nrt"] is False
    monkeypatch.setattr(compilation, "has_option", lambda name: False)
    found, options = polygon_area()
    assert found == 6.0 and not compilation.UNDOCUMENTED & set(options)


# Modules, and names of others, that numba's manual has: its interface, that for extensions with its data models, and
# the events of its compiler.
DOCUMENTED = {
    "numba.extending", "numba.core.errors", "numba.core.types",
    *(f"numba:{name}" for name in ("carray", "njit", "typeof", "types")),
    *(f"numba.core:{name}" for name in ("cgutils", "config", "errors", "event", "types")),
}  # fmt: skip


def undocumented(text):
    """The names that a source imports from numba and that its manual lacks; the whole package hides its modules."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names if name.name.partition(".")[0] == "numba"}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module.partition(".")[0] == "numba":
            found |= {f"{node.module}:{name.name}" for name in node.names if node.module not in DOCUMENTED}
    return found - DOCUMENTED


def test_the_package_takes_no_name_from_numba_that_its_manual_lacks():
    texts = {path: path.read_text(encoding="utf-8") for folder in SOURCE.iterdir() for path in folder.glob("**/*.py")}
    found = {path: undocumented(text) for path, text in texts.items() if "numba" in text}
    assert len(found) > 10 and {path: names for path, names in found.items() if names} == {}
    for text in ("from numba.np.arrayobj import make_array", "def f():\n    import numba\n", "from numba import core",
                 "import numba.core.typing.templates as t"):  # fmt: skip
        assert undocumented(text) and not undocumented("from numba import njit, types\ntypes.int64")
