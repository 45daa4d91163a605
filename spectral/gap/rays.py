"""The top of the spectrum by rays from graded panels, which are divided where the eigenfunction needs it.

Deterministic quadrature is too slow for chaotic hollows. There, the Rayleigh quotient of an eigenfunction is known from
a few million rays to some 1e-5, if the rays begin where the eigenfunction lives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...core.estimates import student_95, with_error
from ...core.long_runs import progress_bar
from ...kernels import Law, Panels
from ...kernels.bases.angles import clipped_inside
from ...kernels.bases.assembly import add_blocks, one_blas_thread
from ...kernels.bases.measure import SINE
from ...kernels.sampling.chunks import RaySums, count_long
from ...kernels.sampling.counts import missed_fraction
from ...kernels.sampling.sobol import PARTS, SobolRays, random_shifts
from ...kernels.walls.conditionals import UNRESOLVED_TOLERANCE
from ..bounds.oscillations import values_in_bins
from ..bounds.trial_space import Rank
from ..essential.edge import EssentialEdge
from .verdict import SpectralGap, gap_between

# Degree on each panel, of which the last two degrees show how well an eigenfunction is resolved, and the last four,
# divided by BROAD, that the last two are not small by accident.
DEGREE, LAST, MORE, BROAD = 6, 2, 4, 10.0
# Width of the first panel at grazing, ratio of the next ones up to JOIN, and number of panels between them.
GRAZING, RATIO, JOIN, INNER = 1e-4, 2.0, 0.15, 24
# Least width of a panel that is divided, and largest number of panels.
NARROWEST, MOST_PANELS = 1e-5, 120
# Fractions of the rays that begin by the modulus of the eigenfunction, by the invariant measure, and by panels.
SHARES = 0.65, 0.2, 0.15
# Points of each of the sequences of the first level, twice as many on every next one; nominal seconds of a ray.
FIRST_POINTS, RAY_TIME = 2**13, 1e-6
# From so many points of a sequence on panels are divided only if what they do not resolve is more than the noise.
MANY_POINTS = 2**17
# Panels are divided until the rest of the effect on the eigenvalue is this fraction of its error.
UNRESOLVED = 0.1
# Rays after which panels that reach no edge show that nothing is beyond it, and the method in words then.
AT_EDGE, OF_EDGE = 2**19, "edge of the essential spectrum, from the law's action on grazing rays and its isometries"
# Points of a sequence at a time.
POINTS_AT_ONCE = 2**14


def suits_rays(law: Law) -> bool:
    """Whether the law is reversible, and driven by one number."""
    return law.reversible is True and law.random_map() is not None


def gap_by_rays(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge, rank: Rank = np.positive
) -> SpectralGap:
    """The gap, or 1 - slem if ranked by modulus, from rays until its error is at most the tolerance.

    A level that misses an eigenvalue which rays in bins show is left out.
    """
    above, below = values_in_bins(law)
    shown = max([0.0, *above[:1], *(below[:1] if rank is np.abs else ())])
    tops: list[Top] = []
    best: Top | None = None
    for top in tops_by_rays(law, rng, seconds, edge.high, rank):
        tops.append(top)
        if top.rays >= AT_EDGE and max(top.reached, shown) < edge.low:
            short = (
                f"no eigenvalue beyond the edge {edge.value:.8g}: {top.reached:.6g} is the largest by {top.rays} rays"
            )
            return gap_between(0.0, 0.0, edge, OF_EDGE, (*map(str, tops), short), law.frame)
        if top.value + top.error >= shown and (best is None or top.error < best.error):
            best = top
            if best.error <= tolerance:
                break
    how = "quotients of an eigenfunction by rays from panels; sampling error + error of the eigenfunction"
    evidence = (*map(str, tops), f"rays in bins show an eigenvalue of at least {shown:.3g}")
    low, high = (shown, 1.0) if best is None else (best.value - best.error, min(best.value + best.error, 1.0))
    return gap_between(low, high, edge, how, evidence, law.frame)


class Top(NamedTuple):
    """The eigenvalue of highest rank off the constants with its error, and what the panels reach of it."""

    value: float
    error: float
    reached: float
    panels: int
    rays: int

    def __str__(self) -> str:
        return f"{with_error(self.value, self.error)} by {self.rays} rays on {self.panels} panels of degree {DEGREE}"


def tops_by_rays(law: Law, rng: np.random.Generator, seconds: float, edge: float, rank: Rank) -> Iterator[Top]:
    """The top of the spectrum from more and more rays, until the time is over.

    Parameters
    ----------
    law : Law
        Reversible, with a `random_map`.
    edge : float
        The essential spectrum is below.
    rank : callable
        np.positive for the largest eigenvalue, np.abs for the largest modulus.

    Notes
    -----
    A ray from the panel p to the panel q counts 1/(d_p + d_q) in both directions, where d is the density of the rays
    relative to the invariant measure, because a reversible law has the same flux in both. Half of eight Sobol sequences
    gives an eigenvector, whose quotient by the other half is below the eigenvalue of the panels by twice what the
    eigenvalue of all rays is above it. What the panels do not resolve is as large as the last coefficients on each.
    """
    edges, share = _first_edges(), None
    rays, points, spent = None, FIRST_POINTS, 0.0
    with progress_bar(None, "step", "gap by rays") as bar:
        while True:
            if rays is None:
                rays = _PanelSums(law, edges, share, rng)
            spent += RAY_TIME * PARTS * (points - rays.points)
            if spent > seconds and points > FIRST_POINTS:
                return
            rays.extend(points)
            with one_blas_thread():
                found = _Quotient.of(rays, rank, edge)
            top = found.top(rays)
            yield top
            bar.describe(f"error {top.error:.1g}")
            bar.update()
            finer = found.divided(edges, UNRESOLVED * found.noise)
            if points < MANY_POINTS or (found.unseen > found.noise and len(finer) > len(edges)):
                share = found.share(edges, finer)
                edges, rays = finer, None
            # by powers of two, and from many points on by the numbers in the middle also
            odd = points & (points - 1)
            points = points * 4 // 3 if odd else points * 3 // 2 if points >= MANY_POINTS and rays else points * 2


def _first_edges() -> Floats:
    graded = GRAZING * RATIO ** np.arange(np.ceil(np.log(JOIN / GRAZING) / np.log(RATIO)))
    inner = np.linspace(graded[-1], np.pi - graded[-1], INNER + 1)[1:-1]
    return np.concatenate([[0.0], graded, inner, np.pi - graded[::-1], [np.pi]])


def _masses(edges: Floats) -> Floats:
    return SINE.mass(edges[:-1], edges[1:])


@dataclass(frozen=True, eq=False)
class _PanelRays(SobolRays):
    """Rays of which each panel of the basis has a share; ``cumulative`` has the sums of the shares, from 0 to 1."""

    basis: Panels
    cumulative: Floats = field(default_factory=lambda: np.array([0.0, 1.0]))

    @property
    def chunk(self) -> int:
        return POINTS_AT_ONCE

    def add_points(self, sums: RaySums, first: int, points: Floats) -> None:
        """Add products of the panels' Legendre polynomials, which are transformed when all rays are added."""
        for row, angles in enumerate(zip(*self.traced(sums, points), strict=True), first):
            (source, here), (target, there) = map(self.basis.positions, angles)
            functions = (np.asarray(legvander(one, DEGREE), dtype=np.float64) for one in (here, there))
            add_blocks(sums.tables[row], self.basis, source, target, *functions)

    def incoming(self, u: Floats) -> Floats:
        panel = np.clip(np.searchsorted(self.cumulative, u, side="right") - 1, 0, len(self.cumulative) - 2)
        mass = _masses(self.basis.edges)
        inside = (u - self.cumulative[panel]) / np.diff(self.cumulative)[panel]
        below = np.append(0.0, np.cumsum(mass))[panel] + mass[panel] * inside
        return clipped_inside(SINE.quantile(np.clip(below, 0.0, 1.0)))


class _PanelSums:
    """Sums of rays on panels, which can be continued."""

    def __init__(self, law: Law, edges: Floats, share: Floats | None, rng: np.random.Generator) -> None:
        self.law, self.basis = law, Panels(edges, DEGREE)
        self.share = np.full(len(edges) - 1, 1.0 / (len(edges) - 1)) if share is None else share
        self.seed = tuple(int(word) for word in rng.integers(0, 2**63, size=2))
        self.shifts = random_shifts(self.seed, _PanelRays.dimension)
        self.sums, self.points = RaySums(law, self.basis, PARTS), 0

    def extend(self, points: int) -> None:
        """Add rays until each sequence has so many points."""
        cumulative = np.append(0.0, np.cumsum(self.share))
        rays = _PanelRays(
            self.law, self.basis, *self.shifts, self.seed, False, self.points, points, cumulative=cumulative
        )
        count_long(self.sums, rays, {})
        self.points = points
        if self.unresolved > UNRESOLVED_TOLERANCE:
            raise AccuracyError(f"{self.law!r}: {self.unresolved:.2g} of the rays did not escape", self.unresolved)

    @property
    def unresolved(self) -> float:
        """The fraction of rays that did not escape."""
        return self.sums.unresolved / (PARTS * self.points)

    def matrices(self) -> Floats:
        """The symmetric matrices of all sequences off the constants, shape (PARTS, n, n)."""
        density = np.repeat(self.share / _masses(self.basis.edges), DEGREE + 1)
        width = self.basis.degree + 1
        rows = self.basis.of_legendre(self.sums.tables.reshape(PARTS, self.basis.size, -1, width))
        both = self.basis.of_legendre(np.swapaxes(rows, 1, 2).reshape(PARTS, self.basis.size, -1, width))
        both = both + np.swapaxes(both, 1, 2)
        # at grazing polynomials are large where few rays are, so that the panels at the ends have constants only
        ends = [*range(1, width), *range(1 - width, 0)]
        both[:, ends] = both[:, :, ends] = 0.0
        both /= self.points * (density[:, None] + density)
        constant = self.basis.constant
        once = both @ constant
        twice = once @ constant
        return np.asarray(
            both - once[:, :, None] * constant - once[:, None] * constant[:, None]
            + twice[:, None, None] * np.outer(constant, constant)
        )  # fmt: skip


@dataclass(frozen=True)
class _Quotient:
    """The quotients of eigenvectors of each half of the sequences by the other half.

    Attributes
    ----------
    quotients : array of shape (PARTS,)
    of_all, room : float
        The highest rank in the matrix of all rays, and its distance from those of functions that panels do not resolve:
        of the essential spectrum, and of the last coefficients on all panels.
    vectors : array of shape (2, panels, DEGREE + 1)
        The eigenvectors of both halves.
    """

    quotients: Floats
    of_all: float
    room: float
    vectors: Floats

    @classmethod
    def of(cls, rays: _PanelSums, rank: Rank, edge: float) -> _Quotient:
        """The quotients of a level."""
        matrices = rays.matrices()
        halves, whole = (matrices[::2], matrices[1::2]), matrices.mean(axis=0)
        (_, first), (_, second), (top, vector) = (
            _extremal(one, rank) for one in (*(half.mean(axis=0) for half in halves), whole)
        )
        quotients = [
            rank(np.einsum("i,pij,j->p", vector, half, vector))
            for vector, half in zip((first, second), halves[::-1], strict=True)
        ]
        second = second * np.sign(first @ second)
        vectors = np.array([first, second]).reshape(2, -1, DEGREE + 1)
        rough = np.where(np.arange(len(vector)) % (DEGREE + 1) > DEGREE - LAST, vector, 0.0)
        of_rough = float(rank(rough @ whole @ rough / (rough @ rough)))
        return cls(np.concatenate(quotients), top, top - max(of_rough, edge, 0.0), vectors)

    @property
    def noise(self) -> float:
        """The sampling error."""
        return student_95(PARTS) * float(np.std(self.quotients, ddof=1) / np.sqrt(PARTS))

    def _effects(self, last: int) -> tuple[Floats, Floats]:
        """What the last coefficients on each panel change in the eigenvalue, and how much of this is noise."""
        first, second = self.vectors[..., -last:]
        scale = self.of_all**2 / max(self.room, self.noise)
        return scale * np.sum(first * second, axis=-1), scale * 0.5 * np.sum((first - second) ** 2, axis=-1)

    @property
    def unseen(self) -> float:
        """What the panels do not resolve of the eigenvalue."""
        effects = [self._effects(last) for last in (LAST, MORE)]
        seen, broad = (max(float(effect.sum()) + float(np.linalg.norm(noise)), 0.0) for effect, noise in effects)
        return max(seen, broad / BROAD)

    def top(self, rays: _PanelSums) -> Top:
        """The eigenvalue with the errors of sampling, of the eigenvector, and of the panels."""
        mean, number = float(self.quotients.mean()), PARTS * rays.points
        raised, unseen = max(self.of_all - mean, 0.0), self.unseen
        lost = (2.0 * rays.unresolved) * float(np.max(self.vectors**2)) + 2.0 * missed_fraction(number)
        error = self.noise + raised / 3.0 + unseen + lost
        value, reached = mean + 2.0 / 3.0 * raised + 0.5 * unseen, mean + raised + self.noise
        return Top(value, error, reached, len(rays.share), number)

    def divided(self, edges: Floats, goal: float) -> Floats:
        """More edges: the middles of the panels with the largest effects, until the rest is below the goal."""
        (seen, noise), (broad, broad_noise) = (self._effects(last) for last in (LAST, MORE))
        effect = np.maximum(seen, broad / BROAD)
        order = np.argsort(effect)
        chosen = np.zeros(len(effect), dtype=bool)
        chosen[order] = np.cumsum(np.maximum(effect[order], 0.0)) > goal
        chosen &= ((seen > noise) | (broad > 2.0 * broad_noise)) & (np.diff(edges) > 2.0 * NARROWEST)
        # of too many the worst
        chosen[order[: max(len(effect) - (MOST_PANELS - len(effect)), 0)]] = False
        return np.union1d(edges, 0.5 * (edges[:-1] + edges[1:])[chosen])

    def share(self, edges: Floats, finer: Floats) -> Floats:
        """The shares of the rays that begin on each of the finer panels."""
        inside = np.searchsorted(edges, 0.5 * (finer[:-1] + finer[1:])) - 1
        mass = _masses(finer)
        modulus = np.sqrt(np.sum(self.vectors**2, axis=(0, 2)) / _masses(edges))[inside] * mass
        parts = modulus / modulus.sum(), mass, np.full(len(mass), 1.0 / len(mass))
        return np.asarray(sum(weight * part for weight, part in zip(SHARES, parts, strict=True)))


def _extremal(matrix: Floats, rank: Rank) -> tuple[float, Floats]:
    """The highest rank of an eigenvalue, and its eigenvector."""
    values, vectors = np.linalg.eigh(matrix)
    first = int(np.argmax(rank(values)))
    return float(rank(values)[first]), vectors[:, first]
