"""Patches of the phase space: pieces of entry points with one itinerary at all nodes of a panel of incoming angles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from .hollow import HollowConditionals, Pieces

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
