"""Walls that nearly retroreflect: they approach it, each at a distance with an error that holds."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker


def test_the_error_of_the_distance_holds_in_95_of_100_runs():
    """Half flat tops over a crevice of depth r/2: the probability of retroreflection has a closed form."""
    law = ker.RectangularTeethLaw(0.8)
    theta = (np.arange(200_000) + 0.5) * math.pi / 200_000
    probability = law.branches(theta)
    moved = np.sum(probability[0] * np.abs(probability[1] - theta[:, None]), axis=1)
    exact = float(np.sum(0.5 * np.sin(theta) * moved) * math.pi / 200_000)
    for reflector in (law, geo.rectangular_teeth(0.8)):
        found = [ker.retroreflection_distance(reflector, 400, seed) for seed in range(100)]
        assert sum(abs(float(one) - exact) <= one.error for one in found) >= 90
        values = np.array([float(one) for one in found])
        assert np.mean([one.error for one in found]) < 1.6 * 1.96 * values.std() + 0.03


def test_the_distance_is_that_of_rows_from_the_law_of_retroreflection():
    law = ker.CircularArcLaw(1.2)
    rows = ker.distance(law, ker.retroreflection(), tolerance=1e-3)
    found = ker.retroreflection_distance(law, 40_000, rng=1)
    assert abs(float(rows) - float(found)) < rows.error + 1.5 * found.error < 0.02
    # without any deflection the error says what may be missed
    still = ker.retroreflection_distance(ker.retroreflection(), 300, rng=0)
    assert float(still) == 0.0 and still.error == pytest.approx(math.pi / 100)


def test_the_page_on_reflection_has_the_distances_that_are_computed():
    """Each row of its table but that of 2,000 notches, to the error that the page prints and to that of fewer rays."""
    page = (Path(__file__).parents[3] / "docs" / "theory" / "reflection.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)\(([\d., ]*)\)` \| ([\d.]+)\((\d+)\) \|$", page, flags=re.MULTILINE)
    assert len(rows) == 8
    for name, arguments, value, last in rows:
        size, _, count = arguments.partition(", ")
        given = (int(size), float(count)) if name == "tube" else (float(size), int(count)) if count else ()
        if count == "2000":
            continue
        found = ker.retroreflection_distance(getattr(geo, name)(*given), rng=7)
        printed = int(last) * 10.0 ** -len(value.partition(".")[2])
        assert abs(float(found) - float(value)) < printed + found.error, (name, arguments)


def test_rays_less_steep_than_the_sides_of_a_fine_notched_angle_come_back_exactly():
    rng = np.random.default_rng(4)
    theta = rng.uniform(0.3, 1.2, 4000)
    steps = geo.trace(geo.notched_angle(0.2, 1000), rng.random(4000), theta)
    assert np.mean(np.abs(steps.theta - theta) < 1e-9) > 0.97
    # every direction is one of two, because all sides are vertical or horizontal
    other = np.minimum(np.abs(steps.theta - theta), np.abs(steps.theta + theta - math.pi))
    assert other.max() < 1e-9


def unfolded(x, theta, plates, height, most=10_000):
    """The tube with plates of no thickness, unfolded across its width: reflections at plates alone are counted."""
    slope = -1.0 / math.tan(theta)
    at, level, down = x, 0, True
    for _ in range(most):
        at, level = at + slope, level + (1 if down else -1)
        if level == 0:
            # the horizontal direction is reversed for an odd number of widths
            odd = math.floor(at) % 2 == 1
            return theta if odd else math.pi - theta
        if level == plates + 1 or abs(at - round(at)) < height:
            down = not down
    return math.nan


def test_the_tube_agrees_with_rotations_of_the_circle():
    """Where the thickness of the plates matters, for about one ray in a thousand, both differ."""
    wall, rng = geo.tube(6, 0.2), np.random.default_rng(2)
    x, theta = rng.random(4000), np.arccos(1.0 - 2.0 * rng.random(4000))
    found = geo.trace(wall, x, theta)
    expected = np.array([unfolded(a, b, 6, 0.2) for a, b in zip(x, theta, strict=True)])
    assert found.escaped.all()
    assert np.mean(np.abs(found.theta - expected) > 1e-9) < 0.02
