"""Sweeps on workers, and what is left when a worker, the scheduler, the process or the disk is lost."""

import os
import re
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from asperity import AsperityError, Estimate
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import workers
from asperity.spectral.sweeps.named_families import wall_by_name
from commands import ended, parts_in, started

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="processes are ended differently here"),
    # dask's own threads and sockets, when what they talk to is killed
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore:.*:DeprecationWarning"),
]

FRACTIONS = [round(0.04 * k, 2) for k in range(1, 13)]
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


def test_tables_chosen_points_and_traced_walls_do_not_depend_on_the_workers(worker_processes):
    walls = {"wall": ["dispersing-arcs:curvature=0.5", "mushrooms:generations=1"]}
    chosen = {"diffuse_fraction": spec.Between(0.01, 0.9, points=10)}
    for asked in (
        (ker.maxwell, GRID, [slowly, "gap"]),
        (ker.maxwell, chosen, slowly),
        (wall_by_name, walls, "resistance", 1e-3),
    ):
        alone, together = (without_seconds(spec.sweep(*asked, client=client)) for client in (None, worker_processes))
        assert alone == together


def test_a_killed_worker_is_replaced_and_its_points_computed_again(undisturbed, worker_processes, tmp_path):

    def murderous(law):
        # the first point to come here ends its worker
        try:
            os.close(os.open(tmp_path / "done", os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")
        os.kill(os.getpid(), signal.SIGKILL)

    table = spec.sweep(ker.maxwell, GRID, murderous, client=worker_processes)
    assert (tmp_path / "done").exists()
    values = [row.value for row in undisturbed if row.quantity == "slowly"]
    assert [row.value for row in table.rows] == values


def test_a_point_that_ends_every_worker_ends_the_sweep_with_a_message(monkeypatch):
    def deadly(law):
        if law.terms[0][0] > 0.45:
            os.kill(os.getpid(), signal.SIGKILL)
        return slowly(law)

    assert workers.MOST_ENDED >= 2
    monkeypatch.setattr(workers, "MOST_ENDED", 1)
    with pytest.raises(AsperityError, match="ended every worker"):
        spec.sweep(ker.maxwell, GRID, deadly, client=1)


def test_a_lost_scheduler_ends_the_sweep_which_then_goes_on(undisturbed, tmp_path):
    program = (
        "import time\nfrom distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    cluster = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address='127.0.0.1:0')\n"
        "    print(cluster.scheduler_address, flush=True)\n    time.sleep(600)\n"
    )
    (tmp_path / "cluster.py").write_text(program)

    computed = tmp_path / "computed"

    def slowly(law):
        # by value: the scheduler has no module of these tests
        time.sleep(0.08)
        with computed.open("a") as file:
            file.write("point\n")
        return Estimate(law.terms[0][0] ** 0.5, 1e-16, "estimate", "slowly")

    with started("cluster.py", cwd=tmp_path) as cluster:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        # the scheduler is killed while the sweep waits for results
        killer = threading.Thread(target=killed_after, args=(cluster, computed, 5))
        killer.start()
        try:
            with pytest.raises(AsperityError, match="the scheduler is gone"):
                spec.sweep(ker.maxwell, GRID, [slowly, "gap"], client=address, checkpoint=tmp_path / "a")
        finally:
            cluster.kill()
            killer.join()
    assert 0 < len(parts_in(tmp_path / "a")) < len(FRACTIONS)
    table = spec.sweep(ker.maxwell, GRID, [slowly, "gap"], checkpoint=tmp_path / "a")
    assert without_seconds(table) == undisturbed


def killed_after(process, told, lines):
    """Kill a process once a file has so many lines: later than the first points are stored."""
    while process.poll() is None:
        if told.exists() and told.read_text().count("\n") >= lines:
            process.kill()
            return
        time.sleep(0.02)


SWEPT = ["sweep", "focusing-arcs", "--over", "half_angle=0.1:1.5:400"]


@pytest.mark.parametrize("command", [SWEPT, [*SWEPT, "--workers", "1"]], ids=lambda words: words[-1])
def test_the_command_gives_a_sign_of_life_and_ends_within_a_second_after_ctrl_c(tmp_path, command):
    (tmp_path / "long.py").write_text(
        "import signal, runpy, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "if __name__ == '__main__':\n"
        "    sys.argv[0] = 'asperity'\n"
        "    runpy.run_module('asperity', run_name='__main__')\n"
    )
    asked = ["long.py", *command, "--quantity", "resistance,gap", "--tolerance", "1e-3", "--out", "a"]
    with started(*asked, cwd=tmp_path) as process:
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
    assert err.startswith("asperity: computing; Ctrl-C stops it")
    assert "of 400 points, which are in a/sweep.checkpoint; the same call goes on from there" in err.splitlines()[-1]


def has_points(path):
    """Whether a file that another process holds has grown beyond its empty tables."""
    return path.exists() and path.stat().st_size > 16384


DOCS = Path(__file__).resolve().parents[3] / "docs"
BLOCKS = [
    pytest.param(block, id=f"{page.name}-{number}")
    for page in sorted(DOCS.glob("*.md"))
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    if re.search(r"client=\d", block)
]


def test_there_are_examples_that_start_workers():
    assert len(BLOCKS) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("block", BLOCKS)
def test_an_example_that_starts_workers_runs_as_a_script(block, tmp_path):
    if "random_wall" in block:
        pytest.importorskip("SurfaceTopography")
    shorter = {
        "1.5, 50": "1.5, 3",
        "1e-6": "1e-2",
        "1e-4": "1e-2",
        "client=2": "client=1",
        "Bins(32)": "Bins(4), 1e-2",
        "family, 100": "family, 4",
        ", 64,": ", 6,",
        # tests of their own have the extremum of a sweep, smooth random walls and proofs for walls, which take long
        ".extremum(": ".plot(",
        ", smooth=True": "",
        "ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()": "ker.henyey_greenstein(curvature)",
        "[1 / 3, 1 / 2, 2 / 3, 1]": "[1 / 2]",
    }
    for long, short in shorter.items():
        block = block.replace(long, short)
    (tmp_path / "whole.py").write_text(block)
    whole = ended("whole.py", cwd=tmp_path)
    assert whole.returncode == 0, whole.stderr
    assert list(tmp_path.glob("*.sweep"))


def test_a_script_that_starts_workers_says_what_it_lacks_without_the_guard(tmp_path):
    script = 'from asperity import kernels as ker, spectral as spec\nspec.sweep(ker.maxwell, {}, "gap", client=1)\n'
    (tmp_path / "without.py").write_text(script.replace("{}", '{"diffuse_fraction": [0.5]}'))
    done = ended("without.py", cwd=tmp_path)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("asperity.errors.InputError: client: each worker reads the script")
    assert 'if __name__ == "__main__":' in last
    # the trace of this one call
    assert done.stderr.count("Traceback") == 1 and len(done.stderr.splitlines()) < 40


def listening(_=None):
    """Sockets of this process to which others can connect."""
    held = {os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    found = []
    for table in map(Path, ("/proc/net/tcp", "/proc/net/tcp6")):
        lines = [line.split() for line in table.read_text().splitlines()[1:]] if table.exists() else []
        # without the number of the line, which changes with the sockets of other processes
        found += [line[1:] for line in lines if line[3] == "0A" and f"socket:[{line[9]}]" in held]
    named = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    # flags with 10000: it accepts connections
    return found + [line for line in named if line[3] == "00010000" and f"socket:[{line[6]}]" in held]


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no list of sockets here")
def test_workers_that_are_started_here_listen_nowhere():
    import socket

    before = listening()
    with workers.connected(1) as worker:
        assert dict(workers.results(listening, range(2), worker)) == {0: [], 1: []}
        assert listening() == before
    # the list does show a socket that listens
    with socket.create_server(("127.0.0.1", 0)):
        assert len(listening()) == len(before) + 1
