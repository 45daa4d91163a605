"""Laws of walls: which shapes have a closed form, what traced rays do, and mixtures of hollows."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AccuracyError
from asperity.kernels.laws.law import Combination, sum_of
from asperity.kernels.walls.conditionals import WallConditionals
from asperity.kernels.walls.wall_law import made_of_isometries
from asperity.spectral.bounds.images import is_traced
from wall_shapes import polygon


def same(law: ker.Law, expected: ker.Law) -> bool:
    theta = np.linspace(0.1, 3.0, 20)
    return bool(np.allclose(law.apply(np.cos, theta), expected.apply(np.cos, theta), atol=1e-12))


def only_part(wall: geo.Wall) -> ker.Law:
    ((weight, law),) = ker.WallLaw(wall).parts
    assert weight == 1.0
    return law


def test_walls_with_a_closed_form_are_recognised_by_their_shape() -> None:
    assert only_part(geo.flat()) == ker.specular()
    assert only_part(geo.rectangular_teeth(1.5)) == ker.RectangularTeethLaw(1.5)
    for wall, expected in (
        (geo.triangular_teeth(0.7), ker.TriangularTeethLaw(0.7)),
        (geo.Wall.from_vertices([(0, 0), (3, -4), (6, 0)]), ker.TriangularTeethLaw(2.0 * math.atan(0.75))),
        (geo.focusing_arcs(1.2), ker.CircularArcLaw(1.2)),
        (geo.focusing_arcs(math.pi / 2).scaled(7.0), ker.CircularArcLaw(math.pi / 2)),
        (geo.focusing_arcs(1e-6), ker.CircularArcLaw(1e-6)),
        (geo.elliptical_arcs(0.9, geo.Disk()).foreshorten(geo.Disk()), ker.CircularArcLaw(0.9)),
        (geo.rectangular_teeth(0.8).mirrored(), ker.RectangularTeethLaw(0.8)),
    ):
        found = only_part(wall)
        assert type(found) is type(expected) and same(found, expected), wall


@pytest.mark.parametrize("ratio", [0.1, 2.6, 10.0])
def test_foreshortened_teeth_have_the_corrected_parameters(ratio: float) -> None:
    """r~ = (1 + m/J)^(1/2) r (S2.18, corrected) and psi~ = 2 arctan((1 + m/J)^(-1/2) tan(psi/2)) (S2.21)."""
    disk, stretch = geo.Disk(ratio, 1.0 / ratio), math.sqrt(1.0 + ratio)
    rectangles = only_part(geo.rectangular_teeth(0.8).foreshorten(disk))
    assert isinstance(rectangles, ker.RectangularTeethLaw)
    assert rectangles.height_to_width == pytest.approx(stretch * 0.8, rel=1e-14)
    triangles = only_part(geo.triangular_teeth(0.8).foreshorten(disk))
    assert isinstance(triangles, ker.TriangularTeethLaw)
    assert triangles.angle == pytest.approx(2.0 * math.atan(math.tan(0.4) / stretch), rel=1e-14)


def test_several_hollows_make_a_combination_by_their_widths() -> None:
    wall = geo.Wall.from_vertices([(0, 0), (1, -1), (2, 0), (3, 0), (3, -2), (3.5, -2), (3.5, 0), (4, 0)])
    law = sum_of(ker.WallLaw(wall).parts)
    assert isinstance(law, Combination)
    expected = 0.5 * ker.TriangularTeethLaw(math.pi / 2) + 0.25 * ker.RectangularTeethLaw(4.0) + 0.25 * ker.specular()
    assert same(law, expected)
    assert np.allclose(ker.WallLaw(wall).branches(1.0)[0].sum(), 1.0)


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
    law = ker.WallLaw(wall)
    assert law.parts == ((1.0, law),) and law.has_traced_parts
    assert made_of_isometries(law) is wall.is_polygonal
    if wall.is_polygonal:
        assert law.branches(1.0)[0].sum() == pytest.approx(1.0, abs=1e-14)


def test_rays_that_do_not_escape_are_sent_back_and_reported() -> None:
    law = ker.WallLaw(geo.triangular_teeth(math.pi / 2))
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
    assert law.isometry_table() is None and len(wall.pieces) > 64
    entry = (np.arange(2**16) + 0.5) / 2**16
    cosines = np.cos(law.reflect(entry[:, None], theta))
    uncertainty = np.abs(cosines[::2].mean(axis=0) - cosines[1::2].mean(axis=0))
    error = law.conditionals(theta, 1e-4).error
    assert np.all(np.abs(law.apply(np.cos, theta) - cosines.mean(axis=0)) <= error + uncertainty)
    assert error.max() < reached and uncertainty.max() < 3e-3


def test_means_over_resolved_polygons_with_many_pieces_are_exact():
    law, theta = ker.WallLaw(_rough(75)), np.array([0.3, 1.6, 2.5])
    assert len(law.wall.pieces) == 150 and law.isometry_table() is not None and law.has_traced_parts
    probability, outgoing = law.branches(theta)
    expected = np.sum(probability * np.cos(outgoing), axis=-1)
    np.testing.assert_allclose(law.apply(np.cos, theta), expected, rtol=0, atol=1e-13)
    assert np.all(np.abs(law.conditionals(theta).mean(np.cos) - expected) <= law.conditionals(theta).error)


def test_a_tolerance_of_some_roundings_is_kept():
    law = ker.WallLaw(geo.mushrooms(0.3))
    assert law.conditionals([1.0], tolerance=1e-15).error[0] < 1e-10


def arc(left, right, half_angle):
    radius = 0.5 * (right - left) / math.sin(half_angle)
    centre = (0.5 * (left + right), radius * math.cos(half_angle))
    ends = -0.5 * np.pi - half_angle, -0.5 * np.pi + half_angle
    return [geo.Arc(centre, radius, *ends).pinned((left, 0.0), (right, 0.0))]


TRAPEZOID = polygon((0, 0), (0.1, -0.2), (0.2, -0.2), (0.3, 0))
BEZIER = [geo.Bezier([(0.6, 0), (0.7, -0.3), (0.9, 0)])]
DOVETAIL = polygon((0, 0), (0.1, 0), (0.02, -0.2), (0.3, -0.2), (0.25, 0), (0.31, 0))
BOTTLE = [
    *polygon((0.6, 0), (0.7, 0), (0.7, -0.05), (0.65, -0.05)),
    geo.Arc((0.75, -0.05), 0.1, np.pi, 2.0 * np.pi),
    *polygon((0.85, -0.05), (0.8, -0.05), (0.8, 0), (1, 0)),
]
WALLS = {
    "straight, arc and Bezier": [*TRAPEZOID, *arc(0.3, 0.6, 1.0), *BEZIER, *polygon((0.9, 0), (1, 0))],
    "straight and arcs": [
        *TRAPEZOID,
        *arc(0.3, 0.6, 1.0),
        *arc(0.6, 0.8, 0.4),
        *polygon((0.8, 0), (0.9, -0.3), (1, 0)),
    ],
    "overhanging": [*DOVETAIL, *arc(0.31, 0.6, 1.3), *BOTTLE],
}


@pytest.fixture(params=WALLS)
def wall(request):
    return geo.Wall(WALLS[request.param])


def test_the_hollows_together_have_the_cell_masses_of_quadrature_over_the_whole_wall(wall):
    law, theta, edges = ker.WallLaw(wall), np.array([0.2, 0.9, 1.7, 2.9]), np.linspace(0.0, np.pi, 8)
    whole = WallConditionals(wall, 0, edges[1:-1])(theta, 1e-9)[0]
    found = law.conditionals(theta, 1e-9, 0, edges[1:-1])
    wrong = np.abs(found.masses(edges) - whole.masses(edges)).sum(axis=1)
    assert np.all(wrong <= 1e-12 + found.error + whole.error)


def test_the_parts_of_a_wall_have_the_best_method_of_each():
    law = ker.WallLaw(geo.Wall(WALLS["straight and arcs"]))
    assert math.fsum(weight for weight, _ in law.parts) == pytest.approx(1.0, abs=1e-14)
    kinds = {type(part): part for _, part in law.parts}
    assert set(kinds) == {ker.WallLaw, ker.CircularArcLaw, ker.TriangularTeethLaw}
    assert kinds[ker.WallLaw].isometry_table() is not None and law.isometry_table() is None
    assert not is_traced(law) and is_traced(ker.WallLaw(geo.Wall(WALLS["overhanging"])))
    assert float(ker.discretise(law, ker.Bins(16), tolerance=1e-6).error) < 1e-6


def test_walls_of_one_kind_of_hollow_or_without_room_for_their_hollows_stay_whole():
    caps = [
        *polygon(
            (0, 0), (0.4, 0), (0.4, -0.5), (0.1, -0.5), (0.1, -0.7), (0.8, -0.7), (0.8, -0.5), (0.5, -0.5), (0.5, 0)
        ),
        *polygon((0.5, 0), (0.75, 0), (0.75, -0.1), (0.65, -0.1)),
        geo.Arc((0.8, -0.1), 0.15, np.pi, 2.0 * np.pi),
        *polygon((0.95, -0.1), (0.85, -0.1), (0.85, 0), (1, 0)),
    ]
    for whole in (geo.Wall(caps), geo.mushrooms(0.3, 0.5), geo.koch(2), geo.dispersing_arcs(1.0)):
        assert len(ker.WallLaw(whole).parts) == 1


def test_the_essential_edge_of_a_mixture_is_at_least_its_straight_fraction():
    from asperity.spectral.essential.edge import essential_edge

    edge = essential_edge(ker.WallLaw(geo.Wall(WALLS["straight, arc and Bezier"])))
    assert edge.low >= 0.4 - 1e-12 and edge.high <= 1.0
