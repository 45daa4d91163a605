"""Matrices by sampling: errors that are calibrated, z-scores that are those of noise, defects that are found out."""

from dataclasses import dataclass

import numpy as np
import pytest
from campaigns.errors.coverage import ESTIMATES
from scipy.stats import binomtest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.kernels.laws.law import DrivenLaw, RandomMap
from asperity.kernels.sampling import chunks as rays
from asperity.kernels.sampling.chunks import RaySums
from asperity.kernels.sampling.counts import LEVEL
from asperity.kernels.sampling.sobol import PARTS, SobolSampler


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
    class Drift(DrivenLaw):
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


def test_replicates_average_to_the_matrix_and_number_eight(bounce) -> None:
    for basis in (ker.Bins(12), ker.Bins(300), ker.Legendre(6)):
        found = ker.discretise(bounce(), basis, "qmc", samples=2**15)
        assert len(found.replicates) == PARTS
        assert np.abs(np.mean(found.replicates, axis=0) - found.symmetric).max() < 1e-12


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


@pytest.mark.parametrize("method", ["qmc", "monte-carlo"])
def test_an_event_that_no_ray_meets_is_within_the_errors(method) -> None:
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
    # the cells below and above pi/2 are exchanged: counts have no variance, and of independent pairs each row has had
    # one pair of the Lambertian law too
    missed, more = 1.0 - 0.05 ** (1.0 / 4096.0), {"qmc": 1.0, "monte-carlo": 1.3}
    basis = ker.Bins([0.0, 0.5 * np.pi, np.pi])
    law = ker.InvolutionLaw(lambda theta: np.pi - np.asarray(theta))
    for method in ("qmc", "monte-carlo"):
        found = ker.discretise(law, basis, method=method, samples=4096)
        exact = np.array([[0.0, 1.0], [1.0, 0.0]])
        assert np.linalg.norm(found.symmetric - exact) < 1e-13
        assert 1.0 - 1e-9 <= float(found.error) / (2.0 * missed) <= more[method] + 1e-9


REPEATS = 60
# A coverage of 95 % gives a smaller p-value once in two thousand cases.
RARE = 5e-4
TEETH = "TriangularTeethLaw(angle=1.1)"
EXACT = (
    f"matrix, {TEETH}, Bins(4), qmc, False", f"matrix, {TEETH}, Bins(16), monte-carlo, True",
    f"matrix, {TEETH}, Legendre(12), qmc, True", "matrix, henyey_greenstein(0.6), Legendre(3), monte-carlo, False",
    "matrix, 0.4*lambertian() + 0.6*specular(), Legendre(3), monte-carlo, False", "pairs, Bins(4), True, False",
    f"eigenvalue, {TEETH}, Legendre(6), monte-carlo, gap", f"eigenvalue, {TEETH}, Legendre(6), qmc, slem",
    "resistance", "mean collisions",
)  # fmt: skip
# Weights by nearest angles make estimates more even than independent batches know, and distances are not negative.
CAUTIOUS = ("pairs, Legendre(6), False, False", "distance, 1, rows, True, 1", "distance, 1, sup, True, 1")


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT + CAUTIOUS)
def test_errors_hold_in_95_of_100_cases_and_not_much_more_often(name: str) -> None:
    found = [ESTIMATES[name](np.random.default_rng([0, k])) for k in range(REPEATS)]
    true, reported = np.array(found, dtype=float).T
    held = int(np.count_nonzero(true <= reported))
    assert binomtest(held, REPEATS, LEVEL).pvalue > RARE or (name in CAUTIOUS and held > LEVEL * REPEATS)
    # a normal scalar has 1.96; with few replicates, Student's quantile is larger
    assert np.mean(reported) < (1.6 if name.startswith("distance") else 3.0) * np.sqrt(np.mean(true**2))


def test_counts_of_large_partitions_grow_into_wider_integers(monkeypatch) -> None:
    monkeypatch.setattr(rays, "BLOCK", 4)
    sums, angle = RaySums(ker.lambertian(), ker.Bins(3), 1), np.full((1, 2**15), 0.3)
    kinds = []
    for _ in range(4):
        sums.add_rows(0, angle, angle)
        kinds.append(sums.tables.dtype)
    assert kinds == [np.uint16, np.uint32, np.uint32, np.uint32] and sums.most == 4 * 2**15
    assert sums.tables[0].tolist() == [[4 * 2**15, 0, 0], [0, 0, 0], [0, 0, 0]]


def test_a_sample_that_goes_on_leaves_earlier_matrices_as_they_are(bounce) -> None:
    sampler = SobolSampler(bounce(), ker.Bins(4), np.random.default_rng(0))
    first = sampler.sampled(2**12, symmetrise=False)
    before = np.array(first.replicates)
    sampler.sampled(2**14, symmetrise=False)
    assert np.array_equal(np.array(first.replicates), before)
