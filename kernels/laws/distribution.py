"""Conditional distributions of the outgoing angle at given incoming angles, with and without atoms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.checks import Floats
from ..bases.angles import clipped_inside


class Distribution(NamedTuple):
    """P~(theta_k, .) for some theta_k, on given edges from 0 to pi, common ones or those of each theta_k.

    Attributes
    ----------
    below : array, shape (angles, edges)
        Mass of the atomless part below each edge.
    position, mass : arrays, shape (angles, atoms)
        Outgoing angles and masses of the atoms.
    """

    below: Floats
    position: Floats
    mass: Floats

    @classmethod
    def of_atoms(cls, edges: Floats, position: Floats, mass: Floats) -> Distribution:
        """The distributions that consist of atoms only."""
        return cls(np.zeros((len(position), edges.shape[-1])), position, mass)

    @classmethod
    def without_atoms(cls, below: Floats) -> Distribution:
        """The distributions without atoms."""
        return cls(below, np.empty((len(below), 0)), np.empty((len(below), 0)))

    @classmethod
    def of_cells(cls, masses: Floats) -> Distribution:
        """The distributions without atoms from the masses between neighbouring edges, shape (angles, cells)."""
        return cls.without_atoms(np.concatenate((np.zeros((len(masses), 1)), np.cumsum(masses, axis=1)), axis=1))

    @classmethod
    def mixed(cls, terms: Sequence[tuple[float, Distribution]]) -> Distribution:
        """The weighted sum of distributions."""
        below = sum((weight * part.below for weight, part in terms), start=np.zeros_like(terms[0][1].below))
        position = np.concatenate([part.position for _, part in terms], axis=1)
        return cls(below, position, np.concatenate([weight * part.mass for weight, part in terms], axis=1))

    def mirrored(self) -> Distribution:
        """The distributions of pi minus the outgoing angle, on the edges pi - edge in reverse order."""
        return Distribution(
            (self.below[:, -1:] - self.below)[:, ::-1], clipped_inside(np.pi - self.position), self.mass
        )

    def cumulative(self, edges: Floats) -> Floats:
        """The total mass below each of the edges, atoms included."""
        atoms = np.sum(self.mass[:, :, None] * (self.position[:, :, None] < edges), axis=1)
        return np.asarray(self.below + atoms)
