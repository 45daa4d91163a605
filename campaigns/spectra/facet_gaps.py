"""The conjecture that the gap of a wall with the diffuse fraction a is at least a times that with diffuse facets.

    python -m campaigns facet-gaps --record RECORD
    python -m campaigns.spectra.facet_gaps RECORD PICTURE    draws the ratios of both sides

The essential spectrum cannot refute it: B <= (1 - a) P_specular, so that it ends at 1 - a or below, and gaps are at
most 1. An eigenvalue above 1 - a gap(P_1) could. Eigenvalues of matrices in bins are below those of the law. From each
random wall the vertices move to where the ratio of both sides is less.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.core.errors import AsperityError
from campaigns.engine import Campaign, Judged

CASES, FRACTIONS, SIGMAS = 200, (0.05, 0.2, 0.6), 4.0
# Bins and rays of the steps to a lower ratio, number and length of these steps, and the same of the judgement.
COARSE, FINE, STEPS, LENGTH = (16, 2**14), (64, 2**16), 4, 0.15
# Least depth of polygons.
DEPTH = 0.05
# Where the steps compare the gaps.
TRIED = 0.2


@dataclass(frozen=True)
class Case:
    """Vertices of a polygon, or of a wall of arcs its half angle alone, and the number of the case."""

    number: int
    vertices: Floats | None
    half_angle: float

    @property
    def wall(self) -> geo.Wall:
        """The wall."""
        return geo.focusing_arcs(self.half_angle) if self.vertices is None else geo.Wall.from_vertices(self.vertices)


def draw(number: int) -> Case:
    """Polygons of up to 7 pieces, shallow and deep, some with flat tops or overhangs, and each tenth wall of arcs."""
    rng = np.random.default_rng([number, 62])
    if number % 10 == 9:
        return Case(number, None, float(rng.uniform(0.1, 1.57)))
    x = np.sort(rng.uniform(0.05, 0.95, int(rng.integers(1, 7))))
    if number % 10 == 8:
        # a chamber below a neck
        low, high = np.sort(rng.uniform(0.3, 0.7, 2))
        out, depth = rng.uniform(0.0, 0.25, 2)
        inner = [(low, 0.0), (low - out, -0.3 - depth), (high + out, -0.3 - depth), (high, 0.0)]
    else:
        y = -(10.0 ** rng.uniform(-1.5, 0.5)) * rng.uniform(0.0, 1.0, len(x))
        y[rng.random(len(x)) < 0.2] = 0.0
        y[rng.integers(len(x))] -= DEPTH
        inner = list(zip(x.tolist(), y.tolist(), strict=True))
    return Case(number, np.array([(0.0, 0.0), *inner, (1.0, 0.0)]), 0.0)


def gap_of(wall: geo.Wall, fraction: float, size: tuple[int, int], seed: int) -> tuple[float, float]:
    """The gap of the matrix in bins, and its standard deviation by the rays."""
    law = ker.FacetedLaw(wall, ker.maxwell(fraction))
    found = spec.spectrum(ker.discretise(law, ker.Bins(size[0]), samples=size[1], rng=seed), 2)
    return float(found.gap), float(found.gap_errors.sampling[0])


def ratio_of(wall: geo.Wall, seed: int) -> float:
    """The coarse ratio at `TRIED`; infinite for a wall that crosses itself."""
    try:
        return gap_of(wall, TRIED, COARSE, seed)[0] / (TRIED * gap_of(wall, 1.0, COARSE, seed)[0])
    except AsperityError:
        return np.inf


def worse(case: Case) -> Case:
    """The case after random steps, each of which makes the ratio less."""
    rng, least = np.random.default_rng([case.number, 63]), np.inf
    for step in range(STEPS):
        moved = case
        if step and case.vertices is not None:
            vertices = case.vertices.copy()
            vertices[1:-1] += LENGTH * rng.normal(size=vertices[1:-1].shape) * [0.3, 1.0]
            vertices[1:-1, 1] = np.minimum(vertices[1:-1, 1], 0.0)
            # of a flat wall both sides are equal
            vertices[1:-1, 1] += min(-DEPTH - float(vertices[:, 1].min()), 0.0)
            moved = Case(case.number, vertices, 0.0)
        elif step:
            moved = Case(case.number, None, float(np.clip(case.half_angle + LENGTH * rng.normal(), 0.05, 1.57)))
        try:
            found = ratio_of(moved.wall, case.number)
        except AsperityError:
            continue
        if found < least:
            case, least = moved, found
    return case


def ratios(case: Case) -> Iterator[tuple[float, float, float]]:
    """Fraction, ratio of the gap to the fraction of that of diffuse facets, and standard deviation of the ratio."""
    wall = worse(case).wall
    one, spread = gap_of(wall, 1.0, FINE, case.number)
    for fraction in FRACTIONS:
        gap, own = gap_of(wall, fraction, FINE, case.number + 1)
        ratio = gap / (fraction * one)
        yield fraction, ratio, ratio * float(np.hypot(own / gap, spread / one))


def judge(case: Case) -> Iterator[Judged]:
    for fraction, ratio, spread in ratios(case):
        yield Judged(f"a = {fraction}", ratio, 1.0, SIGMAS * spread)


def draw_picture(record: Path, picture: Path) -> None:
    """Draw the ratios of the record of a run against the fraction, with error bars."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    ax = figure.subplots()
    cases = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    for number, judgements in cases:
        arcs = draw(number).vertices is None
        for k, found in enumerate(judgements):
            at = FRACTIONS[k] * (1.0 + 0.3 * (number / CASES - 0.5))
            ax.errorbar(at, found["claimed"], 0.5 * found["judge_error"], fmt="^" if arcs else ".", markersize=4,
                        color="#D55E00" if arcs else "#0072B2", elinewidth=0.8)  # fmt: skip
    least = min(found["claimed"] for _, judgements in cases for found in judgements)
    ax.axhline(1.0, color="black", linewidth=1.0, linestyle="--")
    ax.set(xlabel="diffuse fraction a of the facets", ylabel="gap at a / (a times the gap at 1)")
    ax.set(xscale="log", yscale="log")
    ax.set_xticks(FRACTIONS, labels=list(map(str, FRACTIONS)))
    ax.set_yticks([1, 2, 5, 10, 20], labels=["1", "2", "5", "10", "20"])
    ax.minorticks_off()
    ax.set_title(f"{len(cases)} walls: polygons (dots), arcs (triangles), least {least:.3f}", fontsize=10)
    figure.savefig(picture, dpi=100)


CAMPAIGNS = (
    Campaign(
        "facet-gaps", "Is the gap with the diffuse fraction a at least a times that of diffuse facets?", draw, judge,
        CASES, (3, 9),
    ),
)  # fmt: skip

if __name__ == "__main__":
    draw_picture(*map(Path, sys.argv[1:]))
