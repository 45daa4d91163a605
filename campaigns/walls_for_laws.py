"""Walls for target laws: defect and joint distance as functions of the numbers of moments and of hollows.

``python -m campaigns.walls_for_laws [--write]`` prints the table of docs/theory/from-a-law-to-a-wall.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import click
import numpy as np

from asperity import kernels as ker

from .pages import DOCS, print_table, write_between_marks

PAGE = DOCS / "theory" / "from-a-law-to-a-wall.md"
MOMENTS = (4, 6, 8, 10, 12, 14)
EXTREME_MOMENTS = (6, 10)


def laws() -> dict[str, ker.Law]:
    """Diffuse laws, a coin, a random symmetric matrix, and two extreme points."""
    rng = np.random.default_rng(11)
    # the mean of permutation matrices and their transposes is symmetric and doubly stochastic
    flux = np.mean([np.eye(8)[rng.permutation(8)] for _ in range(6)], axis=0)
    cells = ker.Bins(8)
    matrix = ker.discretise(ker.lambertian(), cells)
    symmetric = 0.5 * (flux + flux.T)
    return {
        "Lambert": ker.lambertian(),
        "Maxwell, 1/2": ker.maxwell(0.5),
        "Henyey-Greenstein, 1/2": ker.henyey_greenstein(0.5),
        "Henyey-Greenstein, -1/2": ker.henyey_greenstein(-0.5),
        "fair coin of specular and retro": 0.5 * ker.specular() + 0.5 * ker.retroreflection(),
        "random symmetric matrix": ker.MatrixLaw(ker.KernelMatrix(symmetric, cells, matrix.error, reversible=True)),
        "least resistance": ker.LeastResistanceLaw(),
        "retroreflection": ker.retroreflection(),
    }


HEADS = "law | moments | hollows | pieces | defect | could be smaller by | joint distance | s"


def rows() -> Iterator[str]:
    """One row for each law and number of moments."""
    for name, law in laws().items():
        extreme = name in ("least resistance", "retroreflection")
        for moments in EXTREME_MOMENTS if extreme else MOMENTS:
            start = time.process_time()
            found = ker.wall_for(law, moments=moments)
            seconds = time.process_time() - start
            yield (
                f"{name} | {moments} | {len(found.hollows)} | {len(found.wall.pieces)} | {float(found.defect):.1e} | "
                f"{float(found.bound):.1e} | {float(found.distance):.4f} ± {found.distance.error:.4f} | {seconds:.1f}"
            )


@click.command()
@click.option("--write", is_flag=True, help="Write the table into the page.")
def main(write: bool) -> None:
    """Print the table."""
    measured = print_table(HEADS, rows())
    if write:
        write_between_marks(PAGE, measured)


if __name__ == "__main__":
    main()
