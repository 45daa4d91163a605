"""The law of rectangular teeth, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, positive_number
from ..bases.angles import mirrored_angle
from ..laws.crevice import crevice_breakpoints, crevice_retro, crossings_modulo_two
from ..laws.isometry_table import IsometryTable
from ..laws.law import BranchLaw, entries

LARGEST_COUNT = 2.0**62


@dataclass(frozen=True)
class RectangularTeethLaw(BranchLaw):
    r"""The law of rectangular teeth in closed form: flat top on the first half of the period, crevice on the second.

    A ray crosses d = 2 r abs(cot theta) crevice widths on its way down and up. Specular reflection has probability
    1 - {d}/2 if floor(d) is even and 1/2 + {d}/2 if it is odd, which is
    1 - (distance from d to the nearest even number)/2. All other rays are retroreflected.

    Parameters
    ----------
    height_to_width : float
        r > 0, depth of the crevice over its width.

    Raises
    ------
    InputError
        If ``height_to_width`` is not a finite number above 0.

    Notes
    -----
    The probabilities are those of the given float64 angle, to rounding, for any number of crossings. Where d is large
    they change completely from one float64 to the next: for an angle that is not exact to its last digit, use the mean
    over a period of d, where specular reflection has probability 3/4.

    Source: Rudzis 2022, section 2.2.1, corrected (the even and odd cases are swapped in print).

    Examples
    --------
    >>> law = RectangularTeethLaw(0.5)
    >>> probability, outgoing = law.branches(np.pi / 4)      # d = 1: half of the wall, all of the crevice
    >>> probability.round(15)
    array([0.5, 0.5])
    >>> law
    RectangularTeethLaw(height_to_width=0.5)
    """

    height_to_width: float

    mirror_symmetric = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "height_to_width", positive_number("height_to_width", self.height_to_width))

    def crossings(self, theta: ArrayLike) -> Floats:
        """The number of crevice widths crossed between entry and exit, d = 2 r abs(cot theta)."""
        with np.errstate(over="ignore"):
            return np.asarray(2.0 * self.height_to_width / np.abs(np.tan(angles("theta", theta))))

    def _branches(self, theta: Floats) -> tuple[Floats, Floats]:
        """Probabilities and angles, shape ``theta.shape + (2,)``: specular first, then retroreflection."""
        retro = 0.5 * crevice_retro(self.height_to_width, theta)
        return np.stack([1.0 - retro, retro], axis=-1), np.stack([mirrored_angle(theta), theta], axis=-1)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles cot theta = +-k / (2 r), where d is a whole number, and the probability beyond the last one."""
        return crevice_breakpoints(self.height_to_width, limit)

    def isometry_table(self) -> IsometryTable:
        """The table of flat tops and crevices, each half of the period."""
        return IsometryTable.joined([IsometryTable.flat(0.5), IsometryTable.of_crevice(0.5, self.height_to_width)])

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle of the ray that enters at ``x`` in (0, 1), measured from the left end of the flat top."""
        x, theta = entries(x, theta)
        sides = _sides_hit(x, theta, crossings_modulo_two(self.height_to_width, theta))
        return np.where(np.mod(sides, 2.0) == 0.0, mirrored_angle(theta), theta)

    def hits(self, x: ArrayLike, theta: ArrayLike) -> NDArray[np.int64]:
        """Number of reflections, at most about 2^62; a hit of the flat top counts as one.

        The parity is always right. Beyond 2^52 the number has the rounding error of float64.
        """
        x, theta = entries(x, theta)
        rest = crossings_modulo_two(self.height_to_width, theta)
        # counted in pairs, so that the parity is right where d has more digits than a float64
        pairs = np.rint(0.5 * (np.minimum(self.crossings(theta), LARGEST_COUNT) - rest)).astype(np.int64)
        sides = 2 * pairs + _sides_hit(x, theta, rest).astype(np.int64)
        return np.asarray(1 + np.where(x <= 0.5, 0, sides))


def _sides_hit(x: Floats, theta: Floats, crossings: Floats) -> Floats:
    # Distance, in crevice widths, from the entry point to the side that the ray moves towards.
    ahead = np.where(theta < 0.5 * np.pi, 2.0 * x - 1.0, 2.0 - 2.0 * x)
    return np.where(x <= 0.5, 0.0, np.maximum(np.ceil(crossings - ahead), 0.0))


def crevice_pieces(height_to_width: float, last: int) -> IsometryTable:
    """The table of a crevice restricted to d < ``last``; its opening counts as the whole period."""
    number = np.arange(last)
    high = np.arctan2(2.0 * height_to_width, number)
    low = np.arctan2(2.0 * height_to_width, number + 1)
    # at a whole number d = k the outcome is certain: retroreflection for odd k, specular reflection for even k
    start, end = (np.where(at % 2 == 1, np.sin(angle), 0.0) for at, angle in ((number + 1, low), (number, high)))
    one, zero = np.ones(last), np.zeros(last)
    other = np.sin(low) - start, np.sin(high) - end
    right = IsometryTable(
        np.concatenate([one, -one]),
        np.concatenate([zero, np.pi * one]),
        np.concatenate([low, low]),
        np.concatenate([high, high]),
        np.concatenate([start, other[0]]),
        np.concatenate([end, other[1]]),
    )
    return IsometryTable.joined([right, right.mirrored()])
