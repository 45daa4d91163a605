"""Losses of the chambers that perform interval exchanges, and their order in the width of the opening.

``python -m campaigns.exchange_losses [--write]`` prints the table of docs/theory/from-a-law-to-a-wall.md.
"""

from __future__ import annotations

from collections.abc import Iterator

import click
import numpy as np

from asperity import kernels as ker

from .pages import print_table, write_between_marks
from .walls_for_laws import PAGE

OPENINGS = (1e-2, 1e-3, 1e-4)
SAMPLES = 2**20
# Generations whose distance is given, and their necks.
GENERATIONS, NECK = 10**6, 1e-3
EXCHANGES = (
    ("Lambert", ker.lambertian(), 2),
    ("Lambert", ker.lambertian(), 4),
    ("Maxwell, 1/2", ker.maxwell(0.5), 4),
    ("Henyey-Greenstein, 1/2", ker.henyey_greenstein(0.5), 5),
    ("specular", ker.specular(), 4),
    ("retroreflection", ker.retroreflection(), 1),
)

HEADS = (
    "law | cells | mirrors | loss at 1e-2 | at 1e-3 | at 1e-4 | order | distance of 10^6 generations at 1e-2 | at 1e-3"
)


def rows() -> Iterator[str]:
    """One row an exchange."""
    for name, law, cells in EXCHANGES:
        exchange = ker.IntervalExchangeLaw(ker.discretise(law, ker.Bins(cells)))
        hollows = [ker.exchange_hollow(exchange, opening) for opening in OPENINGS]
        losses = [hollow.loss(SAMPLES) for hollow in hollows]
        value, error = (np.array([getattr(loss, key) for loss in losses]) for key in ("value", "error"))
        order = np.log10(value[0] / value[2]) / 2.0
        spread = np.hypot(error[0] / value[0], error[2] / value[2]) / np.log(100.0)
        measured = " | ".join(f"{loss.value:.2e} ± {loss.error:.0e}" for loss in losses)
        distances = [hollow.generations(GENERATIONS, NECK).distance for hollow in hollows[:2]]
        far = " | ".join(f"{one.value:.4f} ± {one.error:.4f}" for one in distances)
        yield f"{name} | {cells} | {hollows[0].mirrors} | {measured} | {order:.2f} ± {spread:.2f} | {far}"


@click.command()
@click.option("--write", is_flag=True, help="Write the table into the page.")
def main(write: bool) -> None:
    """Print the table."""
    measured = print_table(HEADS, rows())
    if write:
        write_between_marks(PAGE, measured, "measured losses")


if __name__ == "__main__":
    main()
