"""Hollows that are their own mirror images within rounding: the exactly symmetric hollow, and what the change does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...core.checks import Floats
from ...core.rounding import UNIT_ROUNDOFF


class Symmetrised(NamedTuple):
    """A hollow that is exactly its own mirror image, and its distance from the given one.

    Parameters
    ----------
    vertices : array of shape (n, 2)
        The chain from (0, 0) to (width, 0).
    shift : float
        The largest distance of a vertex from the given one.
    turn : float
        The largest change of the direction of a side, radians.
    size : float
        A bound on the distance of two points of the hollow.
    """

    vertices: Floats
    shift: float
    turn: float
    size: float

    def turned(self, bounces: float) -> float:
        """Return a bound on the change of outgoing angles after a number of bounces, radians.

        The angle of a product of reflections changes by twice the sum of the changes of their sides.
        """
        return 2.0 * self.turn * bounces

    def moved(self, bounces: Floats) -> Floats:
        """Return bounds on the distance by which the vertices that rays pass move, unfolded along so many bounces.

        Reflection j of n moves all that lies beyond by twice the shift, and turns it by twice the turn about the side,
        from which the unfolded vertex has a distance of at most n - j + 2 sizes.
        """
        return (2.0 * bounces + 1.0) * self.shift + bounces * (bounces + 3.0) * self.turn * self.size


def symmetrised(chain: Floats) -> Symmetrised:
    """Return the exactly symmetric hollow of a chain of different points, and its distance from the chain.

    Of two vertices that are each other's images the one farther to the right stays; by Sterbenz's lemma the other is
    exact up to twice the width.

    Examples
    --------
    >>> found = symmetrised(np.array([(0.0, 0.0), (0.5 + 2.0**-50, -0.5), (1.0, 0.0)]))
    >>> found.vertices.tolist(), found.shift == 2.0**-50
    ([[0.0, 0.0], [0.5, -0.5], [1.0, 0.0]], True)
    """
    relative = chain - chain[0]
    width, number = relative[-1, 0], len(relative)
    image = relative[::-1]
    # of two equal ones the later
    right = (relative[:, 0] > image[:, 0]) | ((relative[:, 0] == image[:, 0]) & (2 * np.arange(number) >= number))
    x = np.where(right, relative[:, 0], width - image[:, 0])
    if number % 2:
        x[number // 2] = 0.5 * width
    vertices = np.column_stack([x, np.where(right, relative[:, 1], image[:, 1])])
    change = vertices - relative
    size = float(np.hypot(*np.ptp(relative, axis=0)))
    rest = UNIT_ROUNDOFF * size if x.max() > 2.0 * width else 0.0
    shift = float(np.hypot(*change.T).max()) + rest
    lengths, changes = (np.hypot(*np.diff(points, axis=0).T) for points in (relative, change))
    turn = float(((changes + 2.0 * rest) / lengths).max())
    return Symmetrised(vertices, shift, turn, size)
