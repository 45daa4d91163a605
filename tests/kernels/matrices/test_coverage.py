"""Intervals of 95 % hold in 95 % of repetitions: the campaign of campaigns/coverage.py in small."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from campaigns.coverage import (
    MAXWELL,
    SCATTERING,
    TEETH,
    Tally,
    distance_once,
    eigenvalue_once,
    matrix_once,
    pairs_once,
    resistance_once,
    tally,
)
from scipy.stats import binomtest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.sampling.counts import LEVEL, _squared_norms, half_width
from asperity.study import check_tracer

REPEATS = 120
# A coverage of 95 % gives a smaller p-value once in two thousand cases.
RARE = 5e-4


def is_calibrated(found: Tally) -> bool:
    return binomtest(found.held, found.repeats, LEVEL).pvalue > RARE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "basis", "symmetrise"),
    [
        ("monte-carlo", ker.Bins(4), False), ("monte-carlo", ker.Bins(24), True),
        ("monte-carlo", ker.Legendre(6), False),
        ("qmc", ker.Bins(4), True), ("qmc", ker.Bins(24), False), ("qmc", ker.Legendre(6), True),
    ],
)  # fmt: skip
def test_errors_of_sampled_matrices_hold_in_95_of_100_cases(method: str, basis: ker.Basis, symmetrise: bool) -> None:
    assert is_calibrated(tally(matrix_once(TEETH, basis, method, 2048, symmetrise), REPEATS))


@pytest.mark.slow
@pytest.mark.parametrize("law", [SCATTERING, MAXWELL], ids=repr)
def test_errors_hold_against_matrices_that_are_known_by_hand(law: ker.Law) -> None:
    assert is_calibrated(tally(matrix_once(law, ker.Legendre(4), "monte-carlo", 2048, False), REPEATS))


def test_squared_errors_vary_as_multinomial_counts_do_also_where_most_are_none() -> None:
    # 40 draws of 200 cells, every other with ten times the weight: normal counts would have half of the variance
    fraction, weight = np.full(200, 1 / 200), np.where(np.arange(200) % 2, 1.0, 10.0)
    counts = np.random.default_rng(1).multinomial(40, fraction, size=20_000)
    squares = (counts - 0.2) ** 2 @ weight
    mean, variance = _squared_norms(counts, weight, counts.sum(axis=1))
    assert np.mean(mean) == pytest.approx(np.mean(squares), rel=0.01)
    # fractions from so few draws are uneven, which takes 11 % away
    assert np.mean(variance) == pytest.approx(np.var(squares), rel=0.2)


@pytest.mark.parametrize("invariant", [True, False])
@pytest.mark.parametrize("basis", [ker.Bins(8), ker.Legendre(4)], ids=repr)
def test_errors_of_pairs_hold_in_95_of_100_cases(basis: ker.Basis, invariant: bool) -> None:
    found = tally(pairs_once(basis, 4000, invariant, False), REPEATS)
    # weights by nearest angles make estimates more even than independent batches know
    assert is_calibrated(found) or (not invariant and found.coverage > LEVEL)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "which"), [("monte-carlo", "gap"), ("qmc", "slem")])
def test_sampling_errors_of_eigenvalues_hold_in_95_of_100_cases(method: str, which: str) -> None:
    assert is_calibrated(tally(eigenvalue_once(TEETH, ker.Legendre(6), method, 4096, which), REPEATS))


@pytest.mark.parametrize("kind", ["rows", "sup"])
def test_distances_of_a_sample_from_its_own_law_hold_in_95_of_100_cases(kind: str) -> None:
    found = tally(distance_once(1, kind, True, 1), REPEATS)
    assert is_calibrated(found) or found.coverage > LEVEL
    assert found.ratio < 1.6


@pytest.mark.parametrize(("alike", "sampled"), [(True, 2), (False, 1), (False, 2)])
def test_other_distances_of_samples_hold_at_least_as_often(alike: bool, sampled: int) -> None:
    assert tally(distance_once(1, "rows", alike, sampled), 60).coverage >= LEVEL


def test_resistances_by_rays_hold_in_95_of_100_cases() -> None:
    assert is_calibrated(tally(partial(resistance_once, rays=2**14), REPEATS))


def test_the_mean_number_of_collisions_of_a_study_holds_in_95_of_100_cases() -> None:
    wall = geo.focusing_arcs(1.2)

    def once(rng: np.random.Generator) -> tuple[float, float]:
        found = check_tracer(wall, rng)
        # Kac: the length of the hollows over that of their openings, 1.2/sin(1.2)
        return abs(found.mean_collisions.value - 1.2 / np.sin(1.2)), found.mean_collisions.error

    assert is_calibrated(tally(once, 60))


def test_the_half_width_of_parts_is_students_where_they_vary_in_one_direction() -> None:
    parts = [np.array([[value, 0.0], [0.0, 0.0]]) for value in (1.0, 2.0, 4.0, 3.0, 5.0, 2.0, 1.0, 6.0)]
    mean = np.mean(parts, axis=0)
    # t of 7 degrees of freedom, 97.5 %: 2.364624
    assert half_width(mean, parts) == pytest.approx(
        2.364624 * np.std([p[0, 0] for p in parts], ddof=1) / 8**0.5, rel=1e-6
    )
