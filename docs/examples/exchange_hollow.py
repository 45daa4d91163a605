"""Chambers that exchange intervals
================================

Which chamber behind a small opening sends every ray where an exchange of intervals of angles sends it?

A symmetric matrix is that of an exchange of intervals, and pairs of mirrors perform the exchange: the wall of the
theorem that every symmetric law is a limit of laws of walls.
"""

# sphinx_gallery_thumbnail_path = "generated/thumbnails/exchange_hollow.png"
from __future__ import annotations

import sys
from pathlib import Path

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.inverse.exchange_wall import ExchangeHollow

LAWS = {
    "Lambert, two cells": (ker.lambertian(), 2),
    "Lambert, four cells": (ker.lambertian(), 4),
    "specular reflection, four cells": (ker.specular(), 4),
    "Henyey-Greenstein 1/2, three cells": (ker.henyey_greenstein(0.5), 3),
}


def main(opening: float = 1e-2, picture: str | Path | None = None) -> dict[str, ExchangeHollow]:
    """A chamber for each exchange; draws them to ``picture`` if that is given."""
    found = {
        name: ker.exchange_hollow(ker.IntervalExchangeLaw(ker.discretise(law, ker.Bins(cells))), opening)
        for name, (law, cells) in LAWS.items()
    }
    if picture is not None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 7.0), layout="constrained")
        for (name, hollow), axes in zip(found.items(), figure.subplots(2, 2).flat, strict=True):
            geo.draw_wall(hollow.wall, ax=axes)
            axes.set_title(f"{name}\nloss {float(hollow.loss(2**14)):.2g}")
        figure.savefig(picture, dpi=100)
    return found


if __name__ == "__main__":
    for name, hollow in main(picture=sys.argv[1] if len(sys.argv) > 1 else None).items():
        print(f"{name}: {hollow.mirrors} mirrors, loss {hollow.loss()}")
