"""Matrices of laws from independent rays."""

from __future__ import annotations

import numpy as np

from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import DrivenLaw, Law, entry_inside
from .counts import BATCHES, LARGEST_REPLICATES, SampledArray
from .rays import RaySums, progress_bar
from .sobol import PARTS

# Tracing this number of rays takes about a second.
DEFAULT_SAMPLES = 2**20


def independent_rays(
    law: Law, basis: Basis, samples: int, rng: np.random.Generator, symmetrise: bool
) -> tuple[SampledArray, int, float]:
    """The matrix of a law from independent rays with incoming angles from the invariant measure; see `RaySums.array`.

    In bases without cells the error comes from the spread of 32 parts, or of 8 if 32 matrices are too large to store.
    A chunk of rays depends only on numbers drawn from ``rng``, its part and its own index.
    """
    root = [int(word) for word in rng.integers(0, 2**63, size=2)]
    most = LARGEST_REPLICATES // (np.dtype(np.float64).itemsize * basis.size**2)
    parts = 1 if basis.is_partition else BATCHES if most >= BATCHES else PARTS
    sums = RaySums(law, basis, parts)
    chunk = sums.chunk
    sums.each = max(-(-samples // parts), 1)
    # The map of a driven law also returns whether each ray escaped.
    reflect = law.random_map() if isinstance(law, DrivenLaw) and law.closed_form is None else None
    with progress_bar(parts * sums.each) as bar:
        for part in range(parts):
            for index, start in enumerate(range(0, sums.each, chunk)):
                own = np.random.default_rng([*root, part, index])
                theta = SINE.sample(min(chunk, sums.each - start), own)
                if reflect is None:
                    outgoing = law.sample(theta, own)
                else:
                    outgoing, escaped = reflect(entry_inside(own.random(theta.shape)), theta)
                    sums.count_unresolved(escaped)
                sums.add(part, theta, outgoing)
                bar.update(theta.size)
    return sums.array(symmetrise=symmetrise)
