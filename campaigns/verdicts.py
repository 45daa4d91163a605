"""Verdicts and gaps of random walls, and eigenvalues to a tolerance, against independent references.

``python -m campaigns.verdicts`` prints three tables.

- *Theorems*: polygons have no gap, in both conventions; with a Lambertian fraction a their gap is a.
- *Random walls*: segments, arcs, ellipses and Bezier pieces, flat tops and islands, unchanged, mixed and squared, in
  both conventions. The judge follows rays with `tests.textbook_tracer`, which shares no formula with the library's
  tracer. The largest eigenvalues of its Galerkin matrices in Legendre polynomials are lower bounds, so the reported gap
  must not exceed the gap of these matrices. For the verdict *isolated* the judge's values at three degrees must lead to
  the gap. For the verdict *essential edge* the edge must lie between two bounds from rays that meet straight pieces
  only.
- *Tolerances*: `spectrum(law, tolerance=t)` against known eigenvalues.

``--first`` and ``--last`` choose a range of the random walls. Rows are printed as soon as they are computed.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice
from types import SimpleNamespace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from campaigns.judges.random_curved_walls import COUNT, random_curved_wall
from campaigns.judges.random_hollows import random_hollow, wall_with
from campaigns.judges.textbook_tracer import compiled, follow, table_of

from .pages import print_table

Floats = NDArray[np.float64]

POLYGONS, WALLS, TOLERANCE, FRACTION = 20, 48, 1e-3, 0.3
# Logarithm of the judge's number of rays, number of blocks whose spread gives the error, and degrees of its matrices.
LOG_RAYS, BLOCKS, DEGREES = 18, 8, (16, 32, 64)
# Angles, refinement between angles, and entry points of the straight rays; a step, and the rotation that shows a curve.
ANGLES, BETWEEN, POINTS, STEP, TURN = 512, 3, 256, 1e-5, 1e-12
EXCESSES = (0.003, 0.006, 0.012, 0.02, 0.03, 0.05, 0.1)
SIGMAS = 4.0
# Increase of the largest eigenvalues of 64 x 64 matrices by sampling noise; error of the edge's grid and entry points.
NOISE_OF_SIZE, EDGE_NOISE = 3e-3, 6e-3
# Eigenvalues off the constants: for the focusing arc by a second method (10 digits), for the others by theorems.
KNOWN = {
    "focusing arc, 1.2": (ker.CircularArcLaw(1.2), (0.3670253152,)),
    "focusing arc, 1.2, squared": (ker.CircularArcLaw(1.2) ** 2, (0.3670253152**2,)),
    "Henyey-Greenstein, .9": (ker.henyey_greenstein(0.9), (0.9, 0.81, 0.729)),
    "half Lambertian, half arc": (0.5 * ker.lambertian() + 0.5 * ker.CircularArcLaw(1.2), (0.5 * 0.3670253152,)),
}
DIGITS_KNOWN = 3e-10


def island_wall(number: int) -> geo.Wall:
    """A random curved wall with an island in its hollow, alternately a polygon and an ellipse."""
    rng = np.random.default_rng([20261122, number])
    while True:
        wall = random_curved_wall(int(rng.integers(COUNT)))
        x, y, r = rng.uniform(0.25, 0.75), -rng.uniform(0.1, 0.6), rng.uniform(0.03, 0.12)
        if number % 2:
            island = [geo.Arc((x, y), (r, r * float(rng.uniform(0.6, 1.5))), 0.0, -2.0 * np.pi)]
        else:
            corners = 3 + number % 3
            turn = -(np.arange(corners) + rng.uniform(0.0, 0.9)) * 2.0 * np.pi / corners
            points = [(float(x + r * np.cos(t)), float(y + r * np.sin(t))) for t in turn]
            island = [geo.Segment(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        try:
            return geo.Wall(wall.pieces, wall.period, islands=[island])
        except InputError:
            continue


def mirrored_wall(number: int) -> geo.Wall:
    """A random wall of two curves that are mirror images of each other."""
    rng = np.random.default_rng([20261123, number])
    while True:
        x, y = rng.uniform(0.2, 0.45), -rng.uniform(0.1, 0.7)
        bend = rng.uniform(-0.3, 0.3, 2)
        left = geo.Bezier([(0.0, 0.0), (0.3 * x, y * (0.3 + bend[0])), (0.7 * x, y * (0.7 + bend[1])), (x, y)])
        right = geo.Bezier([(1.0 - px, py) for px, py in reversed(left.control_points)])
        try:
            return geo.Wall([left, geo.Segment((x, y), (1.0 - x, y)), right] if number % 2 else _closed(left))
        except InputError:
            continue


def _closed(left: geo.Bezier) -> list[geo.Bezier]:
    """The curve stretched to half the period, and its mirror image."""
    scale = 0.5 / left.end[0]
    wide = geo.Bezier([(px * scale, py) for px, py in left.control_points])
    return [wide, geo.Bezier([(1.0 - px, py) for px, py in reversed(wide.control_points)])]


@compiled
def follow_all(table: Floats, x: Floats, theta: Floats) -> Floats:
    """Outgoing angles; unresolved rays are retroreflected by convention."""
    out = np.empty(x.shape[0])
    for k in range(x.shape[0]):
        out[k] = follow(table, x[k], theta[k])[0]
    return out


@dataclass(frozen=True)
class Judge:
    """Rays of a wall, by the textbook tracer."""

    wall: geo.Wall

    def outgoing(self, fraction: Floats, theta: Floats) -> Floats:
        """Outgoing angles for entry points in fractions of the period; specular on flat tops."""
        pieces = [*self.wall.pieces, *(piece for loop in self.wall.islands for piece in loop)]
        x = fraction * self.wall.period
        flat = np.zeros(x.shape, dtype=bool)
        for piece in self.wall.pieces:
            if isinstance(piece, geo.Segment) and piece.start[1] == 0.0 == piece.end[1]:
                flat |= (piece.start[0] <= x) & (x <= piece.end[0])
        out = np.pi - theta
        out[~flat] = follow_all(table_of(SimpleNamespace(pieces=pieces)), x[~flat], theta[~flat])
        return out

    def matrices(self) -> Floats:
        """<e_i, P e_j> off the constants, from each block of rays, shape (blocks, degree, degree)."""
        found = []
        for block in range(BLOCKS):
            fraction, u = np.clip(
                Sobol(2, rng=np.random.default_rng(block)).random(2**LOG_RAYS // BLOCKS).T, 1e-12, 1 - 1e-12
            )
            theta = np.arccos(1.0 - 2.0 * u)
            here, there = (_polynomials(angle) for angle in (theta, self.outgoing(fraction, theta)))
            found.append(here.T @ there / fraction.size)
        return np.array(found)

    def straight(self) -> tuple[float, float]:
        """Bounds of the largest spectral value of Q, the part of the law that straight pieces produce.

        The lower bound is from a matrix that interpolates between angles. The upper bound (Collatz and Wielandt) is the
        supremum of Q f / f, since Q is positive and f > 0; f is (1 - Q/s)^-1 1 by the matrix, for the best of several
        s.
        """
        theta = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
        out, kept = self._straight_rays(theta)
        low, fraction = _interpolation(out)
        matrix = np.zeros((ANGLES, ANGLES))
        row = np.repeat(np.arange(ANGLES), POINTS).reshape(out.shape)
        np.add.at(matrix, (row[kept], low[kept]), (1.0 - fraction)[kept] / POINTS)
        np.add.at(matrix, (row[kept], low[kept] + 1), fraction[kept] / POINTS)
        root = np.sqrt(np.sin(theta))
        even = root[:, None] * matrix / root
        below = float(np.linalg.eigvalsh(0.5 * (even + even.T))[-1])
        between = np.pi * (np.arange(BETWEEN * ANGLES) + 0.5) / (BETWEEN * ANGLES)
        out, kept = self._straight_rays(between)
        places, (own, own_fraction) = _interpolation(out), _interpolation(between)
        above = float(kept.mean(axis=1).max())
        for excess in EXCESSES:
            function = np.linalg.solve(np.eye(ANGLES) - matrix / (below * (1.0 + excess) + 1e-9), np.ones(ANGLES))
            if function.min() >= 1.0:
                image = np.where(kept, (1 - places[1]) * function[places[0]] + places[1] * function[places[0] + 1], 0.0)
                here = (1 - own_fraction) * function[own] + own_fraction * function[own + 1]
                above = min(above, float((image.mean(axis=1) / here).max()))
        return below, above

    def _straight_rays(self, theta: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles, shape (angles, entry points), and a mask of the rays that a step does not rotate."""
        shift = np.random.default_rng(1).random((theta.size, 1))
        fraction = np.clip((np.arange(POINTS) + shift) / POINTS, 1e-9, 1.0 - 2.0 * STEP)
        angle = np.repeat(theta, POINTS)
        out, beside = (self.outgoing(fraction.ravel() + step, angle).reshape(fraction.shape) for step in (0.0, STEP))
        return out, np.abs(out - beside) <= TURN


def _interpolation(angle: Floats) -> tuple[NDArray[np.intp], Floats]:
    """The grid index below every angle, and the weight of the next index."""
    place = np.clip(angle * ANGLES / np.pi - 0.5, 0.0, ANGLES - 1.0)
    low = np.minimum(place.astype(np.intp), ANGLES - 2)
    return low, place - low


def _polynomials(theta: Floats) -> Floats:
    degrees = np.arange(1, DEGREES[-1])
    return np.asarray(legendre.legvander(np.cos(theta), DEGREES[-1] - 1)[:, 1:] * np.sqrt(2.0 * degrees + 1.0))


@cache
def judged(wall: geo.Wall) -> Floats:
    """The matrices of a wall, computed once."""
    return Judge(wall).matrices()


@dataclass(frozen=True)
class Reference:
    """The judge's estimates of a largest spectral value at increasing degrees, and the error of the last."""

    tops: tuple[float, ...]
    error: float

    @classmethod
    def of(cls, matrices: Floats, norm: bool = False) -> Reference:
        """From the symmetric parts, or from the largest singular values."""

        def top(matrix: Floats, degree: int) -> float:
            part = matrix[: degree - 1, : degree - 1]
            return float(np.linalg.svd(part)[1][0] if norm else np.linalg.eigvalsh(0.5 * (part + part.T))[-1])

        spread = [top(matrix, DEGREES[0]) for matrix in matrices]
        error = SIGMAS * float(np.std(spread, ddof=1)) / np.sqrt(BLOCKS)
        return cls(tuple(top(matrices.mean(axis=0), degree) for degree in DEGREES), error)


@dataclass(frozen=True)
class Row:
    """A law with its gap and the judge's reference."""

    name: str
    gap: spec.SpectralGap
    reference: Reference
    edge: tuple[float, float]

    @property
    def refutation(self) -> str:
        """The error found by the judge, or an empty string."""
        top, error = 1.0 - self.gap.value, self.gap.error
        tops, noise = self.reference.tops, self.reference.error
        change = abs(tops[-1] - tops[-2])
        if self.gap.verdict == "no gap":
            return "a curved wall has one"
        if tops[-1] - noise > top + error + NOISE_OF_SIZE:
            return f"the judge has {tops[-1]:.5f}"
        if self.gap.verdict == "isolated" and top - error > tops[-1] + 2.0 * change + noise + NOISE_OF_SIZE:
            return f"the judge leads to {tops[-1]:.5f} + {change:.5f}"
        if self.gap.verdict == "essential edge":
            low, high = self.edge
            if not low - EDGE_NOISE <= top <= high + EDGE_NOISE:
                return f"the judge's edge is in {low:.4f} to {high:.4f}"
        return ""


def random_walls() -> Iterator[tuple[str, geo.Wall]]:
    """Curved and mixed walls, some with islands, some mirror-symmetric."""
    # in this order the first part of the list has all kinds
    for number in range(WALLS // 6):
        for mixed in range(3 * number, 3 * number + 3):
            yield f"mixed {mixed}", random_curved_wall(mixed)
        for island in range(2 * number, 2 * number + 2):
            yield f"island {island}", island_wall(island)
        yield f"mirrored {number}", mirrored_wall(number)


def rows_of(name: str, wall: geo.Wall, tolerance: float, more: bool) -> Iterator[Row]:
    """The gap of the wall's law in both conventions; with ``more`` also of a mixture and of the square."""
    law, matrices = ker.WallLaw(wall), judged(wall)
    low, high = edge = Judge(wall).straight()
    yield Row(name, spec.spectral_gap(law, tolerance), Reference.of(matrices), edge)
    turned = law.in_specular_frame()
    signs = (-1.0) ** np.arange(1, DEGREES[-1])
    gap = spec.spectral_gap(turned, tolerance)
    yield Row(f"{name}, specular", gap, Reference.of(matrices * signs, norm=not gap.self_adjoint), edge)
    if more:
        mixed = FRACTION * ker.lambertian() + (1.0 - FRACTION) * law
        rest = 1.0 - FRACTION
        yield Row(
            f"{name}, {FRACTION:g} Lambertian", spec.spectral_gap(mixed, tolerance), Reference.of(rest * matrices),
            (rest * low, rest * high),
        )  # fmt: skip
        both = Reference.of(matrices, norm=True)
        square = Reference(tuple(top**2 for top in both.tops), 2.0 * both.error)
        yield Row(f"{name}, squared", spec.spectral_gap(law**2, tolerance), square, (low**2, high**2))


def theorems() -> Iterator[tuple[str, spec.SpectralGap, bool]]:
    """Polygons and laws made from them: name, gap, and whether the theorem holds."""
    for seed in range(POLYGONS):
        law = ker.WallLaw(geo.Wall.from_vertices(wall_with(random_hollow(seed))))
        mixed = FRACTION * ker.lambertian() + (1.0 - FRACTION) * law
        for what, each, value in (
            ("", law, 0.0), (", specular", law.in_specular_frame(), 0.0), (", squared", law**2, 0.0),
            (f", {FRACTION:g} Lambertian", mixed, FRACTION),
            (f", {FRACTION:g} Lambertian, specular", mixed.in_specular_frame(), FRACTION),
        ):  # fmt: skip
            gap = spec.spectral_gap(each)
            verdict = "no gap" if value == 0.0 else "essential edge"
            yield f"polygon {seed}{what}", gap, abs(gap.value - value) <= gap.error + 1e-15 and gap.verdict == verdict


def tolerances() -> Iterator[tuple[str, float, float, float]]:
    """Name, requested tolerance, error, and reported error."""
    for name, (law, values) in KNOWN.items():
        for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
            found = spec.spectrum(law, 4, tolerance=tolerance)
            errors = found.errors.total()
            off = [int(np.argmin(np.abs(found.values - value))) for value in values]
            wrong = max(abs(found.values[i] - value) for i, value in zip(off, values, strict=True))
            yield name, tolerance, float(wrong), float(max(errors[i] for i in off))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.verdicts", description=__doc__)
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help="error asked of the random walls' gaps")
    parser.add_argument("--first", type=int, default=0, help="number of the first random wall; the tables only if 0")
    parser.add_argument("--last", type=int, default=WALLS, help=f"the last is that before this one, {WALLS} by default")
    parser.add_argument("--brief", action="store_true", help="random walls in the paper's convention only")
    options = parser.parse_args()
    if options.first == 0:
        _print_theorems_and_tolerances()
    rows: list[Row] = []

    def cells() -> Iterator[str]:
        for k, (name, wall) in islice(enumerate(random_walls()), options.first, options.last):
            found = rows_of(name, wall, options.tolerance, more=k % 4 == 0)
            for row in islice(found, 1 if options.brief else None):
                rows.append(row)
                gaps = ", ".join(f"{1.0 - top:.4f}" for top in row.reference.tops)
                kind = row.gap.verdict if row.gap.self_adjoint else f"{row.gap.verdict}, norm"
                bounds = f"{1.0 - row.edge[1]:.4f} to {1.0 - row.edge[0]:.4f}"
                yield (
                    f"{row.name} | {row.gap.value:.5f} +- {row.gap.error:.1e} | {kind} "
                    f"| {gaps} +- {row.reference.error:.1e} | {bounds} | {row.refutation or 'no'}"
                )

    print()
    print_table("law | gap | verdict | judge: 1 - top at degrees 16, 32, 64 | judge's straight rays | refuted", cells())
    verdicts = Counter(row.gap.verdict for row in rows)
    print("\n" + ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common()), end="")
    refuted = sum(bool(row.refutation) for row in rows)
    print(f"; {verdicts['undecided']} of {len(rows)} undecided, {refuted} refuted.")


def _print_theorems_and_tolerances() -> None:
    right = [(name, ok) for name, _, ok in theorems()]
    print(f"Theorems: {sum(ok for _, ok in right)} of {len(right)} as they say.")
    for name, ok in right:
        if not ok:
            print(f"**{name}**")
    rows = (
        f"{name} | {tolerance:.0e} | {wrong:.1e} | {reported:.1e} "
        f"| {'yes' if wrong <= reported + DIGITS_KNOWN else '**no**'}"
        for name, tolerance, wrong, reported in tolerances()
    )
    print()
    print_table("law | tolerance asked | error | error reported | holds", rows)


if __name__ == "__main__":
    main()
