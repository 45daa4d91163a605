"""Matrices by sampling: errors that are calibrated, z-scores that are those of noise, defects that are found out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.kernels.laws.law import RandomMap
from asperity.kernels.sampling.sobol import PARTS


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
@pytest.mark.parametrize("basis", [ker.Bins(12), ker.Legendre(6)], ids=repr)
def test_z_scores_of_sampled_matrices_are_those_of_noise(basis: ker.Basis, method: str, bounce) -> None:
    scores = [
        ker.discretise(bounce(), basis, method=method, samples=4096, rng=np.random.default_rng(seed))  # type: ignore[arg-type]
        .symmetry_defect()
        .z_score
        for seed in range(40)
    ]
    assert abs(np.mean(scores)) < 0.65 and 0.6 < np.std(scores) < 1.5


def test_a_law_that_is_not_reversible_is_found_out_also_when_symmetrised_by_hand() -> None:
    @dataclass(frozen=True)
    class Drift(ker.DrivenLaw):
        """Keeps the measure and moves fractions of it by a tenth and a bit: not reversible."""

        def reflect(self, x: object, theta: object) -> np.ndarray:
            fraction = np.mod(ker.SINE.cdf(theta) + 0.1 + 0.3 * np.asarray(x), 1.0)
            return ker.SINE.quantile(np.clip(fraction, 1e-12, 1 - 1e-12))

    for method in ("qmc", "monte-carlo"):
        found = ker.discretise(Drift(), ker.Bins(16), method=method, samples=2**16)  # type: ignore[arg-type]
        assert found.symmetry_defect().z_score > 10.0
        assert found.reversible is None
    with pytest.raises(InputError, match="not known to be reversible"):
        ker.discretise(Drift(), ker.Bins(16), symmetrise=True)


def test_symmetrised_matrices_keep_the_defect_of_the_raw_counts(bounce) -> None:
    plain, both = (
        ker.discretise(bounce(), ker.Bins(16), "monte-carlo", samples=20_000, symmetrise=symmetrise)
        for symmetrise in (False, True)
    )
    assert np.array_equal(plain.counts, both.counts)
    assert both.symmetry_defect() == plain.symmetry_defect() > 0.01
    assert both.symmetry_defect().z_score == plain.symmetry_defect().z_score
    assert np.abs(both.flux - both.flux.T).max() == 0.0 or np.abs(both.flux - both.flux.T).max() < 1e-18
    assert np.allclose(both.flux, (plain.counts + plain.counts.T) / 40_000, rtol=1e-13, atol=0.0)
    assert 1e-4 < both.stochastic_defect() < 0.2
    assert plain.stochastic_defect() < 1e-14
    assert both.symmetrised and not plain.symmetrised


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
def test_the_same_generator_gives_the_same_bits(method: str, bounce) -> None:
    def run(seed: int) -> ker.KernelMatrix:
        rng = np.random.default_rng(seed)
        return ker.discretise(bounce(), ker.Bins(8), method=method, samples=2**12, rng=rng)  # type: ignore[arg-type]

    assert np.array_equal(run(1).counts, run(1).counts)
    assert not np.array_equal(run(1).counts, run(2).counts)
    without = [ker.discretise(bounce(), ker.Bins(8), method=method, samples=2**12).counts for _ in range(2)]  # type: ignore[arg-type]
    assert np.array_equal(*without)


def test_replicates_average_to_the_matrix_and_number_eight(bounce) -> None:
    for basis in (ker.Bins(12), ker.Bins(300), ker.Legendre(6)):
        found = ker.discretise(bounce(), basis, "qmc", samples=2**15)
        assert len(found.replicates) == PARTS
        mean = sum(np.asarray(part.todense() if hasattr(part, "todense") else part) for part in found.replicates) / 8
        assert np.abs(mean - found.symmetric).max() < 1e-12


def test_quasi_monte_carlo_rounds_up_and_beats_monte_carlo(bounce) -> None:
    quasi = ker.discretise(bounce(), ker.Bins(16), "qmc", samples=50_000)
    plain = ker.discretise(bounce(), ker.Bins(16), "monte-carlo", samples=65_536)
    assert quasi.samples == 65_536
    assert float(quasi.error) < 0.35 * float(plain.error)


def test_a_wall_without_closed_form_is_sampled_and_says_so(bounce) -> None:
    law = ker.WallLaw(geo.dispersing_arcs(0.5))
    found = ker.discretise(law, ker.Bins(16), method="qmc", samples=2**14)
    assert found.method == "qmc" and "tolerance" in repr(found)
    with pytest.raises(InputError, match=r"it has .*quadrature.*monte-carlo"):
        ker.discretise(law, ker.Bins(16), method="exact")
    driven = bounce()
    alone = ker.discretise(driven, ker.Bins(16), samples=2**14)
    mixed = ker.discretise(0.5 * driven + 0.5 * ker.lambertian(), ker.Bins(16), samples=2**14)
    assert mixed.method == "qmc + quadrature"
    assert mixed.symmetry_defect().z_score == alone.symmetry_defect().z_score
    chained = ker.discretise(driven @ driven, ker.Bins(16), samples=2**14)
    assert chained.method == "monte-carlo"


def test_rays_that_never_escape_are_counted_bounded_and_finally_refused(bounce) -> None:
    @dataclass(frozen=True)
    class Leaky(type(bounce())):
        lost: float = 0.0

        def random_map(self) -> RandomMap:
            return lambda x, theta: (self.reflect(x, theta), x > self.lost)

    whole, few = (ker.discretise(Leaky(lost=lost), ker.Bins(8), samples=2**16) for lost in (0.0, 5e-5))
    assert whole.unresolved == 0.0 < few.unresolved < 1e-4
    assert float(few.error) >= 2.0 * few.unresolved * 8
    with pytest.raises(AccuracyError, match="did not escape") as caught:
        ker.discretise(Leaky(lost=0.01), ker.Bins(8), samples=2**14)
    assert caught.value.defect == pytest.approx(0.01, rel=0.2)


def test_bins_without_rays_are_named(bounce) -> None:
    with pytest.raises(AccuracyError, match="bins have no incoming pair"):
        ker.discretise(bounce(), ker.Bins(64), "monte-carlo", samples=64)


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
def test_an_event_that_no_ray_meets_is_within_the_errors(method: ker.Method) -> None:
    # a wall that is flat but for notches, which few of the rays enter
    law, flat = ker.RectangularTeethLaw(1e-6), ker.discretise(ker.specular(), ker.Bins(16))
    exact = ker.discretise(law, flat.basis, "exact")
    found = ker.discretise(law, flat.basis, method, samples=8192, rng=1)
    assert 1e-6 < np.linalg.norm(found.symmetric - exact.symmetric) <= float(found.error) < 0.01
    between = ker.distance(found, flat)
    assert 1e-6 < float(ker.distance(exact, flat)) - between.value <= between.error < 0.01
    errors = spec.spectrum(found, k=3).errors
    # off the constants
    assert np.all(errors.quantile * errors.sampling[1:] >= 3.0 / 8192)


def test_rays_that_all_go_to_one_cell_leave_the_error_of_events_that_none_met() -> None:
    # the cells below and above pi/2 are exchanged: counts have no variance
    missed = 1.0 - 0.05 ** (1.0 / 4096.0)
    basis = ker.Bins([0.0, 0.5 * np.pi, np.pi])
    law = ker.InvolutionLaw(lambda theta: np.pi - np.asarray(theta))
    for method in ("qmc", "monte-carlo"):
        found = ker.discretise(law, basis, method=method, samples=4096)
        exact = np.array([[0.0, 1.0], [1.0, 0.0]])
        assert np.linalg.norm(found.symmetric - exact) < 1e-13
        assert float(found.error) == pytest.approx(2.0 * missed, rel=1e-9)
