"""Means over rays of independent scrambled Sobol sequences, with errors from the spread of the sequences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from asperity.kernels.sampling.counts import count_pairs, sum_products

NETS, CHUNK, SEED = 16, 2**18, 20261121


@dataclass(frozen=True)
class Found:
    """A value, its error and its source."""

    value: Floats
    error: float
    source: str


def rays_of(wall: geo.Wall, number: int, net: int) -> Iterator[tuple[Floats, Floats]]:
    """Incoming and outgoing angles of one scrambled Sobol sequence, in chunks."""
    law, engine = ker.WallLaw(wall), Sobol(2, scramble=True, bits=52, rng=np.random.default_rng([SEED, net]))
    tiny, below_one = np.finfo(float).tiny, np.nextafter(1.0, 0.0)
    for start in range(0, number, CHUNK):
        points = engine.random(min(CHUNK, number - start)).clip(tiny, below_one)
        theta = np.arccos(1.0 - 2.0 * points[:, 1]).clip(1e-9, np.pi - 1e-9)
        yield theta, law.reflect(points[:, 0], theta)


def sampled_sums(wall: geo.Wall, bases: dict[str, ker.Basis], rays: int) -> dict[str, list[Floats]]:
    """Symmetrised means of e_i(theta) e_j(theta') for every sequence and basis."""
    nets: dict[str, list[Floats]] = {name: [] for name in bases}
    for net in range(NETS):
        sums = {name: np.zeros((basis.size, basis.size)) for name, basis in bases.items()}
        for theta, out in rays_of(wall, rays // NETS, net):
            for name, basis in bases.items():
                if basis.is_partition:
                    sums[name] += count_pairs(basis, theta, out) * np.outer(basis.normalisation, basis.normalisation)
                else:
                    sums[name] += sum_products(basis, theta, out)
        for name, total in sums.items():
            nets[name].append((total + total.T) * (0.5 * NETS / rays))
    return nets


def mean_and_error(values: list[Floats]) -> tuple[Floats, float]:
    """Mean over the sequences, and the Frobenius norm of its standard errors."""
    table = np.asarray(values)
    return table.mean(axis=0), float(np.sqrt(np.sum(table.var(axis=0, ddof=1)) / len(table)))
