"""Laws of walls: which shapes have a closed form, and what traced rays do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AccuracyError
from asperity.kernels import Combination
from asperity.kernels.bases.measure import SINE
from asperity.kernels.laws.law import Law, specular
from asperity.kernels.walls.circular_arc import CircularArcLaw
from asperity.kernels.walls.rectangular import RectangularTeethLaw
from asperity.kernels.walls.triangular import TriangularTeethLaw
from asperity.kernels.walls.wall_law import UNRESOLVED_TOLERANCE, WallLaw


def same(law: Law | None, expected: Law) -> bool:
    theta = np.linspace(0.1, 3.0, 20)
    return law is not None and bool(np.allclose(law.apply(np.cos, theta), expected.apply(np.cos, theta), atol=1e-12))


def test_walls_with_a_closed_form_are_recognised_by_their_shape() -> None:
    assert WallLaw(geo.flat()).closed_form == specular()
    assert WallLaw(geo.rectangular_teeth(1.5)).closed_form == RectangularTeethLaw(1.5)
    for wall, expected in (
        (geo.triangular_teeth(0.7), TriangularTeethLaw(0.7)),
        (geo.Wall.from_vertices([(0, 0), (3, -4), (6, 0)]), TriangularTeethLaw(2.0 * math.atan(0.75))),
        (geo.focusing_arcs(1.2), CircularArcLaw(1.2)),
        (geo.focusing_arcs(math.pi / 2).scaled(7.0), CircularArcLaw(math.pi / 2)),
        (geo.focusing_arcs(1e-6), CircularArcLaw(1e-6)),
        (geo.elliptical_arcs(0.9, geo.Disk()).foreshorten(geo.Disk()), CircularArcLaw(0.9)),
        (geo.rectangular_teeth(0.8).mirrored(), RectangularTeethLaw(0.8)),
    ):
        assert same(WallLaw(wall).closed_form, expected), wall


def test_foreshortened_teeth_have_the_corrected_parameters() -> None:
    disk = geo.Disk(mass=1.3, inertia=0.5)
    stretch = math.sqrt(1.0 + 1.3 / 0.5)
    rectangles = WallLaw(geo.rectangular_teeth(0.8).foreshorten(disk)).closed_form
    assert isinstance(rectangles, RectangularTeethLaw)
    assert rectangles.height_to_width == pytest.approx(stretch * 0.8, rel=1e-14)
    triangles = WallLaw(geo.triangular_teeth(0.8).foreshorten(disk)).closed_form
    assert isinstance(triangles, TriangularTeethLaw)
    assert triangles.angle == pytest.approx(2.0 * math.atan(math.tan(0.4) / stretch), rel=1e-14)


def test_several_hollows_make_a_combination_by_their_widths() -> None:
    wall = geo.Wall.from_vertices([(0, 0), (1, -1), (2, 0), (3, 0), (3, -2), (3.5, -2), (3.5, 0), (4, 0)])
    law = WallLaw(wall).closed_form
    assert isinstance(law, Combination)
    expected = 0.5 * TriangularTeethLaw(math.pi / 2) + 0.25 * RectangularTeethLaw(4.0) + 0.25 * specular()
    assert same(law, expected)
    assert np.allclose(WallLaw(wall).branches(1.0)[0].sum(), 1.0)


@pytest.mark.parametrize(
    "wall",
    [
        geo.dispersing_arcs(1.0),
        geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)]),
        geo.Wall.from_vertices([(0, 0), (0.2, 0), (0.2, -0.5), (1, -0.5), (1, 0)]),
        geo.Wall([geo.Arc((0.5, 0.0), (0.5, 0.3), -math.pi, 0.0)]),
        geo.double_parabola(),
    ],
    ids=["bumps", "skew", "wide crevice", "ellipse", "parabolas"],
)
def test_other_walls_have_no_closed_form(wall: geo.Wall) -> None:
    law = WallLaw(wall)
    assert law.closed_form is None
    assert law.is_polygonal is wall.is_polygonal
    if wall.is_polygonal:
        assert law.branches(1.0)[0].sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    "wall", [geo.triangular_teeth(0.7), geo.rectangular_teeth(1.1), geo.focusing_arcs(1.2)], ids=repr
)
def test_traced_rays_go_where_the_closed_form_says(wall: geo.Wall) -> None:
    law = WallLaw(wall)
    rng = np.random.default_rng(8)
    x, theta = rng.uniform(0.001, 0.999, 20_000), SINE.sample(20_000, rng)
    outgoing, escaped = law.reflect_with_status(x, theta)
    assert escaped.mean() > 1.0 - UNRESOLVED_TOLERANCE
    error = np.abs(outgoing - law.closed_form.reflect(x, theta))
    assert np.median(error) < 1e-15
    # a ray within rounding of a corner or of a change of its hits may go the other way
    assert np.mean(error[escaped] > 1e-9) < 1e-4


def test_rays_that_do_not_escape_are_sent_back_and_reported() -> None:
    law = WallLaw(geo.triangular_teeth(math.pi / 2))
    # straight into the bottom, and beside it
    outgoing, escaped = law.reflect_with_status([0.5, 0.6], math.pi / 2)
    assert escaped.tolist() == [False, True]
    assert np.allclose(outgoing, math.pi / 2)
    with pytest.raises(AccuracyError, match=r"0\.5 of 2 rays did not escape") as info:
        law.reflect([0.5, 0.6], math.pi / 2)
    assert info.value.defect == 0.5


# ---- expectations under walls with many pieces ---------------------------------------------------------------------
def _rough(points: int) -> geo.Wall:
    """A profile whose slopes are independent: its rays visit many valleys."""
    steps = np.random.default_rng(0).normal(size=points + 1)
    return geo.Wall.from_profile(np.linspace(0.0, 1.0, points + 1), 0.1 * np.cumsum(steps) / np.sqrt(points))


@pytest.mark.parametrize(
    ("wall", "reached"), [(geo.mushrooms(0.25, 0.5, 3), 1e-4), (geo.koch(4), 1e-4), (_rough(1000), 0.3)],
    ids=["mushrooms", "koch", "rough"],
)  # fmt: skip
def test_means_over_walls_with_many_pieces_have_the_error_of_their_conditionals(wall, reached):
    # the midpoint sums over 256 entry points were wrong by .03
    law, theta = ker.WallLaw(wall), np.array([0.3, 1.6, 2.5])
    assert law.exact_law is None and len(wall.pieces) > 64
    entry = (np.arange(2**16) + 0.5) / 2**16
    cosines = np.cos(law.reflect(entry[:, None], theta))
    doubt = np.abs(cosines[::2].mean(axis=0) - cosines[1::2].mean(axis=0))
    error = law.conditionals(theta, 1e-4).error
    assert np.all(np.abs(law.apply(np.cos, theta) - cosines.mean(axis=0)) <= error + doubt)
    assert error.max() < reached and doubt.max() < 3e-3


def test_means_over_resolved_polygons_with_many_pieces_are_exact():
    law, theta = ker.WallLaw(_rough(75)), np.array([0.3, 1.6, 2.5])
    assert len(law.wall.pieces) == 150 and law.exact_law is not None and law.closed_form is None
    probability, outgoing = law.exact_law.branches(theta)
    expected = np.sum(probability * np.cos(outgoing), axis=-1)
    np.testing.assert_allclose(law.apply(np.cos, theta), expected, rtol=0, atol=1e-13)
    assert np.all(np.abs(law.conditionals(theta).mean(np.cos) - expected) <= law.conditionals(theta).error)


def test_a_tolerance_of_some_roundings_is_kept():
    law = ker.WallLaw(geo.mushrooms(0.3))
    assert law.conditionals([1.0], tolerance=1e-15).error[0] < 1e-10
