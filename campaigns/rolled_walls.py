"""Walls whose period begins anywhere and below y = 0, against the same walls begun at a highest point.

``python -m campaigns.rolled_walls`` prints a table that compares rays, collisions of disks and matrices of both walls.
A textbook tracer follows some rays in the coordinates of the rolled wall. The script also prints how many paths with a
slit of zero width are refused, and how many with a plate of zero width are accepted.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.tables import table
from asperity.errors import AccuracyError, WallError
from campaigns.judges.random_rolled_walls import Rolled, rays, rolled_wall, spiked_path, textbook_exit

WALLS, RAYS, JUDGED, DISKS, SPIKES = 200, 20_000, 40, 2_000, 2_000
# After more hits, rounding changes positions and angles too much for a comparison.
MOST_HITS = 200
# Allowed difference of angles; rounding grows along a ray, on bumps by up to a factor of ten at each hit.
SAME_ANGLE = 1e-6
SCALE, SPACING = 1e-3, 2.0 * np.pi / 80
# Flatter rays pass too many cells for the textbook tracer.
STEEP = 0.3


@dataclass(frozen=True)
class Comparison:
    """The results for one wall: counts, the ratio for the matrices, and whether the properties agree."""

    rays: int
    other_rays: int
    judged: int
    misjudged: int
    disks: int
    other_disks: int
    matrix: float
    facts: bool


def compare(one: Rolled, number: int, most_rays: int, judged: int, disks: int, matrices: bool) -> Comparison:
    """Compare a rolled wall with its original."""
    rng = np.random.default_rng([number, 17])
    counted, other = _compare_rays(one, most_rays, rng)
    found, wrong = _judge(one, judged, rng)
    collided, apart = _compare_disks(one, disks, rng)
    return Comparison(
        counted, other, found, wrong, collided, apart, _compare_matrices(one) if matrices else 0.0, _same_facts(one)
    )


def _compare_rays(one: Rolled, count: int, rng: np.random.Generator) -> tuple[int, int]:
    x, theta, entry = rays(one, count, rng)
    here = geo.trace(one.wall, entry, theta, max_collisions=MOST_HITS)
    there = geo.trace(one.rolled, x, theta, max_collisions=MOST_HITS)
    out = here.escaped & there.escaped
    place = here.x + one.shift[0] + one.drop / np.tan(here.theta)
    size = 1.0 + np.abs(place) + one.drop / np.sin(np.where(out, here.theta, 1.0)) ** 2
    apart = np.abs(here.theta - there.theta) + np.abs(place - there.x) / size > SAME_ANGLE
    different = np.where(out, apart | (here.collisions != there.collisions), here.escaped != there.escaped)
    return count, int(different.sum())


def _judge(one: Rolled, count: int, rng: np.random.Generator) -> tuple[int, int]:
    x, theta, _ = rays(one, count, rng, STEEP)
    traced = geo.trace(one.rolled, x, theta, max_collisions=MOST_HITS)
    judged, wrong = 0, 0
    for i in np.flatnonzero(traced.escaped):
        known = textbook_exit(one.rolled, float(x[i]), float(theta[i]))
        if known is None:
            continue
        judged += 1
        place, angle, hits = known
        allowed = SAME_ANGLE * (1.0 + one.drop / np.sin(angle) ** 2)
        same = abs(place - traced.x[i]) <= allowed and abs(angle - traced.theta[i]) <= SAME_ANGLE
        wrong += not (same and hits == traced.collisions[i])
    return judged, wrong


def _compare_disks(one: Rolled, count: int, rng: np.random.Generator) -> tuple[int, int]:
    if count == 0 or any(isinstance(piece, geo.Bezier) for piece in one.wall.pieces):
        return 0, 0
    scale = SCALE / max(one.rolled.depth, one.rolled.period)
    velocity = rng.normal(size=(count, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1]) - 0.1
    position = rng.random((count, 2)) * [scale * one.wall.period, SPACING]
    flight = scale * one.drop / -velocity[:, 1]
    start = position + flight[:, None] * velocity[:, [0, 2]] - [scale * one.shift[0], 0.0]
    limit = {"spacing": SPACING, "max_contacts": MOST_HITS}
    here = geo.collide(geo.Disk(), one.wall, scale, start, velocity, **limit)
    there = geo.collide(geo.Disk(), one.rolled, scale, position, velocity, **limit)
    out = here.escaped & there.escaped
    climb = scale * one.drop / np.where(out, here.velocity[:, 1], 1.0)
    place = here.position + [scale * one.shift[0], 0.0] + climb[:, None] * here.velocity[:, [0, 2]]
    apart = np.abs(here.velocity - there.velocity).max(axis=1) > SAME_ANGLE
    apart |= np.abs(place - there.position).max(axis=1) > SAME_ANGLE * (1.0 + climb / here.velocity[:, 1])
    different = np.where(out, apart | (here.contacts != there.contacts), here.escaped != there.escaped)
    return count, int(different.sum())


def _compare_matrices(one: Rolled) -> float:
    """The distance of the two laws' matrices over the sum of their errors and rounding."""
    basis, rng = ker.Legendre(8), np.random.default_rng(18)
    try:
        here, there = (
            ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-3, samples=2**16, rng=rng)
            for wall in (one.wall, one.rolled)
        )
    except AccuracyError:
        return 0.0
    distance = float(np.linalg.norm(here.symmetric - there.symmetric))
    return distance / (float(here.error) + float(there.error) + 1e-12)


def _same_facts(one: Rolled) -> bool:
    """Whether both walls have the same closing, symmetry, length, openings and flat tops."""
    wall, rolled = one.wall, one.rolled
    widths = [sorted(hollow.width for hollow in each.hollows) for each in (wall, rolled)]
    return (
        wall.closes == rolled.closes
        and wall.is_mirror_symmetric == rolled.is_mirror_symmetric
        and len(widths[0]) == len(widths[1])
        and bool(np.allclose(*widths, rtol=0.0, atol=1e-13 * wall.period))
        and abs(wall.flat_top - rolled.flat_top) <= 1e-13 * wall.period
        and abs(wall.arc_length - rolled.arc_length) <= 1e-12 * wall.arc_length
        and abs(wall.cell.depth - rolled.cell.depth) <= 1e-13 * max(wall.period, wall.depth)
    )


def is_taken_rightly(number: int) -> bool:
    """Whether a path whose spike is a plate is accepted with its depth and length, and any other spike is refused."""
    vertices, is_plate = spiked_path(number)
    try:
        wall = geo.Wall.from_vertices(vertices)
    except WallError as reason:
        return not is_plate and "zero width" in str(reason)
    length = float(np.hypot(*np.diff(vertices, axis=0).T).sum())
    return is_plate and abs(wall.arc_length - length) < 1e-13 and wall.depth == -vertices[:, 1].min()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.rolled_walls", description=__doc__)
    parser.add_argument("--walls", type=int, default=WALLS)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays into every wall")
    options = parser.parse_args()
    kinds: dict[str, list[Comparison]] = {}
    for number in range(options.walls):
        one = rolled_wall(number)
        found = compare(one, number, options.rays, JUDGED, DISKS, matrices=True)
        shape = "polygons" if one.wall.is_polygonal else "with curves"
        kinds.setdefault(f"{shape}, {'lowered' if one.drop else 'rolled'}", []).append(found)
    rows: list[tuple[object, ...]] = []
    for kind, found in sorted(kinds.items()):
        sums = (sum(getattr(row, field.name) for row in found) for field in fields(Comparison)[:6])
        worst, facts = max(row.matrix for row in found), sum(not row.facts for row in found)
        rows.append((kind, len(found), *sums, f"{worst:.2g}", facts))
    heads = "walls | number | rays | others | judged rays | wrong | disks | others | matrices: worst ratio | unlike"
    print(table(heads, rows))
    taken = np.array([(spiked_path(number)[1], is_taken_rightly(number)) for number in range(SPIKES)])
    print(f"\nOf {SPIKES} paths with a spike {int(taken[:, 0].sum())} have a plate, the others a slit; ", end="")
    print(f"{int((~taken[:, 1]).sum())} were taken wrongly.")


if __name__ == "__main__":
    main()
