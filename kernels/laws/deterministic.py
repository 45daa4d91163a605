"""Deterministic laws: measure-preserving involutions of (0, pi)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, angles, finite_array, frozen, instance, read_only
from ...core.errors import InputError
from ..bases.angles import bisected, clipped_inside
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.partitions import Bins
from ..expectations.conditionals import Conditionals
from ..matrices.matrix import KernelMatrix
from .law import Law, RandomMap

PROBES = 4096
# Width of a probe pair in probability. Rounding of the map by about 1e-16 then changes the slope by about 1e-10.
PAIR_MASS = 1e-6
SLOPE_TOLERANCE = 1e-5
RETURN_TOLERANCE = 1e-9
# Bound on the fraction of pairs with a jump of the map between them, for maps with fewer than 10^4 jumps.
JUMP_FRACTION = 0.01
# Cells of equal probability receive equal numbers of probes, up to one probe at each side of a jump.
CELLS = 32
CELL_TOLERANCE = 0.25
# Bound on the rounding error of the measure of an interval under a measure-preserving map.
JUMP_TOLERANCE = 1e-9


@dataclass(frozen=True)
class InvolutionLaw(Law):
    """The law theta' = T(theta) of a measure-preserving involution T.

    A reversible deterministic law has T(T(theta)) = theta and preserves sin(theta) d theta.

    Parameters
    ----------
    map : callable
        Vectorised function from angles to angles, both in (0, pi), in radians.

    Raises
    ------
    InputError
        If, on 4096 probes, T leaves [0, pi], T(T(theta)) differs from theta by more than 1e-9, or T does not preserve
        sin(theta) d theta: it stretches probability elsewhere than at isolated jumps, or fills cells unequally.

    Notes
    -----
    Source: Rudzis 2022, section 1.2.5, corrected: T must be an *involution*, not only measure-preserving.

    Examples
    --------
    >>> law = InvolutionLaw(lambda theta: np.pi - theta)
    >>> float(law.apply(np.cos, np.pi / 3).round(15)), law.mirror_symmetric
    (-0.5, True)
    >>> InvolutionLaw(lambda theta: theta / 2)    # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: map: expected an involution, got T(T(theta)) = 0.779... at theta = 3.117...
    """

    map: Callable[[Floats], Floats]

    reversible = True

    def __post_init__(self) -> None:
        if not callable(self.map):
            raise InputError(f"map: expected a function from angles to angles, got {self.map!r}")
        # With an irrational offset no probe hits a jump at a rational fraction.
        fraction = (np.arange(PROBES) + np.sqrt(2.0) - 1.0) / PROBES
        theta, beside = SINE.quantile(fraction), SINE.quantile(fraction - PAIR_MASS)
        image = self._mapped(theta)
        self._check_return(theta, self._mapped(image))
        self._check_measure(theta, beside, image)
        mirrored = np.pi - self._mapped(np.pi - theta)
        self._set(mirror_symmetric=bool(np.max(np.abs(mirrored - image)) <= RETURN_TOLERANCE))

    def _mapped(self, theta: Floats) -> Floats:
        image = finite_array("map", self.map(theta))
        if image.shape != theta.shape:
            raise InputError(f"map: expected a vectorised function, got shape {image.shape} for shape {theta.shape}")
        bad = (image < 0.0) | (image > np.pi)
        if bad.any():
            where = tuple(np.argwhere(bad)[0])
            raise InputError(
                f"map: expected angles in (0, pi), got {image[where]:.9g} at theta = {np.asarray(theta)[where]:.9g}"
            )
        return clipped_inside(image)

    def _check_return(self, theta: Floats, back: Floats) -> None:
        worst = int(np.argmax(np.abs(back - theta)))
        if abs(back[worst] - theta[worst]) > RETURN_TOLERANCE:
            raise InputError(
                f"map: expected an involution, got T(T(theta)) = {back[worst]:.9g} at theta = {theta[worst]:.9g}"
            )

    def _check_measure(self, theta: Floats, beside: Floats, image: Floats) -> None:
        stretch = np.abs(SINE.mass(self._mapped(beside), image)) / SINE.mass(beside, theta)
        wrong = np.abs(stretch - 1.0) > SLOPE_TOLERANCE
        cells = np.histogram(SINE.cdf(image), bins=CELLS, range=(0.0, 1.0))[0] * (CELLS / PROBES)
        if np.mean(wrong) > JUMP_FRACTION:
            worst = int(np.argmax(np.where(wrong, np.abs(np.log(np.maximum(stretch, 1e-300))), -1.0)))
            raise InputError(
                f"map: expected sin(theta) d theta to be preserved, got {stretch[worst]:.6g} times as much at theta = "
                f"{theta[worst]:.6g} ({int(wrong.sum())} of {PROBES} probes)"
            )
        if np.max(np.abs(cells - 1.0)) > CELL_TOLERANCE:
            raise InputError(
                f"map: expected sin(theta) d theta to be preserved, got {cells.min():.3g} to {cells.max():.3g} of what "
                f"each of {CELLS} equal cells should receive"
            )

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles where the map jumps or reverses direction, as far as 4096 probes show them."""
        return jumps_of_map(self.map), 0.0

    @property
    def angle_map(self) -> Callable[[Floats], Floats]:
        return self.map

    def random_map(self) -> RandomMap:
        """The map T, independent of the uniform number."""
        return lambda x, theta: (np.asarray(self.map(theta), dtype=np.float64), None)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self._mapped(theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return Conditionals.of_atoms(self._mapped(theta)[:, None], np.ones((theta.size, 1)), 0.0)

    def __repr__(self) -> str:
        # The user's function may be any callable.
        return f"InvolutionLaw({getattr(self.map, '__name__', repr(self.map))})"


def jumps_of_map(map_angle: Callable[[Floats], Floats]) -> Floats:
    """The angles where a measure-preserving map jumps or reverses direction, found from the measure between images."""
    probe = SINE.quantile((np.arange(PROBES) + 0.5) / PROBES)
    image = SINE.cdf(np.asarray(map_angle(probe), dtype=np.float64))
    broken = np.abs(np.abs(np.diff(image)) - SINE.mass(probe[:-1], probe[1:])) > JUMP_TOLERANCE
    low, high, start = probe[:-1][broken], probe[1:][broken], image[:-1][broken]

    def still_whole(middle: Floats) -> NDArray[np.bool_]:
        moved = np.abs(SINE.cdf(np.asarray(map_angle(middle), dtype=np.float64)) - start)
        return np.asarray(np.abs(moved - SINE.mass(low, middle)) <= JUMP_TOLERANCE)

    return bisected(low, high, still_whole)


# Fluxes that differ by less than this fraction of a cell are equal; fluxes below NO_MASS are rounding errors.
FLUX_TOLERANCE = 1e-9
NO_MASS = 1e-14


@dataclass(frozen=True, eq=False)
class IntervalExchangeLaw(Law):
    r"""A deterministic law with a given symmetric matrix: it exchanges piece (i, j) of cell i with piece (j, i) of
    cell j.

    The pieces of cell i are sorted by j and have the masses of the flux. The exchange therefore preserves
    sin(theta) d theta and is an involution, and its matrix on the cells is exactly the given one.

    Parameters
    ----------
    matrix : KernelMatrix
        A matrix on `Bins` in theta, with a symmetric flux whose rows sum to the weights, both within 1e-9 of a cell.

    Attributes
    ----------
    starts, widths : ndarray, shape (pieces,)
        Pieces in increasing order, as fractions of sin(theta)/2 d theta.
    partner : ndarray of int, shape (pieces,)
        The piece with which each piece is exchanged.

    Raises
    ------
    InputError
        If the matrix is not as described.

    Notes
    -----
    Every symmetric law is thus a limit of involutions, which are limits of laws of walls. Images are computed from
    fractions of the measure; within 1e-8 of 0 and pi they are accurate to 1e-8 only. Source: A. Plakhov, "Exterior
    Billiards" (2012), ch. 4; Rudzis 2022, section 1.2.5.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> law = IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
    >>> law.partner.tolist(), law.widths.round(12).tolist()
    ([0, 2, 1, 3], [0.25, 0.25, 0.25, 0.25])
    >>> ker.discretise(law, ker.Bins(2)).array.round(12).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """

    matrix: KernelMatrix
    starts: Floats = field(init=False, repr=False)
    widths: Floats = field(init=False, repr=False)
    partner: NDArray[np.int64] = field(init=False, repr=False)

    reversible = True

    def __post_init__(self) -> None:
        flux, edges = self._checked_flux(), self.matrix.basis.edges
        row, column = np.nonzero(flux > NO_MASS)
        widths = flux[row, column]
        # The pieces of each cell start at its left end, so that rounding errors do not add up across cells.
        inside = np.cumsum(widths)
        first = np.searchsorted(row, np.arange(self.matrix.size))
        before = inside - widths
        starts = SINE.cdf(edges[:-1])[row] + before - before[first][row]
        number = np.full(flux.shape, -1, dtype=np.int64)
        number[row, column] = np.arange(row.size)
        self._set(starts=frozen(starts), widths=frozen(widths), partner=read_only(number[column, row]))

    @property
    def angle_map(self) -> Callable[[Floats], Floats]:
        return self.map

    def image(self, theta: Floats) -> Floats:
        """The outgoing angle of every incoming angle."""
        theta = angles("theta", theta)
        fraction = SINE.cdf(theta)
        piece = np.clip(np.searchsorted(self.starts, fraction, side="right") - 1, 0, self.starts.size - 1)
        moved = fraction + (self.starts[self.partner[piece]] - self.starts[piece])
        angle = SINE.quantile(np.clip(moved, 0.0, 1.0))
        return clipped_inside(np.where(self.partner[piece] == piece, theta, angle))

    def map(self, theta: Floats) -> Floats:
        """`image` also at 0 and pi, which rounding can give."""
        return self.image(clipped_inside(finite_array("theta", theta)))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """All angles between two pieces; none are left out."""
        return np.asarray(SINE.quantile(self.starts[1:])), 0.0

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.image(theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return Conditionals.of_atoms(self.image(theta)[:, None], np.ones((theta.size, 1)), 0.0)

    def _checked_flux(self) -> Floats:
        matrix = self.matrix
        if not isinstance(matrix, KernelMatrix) or not isinstance(matrix.basis, Bins) or matrix.basis.measure != SINE:
            raise InputError(f"matrix: expected a KernelMatrix on Bins in theta, got {matrix!r}")
        flux, cell = matrix.flux, float(matrix.weights.min())
        if flux.min() < -FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected probabilities, got a flux of {flux.min():.3g}")
        unequal = float(np.abs(flux - flux.T).max())
        if unequal > FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected a symmetric flux, got entries that differ by {unequal:.3g}")
        missing = float(np.abs(flux.sum(axis=1) - matrix.weights).max())
        if missing > FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected rows that sum to 1, got a flux that misses {missing:.3g} of a cell's")
        return np.maximum(0.5 * (flux + flux.T), 0.0)


# Rays are split from this x = theta - pi/2 on, at which the partner 3 x - pi is grazing.
SPLIT_BEGINS = np.pi / 6.0
# Gauss nodes on intervals that double from 1/1024 of (b, pi - 3 b) on, because x' has a branch point at b - 0.005.
NODES, DOUBLINGS = 16, 10


@dataclass(frozen=True)
class LeastResistanceLaw(Law):
    r"""The minimiser of E[1 + cos(theta' - theta)] among all symmetric laws.

    Let x = theta - pi/2 and x' = theta' - pi/2, both in (-pi/2, pi/2). For x >= 0 (for x < 0 by mirror symmetry):

    - x < pi/6: specular, x' = -x;
    - pi/6 < x < b: x' = 3 x - pi with probability p(x) = -3 cos(3 x)/cos(x), else x' = -x;
    - b < x < pi - 3 b: sin(x') = sin(x) - sin(b) - sin(3 b);
    - pi - 3 b < x: x' = (x - pi)/3.

    The number b = 0.5537931... solves 2 cos(2 b) = int from b to pi - 3 b of sin(x - x') dx. Near-grazing rays are
    returned at a steeper angle. For pi/6 < x < b both outcomes occur, so the law is not deterministic, but
    deterministic involutions approximate it arbitrarily well (`IntervalExchangeLaw`).

    Notes
    -----
    A potential shows that the law is optimal. The even function phi with phi(x) = cos(2 x)/2 for 0 <= x < b and
    phi'(x) = -sin(x - x') for x > b satisfies phi(x) + phi(y) <= cos(x - y) for all x and y, with equality exactly on
    the support of the law. `extremal_resistance` checks the inequality. The resistance is 0.987823750351586; A. Plakhov
    (Arch. Ration. Mech. Anal. 194, 2009) published 0.9878.

    Examples
    --------
    >>> law = LeastResistanceLaw()
    >>> round(law.split_ends, 12), law.reversible, law.mirror_symmetric
    (0.55379314153, True, True)
    >>> float(law.sample(np.pi / 2 - 0.25, np.random.default_rng(0))) - np.pi / 2          # specular
    0.25
    """

    reversible = True
    mirror_symmetric = True

    @property
    def split_ends(self) -> float:
        """The number b, the end of the range of x in which rays are split."""
        return _split_ends()

    def images(self, theta: Floats) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles, shape ``theta.shape + (2,)``; the specular outcome is the first."""
        x = finite_array("theta", theta) - 0.5 * np.pi
        size = np.abs(x)
        away = np.clip(np.where(size < self.split_ends, -3.0 * np.cos(3.0 * size) / np.cos(size), 1.0), 0.0, 1.0)
        away = np.where(size < SPLIT_BEGINS, 0.0, away)
        partner = np.where(size < SPLIT_BEGINS, -size, partners(size, self.split_ends))
        image = np.stack([-size, partner], axis=-1) * np.where(x < 0.0, -1.0, 1.0)[..., None]
        return np.stack([1.0 - away, away], axis=-1), clipped_inside(image + 0.5 * np.pi)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles where the formula changes; none are left out."""
        x = np.array([SPLIT_BEGINS, self.split_ends, np.pi - 3.0 * self.split_ends])
        return 0.5 * np.pi + np.concatenate((-x[::-1], x)), 0.0

    def potential(self, theta: Floats) -> Floats:
        """The potential phi: phi(theta) + phi(theta') <= cos(theta' - theta), with equality on the law's support."""
        size = np.minimum(np.abs(finite_array("theta", theta) - 0.5 * np.pi), 0.5 * np.pi)
        b = self.split_ends
        last = np.pi - 3.0 * b
        # Cumulative integral of sin(x - x') over the sorted x from b to pi - 3 b; beyond, the integral is elementary.
        middle = np.unique(np.concatenate(([b], np.clip(size, b, last).ravel(), _graded(b))))
        table = np.concatenate(([0.0], np.cumsum(_turning(middle[:-1], middle[1:], b))))
        carried = table[np.searchsorted(middle, np.clip(size, b, last))]
        tail = 1.5 * (np.cos((2.0 * np.maximum(size, last) + np.pi) / 3.0) - np.cos((2.0 * last + np.pi) / 3.0))
        return np.asarray(0.5 * np.cos(2.0 * np.minimum(size, b)) - carried + tail)

    @cached_property
    def mean_cosine(self) -> float:
        """E[cos(theta' - theta)] under sin(theta)/2 d theta, by Gauss rules between the breakpoints."""
        edges = np.concatenate(([0.0], self.breakpoints(6)[0], [np.pi]))
        fine = np.concatenate((edges, 0.5 * np.pi + _graded(self.split_ends), 0.5 * np.pi - _graded(self.split_ends)))
        fine = np.unique(fine)
        angle, mass = SINE.quadrature(fine, NODES)
        probability, outgoing = self.images(angle)
        return float(mass @ np.sum(probability * np.cos(outgoing - angle[:, None]), axis=1) / mass.sum())

    def flux(self, cells: Bins) -> Floats:
        """The mass of sin(theta)/2 d theta that goes from each cell to each cell, shape (n, n), to rounding."""
        instance("cells", cells, Bins, "ker.Bins(64)")
        b = self.split_ends
        edges = cells.edges - 0.5 * np.pi
        edges = np.concatenate((edges, -edges))
        ends = [0.0, SPLIT_BEGINS, b, np.pi - 3.0 * b, 0.5 * np.pi]
        # Breakpoints, edges of cells, and preimages of the edges.
        middle_range = np.arcsin(np.clip(np.sin(edges) + np.sin(b) + np.sin(3.0 * b), -1.0, 1.0))
        cuts = np.concatenate((ends, edges, (edges + np.pi) / 3.0, np.pi + 3.0 * edges, middle_range))
        cuts = np.unique(np.clip(cuts, 0.0, 0.5 * np.pi))
        low, high = cuts[:-1], cuts[1:]
        middle = 0.5 * (low + high)
        whole = SINE.mass(low + 0.5 * np.pi, high + 0.5 * np.pi)
        # In the range of splitting, the rays that are not reflected specularly have the density -3 cos(3 x)/2.
        split = 0.5 * (np.sin(3.0 * low) - np.sin(3.0 * high))
        away = np.where(middle < SPLIT_BEGINS, 0.0, np.where(middle < b, split, whole))
        theta, flux = middle + 0.5 * np.pi, np.zeros((cells.size, cells.size))
        image = self.images(theta)[1]
        for target, mass in ((image[:, 0], whole - away), (image[:, 1], away)):
            np.add.at(flux, (cells.index(theta), cells.index(target)), mass)
            np.add.at(flux, (cells.index(np.pi - theta), cells.index(np.pi - target)), mass)
        return np.asarray(0.5 * (flux + flux.T))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        probability, outgoing = self.images(theta)
        return np.where(rng.random(theta.shape) < probability[..., 0], outgoing[..., 0], outgoing[..., 1])

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        probability, outgoing = self.images(theta)
        return Conditionals.of_atoms(outgoing, probability, 0.0)


def partners(size: Floats, b: float) -> Floats:
    """x' of the rays that are not reflected specularly, for x between pi/6 and pi/2."""
    middle = np.arcsin(np.clip(np.sin(size) - np.sin(b) - np.sin(3.0 * b), -1.0, 1.0))
    outer = np.where(size < b, 3.0 * size - np.pi, (size - np.pi) / 3.0)
    return np.where((size > b) & (size < np.pi - 3.0 * b), middle, outer)


def _graded(b: float) -> Floats:
    """Increasing x from b to pi - 3 b between which Gauss rules reach rounding."""
    return b + (np.pi - 4.0 * b) * np.concatenate(([0.0], 0.5 ** np.arange(DOUBLINGS, -1.0, -1.0)))


def _turning(low: Floats, high: Floats, b: float) -> Floats:
    """Integrals of sin(x - x') over intervals between b and pi - 3 b."""
    x, weight = gauss_on_intervals(low, high, NODES)
    return np.asarray((weight * np.sin(x - partners(x, b))).reshape(-1, NODES).sum(axis=1))


@lru_cache(maxsize=1)
def _split_ends() -> float:
    from scipy.optimize import brentq

    def excess(b: float) -> float:
        edges = _graded(b)
        return float(2.0 * np.cos(2.0 * b) - _turning(edges[:-1], edges[1:], b).sum())

    return float(brentq(excess, SPLIT_BEGINS, 0.6, xtol=1e-15))
