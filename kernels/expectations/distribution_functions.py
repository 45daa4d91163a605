"""Cumulative distribution functions of many distributions at once, with jumps, and their inverse functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats
from ..bases.intervals import cell_among

# Smallest step of a cumulative distribution.
SMALLEST_STEP = 1e-300


@dataclass(frozen=True)
class Distributions:
    """Cumulative distribution functions as polygons, one per row; jumps are vertical sides, densities slanted ones.

    Parameters
    ----------
    position, level : arrays, shape (rows, corners)
        Corners (x, F(x)), both non-decreasing along a row; F ends at 1.
    """

    position: Floats
    level: Floats

    @classmethod
    def of_atoms(cls, position: Floats, probability: Floats) -> Distributions:
        """Sums of point masses; both arrays of shape (rows, atoms), in any order."""
        order = np.argsort(position, axis=1, kind="stable")
        above = np.cumsum(np.take_along_axis(probability, order, axis=1), axis=1)
        above /= above[:, -1:]
        below = np.concatenate((np.zeros_like(above[:, :1]), above[:, :-1]), axis=1)
        level = np.stack((below, above), axis=-1).reshape(len(above), -1)
        return cls(np.repeat(np.take_along_axis(position, order, axis=1), 2, axis=1), level)

    @classmethod
    def of_parts(cls, edges: Floats, cumulative: Floats, position: Floats, probability: Floats) -> Distributions:
        """A continuous part, linear between edges, shape (rows, edges), plus point masses, shape (rows, atoms)."""
        if position.shape[1] == 0:
            corners = np.broadcast_to(edges, cumulative.shape)
            return cls(corners, cumulative / cumulative[:, -1:])
        rows, count = cumulative.shape
        cell = cell_among(edges, position)
        fraction = (position - edges[cell]) / (edges[cell + 1] - edges[cell])
        low = np.take_along_axis(cumulative, cell, axis=1)
        at_atom = low + fraction * (np.take_along_axis(cumulative, cell + 1, axis=1) - low)
        # every atom has two corners at the same position, before and after the jump
        corner = np.concatenate((np.broadcast_to(edges, (rows, count)), position, position), axis=1)
        base = np.concatenate((cumulative, at_atom, at_atom), axis=1)
        jump = np.concatenate((np.zeros((rows, count + position.shape[1])), probability), axis=1)
        order = np.argsort(corner, axis=1, kind="stable")
        level = np.take_along_axis(base, order, axis=1) + np.cumsum(np.take_along_axis(jump, order, axis=1), axis=1)
        level = np.maximum.accumulate(level, axis=1)
        return cls(np.take_along_axis(corner, order, axis=1), level / level[:, -1:])

    def quantile(self, fraction: Floats) -> Floats:
        """The inverse function at ``fraction``, shape (rows, any)."""
        rows, corners = self.level.shape
        # one search in all rows at once: row i is shifted to the values from 2 i to 2 i + 1
        shift = 2.0 * np.arange(rows)[:, None]
        index = np.searchsorted((self.level + shift).ravel(), (fraction + shift).ravel(), side="left").reshape(
            fraction.shape
        )
        right = np.clip(index - corners * np.arange(rows)[:, None], 1, corners - 1)
        low, high = (np.take_along_axis(self.level, right - back, axis=1) for back in (1, 0))
        left_end, right_end = (np.take_along_axis(self.position, right - back, axis=1) for back in (1, 0))
        part = np.clip((fraction - low) / np.maximum(high - low, SMALLEST_STEP), 0.0, 1.0)
        return np.asarray(left_end + part * (right_end - left_end))
