"""The intervals of enclosures themselves: trial functions of two eigenfunctions, of which all is known by hand."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.laws.law import Composition, Power
from asperity.spectral.bounds import enclosure
from asperity.spectral.bounds.enclosure import Enclosure, Enclosures
from asperity.spectral.bounds.operator_residuals import Residuals, residuals
from asperity.spectral.bounds.separation import Separation

EPS = float(np.finfo(float).eps)
REST = Separation(0.25, "bound", "known")


def measured(quotients, norms, errors=None) -> Residuals:
    errors = np.zeros(len(quotients)) if errors is None else np.asarray(errors, dtype=float)
    return Residuals(np.asarray(quotients, dtype=float), errors, np.asarray(norms, dtype=float), 7, np.empty(0))


def mixed(own: float, other: float, fraction: float = 0.01) -> tuple[float, float]:
    """Quotient and residual of sqrt(1 - fraction) u + sqrt(fraction) v, u to the value ``own``, v to ``other``."""
    return (1.0 - fraction) * own + fraction * other, float(np.sqrt(fraction * (1.0 - fraction))) * abs(own - other)


def interval(found: Residuals, rest: float, place: int) -> tuple[float, float]:
    return enclosure._temple(found, rest, np.arange(len(found.quotients)), place)


# ---- Kato and Temple's bound is attained by mixtures of two eigenfunctions ---------------------------------------
def test_a_mixture_with_the_rest_of_the_spectrum_attains_the_upper_end():
    value, norm = mixed(0.5, 0.25)
    low, high = interval(measured([1.0, value], [0.0, norm]), 0.25, 1)
    assert high == pytest.approx(0.5, rel=0.0, abs=4e-15) and high >= 0.5
    assert 0.4 < low < value


def test_a_mixture_with_the_neighbour_above_attains_the_lower_end():
    value, norm = mixed(0.5, 1.0)
    low, high = interval(measured([1.0, value], [0.0, norm]), 0.25, 1)
    assert low == pytest.approx(0.5, rel=0.0, abs=4e-15) and low <= 0.5
    assert value < high < value + norm


@pytest.mark.parametrize("by", ["norms", "errors"])
@pytest.mark.parametrize("rest", [0.1, 0.3])
def test_neighbours_are_as_near_as_their_own_intervals(rest, by):
    """One above reaches down to .7, one below up to .3; a further one on either side changes nothing."""
    quotients, spread = [0.95, 0.8, 0.0, 0.2, 0.05], [0.01, 0.1, 0.0, 0.1, 0.01]
    for other, end in ((0.7, 0), (0.3, 1)):
        value, norm = mixed(0.5, other)
        quotients[2] = value
        own = [0.0, 0.0, norm, 0.0, 0.0]
        found = measured(quotients, np.add(spread, own)) if by == "norms" else measured(quotients, own, spread)
        assert interval(found, rest, 2)[end] == pytest.approx(0.5, rel=0.0, abs=4e-15)


def test_of_a_negative_value_the_rest_lies_above():
    value, norm = mixed(-0.5, -0.25)
    low, high = interval(measured([1.0, value], [0.0, norm]), 0.25, 1)
    assert low == pytest.approx(-0.5, rel=0.0, abs=4e-15) and low <= -0.5
    # nothing lies below: the quotient is an upper bound of the least eigenvalue
    assert high == value + 4.0 * EPS
    # and of the largest one a lower bound
    value, norm = mixed(0.5, 0.25)
    assert interval(measured([value], [norm]), 0.25, 0)[0] == value - 4.0 * EPS


def test_where_neighbours_overlap_or_are_too_near_the_residual_remains():
    for neighbour, spread in ((0.55, 0.1), (0.56, 0.05)):
        low, _ = interval(measured([neighbour, 0.5], [spread, 0.125]), 0.25, 1)
        assert low == pytest.approx(0.375, rel=0.0, abs=4e-15)
    for neighbour, spread in ((0.45, 0.1), (0.44, 0.05)):
        _, high = interval(measured([1.0, 0.5, neighbour], [0.0, 0.125, spread]), 0.25, 1)
        assert high == pytest.approx(0.625, rel=0.0, abs=4e-15)
    # of equal values neither is above the other, and the two eigenvalues are at least that large
    low, high = interval(measured([0.5, 0.5], [0.125, 0.125]), 0.25, 1)
    assert low == 0.5 - 4.0 * EPS and high == pytest.approx(0.625, rel=0.0, abs=4e-15)


def test_a_neighbour_that_ends_at_the_value_leaves_no_room():
    low, _ = interval(measured([0.5 + 4.0 * EPS, 0.5], [0.0, 0.125]), 0.25, 1)
    assert low == pytest.approx(0.375, rel=0.0, abs=4e-15)
    _, high = interval(measured([0.5, 0.5 - 4.0 * EPS], [0.125, 0.0]), 0.25, 0)
    assert high == pytest.approx(0.625, rel=0.0, abs=4e-15)


def test_the_errors_of_the_quotient_and_four_roundings_are_added_on_both_sides():
    assert interval(measured([1.0, 0.5], [0.0, 0.0]), 0.25, 1) == (0.5 - 4.0 * EPS, 0.5 + 4.0 * EPS)
    low, high = interval(measured([1.0, 0.5], [0.0, 0.0], [0.0, 0.0625]), 0.25, 1)
    assert (low, high) == (0.4375 - 4.0 * EPS, 0.5625 + 4.0 * EPS)


def test_no_interval_reaches_beyond_one():
    assert interval(measured([0.875], [0.5]), 0.5, 0)[1] == 1.0
    item = enclosed([0.875], [0.5], 0, 0)
    assert item.high == 1.0 and item.low == pytest.approx(0.375, rel=0.0, abs=4e-15)


# ---- what an enclosure claims ------------------------------------------------------------------------------------
def enclosed(quotients, norms, number, place, names=None, exact=True, apart=REST, errors=None) -> Enclosure:
    found = measured(quotients, norms, errors)
    order = np.argsort(-np.abs(found.quotients), kind="stable")
    return enclosure._enclosed(found, (number, apart), order, place, names or ("none",) * len(quotients), exact)


def test_the_constants_have_the_eigenvalue_one_exactly():
    item = enclosed([1.0 - EPS, 0.5], [0.125, 0.0], 1, 0, ("even", "odd"))
    assert (item.value, item.low, item.high, item.label, item.index) == (1.0, 1.0, 1.0, "indexed", 0)
    assert item.residual == 0.125 and item.parity == "even" and item.reason == "P 1 = 1; known"
    # unless nothing is known to stay away from them
    item = enclosed([1.0, 0.5], [0.0, 0.0], 0, 0)
    assert (item.label, item.index, item.low) == ("contains-spectrum", None, 1.0 - 4.0 * EPS)


def test_an_eigenvalue_minus_one_may_come_first():
    item = enclosed([1.0 - EPS, -1.0], [0.0, 0.0], 2, 1)
    assert (item.value, item.low, item.high, item.index) == (-1.0, -1.0 - 4.0 * EPS, -1.0 + 4.0 * EPS, 0)
    item = enclosed([1.0 - EPS, -1.0], [0.0, 0.0], 2, 0)
    assert item.index == 1 and item.low < 1.0 - EPS


def test_indices_count_by_modulus_up_to_the_last_one_that_is_apart():
    quotients, norms = [1.0, 0.5, -0.75, 0.375], [0.0, 0.0625, 0.03125, 0.0]
    items = [enclosed(quotients, norms, 3, place) for place in range(4)]
    assert [item.index for item in items] == [0, 2, 1, None]
    assert [item.label for item in items] == ["indexed"] * 3 + ["contains-spectrum"]
    assert [item.residual for item in items] == norms
    assert "the rest is within 0.25" in items[1].reason and "reaches 0.25" in items[3].reason
    # (.0625)^2 over the room down to the rest, .25
    assert items[1].high == pytest.approx(0.515625, rel=0.0, abs=4e-15)


def test_what_is_not_indexed_has_the_residual_and_the_errors_on_either_side():
    item = enclosed([1.0, 0.5], [0.0, 0.125], 1, 1, errors=[0.0, 0.0625], names=("even", "odd"))
    assert (item.low, item.high) == (0.3125 - 4.0 * EPS, 0.6875 + 4.0 * EPS)
    assert (item.value, item.residual, item.kind, item.parity) == (0.5, 0.125, "bound", "odd")
    assert enclosed([1.0, 0.5], [0.0, 0.125], 1, 1, exact=False).kind == "estimate"


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("kind", ["bound", "estimate"])
def test_an_indexed_enclosure_is_a_bound_only_where_law_and_separation_are(exact, kind):
    item = enclosed([1.0, 0.5], [0.0, 0.0], 2, 1, exact=exact, apart=Separation(0.25, kind, "known"))
    assert item.kind == ("bound" if exact and kind == "bound" else "estimate")


def test_only_neighbours_of_the_same_parity_count():
    quotients, norms = [1.0, 0.5, 0.5625, 0.4375], [0.0, 0.125, 0.0, 0.0]
    alone = enclosed([1.0, 0.5], norms[:2], 2, 1, ("even", "odd"))
    among = enclosed(quotients, norms, 4, 1, ("even", "odd", "even", "even"))
    assert (among.low, among.high) == (alone.low, alone.high)
    assert alone.low == 0.5 - 4.0 * EPS
    alike = enclosed(quotients, norms, 4, 1, ("even", "odd", "odd", "odd"))
    assert alike.low == pytest.approx(0.375, rel=0.0, abs=4e-15)
    # a function that is not listed is no neighbour: its interval may hold nothing of its own
    assert enclosed([*quotients[:3], 0.4375], norms, 3, 1, ("even", "odd", "even", "odd")).high == alone.high


# ---- how many are apart ------------------------------------------------------------------------------------------
def apart(law, quotients, norms, next_value):
    found = measured(quotients, norms)
    order = np.argsort(-np.abs(found.quotients), kind="stable")
    number, separation = enclosure._first_that_separates(law, found, order, next_value)
    return number, separation.radius, separation.kind


FRACTION = ker.maxwell(0.25)  # an essential spectrum up to .75, all but the constants within .75
RANK = ker.MatrixLaw([[0.7, 0.3], [0.3, 0.7]])  # .4 beyond the constants


@pytest.mark.parametrize(
    ("law", "quotients", "norms", "next_value", "expected"),
    [
        (FRACTION, [1, 0.9, -0.8], [0, 0.01, 0.01], 0.7, (3, 0.75, "bound")),
        (FRACTION, [1, 0.9, -0.8], [0, 0.01, 0.01], 0.78, (3, 0.78, "estimate")),
        (FRACTION, [1, -0.8, 0.9], [0, 0.01, 0.01], 0.787, (2, 0.81, "estimate")),
        # the joint residual of .03 and .04 is .05
        (FRACTION, [1, 0.85], [0.03, 0.04], 0.795, (2, 0.795, "estimate")),
        (FRACTION, [1, 0.85], [0.03, 0.04], 0.805, (1, 0.75, "bound")),
        (FRACTION, [1, 0.76], [0, 0.02], 0.1, (1, 0.75, "bound")),
        (FRACTION, [1, 0.98], [0, 0.1], 0.9, (1, 0.75, "bound")),
        (FRACTION, [1, 0.9], [0.5, 0.001], 0.1, (0, 0.75, "bound")),
        (FRACTION, [1, 0.9], [0.5, 0.001], 0.8, (0, 0.75, "bound")),
        (RANK, [1, 0.5], [0, 0.125], 0.375, (1, 0.4, "bound")),
        (RANK, [1, 0.125], [0, 0.125], -1.0, (1, 0.4, "bound")),
    ],
)
def test_the_largest_number_that_stays_beyond_the_rest(law, quotients, norms, next_value, expected):
    number, radius, kind = apart(law, quotients, norms, next_value)
    assert (number, kind) == (expected[0], expected[2]) and radius == pytest.approx(expected[1], rel=1e-13)


def test_where_none_is_apart_the_first_refusal_is_told():
    found = measured([1.0, 0.9], [0.5, 0.001])
    _, separation = enclosure._first_that_separates(FRACTION, found, np.arange(2), 0.1)
    assert "norm of the essential part" in separation.reason


# ---- powers ------------------------------------------------------------------------------------------------------
def item(low, value, high, index=None, residual=0.0) -> Enclosure:
    label = "contains-spectrum" if index is None else "indexed"
    return Enclosure(value, low, high, label, index, residual, "bound", "why")


def raised(items, exponent) -> Enclosures:
    return enclosure._raised(Enclosures(tuple(items), Separation(0.5, "bound", "rest"), "paper", "how"), exponent)


def test_intervals_of_powers_hold_the_powers_of_their_points():
    items = [item(-0.5, -0.375, 0.25), item(-0.25, 0.0, 0.5), item(-0.5, -0.375, -0.25), item(0.25, 0.375, 0.5)]
    for exponent in (2, 3):
        found = raised(items, exponent)
        for entry in items:
            power = next(one for one in found if one.value == entry.value**exponent)
            points = np.linspace(entry.low, entry.high, 13) ** exponent
            assert {(one.low, one.high) for one in found} >= {(power.low, power.high)}
            ends = [(one.low, one.high) for one in found if one.value == power.value]
            assert (points.min(), points.max()) in ends
        assert found.separation.radius == 0.5**exponent and f"power {exponent}" in found.method


def test_powers_come_in_descending_order_after_the_constants():
    found = raised([item(1, 1, 1, 0), item(0.4, 0.5, 0.6, 2), item(-0.9, -0.8, -0.7, 1)], 2)
    assert [entry.index for entry in found] == [0, 1, 2]
    found = raised([item(0.999, 1, 1, 1), item(1, 1, 1, 0)], 2)
    assert [entry.index for entry in found] == [0, 1]


@pytest.mark.parametrize("exponent", [2, 3, 5])
@pytest.mark.parametrize("own", [0.1, -0.4, 0.9])
def test_the_residual_of_a_power_bounds_that_of_the_trial_function(own, exponent):
    """Of sqrt(1 - s) u + sqrt(s) v the residual is known; v may have any eigenvalue, also one of modulus 1."""
    for other in (-1.0, -0.5, 0.0, 0.3, 0.95, 1.0):
        for fraction in (1e-6, 0.01):
            value, norm = mixed(own, other, fraction)
            claimed = raised([item(value - norm, value, value + norm, residual=norm)], exponent)[0].residual
            actual = np.hypot(
                np.sqrt(1.0 - fraction) * (own**exponent - value**exponent),
                np.sqrt(fraction) * (other**exponent - value**exponent),
            )
            assert actual <= claimed * (1.0 + 1e-12)


def test_the_residual_of_a_power_is_attained_beside_an_eigenvalue_one():
    value, norm = mixed(0.5, 1.0, 1e-10)
    claimed = raised([item(0.4, value, 0.6, residual=norm)], 3)[0].residual
    assert claimed == pytest.approx(1e-5 * (1.0 - 0.5**3), rel=1e-4, abs=0.0)
    # a quotient may be above 1 by rounding
    for value in (1.0, 1.25):
        assert raised([item(1.0, value, 1.0, 0, 1e-9)], 4)[0].residual == pytest.approx(4e-9, rel=1e-14, abs=0.0)


# ---- laws with few eigenvalues -----------------------------------------------------------------------------------
def ring() -> ker.MatrixLaw:
    """Four states with the vectors 1, (1, 0, -1, 0), (1, -1, 1, -1), (0, 1, 0, -1) to 1, .375, -.25 and .125."""
    root = np.sqrt(2.0)
    waves = np.array([[1, 1, 1, 1], [root, 0, -root, 0], [1, -1, 1, -1], [0, root, 0, -root]]) / 2
    return ker.MatrixLaw(waves.T @ np.diag([1.0, 0.375, -0.25, 0.125]) @ waves)


@pytest.mark.parametrize("k", [1, 2, 3, 4, 5])
def test_all_eigenvalues_of_a_matrix_are_found_in_order(k):
    exact = np.array([1.0, 0.375, -0.25, 0.125])
    found = spec.enclosures(ring(), k)
    listed = exact[:k]
    assert [item.index for item in found] == np.argsort(np.argsort(-np.abs(np.sort(listed)[::-1]))).tolist()
    for entry, value in zip(found, np.sort(listed)[::-1], strict=True):
        assert value in entry and entry.width < 1e-13 and entry.kind == "bound"
    assert len(found) == min(k, 4)


@pytest.mark.parametrize(("k", "following"), [(1, 0.375), (2, 0.25), (3, 0.125), (4, 0.0)])
def test_what_comes_next_is_the_largest_that_is_not_listed(k, following):
    law = ring()
    values, _, names, next_value = enclosure._trial(law, ker.Bins(law.edges), k, 1e-8)
    assert values == pytest.approx([1.0, *sorted([0.375, -0.25, 0.125][: k - 1], reverse=True)], rel=1e-13)
    assert len(names) == k and next_value == pytest.approx(following, rel=0.0, abs=1e-13)


def test_a_poor_trial_function_counts_where_it_reaches_to(monkeypatch):
    """Of two that come next, of .25 and of .125, the second may stand for a value of .325 if its residual is .2."""

    tried = []

    def poor(law, basis, vectors, values, **options):
        tried.append(len(values))
        return measured(values, np.where(np.abs(values) < 0.2, 0.2, 0.0))

    monkeypatch.setattr(enclosure, "residuals", poor)
    law = ring()
    next_value = enclosure._trial(law, ker.Bins(law.edges), 2, 1e-8)[3]
    assert next_value == pytest.approx(0.325, rel=0.0, abs=1e-13)
    # no more than two are tried where there are more
    enclosure._trial(law, ker.Bins(law.edges), 1, 1e-8)
    assert tried == [2, 2]


def test_the_focusing_arc_has_the_published_eigenvalues_on_panels_that_adapt():
    """Facts 10: 0.3670253152(3) and -0.311346443 at a half angle of 1.2."""
    found = spec.enclosures(ker.CircularArcLaw(1.2), 3)
    assert "Panels" in found.method and found.convention == "paper"
    assert [entry.label for entry in found] == ["indexed"] * 3
    assert 0.3670253152 in found[1] and -0.311346443 in found[2]
    assert [entry.parity for entry in found] == ["even", "odd", "odd"]
    assert [entry.kind for entry in found] == ["estimate"] * 3
    assert all(entry.width <= 2e-8 for entry in found)
    following = spec.enclosures(ker.CircularArcLaw(1.2), 4, tolerance=1e-5)
    smallest = min(following, key=lambda entry: abs(entry.value))
    assert abs(smallest.value) <= found.separation.radius < abs(smallest.value) + 0.01


@pytest.mark.parametrize("k", [2, 3])
def test_enclosures_on_panels_that_adapt_are_as_narrow_as_wanted(k):
    """Diffuse reflection halves the eigenvalues of the arc."""
    law = 0.5 * ker.CircularArcLaw(1.2) + 0.5 * ker.lambertian()
    found = enclosure.enclosed_trial_space(law, k, None, 1e-4)
    assert found.worst <= 1e-4
    for entry, value in zip(found.enclosures, [1.0, 0.3670253152 / 2, -0.311346443 / 2], strict=False):
        assert value in entry


@pytest.mark.parametrize(
    ("law", "basis", "slack"),
    [
        (ker.CircularArcLaw(1.2), ker.Legendre(6), 1e-4),
        (RANK, ker.Legendre(4), 1e-13),
        (ker.henyey_greenstein(0.5), ker.Legendre(4), 1e-13),
    ],
    ids=["arc", "jumps", "smooth"],
)
def test_values_of_trial_functions_are_their_quotients(law, basis, slack):
    """The matrix of trial functions is that of the law, also where images have kinks or jumps."""
    values, vectors, _, _ = enclosure._trial(law, basis, 3, 1e-8)
    assert values == pytest.approx(residuals(law, basis, vectors, values).quotients, rel=0.0, abs=slack)


def test_trial_functions_have_a_parity_where_law_and_basis_are_mirror_symmetric():
    skew = ker.MatrixLaw([[0.6, 0.3, 0.1], [0.3, 0.5, 0.2], [0.1, 0.2, 0.7]])
    for law, basis, names in (
        (ker.lambertian(), ker.Bins(2), ("even", "odd")),
        (ker.lambertian(), ker.Bins([0.0, 1.0, np.pi]), ("none", "none")),
        (skew, ker.Bins(3), ("none", "none")),
    ):
        assert enclosure._trial(law, basis, 2, 1e-8)[2] == names


def test_four_eigenvalues_are_enclosed_unless_another_number_is_given():
    assert len(spec.enclosures(ker.MatrixLaw(0.5 * np.eye(6) + 1.0 / 12.0))) == 4


@pytest.mark.slow
@pytest.mark.parametrize(("k", "basis"), [(1, "Legendre(32)"), (12, "Legendre(36)")])
def test_phase_functions_are_tried_in_polynomials_beyond_those_asked_for(k, basis):
    found = spec.enclosures(ker.henyey_greenstein(0.5), k)
    assert f"trial functions in {basis}," in found.method
    assert [entry.index for entry in found] == list(range(k))


def test_powers_are_recognised_where_they_tell_something():
    law, other = ker.henyey_greenstein(0.5), ker.henyey_greenstein(0.25)
    assert enclosure.as_power(law**3) == enclosure.as_power(law @ law @ law) == (law, 3)
    assert enclosure.as_power(Power(law, 1)) == enclosure.as_power(Composition((law,))) == (law, 1)
    assert enclosure.as_power(law @ law) == (law, 2)
    skew = ker.MatrixLaw(np.roll(np.eye(3), 1, axis=1))
    for nothing in (
        law,
        law @ other,
        law @ law @ other,
        other @ law @ law,
        ker.specular() @ law,
        skew**2,
        Power(law, 0),
    ):
        assert enclosure.as_power(nothing) is None


@pytest.mark.slow
@pytest.mark.parametrize("g", [0.5, -0.9])
def test_a_phase_function_and_its_square_have_powers_of_g(g):
    law = ker.henyey_greenstein(g)
    for power, powers in ((1, law), (2, law**2), (3, law @ law @ law)):
        found = spec.enclosures(powers, 3)
        for entry in found:
            value = g ** (power * entry.index)
            assert value in entry and entry.width < 1e-13 and entry.residual < 1e-12 and entry.kind == "bound"
            assert entry.parity == ("odd" if entry.index % 2 else "even")


def test_a_power_has_the_powers_of_the_ends_at_a_smaller_tolerance():
    law = ker.CircularArcLaw(1.2)
    square, base = spec.enclosures(law**2, 3, tolerance=1e-5), spec.enclosures(law, 3, tolerance=0.5e-5)
    assert square.method == f"power 2; {base.method}"
    assert [(entry.value, entry.index) for entry in square] == [(entry.value**2, entry.index) for entry in base]
    assert spec.enclosures(law**2, 3, ker.Bins(8)).method.startswith("power 2; trial functions in Bins(8)")


# ---- scatterings -------------------------------------------------------------------------------------------------
def test_a_power_of_a_scattering_that_hardly_scatters_is_enclosed():
    near = ker.henyey_greenstein(0.999)
    (_, first) = spec.enclosures(near**2, 2)
    assert 0.999**2 in first and first.width < 1e-11 and (first.label, first.kind) == ("indexed", "bound")


def test_a_scattering_in_the_other_frame_stays_there():
    found = spec.enclosures(ker.henyey_greenstein(0.4).in_specular_frame(), 2)
    assert found.convention == "specular" and -0.4 in found[1] and found[1].width < 1e-13


@pytest.mark.parametrize("basis", [None, ker.Legendre(8)], ids=repr)
def test_a_scattering_with_the_identity_has_its_eigenvalues(basis):
    found = spec.enclosures(0.25 * ker.retroreflection() + 0.75 * ker.henyey_greenstein(0.5), 3, basis)
    for degree, entry in enumerate(found):
        assert 0.25 + 0.75 * 0.5**degree in entry and entry.index == degree and entry.width < 1e-13


# ---- ties --------------------------------------------------------------------------------------------------------
def test_moduli_overlap_where_two_intervals_have_points_of_one_modulus():
    rng, seen = np.random.default_rng(1), set()
    for _ in range(400):
        ends = np.sort(rng.integers(-6, 7, (2, 2)) / 8.0, axis=1).tolist()
        first, second = (item(low, low, high, 1) for low, high in ends)
        # every end and 0 lie on the grid
        grids = [np.linspace(low, high, round(16 * (high - low)) + 1) for low, high in ends]
        overlap = bool(np.intersect1d(*map(np.abs, grids)).size)
        assert enclosure._moduli_overlap(first, second) == enclosure._moduli_overlap(second, first) == overlap, ends
        seen.add(overlap)
    assert seen == {False, True}


def test_only_indexed_enclosures_may_change_places():
    items = [item(0.25, 0.5, 0.75, 2), item(-0.5, -0.5, -0.5, 1), item(0.5, 0.5, 0.5), item(0.0, 0.125, 0.1875, 4)]
    items.append(item(0.75, 0.75, 0.75, 3))
    with_two = "; the order with 2 is not certain"
    added = ["; the order with 1, 3 is not certain", with_two, "", "", with_two]
    assert [entry.reason for entry in enclosure._with_ties(items)] == ["why" + more for more in added]


def test_the_reach_of_functions_is_the_largest_end():
    assert enclosure._reach(measured([0.5, -0.75, 0.625], [0.375, 0.0625, 0.0])) == 0.875


def test_enclosures_are_read_as_a_sequence_and_as_text():
    first, second = item(0.25, 0.5, 0.75, 1), item(-0.5, -0.25, 0.0)
    both = Enclosures((first, second), REST, "paper", "by hand")
    assert len(both) == 2 and list(both) == [first, second] and both[1] is second
    assert first.width == 0.5 and 0.25 in first and 0.75 in first and 0.2 not in first and 0.8 not in first
    assert [str(one) for one in both] == [
        "[0.25, 0.75] holds eigenvalue 1 (bound: why)",
        "[-0.5, 0] holds a point of the spectrum (bound: why)",
    ]
    assert "0.50(25)" in str(both) and "-0.25(25)" in str(both) and "convention paper" in str(both)
    trials = enclosure.EnclosedTrialSpace(both, ker.Legendre(2), np.eye(2))
    assert trials.worst == 0.25 and not trials.indexed
    assert enclosure.EnclosedTrialSpace(Enclosures((first,), REST, "paper", ""), ker.Legendre(2), np.eye(2)).indexed
