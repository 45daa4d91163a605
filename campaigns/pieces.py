"""Rays a second against the number of sides of a polygon, by asperity and by its peers, and the error they leave."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from asperity import geometry as geo
from asperity.core.tables import table

from .timing import least_time

if TYPE_CHECKING:
    from .peers import PeerEnvironment

SIDES = (2, 10, 100, 1_000, 10_000, 100_000)
RAYS, REPEATS = 2**15, 3
# Depth of the corners as a multiple of the width of a side: slopes of order 1 at every number of sides.
SHALLOWEST, DEEPEST = 0.3, 1.5
PICTURE, SPEEDS_OF_PIECES = "rays-per-second.png", "Rays a second against the number of sides, and against failures"


@dataclass(frozen=True)
class Speed:
    """Rays a second through a polygon, fractions of wrong and of lost rays, and the median error of the angle out.

    ``wrong`` and ``error`` are differences from asperity's angles, and NaN for asperity itself.
    """

    tracer: str
    sides: int
    rate: float
    wrong: float
    lost: float
    error: float


def random_polygon(sides: int) -> geo.Wall:
    """A hollow of the given number of sides, of equal width, with corners at random depths."""
    depth = np.random.default_rng(sides).uniform(SHALLOWEST, DEEPEST, sides - 1) / sides
    return geo.Wall.from_vertices(np.column_stack([np.linspace(0.0, 1.0, sides + 1), -np.pad(depth, 1)]))


def measure_pieces(folder: Path, peers: PeerEnvironment, tracers: dict[str, tuple[str, str]]) -> list[Speed]:
    """Trace the same rays through every polygon with every tracer, in one thread."""
    rng = np.random.default_rng(0)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    rows = []
    for sides in SIDES:
        wall = random_polygon(sides)
        traced, seconds = least_time(lambda wall=wall: geo.trace(wall, x, theta, threads=1), REPEATS)
        lost = float(np.mean(~traced.escaped))
        rows.append(Speed("asperity", sides, RAYS / seconds, np.nan, lost, np.nan))
        data = folder / "polygon.npz"
        np.savez(data, corners=wall.vertices, x=x, theta=theta, out=traced.theta)
        for peer, (_, package) in tracers.items():
            found = peers.run(peer, package, data)
            if not isinstance(found, str):
                rows.append(Speed(peer, sides, found["rate"], found["wrong"], found["lost"], found["error"]))
    return rows


def pieces_table(rows: list[Speed]) -> str:
    """One line for each tracer and number of sides."""
    lines = (
        f"{row.sides} | {row.tracer} | {row.rate / 1e6:.3g} | "
        + ("reference | -" if np.isnan(row.wrong) else f"{row.wrong:.1e} | {row.error:.1e}")
        + f" | {row.lost:.1e}"
        for row in rows
    )
    return table("sides of the polygon | tracer | million rays/s | wrong | median error | lost", lines)


def draw_pieces(rows: list[Speed], file: Path) -> None:
    """Rays a second against the number of sides, and against the fraction of rays that are wrong or lost."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    by_sides, by_error = figure.subplots(1, 2, sharey=True)
    for tracer in dict.fromkeys(row.tracer for row in rows):
        mine = [row for row in rows if row.tracer == tracer]
        by_sides.loglog([row.sides for row in mine], [row.rate for row in mine], "o-", label=tracer)
        # asperity's own angles are the reference, so only its lost rays are known here
        failed = [np.nan_to_num(row.wrong) + row.lost for row in mine]
        by_error.loglog(np.maximum(failed, 1.0 / RAYS), [row.rate for row in mine], "o", label=tracer)
    by_sides.set(xlabel="sides of the polygon", ylabel="rays a second, one thread")
    by_error.set(xlabel=f"fraction of rays wrong or lost, at least 1/{RAYS}")
    for axes in (by_sides, by_error):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(file, dpi=120)
