"""Hollows in closed form: which there are, the limit of collisions, and the sines and angles that they use."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.precise_polynomials import POLYNOMIALS, coefficients
from numba import njit

from asperity import geometry as geo
from asperity.geometry.curves.columns import FORM, NO_FORM
from asperity.geometry.tracing.compiled import trigonometry as angle_engine

EPS = 2.0**-52


@pytest.mark.parametrize("limit", [1, 2, 3])
@pytest.mark.parametrize("wall", ["triangular-teeth", "semicircles", "several hollows"], indirect=True)
def test_the_largest_number_of_collisions_ends_rays_alike(wall, limit):
    rng = np.random.default_rng(3)
    x, theta = rng.uniform(-2.0, 3.0, 20_000), np.arccos(1.0 - 2.0 * rng.random(20_000))
    plain = geo.Wall(wall.pieces, wall.period)
    hollows = wall.scene.hollows.copy()
    hollows[:, FORM] = NO_FORM
    plain.__dict__["scene"] = wall.scene._replace(hollows=hollows)
    closed, loop = (geo.trace(one, x, theta, max_collisions=limit) for one in (wall, plain))
    assert closed.counts() == loop.counts() and closed.counts()["bounce_limit"] > 200
    assert np.array_equal(closed.collisions, loop.collisions)


@pytest.mark.parametrize(
    ("wall", "forms"),
    [("saw", 1), ("shallow arcs", 1), ("sharp teeth", 1), ("large teeth", 1), ("several hollows", 2),
     ("rectangular-teeth", 0)],
    indirect=["wall"],
)  # fmt: skip
def test_the_plan_counts_closed_forms(wall, forms):
    assert wall.plan().closed_forms == forms


def test_hollows_outside_of_the_closed_forms_have_none():
    # too narrow, too shallow, more than a half circle, an apex beside the opening
    leaning = geo.Wall.from_vertices([(0, 0), (-0.1, -0.5), (1, 0)])
    round_bottle = geo.Arc((0.5, -0.2), np.hypot(0.2, 0.2), 0.75 * np.pi, 2.25 * np.pi)
    bottle = geo.Wall([geo.Segment((0, 0), (0.3, 0)), round_bottle, geo.Segment((0.7, 0), (1, 0))])
    for wall in (geo.triangular_teeth(0.2), geo.focusing_arcs(0.01), bottle, leaning):
        assert wall.plan().closed_forms == 0


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_polynomials_have_the_coefficients_of_their_script(name):
    assert getattr(angle_engine, name) == coefficients(name)


@njit(error_model="numpy")
def sines_and_angles(theta, sine, cosine, angle):
    for i in range(theta.shape[0]):
        sine[i], cosine[i] = angle_engine.sine_cosine(theta[i])
        angle[i] = angle_engine.direction_angle(cosine[i], sine[i])


def test_sines_and_angles_are_exact_to_two_ulps():
    rng = np.random.default_rng(4)
    tiny = 10.0 ** rng.uniform(-300.0, 0.0, 500)
    theta = np.concatenate(
        [
            np.pi * rng.random(1500),
            tiny,
            np.pi - 10.0 ** rng.uniform(-15.0, 0.0, 500),
            np.pi / 2 + tiny * rng.choice([-1, 1], 500),
            np.pi / 4 + np.arange(-20, 20) * EPS,
        ]
    )
    sine, cosine, angle = np.empty_like(theta), np.empty_like(theta), np.empty_like(theta)
    sines_and_angles(theta, sine, cosine, angle)
    with mp.workdps(40):
        for t, s, c, a in zip(theta.tolist(), sine.tolist(), cosine.tolist(), angle.tolist(), strict=True):
            for found, exact in ((s, mp.sin(t)), (c, mp.cos(t)), (a, mp.atan2(s, c))):
                assert abs(found - exact) <= 2.0 * np.spacing(abs(float(exact)))
