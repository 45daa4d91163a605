"""The top of the spectrum by rays from graded panels, which are divided where eigenfunctions need it.

Deterministic quadrature is too slow for chaotic hollows. There, the Rayleigh quotient of an eigenfunction is known from
a few million rays to some 1e-5, if the rays begin where the eigenfunction lives. A few hundred thousand rays show
eigenfunctions in narrow intervals of angles, which fall between the nodes of quadrature.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any, NamedTuple

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
from ...kernels.laws.law import outgoing_angles
from ...kernels.sampling.chunks import RaySums, count_long
from ...kernels.sampling.counts import missed_fraction
from ...kernels.sampling.sobol import PARTS, SOBOL_BITS, SobolRays, random_shifts
from ..essential.edge import without_lambertian
from .images import is_traced
from .trial_space import Rank

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
FIRST_POINTS, RAY_TIME = 2**13, 7e-7
# From so many points of a sequence on panels are divided only if what they do not resolve is more than the noise.
MANY_POINTS = 2**17
# Panels are divided until the rest of the effect on the eigenvalue is this fraction of its error.
UNRESOLVED = 0.1
# Points of a sequence at a time.
POINTS_AT_ONCE = 2**14
# Eigenfunctions that the panels follow on levels of few points; then that of the highest rank.
FOLLOWED, FEW_POINTS = 3, 2**15
# Earlier levels whose spread counts in the sampling error.
POOLED = 2
# Levels that show the largest values of a law, number of these values, and margin in standard errors.
SHOWING, LARGEST, SIGMAS = 3, 6, 6.0


def suits_rays(law: Law) -> bool:
    """Whether rays show the spectrum: the law is reversible, and driven by one number or traced."""
    return law.reversible is True and (law.random_map() is not None or is_traced(law))


@lru_cache(maxsize=8)
def values_by_rays(law: Law) -> tuple[Floats, Floats]:
    """Lower bounds, by some 400,000 rays, of the largest eigenvalues off the constants of a law P, and of those of -P.

    No bound is given if rays do not escape.
    """
    fraction, rest = without_lambertian(law)
    if fraction < 1.0:
        above, below = values_by_rays(rest)
        return fraction * above, fraction * below
    try:
        *_, last = islice(_levels(law, np.random.default_rng(0), np.inf, 0.0, np.abs), SHOWING)
    except AccuracyError:
        return np.empty(0), np.empty(0)
    return last.lower_bounds(1.0), last.lower_bounds(-1.0)


class Top(NamedTuple):
    """The eigenvalue of highest rank off the constants with its error, and the interval that panels reach of it."""

    value: float
    error: float
    least: float
    reached: float
    panels: int
    rays: int

    @property
    def centre(self) -> float:
        """The middle of what panels reach."""
        return 0.5 * (self.least + self.reached)

    def __str__(self) -> str:
        return f"{with_error(self.value, self.error)} by {self.rays} rays on {self.panels} panels of degree {DEGREE}"


def tops_by_rays(law: Law, rng: np.random.Generator, seconds: float, edge: float, rank: Rank) -> Iterator[Top]:
    """The top of the spectrum from more and more rays, until the time is over.

    Parameters
    ----------
    law : Law
        One that `suits_rays`.
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
    with progress_bar(None, "step", "gap by rays") as bar:
        for level in _levels(law, rng, seconds, edge, rank):
            yield level.top
            bar.describe(f"error {level.top.error:.1g}")
            bar.update()


def _levels(law: Law, rng: np.random.Generator, seconds: float, edge: float, rank: Rank) -> Iterator[_Level]:
    """Twice as many rays on finer panels each, or more on the same ones, whatever the time."""
    edges, share = _first_edges(), None
    rays, points, spent = None, FIRST_POINTS, 0.0
    spreads: list[float] = []
    while True:
        rays = _PanelSums(law, edges, share, rng) if rays is None else rays
        spent += RAY_TIME * PARTS * (points - rays.points)
        if spent > seconds and points > FIRST_POINTS:
            return
        rays.extend(points)
        with one_blas_thread():
            level = _Level(rays, rank, edge, spreads)
            spreads.append(level.spread)
            yield level
            finer = level.divided()
            if points < MANY_POINTS or (level.unseen > level.noise and len(finer) > len(edges)):
                share = level.share(finer)
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

    def traced(self, sums: RaySums, points: Floats) -> tuple[Floats, Floats]:
        if self.law.random_map() is not None:
            return super().traced(sums, points)
        # of a law with more randomness independent rays from these angles, by numbers that the points tell
        theta = self.incoming(points[..., 1])
        own = np.random.default_rng((points[:, 0, 0] * 2.0**SOBOL_BITS).astype(np.uint64))
        outgoing, escaped = self.law._sample_with_status(theta.copy(), own)
        sums.count_unresolved(escaped)
        return theta, outgoing_angles(outgoing, theta, self.law)

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
        self.sums, self.points, self.unresolved = RaySums(law, self.basis, PARTS), 0, 0.0

    def extend(self, points: int) -> None:
        """Add rays until each sequence has so many points."""
        cumulative = np.append(0.0, np.cumsum(self.share))
        rays = _PanelRays(
            self.law, self.basis, *self.shifts, self.seed, False, self.points, points, cumulative=cumulative
        )
        count_long(self.sums, rays, {})
        self.points, self.unresolved = points, self.sums.fraction_unresolved(PARTS * points)

    def matrices(self) -> Floats:
        """The symmetric matrices of all sequences off the constants, shape (PARTS, n, n)."""
        width, size = DEGREE + 1, self.basis.size
        density = np.repeat(self.share / _masses(self.basis.edges), width)
        rows = self.basis.of_legendre(self.sums.tables.reshape(PARTS, size, -1, width))
        both = self.basis.of_legendre(np.swapaxes(rows, 1, 2).reshape(PARTS, size, -1, width))
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


class _Level:
    """Quotients of eigenvectors of each half of the sequences by the other half, and how well panels resolve them."""

    def __init__(self, rays: _PanelSums, rank: Rank, edge: float, before: Sequence[float]) -> None:
        self.rays, self.rank, self.edge, self.before = rays, rank, edge, tuple(before[-POOLED:])
        matrices = rays.matrices()
        self.halves, self.whole = (matrices[::2], matrices[1::2]), matrices.mean(axis=0)
        self.values, self.vectors = self._leading(self.whole, rank)

    @staticmethod
    def _leading(matrix: Floats, rank: Rank, number: int = FOLLOWED) -> tuple[Floats, Floats]:
        """The highest ranks of eigenvalues, decreasing, and their eigenvectors."""
        values, vectors = np.linalg.eigh(matrix)
        order = np.argsort(-rank(values), kind="stable")[:number]
        return rank(values)[order], vectors[:, order]

    @cached_property
    def of_halves(self) -> tuple[Floats, Floats]:
        """Eigenvectors of one half, and their projections on those of the other, shape (n, FOLLOWED)."""
        (_, first), (_, second) = (self._leading(half.mean(axis=0), self.rank) for half in self.halves)
        alike = second @ (second.T @ first)
        return first, alike / np.linalg.norm(alike, axis=0)

    @cached_property
    def quotients(self) -> Floats:
        """Those of the highest rank, shape (PARTS,)."""
        pairs = zip(self.of_halves, self.halves[::-1], strict=True)
        each = [np.einsum("i,pij,j->p", vectors[:, 0], half, vectors[:, 0]) for vectors, half in pairs]
        return self.rank(np.concatenate(each))

    @cached_property
    def spread(self) -> float:
        """The standard deviation of the quotients, times the root of the number of points."""
        return float(np.std(self.quotients, ddof=1) * np.sqrt(self.rays.points))

    @cached_property
    def noise(self) -> float:
        """The sampling error, from the spreads of this level and of those before it.

        Of eight quotients alone it would often be too small where a level is taken for its small error.
        """
        spread = np.sqrt(np.mean(np.square([*self.before, self.spread])))
        return float(student_95(PARTS) * spread / np.sqrt(PARTS * self.rays.points))

    @cached_property
    def room(self) -> float:
        """Distance of the top from functions that panels do not resolve, as far as it is more than the noise.

        They are those of the essential spectrum, and the last coefficients on all panels.
        """
        vector = self.vectors[:, 0]
        rough = np.where(np.arange(len(vector)) % (DEGREE + 1) > DEGREE - LAST, vector, 0.0)
        of_rough = float(self.rank(rough @ self.whole @ rough / (rough @ rough)))
        return max(float(self.values[0]) - max(of_rough, self.edge, 0.0), self.noise)

    def _effects(self, last: int, number: int = 1) -> tuple[Floats, Floats]:
        """What the last coefficients on each panel change in the first eigenvalues, and how much of this is noise."""
        first, second = (each[:, :number].reshape(-1, DEGREE + 1, number)[:, -last:] for each in self.of_halves)
        scale = float(self.values[0]) ** 2 / self.room
        return scale * np.sum(first * second, axis=(1, 2)), scale * 0.5 * np.sum((first - second) ** 2, axis=(1, 2))

    @cached_property
    def unseen(self) -> float:
        """What the panels do not resolve of the eigenvalue."""
        effects = [self._effects(last) for last in (LAST, MORE)]
        seen, broad = (max(float(effect.sum()) + float(np.linalg.norm(noise)), 0.0) for effect, noise in effects)
        return max(seen, broad / BROAD)

    @cached_property
    def top(self) -> Top:
        """The eigenvalue with the errors of sampling, of the eigenvector, and of the panels."""
        mean, number = float(self.quotients.mean()), PARTS * self.rays.points
        raised = max(float(self.values[0]) - mean, 0.0)
        lost = 2.0 * self.rays.unresolved * float(np.max(self.vectors[:, 0] ** 2)) + 2.0 * missed_fraction(number)
        error = self.noise + raised / 3.0 + self.unseen + lost
        value = mean + 2.0 / 3.0 * raised + 0.5 * self.unseen
        return Top(value, error, mean - self.noise, mean + raised + self.noise, len(self.rays.share), number)

    def divided(self) -> Floats:
        """More edges: the middles of the panels with the largest effects, until the rest is a fraction of the error."""
        edges, number = self.rays.basis.edges, FOLLOWED if self.rays.points < FEW_POINTS else 1
        (seen, noise), (broad, broad_noise) = (self._effects(last, number) for last in (LAST, MORE))
        effect = np.maximum(seen, broad / BROAD)
        order = np.argsort(effect)
        chosen = np.zeros(len(effect), dtype=bool)
        chosen[order] = np.cumsum(np.maximum(effect[order], 0.0)) > UNRESOLVED * self.noise
        chosen &= ((seen > noise) | (broad > 2.0 * broad_noise)) & (np.diff(edges) > 2.0 * NARROWEST)
        # of too many the worst
        chosen[order[: max(2 * len(effect) - MOST_PANELS, 0)]] = False
        return np.union1d(edges, 0.5 * (edges[:-1] + edges[1:])[chosen])

    def share(self, finer: Floats) -> Floats:
        """The shares of the rays that begin on each of the finer panels."""
        edges, number = self.rays.basis.edges, FOLLOWED if self.rays.points < FEW_POINTS else 1
        inside = np.searchsorted(edges, 0.5 * (finer[:-1] + finer[1:])) - 1
        mass = _masses(finer)
        squares = np.sum(self.vectors[:, :number].reshape(len(edges) - 1, -1) ** 2, axis=1)
        modulus = np.sqrt(squares / _masses(edges))[inside] * mass
        parts = modulus / modulus.sum(), mass, np.full(len(mass), 1.0 / len(mass))
        return np.asarray(sum(weight * part for weight, part in zip(SHARES, parts, strict=True)))

    def lower_bounds(self, sign: float) -> Floats:
        """Lower bounds of the largest eigenvalues of P, or of -P, from quotients in spaces of the other half."""
        bases = [self._leading(sign * half.mean(axis=0), np.positive, LARGEST)[1] for half in self.halves]
        bounds = []
        for number in range(1, LARGEST + 1):
            quotients: list[Any] = []
            for basis, half in zip(bases, self.halves[::-1], strict=True):
                # the least eigenvalue in a space of this dimension is a lower bound of the one of this number
                each = sign * basis[:, :number].T @ half @ basis[:, :number]
                least = np.linalg.eigh(each.mean(axis=0))[1][:, 0]
                quotients.extend(np.einsum("i,pij,j->p", least, each, least))
            bounds.append(float(np.mean(quotients) - SIGMAS * np.std(quotients, ddof=1) / np.sqrt(PARTS)))
        return np.maximum.accumulate(bounds[::-1])[::-1]
