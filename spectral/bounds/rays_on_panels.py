"""The top of the spectrum by rays from graded panels, which are divided where eigenfunctions need it.

Deterministic quadrature is too slow for chaotic hollows. There, the Rayleigh quotient of an eigenfunction is known from
a few million rays to some 1e-5, if the rays begin where the eigenfunction lives. A few hundred thousand rays show
eigenfunctions in narrow intervals of angles, which fall between the nodes of quadrature.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from ...core.checks import Floats, new_seed
from ...core.errors import AccuracyError
from ...core.estimates import student_95
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
# Points of each of the sequences of the first level, twice as many on every next one.
FIRST_POINTS = 2**13
# From so many points of a sequence on panels are divided only if what they do not resolve is more than the noise.
MANY_POINTS = 2**17
# Panels are divided until the rest of the effect on the eigenvalue is this fraction of its error.
UNRESOLVED = 0.1
# Points of a sequence at a time.
POINTS_AT_ONCE = 2**16
# Eigenfunctions that the panels follow at least on levels of few points; then those that are asked for.
FOLLOWED, FEW_POINTS = 3, 2**15
# Levels that show the largest values of a law, or that none is above a number; how many values, and their margin in
# standard errors.
SHOWING, FEWER, LARGEST, SIGMAS = 3, 2, 6, 6.0


def suits_rays(law: Law) -> bool:
    """Whether rays show the spectrum: the law is reversible, and driven by one number or traced."""
    return law.reversible is True and (law.random_map() is not None or is_traced(law))


@lru_cache(maxsize=16)
def values_by_rays(law: Law, number: int = SHOWING, sigmas: float = SIGMAS) -> tuple[Floats, Floats]:
    """Lower bounds of the largest eigenvalues off the constants of a law P, and of those of -P, by a number of levels.

    They are quotients less so many standard errors; none are known if rays do not escape.
    """
    fraction, rest = without_lambertian(law)
    if fraction < 1.0:
        above, below = values_by_rays(rest, number, sigmas)
        return fraction * above, fraction * below
    try:
        *_, last = islice(levels(law, np.random.default_rng(0), np.abs), number)
    except AccuracyError:
        return np.empty(0), np.empty(0)
    return last.lower_bounds(np.positive, sigmas), last.lower_bounds(np.negative, sigmas)


def show_another(law: Law, listed: int, most: float, by_value: bool) -> float | None:
    """An eigenvalue, or modulus, beyond the first ``listed`` off the constants that is above ``most``, if rays show it.

    Few rays are traced if their quotients are not above it.
    """
    for number, sigmas in ((FEWER, 0.0), (SHOWING, SIGMAS)):
        above, below = values_by_rays(law, number, sigmas)
        seen = above if by_value else -np.sort(-np.append(above, below))
        if not np.any(seen[listed : listed + 1] > most):
            return None
    return float(seen[listed])


def levels(law: Law, rng: np.random.Generator, rank: Rank, number: int = 1) -> Iterator[Level]:
    """Twice as many rays on finer panels each, or on the same ones when these resolve what the rays show.

    Parameters
    ----------
    law : Law
        One that `suits_rays`.
    rank : callable
        np.positive for the largest eigenvalues, np.abs for the largest moduli.
    number : int
        Of eigenfunctions that the panels resolve.

    Notes
    -----
    A ray from the panel p to the panel q counts 1/(d_p + d_q) in both directions, where d is the density of the rays
    relative to the invariant measure, because a reversible law has the same flux in both. Half of eight Sobol sequences
    gives eigenvectors, whose quotients by the other half are below the eigenvalues of the panels by twice what the
    eigenvalues of all rays are above them. What the panels do not resolve is as large as the last coefficients on each.
    """
    edges, share, rays, points = _first_edges(), None, None, FIRST_POINTS
    while True:
        rays = PanelSums(law, edges, share, rng) if rays is None else rays
        rays.extend(points)
        with one_blas_thread():
            level = Level(rays, rank, number)
            finer = level.divided()
        yield level
        if points < MANY_POINTS or (np.any(level.unseen > level.noise) and len(finer) > len(edges)):
            edges, share, rays = finer, level.share(finer), None
        points *= 2


def _first_edges() -> Floats:
    graded = GRAZING * RATIO ** np.arange(np.ceil(np.log(JOIN / GRAZING) / np.log(RATIO)))
    inner = np.linspace(graded[-1], np.pi - graded[-1], INNER + 1)[1:-1]
    return np.concatenate([[0.0], graded, inner, np.pi - graded[::-1], [np.pi]])


def _masses(edges: Floats) -> Floats:
    return SINE.mass(edges[:-1], edges[1:])


@dataclass(frozen=True, eq=False)
class PanelRays(SobolRays):
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
        u = 0.5 * u if self.halved else u
        panel = np.clip(np.searchsorted(self.cumulative, u, side="right") - 1, 0, len(self.cumulative) - 2)
        mass = _masses(self.basis.edges)
        inside = (u - self.cumulative[panel]) / np.diff(self.cumulative)[panel]
        below = np.append(0.0, np.cumsum(mass))[panel] + mass[panel] * inside
        return clipped_inside(SINE.quantile(np.clip(below, 0.0, 1.0)))


class PanelSums:
    """Sums of rays on panels, which can be continued; if the law is ``mirrored``, each counts with its mirror image."""

    def __init__(self, law: Law, edges: Floats, share: Floats | None, rng: np.random.Generator) -> None:
        self.law, self.basis, self.mirrored = law, Panels(edges, DEGREE), law.mirror_symmetric is True
        self.share = np.full(len(edges) - 1, 1.0 / (len(edges) - 1)) if share is None else share
        self.seed = new_seed(rng)
        self.shifts = random_shifts(self.seed, PanelRays.dimension)
        self.sums, self.points, self.unresolved = RaySums(law, self.basis, PARTS), 0, 0.0

    def rays(self, start: int, end: int) -> PanelRays:
        """These rays of each sequence."""
        cumulative = np.append(0.0, np.cumsum(self.share))
        return PanelRays(
            self.law, self.basis, *self.shifts, self.seed, self.mirrored, start, end, cumulative=cumulative
        )

    def extend(self, points: int) -> None:
        """Add rays until each sequence has so many points."""
        count_long(self.sums, self.rays(self.points, points), {})
        self.points, self.unresolved = points, self.sums.fraction_unresolved(PARTS * points)

    @property
    def density(self) -> Floats:
        """Of the rays on each panel, relative to the invariant measure."""
        return np.asarray(self.share / _masses(self.basis.edges))

    @property
    def mirror(self) -> tuple[NDArray[np.intp], Floats]:
        """The number of the function that is the mirror image of each function, and the sign that it takes."""
        image = np.arange(self.basis.size).reshape(-1, DEGREE + 1)[::-1].ravel()
        return image, np.where(image % (DEGREE + 1) % 2, -1.0, 1.0)

    def matrices(self) -> Floats:
        """The symmetric matrices of all sequences off the constants, shape (PARTS, n, n)."""
        width, size = DEGREE + 1, self.basis.size
        density = np.repeat(self.density, width)
        rows = self.basis.of_legendre(self.sums.tables.reshape(PARTS, size, -1, width))
        both = self.basis.of_legendre(np.swapaxes(rows, 1, 2).reshape(PARTS, size, -1, width))
        both = both + np.swapaxes(both, 1, 2)
        if self.mirrored:
            image, sign = self.mirror
            both = 0.5 * (both + sign[:, None] * both[:, image][:, :, image] * sign)
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


class Level:
    """The leading eigenfunctions of rays on panels, and how well these and the rays show them.

    Attributes
    ----------
    rays : PanelSums
    rank : callable
    number : int
        Of the functions to resolve. On levels of few points the panels follow at least FOLLOWED.
    """

    def __init__(self, rays: PanelSums, rank: Rank, number: int) -> None:
        self.rays, self.rank, self.number = rays, rank, number
        matrices = rays.matrices()
        self.halves, self.whole = (matrices[::2], matrices[1::2]), matrices.mean(axis=0)

    def _eigenpairs(self, matrix: Floats) -> tuple[Floats, Floats]:
        """All eigenvalues, and eigenvectors of either parity if mirrored."""
        if not self.rays.mirrored:
            return np.linalg.eigh(matrix)
        image, sign = (each[: len(matrix) // 2] for each in self.rays.mirror)
        own, other = matrix[: len(image), : len(image)], sign * matrix[: len(image), image]
        (even, first), (odd, second) = np.linalg.eigh(own + other), np.linalg.eigh(own - other)
        vectors = np.empty(matrix.shape)
        vectors[: len(image)] = np.sqrt(0.5) * np.concatenate([first, second], axis=1)
        vectors[image] = np.sqrt(0.5) * sign[:, None] * np.concatenate([first, -second], axis=1)
        return np.append(even, odd), vectors

    @cached_property
    def pairs_of_halves(self) -> list[tuple[Floats, Floats]]:
        """The eigenpairs of the means of each half."""
        return [self._eigenpairs(half.mean(axis=0)) for half in self.halves]

    @cached_property
    def leading(self) -> tuple[Floats, Floats]:
        """The highest ranks of eigenvalues of all rays, decreasing, and their eigenvectors, shape (n, followed)."""
        return _first(*self._eigenpairs(self.whole), self.rank, max(self.number, FOLLOWED))

    @property
    def values(self) -> Floats:
        """The ranks of `leading`."""
        return self.leading[0]

    @property
    def vectors(self) -> Floats:
        """The eigenvectors of `leading`."""
        return self.leading[1]

    @cached_property
    def signs(self) -> Floats:
        """The signs of the eigenvalues of ``vectors``."""
        return np.asarray(np.sign(np.einsum("ik,ij,jk->k", self.vectors, self.whole, self.vectors)))

    @property
    def parities(self) -> Floats:
        """The signs that the mirror images of ``vectors`` take; 0 if the law is not mirrored."""
        image, sign = self.rays.mirror
        same = np.sign(np.sum(self.vectors * sign[:, None] * self.vectors[image], axis=0))
        return np.asarray(same if self.rays.mirrored else 0.0 * same)

    @property
    def followed(self) -> int:
        """Functions that the panels of the next level follow."""
        return len(self.values) if self.rays.points < FEW_POINTS else self.number

    @cached_property
    def of_halves(self) -> tuple[Floats, Floats]:
        """Eigenvectors of one half, and their projections on those of the other, shape (n, followed)."""
        (_, first), (_, second) = (_first(*pairs, self.rank, len(self.values)) for pairs in self.pairs_of_halves)
        alike = second @ (second.T @ first)
        return first, alike / np.linalg.norm(alike, axis=0)

    @cached_property
    def quotients(self) -> Floats:
        """Of each sequence, by the eigenvectors of the other half, shape (PARTS, followed)."""
        pairs = zip(self.of_halves, self.halves[::-1], strict=True)
        return self.rank(
            np.concatenate([np.einsum("ik,pij,jk->pk", vectors, half, vectors) for vectors, half in pairs])
        )

    @cached_property
    def noise(self) -> Floats:
        """The sampling error of their mean."""
        return np.asarray(student_95(PARTS) * self.quotients.std(axis=0, ddof=1) / np.sqrt(PARTS))

    @cached_property
    def raised(self) -> Floats:
        """How far the values are above the eigenvalues of the panels, and quotients of ``vectors`` are below these."""
        return np.asarray(np.maximum(self.values - self.quotients.mean(axis=0), 0.0) / 3.0)

    @cached_property
    def effects(self) -> list[tuple[Floats, Floats]]:
        """The effects of the last two coefficients on each panel, and of the last four, with their noise."""
        return [self._effects(last) for last in (LAST, MORE)]

    def _effects(self, last: int) -> tuple[Floats, Floats]:
        """What the last coefficients on each panel change in each value, and how much of this is noise.

        The resolvent of the rays on the last functions of all panels tells how near these are to each value.
        """
        block = np.flatnonzero(np.arange(len(self.vectors)) % (DEGREE + 1) > DEGREE - last)
        quotients, basis = np.linalg.eigh(self.whole[np.ix_(block, block)])
        distance = np.maximum(self.values - self.rank(quotients)[:, None], self.noise)
        first, second = (each[block] for each in self.of_halves)

        def joint(one: Floats, other: Floats) -> Floats:
            resolved = basis @ ((basis.T @ other) / distance)
            return np.asarray((self.values**2 * one * resolved).reshape(-1, last, len(self.values)).sum(axis=1))

        return joint(first, second), np.abs(0.5 * joint(first - second, first - second))

    @cached_property
    def unseen(self) -> Floats:
        """What the panels do not resolve of each eigenvalue."""
        seen, broad = (
            np.maximum(each.sum(axis=0) + np.linalg.norm(noise, axis=0), 0.0) for each, noise in self.effects
        )
        return np.asarray(np.maximum(seen, broad / BROAD))

    @property
    def squares(self) -> Floats:
        """The square of each function that is followed on each panel, shape (panels, followed)."""
        parts = self.vectors[:, : self.followed].reshape(-1, DEGREE + 1, self.followed)
        return np.asarray(np.sum(parts**2, axis=1))

    @property
    def lost(self) -> float:
        """The effect of rays that do not escape, and of what none of the rays met."""
        most = float(np.max(self.squares / self.rays.share[:, None]))
        return 2.0 * self.rays.unresolved * most + 2.0 * missed_fraction(PARTS * self.rays.points)

    def divided(self) -> Floats:
        """More edges: the middles of the panels with the largest effects, until the rest is a fraction of the error."""
        edges = self.rays.basis.edges
        (seen, noise), (broad, broad_noise) = (
            (part[:, : self.followed].sum(axis=1) for part in both) for both in self.effects
        )
        effect = np.maximum(seen, broad / BROAD)
        order = np.argsort(effect)
        chosen = np.zeros(len(effect), dtype=bool)
        chosen[order] = np.cumsum(np.maximum(effect[order], 0.0)) > UNRESOLVED * self.noise[: self.number].min()
        chosen &= ((seen > noise) | (broad > 2.0 * broad_noise)) & (np.diff(edges) > 2.0 * NARROWEST)
        # of too many the worst
        chosen[order[: max(2 * len(effect) - MOST_PANELS, 0)]] = False
        chosen |= chosen[::-1] & self.rays.mirrored
        return np.union1d(edges, 0.5 * (edges[:-1] + edges[1:])[chosen])

    def share(self, finer: Floats) -> Floats:
        """The shares of the rays that begin on each of the finer panels."""
        edges = self.rays.basis.edges
        inside = np.searchsorted(edges, 0.5 * (finer[:-1] + finer[1:])) - 1
        mass = _masses(finer)
        modulus = np.sqrt(self.squares.sum(axis=1) / _masses(edges))[inside] * mass
        parts = modulus / modulus.sum(), mass, np.full(len(mass), 1.0 / len(mass))
        return np.asarray(sum(weight * part for weight, part in zip(SHARES, parts, strict=True)))

    def lower_bounds(self, rank: Rank, sigmas: float) -> Floats:
        """Lower bounds of the highest ranks, values or their negatives, by quotients in spaces of other rays."""
        bases, bounds = [_first(*pairs, rank, LARGEST)[1] for pairs in self.pairs_of_halves], []
        for number in range(1, LARGEST + 1):
            quotients: list[Any] = []
            for basis, half in zip(bases, self.halves[::-1], strict=True):
                # the least eigenvalue in a space of this dimension is a lower bound of the one of this number
                each = rank(basis[:, :number].T @ half @ basis[:, :number])
                least = np.linalg.eigh(each.mean(axis=0))[1][:, 0]
                quotients.extend(np.einsum("i,pij,j->p", least, each, least))
            bounds.append(float(np.mean(quotients) - sigmas * np.std(quotients, ddof=1) / np.sqrt(PARTS)))
        return np.maximum.accumulate(bounds[::-1])[::-1]


def _first(values: Floats, vectors: Floats, rank: Rank, number: int) -> tuple[Floats, Floats]:
    """The highest ranks, decreasing, and their eigenvectors."""
    order = np.argsort(-rank(values), kind="stable")[:number]
    return rank(values)[order], vectors[:, order]
