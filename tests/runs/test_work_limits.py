"""Limits on work: samples bound the time, a time limit leads to a larger error, and matrices fit into memory."""

import time

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.long_runs import OutOfTime, count_time, time_limited
from asperity.kernels.walls.conditionals import WallConditionals
from commands import ended

# Peak of a computation over the memory before it, in matrices of 2500 bins (50 MB); 1,000 MB are for the rays.
PEAK = """
import resource
from asperity import geometry as geo, kernels as ker
def peak():
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
law = {law}
ker.discretise(law, ker.Bins(16){more})
before = peak()
ker.discretise(law, ker.Bins(2500){more})
print((peak() - before) / 5e7)
"""


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
    law = ker.WallLaw(geo.mushrooms(0.3, 0.2))
    exact, quick = ker.resistance(law, 1e-6), ker.resistance(law, 1e-6, time_limit=0.1)
    assert exact.error < 0.1 * quick.error
    assert abs(quick.value - exact.value) <= quick.error + exact.error


def test_time_is_counted_only_within_a_limit() -> None:
    count_time(1e9)
    with time_limited(2.0):
        count_time(1.5)
        with pytest.raises(OutOfTime, match=r"1 seconds, 0\.5 allowed"):
            count_time(1.0)
    count_time(1e9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "more"),
    [
        ("ker.TriangularTeethLaw(0.7)", ""),
        ("ker.WallLaw(geo.dispersing_arcs(1.0))", ", method='qmc'"),
    ],
)
def test_a_matrix_is_computed_in_the_memory_of_eight(law: str, more: str) -> None:
    done = ended("-c", PEAK.format(law=law, more=more), check=True)
    assert float(done.stdout) < 8.0 + 20.0, "eight matrices, and 1,000 MB for rays and nodes"
