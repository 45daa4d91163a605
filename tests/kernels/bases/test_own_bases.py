"""Bases of a user's own class are held to the promises of `Basis`, once, and those of this package keep them."""

from dataclasses import replace

import numpy as np
import pytest
from campaigns.faults.own_bases import Maker, Own

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.bases import basis as promises
from asperity.kernels.bases.polynomials import Directions

OURS = [
    ker.Bins(1), ker.Bins(37), ker.Bins([0.0, 1e-6, 1.0, np.pi]), ker.Bins(8, weight="sin2"), ker.Legendre(1),
    ker.Legendre(64), ker.Legendre(8, weight="sin2"), ker.Panels([0.0, 1.0, 2.0, np.pi], 3), Directions(),
    ker.Panels.for_wall(geo.focusing_arcs(1.2)), ker.Panels([0.0, np.pi], 9, "sin2"),
]  # fmt: skip
HALF = ker.maxwell(0.5)


@pytest.fixture
def good():
    return Maker(1).hats()


@pytest.mark.parametrize("basis", OURS, ids=repr)
def test_our_bases_keep_the_promises_that_are_asked_of_a_users(basis):
    for what, found, expected in promises._promises(basis):
        scale = basis.size * max(1.0, np.abs(found).max())
        assert np.abs(found - expected).max() <= promises.ORTHONORMAL * scale, what


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: {"knots": np.array([0.0, 1.0])}, "add edges where functions have kinks"),
        (lambda f: {"nodes": 1}, "raise nodes_per_interval"),
        (lambda f: {"functions": lambda u: f(u)[..., [0, 0, *range(2, np.shape(f(0.5))[0])]]}, "orthonormal"),
        (lambda f: {"functions": lambda u: f(u) * 1j}, "expected numbers"),
        (lambda f: {"functions": lambda u: np.moveaxis(f(u), -1, 0)}, "expected shape"),
        (lambda f: {"functions": lambda u: f(u) + np.nan}, "finite numbers"),
        (lambda f: {"functions": lambda u: f(u) / 0}, "finite numbers"),
        (lambda f: {"functions": lambda u: {}["nothing"]}, r"failed \(KeyError: 'nothing'\)"),
        (lambda f: {"coefficients": -np.ones(2)}, "expected shape"),
        (lambda f: {"partition": True}, "indicators"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_a_basis_that_breaks_a_promise_is_refused_at_every_door(good, change, words):
    basis = replace(good, **change(good.functions))
    theta = np.arccos(np.linspace(-0.9, 0.9, 200))
    for door in (
        lambda: ker.discretise(HALF, basis), lambda: ker.estimate(theta, theta[::-1], basis),
        lambda: ker.estimate_stream([(theta, theta[::-1])], basis), lambda: spec.mean_law(ker.maxwell, 4, basis),
        lambda: ker.KernelMatrix(np.eye(good.size), basis, HALF_ERROR),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            door()


HALF_ERROR = ker.discretise(HALF, ker.Bins(2)).error


def test_what_the_refusals_advise_helps(good):
    for bad, better in (({"knots": np.array([0.0, 1.0])}, {"knots": good.knots}), ({"nodes": 1}, {"nodes": 48})):
        basis = replace(good, **bad)
        with pytest.raises(InputError, match="raise nodes_per_interval, or add edges where functions have kinks"):
            ker.discretise(HALF, basis)
        assert ker.discretise(HALF, replace(basis, **better)).error.value < 1e-12


def test_a_basis_is_examined_once(good):
    calls = []

    def counted(u):
        calls.append(np.shape(u))
        return good.functions(u)

    basis = replace(good, functions=counted)
    promises.checked_basis(basis)
    assert len(calls) == 2
    promises.checked_basis(basis)
    assert len(calls) == 2


def test_a_class_derived_from_ours_is_examined_too():
    class Doubled(ker.Legendre):
        def evaluate(self, angle):
            return 2.0 * super().evaluate(angle)

    with pytest.raises(InputError, match="orthonormal"):
        ker.discretise(HALF, Doubled(3))


def test_an_error_that_is_not_known_has_its_reason(good):
    matrix = ker.discretise(HALF, good)
    found = spec.spectrum(matrix, k=3)
    assert np.isinf(found.gap_error) and "coarsened" in found.evidence[0] and "coarsened" in repr(found)
    assert "coarsened" in spec.spectral_gap(matrix).evidence[0]
    coarse = Own(lambda u: np.ones((*np.shape(u), 1)), np.array([0.0, 1.0]), np.ones(1))
    assert "coarsened" in repr(
        spec.spectrum(ker.discretise(HALF, replace(good, coarser=(coarse, good.constant[None]))))
    )
    assert "inf" not in repr(spec.spectrum(ker.henyey_greenstein(0.5), k=2))
