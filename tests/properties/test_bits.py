"""Results have the same bits whatever computes them: waves, boxes, threads, neighbours, workers, stops and restarts."""

import os
import sqlite3
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from asperity import FileExistsRefusal, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import checkpoints
from asperity.geometry.curves.columns import START_X, START_Y, STRETCH, TREE_LEVELS, X1, X2, X3, Y1, Y2, Y3
from asperity.geometry.tracing import tracing
from asperity.geometry.tracing.compiled.waves import MOST_HITS
from asperity.kernels.billiards import billiard
from asperity.kernels.sampling import chunks, streams
from asperity.kernels.sampling.chunks import RaySums
from asperity.spectral.consequences import channel
from commands import environment, parts_in, started

ENOUGH = 2_000
RAYS = 1_000


# ---- rays --------------------------------------------------------------------------------------------------------
def rays_of(wall, count=RAYS, seed=1):
    """Spread rays, some from the ends of a period; rays through joints and up to 10^k ulps beside; flat and tangent."""
    rng, period = np.random.default_rng(seed), wall.period
    x, start = period * rng.uniform(-2.0, 3.0, count), period * rng.random(count)
    x[::8] = period * np.rint(x[::8] / period)
    spread = np.arccos(1.0 - 2.0 * rng.random(count))
    joints = np.concatenate([wall.vertices, *wall.island_vertices])
    joint = joints[rng.integers(len(joints), size=count)]
    ulps = np.rint(10.0 ** rng.uniform(-1.0, 9.0, count)) * rng.choice([-1, 1], count)
    aimed = np.arctan2(-joint[:, 1], start - joint[:, 0]) + ulps * np.finfo(float).eps
    flat = 10.0 ** rng.uniform(-9.0, -1.0, count)
    rays = [(x, spread), (start, aimed), (x, np.where(rng.random(count) < 0.5, flat, np.pi - flat))]
    if len(wall.scene.beziers):
        rays.append(tangent_rays(wall.scene.beziers, count, rng))
    x, theta = np.concatenate(rays, axis=1)
    return x, np.clip(theta, 1e-12, np.pi - 1e-12)


def tangent_rays(curves, count, rng):
    """Rays along tangents of Bezier pieces, up to 10^k ulps beside them, also at the ends of the pieces."""
    row, s = curves[rng.integers(len(curves), size=count)], rng.random(count)
    s[::4] = np.rint(s[::4])
    x, y = (row[:, a] + s * (row[:, b] + s * (row[:, c] + s * row[:, d]))
            for a, b, c, d in ((START_X, X1, X2, X3), (START_Y, Y1, Y2, Y3)))  # fmt: skip
    along, up = (row[:, b] + s * (2.0 * row[:, c] + 3.0 * s * row[:, d]) for b, c, d in ((X1, X2, X3), (Y1, Y2, Y3)))
    theta = np.arctan2(up, along) % np.pi + 10.0 ** rng.uniform(-16.0, -2.0, count) * rng.choice([-1, 1], count)
    theta = np.clip(theta, 1e-6, np.pi - 1e-6)
    return x - y / np.tan(theta), theta


def bits_of(array):
    """The bytes of the entries, shape (n, bytes)."""
    width = array.dtype.itemsize * int(np.prod(array.shape[1:]))
    return np.ascontiguousarray(array).view(np.uint8).reshape(len(array), width)


def same_bits(found, expected, chosen=slice(None)):
    """Whether two traces or collisions agree to the bit, the first with chosen ones of the second.

    Else it fails with the first ray or disk that differs: its number, and both results.
    """
    arrays = {name: part for name, part in vars(expected).items() if isinstance(part, np.ndarray)}
    pairs = {name: (vars(found)[name], part[chosen]) for name, part in arrays.items()}
    assert all(left.shape == right.shape and left.dtype == right.dtype for left, right in pairs.values())
    differs = np.any([(bits_of(left) != bits_of(right)).any(axis=1) for left, right in pairs.values()], axis=0)
    if differs.any():
        k = int(np.argmax(differs))
        shown = (
            f"{name} {left[k].tolist()!r}, expected {right[k].tolist()!r}" for name, (left, right) in pairs.items()
        )
        pytest.fail(f"{int(differs.sum())} of {len(differs)} differ, the first is number {k}: {'; '.join(shown)}")
    return True


def traced(monkeypatch, in_waves, *arguments, **options):
    monkeypatch.setattr(tracing, "_goes_in_waves", lambda scene, rays: in_waves)
    return geo.trace(*arguments, **options)


@pytest.mark.parametrize("limit", [3, ENOUGH])
def test_rays_in_waves_have_the_bits_of_the_loop(closed_wall, limit, monkeypatch):
    if np.any(closed_wall.scene.arcs[:, STRETCH] != 1.0) or len(closed_wall.scene.boxes):
        pytest.skip("ellipses and hollows with trees are not traced in waves")
    x, theta = rays_of(closed_wall)
    waves, loop = (traced(monkeypatch, way, closed_wall, x, theta, max_collisions=limit) for way in (True, False))
    assert same_bits(waves, loop)


@pytest.mark.parametrize("wall", ["cave"], indirect=True)
def test_rays_that_come_in_for_others_and_rays_that_stay_long_have_the_bits_of_the_loop(wall, monkeypatch):
    rng, many = np.random.default_rng(5), tracing.MANY_RAYS + 999
    x, theta = rng.uniform(0.485, 0.515, many), rng.uniform(0.1, 3.0, many)
    waves, loop = (traced(monkeypatch, way, wall, x, theta) for way in (True, False))
    assert np.sum(loop.collisions > MOST_HITS) > 100
    assert same_bits(waves, loop)


def test_a_ray_has_the_same_bits_in_any_company_and_on_any_number_of_threads(closed_wall):
    x, theta = rays_of(closed_wall, 600, 2)
    whole = geo.trace(closed_wall, x, theta, max_collisions=ENOUGH, threads=2)
    assert same_bits(geo.trace(closed_wall, x, theta, max_collisions=ENOUGH, threads=1), whole)
    for chosen in (slice(5, None, 7), slice(9, 16), slice(1203, 1204)):
        assert same_bits(geo.trace(closed_wall, x[chosen], theta[chosen], max_collisions=ENOUGH), whole, chosen)


@pytest.mark.parametrize("wall", ["koch", "koch 6", "profile", "random teeth", "comb", "curved floor"], indirect=True)
def test_a_tree_of_boxes_changes_no_bit(wall):
    assert wall.plan().hollows_with_grid >= 1
    # without boxes a ray asks every piece
    limit = {"max_collisions": ENOUGH}
    x, theta = rays_of(wall, 500 if len(wall.pieces) < 1_000 else 60)
    plain = geo.Wall(wall.pieces, wall.period)
    hollows = plain.scene.hollows.copy()
    hollows[:, TREE_LEVELS] = 0.0
    plain.__dict__["scene"] = plain.scene._replace(hollows=hollows, boxes=plain.scene.boxes[:0])
    assert same_bits(geo.trace(wall, x, theta, **limit), geo.trace(plain, x, theta, **limit))


@pytest.mark.parametrize("wall", ["triangular-teeth", "focusing-arcs", "dispersing-arcs"], indirect=True)
def test_a_disk_has_the_same_bits_in_any_company_and_on_any_number_of_threads(wall):
    disk, scale, rng = geo.Disk(1.0, 0.6), 0.03, np.random.default_rng(9)
    position = np.stack([rng.random(2_000) * scale, 0.1 * (rng.random(2_000) - 0.5)], axis=1)
    velocity = -disk.from_angles(*np.arccos(1.0 - 2.0 * rng.random((2, 2_000))))
    whole = geo.collide(disk, wall, scale, position, velocity, threads=2)
    assert same_bits(geo.collide(disk, wall, scale, position, velocity, threads=1), whole)
    for chosen in (np.arange(2_000)[::-1], np.arange(0, 2_000, 7), np.array([5]), np.arange(0)):
        assert same_bits(geo.collide(disk, wall, scale, position[chosen], velocity[chosen]), whole, chosen)


# ---- long runs ---------------------------------------------------------------------------------------------------
WALL = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))
BINS, PANELS = ker.Bins(40), ker.Panels([0.0, 1.0, np.pi], 2)


def exits(**changed):
    asked = {"law": ker.maxwell(0.5), "lengths": [2.0, 4.0, 8.0], "particles": 200, "rng": 7}
    return spec.exit_times(**asked | changed)


DISK = geo.Disk(1.0, 0.5)


def played(**changed):
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(0.9), DISK)
    velocity = DISK.from_angles(np.linspace(0.5, 2.5, 200), np.full(200, 1.0))
    asked = {"container": geo.Container.strip(), "laws": law, "position": np.zeros((200, 2)), "velocity": velocity}
    return ker.play(**asked | {"collisions": 5, "rng": 7} | changed)


def studied(**changed):
    asked = {"wall": geo.triangular_teeth(1.2), "scales": [1e-3, 1e-4, 1e-5], "rng": 7, "samples": (2, 3, 40)}
    return ker.limit_study(geo.Disk(1.0, 1.0), **asked | {"repetitions": 4} | changed)


def streamed(basis, **engine):
    rng = np.random.default_rng(0)
    pairs = ker.SINE.sample(2000, rng), ker.SINE.sample(2000, rng)
    return ker.estimate_stream(pairs, basis, **engine).symmetric


def half_diffuse(rng):
    return ker.maxwell(np.random.default_rng(rng).uniform(0.2, 0.8))


def swept(**changed):
    asked = {"family": ker.maxwell, "grid": {"diffuse_fraction": np.linspace(0.1, 0.9, 9).tolist()}}
    return spec.sweep(**asked | {"quantities": ["gap", "eta"]} | changed)


def discretised(**changed):
    return ker.discretise(**{"law": WALL, "basis": BINS, "method": "monte-carlo", "samples": 2**12, "rng": 3} | changed)


def numbers_of_a_matrix(method, basis, **engine):
    found = discretised(method=method, basis=basis, **engine)
    return np.append(found.symmetric, [float(found.error), found.unresolved])


def numbers_of_a_study(**engine):
    found = studied(**engine)
    return np.concatenate([found.distance, *(values.ravel() for values in found.errors.values())])


# Those that store all sums in one piece, in place of the earlier ones.
IN_ONE_PIECE = {
    **{f"estimate_stream {basis!r}": partial(streamed, basis) for basis in (BINS, ker.Legendre(5), PANELS)},
    **{f"{method} {basis!r}": partial(numbers_of_a_matrix, method, basis)
       for method, basis in (("monte-carlo", BINS), ("qmc", ker.Legendre(5)), ("qmc", PANELS))},
}  # fmt: skip
RUNS = {
    "exit_times": lambda **engine: exits(**engine).times,
    "play": lambda **engine: played(**engine).position,
    "limit_study": numbers_of_a_study,
    "mean_law": lambda **engine: spec.mean_law(half_diffuse, 12, BINS, **engine).symmetric,
    "sweep": lambda **engine: np.array([(row.value, row.error) for row in swept(**engine).rows]),
    **IN_ONE_PIECE,
}
# Pages of 4 kB that are left on the disk: for some parts, or too few for the sums.
LEFT = {"exit_times": 1, "play": 4, "limit_study": 1, "mean_law": 12}
FILLING = [name for name in RUNS if name in LEFT or "Bins" in name]


def in_small_parts(setattr=setattr):
    """Let runs of a second consist of several parts, each stored at once."""
    for module, name, value in (
        (channel, "TOGETHER", 16), (billiard, "TOGETHER", 16), (streams, "BLOCK", 512), (chunks, "RAYS_A_TASK", 1),
        (RaySums, "chunk", 2**9), (streams, "STORED_EVERY", 0.0), (chunks, "STORED_EVERY", 0.0),
        (checkpoints, "MOMENT", 0.0), (checkpoints, "PATIENCE", 0.01),
    ):  # fmt: skip
        setattr(module, name, value)


@pytest.fixture
def small_parts(monkeypatch):
    in_small_parts(monkeypatch.setattr)


@pytest.fixture
def stored(monkeypatch):
    """The keys of the parts that are stored, and after how many of them Ctrl-C is pressed."""
    keys, stop, put = [], [], checkpoints.Checkpoint.put

    def counted(self, key, value, **how):
        if stop and len(keys) == stop[0]:
            raise KeyboardInterrupt
        keys.append(key)
        put(self, key, value, **how)

    monkeypatch.setattr(checkpoints.Checkpoint, "put", counted)
    return keys, stop


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("name", [name for name in RUNS if not name.startswith("estimate_stream")])
def test_a_run_has_the_same_bits_on_workers(name, workers):
    assert RUNS[name](client=workers).tobytes() == RUNS[name]().tobytes()


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("name", RUNS)
def test_a_run_that_was_stopped_goes_on_to_the_same_bits_and_computes_no_part_twice(name, tmp_path, stored):
    keys, stop = stored
    whole = RUNS[name](checkpoint=tmp_path / "whole")
    parts = len(keys)
    assert parts > 4 and RUNS[name]().tobytes() == whole.tobytes()
    keys.clear()
    stop.append(3)
    with pytest.raises(KeyboardInterrupt, match=r"stopped.*the same call"):
        RUNS[name](checkpoint=tmp_path / "a")
    stop.clear()
    assert RUNS[name](checkpoint=tmp_path / "a").tobytes() == whole.tobytes() and len(keys) == parts
    assert RUNS[name](checkpoint=tmp_path / "a").tobytes() == whole.tobytes()
    # sums in one piece are stored once more
    assert len(keys) == parts + (name in IN_ONE_PIECE)


PROGRAM = """
import sys
import test_bits as own
own.in_small_parts()
put = own.checkpoints.Checkpoint.put
def told(self, key, value, **how):
    put(self, key, value, **how)
    print("part", flush=True)
own.checkpoints.Checkpoint.put = told
own.RUNS[sys.argv[1]](checkpoint="a")
"""


@pytest.mark.skipif(os.name != "posix", reason="processes are ended differently here")
@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("name", ["play", "qmc Legendre(5)"])
def test_what_a_killed_process_stored_is_gone_on_with_to_the_same_bits(name, tmp_path, stored):
    keys, _ = stored
    whole = RUNS[name](checkpoint=tmp_path / "whole")
    parts = len(keys)
    own = environment(Path(__file__).resolve().parent)
    with started("-c", PROGRAM, name, cwd=tmp_path, env=own) as process:
        for _ in range(4):
            assert process.stdout.readline() == "part\n"
        process.kill()
    keys.clear()
    assert RUNS[name](checkpoint=tmp_path / "a").tobytes() == whole.tobytes() and len(keys) <= parts - 4


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("name", FILLING)
def test_a_full_disk_stops_with_a_message_and_what_was_written_is_gone_on_with(name, tmp_path, monkeypatch):
    whole, path = RUNS[name](), tmp_path / "a"
    original = checkpoints.Checkpoint._begin

    def limited(self, *arguments):
        original(self, *arguments)
        (pages,) = self._file.execute("PRAGMA page_count").fetchone()
        # pages beyond these are as good as a full disk for SQLite
        self._file.execute(f"PRAGMA max_page_count = {pages + LEFT.get(name, 1)}")

    monkeypatch.setattr(checkpoints.Checkpoint, "_begin", limited)
    with pytest.raises(InputError, match=r"disk is full.*what was written before is safe. Free space"):
        RUNS[name](checkpoint=path)
    assert bool(parts_in(path)) == (name not in IN_ONE_PIECE)
    monkeypatch.setattr(checkpoints.Checkpoint, "_begin", original)
    assert RUNS[name](checkpoint=path).tobytes() == whole.tobytes()


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("name", RUNS)
def test_a_second_process_on_a_checkpoint_is_refused_and_harms_nothing(name, tmp_path):
    path = tmp_path / "a"
    whole = RUNS[name](checkpoint=path)
    before = path.read_bytes()
    other = sqlite3.connect(path, isolation_level=None)
    try:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(FileExistsRefusal, match="in use by another process; wait for it or name another file"):
            RUNS[name](checkpoint=path)
    finally:
        other.close()
    assert path.read_bytes() == before and RUNS[name](checkpoint=path).tobytes() == whole.tobytes()


CHANGED = [
    (exits, {"particles": 201}, "particles: 200 there, 201 here"),
    (exits, {"law": ker.maxwell(0.25)}, "law: "),
    (exits, {"rng": 8}, "seed: "),
    (exits, {"lengths": [2.0, 4.0, 9.0]}, "lengths: "),
    (exits, {"speed": 2.0}, "speed: "),
    (exits, {"other": ker.specular()}, "other: "),
    (exits, {"arrangement": "half-turn"}, "arrangement: "),
    (played, {"laws": ker.CollisionLaw.from_wall(geo.focusing_arcs(0.8), DISK)}, "laws: "),
    (played, {"position": np.full((200, 2), 0.25)}, "position: "),
    (played, {"collisions": 6}, "collisions: "),
    (played, {"container": geo.Container.strip(2.0)}, "container: "),
    (studied, {"scales": [1e-3, 1e-4, 1e-6]}, "sizes: "),
    (studied, {"psi": 1.0}, "psi: "),
    (studied, {"wall": geo.triangular_teeth(1.2000000001)}, "wall: "),
    (studied, {"samples": (2, 3, 5)}, "samples: "),
    (studied, {"limit": geo.triangular_teeth(1.3)}, "limit: "),
    (discretised, {"law": ker.CircularArcLaw(1.2)}, "law: "),
    (discretised, {"rng": 6}, "seed: "),
    (discretised, {"basis": ker.Bins(9)}, "basis: "),
    (discretised, {"samples": 4097}, "rays: 4096 there, 4097 here"),
    (discretised, {"method": "qmc"}, "computation: 'independent rays' there, 'scrambled Sobol sequences' here"),
    (swept, {"tolerance": 1e-3}, "tolerance: 1e-06 there, 0.001 here"),
    (swept, {"quantities": ["eta"]}, "quantities: ['gap', 'eta'] there, ['eta'] here"),
    (swept, {"grid": {"diffuse_fraction": [0.25, 0.5]}}, "grid.diffuse_fraction: '9 from 0.1 to 0.9"),
    (swept, {"family": lambda diffuse_fraction: ker.maxwell(diffuse_fraction / 2.0)}, "last wall"),
]


@pytest.mark.parametrize(("run", "changed", "words"), CHANGED)
def test_the_checkpoint_of_another_run_is_refused_with_the_difference(run, changed, words, tmp_path):
    run(checkpoint=tmp_path / "a")
    before = (tmp_path / "a").read_bytes()
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        run(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value) and (tmp_path / "a").read_bytes() == before


def test_each_part_has_random_numbers_of_its_own(monkeypatch):
    monkeypatch.setattr(channel, "TOGETHER", 8)
    times = exits(particles=16).times
    assert len({row.tobytes() for row in times}) == 16
    # the first part of more particles is that of fewer
    assert exits(particles=24).times[:16].tobytes() == times.tobytes()
