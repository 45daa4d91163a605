"""Between smooth and no-slip
==========================

Between smooth and no-slip: a disk on rectangular teeth.

The teeth send a ray back or on, so that the disk's law is a coin toss between the matrices A_smooth and A_no-slip. The
coin depends on the angle and on the foreshortened depth of the teeth, not monotonically: it oscillates between 0 and
1/2, because half of the wall is flat tops.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/no_slip_or_smooth.png"

from __future__ import annotations

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker


def main(depths: tuple[float, ...] = (0.25, 0.5, 1.0, 4.0), theta: float = 1.0) -> dict[float, float]:
    """Probability of the no-slip matrix at the angle ``theta``, for each ratio height/width of the teeth."""
    disk = geo.Disk(mass=1.0, inertia_ratio=0.5)
    no_slip = ker.no_slip_matrix(disk)
    found = {}
    for ratio in depths:
        K = ker.CollisionLaw.from_wall(geo.rectangular_teeth(ratio), disk)
        found[ratio] = sum(float(p) for p, matrix in K.branches(theta) if np.allclose(matrix, no_slip))
    return found


if __name__ == "__main__":
    for ratio, fraction in main().items():
        print(f"height/width {ratio:5g}: no-slip with probability {fraction:.12f}")
