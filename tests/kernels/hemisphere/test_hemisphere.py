"""Laws on the half sphere of velocities: closed forms, invariants, and rays in three dimensions."""

from pathlib import Path

import numpy as np
import pytest
from campaigns.judges.plain_facets import flown

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError

RNG = 20_260_401
ROUGH, SMOOTH, RETRO = (ker.HemisphereLaw(law) for law in (ker.lambertian(), ker.specular(), ker.retroreflection()))
ARCS = ker.HemisphereLaw(ker.CircularArcLaw(1.2))
# Not mirror-symmetric: its planar law is reversible in the paper's convention only.
LEANING = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)]))
LARGEST_Z = 4.5


def cosine_law(rng, count):
    """Incoming velocities of speed 1: uniform on the disc of tangential velocities."""
    radius, phi = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return np.column_stack([radius * np.cos(phi), radius * np.sin(phi), -np.sqrt(1 - radius**2)])


def z_score(values, wanted):
    return (np.mean(values) - wanted) / (np.std(values) / np.sqrt(len(values)) + 1e-15)


def scores_of_entries(incoming, outgoing, matrix):
    """z-scores of the means of f_i(v) f_j(v') against all entries of a matrix."""
    before, after = (matrix.basis.evaluate(velocity[:, :2]) for velocity in (incoming, outgoing))
    mean, square = before.T @ after / len(before), (before**2).T @ after**2 / len(before)
    return (mean - matrix.symmetric) / np.sqrt(np.maximum(square - mean**2, 1e-24) / len(before))


@pytest.mark.parametrize("order", [0, 1, 2, 5])
def test_lambertian_grooves_of_random_direction_have_the_eigenvalue_of_the_degree(order):
    block = ROUGH.matrix(13, order)
    np.testing.assert_array_equal(block.degrees, np.arange(order, 14, 2))
    np.testing.assert_allclose(block.symmetric, np.diag(1 / (block.degrees + 1)), atol=1e-14)
    assert block.error.value < 1e-12


def test_zernike_functions_are_orthonormal_and_those_of_low_degree_are_known():
    basis = ker.Zernike(9)
    np.testing.assert_allclose(basis.project(lambda at: np.ones(at.shape[:-1])), basis.constant, atol=1e-14)
    coefficients = [basis.project(lambda at, i=i: basis.evaluate(at)[..., i]) for i in range(basis.size)]
    np.testing.assert_allclose(coefficients, np.eye(basis.size), atol=1e-13)
    x, y = np.array([[0.3, -0.9, 0.0], [0.2, 0.1, 0.0]])
    square = x * x + y * y
    known = [
        np.ones(3), 2 * y, 2 * x, np.sqrt(6) * 2 * x * y, np.sqrt(3) * (2 * square - 1), np.sqrt(6) * (x * x - y * y),
        np.sqrt(8) * (3 * x * x * y - y**3), np.sqrt(8) * (3 * square - 2) * y,
    ]  # fmt: skip
    np.testing.assert_allclose(basis.evaluate(np.stack([x, y], axis=-1))[:, :8], np.transpose(known), atol=1e-14)
    coarse, embedding = basis.coarsened()
    assert coarse == ker.Zernike(4) != basis and embedding.shape == (15, 55)


@pytest.mark.parametrize("orientation", ["random", 0.4])
def test_a_smooth_wall_is_the_identity(orientation):
    law = ker.HemisphereLaw(ker.specular(), orientation)
    matrix = ker.discretise(law, ker.Zernike(7))
    np.testing.assert_allclose(matrix.symmetric, np.eye(36), atol=1e-14)
    velocity = cosine_law(np.random.default_rng(RNG), 100)
    np.testing.assert_allclose(law.sample(velocity, rng=0), velocity * [1, 1, -1], atol=1e-14)


@pytest.mark.parametrize("orientation", [0.0, 0.7])
def test_retroreflecting_grooves_of_a_fixed_direction_turn_the_velocity_across(orientation):
    law = ker.HemisphereLaw(ker.retroreflection(), orientation)
    along = np.array([np.cos(orientation), np.sin(orientation)])
    turned = 2 * np.outer(along, along) - np.eye(2)
    velocity = cosine_law(np.random.default_rng(RNG), 50)
    outgoing = law.sample(velocity, rng=0)
    np.testing.assert_allclose(outgoing[:, :2], velocity[:, :2] @ turned, atol=1e-14)
    basis = ker.Zernike(5)
    image = ker.discretise(law, basis).symmetric @ np.eye(basis.size)[:, 11]
    np.testing.assert_allclose(
        basis.evaluate(velocity[:, :2]) @ image, basis.evaluate(outgoing[:, :2])[:, 11], atol=1e-13
    )


def test_the_direction_of_a_leaning_profile_is_that_of_the_documentation():
    """Grooves along y have the wall's x along x: against rays of the planar tracer."""
    velocity = np.tile([0.3, 0.4, -0.5], (2000, 1))
    outgoing = ker.HemisphereLaw(LEANING, np.pi / 2).sample(velocity, rng=RNG)
    rays = geo.trace(
        geo.Wall.from_vertices([(0, 0), (0.2, -0.4), (1, 0)]),
        np.random.default_rng(RNG + 1).random(2000),
        np.full(2000, np.arctan2(0.5, -0.3)),
    )
    across = np.hypot(0.3, 0.5) * np.cos(rays.theta)
    spread = np.hypot(across.std(), outgoing[:, 0].std()) / np.sqrt(2000)
    assert abs(outgoing[:, 0].mean() - across.mean()) < LARGEST_Z * spread
    # leaning the other way the mean is another one
    other = ker.HemisphereLaw(LEANING, -np.pi / 2).sample(velocity, rng=RNG)[:, 0]
    assert abs(other.mean() - across.mean()) > 4 * LARGEST_Z * spread


@pytest.mark.parametrize("law", [ARCS, ker.HemisphereLaw(LEANING), 0.5 * ARCS + 0.5 * ROUGH])
def test_laws_of_random_direction_are_symmetric_and_contract(law):
    assert law.reversible and law.rotation_invariant
    matrix = ker.discretise(law, ker.Zernike(6), tolerance=1e-6)
    np.testing.assert_allclose(matrix.symmetric, matrix.symmetric.T, atol=1e-15)
    np.testing.assert_allclose(matrix.symmetric[0], np.eye(28)[0], atol=1e-6)
    assert np.abs(np.linalg.eigvalsh(matrix.symmetric)).max() < 1 + 1e-6
    # the blocks of the orders are those of the whole matrix, once for the sines and once for the cosines
    for order in (0, 1, 4):
        block = law.matrix(6, order, tolerance=1e-6)
        for sign in {order, -order}:
            here = matrix.basis.orders == sign
            np.testing.assert_allclose(matrix.symmetric[np.ix_(here, here)], block.symmetric, atol=1e-14)


def test_a_law_given_in_the_other_convention_is_the_same_law():
    planar = ker.CircularArcLaw(1.2)
    both = [ker.HemisphereLaw(law).matrix(4, 2, tolerance=1e-8) for law in (planar, planar.in_specular_frame())]
    np.testing.assert_array_equal(both[0].symmetric, both[1].symmetric)
    velocity = cosine_law(np.random.default_rng(RNG), 50)
    first, second = (
        ker.HemisphereLaw(law, 0.3).sample(velocity, rng=1) for law in (planar, planar.in_specular_frame())
    )
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("law", [ARCS, ker.HemisphereLaw(LEANING, 0.7), 0.3 * ARCS + 0.7 * ROUGH, ROUGH @ RETRO])
def test_samples_keep_the_cosine_law_the_speed_and_what_the_matrix_says(law):
    rng, count = np.random.default_rng(RNG), 40_000
    speed = np.exp(rng.normal(size=(count, 1)))
    incoming = cosine_law(rng, count)
    outgoing = law.sample(speed * incoming, rng=rng) / speed
    np.testing.assert_allclose(np.sum(outgoing**2, axis=1), 1.0, rtol=1e-13)
    assert np.all(outgoing[:, 2] > 0)
    basis = ker.Zernike(3)
    scores = [z_score(values, 0.0) for values in basis.evaluate(outgoing[:, :2])[:, 1:].T]
    assert np.abs(scores).max() < LARGEST_Z
    matrix = ker.discretise(law, basis, tolerance=1e-6)
    assert np.abs(scores_of_entries(incoming, outgoing, matrix)).max() < LARGEST_Z


@pytest.mark.parametrize("scale", [5e-324 / 0.5, 1e-300, 1e300, 1.7e308])
def test_speeds_of_every_size_are_kept(scale):
    outgoing = ARCS.sample(scale * np.array([[0.5, 0.7, -0.5]]), rng=0)
    size = np.linalg.norm(outgoing / scale)
    assert size == pytest.approx(np.linalg.norm([0.5, 0.7, 0.5]), rel=1e-12) or scale < 1e-307


def test_semicircular_grooves_agree_with_rays_in_three_dimensions():
    rng = np.random.default_rng(RNG)
    incoming = cosine_law(rng, 100_000)
    outgoing = reflected_in_semicircles(incoming, rng)
    law = ker.HemisphereLaw(ker.CircularArcLaw(np.pi / 2))
    accommodated = 1 - 2 * np.sum(incoming[:, :2] * outgoing[:, :2], axis=1)
    coefficients = spec.accommodation(law, tolerance=1e-6)
    assert abs(z_score(accommodated, float(coefficients.tangential))) < LARGEST_Z
    normal = 1 - 18 * (-incoming[:, 2] - 2 / 3) * (outgoing[:, 2] - 2 / 3)
    assert abs(z_score(normal, float(coefficients.normal))) < LARGEST_Z
    # all directions are alike for the mean over an order; those of a fixed direction are told apart
    basis = ker.Zernike(4)
    products = basis.evaluate(incoming[:, :2]) * basis.evaluate(outgoing[:, :2])
    fixed = ker.discretise(ker.HemisphereLaw(law.law, np.pi / 2), basis, tolerance=1e-6)
    assert np.abs(scores_of_entries(incoming, outgoing, fixed)).max() < LARGEST_Z
    for order in (0, 1, 2, 3):
        for k, degree in enumerate(range(order, 5, 2)):
            of_order = products[:, (np.abs(basis.orders) == order) & (basis.degrees == degree)].mean(axis=1)
            wanted = law.matrix(4, order, tolerance=1e-6).symmetric[k, k]
            assert abs(z_score(of_order, wanted)) < LARGEST_Z


def reflected_in_semicircles(incoming, rng):
    """Outgoing velocities of rays that enter half cylinders of radius 1/2 along y through z = 0, 0 < x < 1."""
    velocity = incoming.copy()
    at = np.column_stack([rng.random(len(velocity)), np.zeros((len(velocity), 2))])
    inside = np.arange(len(velocity))
    while inside.size:
        p, v = at[inside], velocity[inside]
        x, z = p[:, 0] - 0.5, p[:, 2]
        a, half, c = v[:, 0] ** 2 + v[:, 2] ** 2, x * v[:, 0] + z * v[:, 2], x * x + z * z - 0.25
        time = (-half + np.sqrt(np.maximum(half * half - a * c, 0))) / a
        normal = -2 * np.column_stack([x + time * v[:, 0], 0 * x, z + time * v[:, 2]])
        leaves = (z + time * v[:, 2] > 0) & (v[:, 2] > 0)
        inside, p, v, normal, time = inside[~leaves], p[~leaves], v[~leaves], normal[~leaves], time[~leaves]
        at[inside] = p + time[:, None] * v
        velocity[inside] = v - 2 * np.sum(v * normal, axis=1)[:, None] * normal
    return velocity


def table_of_named_walls():
    """Rows of the page: (value, error) of gap, tangential and normal accommodation, and the verdict, by wall."""
    page = (Path(__file__).parents[3] / "docs" / "theory" / "three-dimensions.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.count(" | ") == 4]
    return {row[0]: (number(row[1]), row[2], number(row[3]), number(row[4])) for row in rows if row[0] in geo.WALLS}


def number(text):
    """0.5776(11) as value and error; what is printed without error is exact but for rounding."""
    plain, _, units = text.rstrip(")").partition("(")
    digits = len(plain.partition(".")[2])
    return float(plain), float(units) * 10.0**-digits if units else 1e-12


CHEAP = ("flat", "triangular-teeth", "rectangular-teeth", "focusing-arcs")


@pytest.mark.parametrize("name", [
    name if name in CHEAP else pytest.param(name, marks=pytest.mark.slow) for name in geo.WALLS
])  # fmt: skip
def test_the_table_of_named_walls_is_that_of_its_snippet(name):
    rows = table_of_named_walls()
    assert list(rows) == list(geo.WALLS)
    gap, verdict, tangential, normal = rows[name]
    H = ker.HemisphereLaw(ker.WallLaw(geo.WALLS[name].build()))
    own = spec.spectral_gap(H, tolerance=1e-3)
    found = spec.accommodation(H, tolerance=1e-5)
    assert own.verdict == verdict
    for fresh, (value, error) in ((own, gap), (found.tangential, tangential), (found.normal, normal)):
        assert abs(fresh.value - value) <= error and fresh.error <= 1.5 * error


@pytest.mark.parametrize("law", [ker.TriangularTeethLaw(0.5), ker.TriangularTeethLaw(0.7), ker.CircularArcLaw(0.4)])
def test_the_error_of_a_gap_holds_where_low_degrees_change_little(law):
    H = ker.HemisphereLaw(law)
    fine = min(1 - np.linalg.eigvalsh(H.matrix(40, m).symmetric[0 if m else 1 :, 0 if m else 1 :])[-1] for m in (0, 1))
    for tolerance in (1e-2, 1e-3):
        found = spec.spectral_gap(H, tolerance=tolerance)
        assert abs(found.value - fine) < found.error


def test_tangential_accommodation_is_half_the_planar_one():
    found = spec.accommodation(ARCS)
    assert float(found.tangential) == pytest.approx(0.663779, abs=5e-7)
    planar = spec.accommodation(ARCS.law)
    assert float(found.tangential) == pytest.approx(0.5 * float(planar.tangential), abs=1e-12)
    assert found.tangential.error == pytest.approx(0.5 * planar.tangential.error, rel=1e-6)
    assert 1 - ARCS.matrix(1, 1).symmetric[0, 0] == pytest.approx(float(found.tangential), abs=1e-9)
    mixture = spec.accommodation(0.25 * SMOOTH + 0.75 * RETRO)
    assert [float(x) for x in (mixture.tangential, mixture.normal)] == pytest.approx([0.75, 0.0], abs=1e-13)
    assert float(mixture.maxwell_fraction) == pytest.approx(0.675, abs=1e-13)


def test_normal_accommodation_of_lambertian_grooves_is_that_of_one_integral():
    b, weight = np.polynomial.legendre.leggauss(60)
    # E[v_n' | b] = pi sqrt(1 - b^2)/4, and v_n' is independent of v_n given b
    correlation = np.sum(weight * 2 / np.pi * np.sqrt(1 - b * b) * (np.pi / 4) ** 2 * (1 - b * b))
    wanted = 1 - 18 * (correlation - 4 / 9)
    assert float(spec.accommodation(ROUGH).normal) == pytest.approx(wanted, abs=1e-5)


def test_the_matrix_of_a_product_is_the_product_where_polynomials_are_kept_and_near_it_elsewhere():
    lambertian = ROUGH.matrix(6, 2).symmetric
    np.testing.assert_allclose((ROUGH @ ROUGH).matrix(6, 2).symmetric, lambertian @ lambertian, atol=1e-14)
    product, arcs = (ARCS @ ROUGH).matrix(6, 2, tolerance=1e-8), ARCS.matrix(6, 2, tolerance=1e-8)
    np.testing.assert_allclose(product.symmetric, arcs.symmetric @ lambertian, atol=1e-8)
    twice, finer = (law.matrix(degree, 1, tolerance=1e-6) for law, degree in ((ARCS @ ARCS, 3), (ARCS, 17)))
    wanted = (finer.symmetric @ finer.symmetric)[:2, :2]
    assert np.linalg.norm(twice.symmetric - wanted, 2) <= twice.error.value < 0.02
    assert (ARCS @ ROUGH).reversible is None and (ROUGH @ ARCS @ ROUGH).reversible


def test_one_fixed_direction_is_a_planar_product():
    planar = ker.henyey_greenstein(0.5)
    twice = ker.HemisphereLaw(planar, 0.3) @ ker.HemisphereLaw(planar, 0.3)
    composed = planar.in_specular_frame() @ planar.in_specular_frame()
    found, wanted = (ker.discretise(law, ker.Zernike(5)).symmetric for law in (twice, ker.HemisphereLaw(composed, 0.3)))
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_gaps_are_between_half_the_planar_gap_and_the_quotients_of_polynomials():
    assert float(spec.spectral_gap(ROUGH)) == pytest.approx(0.5, abs=1e-13)
    mixture = spec.spectral_gap(0.3 * ROUGH + 0.7 * SMOOTH)
    assert float(mixture) == pytest.approx(0.15, abs=1e-12) and mixture.verdict == "isolated"
    coarse = spec.spectral_gap(ARCS, tolerance=3e-3)
    assert coarse.verdict == "isolated" and coarse.convention == "specular"
    # with degree 32
    assert abs(float(coarse) - 0.57755) < coarse.error
    top = np.linalg.eigvalsh(ARCS.matrix(17, 1, tolerance=1e-6).symmetric)[-1]
    assert float(coarse) - coarse.error < 1 - top <= float(coarse) + 1e-6
    # half the planar gap is attained: scattering forward has the eigenfunction cos(theta)
    scattering = spec.spectral_gap(ker.HemisphereLaw(ker.henyey_greenstein(-0.5)))
    assert scattering.value == pytest.approx(0.25, abs=1e-9)


def test_grooves_of_one_direction_have_no_gap_and_those_of_two_may():
    fixed = ker.HemisphereLaw(ker.lambertian(), 0.3)
    assert spec.spectral_gap(fixed).verdict == "no gap" == spec.spectral_gap(fixed @ fixed).verdict
    crossed = 0.5 * ker.HemisphereLaw(ker.lambertian(), 0.0) + 0.5 * ker.HemisphereLaw(ker.lambertian(), np.pi / 2)
    found = spec.spectral_gap(crossed)
    assert found.verdict == "undecided"
    # two projections: 1 - (1 + cosine of their angle)/2, where the maximal correlation of x and y on the disc is that
    # of x^2 and y^2, 1/3
    assert found.value == pytest.approx(1 / 3, abs=1e-9)


def test_the_matrix_of_a_law_of_directions_is_saved_and_has_a_spectrum(tmp_path):
    matrix = ker.discretise(ROUGH, ker.Zernike(4))
    restored = ker.load_matrix(matrix.save(tmp_path / "disc.npz"))
    np.testing.assert_array_equal(restored.symmetric, matrix.symmetric)
    assert restored.basis == matrix.basis and restored.frame == "specular"
    np.testing.assert_allclose(spec.spectrum(matrix, k=4).values, [1, 1 / 2, 1 / 2, 1 / 3], atol=1e-13)
    assert (matrix @ (lambda at: at[..., 0])) == pytest.approx(0.5 * matrix.basis.project(lambda at: at[..., 0]))


TEETH = geo.triangular_teeth(0.9)


@pytest.mark.parametrize(
    ("wall", "facets"), [(TEETH, "diffuse in space"), (LEANING.wall, "diffuse in space"), (TEETH, "finer grooves")]
)
def test_diffuse_facets_reflect_in_space_as_own_rays_of_the_cosine_law(wall, facets):
    """Rays of the judge in three dimensions; the matrix and the samples agree with them entry by entry."""
    law = ker.HemisphereLaw(ker.FacetedLaw(wall, ker.maxwell(0.3)), np.pi / 2, facets)
    rng = np.random.default_rng(RNG)
    incoming = cosine_law(rng, 2**17)
    matrix = ker.discretise(law, ker.Zernike(3), samples=2**17)
    # grooves along y: across is x, and the judge has the normal second and the grooves third
    found, _ = flown(wall.vertices, incoming[:, [0, 2, 1]], 0.3, 0.0, rng, in_space=facets == "diffuse in space")
    for outgoing in (found[:, [0, 2, 1]], law.sample(incoming, rng=1)):
        scores = scores_of_entries(incoming, outgoing, matrix)[1:, 1:]
        assert np.abs(scores).max() < LARGEST_Z and np.abs(outgoing[:, 2]).min() > 0.0


def test_the_accommodation_along_grooves_is_the_probability_of_a_diffuse_hit():
    law = ker.FacetedLaw(TEETH, ker.maxwell(0.3))
    found = spec.accommodation(ker.HemisphereLaw(law, facets="diffuse in space"), 1e-3)
    rng = np.random.default_rng(RNG)
    rays = geo.trace(TEETH, rng.random(2**18), ker.SINE.sample(2**18, rng))
    scattered = 1.0 - 0.7**rays.collisions
    assert abs(z_score(scattered, found.along.value)) < LARGEST_Z
    # of the independent rays of a plan in three dimensions
    assert abs(found.across.value - (1.0 + 4.0 * 0.04935)) < 4.0 * 0.0002 + found.across.error
    assert abs(found.along.value - (1.0 - 4.0 * 0.11513)) < 4.0 * 0.00009 + found.along.error
    assert found.tangential.value == pytest.approx(0.5 * (found.across.value + found.along.value), abs=1e-14)
    incoming = cosine_law(rng, 2**17)
    outgoing, _ = flown(TEETH.vertices, incoming[:, [0, 2, 1]], 0.3, 0.0, rng, in_space=True)
    changes = 1.0 - 18.0 * (-incoming[:, 2] * outgoing[:, 1] - 4.0 / 9.0)
    assert abs(z_score(changes, found.normal.value)) < LARGEST_Z
    kept = spec.accommodation(ker.HemisphereLaw(law, facets="finer grooves"), 1e-3)
    assert kept.along.value == 0.0 and kept.tangential.value == pytest.approx(0.5 * kept.across.value, abs=1e-15)


def test_a_flat_wall_of_diffuse_facets_is_the_wall_of_maxwell_in_space():
    law = ker.FacetedLaw(geo.flat(), ker.maxwell(0.4))
    matrix = ker.discretise(ker.HemisphereLaw(law, 0.3, "diffuse in space"), ker.Zernike(3), samples=2**12)
    assert np.linalg.norm(matrix.symmetric - np.diag([1.0] + [0.6] * 9)) < float(matrix.error) < 1e-3
    found = spec.accommodation(ker.HemisphereLaw(law, facets="diffuse in space"), 1e-6)
    for one in (found.across, found.along, found.normal, found.maxwell_fraction):
        assert abs(one.value - 0.4) <= one.error + 1e-12
    tubes = [
        spec.transmission(one, 3.0, "tube", 2e-2, 1)
        for one in (ker.HemisphereLaw(law, facets="diffuse in space"), ker.maxwell(0.4))
    ]
    assert abs(tubes[0].value - tubes[1].value) < 2.0 * tubes[0].error < 0.04


def test_grooves_of_one_direction_have_a_gap_if_their_facets_are_diffuse_in_space():
    law = ker.FacetedLaw(TEETH, ker.maxwell(0.3))
    kept, drawn = (
        spec.spectral_gap(ker.HemisphereLaw(law, 0.0, facets), 0.3) for facets in ("finer grooves", "diffuse in space")
    )
    assert kept.verdict == "no gap"
    # rays without a diffuse hit keep the velocity along, and are at least E .7^N of all
    along = spec.accommodation(ker.HemisphereLaw(law, 0.0, "diffuse in space"), 1e-2).along
    assert 0.0 < drawn.value - drawn.error < drawn.value <= along.value + along.error + 1e-3


def test_facets_must_say_what_becomes_of_the_velocity_along_the_grooves():
    law = ker.FacetedLaw(TEETH, ker.maxwell(0.3))
    for one in (law, law.in_specular_frame(), law @ law, law**2, 0.5 * law + 0.5 * ker.lambertian()):
        with pytest.raises(InputError, match=r"pass facets='diffuse in space' .* or facets='finer grooves'"):
            ker.HemisphereLaw(one)
        assert "finer grooves" in repr(ker.HemisphereLaw(one, facets="finer grooves"))
    with pytest.raises(InputError, match=r"^facets: expected 'finer grooves' or 'diffuse in space'"):
        ker.HemisphereLaw(law, facets="diffuse")
    two_scales = ker.FacetedLaw(TEETH, ker.WallLaw(TEETH))
    for one in (law @ law, ker.lambertian(), two_scales):
        with pytest.raises(InputError, match=r"add and multiply such laws"):
            ker.HemisphereLaw(one, facets="diffuse in space")
