"""Quantities of laws that preserve sin(theta) d theta, and refusals of others."""

import warnings

import numpy as np
import pytest
from campaigns.errors.invariance import Recipe

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.spectral.bounds import contraction

DRIFTS = ker.MatrixLaw([[0.5, 0, 0.5], [0.25, 0.75, 0], [0.25, 0.75, 0]])
ISOTROPIC = ker.DensityLaw(lambda a, b: np.full(np.broadcast_shapes(np.shape(a), np.shape(b)), 1.0 / np.pi))
ROTATES, TEETH = ker.MatrixLaw(np.roll(np.eye(5), 1, axis=1)), ker.TriangularTeethLaw(1.0)
SAW = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0, -0.6), (1, 0)]))
P1, P2 = np.polynomial.Polynomial([0.0, 1.0]), np.polynomial.Polynomial([-0.5, 0.0, 1.5])
DIFFUSE = 4.0 / np.pi


@pytest.mark.parametrize(
    "law", [DRIFTS, ISOTROPIC, Recipe(0.4, P1 + 0.2, P2), 0.5 * DRIFTS + 0.5 * ker.lambertian(), DRIFTS @ TEETH]
)
def test_laws_that_do_not_preserve_the_measure_have_no_slope_but_a_diffusivity_at_a_length(law):
    with pytest.raises(InputError, match=r"expected one that preserves sin\(theta\) d theta.*channel_diffusivity"):
        spec.diffusivity(law)
    found = spec.channel_diffusivity(law, [20.0], 200, rng=0)
    assert found.onset == np.inf and found.values[0] > 0.0


@pytest.mark.parametrize(
    "law",
    [ROTATES, 0.5 * ROTATES + 0.5 * ker.lambertian(), ROTATES.in_specular_frame(), Recipe(0.4, P1, P2),
     ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) * (1.0 + 0.4 * np.cos(a) * (3.0 * np.cos(b) ** 2 - 1.0))),
     TEETH @ SAW @ ker.lambertian(), 0.5 * TEETH @ SAW + 0.5 * ker.lambertian()],
)  # fmt: skip
def test_laws_that_preserve_the_measure_without_being_reversible_are_taken(law):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = spec.diffusivity(law)
    assert np.isfinite(found.error) and found.value > 0.5 * DIFFUSE


def test_a_measured_table_is_refused_until_rows_and_columns_are_divided_by_their_sums_in_turn():
    table = np.full((3, 3), 1.0 / 3.0)
    table[0] += [0.05, -0.05, 0.0]
    with pytest.raises(InputError, match="divide rows and columns by their sums in turn"):
        spec.diffusivity(ker.MatrixLaw(table))
    with pytest.raises(InputError, match=r"its adjoint is not a law.*divide rows and columns"):
        ker.MatrixLaw(table).adjoint()
    for _ in range(50):
        table /= table.sum(axis=0)
        table /= table.sum(axis=1)[:, None]
    found = spec.diffusivity(ker.MatrixLaw(table))
    assert found.value == pytest.approx(DIFFUSE, abs=2.0 * found.error) and ker.MatrixLaw(table).adjoint()


def test_whether_the_measure_is_preserved_is_not_guessed_from_a_matrix_without_accuracy(monkeypatch):
    monkeypatch.setattr(contraction, "UNKNOWN", -1.0)
    with pytest.raises(AccuracyError, match="not known whether"):
        spec.diffusivity(Recipe(0.4, P1, P2))


@pytest.mark.parametrize("quantity", [spec.enclosures, spec.spectral_gap, spec.mixing_time])
@pytest.mark.parametrize("law", [DRIFTS, ISOTROPIC, Recipe(0.4, P1 + 0.2, P2)])
def test_spectra_of_laws_that_do_not_preserve_the_measure_are_refused(law, quantity):
    with pytest.raises(AccuracyError, match="symmetric"):
        quantity(law)


@pytest.mark.parametrize("law", [DRIFTS, ISOTROPIC])
def test_averages_over_incoming_angles_need_no_invariant_measure(law):
    """Resistance, accommodation and distances average over given incoming angles: checked by random pairs."""
    rng = np.random.default_rng(0)
    theta = ker.SINE.sample(400_000, rng)
    out = law.sample(theta, rng)
    cost = 0.75 * (1.0 + np.cos(out - theta))
    assert abs(cost.mean() - float(ker.resistance(law))) < 4.0 * cost.std() / theta.size**0.5
    tangential = 1.0 + 3.0 * np.cos(theta) * np.cos(out)
    found = spec.accommodation(law, 1e-6).tangential
    assert abs(tangential.mean() - float(found)) < 4.0 * tangential.std() / theta.size**0.5
