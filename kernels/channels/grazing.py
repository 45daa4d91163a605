"""Integrals over grazing angles of the law of a hollow with a channel at its opening.

A ray that crosses a channel d times, d = c cot(theta) for a channel of c widths, comes to its lower end with uniform x
and with its angle theta or pi - theta, which alternate with d. The same holds on the way out. Near grazing d takes all
values, so the expectations of functions that are odd under the mirror image have critical angles that accumulate like
1/d. Even functions do not notice the channel.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from ...core.checks import Floats
from ...geometry import Wall
from ...geometry.cells.channel import Channel, channel_of
from ...geometry.itineraries.hollow import compiled_result
from ...geometry.itineraries.patches import positions
from ..bases.basis import Basis
from ..bases.measure import SINE
from .below_channel import LOWEST, MOST_CROSSINGS, PLACES, TAILS, WEIGHTS, BelowChannel, Patch

# The signs of the way in are damped by the factor erfc(SHARPNESS (d / K - 1)) / 2, which is negligible beyond REACH K.
SHARPNESS, REACH = 7.0, 1.5
# The first K, the ratio of consecutive ones, and the last.
FIRST_DAMPED, DAMPING_RATIO, LAST_DAMPED = 5.0, math.sqrt(2.0), MOST_CROSSINGS / REACH
# The mass beyond d crossings is proportional to d^-2, and sums of signs oscillate: errors fall at least by this factor
# from one K to the next, also where a step is small by chance.
DAMPING_FALL = DAMPING_RATIO**3
# Places per coefficient at which the phase is looked at for integers, and numbers of crossings per strip for the same.
PLACES_PER_TERM, KINK_PLACES, MOST_KINKS = 2, 17, 1 << 16
# Nodes of Gauss's rules between kinks and numbers of their null rules: the first rule up to MANY crossings, the second
# one beyond, where kinks are close. The error of a rule as a multiple of its null rules.
MANY, RULES = 24.0, ((5, 2), (3, 1))
NULL_FACTOR = 2.0
# Fractions of the tolerance for the patches, for the rules between kinks, and for the damping.
PATCH_PART, RULE_PART, DAMPING_PART = 0.2, 0.2, 0.6
NARROWEST = 1e-7
# Chebyshev coefficients below this fraction of the largest one are left out.
NEGLIGIBLE = 1e-13
# Largest basis, whose functions a patch resolves.
MOST_FUNCTIONS = 8
# Rows computed at a time, so that they fit into memory.
ROWS_AT_ONCE = 4096


class GaussRule(NamedTuple):
    """Gauss's rule on (0, 1) and null rules of its size for polynomials of low degree, shape (rules, nodes)."""

    nodes: Floats
    weights: Floats
    null: Floats


@lru_cache
def gauss_rule(count: int, nulls: int) -> GaussRule:
    """The rule with so many nodes and null rules."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    null = weights[:, None] * np.polynomial.legendre.legvander(nodes, count - 1)[:, -nulls:]
    null *= 0.5 * np.linalg.norm(weights) / np.linalg.norm(null, axis=0)
    return GaussRule(0.5 * (1.0 + nodes), 0.5 * weights, null.T)


class Tables(NamedTuple):
    """Matrices of one nested rule: to Chebyshev coefficients, to those of antiderivatives, to values on a grid."""

    place: Floats
    series: Floats
    antiderivative: Floats
    grid: Floats
    on_grid: Floats


@lru_cache
def tables(level: int) -> Tables:
    """The matrices of a nested rule, whose positions become places from -1 to 1."""
    chebyshev = np.polynomial.chebyshev
    place, _ = positions(level)
    terms = len(place)
    series = np.asarray(np.linalg.inv(chebyshev.chebvander(2.0 * place - 1.0, terms - 1)), dtype=np.float64)
    integrals = 0.5 * np.array([chebyshev.chebint(row, lbnd=-1) for row in np.eye(terms)]).T
    count = PLACES_PER_TERM * (terms + 1)
    grid = -np.cos(np.pi * np.arange(count + 1) / count)
    on_grid = np.asarray(chebyshev.chebvander(grid, terms - 1), dtype=np.float64)
    return Tables(place, series, np.asarray(integrals @ series, dtype=np.float64), grid, on_grid)


def unstretched(fraction: Floats) -> Floats:
    """The places s at which s^2 (3 - 2 s) has these values.

    Examples
    --------
    >>> unstretched(np.array([-1.0, 0.0, 0.5, 1.0])).round(15).tolist()
    [0.0, 0.0, 0.5, 1.0]
    """
    return np.asarray(0.5 - np.sin(np.arcsin(np.clip(1.0 - 2.0 * fraction, -1.0, 1.0)) / 3.0))


def _needed(series: Floats) -> int:
    """The number of terms of Chebyshev series, on the last axis, until the others are negligible."""
    largest = np.abs(series).reshape(-1, series.shape[-1]).max(axis=0, initial=0.0)
    return 1 + int(np.flatnonzero(largest > NEGLIGIBLE * np.max(largest, initial=1e-300))[-1]) if largest.size else 1


def damping(crossings: Floats, damped: float) -> Floats:
    """The factor of the signs of the way in."""
    return np.asarray(0.5 * erfc(SHARPNESS * (crossings / damped - 1.0)))


class PatchIntegrals:
    """The expectations of the functions of a basis on the rays of one patch, as functions of the crossings d."""

    def __init__(self, patch: Patch, basis: Basis, height: float) -> None:
        self.patch, self.height = patch, height
        self.tables = tables(patch.level)
        place = self.tables.place
        slope = (patch.ends[:, 1:] - patch.ends[:, :1]) * 6.0 * place * (1.0 - place)
        here, mirrored = basis.evaluate(patch.outs), basis.evaluate(np.pi - patch.outs)
        odd = 0.5 * (here - mirrored)
        self.even = np.einsum("l,kl,klj->kj", self.tables.antiderivative.sum(axis=0), slope, 0.5 * (here + mirrored))
        self.odd = np.flatnonzero(np.abs(odd).max(axis=(0, 1)) > 0.0)
        anti = np.einsum("tl,kl,klj->kjt", self.tables.antiderivative, slope, odd[..., self.odd])
        self.tail = float(np.abs(anti[..., -2:]).max(initial=0.0))
        self._anti = anti[..., : _needed(anti)]
        outs, exits = patch.outs @ self.tables.series.T, patch.exits @ self.tables.series.T
        self._outs, self._exits = outs[:, : _needed(outs)], exits[:, : _needed(exits)]

    @property
    def measure(self) -> float:
        """Measure of the panel."""
        return float(SINE.mass(np.array(self.patch.low), np.array(self.patch.high)))

    def kinks(self, number: int, low: float, high: float) -> Floats:
        """Numbers of crossings from low to high, within one whole number, between which expectations are smooth."""
        from ...geometry.itineraries.compiled.crossings import Strip, set_kinks

        ends, outs, exits = (np.ascontiguousarray(array.T) for array in (self.patch.ends, self._outs, self._exits))
        panel = self.patch.low, self.patch.high, PLACES, WEIGHTS
        strip = Strip(float(number), *panel, ends, outs, exits, np.empty(len(PLACES)))
        found, grid = np.empty(MOST_KINKS), np.linspace(low, high, KINK_PLACES)
        count = compiled_result(lambda: set_kinks(strip, grid, self.height, found))
        inside = found[:count]
        return np.unique(np.concatenate(([low, high], inside[(inside > low) & (inside < high)])))

    def __call__(self, crossings: Floats, number: Floats) -> tuple[Floats, Floats]:
        """The expectations of the odd functions and the widths left out, for crossings from ``number`` to the next."""
        parts = [
            self._rows(crossings[k : k + ROWS_AT_ONCE], number[k : k + ROWS_AT_ONCE])
            for k in range(0, len(crossings), ROWS_AT_ONCE)
        ]
        found, lost = zip(*parts, strict=True)
        return np.concatenate(found), np.concatenate(lost)

    def _rows(self, crossings: Floats, number: Floats) -> tuple[Floats, Floats]:
        from ...geometry.itineraries.compiled.crossings import Rows, signed_integrals

        row = self.interpolation(np.arctan2(self.height, crossings))
        outs, exits, ends = row @ self._outs, row @ self._exits, row @ self.patch.ends
        anti = (row @ self._anti.reshape(len(PLACES), -1)).reshape(len(crossings), *self._anti.shape[1:])
        with np.errstate(divide="ignore"):
            phases = self._on_grid(exits) + self.height / np.tan(self._on_grid(outs))
        # the entry points behind the corner have crossed the channel once more
        corner = (number + 1.0 - crossings - ends[:, 0]) / (ends[:, 1] - ends[:, 0])
        rows = Rows(outs, exits, np.ascontiguousarray(anti), phases, 2.0 * unstretched(corner) - 1.0)
        found, lost = np.empty((len(crossings), len(self.odd))), np.zeros(len(crossings))
        state = np.empty(1 + len(self.odd))
        compiled_result(lambda: signed_integrals(rows, self.tables.grid, self.height, state, found, lost))
        return found * np.where(number % 2.0 == 0.0, 1.0, -1.0)[:, None], lost

    def _on_grid(self, series: Floats) -> Floats:
        """The values of series, one a row, on the grid."""
        return np.asarray(series @ self.tables.on_grid[:, : series.shape[1]].T)

    def interpolation(self, angle: Floats) -> Floats:
        """The matrix that interpolates values at the nodes of the panel to other angles."""
        place = unstretched((angle - self.patch.low) / (self.patch.high - self.patch.low))
        step = place[:, None] - PLACES
        with np.errstate(divide="ignore", invalid="ignore"):
            row = WEIGHTS / step
            row /= row.sum(axis=1, keepdims=True)
        at_node = step == 0.0
        return np.where(at_node.any(axis=1)[:, None], at_node, row)


class Weighted(NamedTuple):
    """Numbers of crossings, integrals of the odd functions there times the weights of a rule, and the functions."""

    crossings: Floats
    values: Floats
    functions: NDArray[np.int64]


class GrazingIntegrals:
    """The integrals of e_i(theta) E[e_j(Theta') | theta] over grazing angles, for one hollow with a channel.

    The factor of the mirror image on the way in is damped beyond some number K of crossings, by a factor between 1 and
    0 that is smooth in d; without the damping it alternates with d, and its integral vanishes up to resonances and to
    what the ends of the patches leave, a part 1/d.

    Attributes
    ----------
    highest : float
        The integrals are over (0, highest).
    """

    def __init__(self, wall: Wall, height_to_width: float, basis: Basis) -> None:
        self.basis, self.height = basis, height_to_width
        self.below = BelowChannel(wall, height_to_width, float(basis.size))
        self.highest = self.below.highest
        self.size = float(basis.magnitudes()[0].max())
        self._spent = 0, 0

    @classmethod
    def of(cls, wall: Wall, basis: Basis) -> GrazingIntegrals | None:
        """The integrals of a mirror-symmetric wall that is its own cell; None if its hollows have no channel."""
        channel = cls.channel(wall, basis)
        if channel is None:
            return None
        found = cls(channel.below, channel.height_to_width, basis)
        return found if found.highest > 0.0 else None

    @staticmethod
    def channel(wall: Wall, basis: Basis) -> Channel[Wall] | None:
        """The channel of a wall's hollows, if the functions are smooth."""
        from ...geometry.cells.hollow_shape import distinct_hollows

        smooth = basis.is_polynomial or len(basis.edges) == 2
        if not smooth or basis.size > MOST_FUNCTIONS or not wall.closes:
            return None
        shapes = distinct_hollows(wall)
        return channel_of(wall, shapes[0][1][0]) if len(shapes) == 1 else None

    @cached_property
    def flat(self) -> Floats:
        """The integrals for a flat top instead of the hollow."""
        angle, weight = SINE.quadrature(np.array([0.0, self.highest]), self.basis.nodes_per_interval)
        return np.asarray((self.basis.evaluate(angle) * weight[:, None]).T @ self.basis.evaluate(np.pi - angle))

    def spent(self) -> tuple[int, int]:
        """Rays and ray segments since the last call."""
        hollow = self.below.hollow
        now = hollow.rays, hollow.segments
        rays, segments = now[0] - self._spent[0], now[1] - self._spent[1]
        self._spent = now
        return rays, segments

    def matrix(self, tolerance: float) -> tuple[Floats, float]:
        """The integrals and their error: of the patches, of the rules between kinks, and of the damping.

        The damping has at least the error of the last step from one K to the next, and that of the step before, less
        the factor by which the errors fall.
        """
        # the sizes of the functions of the outgoing and of the incoming angle
        factor = self.size**2
        panels = self.below.panels(PATCH_PART * tolerance / (factor * float(SINE.cdf(np.array(self.highest)))))
        patches = [PatchIntegrals(patch, self.basis, self.height) for panel in panels for patch in panel.patches]
        error = factor * (float(SINE.cdf(np.array(LOWEST))) + sum(panel.error * panel.measure for panel in panels))
        even, doubt = self._even(patches)
        error += doubt + self.size * sum(own.tail * own.measure for own in patches)
        found: list[Weighted] = []
        squares, first, damped, steps = 0.0, 0.0, FIRST_DAMPED, [np.inf, np.inf]
        before = None
        while True:
            last = REACH * damped
            for patch in patches:
                for number, ends in enumerate(((first, min(last, MANY)), (max(first, MANY), last))):
                    parts, square, lost = self._strips(patch, gauss_rule(*RULES[number]), ends, RULE_PART * tolerance)
                    found += parts
                    squares, error = squares + square, error + lost
            first = last
            odd = self._damped(found, damped)
            steps = [steps[-1], np.inf if before is None else float(np.linalg.norm(odd - before))]
            of_damping = max(steps[1], steps[0] / DAMPING_FALL)
            if of_damping <= DAMPING_PART * tolerance or damped * DAMPING_RATIO > LAST_DAMPED:
                break
            before, damped = odd, damped * DAMPING_RATIO
        return even + odd, error + NULL_FACTOR * math.sqrt(squares) + of_damping

    def _even(self, patches: list[PatchIntegrals]) -> tuple[Floats, float]:
        """The integrals of the even functions, and their error: the last coefficients of series in the angle."""
        total, error = np.zeros((self.basis.size, self.basis.size)), 0.0
        for own in patches:
            ends = np.array([own.patch.low, own.patch.high])
            angle, weight = SINE.quadrature(ends, len(PLACES) + self.basis.nodes_per_interval)
            here = self.basis.evaluate(angle) * weight[:, None]
            total += here.T @ (own.interpolation(angle) @ own.even)
            last = float(np.max(np.linalg.norm(TAILS @ own.even, axis=1)))
            error += self.size * last * own.measure
        return total, error

    def _strips(
        self, patch: PatchIntegrals, rule: GaussRule, limits: tuple[float, float], tolerance: float
    ) -> tuple[list[Weighted], float, float]:
        """The values of one patch between two numbers of crossings, the squared error of the rule, and what is lost."""
        low, high = self.height / math.tan(patch.patch.high), self.height / math.tan(patch.patch.low)
        low, high = max(low, limits[0]), min(high, limits[1])
        if high <= low or not len(patch.odd):
            return [], 0.0, 0.0
        numbers = np.arange(math.floor(low), math.ceil(high))
        cuts = [patch.kinks(n, max(low, n), min(high, n + 1.0)) for n in numbers.tolist()]
        starts, ends = np.concatenate([cut[:-1] for cut in cuts]), np.concatenate([cut[1:] for cut in cuts])
        number = np.repeat(numbers.astype(np.float64), [len(cut) - 1 for cut in cuts])
        found, squares, lost = [], 0.0, 0.0
        while len(starts):
            width = ends - starts
            crossings = starts[:, None] + width[:, None] * rule.nodes
            values, missing = patch(crossings.ravel(), np.repeat(number, len(rule.nodes)))
            angle = np.arctan2(self.height, crossings)
            weight = SINE.density(angle) * np.sin(angle) ** 2 / self.height * width[:, None]
            values = values.reshape(*crossings.shape, -1) * weight[..., None]
            null = self.size * np.sqrt(
                np.mean(np.sum(np.einsum("ng,kgj->nkj", rule.null, values) ** 2, axis=2), axis=0)
            )
            # the squares of the goals have a sum of at most the squared tolerance
            ready = (null <= tolerance / NULL_FACTOR * np.sqrt(width) / (1.0 + starts)) | (width < NARROWEST)
            squares += float(np.sum(null[ready] ** 2))
            lost += self.size**2 * float(np.sum((missing.reshape(weight.shape) * weight * rule.weights)[ready]))
            own = (values * rule.weights[:, None])[ready].reshape(-1, len(patch.odd))
            found.append(Weighted(crossings[ready].ravel(), own, patch.odd))
            middle = 0.5 * (starts + ends)[~ready]
            starts, ends = np.append(starts[~ready], middle), np.append(middle, ends[~ready])
            number = np.tile(number[~ready], 2)
        return found, squares, lost

    def _damped(self, found: list[Weighted], damped: float) -> Floats:
        """The integrals of the odd functions, damped beyond a number of crossings."""
        total = np.zeros((self.basis.size, self.basis.size))
        for part in found:
            here = self.basis.evaluate(np.arctan2(self.height, part.crossings))
            total[:, part.functions] += here.T @ (part.values * damping(part.crossings, damped)[:, None])
        return total
