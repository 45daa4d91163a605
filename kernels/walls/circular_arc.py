"""The law of focusing circular arcs, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, number_between
from ..bases.angles import clipped_inside, mirrored_angle, mixed_arccos
from ..bases.basis import AngleFunction, Basis
from ..bases.intervals import joined_lists
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.panels import Panels
from ..expectations.arcs import ArcMeans, ArcPieces, PiecesOfAngles, arc_images, outgoing_lines
from ..expectations.basis_means import Expectations, Means
from ..laws.distribution import Distribution
from ..laws.law import DrivenLaw, entry_points

# Rows jump where the number of hits N changes. Each of the first intervals gets its own Gauss rule; beyond MOST_HITS
# hits, a fraction of rays of about 1/(4 N^2) and only for theta within xi/N of xi, the outgoing angle stays within xi/N
# of pi - xi (or xi) and its mean within xi/N^2: for a smooth function what is neglected is below 1/(4 N^4) = 4e-12.
MOST_HITS = 500
FEWEST_HITS = 8
NODES = 16
# Evaluations of the function held in memory at a time.
CHUNK = 2**14


@dataclass(frozen=True)
class CircularArcLaw(DrivenLaw):
    r"""Focusing circular arcs of half angle xi, one a period.

    A chord of the circle is turned by the same angle at every hit. With X uniform in (0, 1) from the left tip,

        delta = arccos(X cos(theta - xi) + (1 - X) cos(theta + xi)),
        delta <= pi/2 :  N = ceil((xi + theta - delta) / (2 delta)),  theta' = theta - 2 N delta + pi,

    and if delta > pi/2 the mirror image: theta -> pi - theta, delta -> pi - delta, theta' -> pi - theta'. N is the
    number of hits.

    Parameters
    ----------
    half_angle : float
        xi in (0, pi/2], radians.

    Raises
    ------
    InputError
        If it is not in that range.

    Notes
    -----
    Hits of a ray with N above about 1e8 are uncertain by N^2 eps, because the ray then ends at a tip within rounding;
    the outgoing angle changes by 2 delta at such a tie. For fixed theta the law of delta is explicit, with density
    sin(delta) / (2 sin(theta) sin(xi)), so `apply` needs no sampling in X: Gauss rules between the changes of N.

    Source: Rudzis 2022, section 2.2.3, corrected (eqs. 2.15, 2.17, 2.18 as printed are wrong).

    Examples
    --------
    A ray through the centre of a semicircle goes back where it came from.

    >>> law = CircularArcLaw(np.pi / 2)
    >>> round(float(law.reflect(0.5, 1.25)), 15), int(law.hits(0.5, 1.25))
    (1.25, 1)
    """

    half_angle: float

    reversible = True
    mirror_symmetric = True
    evaluations = 8 * NODES

    def __post_init__(self) -> None:
        checked = number_between("half_angle", self.half_angle, 0.0, 0.5 * np.pi, closed="high")
        object.__setattr__(self, "half_angle", checked)

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        right, base, chord, hits = self._rotation(entry_points(x), angles("theta", theta))
        outgoing = clipped_inside(np.pi + base - 2.0 * hits * chord)
        return np.where(right, mirrored_angle(outgoing), outgoing)

    def hits(self, x: ArrayLike, theta: ArrayLike) -> NDArray[np.int64]:
        """Number of reflections of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        return np.asarray(self._rotation(entry_points(x), angles("theta", theta))[3].astype(np.int64))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Incoming angles at which rows gain or lose an interval of X, and the probability of those left out.

        They are theta = xi (1 + 1/k) and xi k/(k + 1), their mirror images, xi and pi/2 -+ xi; they accumulate at xi
        and pi - xi, and those left out lie there.
        """
        count = max((limit - 4) // 4, 1)
        k = np.arange(1.0, count + 1.0)
        left = self.half_angle * np.concatenate([[1.0], 1.0 + 1.0 / k, k / (k + 1.0)])
        left = np.concatenate([left, [0.5 * np.pi - self.half_angle]])
        breakpoints = np.unique(np.concatenate([left, np.pi - left]))
        low, high = self.half_angle * count / (count + 1.0), self.half_angle * (count + 1.0) / count
        return breakpoints[(breakpoints > 0.0) & (breakpoints < np.pi)], min(
            float(2.0 * SINE.mass(low, min(high, np.pi))), 1.0
        )

    def distribution(self, theta: Floats, edges: Floats) -> Distribution:
        """The masses between the edges, as integrals of a sine."""
        return Distribution.of_cells(self.conditional_masses(theta, edges))

    def expectations(self, basis: Basis) -> Expectations:
        """Of polynomials on panels piece by piece, with errors; of others by `apply`."""
        if isinstance(basis, Panels):
            return _OnPanels(basis, self.half_angle, self.pieces)
        return super().expectations(basis)

    def _rotation(self, x: Floats, theta: Floats) -> tuple[NDArray[np.bool_], Floats, Floats, Floats]:
        """Whether the ray is followed in the mirror, its angle there, the chord's angle delta <= pi/2, and N."""
        angle, complement = mixed_arccos(x, theta, self.half_angle)
        right = angle > complement
        base = np.where(right, np.pi - theta, theta)
        chord = np.minimum(angle, complement)
        # The bound is exact; without it rounding could turn the single hit of a grazing ray into none.
        return right, base, chord, np.maximum(np.ceil((self.half_angle + base - chord) / (2.0 * chord)), 1.0)

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        return self.means(function, theta)

    def means(self, function: AngleFunction, theta: Floats, nodes: int = NODES, most_hits: int = MOST_HITS) -> Floats:
        """What `apply` gives, by Gauss rules of so many nodes where N is constant, N followed up to ``most_hits``."""
        flat = theta.reshape(-1)
        starts = range(0, max(flat.size, 1), CHUNK)
        parts = [self._means(function, flat[start : start + CHUNK], nodes, most_hits) for start in starts]
        total = np.concatenate(parts)
        return total.reshape(theta.shape + total.shape[1:])

    def _means(self, function: AngleFunction, theta: Floats, nodes: int, most_hits: int) -> Floats:
        ray, mirrored, outgoing, weight = self._conditional_quadrature(theta, nodes, most_hits)
        angle = clipped_inside(np.where(mirrored[:, None], np.pi - outgoing, outgoing))
        value = np.asarray(function(angle), dtype=np.float64)
        piece = np.einsum("ij,ij...->i...", weight, value)
        total = np.bincount(ray, weights=weight.sum(axis=1), minlength=theta.size)
        starts = np.searchsorted(ray, np.arange(theta.size))
        summed = np.add.reduceat(piece, starts, axis=0)
        return np.asarray(summed / total.reshape((-1,) + (1,) * (summed.ndim - 1)))

    def conditional_masses(self, theta: Floats, edges: Floats) -> Floats:
        """P(theta, (edges[j], edges[j + 1])) for increasing edges, shape (rays, cells): sums of integrals of a sine."""
        ray, mirror, lower, upper, hits, rest, alone = self.pieces(theta)
        lower = np.where(rest, lower, np.minimum(lower, upper))
        found = np.zeros((theta.size, edges.size - 1))
        step = max(1, 2**6 * CHUNK // edges.size)
        for start in range(0, ray.size, step):
            part = slice(start, start + step)
            base = np.where(mirror[part], np.pi - theta[ray[part]], theta[ray[part]])
            mirrored = np.where(mirror[part, None], np.pi - edges, edges)
            # theta' falls with delta, so the part of the piece below an edge has delta above this
            chord = (np.pi + base[:, None] - mirrored) / (2.0 * hits[part, None])
            chord = np.where(rest[part, None], np.where(mirrored > np.pi - self.half_angle, -1.0, 4.0), chord)
            high = np.maximum(upper[part], lower[part])[:, None]
            below = SINE.mass(np.clip(chord, lower[part, None], high), high)
            single = alone[part] & ~rest[part]
            below[single] = chord[single] <= upper[part][single, None]
            np.add.at(found, ray[part], np.abs(np.diff(below, axis=1)))
        return np.asarray(found / found.sum(axis=1, keepdims=True))

    def _conditional_quadrature(
        self, theta: Floats, nodes: int, most_hits: int
    ) -> tuple[NDArray[np.intp], NDArray[np.bool_], Floats, Floats]:
        """Gauss rules in delta between the changes of N, for every theta and both sides.

        Returns for each piece its ray and whether it is followed in the mirror, shape (pieces,), sorted by ray,
        and the outgoing angles there and their weights (not normalised), shape (pieces, nodes). A piece with one
        outcome has the weight of this at its nodes together.
        """
        ray, mirrored, lower, upper, hits, rest, alone = self.pieces(theta, most_hits)
        base = np.where(mirrored, np.pi - theta[ray], theta[ray])
        chord, weight = (part.reshape(-1, nodes) for part in gauss_on_intervals(lower, np.maximum(upper, lower), nodes))
        outgoing = np.pi + base[:, None] - 2.0 * hits[:, None] * chord
        outgoing = np.where(rest[:, None], np.pi - self.half_angle, outgoing)
        weight = weight * SINE.density(chord) + np.where(alone & ~rest, 1.0, 0.0)[:, None]
        return ray, mirrored, outgoing, weight

    def pieces(self, theta: Floats, most_hits: int = MOST_HITS) -> ArcPieces:
        """The intervals of delta on which N is constant, for every theta and both sides, sorted by ray."""
        xi = self.half_angle
        base = np.stack([theta, np.pi - theta], axis=-1).reshape(-1)
        total = xi + base
        low, high = np.abs(base - xi), np.minimum(np.pi - np.abs(np.pi - total), 0.5 * np.pi)
        # A degenerate row (theta below rounding of xi) keeps one piece of no width, with the right outcome.
        alone = (np.abs(high - low) <= 0.0) & (base <= 0.5 * np.pi)
        fewest = np.maximum(np.ceil((total - high) / (2.0 * high)), 1.0)
        with np.errstate(divide="ignore"):
            most = np.minimum(np.ceil((total - low) / (2.0 * low)), most_hits)
        most = np.maximum(most, fewest)
        pieces = np.where((high > low) | alone, most - fewest + 2.0, 0.0).astype(np.intp)
        owner, order = joined_lists(pieces)
        hits = np.asarray(fewest[owner] + order, dtype=np.float64)
        # The last piece of every row holds all the rays with more hits, at the mean of their outgoing angles.
        rest = order == pieces[owner] - 1
        lower = np.where(rest, low[owner], np.maximum(low[owner], total[owner] / (2.0 * hits + 1.0)))
        upper = np.minimum(high[owner], total[owner] / (2.0 * hits - 1.0))
        return ArcPieces(owner // 2, owner % 2 == 1, lower, upper, hits, rest, alone[owner])


def followed_hits(tolerance: float) -> int:
    """How many hits N to follow, so that integrals over theta of means of functions of slope 10 err by less.

    Rays with more hits are a fraction of 1/(4 N^2), for theta within xi/N of xi, and leave within 2 xi/N of their
    position.
    """
    return int(np.clip(np.ceil((100.0 / tolerance) ** 0.25), FEWEST_HITS, MOST_HITS))


@dataclass(frozen=True)
class _OnPanels(Expectations):
    basis: Panels
    half_angle: float
    pieces: PiecesOfAngles

    @property
    def has_errors(self) -> bool:
        return True

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        lines = outgoing_lines(self.half_angle, self.pieces(theta, followed_hits(tolerance)), theta)
        return arc_images(lines, self.basis, theta)

    def of(self, vectors: Floats) -> Means:
        means = ArcMeans(self.half_angle, self.pieces, self.basis, vectors)
        return lambda theta, tolerance: means(theta, followed_hits(tolerance))
