"""The exact laws of fifty random polygonal hollows, against identities and against 10^6 traced rays each.

``python -m campaigns.hollows`` prints a row for each hollow and the smallest of the fifty p-values.
``tests/kernels/polygons/test_marching.py`` compares the beams of the same hollows with interval marching, the second
exact method.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from campaigns.judges.random_hollows import random_hollow, wall_with
from campaigns.judges.traced_pairs import chi_square_p

from .pages import print_table

HOLLOWS, RAYS, CELLS = 50, 1_000_000, 12


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.hollows", description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays into every hollow")
    rays = parser.parse_args().rays
    p_values: list[float] = []
    heads = "hollow | vertices | graph | unresolved, a bound | mass - 1 | detailed balance | p of chi-square"
    print_table(heads, _rows(rays, p_values))
    print(f"\nSmallest p-value of {HOLLOWS}: {min(p_values):.2g}")


def _rows(rays: int, p_values: list[float]) -> Iterator[str]:
    for seed in range(HOLLOWS):
        chain = random_hollow(seed)
        wall = geo.Wall.from_vertices(wall_with(chain))
        law = ker.PolygonLaw(wall)
        kernel = ker.discretise(law, ker.Bins(64))
        balance = float(np.linalg.norm(kernel.symmetric - kernel.symmetric.T))
        p_value = chi_square_p(wall, law, rays, CELLS, np.random.default_rng([seed, 1]))
        p_values.append(p_value)
        graph = "yes" if np.all(np.diff(chain[:, 0]) >= 0.0) else "no"
        yield (
            f"{seed} | {len(chain)} | {graph} | {float(law.unresolved):.1e} | {law.isometry_table().mass() - 1.0:.1e} "
            f"| {balance:.1e} | {p_value:.3f}"
        )


if __name__ == "__main__":
    main()
