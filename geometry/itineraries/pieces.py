"""The intervals of entry points with equal itinerary at known incoming angles, and their ends predicted in between."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats

# Mixes the labels on both sides of a change to its key; any odd number without pattern.
KEY_FACTOR = np.uint64(6364136223846793005)
# Distance of the samples on both sides of a predicted change from it: a fraction of the last term of the interpolation
# by a cubic, a parabola and a line. The remainder is smaller by a factor of the angles' distance; if the samples do not
# enclose the change, the search between its neighbours finds it.
CUBIC_UNCERTAINTY, PARABOLA_UNCERTAINTY, LINE_UNCERTAINTY = 0.1, 0.3, 0.05


class Pieces(NamedTuple):
    """The pieces of one incoming angle in increasing order: their first and last positions, and their labels.

    ``out`` are the outgoing angles of the rays at the first positions.

    ``matters`` is the width from which on a missed piece matters. The changes between the pieces are in the order of
    their keys: keys, positions, and the numbers of the pieces before them. Keys that occur twice are left out.
    """

    angle: float
    low: Floats
    high: Floats
    label: NDArray[np.uint64]
    out: Floats
    matters: float
    keys: NDArray[np.uint64]
    changes: Floats
    number: NDArray[np.int64]

    @staticmethod
    def at(angle: float, low: Floats, high: Floats, label: NDArray[np.uint64], out: Floats, matters: float) -> Pieces:
        """The pieces at an angle, with the changes between them."""
        key = label[:-1] * KEY_FACTOR + label[1:]
        number = np.argsort(key)
        differs = np.ones(len(key) + 1, dtype=np.bool_)
        if len(key):
            ordered = key[number]
            differs[1:-1] = ordered[1:] != ordered[:-1]
        number = number[differs[:-1] & differs[1:]]
        position = 0.5 * (high[number] + low[number + 1])
        return Pieces(angle, low, high, label, out, matters, key[number], position, number)

    def middles(self, least: float, known: NDArray[np.int64] | None = None) -> Floats:
        """The middles of the pieces wider than ``least``, unless the changes at both ends are among the known ones."""
        ends = np.zeros(len(self.low) + 1, dtype=np.bool_)
        if known is not None:
            ends[[0, -1]] = ends[known + 1] = True
        wanted = (self.high - self.low > least) & ~(ends[:-1] & ends[1:])
        return np.asarray(0.5 * (self.low + self.high)[wanted])

    def unlike(self, other: Pieces) -> tuple[Floats, Floats, NDArray[np.uint64]]:
        """Where a piece of another angle lies inside one with another label here, if it is wide enough to matter here.

        Angles, which are this one, positions, and the labels here. Positions in gaps are left out, because the error of
        the angle includes the gaps.
        """
        x = 0.5 * (other.low + other.high)
        k = np.minimum(np.searchsorted(self.high, x, side="right"), len(self.high) - 1)
        matters = (other.high - other.low > self.matters) & (self.label[k] != other.label)
        found = np.flatnonzero(matters & (self.low[k] < x) & (x < self.high[k]))
        return np.full(len(found), self.angle), x[found], self.label[k[found]]

    def shared(self, other: Pieces) -> float:
        """The total width of the pieces whose itinerary also exists at the other angle."""
        _, same = _places(np.sort(other.label), self.label)
        return float(np.sum((self.high - self.low)[same]))

    def places(self, keys: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The places of the changes with the keys, and whether there is such a change."""
        return _places(self.keys, keys)


def _places(ordered: NDArray[np.uint64], wanted: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The places of wanted numbers among increasing ones, and whether they are there; faster than `numpy.isin`."""
    if not len(ordered):
        return np.zeros(len(wanted), np.int64), np.zeros(len(wanted), np.bool_)
    place = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
    return place, ordered[place] == wanted


def samples_between(angle: float, nearest: tuple[Pieces, Pieces], farther: list[Pieces], least: float) -> Floats:
    """Positions that enclose the changes at an angle between two known ones, in any order.

    A change present at both angles is interpolated, with the help of up to two farther angles. It gets one position on
    either side, at a distance of at least ``least`` divided by the number of changes. Pieces wider than ``least`` of
    which a change is not present at both angles get a position in their middle.
    """
    before, after = nearest
    place, same = after.places(before.keys)
    left, right, keys = before.number[same], after.number[place[same]], before.keys[same]
    unmatched = before.middles(least, left), after.middles(least, right)
    first, second = before.changes[same], after.changes[place[same]]
    slope = (second - first) / (after.angle - before.angle)
    line, product = first + (angle - before.angle) * slope, (angle - before.angle) * (angle - after.angle)
    found, uncertainty = line, LINE_UNCERTAINTY * np.abs(second - first)
    bends = []
    for far in farther:
        place, same = far.places(keys)
        there = far.changes[place] if len(far.changes) else np.full(len(keys), np.nan)
        there[~same] = np.nan
        bend = ((there - first) / (far.angle - before.angle) - slope) / (far.angle - after.angle)
        bends.append(bend)
        found = np.where(same, line + product * bend, found)
        uncertainty = np.where(same, PARABOLA_UNCERTAINTY * np.abs(product * bend), uncertainty)
    if len(bends) == 2:
        rate = (bends[1] - bends[0]) / (farther[1].angle - farther[0].angle)
        both = np.isfinite(rate)
        found = np.where(both, line + product * (bends[0] + (angle - farther[0].angle) * rate), found)
        uncertainty = np.where(both, CUBIC_UNCERTAINTY * np.abs(product * (bends[1] - bends[0])), uncertainty)
    uncertainty = np.maximum(uncertainty, least / max(1, len(keys)))
    return np.concatenate((found - uncertainty, found + uncertainty, *unmatched))
