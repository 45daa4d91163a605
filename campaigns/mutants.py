"""Mutation tests: python -m campaigns.mutants [MODULE ...] prints a table of the faults that the tests miss.

cosmic-ray writes one small fault at a time into a module (another number, - for +, / for *, a reversed comparison, a
negated condition, ...), and the module's own tests are run on it. A mutant that survives is a fault that the tests
miss, unless the changed line has the same meaning. `equivalent_mutants.toml` lists such equivalent mutants with their
reasons. The modules are those whose errors do not show in the results that they prove or weight.

A mutant runs in a fork of a process that has imported everything that does not need the module; nothing is written to
the tree. A survivor that is not known to be equivalent is tested again, by a fresh Python in a copy of the tree.
``--fraction 0.1`` takes every tenth mutant.
"""

from __future__ import annotations

import argparse
import difflib
import gc
import importlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from multiprocessing import get_context
from pathlib import Path

from .pages import print_table

ROOT = Path(__file__).resolve().parent.parent
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
# The tests of each module, quick ones first, because the first failure ends a run.
TESTS = {
    "spectral/eigenvalues/completeness.py": ("spectral/test_completeness.py",),
    "spectral/bounds/enclosure.py": ("spectral/test_enclosure_intervals.py", "properties/test_refusals_kernels.py"),
    "spectral/bounds/separation.py": ("spectral/test_separation.py",),
    "kernels/matrices/defects.py": ("kernels/matrices/test_symmetry.py",),
    "kernels/sampling/counts.py": ("kernels/matrices/test_counting.py",),
    "kernels/bases/assembly.py": ("kernels/matrices/test_bases.py",),
    "kernels/bases/legendre.py": ("kernels/matrices/test_bases.py", "properties/test_refusals_kernels.py"),
    "kernels/bases/panels.py": ("kernels/matrices/test_bases.py", "properties/test_refusals_kernels.py"),
    "kernels/collisions/collision_law.py": (
        "kernels/collisions/test_collision.py",
        "kernels/collisions/test_collision_algebra.py",
        "properties/test_refusals_kernels.py",
    ),
    "kernels/bases/measure.py": ("kernels/matrices/test_bases.py", "properties/test_refusals_kernels.py"),
    "geometry/disk/disk.py": ("geometry/disks/test_disk.py", "properties/test_refusals_geometry.py"),
    "geometry/cells/profile.py": ("geometry/walls/test_profiles.py", "properties/test_refusals_geometry.py"),
}
# Kinds of mutants: plausible human errors, not every operator exchanged with every other.
KINDS = (
    "NumberReplacer", "AddNot", "Delete_Not", "Delete_USub", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue",
    "ReplaceOrWithAnd", "ReplaceAndWithOr", "ZeroIterationForLoop", "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak", "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "FloorDiv_Mul", "Mod_FloorDiv",
    "Eq_NotEq", "NotEq_Eq", "Lt_LtE", "Lt_Gt", "LtE_Lt", "LtE_GtE", "Gt_GtE", "Gt_Lt", "GtE_Gt", "GtE_LtE", "Is_IsNot",
    "IsNot_Is", "In_NotIn", "NotIn_In",
)  # fmt: skip
# Limits of a mutant: PATIENCE times the module's own processor time plus SECONDS, and BYTES of memory.
PATIENCE, SECONDS, BYTES = 10.0, 20.0, 2**34
# Imports of the tests besides asperity.
LIBRARIES = ("hypothesis", "mpmath", "numba", "numpy.testing", "pytest", "scipy.linalg", "scipy.special", "scipy.stats")
INTERNAL_ERROR = 3
PYTEST = ("-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:xdist")
LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv*", ".*_cache", ".hypothesis", "*.egg-info", "build", "dist", "_build", "study", "bench-results"
)


@dataclass(frozen=True)
class Mutant:
    """A changed line, and whether the tests failed on it."""

    module: str
    line: int
    before: str
    after: str
    killed: bool

    @property
    def change(self) -> tuple[str, str, str]:
        """The key of the mutant in `equivalent_mutants.toml`."""
        return self.module, self.before, self.after


def main() -> None:
    """Print a row for each module, and the survivors that are not known to be equivalent."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=f"among {', '.join(TESTS)}")
    parser.add_argument("--fraction", type=float, default=1.0, help="fraction of the mutants that are tried")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="modules at a time")
    options = parser.parse_args()
    unknown = set(options.modules) - set(TESTS)
    if unknown:
        parser.error(f"no tests are listed for {', '.join(sorted(unknown))}")
    same = known_equivalents()
    found: list[Mutant] = []

    def cells(module: str, mutants: list[Mutant]) -> str:
        alive = [mutant for mutant in mutants if not mutant.killed]
        left = [mutant for mutant in alive if mutant.change not in same]
        found.extend(left)
        killed = len(mutants) - len(alive)
        fraction = 100.0 * killed / max(killed + len(left), 1)
        return f"`{module}` | {len(mutants)} | {killed} | {len(alive) - len(left)} | {len(left)} | {fraction:.1f} %"

    modules = options.modules or list(TESTS)
    with ProcessPoolExecutor(options.jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        tries = pool.map(partial(mutants_of, fraction=options.fraction, seed=options.seed, same=same), modules)
        print_table(
            "module | mutants | killed | equivalent | survived | killed of the others", map(cells, modules, tries)
        )
    for mutant in found:
        print(f"\n{mutant.module}:{mutant.line}\n- {mutant.before}\n+ {mutant.after}")


def known_equivalents() -> set[tuple[str, str, str]]:
    """Module, line and changed line of the equivalent mutants listed in the file."""
    listed = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))["mutant"]
    return {(entry["module"], entry["before"], entry["after"]) for entry in listed}


def mutants_of(module: str, fraction: float, seed: int, same: set[tuple[str, str, str]]) -> list[Mutant]:
    """Test the mutants of one module; the process must be fresh."""
    original = (ROOT / module).read_text(encoding="utf-8")
    _warm(module)
    killed, seconds = _is_killed(module, original, resource.RLIM_INFINITY)
    if killed:
        sys.exit(f"the tests of {module} fail without a fault: run pytest {' '.join(_tests(module))}")
    changed = list(_changed_sources(original))
    found = []
    for source in random.Random(seed).sample(changed, round(fraction * len(changed))):
        mutant = _mutant(module, original, source, _is_killed(module, source, round(PATIENCE * seconds + SECONDS))[0])
        if not mutant.killed and mutant.change not in same:
            mutant = replace(mutant, killed=_is_killed_afresh(module, source))
        found.append(mutant)
    return found


def _changed_sources(original: str) -> Iterator[str]:
    """Copies of the module with one fault of the listed kinds, outside decorators, whose arguments are not
    arithmetic."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    lines = original.splitlines()
    for name in sorted(name for name in operator_names() if name.endswith(KINDS)):
        operator = get_operator(name)()
        places = [place for node in ast_nodes(get_ast(original)) for place in operator.mutation_positions(node)]
        for number, ((line, _), _) in enumerate(places):
            if not lines[line - 1].lstrip().startswith("@"):
                yield mutate_code(original, operator, number)


class _Source(MetaPathFinder, InspectLoader):
    """Gives a module another source, or none, so that it cannot be imported."""

    def __init__(self, module: str, source: str | None) -> None:
        self.name = "asperity." + module.removesuffix(".py").replace("/", ".")
        self.path, self.source = ROOT / "src" / "asperity" / module, source

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return spec_from_file_location(fullname, self.path, loader=self) if fullname == self.name else None

    def get_source(self, fullname: str) -> str | None:
        return self.source


def _warm(module: str) -> None:
    """Import everything that can be imported without the module."""
    os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT / "src"), str(ROOT)]
    for library in LIBRARIES:
        importlib.import_module(library)
    sys.meta_path.insert(0, _Source(module, None))
    for room in ("geometry", "kernels", "spectral"):
        for path in sorted((ROOT / room).glob("*.py")):
            with suppress(ImportError):
                importlib.import_module(f"asperity.{room}.{path.stem}")
    sys.meta_path.pop(0)
    gc.freeze()  # or every fork would look for garbage among all that it shares


def _is_killed(module: str, source: str, seconds: int) -> tuple[bool, float]:
    """Whether the module's tests fail in a fork with this source, and the CPU seconds of the tests."""
    process = os.fork()
    if process == 0:
        with suppress(BaseException):
            os._exit(_run_tests(module, source, seconds))
        os._exit(INTERNAL_ERROR)
    _, status, used = os.wait4(process, 0)
    code = os.waitstatus_to_exitcode(status)
    # 4 where the list of walls cannot even be made
    if code not in (0, 1, 2, 4, -signal.SIGXCPU, -signal.SIGALRM):
        sys.exit(f"the tests of {module} ended with {code}")
    return code != 0, used.ru_utime + used.ru_stime


def _run_tests(module: str, source: str, seconds: int) -> int:
    import pytest
    from hypothesis import Phase, settings

    # one counterexample suffices, without shrinking
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", deadline=None, derandomize=True, phases=phases, report_multiple_bugs=False)

    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    sys.meta_path.insert(0, _Source(module, source))
    return int(pytest.main([*PYTEST, "--hypothesis-profile=mutants", *_tests(module)]))


def _is_killed_afresh(module: str, source: str) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
        (tree / module).write_text(source, encoding="utf-8")
        command = [sys.executable, "-m", "pytest", *PYTEST, *_tests(module)]
        environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
        return subprocess.run(command, cwd=tree, env=environment, capture_output=True, check=False).returncode != 0


def _tests(module: str) -> list[str]:
    return [f"tests/{name}" for name in TESTS[module]]


def _mutant(module: str, original: str, source: str, killed: bool) -> Mutant:
    diff = list(difflib.unified_diff(original.splitlines(), source.splitlines(), lineterm="", n=0))
    line = int(diff[2].split()[1].split(",")[0].lstrip("-"))
    before, after = (" ".join(text[1:].strip() for text in diff[3:] if text.startswith(sign)) for sign in "-+")
    return Mutant(module, line, before, after, killed)


if __name__ == "__main__":
    main()
