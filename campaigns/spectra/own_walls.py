"""Gaps of walls as users draw them: reached or not, the processor time, and the error against two judges.

A case is a random wall of one to five pieces in one of the conventions: mixed pieces, Bezier pieces, arcs that touch,
islands, mirror images, several hollows below flat tops, and smooth profiles of 20 points. The judges are rays from
panels with a seed of their own, which share nothing but the tracer with the enclosures, and matrices of the textbook
tracer's rays, in Legendre polynomials and in bins that become narrow at grazing, whose eigenvalues are lower bounds of
those of the law. Every eighth wall is asked for 1e-6 too, and judged by the gap at a tenth of this. In the table each
row is a tolerance; the outcomes count the gaps that reach it by the processor time that they take.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.spectral.bounds.contraction import self_adjoint_elsewhere
from asperity.spectral.essential.edge import essential_edge
from asperity.spectral.gap.gap import gap_by_rays
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall
from campaigns.engine import Campaign, Judged
from campaigns.judges.textbook_tracer import outgoing_angles
from campaigns.spectra import verdicts

WALLS, KINDS = 200, 8
# Tolerances with their time limits; those of every eighth wall, the second of them the judge's; time limit of the rays
# that judge, and the seconds by which gaps are counted.
LIMITS, FINE, EVERY = {1e-3: 10.0, 1e-4: 10.0}, {1e-6: 60.0, 1e-7: 60.0}, 8
RAYS_LIMIT, STEPS = 2.0, (1, 2, 4, 15, 60, 120)
# Bins of the second judge, and rays from each.
BINS, RAYS_OF_BIN = 400, 1024
PROFILE = geo.HeightCorrelation(0.2)
Case = tuple[str, ker.Law, geo.Wall, bool]


def chain(number: int, pieces: int) -> geo.Wall:
    """A wall of cubic Bezier pieces below their chords."""

    def attempt(rng: np.random.Generator) -> geo.Wall:
        inner = np.sort(rng.random(pieces - 1))
        depth = rng.uniform(0.2, 0.5, pieces - 1)
        joints = [(0.0, 0.0), *zip(inner.tolist(), (-depth).tolist(), strict=True), (1.0, 0.0)]
        return geo.Wall(
            [
                geo.Bezier([a, *((a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]) - 0.2 * rng.random())
                                 for f in (1 / 3, 2 / 3)), b])
                for a, b in pairwise(joints)
            ]
        )  # fmt: skip

    return verdicts.first_valid(20261128, number, attempt)


def hollows(number: int) -> geo.Wall:
    """Two or three hollows of other shapes, an arc or a Bezier piece each, with flat tops between them."""

    def attempt(rng: np.random.Generator) -> geo.Wall:
        pieces, x = [], 0.0
        for _ in range(2 + number % 2):
            width, top = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.05, 0.3))
            low, high = (float(-rng.uniform(0.1, 0.8)) for _ in range(2))
            end = x + width
            pieces += [
                geo.Bezier([(x, 0.0), (x + 0.3 * width, low), (x + 0.7 * width, high), (end, 0.0)]),
                geo.Segment((end, 0.0), (end + top, 0.0)),
            ]
            x = end + top
        return geo.Wall(pieces, period=x)

    return verdicts.first_valid(20261129, number, attempt)


def draw(number: int) -> Case:
    """The wall's kind and its law, in alternate conventions."""
    group, kind = divmod(number, KINDS)
    name, wall = (
        ("mixed pieces", random_curved_wall(group % COUNT)) if kind == 0 else
        ("mixed pieces", random_curved_wall(group, 20261128)) if kind == 1 else
        ("Bezier pieces", chain(number, 1 + group % 5)) if kind in (2, 3) else
        ("island", verdicts.island_wall(100 + group)) if kind == 4 else
        ("mirror image", verdicts.mirrored_wall(100 + group)) if kind == 5 else
        ("several hollows", hollows(number)) if kind == 6 else
        ("smooth profile", geo.random_wall(PROFILE, 20, rms_slope=0.2 + 0.1 * (group % 4), rng=number, smooth=True))
    )  # fmt: skip
    law = ker.WallLaw(wall)
    return name, law.in_specular_frame() if group % 2 else law, wall, group % EVERY == number % EVERY


def reach_in_bins(wall: geo.Wall, mirrored: bool, modulus: bool) -> float:
    """A lower bound of the largest eigenvalue, or modulus: the quotient, by half of the rays, of a function in bins.

    The other half of the rays shows the function. As many rays begin in each bin, since eigenfunctions may live on
    grazing angles of small measure; both directions of a flux between two bins count. Outgoing angles are mirrored for
    symmetric laws in the specular frame.
    """
    rng = np.random.default_rng(1)
    edges = np.pi / (1.0 + np.exp(-np.linspace(-10.0, 10.0, BINS - 1)))
    edges = np.concatenate([[0.0], edges, [np.pi]])
    mass = -0.5 * np.diff(np.cos(edges))
    row = np.repeat(np.arange(BINS), RAYS_OF_BIN)
    theta = np.arccos(np.cos(edges[row]) - 2.0 * mass[row] * rng.random(row.size))
    out = outgoing_angles(wall, rng.random(row.size) * wall.period, theta)
    lost = np.isnan(out)
    out = np.where(lost, theta, np.pi - out if mirrored else out)
    column = np.clip(np.searchsorted(edges, out) - 1, 0, BINS - 1)
    root = np.sqrt(mass)
    # functions are 0 where the textbook loses rays
    known = ~np.isin(np.arange(BINS), row[lost])

    def matrix(part: NDArray[np.intp]) -> Floats:
        hits = np.zeros((BINS, BINS))
        np.add.at(hits, (row[part], column[part]), 1.0)
        flux = (hits + hits.T) / (part.size / BINS) / (1.0 / mass[:, None] + 1.0 / mass)
        whole = flux / np.outer(root, root) - np.outer(root, root)
        return np.where(known[:, None] & known, whole, 0.0)

    first, *others = (matrix(part) for part in _parts(row.size))
    values, vectors = np.linalg.eigh(first)
    chosen = vectors[:, -1] if not modulus or values[-1] > -values[0] else vectors[:, 0]
    quotients = np.array([chosen @ other @ chosen for other in others])
    quotients = np.abs(quotients) if modulus else quotients
    return float(quotients.mean() - verdicts.SIGMAS * quotients.std(ddof=1) / np.sqrt(len(others)))


def _parts(rays: int) -> list[NDArray[np.intp]]:
    """Half of the rays, and eight parts of the other half."""
    number = np.arange(rays)
    return [number[::2], *(number[1 + 2 * k :: 16] for k in range(8))]


def judge(case: Case) -> Iterator[Judged]:
    """The gap to each tolerance against the judges."""
    _, law, wall, fine = case
    found = {}
    for tolerance, limit in (LIMITS | FINE if fine else LIMITS).items():
        begun = time.process_time()
        gap = spec.spectral_gap(law, tolerance, time_limit=limit)
        found[tolerance] = gap, time.process_time() - begun
    other = self_adjoint_elsewhere(law)
    own, rank = (law, np.positive) if other is None else (other, np.abs)
    by_rays = gap_by_rays(own, 0.0, np.random.default_rng(1), RAYS_LIMIT, essential_edge(own), rank)
    signs = (-1.0) ** np.arange(1, verdicts.DEGREES[-1]) if law.frame == "specular" else 1.0
    tops, noise = verdicts.reference(verdicts.matrices(wall) * signs, norm=other is not None)
    most = 1.0 - float(tops[-1]) + noise + verdicts.NOISE_OF_SIZE
    most = min(most, 1.0 - reach_in_bins(wall, law.frame == "specular" and other is None, other is not None))
    for tolerance, (gap, seconds) in found.items():
        within = next((step for step in STEPS if seconds <= step), STEPS[-1])
        outcome = f"within {within} s" if gap.error <= tolerance else f"missed: {gap.verdict}"
        fault = f"rays of the textbook show a gap below {most:.4g}" if gap.value - gap.error > most else ""
        yield Judged(f"{tolerance:g}", gap.error, abs(gap.value - by_rays.value), by_rays.error, fault, outcome)
    if fine:
        (gap, _), (finest, _) = (found[tolerance] for tolerance in FINE)
        yield Judged("1e-06 beside 1e-07", gap.error, abs(gap.value - finest.value), finest.error)


CAMPAIGNS = (
    Campaign(
        "own-walls", "Do gaps of walls as users draw them reach their tolerance, in time?", draw, judge, WALLS, [2]
    ),
)
