"""Rays in waves: vectors compute them; how many are left to the loop; when waves pay. Their bits are a property."""

from __future__ import annotations

import re

import numpy as np
import pytest
from llvmlite import binding
from numba import njit, types

from asperity import geometry as geo
from asperity.geometry.scene.compiled.compiling import Late
from asperity.geometry.tracing import tracing
from asperity.geometry.tracing.compiled import blocks, waves
from asperity.geometry.tracing.compiled.pieces import lines
from asperity.geometry.tracing.compiled.trigonometry import mirrored
from asperity.geometry.tracing.threads import new_flag

RAYS = 5_000


NUMBER, COUNT = types.float64, types.int64
WORK, LISTS = types.Array(NUMBER, 1, "C"), types.Array(COUNT, 1, "C")
PAIR, CURVE, LINE = types.UniTuple(NUMBER, 2), types.UniTuple(NUMBER, 15), types.NamedUniTuple(NUMBER, 9, lines.Line)
LOOPS = {
    waves.meet_corner: (WORK, COUNT, NUMBER, NUMBER, NUMBER),
    waves.meet_line: (WORK, COUNT, LINE, NUMBER, NUMBER, NUMBER),
    waves.meet_arc: (WORK, COUNT, CURVE, NUMBER, NUMBER),
    waves.meet_parabola: (WORK, COUNT, CURVE, NUMBER),
    waves.mark_near: (WORK, COUNT, CURVE, NUMBER),
    waves.find_own_root: (WORK, COUNT, CURVE),
    waves.find_fall: (WORK, COUNT, CURVE, COUNT),
    waves.start_roots: (WORK, COUNT, CURVE),
    waves.improve_roots: (WORK, COUNT, CURVE),
    waves.time_roots: (WORK, COUNT, CURVE, NUMBER),
    waves.place_on_arc: (WORK, COUNT, CURVE, NUMBER),
    waves.reflect_rays: (WORK, COUNT, PAIR, NUMBER, NUMBER),
    waves.begin_rays: (WORK, LISTS, COUNT, COUNT, WORK, WORK, PAIR),
    waves.end_rays: (WORK, LISTS, COUNT, WORK, WORK, WORK),
}


@pytest.mark.skipif(not binding.get_host_cpu_features().get("avx2"), reason="names of instructions of AVX2 and AVX-512")
@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: loop.__name__)
def test_loops_over_rays_use_vectors_and_write_without_masks(loop):
    compiled = njit(error_model="numpy")(loop.py_func)
    compiled.compile(LOOPS[loop])
    (code,) = compiled.inspect_asm().values()
    vectors = len(re.findall(r"v(?:add|sub|mul|div|sqrt)pd.*%[yz]mm", code))
    # the last rays, fewer than fit into a vector, take the same operations one by one, some in up to three copies
    assert 4 * vectors > len(re.findall(r"v(?:add|sub|mul|div|sqrt)sd", code)) > 0
    assert "vmaskmov" not in code


def rays(wall):
    rng = np.random.default_rng(2)
    return wall.period * rng.uniform(-2.0, 3.0, RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))


@pytest.mark.parametrize(
    "wall",
    ["mushrooms", "dispersing-arcs", "valley of arcs", "double-parabola", "nearly parabolas", "inflections", "mixed",
     "many cubics"],
    indirect=True,
)  # fmt: skip
def test_few_rays_are_left_to_the_loop(wall):
    x, theta = rays(wall)
    results = np.empty(RAYS), np.empty(RAYS), np.empty(RAYS, np.int64), np.empty(RAYS, np.uint8)
    room = blocks.room_for(wall.scene.hollows, RAYS)
    given = x, theta, wall.scene.tables.address, 2**62, results, room, blocks.CROSSINGS
    blocks.trace_hollows(*given)
    assert np.mean(results[-1] == blocks.UNDECIDED) < 0.01


@pytest.mark.parametrize("wall", ["valley of arcs", "random teeth", "double-parabola"], indirect=True)
def test_rays_that_enter_at_a_corner_are_flagged_in_waves(wall, monkeypatch):
    monkeypatch.setattr(tracing, "_goes_in_waves", lambda scene, rays: True)
    assert np.all(geo.trace(wall, np.zeros(999), np.linspace(0.01, 3.13, 999)).status == geo.Status.CORNER)


def test_a_wall_without_hollows_reflects_all_rays_of_a_wave(monkeypatch):
    # its tables are empty, without an address
    monkeypatch.setattr(tracing, "_goes_in_waves", lambda scene, rays: True)
    x, theta = rays(geo.flat())
    found = geo.trace(geo.flat(), x, theta)
    assert np.array_equal(found.x, x) and np.all(found.collisions == 1) and found.escaped.all()


def test_waves_end_at_a_raised_flag_as_the_loop_does():
    wall, stop = geo.mushrooms(0.3, 0.5), new_flag()
    stop[0] = 1
    x, theta = rays(wall)
    results = np.empty_like(x), np.empty_like(x), np.empty(x.shape, np.int64), np.full(x.shape, 77, np.uint8)
    tracing._block_tracer(wall.scene, 10, stop, True)(x, theta, *results)
    assert np.all(results[-1] == 77)


def test_closed_forms_ellipses_and_trees_have_no_waves():
    for wall in (geo.triangular_teeth(0.7), geo.elliptical_arcs(1.0, geo.Disk(1.0, 0.6)), geo.koch(4)):
        assert not tracing._goes_in_waves(wall.scene, 2**30)
    assert not tracing._goes_in_waves(geo.mushrooms(0.3, 0.5).scene, tracing.MANY_RAYS - 1)


def test_a_function_is_worth_its_compilation_once_it_is_wanted_often_or_stored():
    late = Late(mirrored, types.float32)
    assert not late.is_worth(4, 10)
    assert not late.is_worth(5, 10)
    assert late.is_worth(1, 10)
    used = Late(blocks.cross_simple, *blocks.SIMPLE._kinds)
    blocks.SIMPLE.load()
    assert used.is_worth(1, 10)
