"""The exact laws of fifty random polygonal hollows, against identities and against 10^6 traced rays each.

``tests/kernels/polygons/test_marching.py`` compares the beams of the same hollows with interval marching, the second
exact method.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from campaigns.engine import Campaign, Judged
from campaigns.judges.random_hollows import random_hollow, wall_with
from campaigns.judges.traced_pairs import chi_square_p

HOLLOWS, RAYS, CELLS, BINS = 50, 1_000_000, 12, 64
# A fair sample has a smaller p-value in one hollow of a hundred thousand.
RARE = 1e-5
# Rounding of the mass, and of each entry of the flux.
ROUNDING = 1e-14


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


CAMPAIGNS = (
    Campaign("polygons", "Is the table of isometries the law of the rays?", int, judge, HOLLOWS, range(2)),
)  # fmt: skip
