"""The extreme cases: the data they rest on, and that they can fail."""

import json

import pytest
from campaigns.extremes import disks as extreme_disks
from campaigns.extremes import rays as extreme_rays
from campaigns.extremes.references import disks_of, judge_of, judged_disk, judged_ray
from campaigns.extremes.walls import extreme_walls

from asperity import geometry as geo

DEGRADED = (
    "mushrooms of stem aspect 0, stem/cap 1e-08", "floating islands, theta = 1e-12",
)  # fmt: skip
# Of every kind of judge and of wall, those that take a second at most.
RECOMPUTED = (
    "triangular teeth, angle 0.0001", "rectangular teeth, r = 1e+08", "arcs, half angle 1e-08",
    "mushrooms of stem aspect 0, stem/cap 1e-08", "cusp between dispersing bumps", "overhangs", "floating islands",
    "elliptical arcs, J = 1e3 m", "Koch 3, rays aimed at joints", "triangular teeth, rays aimed at joints",
)  # fmt: skip


def test_rays_are_flagged_without_a_corner_on_two_walls_only():
    found = [each for number in extreme_rays.SMALL for each in extreme_rays.judge(extreme_rays.draw(number))]
    assert {each.kind for each in found if "degraded" in each.outcome} == set(DEGRADED)


def test_every_extreme_wall_has_its_rays():
    assert list(json.loads(extreme_rays.DATA.read_text())) == list(extreme_walls())
    for name in extreme_walls():
        reference, rays = extreme_rays.known_rays(name)
        assert reference in ("closed form, 50 digits", "tracer in 50 digits")
        assert len(rays) >= 24 or name == "floating islands, theta = 1e-12"


@pytest.mark.parametrize("name", RECOMPUTED)
def test_the_data_are_what_their_script_computes(name):
    wall = extreme_walls()[name]()
    judge = judge_of(name, wall)
    stored = json.loads(extreme_rays.DATA.read_text())[name]
    assert stored["reference"] == judge.reference
    rays = stored["rays"]
    # the rays that are stored, not new ones: numpy's arccos and powers round differently from processor to processor
    for ray in (rays[0], rays[len(rays) // 2], rays[-1]):
        assert judged_ray(name, judge, float.fromhex(ray[0]), float.fromhex(ray[1])) == ray


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("triangular teeth, angle 0.7", geo.triangular_teeth(0.70001)),
        ("rectangular teeth, r = 1", geo.rectangular_teeth(1.1)),
        ("arcs, half angle 1.2", geo.focusing_arcs(1.20001)),
        ("overhangs", geo.Wall.from_vertices([(0, 0), (0.4, 0), (0.2, -0.5), (0.9, -0.601), (0.6, 0), (1, 0)])),
    ],
)
def test_the_check_of_rays_can_fail(name, other):
    assert all(each.verdict == "holds" for each in extreme_rays.judge((name, extreme_walls()[name]())))
    assert any(each.verdict == "fails" for each in extreme_rays.judge((name, other)))


@pytest.mark.parametrize("scale", [1e-1, 1e-8])
def test_the_disks_data_are_what_their_script_computes(scale):
    stored = json.loads(extreme_disks.DATA.read_text())[f"{scale:g}"]
    position, velocity = disks_of(scale)
    assert judged_disk(scale, position[3], velocity[3]) == stored[3]


def test_the_check_of_disks_can_fail(monkeypatch):
    monkeypatch.setattr(extreme_disks, "WALL", geo.triangular_teeth(0.70001))
    assert any(each.verdict == "fails" for each in extreme_disks.judge(0.001))
