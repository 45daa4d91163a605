"""The best proved gap among walls of one arc
===========================================

Which hollow arc makes particles forget their direction fastest? The gap of the law, in the paper's convention, has
three local maxima between half angles 0 and pi/2; the greatest is near 0.752, where two eigenvalues cross. The gaps
of a grid are estimated, and that of the best wall is proved, which takes about a minute of one core.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/best_proved_gap.png"

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

GRID = (0.5, 0.505, 0.6, 0.75, 0.752, 0.755, 0.9, 0.98, 1.1, 1.3, 1.5)


def main(half_angles: Sequence[float] = GRID, width: float = 1e-3) -> tuple[Any, float, Any]:
    """The estimates, the half angle of the greatest, and the theorem on its gap."""
    table = spec.sweep(geo.focusing_arcs, {"half_angle": half_angles}, "gap", tolerance=1e-3)
    gaps = [row.value or 0.0 for row in table.of("gap")]
    best = float(half_angles[int(np.argmax(gaps))])
    return table, best, spec.prove_gap(ker.WallLaw(geo.focusing_arcs(best)), width)


if __name__ == "__main__":
    table, best, proof = main()
    for row in table.of("gap"):
        print(f"half angle {row.point['half_angle']:5.3f}  gap {row.in_words()}")
    print(f"the best of these, half angle {best:g}:")
    print(proof.statement)
