"""What geometry, sweeps and long runs refuse, and the words in which they do: one table of calls."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError, WallError
from asperity.geometry import Arc, Bezier, Segment, Wall
from asperity.geometry.cells import profile
from wall_shapes import flask, polygon, square

nan, inf, pi = math.nan, math.inf, math.pi
DISK, ARC, TEETH = geo.Disk(), Arc((0, 0), 1, 0, 1), geo.triangular_teeth(1.2)


FLOOR, LOOP = polygon((0, -1), (1, -1)), polygon((0.5, 0), (0.75 + 1e-6, -0.2), (0.75 - 1e-6, -0.2), (1, 0))


def islands(*loops):
    return Wall(FLOOR, islands=list(loops))


CURVES = [
    (lambda: Segment((0, 0), (0, nan)), "Segment end"),
    (lambda: Segment((0, 0), (0, 0)), "two different points"),
    (lambda: Segment((0, 0), 3), r"point \(x, y\)"),
    (lambda: Arc((0, 0), -1, 0, 1), "semi_axes"),
    (lambda: Arc((0, inf), 1, 0, 1), "center"),
    (lambda: Arc((0, 0), 1, 1, 1), "2 pi"),
    (lambda: Arc((0, 0), 1, 0, nan), "start and end"),
    (lambda: Bezier([(0, 0), (1, 1)]), "3 or 4 points"),
    (lambda: Bezier([(0, 0), (1, nan), (1, 0)]), "control point 1"),
    (lambda: Bezier([(1, 1)] * 3), "points that differ"),
    (lambda: Segment((0, 0), (1, 0)).stretched(0, 1), "factors"),
]

WALLS = [
    (lambda: ARC.flattened(0.0), "tolerance"),
    (lambda: flask(0.51), "piece 1 crosses itself or the neighbouring period"),
    (lambda: Wall([Bezier([(0, 0), (1.6, -1.5), (-0.6, -1.5), (1, 0)])]), "piece 0 crosses itself"),
    (lambda: islands(square(0.2, -0.5, 0.2), square(0.3, -0.45, 0.2)), "island 0 .* island 1"),
    (lambda: islands(square(0.2, -1.1, 0.2)), "piece 0 .* of island 0"),
    (lambda: islands(square(0.2, -1.5, 0.2)), "wrong side"),
    (lambda: islands(square(0.9, -0.5, 0.2)), "piece 1 of island 0 leaves the cell .* roll"),
    (lambda: islands(square(0.2, -0.1, 0.2)), "of island 0 rises to y = 0.1"),
    (lambda: Wall.from_vertices([(0, 0), (0.2, nan), (1, 0)]), r"nan\) at vertex 1"),
    (lambda: Wall.from_vertices([(0, 0), (0.2, -1), (0.2, -1), (1, 0)]), "vertices 1 and 2 coincide"),
    (lambda: Wall.from_vertices([(0, 0), (0.5, 0.1), (1, 0)]), "piece 0 rises to y = 0.1 at x = 0.5"),
    (lambda: Wall.from_vertices([(0, 0), (0.5, -0.1), (1, -0.1)]), "same height"),
    (lambda: Wall(polygon((0.1, 0), (0.5, -0.1), (1, 0))), r"start at x = 0, got \(0.1, 0\)"),
    (lambda: Wall.from_vertices([(0, 0), (0.5, -0.1), (0, 0)]), "period"),
    (lambda: Wall.from_vertices([0, 1, 2]), "shape"),
    (lambda: Wall.from_vertices("teeth"), "points"),
    (lambda: Wall(polygon((1, 0), (0.5, -1), (0, 0))), "right to left"),
    (lambda: Wall(polygon((0, 0), (0.5, -1), (0.9, 0))), "end at x = period = 1"),
    (lambda: Wall([Segment((0, 0), (0.5, -1)), Segment((0.5, -1.1), (1, 0))]), "pieces 0 and 1 do not join"),
    (lambda: Wall([Arc((0.5, 0), 0.5, pi, 0)]), "piece 0 rises to y = 0.[45]"),
    (lambda: Wall([Bezier([(0, 0), (0.5, 0), (1, 0)])]), "piece 0: expected a Segment"),
    (lambda: Wall([]), "at least one piece"),
    (lambda: Wall([1]), r"pieces\[0\]"),
    (lambda: Wall(None), "sequence of curves"),
    (lambda: Wall(FLOOR, period=-1), "period"),
    (lambda: Wall(polygon((0, -0.5), (1.2, -0.7), (1, -0.5)), islands=[square(0.4, -0.3, 0.2)]), "roll the cell"),
    (lambda: geo.flat().scaled(-1), "factor"),
    (lambda: Wall([Segment((0, 0), (1e-16, 0)), Segment((0, 0), (1, 0))]), "piece 0 has no length"),
    # a tiny loop beside a curve
    (lambda: Wall([Arc((0.25, 0), 0.25, pi, 2 * pi), *LOOP]), r"piece 1 and piece 3 cross .*\(0.75, -0.199999\)"),
]  # fmt: skip

NAMED = [
    *((lambda s=s: ARC.tangent(s), r"s: expected numbers in \[0, 1\]") for s in (1e308, [0.5, -0.1])),
    (lambda: geo.Segment((0, 0), (1, 0)).point(1e308), r"s: expected numbers in \[0, 1\]"),
    (lambda: ARC.split(1e308), "s: expected a number in"), (lambda: ARC.split(-0.1), "s: expected a number in"),
    (lambda: geo.triangular_teeth(0.0), "expected"), (lambda: geo.triangular_teeth(pi), "expected"),
    (lambda: geo.rectangular_teeth(-1.0), "expected"), (lambda: geo.focusing_arcs(70), "angles are in radians"),
    (lambda: geo.dispersing_arcs(2.1), "expected"), (lambda: geo.elliptical_arcs(0.5, 3), "expected"),
    (lambda: geo.mushrooms(1.0), "expected"), (lambda: geo.mushrooms(0.5, -1.0), "expected"),
    (lambda: geo.mushrooms(0.5, 1.0, 0), "expected"), (lambda: geo.mushrooms(0.5, 0.0, 2), "larger stem_aspect"),
    (lambda: geo.mushrooms(0.001, 0.01, 4), "expected"), (lambda: geo.koch(1.5), "expected"),
    (lambda: geo.koch(11), "expected"),
]  # fmt: skip


def vertices(x, height, seam="step"):
    return lambda: profile.vertices_of_profile(geo.Profile(x, height), seam)


def random_wall(**asked):
    return lambda: geo.random_wall(**{"spectrum": geo.HeightCorrelation(0.1), "points": 16, **asked})


PROFILES = [
    (vertices([0, 3, 5, 2, 4], [0] * 5), "got 5 at row 2 and 2 at row 3"),
    (vertices([0, 1, 1, 2], [0] * 4), "strictly increasing .*got 1 at row 1 and 1 at row 2"),
    (vertices([[0, 1], [2, 3]], [[0, 1], [2, 3]]), r"got shapes \(2, 2\) and \(2, 2\)"),
    (vertices([0, 1, 2], [0, 1]), r"same length.*got shapes \(3,\) and \(2,\)"),
    (vertices([0], [0]), "at least 2"),
    (vertices([0, 1], ["a", "b"]), "height"),
    (vertices([0, 1], [0, nan]), r"height: .* index \(1,\)"),
    (vertices([0, 1], [0, 1], "glue"), "seam: expected 'mirror', 'step' or 'wrap', got 'glue'"),
    (lambda: Wall.from_profile([0, 1, 2], np.ma.array([1, 7, 2], mask=[0, 1, 0])), "1 of 3 heights are undefined"),
    (random_wall(), "expected one of rms_slope and rms_height"),
    (random_wall(rms_slope=-1.0), "rms_slope: expected"),
    (random_wall(rms_slope=0.1, spectrum=geo.SelfAffine(0.5, shortest=2.0)), "expected power at one frequency"),
    (random_wall(rms_slope=0.1, spectrum=lambda q: -q), "powers of at least 0"),
    (random_wall(rms_slope=0.1, spectrum=geo.HeightCorrelation(0.1, lambda s: np.where(s < 1, 1.0, 0.0))), "negative"),
    (random_wall(rms_slope=0.1, spectrum=0.1), "expected HeightCorrelation"),
    (random_wall(rms_slope=0.1, points=3), "points"),
]  # fmt: skip

DOWN, STILL = [[0.0, -1.0, 0.0]], [[0.0, 0.0]]
SPACE = geo.ConfigurationSpace(geo.flat(), DISK, 0.1)
SHADOW = geo.ConfigurationSpace(TEETH, DISK, 1e-6)
FOUR, POINTS = geo.SatelliteDisk(DISK, 4, 0.1), geo.SatelliteDisk(DISK, 12, 0.0)
PAIR = [[-1.6, -1.0, 0.2], [0.1, 0.3, -0.4]]


def collision(**changed):
    asked = {"disk": DISK, "wall": TEETH, "scale": 0.01, "position": STILL, "velocity": DOWN}
    return lambda: geo.collide(**(asked | changed))


def rim(**changed):
    return lambda: geo.SatelliteDisk(DISK, 4, **({"size": 0.0} | changed))


def study(scales=(0.01,), **changed):
    return lambda: ker.limit_study(DISK, TEETH, list(scales), np.random.default_rng(0), **changed)


DISKS = [
    (lambda: geo.Disk(mass=0.0), "mass"), (lambda: geo.Disk(inertia_ratio=-1.0), "inertia_ratio"),
    (lambda: geo.Disk(mass=nan), "mass"),
    (lambda: DISK.to_angles([(1.0, 1.0, 0.0), (1.0, 0.0, 0.0)]), r"got v2 = 0\.0 at index \(1,\);"),
    (lambda: DISK.to_angles((1.0, -1.0, 0.0)), r"v2 > 0, got v2 = -1\.0;"),
    (lambda: DISK.to_angles([(1, 1, 0), (1, -0.5, 7), (1, 0, 0)]), r"got v2 = -0\.5 at index \(1,\);"),
    (lambda: DISK.to_angles((1.0, 1.0)), "shape"), (lambda: DISK.to_angles(1.0), r"got shape \(\)"),
    (lambda: DISK.inner((1.0, 1.0, nan), (1, 1, 1)), "finite"),
    (lambda: DISK.from_angles(0.0, 1.0), "theta"), (lambda: DISK.from_angles(1.0, pi), "psi"),
    (lambda: DISK.from_angles(1.0, 1.0, speed=0.0), "speed"),
    (lambda: DISK.from_angles([1.0, 1.0], [1.0, 1.0, 1.0]), "broadcast"),
    (lambda: geo.RollingCharts(1.0), "2 pi divided by a whole number"),
    (lambda: geo.RollingCharts(2 * pi / 3), "at least 4"),
    (lambda: geo.RollingCharts(pi / 4, scale=0.0), "scale: expected a number greater than 0"),
    (lambda: geo.RollingCharts.plane_crossing([0, 1, 0], [1, 0, 1]), "v2 other than 0"),
    (lambda: geo.RollingCharts(pi / 4).transfer([0, 0, 0], [1, 1, 1]), r"shape \(..., 2\)"),
    (lambda: geo.ConfigurationSpace(geo.koch(2), DISK, 5.0), "at most two satellites"),
    (lambda: geo.ConfigurationSpace(geo.flat(), None, 0.1), "disk: expected a Disk such as"),
    (lambda: geo.ConfigurationSpace(geo.koch(2), DISK, 0.1, pi / 50), "at most two satellites"),
    (lambda: SPACE.contains([0.0, 1.0]), r"shape \(..., 3\)"),
    (lambda: SPACE.cylinder_contains([0.0]), r"shape \(..., 3\)"),
    (lambda: SPACE.normal(0, 0, [1.0]), r"shape \(..., 2\)"),
    (study(psi=4.0), "psi"), (study(repetitions=1), "repetitions"), (study(spacing=lambda eps: pi / 250), "spacing"),
    (lambda: ker.SatelliteLaw(TEETH, DISK, 0.1).draw_limit((1.0, 1.2), 0, scales=[0.1, 0.05, 0.02, 0.01, 0.005]),
     "scales: expected at most 4 numbers"),
    (lambda: geo.collide_cylinder(DISK, TEETH, 0.1, STILL, [[0, 1, 0]]), "v2 < 0"),
    (lambda: geo.collide_modified(DISK, TEETH, 0.1, STILL, DOWN, 1.0), "whole number"),
    (lambda: geo.InnerDisk(0.8, 0.0), "less than"), (lambda: geo.InnerDisk(0.2, -1.0), "at least 0"),
    (lambda: geo.InnerDisk(0.0, 0.0), "spacing"), (lambda: geo.InnerDisk(0.2, 0.0).contains([0, 0], [0, 0]), "shape"),
    (collision(spacing=0.3), "whole number"), (collision(spacing=pi / 250), "at most two satellites"),
    (collision(scale=3.0), "make the scale smaller"), (collision(scale=0.0), "greater than 0"),
    (collision(velocity=[[0.0, 1.0, 0.0]]), "v2 < 0"), (collision(velocity=[[0.0, -1.0]]), r"shape \(n, 3\)"),
    (collision(position=[0.0, 0.0]), r"shape \(n, 2\)"), (collision(wall="teeth"), "expected a Wall"),
    (collision(position=np.zeros((3, 2)), velocity=DOWN * 2), "equally many rows"),
    (collision(disk=1.0), "expected a Disk"),
    (lambda: geo.collide_pair(POINTS, FOUR, np.zeros((1, 2, 3)), [PAIR]), "rims do not cross"),
    (lambda: geo.collide_pair(FOUR, FOUR, [[[0, 2.1, 0], [0, 0, 0]]], [PAIR]), "do not touch"),
    (lambda: geo.collide_pair(FOUR, FOUR, [[0, 0, 0]], [[0, 0, 0]]), r"\(n, 2, 3\)"),
    (lambda: geo.collide_pair(POINTS, POINTS, [[[9, 9, 0], [0, 0, 0]]], [PAIR]), "points do not touch"),
    (lambda: geo.SatelliteDisk(DISK, 2, 0.1), "at least 3"), (rim(size=[0.1, 0.2]), "size: expected 4"),
    (rim(size=[-0.1, 0, 0, 0]), "size"), (rim(radius=[1, 1, 1, 0]), "radius"), (rim(joined=1), "joined"),
    (rim(angles=[0, 1, 1, 3]), "angles: expected 4 increasing"), (rim(angles=[0.0, 0.1, 0.2, 0.3]), "half a turn"),
    (rim(size=[0, 0, 0, 0.1], joined=True), "equal sizes"),
    (lambda: geo.collide_rim(POINTS, geo.focusing_arcs(1.0), 0.1, STILL, DOWN), "straight pieces"),
    (lambda: geo.collide_rim(rim(joined=True)(), geo.flat(), 0.1, STILL, DOWN), "edges shorter"),
    (lambda: geo.shadow(SHADOW, [0.0], DOWN[0]), "position"),
    (lambda: geo.shadow(SHADOW, [0.0, 0.0], [0.0, 1.0, 0.0]), "v2 < 0"),
    (lambda: geo.shadow(geo.flat(), [0.0, 0.0], DOWN[0]), "ConfigurationSpace"),
    (lambda: geo.good_fraction(SHADOW, 5), "samples"), (lambda: SHADOW.good_half_width(0.0), "length"),
    (lambda: geo.ConfigurationSpace(TEETH, DISK, 1e-2).good_half_width(), "smaller scale"),
]  # fmt: skip

UNIT = [*polygon((0, 0), (1, 0), (1, 1), (0, 1)), Segment((0, 1), (0, 0))]
CIRCLE = geo.Container.circle(1.5)
TWO = geo.Container.from_curves([Arc((0, 0), 1.0, 0.0, 0.1), Arc((0, 0), 1.0, 0.1, 2 * pi)])


def table(*curves):
    return lambda: geo.Container.from_curves(list(curves))


def played(container, laws, position=(0.0, 0.0)):
    return lambda: ker.play(container, laws, list(position), [1.0, 0.0, 0.0], 1)


TABLES = [
    (table(*UNIT[:3]), "curve 2.*inside is on the left"),
    (table(*UNIT, *(curve.moved(3.0, 0.0) for curve in UNIT)), "expected one outer loop"),
    (table(*UNIT, Arc((1.0, 0.5), 0.2, 2 * pi, 0.0)), "obstacles inside the outer loop"),
    (table(*UNIT, *(Arc((x, 0.5), 0.2, 2 * pi, 0.0) for x in (0.4, 0.6))), "separate obstacles"),
    (table(*polygon((0, 0), (1, 1), (1, 0), (0, 1), (0, 0))), "cross themselves"),
    (table((0, 0)), "Segments, Arcs and Beziers"), (table(Bezier([(0, 0), (1, 1), (0, 0)])), "without cusps"),
    (table(), "at least one curve"),
    (table(Arc((0.5, 1e6), 1e6, -pi / 2 - 5e-7, -pi / 2 + 5e-7).pinned((0, 0), (1, 0)), *UNIT[1:]), "almost straight"),
    (lambda: geo.Container.strip().area, "outer loop"), (lambda: geo.Container.sinai(1.0, 0.5), r"\(0, 0\.5\)"),
    (played(CIRCLE, ker.smooth(DISK), (2.0, 0.0)), "centres in the container"),
    (played(geo.Container.stadium(1.0, 0.5), [ker.smooth(DISK)]), "the 4 walls"),
    (lambda: geo.nested_reflection(TWO, [0], [0.5], [0.4]), "on openings"),
    (lambda: geo.nested_reflection(TWO, [2], [0.5], [0.4]), "openings"),
    (lambda: geo.billiard_map(CIRCLE, [0.0], [0.0]), "open interval"),
    (lambda: geo.billiard_map(geo.Container.strip(), [0.0], [1.0]), "from curves"),
    (lambda: geo.billiard_map(CIRCLE, [0.0, 1.0], [1.0]), r"\(n,\)"),
]  # fmt: skip

GRID = {"diffuse_fraction": [0.25, 0.5, 1.0]}


def swept(*arguments):
    return lambda: spec.sweep(*arguments)


def extremum(family, grid, *arguments):
    return lambda: spec.sweep(family, grid).extremum(*arguments)


def limited(tool, limit):
    return lambda: tool(ker.lambertian(), time_limit=limit)


RUNS = [
    (swept(ker.maxwell, {}), "expected values by parameter"),
    (swept(ker.maxwell, {"angle": [1.0]}), "cannot be called with angle"),
    (swept(ker.maxwell, {"diffuse_fraction": []}), "at least one"),
    (swept(ker.maxwell, {"diffuse_fraction": [nan]}), "numbers or texts"),
    (swept(ker.maxwell, {"diffuse_fraction": [0.5, 0.5]}), "different values"),
    (swept(ker.maxwell, GRID, "lambda"), "expected one of gap"), (swept(ker.maxwell, GRID, []), "got none"),
    (swept(ker.maxwell, GRID, ["gap", "gap"]), "'gap' twice"), (swept(ker.maxwell, GRID, "gap", 0.0), "greater than 0"),
    (swept(0.5, GRID), "expected a function that returns a wall"),
    (lambda: spec.Between(1.0, 0.0), "greater than low"), (lambda: spec.SweepTable.of_json("[]"), "expected what"),
    (lambda: spec.SweepTable.of_json(spec.sweep(ker.maxwell, GRID).to_json()).extremum(), "was read"),
    (extremum(ker.maxwell, GRID, "eta"), "expected one of gap"),
    (extremum(lambda a, b: ker.maxwell(a * b), {"a": [0.1, 0.2], "b": [1.0]}), "expected one parameter"),
    (extremum(ker.maxwell, {"diffuse_fraction": [3.0]}), "no point of the sweep has a value"),
    (lambda: spec.ensemble(lambda rng: ker.maxwell(0.5), 3), "realisations"),
    (lambda: spec.mean_law(lambda rng: ker.maxwell(0.5), 5, 8), "basis"),
    (lambda: spec.hilbert_schmidt_norm(0.5), "law"),
    (lambda: spec.hilbert_schmidt_norm(ker.lambertian(), 0.0), "tolerance"),
    *((limited(tool, limit), "time_limit: expected")
      for tool in (spec.spectral_gap, spec.spectrum, ker.resistance) for limit in (0.0, nan, "long")),
    (lambda: ker.discretise(ker.WallLaw(geo.dispersing_arcs(1.0)), ker.Bins(10**5), "qmc"), "more than there is"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "words"), [*CURVES, *WALLS, *NAMED, *PROFILES, *DISKS, *TABLES, *RUNS])
def test_a_call_is_refused_in_words(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_unsuitable_curves_raise_wall_errors():
    for call, _ in CURVES:
        with pytest.raises(WallError):
            call()


CROSSING = {
    "a loop": ([(0, 0), (0.7, -0.5), (0.3, -0.5), (1, 0)], r"piece 0 and piece 2 .*\(0.5, -0.357143\)"),
    "a wide cavity": (
        [(0, 0), (0.4, 0), (0.4, -0.1), (-0.2, -0.1), (-0.2, -1), (1.2, -1), (1.2, -0.1), (0.6, -0.1), (0.6, 0),
         (1, 0)],
        "piece",
    ),
    "a far overhang": ([(0, 0), (5, -1), (6.5, -1), (1, 0)], "piece"),
    "through a corner": (
        [(0, 0), (0, -1), (0.5, -0.5), (0.5, -0.2), (0.8, -0.2), (0.8, -0.5), (0.5, -0.5), (0.2, -0.4), (0.3, -0.9),
         (1, -0.9), (1, 0)],
        r"\(0.5, -0.5\)",
    ),
    "through an edge": (
        [(0, 0), (0, -1), (0.6, -1), (0.6, -0.2), (0.8, -0.2), (0.8, -0.5), (0.4, -0.5), (0.4, -0.8), (0.8, -0.8),
         (0.8, -1), (1, -1), (1, 0)],
        "piece 2",
    ),
    "a tiny loop": ([(0, 0), (0.5 + 1e-7, -0.5), (0.5 - 1e-7, -0.5), (1, 0)], "piece 0 and piece 2"),
}  # fmt: skip


@pytest.mark.parametrize("name", CROSSING)
@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_crossing_pieces_are_refused_with_their_place(name, factor):
    corners, words = CROSSING[name]
    with pytest.raises(WallError, match=words if factor == 1.0 else "cross"):
        Wall.from_vertices(np.array(corners) * factor)


def rays(count):
    rng = np.random.default_rng(14)
    return {"x": rng.random(count), "theta": np.arccos(1.0 - 2.0 * rng.random(count))}


@pytest.mark.parametrize("wall", ["triangular-teeth", "elliptical-arcs"], indirect=True)
@pytest.mark.parametrize(
    ("what", "bad"), [("x", nan), ("x", -inf), ("theta", nan), ("theta", 0.0), ("theta", pi), ("theta", -0.1)]
)
def test_one_bad_ray_among_many_is_named(wall, what, bad):
    asked = rays(40_000)
    asked[what][39_998] = bad
    with pytest.raises(InputError, match=f"{what}: expected .*39998"):
        geo.trace(wall, asked["x"], asked["theta"], threads=2)


SEGMENT = '[[pieces]]\nkind = "segment"\nstart = [0, 0]\nend = [1, 0]\n'
ARCS = 'period = 1\n[[pieces]]\nkind = "arc"\ncenter = [0.5, 0]\n'
FILES = [
    ("wall.toml", "period = = 1", "not a TOML file .*line 1"),
    ("wall.toml", "vertices = [[0, 0], [1, 0]]", "missing key 'period'"),
    ("wall.toml", "period = 1", "'vertices' and 'pieces'"),
    ("wall.toml", "period = 1\nvertices = [[0, 0], [1, 0]]\n" + SEGMENT, "exactly one"),
    ("wall.toml", "period = 1\nvertices = [[0, 0], [1, 0]]\ndepth = 2", "unknown key 'depth'"),
    ("wall.toml", 'period = "1"\nvertices = [[0, 0], [1, 0]]', "key 'period': expected a number"),
    ("wall.toml", "period = 1\nvertices = [[0, 0], [1]]", r"key 'vertices\[1\]': expected two numbers"),
    ("wall.toml", "period = 1\nvertices = 3", "key 'vertices': expected a list of points"),
    ("wall.toml", "period = 1\nvertices = [[0, 0], [0.5, nan], [1, 0]]", "finite"),
    ("wall.toml", "period = 1\n" + SEGMENT.replace("segment", "spline"), r"pieces\[0\]: key 'kind': .*'spline'"),
    ("wall.toml", "period = 1\n" + SEGMENT.replace('kind = "segment"', ""), r"pieces\[0\]: missing key 'kind'"),
    ("wall.toml", "period = 1\n" + SEGMENT.replace("end = [1, 0]", ""), r"pieces\[0\]: missing key 'end'"),
    ("wall.toml", "period = 1\n" + SEGMENT + "radius = 1", r"pieces\[0\]: unknown key 'radius'"),
    ("wall.toml", "period = 1\npieces = 3", r"array of tables"),
    ("wall.toml", 'period = 1\nformat = "other"\n' + SEGMENT, "key 'format'"),
    ("wall.toml", "period = 1\n" + SEGMENT + "[[islands]]\nloop = 1", r"islands\[0\]: missing key 'pieces'"),
    ("wall.toml", f"{ARCS}angles = [3.14, 6.28]", "missing key 'semi_axes'"),
    ("wall.toml", f"{ARCS}semi_axes = 0.5\nangles = [3.2, 6.2]\nstart = [0, 0]", "missing key 'end'"),
    ("wall.toml", 'period = 1\n[[pieces]]\nkind = "bezier"\ncontrol_points = [[0, 0], [1, 0]]', "3 or 4 points"),
    ("wall.toml", "period = 1\nvertices = [[0, 0], [0.7, -0.5], [0.3, -0.5], [1, 0]]", "piece 0 and piece 2"),
    ("wall.toml", f"period = 1{'0' * 400}\nvertices = [[0, 0], [1, 0]]", "'period': expected a number below 1e308"),
    *(("wall.toml", text, r"wall\.toml: ")
      for text in ("a = " + "[" * 5000, "a = " + "{b=" * 5000, "b = " + "9" * 5000)),
    *(("wall.toml", f"period = 1.0\nvertices = [[0, 0], {vertex.format(size)}, [1, 0]]",
       r"finite coordinates of at most 1e\+100")
      for vertex in ("[0.5, -{}]", "[{}, -0.5]", "[-{}, -1]") for size in (1e101, 1e308)),
    # no number, and so no undefined height
    *(("scan.csv", f"0 1\n1 {word}\n2 1\n", r"line 2: expected two numbers|at most 1e\+100")
      for word in ("1e400", "-1e400", "1_0", "1e308", "0x10", "١")),
    ("wall.toml", b"\xff\xfe\x00", "cannot read it .*utf-8.*; expected a file of text"),
    ("scan.csv", "0 1\n1 2 3\n", "line 2: expected two numbers"),
    ("scan.csv", "x y\nfoo bar\n0 1\n1 2\n", "line 2"),
    ("scan.csv", "0 1\n", "at least two rows"),
    ("scan.csv", "", "cannot read a file of 0 bytes"),
    ("scan.csv", "\n", "at least two rows of x and height, got 0"),
    ("scan.csv", "x y\n0 1\n", "at least two rows of x and height, got 1"),
    ("scan.csv", "# a\n0 1\n1 2\nx y\n3 4", "line 4: expected two numbers, x and height, got 'x y'"),
    ("scan.csv", "x 1\n0 1\n1 2", "line 1"),
    ("scan.csv", "x [um], height\n0 1\n1 2\n", r"header: expected two units((?!of heights).)*$"),
    ("scan.csv", "x [um], height [V]\n0 1\n1 2\n", r"header: expected two units((?!of heights).)*$"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "words"), FILES)
def test_a_file_is_refused_in_one_line_with_its_name(name, content, words, tmp_path):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    read = geo.load_wall if name == "wall.toml" else geo.read_profile
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path / name)
    assert name in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no_such"):
        read(tmp_path / "no_such")


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"decimal": ";"}, "decimal"), ({"delimiter": ""}, "delimiter"),
        ({"delimiter": ",", "decimal": ","}, "delimiter"), ({"usecols": 3}, "usecols"),
        ({"usecols": (0, -1)}, "usecols"),
        ({"skiprows": -1}, "skiprows"), 
        *(({"encoding": name}, "encoding") for name in ("undefined", "klingon", "hex", "idna", "\0", "", 3)),
        ({"units": ("um", "V")}, "units"), ({"units": ("um",)}, "units"), ({"units": 3}, "units"),
    ],
)  # fmt: skip
def test_unsuitable_options_of_a_profile_are_refused_by_name(options, name, tmp_path):
    (tmp_path / "scan.txt").write_text("# ö\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(InputError, match=rf"^{name}: expected|pass {name}="):
        geo.read_profile(tmp_path / "scan.txt", **options)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("focusing-arc", "Did you mean focusing-arcs.*triangular-teeth"), ("", "neither"),
        ("qqq", "neither a named wall nor a file.*koch"), ("focusing-arcs:half_angel=1", "did you mean half_angle"),
        ("flat:angle=1", "it has none"), ("focusing-arcs:half_angle=wide", "expected a number, got 'wide'"),
        ("koch:generations=1.5", "expected a whole number"), ("focusing-arcs:0.9", "parameter=value"),
        ("focusing-arcs:half_angle=1,half_angle=2", "twice"), ("focusing-arcs:half_angle=9", "half_angle"),
        ("arc.toml:seam=step", "arc.toml: unknown parameter 'seam'"),
        ("scan.txt:angle=2", "scan.txt: unknown parameter 'angle'"), ("scan.txt:seam=glue", "scan.txt: seam"),
        ("scan.txt:sort=maybe", "parameter sort: cannot read 'maybe'"),
        ("bad.txt", "bad.txt: x: expected strictly increasing"),
    ],
)  # fmt: skip
def test_unknown_walls_are_refused_in_one_line(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    geo.flat().save("arc.toml")
    (tmp_path / "scan.txt").write_text("0 1\n1 2\n3 0\n")
    (tmp_path / "bad.txt").write_text("0 1\n1 2\n1 0\n")
    with pytest.raises(InputError, match=words) as caught:
        geo.wall_from_text(text)
    assert "\n" not in str(caught.value)
