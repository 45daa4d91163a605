"""Polygonal bodies: Cauchy's formula, involution, zero resistance, invisibility; the spinning disk."""

import numpy as np
import pytest
from scipy.special import ellipe

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.aerodynamics.drag import integral

RNG = 20_260_401
TRIANGLE = ker.PolygonalBody([[(0.0, 0.0), (2.0, 0.0), (0.3, 1.1)]])
# a slotted block, which is not convex
SLOT = ker.PolygonalBody([[(0, 0), (3, 0), (3, 2), (2, 2), (2, 0.5), (1, 0.5), (1, 2), (0, 2)]])


def convex_force(polygon, angle):
    """Of a convex polygon by its lit sides: each particle transfers twice its normal momentum."""
    stream = -np.array([np.cos(angle), np.sin(angle)])
    total = np.zeros(2)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        side = end - start
        normal = np.array([side[1], -side[0]]) / np.hypot(*side)
        onto = -stream @ normal
        if onto > 0.0:
            total += -2.0 * np.hypot(*side) * onto**2 * normal
    return total @ stream, total @ np.array([-stream[1], stream[0]])


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3, 2.9, 4.4])
def test_the_force_on_a_convex_body_is_that_of_its_lit_sides(angle):
    along, across = convex_force(TRIANGLE.polygons[0], angle)
    hits = 0
    for seed in range(20):
        force = TRIANGLE.force(angle, 400, rng=seed)
        for number, exact in ((force.along, along), (force.across, across)):
            hits += int(abs(float(number) - exact) <= number.error)
        assert force.along.error < 0.1
    # 40 intervals
    assert hits >= 36


def test_a_body_of_zero_resistance_leaves_a_stream_as_it_is():
    body = ker.zero_resistance_body()
    x = np.random.default_rng(RNG).uniform(-1.0, 1.0, 3_000)
    start = np.stack([x, np.full(x.size, 5.0)], axis=1)
    out = body.scatter(start, np.tile([0.0, -1.0], (x.size, 1)))
    assert np.max(np.abs(out.velocity - [0.0, -1.0])) < 1e-14
    met = np.abs(x) > 0.5
    assert np.all(out.reflections == np.where(met, 2, 0))
    # but the particles leave on other lines, so that the body can be seen
    assert np.all(np.abs(out.position[met, 0] - x[met]) > 0.1)
    # the stream in the opposite direction and along x
    assert float(body.force(-np.pi / 2).along) < 1e-13
    sideways = body.force(0.0)
    assert float(sideways.along) - sideways.along.error > 0.5


def test_an_invisible_body_returns_every_particle_to_its_line():
    body = ker.invisible_body()
    for angle in (np.pi / 2, -np.pi / 2):
        force = body.force(angle, 2_000, rng=RNG)
        assert float(force.along) < 1e-13 and force.unchanged == 1.0 and force.width == pytest.approx(2.0)
    x = np.random.default_rng(RNG).uniform(-1.0, 1.0, 1_000)
    out = body.scatter(np.stack([x, np.full(x.size, 5.0)], axis=1), np.tile([0.0, -1.0], (x.size, 1)))
    assert np.max(np.abs(out.position[:, 0] - x)) < 1e-13
    assert np.all(out.reflections == np.where(np.abs(x) > 0.5, 4, 0))
    tilted = body.force(np.pi / 2 + 0.1)
    assert float(tilted.along) > 3.0 * tilted.along.error and tilted.unchanged < 0.9
    # one triangle less is seen
    part = ker.PolygonalBody(body.polygons[:3]).force(np.pi / 2)
    assert part.unchanged < 0.8


REGIONS = {
    "polygon": geo.Container.polygon([(-3, -2), (4, -2), (5, 3), (0, 5)]),
    "ellipse": geo.Container.ellipse(5.0, 4.0),
    "stadium": geo.Container.stadium(2.0, 4.0),
}


@pytest.mark.parametrize(
    ("body", "region"),
    [(SLOT, "circle"), (TRIANGLE, "polygon"), (ker.zero_resistance_body(), "ellipse"), (SLOT, "stadium")],
)
def test_scattering_in_a_convex_region_is_an_involution_that_preserves_the_flux(body, region):
    n, centre, radius = 20_000, (0.5, 0.6), 4.0
    if region == "circle":
        before, after = body.scatter_in_circle(n, RNG, centre, radius)
        size = radius * (1.0 + 1e-12)
        around = geo.Container.from_curves([geo.Arc(centre, size, 0.0, 2.0 * np.pi)])
        again = body._through_region(after * [size, 1.0], around) / [size, 1.0]
        period = 2.0 * np.pi
    else:
        around = REGIONS[region].closed()
        before, after = body.scatter_in(REGIONS[region], n, RNG)
        again, period = body._through_region(after, around), around.perimeter
    turn = np.abs(np.exp(2j * np.pi * (again[:, 0] - before[:, 0]) / period) - 1.0)
    close = (turn < 1e-8) & (np.abs(again[:, 1] - before[:, 1]) < 1e-8)
    assert close.mean() > (0.9995 if region == "circle" else 0.999)
    # the outgoing states have the distribution of the incoming ones, ds sin(theta) d theta
    place, theta = 2.0 * np.pi * after[:, 0] / period, after[:, 1]
    assert np.all((theta > 0.0) & (theta < np.pi))
    for values, exact in (
        (np.cos(theta), 0.0), (np.cos(theta) ** 2, 1 / 3), (np.cos(place) * np.sin(theta), 0.0),
        (np.cos(place), 0.0), (np.sin(place), 0.0),
    ):  # fmt: skip
        assert abs(values.mean() - exact) < 4.5 * values.std() / np.sqrt(n)


def test_the_fraction_of_lines_that_meet_a_convex_body_is_its_perimeter_over_that_of_the_circle():
    """Cauchy and Crofton; and the mean momentum transfer is 8/3 of the perimeter, in any circle around the body."""
    perimeter = np.sum(np.hypot(*(np.roll(TRIANGLE.polygons[0], -1, axis=0) - TRIANGLE.polygons[0]).T))
    for radius in (2.5, 5.0):
        n = 60_000
        before, after = TRIANGLE.scatter_in_circle(n, RNG, (0.5, 0.5), radius)
        incoming = before.sum(axis=1) - 0.5 * np.pi
        outgoing = after.sum(axis=1) - 0.5 * np.pi
        cost = 1.0 + np.cos(outgoing - incoming)
        met = cost > 1e-12
        fraction = perimeter / (2.0 * np.pi * radius)
        assert abs(met.mean() - fraction) < 4.5 * np.sqrt(fraction * (1 - fraction) / n)
        # 2 perimeter(C) E[cost] = (8/3) perimeter(B)
        scaled = 2.0 * 2.0 * np.pi * radius * cost
        assert abs(scaled.mean() - 8.0 / 3.0 * perimeter) < 4.5 * scaled.std() / np.sqrt(n)


@pytest.mark.parametrize("spin", [-0.7, 0.0, 0.2, 1.0, 3.0])
def test_forces_on_a_spinning_disk_of_mirrors_and_retroreflectors_are_known(spin):
    mixed = ker.spin_force(0.25 * ker.retroreflection() + 0.75 * ker.specular(), spin, radius=2.0)
    assert float(mixed.along) == pytest.approx(2.0 * (1.0 + 2.0), abs=1e-9)
    assert float(mixed.across) == pytest.approx(2.0 * 0.25 * np.pi * spin, abs=1e-9)
    assert float(mixed.torque) == pytest.approx(-4.0 * 4.0 * 0.25 * spin, abs=1e-9)


@pytest.mark.parametrize("law", [ker.TriangularTeethLaw(0.9), ker.CircularArcLaw(1.2)], ids=repr)
def test_the_spin_force_has_the_symmetry_of_the_cell_and_the_limit_without_spin(law):
    plus, minus, still = (ker.spin_force(law, spin) for spin in (0.4, -0.4, 0.0))
    for name, sign in (("along", 1.0), ("across", -1.0), ("torque", -1.0)):
        one, other = getattr(plus, name), getattr(minus, name)
        assert abs(float(one) - sign * float(other)) <= one.error + other.error + 1e-9
    body = ker.RoughBody.disk(law).force(0.0)
    assert abs(still.along.value - body.along.value) <= still.along.error + body.along.error < 1e-6
    assert abs(still.across.value) <= still.across.error + 1e-9
    # rough disks have the inverse Magnus effect, and their spin is braked
    assert float(plus.across) > 0.0 > float(plus.torque)


@pytest.mark.parametrize(
    ("law", "points"),
    [(ker.lambertian(), 10_000), (ker.RectangularTeethLaw(2.0), 200_000), (ker.TriangularTeethLaw(0.3), 200_000)],
    ids=repr,
)
def test_reported_errors_of_spin_forces_hold(law, points):
    """Against a midpoint rule in the coordinates of the plane, at spins for which kinks lie anywhere."""
    phi = np.pi * ((np.arange(points) + 0.5) / points - 0.5)
    normal, tangent = np.stack([np.cos(phi), np.sin(phi)]), np.stack([-np.sin(phi), np.cos(phi)])
    for spin in np.random.default_rng(RNG).uniform(-1.5, 1.5, 4):
        relative = np.array([[-1.0], [0.0]]) - spin * tangent
        theta = np.arctan2(-np.sum(relative * normal, axis=0), np.sum(relative * tangent, axis=0))
        speed = np.hypot(*relative)
        push = relative - speed * (law.apply(np.sin, theta) * normal - law.apply(np.cos, theta) * tangent)
        weight = np.cos(phi) * np.pi / phi.size
        found = ker.spin_force(law, float(spin))
        exact = (-push[0] @ weight, -push[1] @ weight, np.sum(push * tangent, axis=0) @ weight)
        for number, value in zip((found.along, found.across, found.torque), exact, strict=True):
            assert abs(float(number) - value) <= number.error + 2e-7


def test_laws_that_differ_along_a_body_add_their_parts():
    rough, smooth = ker.retroreflection(), ker.specular()
    body = ker.RoughBody.disk(lambda normal: rough if normal < np.pi else smooth)
    # 8/3 of the perimeter 2 pi, times (3/2 + 1)/2
    assert float(body.resistance()) == pytest.approx(8.0 / 3.0 * 2.0 * np.pi * 1.25, abs=1e-9)
    cost = body.resistance(cost=lambda u, v: 1.0 + np.cos(u - v))
    assert float(cost) == pytest.approx(float(body.resistance()), abs=cost.error + 1e-9)
    # a stream from above meets the rough half only, from below the smooth one
    # from the side the rough half sends momentum back along the stream, the smooth half pushes to the rough side
    for angle, exact in ((np.pi / 2, (4.0, 0.0)), (-np.pi / 2, (8.0 / 3.0, 0.0)), (0.0, (10.0 / 3.0, -2.0 / 3.0))):
        force = body.force(angle)
        for number, value in zip((force.along, force.across), exact, strict=True):
            assert abs(number.value - value) <= number.error < 1e-7
    u, v, n = body.sample(4_000, rng=RNG)
    turned = np.abs(np.angle(np.exp(1j * (u - v)))) < 1e-9
    assert np.array_equal(turned[np.abs(n - np.pi) > 1e-3], (n < np.pi)[np.abs(n - np.pi) > 1e-3])


def test_a_direction_measure_weights_the_forces_of_streams():
    """The integral over directions of chi(u) force(u), by a rule in the directions."""
    body = ker.RoughBody.ellipse(ker.maxwell(0.5), 2.0, 1.0)

    def chi(u):
        return 1.0 + 0.5 * np.cos(2.0 * u)

    found = body.resistance(directions=chi)
    angles = 2.0 * np.pi * np.arange(48) / 48
    exact = 2.0 * np.pi * np.mean([chi(angle) * body.force(angle).along.value for angle in angles])
    assert float(found) == pytest.approx(exact, rel=1e-9)


# ---- rough bodies ------------------------------------------------------------------------------------------------
ROUGH, SMOOTH = ker.retroreflection(), ker.specular()


@pytest.mark.parametrize(("a", "b"), [(40.0, 1.0), (1.0, 1000.0), (1e-3, 2e-3), (3e5, 1.0)])
def test_the_resistance_of_an_ellipse_of_any_ratio_is_its_perimeter_times_that_of_the_law(a, b):
    exact = 4.0 * max(a, b) * ellipe(1.0 - (min(a, b) / max(a, b)) ** 2)
    body = ker.RoughBody.ellipse(ROUGH, a, b)
    assert abs(body.perimeter.value - exact) <= body.perimeter.error <= 1e-8 * exact
    found = body.resistance()
    assert abs(found.value - 4.0 * exact) <= found.error <= 1e-7 * exact
    # all particles within the width 2 b go back
    force = body.force(0.0)
    assert abs(force.along.value - 4.0 * b) <= force.along.error <= 1e-7 * exact


@pytest.mark.parametrize("ends", [(0.3, 1.234), (2.0, 2.002), (6.0, 6.28318)])
def test_a_strip_of_another_law_counts_with_its_length(ends):
    low, high = ends
    body = ker.RoughBody.disk(lambda normal: ROUGH if low < normal < high else SMOOTH)
    exact = 8.0 / 3.0 * (2.0 * np.pi + 0.5 * (high - low))
    for found in (body.resistance(), body.resistance(cost=lambda u, v: 1.0 + np.cos(u - v))):
        assert abs(found.value - exact) <= found.error < 1e-7
    # all particles that meet the strip from the direction of its middle go back: 2 cos instead of 2 cos^3
    width = 0.5 * (high - low)
    force = body.force(0.5 * (low + high))
    more = 2.0 * (2.0 * np.sin(width)) - 2.0 * (2.0 * np.sin(width) - 2.0 * np.sin(width) ** 3 / 3.0)
    assert abs(force.along.value - 8.0 / 3.0 - more) <= force.along.error < 1e-7


def test_a_narrow_strip_between_breakpoints_counts_beside_a_law_that_varies():
    ends = np.array([1.0, 1.0 + 1e-6])

    def law(normal):
        part = 0.5 + 0.5 * np.sin(normal)
        return ROUGH if ends[0] < normal < ends[1] else part * ROUGH + (1.0 - part) * SMOOTH

    body = ker.RoughBody.disk(law, breakpoints=ends)
    found = body.resistance(tolerance=1e-12)
    # the mean part is 1/2, the strip has 1
    exact = 8.0 / 3.0 * (2.5 * np.pi + 0.5 * np.sum(np.diff(ends) * 0.5 + 0.5 * np.diff(np.cos(ends))))
    assert abs(found.value - exact) <= found.error < 1e-9


def test_integrals_hold_for_any_jump_kink_and_strip():
    edges, rng = np.linspace(0.0, 2.0 * np.pi, 49), np.random.default_rng(RNG)
    for at, width in zip(rng.uniform(0.0, 5.0, 200), 10.0 ** rng.uniform(-1.7, 0.0, 200), strict=True):
        kinds = (
            (lambda n, at=at: n > at, 2.0 * np.pi - at),
            (lambda n, at=at: np.maximum(n - at, 0.0), 0.5 * (2.0 * np.pi - at) ** 2),
            (lambda n, at=at, width=width: (n > at) & (n < at + width), width),
        )
        for function, exact in kinds:
            for tolerance in (1e-2, 1e-9):
                (value,), (error,), _ = integral(
                    lambda n, f=function: np.stack([f(n), 1e-14 + 0.0 * n]), edges, tolerance
                )
                assert abs(value - exact) <= error < tolerance


def test_normals_of_samples_are_distributed_as_lengths():
    u, v, n = ker.RoughBody.ellipse(ROUGH, 40.0, 1.0).sample(50_000, RNG)
    perimeter = 160.0 * ellipe(1.0 - 1.0 / 1600.0)
    # half of the perimeter projected along both axes is twice the other axis
    for values, exact in ((np.abs(np.sin(n)), 160.0 / perimeter), (np.abs(np.cos(n)), 4.0 / perimeter)):
        assert abs(values.mean() - exact) < 4.5 * values.std() / np.sqrt(n.size)
    assert np.unique(n).size == n.size and np.allclose(u, v)
    rounded = ker.RoughBody(np.pi * np.array([0.5, 1.5]), [2.0, 2.0], SMOOTH, radius=lambda n: 0.5 + 0.0 * n)
    _, _, n = rounded.sample(20_000, RNG)
    flat = np.isclose(np.abs(np.sin(n)), 1.0, atol=1e-15)
    fraction = 4.0 / (4.0 + np.pi)
    assert abs(flat.mean() - fraction) < 4.5 * np.sqrt(fraction * (1.0 - fraction) / n.size)


def test_a_polygon_may_have_vertices_on_its_sides():
    law = [ROUGH, SMOOTH, SMOOTH, SMOOTH, SMOOTH]
    body = ker.RoughBody.polygon(law, [(0, 0), (0.5, 0), (1, 0), (1, 1), (0, 1)])
    found = body.force(-np.pi / 2)
    assert abs(found.along.value - 2.0) <= found.along.error < 1e-12
    assert body.resistance().value == pytest.approx(8.0 / 3.0 * 4.25, abs=1e-9)
