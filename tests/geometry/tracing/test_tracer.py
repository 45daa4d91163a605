"""The tracer against closed forms, and the threads that it runs on."""

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
from commands import ended

EPS = np.finfo(float).eps
RAYS = 100_000


def rays(seed, n, period=1.0):
    rng = np.random.default_rng(seed)
    return period * rng.random(n), np.arccos(1.0 - 2.0 * rng.random(n))


@pytest.mark.parametrize("angle", [0.05, 0.3, 0.7, 1.4, 2.6, np.pi - 1e-4])
def test_triangular_teeth_follow_the_corrected_law(angle):
    """Facts 2, per ray: theta' = +-theta + const, whose conditioning is 1 plus one a bounce."""
    x, theta = rays(5, RAYS)
    traced = geo.trace(geo.triangular_teeth(angle), x, theta)
    c = np.cos(theta - angle / 2) - 2 * x * np.sin(theta) * np.sin(angle / 2)
    mirrored = c < 0
    t, h = np.where(mirrored, np.pi - theta, theta), np.arccos(np.abs(c))
    n = np.ceil((t + h) / angle - 0.5)
    outgoing = np.where(n % 2 == 0, np.pi + t - n * angle, n * angle - t)
    outgoing = np.where(mirrored, np.pi - outgoing, outgoing)
    # the number of hits is undecided where the argument of ceil is an integer to rounding, or c is 0
    distance = np.abs((t + h) / angle - 0.5 - np.round((t + h) / angle - 0.5)) * angle * np.sin(h)
    clear = (distance > 64 * EPS * (1 + n)) & (np.abs(c) > 64 * EPS)
    assert clear.mean() > 0.9999
    assert np.array_equal(traced.collisions[clear], n[clear])
    assert np.all(np.abs(traced.theta - outgoing)[clear] <= 64 * EPS * (1 + n[clear]))
    assert traced.escaped[clear].all()


@pytest.mark.parametrize("ratio", [0.1, 1.0, 7.3])
def test_rectangular_teeth_follow_the_corrected_law(ratio):
    """Over the crevice the number of crossings of a channel decides between specular and retroreflection."""
    x, theta = rays(6, RAYS)
    traced = geo.trace(geo.rectangular_teeth(ratio), x, theta)
    inside = x > 0.5
    # unfold the crevice of width 1/2 and depth ratio/2: the ray moves by `run` crevice widths and comes back up
    start = (x - 0.5) * 2.0
    run = -2.0 * ratio / np.tan(theta)
    place = start + run
    walls_hit = np.abs(np.floor(place))
    specular = ~inside | (walls_hit % 2 == 0)
    outgoing = np.where(specular, np.pi - theta, theta)
    hits = np.where(inside, 1 + walls_hit, 1)
    clear = np.abs(place - np.round(place)) > 64 * EPS * (1 + np.abs(place))
    assert clear.mean() > 0.9999
    assert np.array_equal(traced.collisions[clear], hits[clear])
    assert np.all(np.abs(traced.theta - outgoing)[clear] <= 64 * EPS * (1 + hits[clear]))


@pytest.mark.parametrize("half_angle", [1e-6, 0.1, 1.2, np.pi / 2])
def test_circular_arcs_follow_the_corrected_law(half_angle):
    """Facts 3, per ray; conditioning is that of theta' = theta + N step with d(step)/d(delta) = 2 and d(delta)/dX."""
    x, theta = rays(7, RAYS)
    x = np.clip(x, 1e-9, 1 - 1e-9)
    traced = geo.trace(geo.focusing_arcs(half_angle), x, theta)
    left, right = theta - half_angle, theta + half_angle
    # tan(delta/2) from the half-angle sums, so that neither delta -> 0 nor xi -> 0 cancels
    sin2 = (1 - x) * np.sin(right / 2) ** 2 + x * np.sin(left / 2) ** 2
    cos2 = (1 - x) * np.cos(right / 2) ** 2 + x * np.cos(left / 2) ** 2
    delta = 2 * np.arctan2(np.sqrt(sin2), np.sqrt(cos2))
    gamma = theta - delta
    if half_angle < 1e-3:
        # theta - delta cancels: solve cos(theta - gamma) = cos(theta) cos(xi) + (2 X - 1) sin(theta) sin(xi) for gamma
        gamma = (2 * x - 1) * half_angle
        for _ in range(4):
            f = 2 * np.cos(theta) * np.sin((half_angle + gamma) / 2) * np.sin((half_angle - gamma) / 2)
            f += np.sin(theta) * (np.sin(gamma) - (2 * x - 1) * np.sin(half_angle))
            gamma = gamma - f / np.sin(theta - gamma)
        delta = theta - gamma
    acute = delta < np.pi / 2
    hop = np.where(acute, 2 * delta, 2 * (np.pi - delta))
    room = np.where(acute, half_angle + gamma, half_angle - gamma)
    n = np.ceil(room / hop)
    outgoing = np.where(acute, theta - n * hop + np.pi, theta + n * hop - np.pi)
    condition = (1 + n) * (1 + 2 * n + 2 * np.sin(half_angle) * np.sin(theta) / np.sin(delta) * (1 + n))
    clear = (np.abs(room / hop - np.round(room / hop)) * hop > 64 * EPS * condition) & (
        np.abs(delta - np.pi / 2) > 64 * EPS * condition
    )
    assert clear.mean() > 0.9999
    assert np.array_equal(traced.collisions[clear], n[clear])
    assert np.all(np.abs(traced.theta - outgoing)[clear] <= 64 * EPS * condition[clear])


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
    environment = {name: value for name, value in os.environ.items() if not name.startswith(settings)}
    done = ended("-c", FAULTS, env=environment, check=True)
    # the results have 1,600 pages
    assert int(done.stdout) < 400


def test_a_wall_that_was_traced_can_be_copied_and_sent_to_another_process():
    wall = geo.mushrooms(0.3)
    ray = geo.trace(wall, 0.3, 1.0)
    twins = [copy.deepcopy(wall), pickle.loads(pickle.dumps(wall))]
    assert len({one.scene.tables.address for one in (wall, *twins)}) == 3
    del wall
    assert all(geo.trace(twin, 0.3, 1.0).x == ray.x for twin in twins)
