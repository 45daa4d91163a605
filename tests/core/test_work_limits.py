"""Limits on work: samples bound the time, a time limit leads to a larger error, and matrices fit into memory."""

import sys
import time
import tracemalloc

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import checks
from asperity.core.long_runs import OutOfTime, count_time, time_limited
from asperity.errors import InputError
from asperity.kernels.discretisation.discretisation import MATRICES
from asperity.kernels.walls.conditionals import WallConditionals
from commands import ended


def comb(rng: np.random.Generator) -> geo.Wall:
    """A box with four plates of zero thickness at random places, 15 segments."""
    depth, places = rng.uniform(0.5, 3.0), np.sort(rng.random(4))
    vertices = [(0.0, 0.0), (0.0, -depth)]
    for x in places.tolist():
        vertices += [(x, -depth), (x, -depth * rng.uniform(0.1, 0.9)), (x, -depth)]
    return geo.Wall.from_vertices([*vertices, (1.0, -depth), (1.0, 0.0)])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_samples_bound_the_work_on_a_comb(seed: int) -> None:
    wall = comb(np.random.default_rng(seed))
    law = ker.WallLaw(wall)
    ker.discretise(law, ker.Bins(4), "qmc", samples=64)
    start = time.process_time()
    ker.discretise(law, ker.Bins(12), "qmc", samples=2**17)
    many_rays = time.process_time() - start
    start = time.process_time()
    found = ker.discretise(law, ker.Bins(12), samples=2**14)
    # beams that resolve take up to a second, compiling aside; rays at grazing angles took minutes
    assert time.process_time() - start < 4.0 * many_rays + 8.0
    assert float(found.error) < 0.2


def test_an_angle_stops_near_its_limit_of_segments() -> None:
    limit = 20_000
    for seed in range(4):
        conditionals = WallConditionals(comb(np.random.default_rng(seed)), 0, np.empty(0), most_segments=limit)
        conditionals(np.array([0.005]), 1e-6)
        collisions = geo.trace(conditionals.wall, 0.5, 0.005).collisions
        assert conditionals.spent()[1] < limit + 64 * (int(collisions) + 100), "a block of rays beyond the limit"


@pytest.mark.slow
def test_a_gap_within_a_time_limit_agrees_with_one_without() -> None:
    law = ker.WallLaw(geo.dispersing_arcs(0.8))
    exact = spec.spectral_gap(law, tolerance=1e-7)
    quick = spec.spectral_gap(law, tolerance=1e-7, time_limit=0.01)
    assert exact.error <= 1e-7 < quick.error
    assert abs(quick.value - exact.value) <= quick.error + exact.error
    again = spec.spectral_gap(law, tolerance=1e-7, time_limit=0.01)
    assert (quick.value, quick.error) == (again.value, again.error), "time is counted, not measured"


def test_a_resistance_within_a_time_limit_agrees_with_one_without() -> None:
    # a tolerance of 1e-5 takes a minute
    exact, error = 1.0703932, 2.7e-6
    quick = ker.resistance(ker.WallLaw(geo.mushrooms(0.3, 0.2)), 1e-6, time_limit=0.1)
    assert error < 0.1 * quick.error
    assert abs(quick.value - exact) <= quick.error + error


def test_time_is_counted_only_within_a_limit() -> None:
    count_time(1e9)
    with time_limited(2.0):
        count_time(1.5)
        with pytest.raises(OutOfTime, match=r"1 seconds, 0\.5 allowed"):
            count_time(1.0)
    count_time(1e9)


WALL = ker.WallLaw(geo.dispersing_arcs(1.0))
HALF = 0.5 * ker.lambertian() + 0.5 * ker.WallLaw(geo.mushrooms(0.3, 0.2))


def peak_of(law: ker.Law, bins: int, method: str) -> int:
    """Bytes at most at a time."""
    tracemalloc.start()
    try:
        ker.discretise(law, ker.Bins(bins), method, samples=2**16)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("law", "method"),
    [
        *((WALL, method) for method in ("auto", "qmc", "monte-carlo")),
        *((law, "auto") for law in (HALF, ker.TriangularTeethLaw(0.7), ker.LeastResistanceLaw())),
    ],
    ids=["wall", "qmc", "monte-carlo", "sum", "isometries", "least resistance"],
)
def test_a_matrix_is_computed_in_the_memory_of_six(law: ker.Law, method: str) -> None:
    few, many = (2100, 2500) if law is HALF else (1100, 1700)
    # what rays, nodes and blocks of rows take does not grow with the matrix; sums of small ones keep replicates
    more = peak_of(law, many, method) - peak_of(law, few, method)
    assert more < MATRICES * 8 * (many**2 - few**2)


def test_without_the_module_of_limits_as_on_windows_no_call_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    monkeypatch.delattr(checks.os, "sysconf")
    checks.check_memory("n", "a matrix", 10**15)


def test_what_exceeds_the_memory_is_refused_with_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    assert 2**27 < checks.memory_left() < 2**60
    for limit, size in ((10**9, 5000), (3 * 10**9, 20_000)):
        monkeypatch.setattr(checks, "memory_left", lambda limit=limit: limit)
        words = (
            rf"Bins\({size}\) takes {6 * 8e-9 * size**2:.2g} GB of memory, more than there is \({limit / 1e9:.2g} GB\)"
        )
        with pytest.raises(InputError, match=words):
            ker.discretise(WALL, ker.Bins(size))
    # rules of fifteen nodes on each bin, twice; the wall is mirror-symmetric
    with pytest.raises(InputError, match=r"quadrature of rays in Bins\(5000\) takes 3\.2 GB"):
        ker.discretise(WALL, ker.Bins(5000), "quadrature")


def test_a_limit_of_the_process_counts_as_its_memory() -> None:
    code = """
import resource
from asperity import kernels as ker
from asperity.errors import InputError
resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, resource.RLIM_INFINITY))
try:
    ker.discretise(ker.lambertian(), ker.Bins(10_000))
except InputError as reason:
    print(reason)
"""
    assert "takes 4.8 GB of memory, more than there is (" in ended("-c", code, check=True).stdout
