"""Masses of cells of outgoing angles over panels of incoming angles, for walls whose rays are traced.

The entry points of rays with one itinerary at all nodes of a panel are a patch, on which the outgoing angle is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...geometry.curves.columns import LEFT, RIGHT
from ...geometry.itineraries.hollow import HollowConditionals, Pieces, compiled_result
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..expectations.angle_panels import NODES
from .conditionals import WallConditionals

# Fractions of the tolerance of the expectations for the gaps between the pieces, for pieces of which the outgoing angle
# of one end counts, and for the outgoing angles.
GAP_FRACTION, TINY_FRACTION, ANGLE_FRACTION = 0.03, 0.3, 0.4
# A patch is integrated if the error of its interpolant is below this multiple of the tolerance of the expectations.
PATCH_FACTOR = 1.0
# Error of the integral over a part of a patch, as a fraction of the tolerance.
PART_FRACTION = 1e-2
# Error of an interpolant as a multiple of the largest of its last coefficients, and their number.
TAIL_FACTOR, TAIL = 1.0, 2
MOST_ROUNDS = 8

_PLACES = 0.5 * (1.0 + NODES)


def _row_weights() -> Floats:
    """The barycentric weights of the nodes of a panel."""
    weights = np.array([1.0 / np.prod(4.0 * (x - np.delete(_PLACES, k))) for k, x in enumerate(_PLACES)])
    return np.asarray(weights / np.abs(weights).max())


_WEIGHTS = _row_weights()
# The last Legendre coefficients of the polynomial through values at the nodes.
_TAILS = np.linalg.inv(np.polynomial.legendre.legvander(NODES, len(NODES) - 1))[-TAIL:]


class CellIntegrals(NamedTuple):
    """Integrals over panels of the functions e_j(Theta'), each constant on a cell; the first axis runs over the panels.

    ``rest``, shape (panels, nodes, cells), are the expectations at the nodes on the pieces that belong to no patch;
    ``integrals`` and ``error``, shape (panels, cells) and (panels,), the integrals over the patches and the error of
    their quadrature; ``mean_error``, shape (panels, nodes), the other errors, as errors of the expectations.
    """

    rest: Floats
    integrals: Floats
    error: Floats
    mean_error: Floats


class CellMasses:
    """Integrals of the indicators of cells over panels, for one wall and one basis of indicators.

    On a patch, the pieces of one itinerary at all nodes of a panel, the outgoing angle is analytic in both variables.
    It is interpolated there, so the curves on which it crosses an edge are known without further rays.
    """

    def __init__(self, conditionals: WallConditionals, basis: Basis) -> None:
        self.conditionals, self.basis = conditionals, basis
        self.sizes = np.array(basis.magnitudes()[0])
        self.edges = np.array(basis.edges[1:-1])

    def __call__(self, low: Floats, high: Floats, angle: Floats, tolerance: Floats) -> CellIntegrals:
        """The integrals over the panels between low and high, with nodes ``angle`` and tolerances of the means."""
        found = CellIntegrals(
            np.zeros((*angle.shape, self.basis.size)),
            self._flat_tops(low, high),
            np.zeros(len(low)),
            np.zeros(angle.shape),
        )
        for hollow, fraction in self.conditionals.hollows:
            todo, asked = np.arange(len(low)), np.unique(angle)
            for number in range(MOST_ROUNDS):
                panels = _Panels(hollow, self.sizes, self.edges, low[todo], high[todo], angle[todo], tolerance[todo])
                self.conditionals.outdated |= panels.march(asked)
                own, missed = panels.integrals(fraction)
                complete = ~np.isin(angle[todo], list(missed)).any(axis=1) | (number == MOST_ROUNDS - 1)
                for total, part in zip(found, own, strict=True):
                    total[todo[complete]] += part[complete]
                todo, asked = todo[~complete], np.array(sorted(missed))
                if not len(todo):
                    break
        return found

    def _flat_tops(self, low: Floats, high: Floats) -> Floats:
        """The integrals over the rays that meet a flat top and leave at pi - theta."""
        edges = self.basis.edges
        below = np.maximum(low[:, None], np.pi - edges[None, 1:])
        above = np.minimum(high[:, None], np.pi - edges[None, :-1])
        mass = SINE.mass(below, np.maximum(below, above))
        return np.asarray(self.conditionals.flat_fraction * mass * self.sizes)


class _Sums(NamedTuple):
    """Sums over the strips: as in `CellIntegrals`, but not normalised, and with squares of independent errors.

    The errors of the expectations due to the gaps between pieces are added, those due to the outgoing angles squared.
    """

    rest: Floats
    integrals: Floats
    squares: Floats
    gaps: Floats
    mean_squares: Floats


@dataclass
class _Panels:
    """The panels of one computation in one hollow."""

    hollow: HollowConditionals
    sizes: Floats
    edges: Floats
    low: Floats
    high: Floats
    angle: Floats
    tolerance: Floats

    def march(self, asked: Floats) -> set[float]:
        """Find the pieces at the angles that are asked for; return earlier angles now known to miss a piece."""
        place = np.minimum(np.searchsorted(asked, self.angle), len(asked) - 1)
        tolerance = np.full(len(asked), np.inf)
        here = asked[place] == self.angle
        np.minimum.at(tolerance, place[here], np.broadcast_to(self.tolerance[:, None], here.shape)[here])
        return self.hollow.march(asked, GAP_FRACTION * tolerance)[1]

    def integrals(self, fraction: float) -> tuple[CellIntegrals, set[float]]:
        """The integrals over the hollow, a fraction of the period, and the angles at which a piece was missed."""
        patches, singles, tiny = self._strips()
        size = len(self.sizes)
        found = _Sums(
            np.zeros((*self.angle.shape, size)), np.zeros((len(self.low), size)), np.zeros(len(self.low)),
            np.zeros(self.angle.shape), np.zeros(self.angle.shape),
        )  # fmt: skip
        missed = self._add_patches(patches, found) | self._add_singles(singles, found)
        self._add_tiny(*tiny, found)
        scale = fraction / self.hollow.width
        return CellIntegrals(
            scale * self.sizes * found.rest,
            scale * self.sizes * found.integrals,
            scale * np.sqrt(found.squares),
            scale * (found.gaps + np.sqrt(found.mean_squares)),
        ), missed

    def _strips(self) -> tuple[Strips, Strips, tuple[Strips, Floats]]:
        """The patches; the other pieces with the numbers of their nodes; the tiny ones with their outgoing angles."""
        from ...geometry.itineraries.compiled.changes import FIRST_LABEL

        left, right = self.hollow.scene.hollows[self.hollow.hollow, [LEFT, RIGHT]].tolist()
        patches, singles, tiny, tiny_outs = [], [], [], []
        for number, (angles, tolerance) in enumerate(zip(self.angle, self.tolerance.tolist(), strict=True)):
            rows = [self.hollow.pieces(angle) for angle in angles.tolist()]
            node = np.repeat(np.arange(len(rows)), [len(row.label) for row in rows])
            label, out = np.concatenate([row.label for row in rows]), np.concatenate([row.out for row in rows])
            ends = np.concatenate([ends_of(row, left, right) for row in rows])
            others = Strips(angles[node][:, None], ends[:, None], label, number * len(rows) + node)
            limit = TINY_FRACTION * tolerance / self.sizes.max() * self.hollow.width
            is_tiny = _narrowest(others.width[:, 0], node, limit) | (label < FIRST_LABEL)
            common = common_pieces(rows)
            common = common[~is_tiny[common].all(axis=1)]
            alone = np.ones(len(label), dtype=np.bool_)
            alone[common] = False
            owner = np.full(len(common), number)
            patches.append(Strips(np.tile(angles, (len(common), 1)), ends[common], label[common[:, 0]], owner))
            singles.append(others.chosen(alone & ~is_tiny))
            tiny.append(others.chosen(alone & is_tiny))
            tiny_outs.append(out[alone & is_tiny])
        return together(patches), together(singles), (together(tiny), np.concatenate(tiny_outs))

    def _wanted(self, strips: Strips, of_all: Floats) -> Floats:
        """The wanted errors of the outgoing angles on strips; ``of_all`` is the width that shares the tolerance.

        A shift of the angle by d moves a mass of about d/pi times the width of a strip over every edge.
        """
        edges = len(self.sizes) / np.pi * of_all / self.hollow.width
        panel = strips.owner // (len(NODES) // strips.angle.shape[1])
        return np.asarray(ANGLE_FRACTION * self.tolerance[panel] / (np.median(self.sizes) * edges))

    def _add_patches(self, patches: Strips, found: _Sums) -> set[float]:
        """Add the patches, or their rows if they are not interpolated well; return the angles that miss a piece."""
        from ...geometry.itineraries.compiled.patches import Cells, Grid, masses_of_patches, room_for

        measure = SINE.mass(self.low, self.high)
        limits = PATCH_FACTOR * self.tolerance * self.hollow.width
        goals = PART_FRACTION * self.tolerance * self.hollow.width * np.sqrt(measure)
        width = patches.width.max(axis=1, initial=0.0)
        # their errors count as independent ones
        alike = np.bincount(patches.owner)[patches.owner]
        sampled, missed = sample(self.hollow, patches, self._wanted(patches, width * np.sqrt(alike)), self.edges)
        for level, strips, outs, error in sampled:
            place, _ = grid = positions(level)
            uncertainties = error, _tail(weight_at(place) * outs), _tail(strips.ends)
            room = room_for(len(self.sizes), len(NODES), outs.shape[2])
            own = strips.ends, outs, strips.owner
            panels, cells = (self.low, self.high, measure), Cells(self.edges, self.sizes)
            grids = Grid(_PLACES, _WEIGHTS), Grid(*grid)
            compiled_result(
                partial(masses_of_patches, panels, *grids, own, uncertainties, limits, goals, cells, tuple(found), room)
            )
        return missed

    def _add_singles(self, singles: Strips, found: _Sums) -> set[float]:
        """Add pieces at single angles; return the angles that miss a piece."""
        from ...geometry.itineraries.compiled.patches import Cells, Grid, masses_of_rows, room_for

        of_all = np.asarray(np.bincount(singles.owner, weights=singles.width[:, 0])[singles.owner], np.float64)
        sampled, missed = sample(self.hollow, singles, self._wanted(singles, of_all), self.edges)
        rest = found.rest.reshape(-1, len(self.sizes))
        for level, strips, outs, error in sampled:
            room = room_for(len(self.sizes), len(NODES), outs.shape[2])
            grid, cells = Grid(*positions(level)), Cells(self.edges, self.sizes)
            pieces = strips.ends, outs, strips.owner, error
            compiled_result(partial(masses_of_rows, grid, *pieces, cells, rest, found.gaps.reshape(-1), room))
        return missed

    def _add_tiny(self, tiny: Strips, outs: Floats, found: _Sums) -> None:
        """Add pieces by the outgoing angles of their first rays; their whole widths count as error."""
        width = tiny.width[:, 0]
        np.add.at(found.rest.reshape(-1, len(self.sizes)), (tiny.owner, np.searchsorted(self.edges, outs)), width)
        np.add.at(found.gaps.reshape(-1), tiny.owner, 2.0 * self.sizes.max() * width)


def _narrowest(width: Floats, node: NDArray[np.int64], limit: float) -> NDArray[np.bool_]:
    """The pieces that are the narrowest ones of their node, as many as have at most this width together."""
    order = np.lexsort((width, node))
    sums = np.cumsum(width[order])
    first = np.searchsorted(node[order], node[order])
    chosen = np.zeros(len(width), dtype=np.bool_)
    chosen[order] = sums - np.append(0.0, sums)[first] <= limit
    return chosen


def _tail(values: Floats) -> Floats:
    """The error of interpolation between the nodes of the panel, for values of shape (patches, nodes, any)."""
    last = np.abs(np.einsum("tk,pkj->ptj", _TAILS, values)).max(axis=(1, 2), initial=0.0)
    return np.asarray(TAIL_FACTOR * last)


# Mix a label, the number of its occurrences at one angle, and the number of one of them to a key.
_MIXING = tuple(np.uint64(k) for k in (6364136223846793005, 1442695040888963407, 2862933555777941757))
# Numbers of the nested rules whose positions are tried in turn; rule k has 2^(k + 2) - 1 positions.
FIRST_LEVEL, LAST_LEVEL = 0, 4
# Least ratio of consecutive differences in the error of an interpolant: smaller ones also occur by chance.
LEAST_RATIO = 0.03


class Strips(NamedTuple):
    """Pieces of one itinerary, each at one incoming angle or at all nodes of a panel.

    ``angle`` has the shape (strips, nodes); ``ends``, of shape (strips, nodes, 4), the middle of the gap before the
    piece, its first and its last sample, and the middle of the gap after it; ``label`` and ``owner``, of shape
    (strips,), the label, and the number of the panel or of the angle.
    """

    angle: Floats
    ends: Floats
    label: NDArray[np.uint64]
    owner: NDArray[np.int64]

    @property
    def width(self) -> Floats:
        """The widths of the pieces with half of the gaps around them, shape (strips, nodes)."""
        return np.asarray(self.ends[..., 3] - self.ends[..., 0])

    def chosen(self, mask: NDArray[np.bool_] | NDArray[np.int64]) -> Strips:
        """The strips of a mask or of these numbers."""
        return Strips(self.angle[mask], self.ends[mask], self.label[mask], self.owner[mask])


def together(parts: list[Strips]) -> Strips:
    """All strips of several lists."""
    angles, ends, labels, owners = zip(*parts, strict=True)
    return Strips(np.concatenate(angles), np.concatenate(ends), np.concatenate(labels), np.concatenate(owners))


class Sampled(NamedTuple):
    """Strips with their outgoing angles, shape (strips, nodes, positions), and the errors of the interpolants.

    The error is a bound of that of the angle times `weight_at`.
    """

    level: int
    strips: Strips
    outs: Floats
    error: Floats


def positions(level: int) -> tuple[Floats, Floats]:
    """The positions in (0, 1) of a nested rule, increasing, before its substitution; and their barycentric weights."""
    intervals = 2 ** (level + 2)
    angle = np.pi * np.arange(1, intervals) / intervals
    signs = np.where(np.arange(intervals - 1) % 2 == 0, 1.0, -1.0)
    return np.sin(0.5 * angle) ** 2, signs * np.sin(angle) ** 2


def weight_at(place: Floats) -> Floats:
    """The density of entry points at positions before the substitution, 1 in the middle: the weight of errors there."""
    return 4.0 * place * (1.0 - place)


def interpolation(nodes: Floats, weights: Floats, at: Floats) -> Floats:
    """The matrix that interpolates values at the nodes, by the barycentric formula, to other positions."""
    ratio = weights / (at[:, None] - nodes)
    return np.asarray(ratio / ratio.sum(axis=1, keepdims=True))


def common_pieces(rows: list[Pieces]) -> NDArray[np.int64]:
    """The pieces that exist at all angles, shape (pieces, angles), by their numbers among the pieces of all angles.

    An itinerary that occurs several times at an angle must occur equally often at all.
    """
    keys = []
    for pieces in rows:
        order = np.argsort(pieces.label, kind="stable")
        ordered = pieces.label[order]
        first, end = np.searchsorted(ordered, ordered), np.searchsorted(ordered, ordered, side="right")
        occurrence, count = np.empty((2, len(order)), np.uint64)
        occurrence[order], count[order] = np.arange(len(order)) - first, end - first
        keys.append(pieces.label * _MIXING[0] + occurrence * _MIXING[1] + count * _MIXING[2])
    _, group, size = np.unique(np.concatenate(keys), return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    return np.asarray(order[(size == len(rows))[group[order]]].reshape(-1, len(rows)))


def ends_of(pieces: Pieces, left: float, right: float) -> Floats:
    """The ends of all pieces at one angle as in `Strips`, shape (pieces, 4)."""
    middles = np.concatenate(([left], 0.5 * (pieces.high[:-1] + pieces.low[1:]), [right]))
    return np.stack((middles[:-1], pieces.low, pieces.high, middles[1:]), axis=1)


def sample(
    hollow: HollowConditionals, strips: Strips, tolerance: Floats, edges: Floats
) -> tuple[list[Sampled], set[float]]:
    """The outgoing angles on strips, at the positions of the first rule whose interpolant reaches the tolerance.

    The tolerances, one for each strip, are errors of the outgoing angle times `weight_at`. If all angles, and others as
    far from them as they differ, lie between two edges, the first rule is enough. Also returns the angles at which a
    ray has another label than its strip; the missed piece is noted there.
    """
    found, missed = [], set[float]()
    known = np.empty((*strips.angle.shape, 0))
    before = np.empty(0)
    for level in range(FIRST_LEVEL, LAST_LEVEL + 1):
        place, _ = positions(level)
        fresh = place if level == FIRST_LEVEL else place[::2]
        outs, wrong = _traced(hollow, strips, fresh)
        missed |= wrong
        if level == FIRST_LEVEL:
            both, least, most = outs, outs.min(axis=(1, 2), initial=np.pi), outs.max(axis=(1, 2), initial=0.0)
            error = difference = most - least
            ready = np.searchsorted(edges, least - error) == np.searchsorted(edges, most + error)
            ready |= error <= tolerance
        else:
            expected = known @ interpolation(*positions(level - 1), fresh).T
            difference = (weight_at(fresh) * np.abs(expected - outs)).max(axis=(1, 2), initial=0.0)
            both = np.empty((*strips.angle.shape, len(place)))
            both[..., ::2], both[..., 1::2] = outs, known
            ratio = difference / np.maximum(before, np.finfo(np.float64).tiny)
            error = difference * np.clip(ratio, LEAST_RATIO, 1.0)
            ready = (error <= tolerance) | (level == LAST_LEVEL)
        if ready.any():
            found.append(Sampled(level, strips.chosen(ready), both[ready], error[ready]))
        strips, known, before, tolerance = strips.chosen(~ready), both[~ready], difference[~ready], tolerance[~ready]
        if not len(strips.label):
            break
    return found, missed


def _traced(hollow: HollowConditionals, strips: Strips, place: Floats) -> tuple[Floats, set[float]]:
    """The outgoing angles at positions within the strips, and the angles at which a piece was missed."""
    low, high = strips.ends[..., 1, None], strips.ends[..., 2, None]
    entries = low + (high - low) * (place * place * (3.0 - 2.0 * place))
    angles = np.broadcast_to(strips.angle[..., None], entries.shape)
    labels = np.broadcast_to(strips.label[:, None, None], entries.shape)
    outs, missed = hollow.trace(entries.ravel(), angles.ravel(), labels.ravel())
    return outs.reshape(entries.shape), missed
