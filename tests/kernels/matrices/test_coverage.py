"""Intervals of 95 % hold in 95 % of repetitions, not much more often, for a few estimates of the campaign."""

from __future__ import annotations

import numpy as np
import pytest
from campaigns.errors.coverage import ESTIMATES
from scipy.stats import binomtest

from asperity.kernels.sampling.counts import LEVEL, _squared_norms, half_width

REPEATS = 120
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


def test_squared_errors_vary_as_multinomial_counts_do_also_where_most_are_none() -> None:
    # 40 draws of 200 cells, every other with ten times the weight: normal counts would have half of the variance
    fraction, weight = np.full(200, 1 / 200), np.where(np.arange(200) % 2, 1.0, 10.0)
    counts = np.random.default_rng(1).multinomial(40, fraction, size=20_000)
    squares = (counts - 0.2) ** 2 @ weight
    mean, variance = _squared_norms(counts, weight, counts.sum(axis=1))
    assert np.mean(mean) == pytest.approx(np.mean(squares), rel=0.01)
    # fractions from so few draws are uneven, which takes 11 % away
    assert np.mean(variance) == pytest.approx(np.var(squares), rel=0.2)


def test_the_half_width_of_parts_is_students_where_they_vary_in_one_direction() -> None:
    parts = [np.array([[value, 0.0], [0.0, 0.0]]) for value in (1.0, 2.0, 4.0, 3.0, 5.0, 2.0, 1.0, 6.0)]
    mean = np.mean(parts, axis=0)
    # t of 7 degrees of freedom, 97.5 %: 2.364624
    assert half_width(mean, parts) == pytest.approx(
        2.364624 * np.std([p[0, 0] for p in parts], ddof=1) / 8**0.5, rel=1e-6
    )
