"""Proved gaps of focusing arcs: images, densities and intervals against the law itself, and false certificates."""

import copy
import math
from decimal import Decimal
from itertools import pairwise

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import ProofError
from asperity.spectral.proofs import checker
from asperity.spectral.proofs import proof as search
from asperity.spectral.proofs.checker import FocusingArcs, Pieces, Refused, arb, ball, ctx, exact

EDGES, POWERS = ["0.4", "1.1"], [["0.3", "1.0"], ["-0.2", "0.5", "2.0"], ["1.0", "-0.7"]]


def arcs(half_angle):
    return ker.WallLaw(geo.focusing_arcs(half_angle))


@pytest.fixture(scope="module")
def proof():
    """One that takes a few seconds: 20 bins are too few, so that more are tried."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "ARC_BINS", (20, 60))
        patch.setattr(search, "REFLECTIONS", 30)
        return spec.prove_gap(arcs(0.4).in_specular_frame(), width=1e-2)


@pytest.mark.parametrize("odd", [True, False])
@pytest.mark.parametrize("half_angle", [0.5, 0.9, 1.5])
def test_the_image_of_polynomials_is_that_of_the_law(half_angle, odd):
    """The image under the law at three angles, and the slope between the ends of a short interval."""
    with ctx.workprec(128):
        v, law = Pieces(EDGES, POWERS, odd), FocusingArcs(exact(repr(half_angle)), {"parts": 1, "reflections": 60})
        # the numbers of a run with one interval a piece
        law.form_and_residual(v, 1, arb("0.3"))
        mean = float(arb(POWERS[0][0]) - v.half[0][3][0])

    def values(theta):
        folded = np.minimum(theta, np.pi - theta)
        ends = np.array([0.0, 0.4, 1.1, np.pi / 2])
        piece = np.clip(np.searchsorted(ends, folded) - 1, 0, 2)
        middle = 0.5 * (ends[:-1] + ends[1:])
        table = np.array([[float(x) for x in (*p, 0, 0)][:3] for p in POWERS])
        found = np.sum(table[piece] * (folded - middle[piece])[..., None] ** np.arange(3), axis=-1) - mean
        return np.where(theta > np.pi / 2, -1 if odd else 1, 1) * found

    def image(theta):
        with ctx.workprec(128):
            one = law.one_side(v, theta, arb(theta.mid()))
            two = law.one_side(v, checker.PI - theta, checker.PI - arb(theta.mid()))
        fold = -1 if odd else 1
        return one[0] + fold * two[0], one[1] - fold * two[1], one[2] + fold * two[2]

    angle = np.array([0.2, 0.77, 1.3])
    entry = (np.arange(10**5) + 0.5) / 10**5
    known = [values(np.pi - ker.CircularArcLaw(half_angle).reflect(entry, theta)).mean() for theta in angle]
    for theta, value in zip(angle, known, strict=True):
        point = arb(repr(float(theta)))
        after, _, rest = image(point)
        scaled = 2.0 * math.sin(half_angle) * math.sin(theta) * value
        assert abs(float((after + rest - scaled).mid())) < 1e-4 + float(rest.rad())
        width = arb("1e-4")
        first, last = image(point)[0], image(point + width)[0]
        slope = image(ball(point, point + width))[1]
        change = (last - first) / width
        assert float(slope.lower()) - 1e-3 < float(change.mid()) < float(slope.upper()) + 1e-3


@pytest.mark.parametrize("half_angle", [0.5, 0.9, 1.5])
def test_densities_between_bins_are_below_those_of_the_law(half_angle):
    law = FocusingArcs(exact(repr(half_angle)), {})
    edges = np.linspace(0.0, np.pi, 41)
    masses = ker.discretise(ker.CircularArcLaw(half_angle).in_specular_frame(), ker.Bins(edges), tolerance=1e-8).array
    bins = [ball(repr(float(a)), repr(float(b))) for a, b in pairwise(edges)]
    weight = 0.5 * -np.diff(np.cos(edges))
    rows = slice(1, 39)
    least = np.array([[float(law.least(one, two).lower()) for two in bins[rows]] for one in bins[rows]])
    known = masses[rows, rows] / weight[rows]
    assert np.all(least <= known * (1.0 + 1e-6) + 1e-6)
    assert (least @ weight[rows]).mean() > 0.6


def test_the_interval_contains_the_gap(proof):
    low, high = map(float, proof.interval)
    assert low < spec.spectral_gap(arcs(0.4).in_specular_frame()).value < high
    assert "focusing arcs of half angle 0.4 " in proof.statement


@pytest.mark.slow
def test_a_gap_of_the_other_convention_is_proved(monkeypatch):
    monkeypatch.setattr(search, "ARC_BINS", (70,))
    low, high = map(float, spec.prove_gap(arcs(1.5), width=2e-2).interval)
    assert low < spec.spectral_gap(arcs(1.5)).value < high


def test_bins_that_begin_where_the_sine_of_a_bin_is_of_unknown_sign_are_refused():
    """The least sine of such a bin was negative, and with it the chance to enter grazing angles."""
    with ctx.workprec(64), pytest.raises(Refused):
        FocusingArcs(exact("0.9"), {}).count(["2.5118864315e-9"], False, 1, arb("0.99"))


@pytest.mark.parametrize(("half_angle", "first"), [("0.4", "0.21"), ("1.4", "0.18")])
def test_a_first_bin_from_which_rays_come_back_to_it_is_refused(half_angle, first):
    with pytest.raises(Refused, match="a first bin nearer to 0"):
        FocusingArcs(exact(half_angle), {}).grazing(arb(first))


@pytest.mark.parametrize(
    ("path", "change"),
    [
        (("interval", 0), lambda text: str(Decimal(text) + Decimal("1e-9"))),
        (("interval", 1), lambda text: str(Decimal(text) - Decimal("1e-9"))),
        (("law", "half_angle"), lambda pair: [str(float(pair[0]) * 1.01), pair[1]]),
        (("law", "half_angle"), lambda pair: ["1.6", "0"]),
        (("law", "family"), lambda text: "dispersing arcs"),
        (("parities", 1, "trial", 3, 0), lambda text: str(float(text) * 1.2)),
        (("parities", 0, "trial", 3, 0), lambda text: "nan"),
        (("parities", 1, "guess"), lambda text: "nan"),
        (("parities", 1, "guess"), lambda text: str(float(text) * 1.2)),
        (("parities", 0, "threshold"), lambda text: "0.95"),
        (("parities", 1, "threshold"), lambda text: "0.25"),
        (("bins", 5), lambda text: "1.0"),
        (("edges", 2), lambda text: "1.6"),
        (("effort", "parts"), lambda number: 0),
        (("effort", "parts"), lambda number: 1),
        (("effort", "reflections"), lambda number: 0),
        (("effort", "reflections"), lambda number: 1),
        (("precision",), lambda bits: 20),
    ],
)
def test_a_certificate_that_was_tampered_with_is_refused(proof, path, change):
    forged = copy.deepcopy(proof.certificate)
    place = forged
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = change(place[path[-1]])
    # the checker sets the precision of the library of balls
    with ctx.workprec(53), pytest.raises(Refused):
        checker.check(forged)


def test_what_is_not_proved_says_so(monkeypatch):
    with pytest.raises(ProofError, match="between 0 and pi/2"):
        spec.prove_gap(arcs(math.pi / 2))
    monkeypatch.setattr(search, "ARC_BINS", (20,))
    with pytest.raises(ProofError, match="eigenvalues of even functions below"):
        spec.prove_gap(arcs(0.9))
