"""The exact laws of fifty random polygonal hollows, against identities and against 10^6 traced rays each.

``tests/geometry/polygons/test_marching.py`` compares the beams of the same hollows with interval marching, the second
exact method.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import chi2

from asperity import geometry as geo
from asperity import kernels as ker
from campaigns.cases.random_hollows import random_hollow, wall_with
from campaigns.engine import Campaign, Judged

HOLLOWS, RAYS, CELLS, BINS = 50, 1_000_000, 12, 64
# A fair sample has a smaller p-value in one hollow of a hundred thousand.
RARE = 1e-5
# Rounding of the mass, and of each entry of the flux.
ROUNDING = 1e-14
# Pairs of bins where fewer rays are expected are counted together, so that the statistic is nearly chi-square.
FEWEST_EXPECTED = 10.0


def judge(number: int) -> Iterator[Judged]:
    """Mass and detailed balance of the law, and the fraction of fair samples that agree worse with it than its rays."""
    wall = geo.Wall.from_vertices(wall_with(random_hollow(number)))
    law = ker.PolygonLaw(wall)
    unresolved = float(law.unresolved)
    yield Judged("mass", unresolved + ROUNDING, abs(law.isometry_table().mass() - 1.0))
    symmetric = ker.discretise(law, ker.Bins(BINS)).symmetric
    yield Judged("detailed balance", unresolved + BINS * ROUNDING, float(np.linalg.norm(symmetric - symmetric.T)))
    p_value = chi_square_p(wall, law, RAYS, CELLS, np.random.default_rng([number, 1]))
    yield Judged("traced rays", fault=f"p = {p_value:.2g}" if p_value < RARE else "")


def chi_square_p(wall: geo.Wall, law: ker.Law, rays: int, cells: int, rng: np.random.Generator) -> float:
    """The p-value of Pearson's chi-square for the pairs of bins that traced rays come from and go to.

    It is 0 if a ray did not escape, or went where the law has less than 1e-9 of the flux.
    """
    basis = ker.Bins(cells)
    x, theta = rng.uniform(0.0, wall.period, rays), ker.SINE.sample(rays, rng)
    traced = geo.trace(wall, x, theta)
    pairs = np.bincount(basis.index(theta) * cells + basis.index(traced.theta), minlength=cells * cells)
    expected = rays * ker.discretise(law, basis).flux.ravel()
    if not traced.escaped.all() or pairs[expected < 1e-9 * rays].sum() > 0:
        return 0.0
    rare = expected < FEWEST_EXPECTED
    counts = np.append(pairs[~rare], pairs[rare].sum())
    means = np.append(expected[~rare], expected[rare].sum())
    counts, means = counts[means > 1e-6], means[means > 1e-6]
    return float(chi2.sf(np.sum((counts - means) ** 2 / means), counts.size - 1))


CAMPAIGNS = (
    Campaign("polygons", "Is the table of isometries the law of the rays?", int, judge, HOLLOWS, range(2)),
)  # fmt: skip
