"""Which wrong lines the tests would let pass: python -m benchmarks.mutants [MODULE ...] prints a table of mutants.

cosmic-ray writes one small fault at a time into a copy of a module (another number, - for +, / for *, a comparison
turned, a condition negated, ...), and the module's own tests are run on it. A mutant that survives is a fault that
nobody would see, unless the changed line means the same: `equivalent_mutants.toml` has those, each with its reason.
The modules are those whose errors do not show in the results that they prove or weigh. A full run takes hours;
``--share 0.1`` takes every tenth mutant.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
# The tests that are to see a fault in a module; the quick ones first, since the first failure ends a run.
TESTS = {
    "spectral/completeness.py": ("test_completeness.py",),
    "spectral/enclosure.py": ("test_enclosure_intervals.py",),
    "spectral/separation.py": ("test_separation.py",),
    "kernels/symmetry.py": ("test_symmetry.py",),
    "kernels/counting.py": ("test_counting.py",),
    "kernels/products.py": ("test_weights_and_bases.py",),
    "kernels/legendre.py": ("test_weights_and_bases.py",),
    "kernels/panels.py": ("test_weights_and_bases.py",),
    "kernels/collision.py": ("test_collision_maps.py",),
    "kernels/measure.py": ("test_weights_and_bases.py",),
    "geometry/disk.py": ("test_disk.py",),
    "geometry/profile.py": ("test_profiles.py",),
}
# Mutants of these kinds: exchanges of operators whose faults people make, not every operator by every other.
KINDS = (
    "NumberReplacer", "AddNot", "Delete_Not", "Delete_USub", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue",
    "ReplaceOrWithAnd", "ReplaceAndWithOr", "ZeroIterationForLoop", "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak", "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "FloorDiv_Mul", "Mod_FloorDiv",
    "Eq_NotEq", "NotEq_Eq", "Lt_LtE", "Lt_Gt", "LtE_Lt", "LtE_GtE", "Gt_GtE", "Gt_Lt", "GtE_Gt", "GtE_LtE", "Is_IsNot",
    "IsNot_Is", "In_NotIn", "NotIn_In",
)  # fmt: skip
SECONDS = 120.0
LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv*", ".*_cache", ".hypothesis", "*.egg-info", "build", "dist", "_build", "study", "bench-results"
)


@dataclass(frozen=True)
class Mutant:
    """A changed line, and whether the tests saw it."""

    module: str
    line: int
    before: str
    after: str
    killed: bool


def main() -> None:
    """Print a row a module, and the survivors that are not known to be equivalent."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=f"among {', '.join(TESTS)}")
    parser.add_argument("--share", type=float, default=1.0, help="share of the mutants that are tried")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="modules at a time")
    options = parser.parse_args()
    unknown = set(options.modules) - set(TESTS)
    if unknown:
        parser.error(f"no tests are listed for {', '.join(sorted(unknown))}")
    same = known_equivalents()
    print("| module | mutants | killed | equivalent | survived | killed of the others |\n" + "|---" * 6 + "|")
    with ThreadPoolExecutor(options.jobs) as pool:
        rows = pool.map(lambda module: mutants_of(module, options.share, options.seed), options.modules or TESTS)
        found = []
        for module, mutants in zip(options.modules or TESTS, rows, strict=True):
            alive = [mutant for mutant in mutants if not mutant.killed]
            left = [mutant for mutant in alive if (module, mutant.before, mutant.after) not in same]
            killed, others = len(mutants) - len(alive), len(mutants) - len(alive) + len(left)
            print(
                f"| `{module}` | {len(mutants)} | {killed} | {len(alive) - len(left)} | {len(left)} "
                f"| {100.0 * killed / max(others, 1):.1f} % |",
                flush=True,
            )
            found += left
    for mutant in found:
        print(f"\n{mutant.module}:{mutant.line}\n- {mutant.before}\n+ {mutant.after}")


def known_equivalents() -> set[tuple[str, str, str]]:
    """Module, line and changed line of the mutants that mean the same, as the file lists them."""
    listed = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))["mutant"]
    return {(entry["module"], entry["before"], entry["after"]) for entry in listed}


def mutants_of(module: str, share: float, seed: int) -> list[Mutant]:
    """Try the mutants of one module in a copy of the whole tree."""
    from cosmic_ray.work_db import WorkDB, use_db

    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
        tests = " ".join(f"tests/{name}" for name in TESTS[module])
        command = f"{sys.executable} -m pytest -x -q -p no:cacheprovider -p no:xdist {tests}"
        (tree / "mutants.toml").write_text(
            f'[cosmic-ray]\nmodule-path = "{module}"\ntimeout = {SECONDS}\ntest-command = "{command}"\n'
            '[cosmic-ray.distributor]\nname = "local"\n'
        )
        environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
        _run([*command.split()], tree, environment)
        _run(["cosmic-ray", "init", "mutants.toml", "mutants.sqlite"], tree, environment)
        database = str(tree / "mutants.sqlite")
        with use_db(database, WorkDB.Mode.open) as work:
            _leave_out(work, (tree / module).read_text(encoding="utf-8").splitlines(), share, random.Random(seed))
        _run(["cosmic-ray", "exec", "mutants.toml", "mutants.sqlite"], tree, environment)
        with use_db(database, WorkDB.Mode.open) as work:
            results = [result for _, result in work.completed_work_items if result.test_outcome is not None]
            return [_mutant(module, result.diff, result.is_killed) for result in results]


def _leave_out(work, source: list[str], share: float, chance: random.Random) -> None:
    """Skip the kinds that are not listed, decorators, whose arguments are no arithmetic, and all but a share."""
    from cosmic_ray.work_item import WorkerOutcome, WorkResult

    items = sorted(work.pending_work_items, key=lambda item: str(item.mutations))
    wanted = [
        item
        for item in items
        if item.mutations[0].operator_name.endswith(KINDS)
        and not source[item.mutations[0].start_pos[0] - 1].lstrip().startswith("@")
    ]
    tried = {item.job_id for item in chance.sample(wanted, round(share * len(wanted)))}
    left_out = [item.job_id for item in items if item.job_id not in tried]
    work.set_multiple_results(left_out, WorkResult(worker_outcome=WorkerOutcome.SKIPPED))


def _mutant(module: str, diff: str, killed: bool) -> Mutant:
    lines = diff.splitlines()
    place = int(next(line for line in lines if line.startswith("@@")).split()[1].split(",")[0].lstrip("-"))
    body = lines[next(k for k, line in enumerate(lines) if line.startswith("@@")) + 1 :]
    offset = next(k for k, line in enumerate(body) if line.startswith("-"))
    return Mutant(module, place + offset, _changed(body, "-"), _changed(body, "+"), killed)


def _changed(body: Iterable[str], sign: str) -> str:
    return " ".join(line[1:].strip() for line in body if line.startswith(sign))


def _run(command: list[str], tree: Path, environment: dict[str, str]) -> None:
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")


if __name__ == "__main__":
    main()
