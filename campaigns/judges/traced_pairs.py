"""Traced rays against an exact law: Pearson's chi-square of the pairs of bins that they come from and go to."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from asperity import geometry as geo
from asperity import kernels as ker

# Pairs of bins where fewer rays are expected are counted together, so that the statistic is nearly chi-square.
FEWEST_EXPECTED = 10.0


def chi_square_p(wall: geo.Wall, law: ker.Law, rays: int, cells: int, rng: np.random.Generator) -> float:
    """The fraction of fair samples that would agree worse with the law than this one of the wall's traced rays.

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
