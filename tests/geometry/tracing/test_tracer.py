"""The compiled tracer against laws, closed forms and its plain twin."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_plainly

from asperity import geometry as geo
from asperity.geometry.tracing.threads import in_blocks, interruptibly

EPS = np.finfo(float).eps
RAYS = 10**6


def island_wall():
    """An open wall: no corner of the floor reaches y = 0, and a disk floats above it."""
    floor = [geo.Segment((0.0, -0.8), (0.5, -1.0)), geo.Segment((0.5, -1.0), (1.0, -0.8))]
    return geo.Wall(floor, period=1.0, islands=[[geo.Arc((0.4, -0.4), 0.2, 0.0, -2.0 * np.pi)]])


def bezier_wall():
    """A focusing cubic and a straight flank, a flat top between the hollows."""
    return geo.Wall(
        [
            geo.Bezier([(0.0, 0.0), (0.1, -0.5), (0.5, -0.6), (0.6, 0.0)]),
            geo.Segment((0.6, 0.0), (0.7, 0.0)),
            geo.Segment((0.7, 0.0), (0.8, -0.4)),
            geo.Bezier([(0.8, -0.4), (0.85, -0.1), (1.0, 0.0)]),
        ],
        period=1.0,
    )


WALLS = {name: entry.build() for name, entry in geo.WALLS.items()} | {
    "semicircle": geo.focusing_arcs(np.pi / 2),
    "cusp": geo.dispersing_arcs(2.0),
    "plated mushroom": geo.mushrooms(0.3),
    "mushrooms on mushrooms": geo.mushrooms(0.3, 0.5, 2),
    "bezier": bezier_wall(),
    "island": island_wall(),
}
MUSHROOMS = [name for name in WALLS if "mushroom" in name]
CLOSED = [name for name in WALLS if name != "island"]


def rays(seed, n, period=1.0):
    rng = np.random.default_rng(seed)
    return period * rng.random(n), np.arccos(1.0 - 2.0 * rng.random(n))


@pytest.mark.parametrize("name", WALLS)
def test_compiled_loop_agrees_with_its_plain_twin(name):
    wall = WALLS[name]
    x, theta = rays(1, 250)
    if not wall.closes:
        theta = np.clip(theta, 0.3, np.pi - 0.3)
    traced = geo.trace(wall, x, theta)
    assert traced.escaped.all()
    for i in range(len(x)):
        there, angle, hits = trace_plainly(wall, x[i], theta[i])
        assert hits == traced.collisions[i]
        # the twin drifts off its curves, and a disk multiplies its drift by up to ten a bounce
        allowed = 1e-12 * 10.0**hits if name == "island" else 1e-9 * (1 + hits)
        assert abs(angle - traced.theta[i]) < allowed and abs(there - traced.x[i]) < allowed


@pytest.mark.parametrize("name", WALLS)
def test_tracing_back_returns_the_ray(name):
    wall = WALLS[name]
    x, theta = rays(2, 20_000)
    there = geo.trace(wall, x, theta)
    back = geo.trace(wall, there.x, there.theta)
    assert there.escaped.all() and back.escaped.all()
    # conditioning: how far the outgoing state moves when the incoming one moves by h, per ray, by a finite difference
    h = 1e-7
    moved = geo.trace(wall, there.x, np.clip(there.theta + h, 1e-9, np.pi - 1e-9))
    shifted = geo.trace(wall, there.x + h, there.theta)
    same = (moved.collisions == back.collisions) & (shifted.collisions == back.collisions)
    assert same.mean() > 0.99
    stretch = sum(np.abs(m.theta - back.theta) + np.abs(m.x - back.x) for m in (moved, shifted)) / h
    allowed = 64 * EPS * (1 + back.collisions) * (1.0 + stretch)
    miss = np.abs(back.theta - theta) + np.abs(back.x - x)
    assert np.array_equal(back.collisions, there.collisions)
    assert np.all(miss[same] <= allowed[same])


@pytest.mark.parametrize("name", CLOSED)
def test_flux_is_preserved(name):
    """The outgoing u = -cos theta' of rays that enter with the invariant measure is uniform: chi-square in 64 bins."""
    wall = WALLS[name]
    x, theta = rays(3, 400_000)
    traced = geo.trace(wall, x, theta)
    bins = 64
    number = np.bincount(np.minimum((0.5 * bins * (1 - np.cos(traced.theta))).astype(int), bins - 1), minlength=bins)
    expected = len(x) / bins
    chi = np.sum((number - expected) ** 2) / expected
    assert abs(chi - (bins - 1)) / np.sqrt(2 * (bins - 1)) < 4.5


@pytest.mark.parametrize("name", [n for n in CLOSED if n not in ("flat", *MUSHROOMS)])
def test_mean_number_of_bounces_is_wall_over_opening(name):
    """Kac: over the flux, mean bounces in the hollows = length of their boundary / width of their openings.

    Mushrooms are left out: rays that circle in the cap outside the stem's caustic are never reached from the opening.
    """
    wall = WALLS[name]
    n = 200_000
    rng = np.random.default_rng(4)
    widths = np.array([hollow.right - hollow.left for hollow in wall.hollows])
    lefts = np.array([hollow.left for hollow in wall.hollows])
    which = rng.choice(len(widths), n, p=widths / widths.sum())
    x = lefts[which] + widths[which] * rng.random(n)
    traced = geo.trace(wall, x, np.arccos(1.0 - 2.0 * rng.random(n)))
    expected = (wall.arc_length - wall.flat_top) / widths.sum()
    error = np.std(traced.collisions) / np.sqrt(n)
    assert abs(np.mean(traced.collisions) - expected) < 4.5 * error + 1e-12


@pytest.mark.parametrize("angle", [0.3, 0.7, 1.4, 2.6])
def test_triangular_teeth_follow_the_corrected_law(angle):
    """Facts 2, per ray, a million rays: theta' = +-theta + const, whose conditioning is 1 plus one a bounce."""
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
    assert clear.mean() > 0.999999
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
    assert clear.mean() > 0.99999
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


def test_a_ray_stays_within_one_period_of_where_it_entered():
    """Lemma 2.1: x' - x is of the order of the period where hollows close; here of the same hollow."""
    for name in CLOSED:
        x, theta = rays(8, 10_000, 3.0)
        traced = geo.trace(WALLS[name], x, theta)
        assert np.all(np.abs(traced.x - x) <= 1.0 + 1e-12)
        assert np.array_equal(np.floor(traced.x[traced.escaped]), np.floor(x[traced.escaped]))


def test_scaling_the_wall_scales_the_rays():
    wall = geo.mushrooms(0.3, 0.2)
    x, theta = rays(9, 5_000)
    plain = geo.trace(wall, x, theta)
    # a power of two is exact
    for factor in (2.0**-20, 2.0**20):
        scaled = geo.trace(wall.scaled(factor), x * factor, theta)
        assert np.array_equal(scaled.collisions, plain.collisions)
        assert np.array_equal(scaled.theta, plain.theta)


def test_mirroring_the_wall_mirrors_the_rays():
    wall = bezier_wall()
    x, theta = rays(10, 5_000)
    plain, mirrored = geo.trace(wall, x, theta), geo.trace(wall.mirrored(), 1 - x, np.pi - theta)
    assert np.array_equal(plain.collisions, mirrored.collisions)
    assert np.allclose(plain.theta, np.pi - mirrored.theta, atol=1e-12, rtol=0)


def test_a_run_along_an_arc_counts_every_hop():
    """A ray that enters near the tip of a semicircle, nearly along it, hops some hundred thousand times."""
    x, theta = 1e-11, np.pi / 2 + 1e-5
    traced = geo.trace(geo.focusing_arcs(np.pi / 2), x, theta)
    assert bool(traced.escaped)
    step_by_step = geo.trajectory(geo.focusing_arcs(np.pi / 2), x, theta, max_collisions=10**6)
    assert len(step_by_step) - 2 == int(traced.collisions) > 10_000


@pytest.mark.parametrize("theta", [1e-12, 1e-9, 1e-6, np.pi - 1e-6, np.pi - 1e-12])
@pytest.mark.parametrize("name", WALLS)
def test_grazing_rays_are_accounted_for(name, theta):
    wall = WALLS[name]
    # such a ray passes a million cells of an open wall, for 20 ms
    number = 997 if wall.closes else 47
    traced = geo.trace(wall, np.linspace(0.001, 0.999, number), theta, max_collisions=10_000)
    counts = traced.counts()
    assert sum(counts.values()) == number
    assert np.isfinite(traced.x).all() and np.isfinite(traced.theta).all()
    if wall.closes:
        # a long channel takes cot(theta) bounces, which the limit cuts; next to a corner rays are nearer than rounding
        assert counts["escaped"] + counts["bounce_limit"] >= 0.98 * 997
        assert counts["bounce_limit"] == 0 or name in ("rectangular-teeth", *MUSHROOMS)


def test_the_first_hit_is_told_from_a_corner_however_near_it_is():
    """At theta = 1e-12 a ray that enters 1e-6 from a vertical side hits it 1e-18 below the corner, and comes back."""
    wall = geo.rectangular_teeth(1.0)
    for x, theta in ((0.5 + 1e-6, 1e-12), (1.0 - 1e-6, np.pi - 1e-12)):
        traced = geo.trace(wall, x, theta, max_collisions=50)
        assert traced.counts()["corner"] == 0 and traced.collisions == 50
    notch = geo.trace(geo.triangular_teeth(0.1), 1e-20, np.pi / 2)
    assert notch.counts()["corner"] == 0


def test_a_ray_aimed_at_a_corner_is_reported():
    notch = geo.triangular_teeth(np.pi / 2)
    # straight down into the bottom, straight down onto a tip, and aimed at the bottom at 45 degrees
    traced = geo.trace(notch, [0.5, 1.0, 0.0], [np.pi / 2, np.pi / 2, 3 * np.pi / 4])
    assert traced.counts()["corner"] >= 2
    assert traced.status[0] == geo.Status.CORNER and traced.status[1] == geo.Status.CORNER
    assert traced.theta[0] == pytest.approx(-np.pi / 2)


def test_the_bounce_limit_is_reported():
    traced = geo.trace(geo.rectangular_teeth(100.0), 0.7, 0.01, max_collisions=50)
    assert traced.counts()["bounce_limit"] == 1
    assert traced.collisions == 50


def test_results_do_not_depend_on_threads():
    x, theta = rays(11, 50_000)
    one, two = (geo.trace(WALLS["mushrooms on mushrooms"], x, theta, threads=n) for n in (1, 2))
    assert np.array_equal(one.theta, two.theta) and np.array_equal(one.x, two.x)


@pytest.mark.parametrize("name", WALLS)
def test_trajectory_ends_where_the_trace_does(name):
    wall = WALLS[name]
    for x, theta in ((0.37, 1.9), (0.81, 0.4), (2.6, 2.8), (-0.31, 0.25)):
        path, traced = geo.trajectory(wall, x, theta), geo.trace(wall, x, theta)
        assert np.allclose(path[0], [x, 0.0], atol=1e-15)
        assert np.allclose(path[-1], [traced.x, 0.0], atol=1e-9)
        assert len(path) == int(traced.collisions) + 2


def test_shapes_broadcast_and_results_are_read_only():
    traced = geo.trace(geo.koch(2), np.linspace(0.1, 0.9, 5)[:, None], [0.5, 1.0, 1.5])
    assert traced.x.shape == traced.status.shape == (5, 3)
    with pytest.raises(ValueError, match="read-only"):
        traced.x[0, 0] = 1.0


def test_foreshortened_ellipses_are_circles():
    disk = geo.Disk(2.0, 0.7)
    found = geo.elliptical_arcs(0.8, disk).foreshorten(disk)
    assert all(piece.is_circular for piece in found.pieces)
    x, theta = rays(12, 20_000)
    circle = geo.trace(geo.focusing_arcs(0.8), x, theta)
    traced = geo.trace(found, x, theta)
    same = traced.collisions == circle.collisions
    assert same.mean() > 0.9999
    assert np.max(np.abs(traced.theta - circle.theta)[same]) < 1e-10


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
    subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED], check=True, timeout=60)


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
    command = [sys.executable, "-c", FAULTS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    # the results have 1,600 pages
    assert int(done.stdout) < 400
