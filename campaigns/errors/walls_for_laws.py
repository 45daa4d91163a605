"""The two tables of docs/theory/from-a-law-to-a-wall.md: ``python -m campaigns.errors.walls_for_laws``.

Walls for target laws: defect and joint distance as functions of the numbers of moments and of hollows. Chambers that
perform interval exchanges: their losses, and the order of the losses in the width of the opening.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from asperity import kernels as ker
from campaigns.pages import print_table

WALL_HEADS = "law | moments | hollows | pieces | defect | could be smaller by | joint distance | s"
CHAMBER_HEADS = (
    "law | cells | mirrors | loss at 1e-2 | at 1e-3 | at 1e-4 | order | distance of 10^6 generations at 1e-2 | at 1e-3"
)
OPENINGS, SAMPLES = (1e-2, 1e-3, 1e-4), 2**20
# Generations whose distance is given, and their necks.
GENERATIONS, NECK = 10**6, 1e-3
LAMBERT, HALF, FORWARD = ker.lambertian(), ker.maxwell(0.5), ker.henyey_greenstein(0.5)
SPECULAR, RETRO = ker.specular(), ker.retroreflection()


def random_matrix() -> ker.Law:
    """The mean of permutation matrices and their transposes, which is symmetric and doubly stochastic."""
    rng, cells = np.random.default_rng(11), ker.Bins(8)
    flux = np.mean([np.eye(8)[rng.permutation(8)] for _ in range(6)], axis=0)
    error = ker.discretise(LAMBERT, cells).error
    return ker.MatrixLaw(ker.KernelMatrix(0.5 * (flux + flux.T), cells, error, reversible=True))


def walls() -> Iterator[str]:
    """Diffuse laws, a coin, a random symmetric matrix, and two extreme points: a row for each number of moments."""
    laws = {
        "Lambert": LAMBERT, "Maxwell, 1/2": HALF, "Henyey-Greenstein, 1/2": FORWARD,
        "Henyey-Greenstein, -1/2": ker.henyey_greenstein(-0.5),
        "fair coin of specular and retro": 0.5 * SPECULAR + 0.5 * RETRO, "random symmetric matrix": random_matrix(),
        "least resistance": ker.LeastResistanceLaw(), "retroreflection": RETRO,
    }  # fmt: skip
    for name, law in laws.items():
        for moments in (6, 10) if name in ("least resistance", "retroreflection") else (4, 6, 8, 10, 12, 14):
            start = time.process_time()
            found = ker.wall_for(law, moments=moments)
            seconds = time.process_time() - start
            yield (
                f"{name} | {moments} | {len(found.hollows)} | {len(found.wall.pieces)} | {float(found.defect):.1e} | "
                f"{float(found.bound):.1e} | {float(found.distance):.4f} ± {found.distance.error:.4f} | {seconds:.1f}"
            )


def chambers() -> Iterator[str]:
    """One row for each exchange."""
    exchanges = (
        ("Lambert", LAMBERT, 2), ("Lambert", LAMBERT, 4), ("Maxwell, 1/2", HALF, 4),
        ("Henyey-Greenstein, 1/2", FORWARD, 5), ("specular", SPECULAR, 4), ("retroreflection", RETRO, 1),
    )  # fmt: skip
    for name, law, cells in exchanges:
        exchange = ker.IntervalExchangeLaw(ker.discretise(law, ker.Bins(cells)))
        hollows = [ker.exchange_hollow(exchange, opening) for opening in OPENINGS]
        losses = [hollow.loss(SAMPLES) for hollow in hollows]
        order = np.log10(losses[0].value / losses[2].value) / 2.0
        spread = np.hypot(*(losses[k].error / losses[k].value for k in (0, 2))) / np.log(100.0)
        measured = " | ".join(f"{loss.value:.2e} ± {loss.error:.0e}" for loss in losses)
        distances = [hollow.generations(GENERATIONS, NECK).distance for hollow in hollows[:2]]
        far = " | ".join(f"{one.value:.4f} ± {one.error:.4f}" for one in distances)
        yield f"{name} | {cells} | {hollows[0].mirrors} | {measured} | {order:.2f} ± {spread:.2f} | {far}"


if __name__ == "__main__":
    print_table(WALL_HEADS, walls())
    print_table(CHAMBER_HEADS, chambers())
