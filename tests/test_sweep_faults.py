"""Sweeps on workers, and what is left when a worker, the scheduler, the process or the disk is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from asperity import AsperityError, Estimate
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.sweeps.folder import wall_by_name

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="processes are ended differently here"),
    # dask's own threads and sockets, when what they talk to is killed
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:.*:DeprecationWarning"),
]

SOURCE = Path(__file__).resolve().parents[1] / "src"
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(SOURCE), os.environ.get("PYTHONPATH", "")])}
FRACTIONS = [round(0.02 * k, 2) for k in range(1, 26)]
GRID = {"diffuse_fraction": FRACTIONS}
# Seconds after which Ctrl-C must have ended a sweep: an idle machine takes a tenth of one.
SOON = 3.0


def slowly(law):
    """A number with all its digits, after a while."""
    time.sleep(0.08)
    return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")


def without_seconds(table):
    return [replace(row, seconds=0.0) for row in table.rows]


@pytest.fixture(scope="module")
def undisturbed():
    return without_seconds(spec.sweep(ker.maxwell, GRID, [slowly, "gap"]))


def test_the_table_does_not_depend_on_the_number_of_workers(undisturbed):
    for workers in (1, 3):
        table = spec.sweep(ker.maxwell, GRID, [slowly, "gap"], client=workers)
        assert without_seconds(table) == undisturbed


def test_traced_walls_have_the_same_bits_on_workers():
    grid = {"wall": ["dispersing-arcs:curvature=0.5", "mushrooms:generations=1"]}
    alone, together = (spec.sweep(wall_by_name, grid, "resistance", 1e-3, client=client) for client in (None, 2))
    assert [row.message for row in alone.rows] == [row.message for row in together.rows]
    assert without_seconds(alone) == without_seconds(together)


def test_the_points_that_are_chosen_do_not_depend_on_the_workers():
    grid = {"diffuse_fraction": spec.Between(0.01, 0.9, points=10)}
    alone, together = (spec.sweep(ker.maxwell, grid, slowly, client=client) for client in (None, 2))
    assert without_seconds(alone) == without_seconds(together)


def test_a_killed_worker_is_replaced_and_its_points_computed_again(undisturbed, tmp_path):
    killed = []

    def murderous(law):
        # the first point to come here ends its worker
        try:
            os.close(os.open(tmp_path / "done", os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")
        os.kill(os.getpid(), signal.SIGKILL)
        killed.append(law)

    table = spec.sweep(ker.maxwell, GRID, murderous, client=2)
    assert (tmp_path / "done").exists()
    values = [row.value for row in undisturbed if row.quantity == "slowly"]
    assert [row.value for row in table.rows] == values


def test_a_point_that_ends_every_worker_ends_the_sweep_with_a_message(tmp_path):
    def deadly(law):
        if law.terms[0][0] > 0.45:
            os.kill(os.getpid(), signal.SIGKILL)
        return slowly(law)

    with pytest.raises(AsperityError, match="ended every worker"):
        spec.sweep(ker.maxwell, GRID, deadly, client=1, checkpoint=tmp_path / "a")


def started(*command, cwd):
    return subprocess.Popen(
        [sys.executable, *command], env=ENVIRONMENT, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_a_lost_scheduler_ends_the_sweep_which_then_goes_on(undisturbed, tmp_path):
    program = (
        "import time\nfrom distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    cluster = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address='127.0.0.1:0')\n"
        "    print(cluster.scheduler_address, flush=True)\n    time.sleep(600)\n"
    )
    (tmp_path / "cluster.py").write_text(program)

    def slowly(law):
        # by value: the scheduler has no module of these tests
        time.sleep(0.08)
        return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")

    with started("cluster.py", cwd=tmp_path) as cluster:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        # the scheduler is killed while the sweep waits for results
        killer = subprocess.Popen(
            [sys.executable, "-c", f"import os, time; time.sleep(1.5); os.kill({cluster.pid}, 9)"]
        )
        try:
            with pytest.raises(AsperityError, match="the scheduler is gone"):
                spec.sweep(ker.maxwell, GRID, [slowly, "gap"], client=address, checkpoint=tmp_path / "a")
        finally:
            killer.wait()
            cluster.kill()
    with Stored(tmp_path / "a") as stored:
        assert 0 < len(stored) < len(FRACTIONS)
    table = spec.sweep(ker.maxwell, GRID, [slowly, "gap"], checkpoint=tmp_path / "a")
    assert without_seconds(table) == undisturbed


class Stored:
    """The points in a checkpoint, read as any other program would."""

    def __init__(self, path):
        import sqlite3

        self.file = sqlite3.connect(path)

    def __enter__(self):
        return [key for (key,) in self.file.execute("SELECT key FROM parts")]

    def __exit__(self, *_):
        self.file.close()


SWEEP = """
import sys, time
from asperity import kernels as ker, spectral as spec
from asperity.estimates import Estimate

def slowly(law):
    print("point", flush=True)
    time.sleep(0.08)
    return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")

if __name__ == "__main__":
    grid = {"diffuse_fraction": [round(0.02 * k, 2) for k in range(1, 26)]}
    table = spec.sweep(ker.maxwell, grid, [slowly, "gap"], checkpoint="a")
    print(repr([(row.value, row.error, row.quantity) for row in table.rows]))
"""


def test_a_killed_process_goes_on_with_the_same_bits(undisturbed, tmp_path):
    (tmp_path / "run.py").write_text(SWEEP)
    for _ in range(3):
        with started("run.py", cwd=tmp_path) as process:
            assert process.stdout is not None
            for _ in range(9):
                process.stdout.readline()
            process.kill()
    with started("run.py", cwd=tmp_path) as process:
        out, _ = process.communicate(timeout=60)
    assert out.count("point") < len(FRACTIONS)
    assert out.splitlines()[-1] == repr([(row.value, row.error, row.quantity) for row in undisturbed])


@pytest.mark.parametrize("workers", [[], ["--workers", "2"]])
def test_ctrl_c_ends_the_command_within_a_second_and_says_how_to_go_on(tmp_path, workers):
    (tmp_path / "long.py").write_text(
        "import signal, runpy, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "if __name__ == '__main__':\n"
        "    sys.argv[0] = 'asperity'\n"
        "    runpy.run_module('asperity', run_name='__main__')\n"
    )
    command = ["long.py", "sweep", "focusing-arcs", "--over", "half_angle=0.1:1.5:400", "--quantity", "resistance,gap"]
    with started(*command, "--tolerance", "1e-3", *workers, "--out", "a", cwd=tmp_path) as process:
        try:
            deadline = time.time() + 120.0
            while time.time() < deadline and not has_points(tmp_path / "a" / "sweep.checkpoint"):
                time.sleep(0.2)
            sent = time.time()
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
            took = time.time() - sent
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert took < SOON
    assert "of 400 points, which are in a/sweep.checkpoint; the same call goes on from there" in err.splitlines()[-1]


def has_points(path):
    """Whether a file that another process holds has grown beyond its empty tables."""
    return path.exists() and path.stat().st_size > 16384


def test_a_disk_that_is_full_stops_the_sweep_and_loses_nothing(undisturbed, tmp_path):
    limited = SWEEP.replace(
        'if __name__ == "__main__":',
        'if __name__ == "__main__":\n'
        "    import resource, signal\n"
        "    from asperity.core import checkpoints\n"
        "    checkpoints.MOMENT = 0.0\n"
        "    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (20480, resource.RLIM_INFINITY))",
    )
    (tmp_path / "limited.py").write_text(limited)
    with started("limited.py", cwd=tmp_path) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "what was written before is safe. Free space" in err
    with Stored(tmp_path / "a") as stored:
        assert 0 < len(stored) < len(FRACTIONS)
    (tmp_path / "run.py").write_text(SWEEP)
    with started("run.py", cwd=tmp_path) as process:
        out, _ = process.communicate(timeout=60)
    assert out.count("point") == len(FRACTIONS) - len(stored)
    assert out.splitlines()[-1] == repr([(row.value, row.error, row.quantity) for row in undisturbed])
