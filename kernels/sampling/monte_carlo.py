"""Matrices of laws from independent rays."""

from __future__ import annotations

import numpy as np

from ...core.long_runs import Engine
from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from .chunks import IndependentRays, count_long
from .counts import BATCHES, LARGEST_REPLICATES
from .rays import RaySums
from .sobol import PARTS

# Tracing this number of rays takes about a second.
DEFAULT_SAMPLES = 2**20


def independent_rays(
    law: Law,
    basis: Basis,
    samples: int,
    rng: np.random.Generator,
    symmetrise: bool,
    engine: Engine | None = None,
) -> KernelMatrix:
    """The matrix of a law from independent rays with incoming angles from the invariant measure; see `RaySums.matrix`.

    In bases without cells the error comes from the spread of 32 parts, or of 8 if 32 matrices are too large to store.
    A chunk of rays depends only on numbers drawn from ``rng``, its part and its own index. With an ``engine`` its
    workers count or add up the rays and its checkpoint stores the sums, which are the same to the last bit.
    """
    root = tuple(int(word) for word in rng.integers(0, 2**63, size=2))
    most = LARGEST_REPLICATES // (np.dtype(np.float64).itemsize * basis.size**2)
    parts = 1 if basis.is_partition else BATCHES if most >= BATCHES else PARTS
    sums = RaySums(law, basis, parts)
    sums.each = max(-(-samples // parts), 1)
    count_long(sums, IndependentRays(law, basis, root, sums.each, parts), engine or {})
    return sums.matrix(symmetrise=symmetrise)
