"""Exact beams of polygonal hollows: mass, closed forms, detailed balance, and rays traced one by one."""

import numpy as np
import pytest
from random_hollows import random_hollow

from asperity import InputError, WallError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.beams import beams_of

RANDOM = 50


def row(beams, theta):
    """Probabilities by isometry at one angle, straight from the pieces."""
    inside = (beams.low <= theta) & (theta < beams.high)
    probability = beams.sine[inside] + beams.cosine[inside] / np.tan(theta)
    return probability, beams.sign[inside], beams.offset[inside]


def mean_cosine(beams, theta):
    probability, sign, offset = row(beams, theta)
    return probability @ np.cos(sign * theta + offset), probability.sum()


@pytest.mark.parametrize("angle", [0.1, 0.7, np.pi / 2, 2.0, 3.0])
def test_triangular_teeth_have_their_closed_law(angle):
    wall = geo.triangular_teeth(angle)
    beams = beams_of(wall.vertices)
    law = ker.TriangularTeethLaw(angle)
    assert beams.unresolved == 0.0
    for theta in np.linspace(0.01, np.pi - 0.01, 23):
        probability, outgoing = law.branches(theta)
        mean, total = mean_cosine(beams, theta)
        assert abs(total - 1.0) < 1e-13 / np.sin(theta)
        assert abs(mean - probability @ np.cos(outgoing)) < 1e-13 / np.sin(theta)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 2.5])
def test_a_rectangular_crevice_reflects_by_the_fractional_part_of_its_depth(ratio):
    beams = beams_of([(0, 0), (0, -ratio), (1, -ratio), (1, 0)], max_beams=20_000)
    for theta in np.linspace(0.3, np.pi - 0.3, 17):
        probability, sign, offset = row(beams, theta)
        strip = 2.0 * ratio * abs(np.cos(theta) / np.sin(theta))
        back = probability[sign > 0].sum()
        expected = strip % 1.0 if np.floor(strip) % 2 == 0 else 1.0 - strip % 1.0
        assert abs(back - expected) < 1e-12
        assert abs(probability.sum() - 1.0) < 1e-12
        assert np.abs(offset[sign > 0]).max(initial=0.0) < 1e-18
        assert np.abs(offset[sign < 0] - np.pi).max(initial=0.0) == 0.0


@pytest.mark.parametrize("seed", range(RANDOM))
def test_the_pieces_of_a_random_hollow_have_mass_one(seed):
    beams = beams_of(random_hollow(seed), max_beams=20_000)
    assert beams.defect < 1e-13
    assert abs(beams.resolved() + beams.unresolved - 1.0) < 1e-13
    assert beams.rounding < 1e-10
    if seed % 2 == 0:
        assert beams.unresolved <= 1e-12


def test_bad_chains_are_refused_with_a_reason():
    with pytest.raises(InputError, match="left < right"):
        beams_of([(1, 0), (0.5, -1), (0, 0)])
    with pytest.raises(InputError, match="y <= 0"):
        beams_of([(0, 0), (0.5, 1), (1, 0)])
    with pytest.raises(WallError, match="cross itself"):
        beams_of([(0, 0), (1, -1), (0, -1), (1, 0)])
