"""The outgoing angle on each piece of a row of circular arcs: linear in the angle delta of the chord."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...checks import Floats
from ..bases.measure import SINE

if TYPE_CHECKING:
    from ..walls.circular_arc import CircularArcLaw


class ArcLines(NamedTuple):
    """Pieces of rows, each of shape (pieces,).

    The number of the row; theta' = offset + slope delta for delta from lower to upper; the mass, not normalised; where
    all of it leaves at one angle, ``single``, that angle; whether it has more hits than are followed.
    """

    ray: NDArray[np.intp]
    slope: Floats
    offset: Floats
    lower: Floats
    upper: Floats
    mass: Floats
    angle: Floats
    single: NDArray[np.bool_]
    rest: NDArray[np.bool_]

    def of_rows(self, values: Floats, rows: int) -> Floats:
        """Sums of the values of pieces over each row."""
        return np.asarray(np.bincount(self.ray, weights=values, minlength=rows), dtype=np.float64)


def outgoing_lines(law: CircularArcLaw, theta: Floats, most_hits: int) -> ArcLines:
    """The pieces of the rows at ``theta``, followed up to so many hits."""
    pieces = law.pieces(theta, most_hits)
    base = np.where(pieces.mirrored, np.pi - theta[pieces.ray], theta[pieces.ray])
    slope = np.where(pieces.mirrored, 2.0, -2.0) * pieces.hits
    offset = np.where(pieces.mirrored, -base, np.pi + base)
    lower, upper = pieces.lower, np.maximum(pieces.upper, pieces.lower)
    alone = pieces.alone & ~pieces.rest
    mass = np.where(alone, 1.0, SINE.mass(lower, upper))
    # rays with more hits than are followed leave together; a row of no width has one outgoing angle
    end = np.where(pieces.mirrored, law.half_angle, np.pi - law.half_angle)
    angle = np.where(pieces.rest, end, offset + slope * lower)
    return ArcLines(pieces.ray, slope, offset, lower, upper, mass, angle, pieces.rest | alone, pieces.rest)
