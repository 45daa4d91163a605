"""Memory of an estimate by rays as a function of the number of rays."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

# Bins, and rays of successive estimates; 10^10 rays would be more chunks, each added to the same counts.
BINS, RAYS = 512, (2**20, 2**22, 2**23)
# Fraction by which the interpreter's own objects may change the memory.
SAME = 0.02


@dataclass(frozen=True)
class MemoryUse:
    """Peaks of allocated bytes, one for each number of rays, and the bytes of the matrix of counts."""

    rays: tuple[int, ...]
    peaks: tuple[int, ...]
    matrix: int

    @property
    def grows(self) -> bool:
        """Whether more rays take more memory."""
        return max(self.peaks[1:]) > (1.0 + SAME) * self.peaks[0]


def measure_memory(rays: tuple[int, ...] = RAYS) -> MemoryUse:
    """Measure peaks, including numpy's allocations, without the memory in use before the first estimate."""
    law, basis = ker.WallLaw(geo.dispersing_arcs(1.0)), ker.Bins(BINS)
    peaks = []
    _estimate(law, basis, min(rays) // 4)
    for number in rays:
        tracemalloc.start()
        _estimate(law, basis, number)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    return MemoryUse(rays, tuple(peaks), 8 * BINS**2)


def _estimate(law: ker.Law, basis: ker.Basis, rays: int) -> None:
    ker.discretise(law, basis, "monte-carlo", samples=rays, rng=np.random.default_rng(0))


if __name__ == "__main__":
    print(measure_memory())
