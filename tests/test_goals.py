"""The table of goals and what it rests on: memory, robustness, and the shares of the time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from benchmarks import goals, memory, profiles, robustness

from asperity import geometry as geo
from asperity import kernels as ker


def test_the_memory_of_an_estimate_does_not_grow_with_its_rays():
    # several chunks of 65,536 rays each
    used = memory.measure_memory((2**20, 2**21))
    assert not used.grows and min(used.peaks) > used.matrix
    assert memory.MemoryUse((1, 2, 4), (100, 100, 103), 1).grows
    assert not memory.MemoryUse((1, 2, 4), (100, 101, 90), 1).grows


def test_a_lost_or_wrong_ray_misses_the_goal():
    right = robustness.Verdict(100, 0, 7, 3, 0, 1.0, (), ())
    assert goals._robust("corners", right).is_met
    assert not goals._robust("corners", robustness.Verdict(100, 1, 7, 3, 0, 1.0, (), ())).is_met
    assert not goals._robust("grazing", robustness.Verdict(100, 0, 7, 3, 1, 1.0, (), ())).is_met


def test_rays_of_all_walls_are_counted_together(monkeypatch):
    monkeypatch.setattr(robustness, "WALLS", {"teeth": geo.triangular_teeth(0.7), "notch": geo.triangular_teeth(1.5)})
    found = robustness.measure_robustness(20)
    assert set(found) == {"corners", "grazing"}
    for verdict in found.values():
        assert verdict.rays == 20 and verdict.lost == verdict.wrong == 0


def test_a_ray_that_was_moved_is_wrong_and_no_conditioning_explains_it():
    wall, rng = geo.triangular_teeth(0.7), np.random.default_rng(1)
    x, theta = rng.random(50), np.arccos(1.0 - 2.0 * rng.random(50))
    traced = geo.trace(wall, x, theta)
    assert robustness._explained(wall, traced, x, theta, robustness.twin_trace).all()
    assert not robustness._explained(wall, traced, x, theta + 1e-9, robustness.twin_trace).any()


def test_shares_of_the_time_go_to_the_modules_that_spend_it():
    def job():
        ker.discretise(ker.henyey_greenstein(0.5), ker.Legendre(64))
        return sum(math.sqrt(k) for k in range(1000))

    shares = profiles.time_by_module(job)
    assert sum(shares.values()) == pytest.approx(1.0)
    # what numpy does for a module is that module's, and what nobody of the package asked for is outside
    assert "outside" in shares and any(name.startswith("kernels.") for name in shares)
    assert all(
        name == "outside" or name.split(".")[0] in ("asperity", "geometry", "kernels", "spectral") for name in shares
    )
