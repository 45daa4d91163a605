"""Mutation tests: python -m campaigns.mutants [MODULE ...] prints a table of the faults that the tests miss.

cosmic-ray writes one small fault at a time into a module (another number, - for +, / for *, a reversed comparison, a
negated condition, ...), in a copy of the tree, and runs the module's own tests on it. A mutant that survives is a fault
that the tests miss, unless the changed line has the same meaning. `equivalent_mutants.toml` lists such equivalent
mutants with their reasons. The modules are those whose errors do not show in the results that they prove or weight.
``--fraction 0.1`` takes every tenth mutant.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shlex
import shutil
import sys
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from .pages import print_table

ROOT = Path(__file__).resolve().parent.parent
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
# Modules whose faults should be found by the tests in the folder of the same path, and by those of refusals.
MODULES = (
    "spectral/eigenvalues/dense.py", "spectral/bounds/enclosure.py", "spectral/bounds/separation.py",
    "kernels/matrices/defects.py", "kernels/sampling/counts.py", "kernels/bases/assembly.py",
    "kernels/bases/polynomials.py", "kernels/bases/partitions.py", "kernels/bases/measure.py",
    "kernels/collisions/collision_law.py", "geometry/disk/disk.py", "geometry/cells/profile.py",
)  # fmt: skip
REFUSALS = "tests/properties/test_refusals_kernels.py", "tests/properties/test_refusals_geometry.py"
# Kinds of mutants: plausible human errors, not every operator exchanged with every other.
KINDS = (
    "NumberReplacer", "AddNot", "Delete_Not", "Delete_USub", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue",
    "ReplaceOrWithAnd", "ReplaceAndWithOr", "ZeroIterationForLoop", "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak", "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "FloorDiv_Mul", "Mod_FloorDiv",
    "Eq_NotEq", "NotEq_Eq", "Lt_LtE", "Lt_Gt", "LtE_Lt", "LtE_GtE", "Gt_GtE", "Gt_Lt", "GtE_Gt", "GtE_LtE", "Is_IsNot",
    "IsNot_Is", "In_NotIn", "NotIn_In",
)  # fmt: skip
# Limits of a mutant: PATIENCE times the time of the tests on the module itself plus SECONDS, and BYTES of memory.
PATIENCE, SECONDS, BYTES = 10.0, 20.0, 2**34
PYTEST = ("-m", "pytest", "-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:xdist")
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
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=f"by default {', '.join(MODULES)}")
    parser.add_argument("--fraction", type=float, default=1.0, help="fraction of the mutants that are tried")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="modules at a time")
    options = parser.parse_args()
    untested = [module for module in options.modules if not (ROOT / "tests" / module).parent.is_dir()]
    if untested:
        parser.error(f"no folder of tests/ belongs to {', '.join(untested)}")
    same = known_equivalents()
    found: list[Mutant] = []

    def cells(module: str, mutants: list[Mutant]) -> str:
        alive = [mutant for mutant in mutants if not mutant.killed]
        left = [mutant for mutant in alive if mutant.change not in same]
        found.extend(left)
        killed = len(mutants) - len(alive)
        fraction = 100.0 * killed / max(killed + len(left), 1)
        return f"`{module}` | {len(mutants)} | {killed} | {len(alive) - len(left)} | {len(left)} | {fraction:.1f} %"

    modules = options.modules or MODULES
    with ProcessPoolExecutor(options.jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
        tries = pool.map(partial(mutants_of, fraction=options.fraction, seed=options.seed), modules)
        print_table(
            "module | mutants | killed | equivalent | survived | killed of the others", map(cells, modules, tries)
        )
    for mutant in found:
        print(f"\n{mutant.module}:{mutant.line}\n- {mutant.before}\n+ {mutant.after}")


def known_equivalents() -> set[tuple[str, str, str]]:
    """Module, line and changed line of the equivalent mutants listed in the file."""
    listed = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))["mutant"]
    return {(entry["module"], entry["before"], entry["after"]) for entry in listed}


def mutants_of(module: str, fraction: float, seed: int) -> list[Mutant]:
    """Test the mutants of one module, in a process of its own."""
    from cosmic_ray.commands import init
    from cosmic_ray.mutating import mutate_and_test
    from cosmic_ray.testing import run_tests
    from cosmic_ray.work_db import use_db
    from cosmic_ray.work_item import TestOutcome

    command = shlex.join([sys.executable, *PYTEST, f"tests/{Path(module).parent}", *REFUSALS])
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    with TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
        os.chdir(tree)
        os.environ["PYTHONPATH"] = os.pathsep.join((str(tree / "src"), str(tree)))
        begun = time.monotonic()
        outcome, _ = run_tests(command, None)
        limit = PATIENCE * (time.monotonic() - begun) + SECONDS
        if outcome != TestOutcome.SURVIVED:
            sys.exit(f"the tests of {module} fail without a fault: run {command}")
        lines = Path(module).read_text(encoding="utf-8").splitlines()
        with use_db(f"{folder}/session.sqlite") as session:
            init([Path(module)], session, {})
            # no decorators, whose arguments are not arithmetic
            faults = [
                fault
                for item in session.work_items
                for fault in item.mutations
                if fault.operator_name.endswith(KINDS) and not lines[fault.start_pos[0] - 1].lstrip().startswith("@")
            ]
        faults.sort(key=lambda fault: (fault.operator_name, fault.occurrence))
        found = []
        for fault in random.Random(seed).sample(faults, round(fraction * len(faults))):
            result = mutate_and_test([fault], command, limit)
            before, after = (_changed(result.diff, sign) for sign in "-+")
            found.append(Mutant(module, fault.start_pos[0], before, after, result.is_killed))
    return found


def _changed(diff: str, sign: str) -> str:
    """The lines of a diff with this sign, without its headings, as one."""
    lines = [line[1:].strip() for line in diff.splitlines() if line.startswith(sign) and line[:3] != 3 * sign]
    return " ".join(lines)


if __name__ == "__main__":
    main()
