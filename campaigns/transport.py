"""Optimal transport: ``python -m campaigns.transport``.

Row-wise distances against a loop of POT's, exact joint distances, bounds of the least resistance, and false alarms of
the difference test in 2,000 runs.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from asperity import kernels as ker
from asperity.core.tables import table
from asperity.kernels.distances.transport import grid_wasserstein

from .timing import least_time

BINS, REPEATS = 512, 5
# Sizes for the generated page.
PAGE_JOINT, PAGE_CELLS = (32, 64), (256, 1024)
ALARM_RUNS, ALARM_PAIRS, ALARM_BINS, LEVEL = 2000, 300, 6, 0.05
# computed by campaigns/judges/precise_least_resistance.py
LEAST = 0.987823750351585515600495963


@dataclass(frozen=True)
class RowTimes:
    """Row-wise distances of two matrices: seconds of asperity and of POT, and the largest difference."""

    bins: int
    seconds: float
    pot_seconds: float
    difference: float

    @property
    def ratio(self) -> float:
        """POT's time over asperity's."""
        return self.pot_seconds / self.seconds


def measure_rows() -> RowTimes:
    """W_1 of all rows by distribution functions, and by a loop over `ot.wasserstein_1d`."""
    import ot

    rng = np.random.default_rng(0)
    points = np.sort(rng.random(BINS)) * np.pi
    one, other = (rng.dirichlet(np.full(BINS, 0.3), BINS) for _ in range(2))
    ours, seconds = least_time(lambda: grid_wasserstein(one, other, points), REPEATS)
    pot, pot_seconds = least_time(
        lambda: [float(ot.wasserstein_1d(points, points, *pair)) for pair in zip(one, other, strict=True)], REPEATS
    )
    return RowTimes(BINS, seconds, pot_seconds, float(np.abs(ours - pot).max()))


def measure_joint(sizes: Iterable[int]) -> list[tuple[int, ker.Distance, float]]:
    """Joint distances of Henyey-Greenstein matrices: size, distance, seconds; from about 64 bins on, bins are
    merged."""
    rows = []
    for size in sizes:
        pair = [ker.discretise(ker.henyey_greenstein(g), ker.Bins(size)) for g in (0.5, 0.7)]
        rows.append((size, *least_time(lambda pair=pair: ker.distance(*pair, kind="joint"), 1)))
    return rows


def measure_extremes(sizes: Iterable[int]) -> list[tuple[int, float, float, float]]:
    """Cells, distance of the bounds of the least resistance from its value, and seconds."""
    rows = []
    for size in sizes:
        found, seconds = least_time(lambda size=size: ker.extremal_resistance(size), 1)
        rows.append((size, LEAST - found.lower, found.upper - LEAST, seconds))
    return rows


def count_false_alarms() -> int:
    """Number of seeds for which the test at 5 % separates two samples of one law."""
    law, alarms = ker.maxwell(0.4), 0
    for seed in range(ALARM_RUNS):
        rng = np.random.default_rng(seed)
        pair = []
        for pairs in (ALARM_PAIRS, ALARM_PAIRS * 2 // 3):
            theta = ker.SINE.sample(pairs, rng)
            pair.append(ker.estimate(theta, law.sample(theta, rng), ker.Bins(ALARM_BINS)))
        alarms += ker.difference_test(*pair, permutations=99, rng=rng).differs(LEVEL)
    return alarms


def transport_table(joint: Iterable[int], cells: Iterable[int]) -> str:
    """A table of the time for comparing laws by transport, without the false alarms, which take minutes."""
    rows = measure_rows()
    ratio = f"a loop over POT: {rows.pot_seconds:.2g} s, {rows.ratio:.0f} times; same to {rows.difference:.0e}"
    lines = [f"distances of {rows.bins} rows | exact | {rows.seconds:.2g} | {ratio}"]
    for size, found, seconds in measure_joint(joint):
        lines.append(f"joint distance on {size} bins | {found.value:.6f} +- {found.error:.1e} | {seconds:.2g} | -")
    for size, below, above, seconds in measure_extremes(cells):
        value = f"bounds -{below:.1e}, +{above:.1e}"
        lines.append(f"least resistance on {size} cells | {value} | {seconds:.2g} | its closed form")
    return table("transport | result | seconds | compared with", lines)


def main() -> None:
    """Print the table with more sizes, and the false alarms."""
    from scipy.stats import binomtest

    print(transport_table((16, 32, 48, 64, 128), (256, 1024, 4096)))
    alarms = count_false_alarms()
    p_value = binomtest(alarms, ALARM_RUNS, LEVEL).pvalue
    print(f"\nFalse alarms: {alarms} of {ALARM_RUNS}, p = {p_value:.2g} for a rate of {LEVEL:g}")


if __name__ == "__main__":
    main()
