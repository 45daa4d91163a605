"""The threads that the tracer runs on, its memory, and how it takes and gives arrays."""

from __future__ import annotations

import copy
import os
import pickle
import platform
import threading
import time
import weakref

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.geometry.tracing.threads import in_blocks, interruptibly
from commands import ended, environment


def rays(seed, n, period=1.0):
    rng = np.random.default_rng(seed)
    return period * rng.random(n), np.arccos(1.0 - 2.0 * rng.random(n))


def test_the_first_hit_is_told_from_a_corner_however_near_it_is():
    """At theta = 1e-12 a ray that enters 1e-6 from a vertical side hits it 1e-18 below the corner, and comes back."""
    wall = geo.rectangular_teeth(1.0)
    for x, theta in ((0.5 + 1e-6, 1e-12), (1.0 - 1e-6, np.pi - 1e-12)):
        traced = geo.trace(wall, x, theta, max_collisions=50)
        assert traced.counts()["corner"] == 0 and traced.collisions == 50
    notch = geo.trace(geo.triangular_teeth(0.1), 1e-20, np.pi / 2)
    assert notch.counts()["corner"] == 0


def test_shapes_broadcast_and_results_are_read_only():
    traced = geo.trace(geo.koch(2), np.linspace(0.1, 0.9, 5)[:, None], [0.5, 1.0, 1.5])
    assert traced.x.shape == traced.status.shape == (5, 3)
    with pytest.raises(ValueError, match="read-only"):
        traced.x[0, 0] = 1.0


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be pinned here")
def test_a_process_that_is_pinned_to_one_core_traces_on_one_thread():
    before = os.sched_getaffinity(0)
    own = threading.current_thread().name
    seen = set()
    try:
        os.sched_setaffinity(0, {min(before)})
        in_blocks(lambda part: seen.add(threading.current_thread().name), 100, None, block=10)
    finally:
        os.sched_setaffinity(0, before)
    assert seen == {own}


def test_threads_wait_for_the_next_call():
    x, theta = rays(13, 2**15)
    wall = geo.focusing_arcs(0.8)
    geo.trace(wall, x, theta, threads=2)
    before = threading.active_count()
    for _ in range(20):
        geo.trace(wall, x, theta, threads=2)
    assert threading.active_count() == before


def test_a_waiting_thread_holds_nothing_of_the_last_call():
    class Large:
        def read(self):
            return 7

    held = Large()
    there = weakref.ref(held)
    assert interruptibly(held.read) == 7
    del held
    limit = time.monotonic() + 10.0
    while there() is not None and time.monotonic() < limit:
        time.sleep(0.001)
    assert there() is None


def test_a_failure_on_a_waiting_thread_reaches_the_caller_and_leaves_the_thread():
    def fail():
        raise ArithmeticError("seven")

    assert interruptibly(lambda: 1) == 1
    before = threading.active_count()
    for _ in range(5):
        with pytest.raises(ArithmeticError, match="seven"):
            interruptibly(fail)
        assert interruptibly(lambda: 2) == 2
    assert threading.active_count() == before


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be pinned here")
def test_a_call_runs_on_the_processors_of_its_caller():
    before = os.sched_getaffinity(0)
    interruptibly(lambda: None)
    try:
        os.sched_setaffinity(0, {min(before)})
        pinned = interruptibly(lambda: os.sched_getaffinity(0))
    finally:
        os.sched_setaffinity(0, before)
    assert pinned == {min(before)}
    assert interruptibly(lambda: os.sched_getaffinity(0)) == before


FORKED = """
import os
import numpy as np
from asperity import geometry as geo
wall, x = geo.focusing_arcs(0.8), np.linspace(0.1, 0.9, 2**15)
before = geo.trace(wall, x, 1.0, threads=2)
child = os.fork()
after = geo.trace(wall, x, 1.0, threads=2)
assert np.array_equal(after.theta, before.theta)
if child == 0:
    os._exit(0)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
def test_a_forked_process_starts_threads_of_its_own():
    # Python 3.12 warns of every fork of a process with threads
    ended("-W", "ignore", "-c", FORKED, check=True)


FAULTS = """
import resource
import numpy as np
from asperity import geometry as geo
x, theta = np.random.default_rng(0).random((2, 2**18)) + 0.1
wall = geo.triangular_teeth(0.7)
faults = []
for _ in range(16):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    ray = geo.trace(wall, x, theta, threads=1)
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(sorted(faults[4:])[2 * len(faults[4:]) // 3])
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other allocators have other rules")
def test_a_trace_takes_the_memory_of_the_results_before():
    # in a process of its own, because the allocator remembers the largest block that was ever freed, and without its
    # settings in the environment, which would hold instead; dask leaves one there when it starts a worker
    settings = ("MALLOC_", "GLIBC_TUNABLES", "LD_PRELOAD")
    plain = {name: value for name, value in environment().items() if not name.startswith(settings)}
    done = ended("-c", FAULTS, env=plain, check=True)
    # the results have 1,600 pages
    assert int(done.stdout) < 400


def test_a_wall_that_was_traced_can_be_copied_and_sent_to_another_process():
    wall = geo.mushrooms(0.3)
    ray = geo.trace(wall, 0.3, 1.0)
    twins = [copy.deepcopy(wall), pickle.loads(pickle.dumps(wall))]
    assert len({one.scene.tables.address for one in (wall, *twins)}) == 3
    del wall
    assert all(geo.trace(twin, 0.3, 1.0).x == ray.x for twin in twins)
