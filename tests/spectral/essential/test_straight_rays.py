"""Edges of walls with straight and curved pieces, against eigenvalues of two or three angles in closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.spectral.essential.edge import essential_edge
from asperity.spectral.essential.straight_rays import straight_part


def bent(start, end, by):
    """A curve from one point to another, bent by a vector."""
    start, end, by = map(np.array, (start, end, by))
    return geo.Bezier([tuple(p) for p in (start, start + (end - start) / 3 + by, end + (start - end) / 3 + by, end)])


def channel(slant, depth, period):
    """A slanted channel between curves, with a right angle at its end and a flat top beside it."""
    along, out = np.array([np.sin(slant), -np.cos(slant)]), -0.03 * np.array([np.cos(slant), np.sin(slant)])
    left, right = depth * along, np.array([1.0, 0.0]) + depth * along
    end = tuple(0.5 * (left + right + along))
    return geo.Wall(
        [
            bent((0, 0), left, out), geo.Segment(tuple(left), end), geo.Segment(end, tuple(right)),
            bent(right, (1, 0), -out), geo.Segment((1, 0), (period, 0)),
        ],
        period=period,
    )  # fmt: skip


def groove(depth, width, period):
    """A rectangular groove beside a shallow curve."""
    return geo.Wall(
        [
            geo.Segment((0, 0), (0, -depth)), geo.Segment((0, -depth), (width, -depth)),
            geo.Segment((width, -depth), (width, 0)), bent((width, 0), (period, 0), (0, -0.01)),
        ],
        period=period,
    )  # fmt: skip


def pocket(angle, width, depth, period):
    """A channel with a flat end which only a slanted mirror shows, between curves."""
    x, top = 0.3, -0.5 + width * abs(np.tan(angle))
    return geo.Wall(
        [
            geo.Bezier([(0, 0), (0.03, -0.6), (x - 0.05, -0.6), (x, -0.55)]),
            bent((x, -0.55), (x, -depth), (-0.01 * width, 0)), geo.Segment((x, -depth), (x + width, -depth)),
            bent((x + width, -depth), (x + width, -0.5), (0.01 * width, 0)), geo.Segment((x + width, -0.5), (x, top)),
            geo.Bezier([(x, top), (x + width + 0.1, -0.05), (period - 0.05, -0.05), (period, 0)]),
        ],
        period=period,
    )  # fmt: skip


@pytest.mark.parametrize("depth", [5, 60, 1000])
def test_a_channel_has_the_edge_of_its_axis_and_its_mirror_image_however_deep(depth):
    """Along the axis the fraction 1/period comes back by the right angle, and flat tops reflect the rest."""
    found = straight_part(ker.WallLaw(channel(0.37, depth, 1.25)))
    exact = 0.4 + np.sqrt(0.2)
    assert found.low <= exact <= found.high and found.high - found.low < 5e-5


@pytest.mark.parametrize("shape", [(0.5, 0.5, 1.0), (1.0, 0.1, 0.25), (10.0, 0.1, 0.15), (0.7, 0.3, 0.8)])
def test_a_groove_keeps_the_fraction_of_its_opening_also_near_grazing(shape):
    """Near grazing weights change within 1e-8; no orbit may take those of an angle nearby."""
    found = straight_part(ker.WallLaw(groove(*shape)))
    exact = shape[1] / shape[2]
    assert found.low - 1e-12 <= exact <= found.high and found.high - found.low < 1e-7


@pytest.mark.parametrize(("angle", "width", "depth", "period"), [(107.7, 0.1, 12.0, 0.5), (103.1, 0.1, 60.0, 0.6)])
def test_a_channel_behind_a_mirror_is_found_at_the_image_of_its_axis(angle, width, depth, period):
    wall = pocket(np.radians(angle), width, depth, period)
    # rays along the axis hit the mirror, the end and the mirror again, and return; a grid counts them
    theta, number = 2.0 * np.radians(angle) - 0.5 * np.pi, 2**16
    out = geo.trace(wall, period * (np.arange(number) + 0.5) / number, np.full(number, theta)).theta
    counted = np.mean(np.abs(out - theta) < 1e-9)
    found = straight_part(ker.WallLaw(wall))
    assert counted > 0.1
    assert found.low - 4.0 / number <= counted <= found.high + 4.0 / number and found.high - found.low < 1e-5


def test_many_straight_pieces_have_a_top_between_quotients_and_suprema():
    """Orbits have too many angles; the best pair of angles known from a plain search has the eigenvalue .861340."""
    rng = np.random.default_rng(12)
    y = np.minimum(-rng.random(15), -0.01)
    y[[0, -1]] = 0.0
    points = list(zip((np.arange(15) / 14).tolist(), y.tolist(), strict=True))
    pieces = [geo.Segment(*pair) for pair in itertools.pairwise(points)]
    for k in (6, 13):
        normal = np.array([pieces[k].start[1] - pieces[k].end[1], pieces[k].end[0] - pieces[k].start[0]])
        pieces[k] = bent(pieces[k].start, pieces[k].end, 0.02 * rng.choice([-1, 1]) * normal)
    found = straight_part(ker.WallLaw(geo.Wall(pieces)))
    assert 0.86133 < found.low <= found.high < 0.87 and found.fraction < found.low


def test_nearly_straight_curves_are_curves():
    """However little it is bent, a curve turns rays by angles that depend on where they hit it."""
    bowl = [geo.Segment((0, 0), (0.3, -0.4)), geo.Segment((0.3, -0.4), (0.7, -0.4))]
    for by in (1e-3, 1e-6, 1e-9):
        found = straight_part(ker.WallLaw(geo.Wall([*bowl, bent((0.7, -0.4), (1, 0), (0, by))])))
        assert found.high < 0.95
    straight = ker.WallLaw(geo.Wall([*bowl, bent((0.7, -0.4), (1, 0), (0, 0))]))
    assert straight.wall.cell.pieces == (*bowl, geo.Segment((0.7, -0.4), (1, 0)))
    assert straight.isometry_table() is not None and essential_edge(straight).value == 1.0


def test_straight_curves_are_sides_of_walls_that_do_not_close_too():
    """A floor of two sides below a round island, drawn with segments and with curves that are straight."""
    island = [geo.Arc((0.5, -0.4), (0.1, 0.1), 0.0, -2.0 * np.pi)]
    ends = [(0, -1), (0.6, -1.1), (1, -1)]
    found = [
        straight_part(ker.WallLaw(geo.Wall([side(*ends[:2]), side(*ends[1:])], islands=[island])))
        for side in (geo.Segment, lambda a, b: bent(a, b, (0, 0)))
    ]
    assert found[0] == found[1] and found[0].low > 0.5
