"""The law of triangular teeth, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, number_between, whole_number
from ...core.rounding import EPS
from ..bases.angles import clipped_inside, mirrored_angle, mixed_arccos
from ..bases.intervals import without_extremal
from ..laws.branches import merged
from ..laws.isometry_table import IsometryTable
from ..laws.law import BranchLaw, entries

# Breakpoints closer than this are one breakpoint computed by two formulas.
BREAKPOINT_SPACING = 16.0 * EPS
# Limit on the breakpoints of a table, which has four pieces between two breakpoints.
MOST_LISTED_BREAKPOINTS = 2**17


@dataclass(frozen=True)
class TriangularTeethLaw(BranchLaw):
    r"""The law of triangular teeth of apex angle psi, one hollow per period, in closed form.

    Unfolded, the sides of a hollow are half-lines from its bottom at multiples of psi. A ray that passes the bottom on
    its left crosses n = N - 1 or n = N of them, N = ceil(2 theta / psi). With X uniform in (0, 1) from the left tip,

        h = arccos((1 - X) cos(theta - psi/2) + X cos(theta + psi/2)),
        n = floor((theta + h) / psi + 1/2),
        theta' = pi + theta - n psi (n even),  n psi - theta (n odd),

    if cos(h) > 0, otherwise the mirror image. As a distribution: cos(h) > 0 for X < cos(theta - psi/2) / D with
    D = 2 sin(theta) sin(psi/2), and n = N - 1 for X < 2 sin((N - 1) psi/2) sin(N psi/2 - theta) / D.

    Parameters
    ----------
    angle : float
        Apex angle psi in (0, pi), radians.

    Raises
    ------
    InputError
        If ``angle`` is not in (0, pi).

    Notes
    -----
    Source: Rudzis 2022, section 2.2.2, corrected and completed: the printed law holds for theta <= (pi - psi)/2
    only, with floor for ceil and without a stray -theta.

    Examples
    --------
    Right-angled teeth are corner reflectors: every ray that hits both sides is retroreflected.

    >>> law = TriangularTeethLaw(np.pi / 2)
    >>> float(law.reflect(0.5, 1.5)), int(law.hits(0.5, 1.5))
    (1.5, 2)
    """

    angle: float

    mirror_symmetric = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "angle", number_between("angle", self.angle, 0.0, np.pi))

    def _branches(self, theta: Floats) -> tuple[Floats, Floats]:
        """Probabilities and angles, shape ``theta.shape + (4,)``.

        The order is: left of the bottom with N - 1 hits and with N hits, right of the bottom with N hits and with
        N - 1 hits. N belongs to theta on the left and to pi - theta on the right.
        """
        mirror = np.pi - theta
        # cos(theta - psi/2) written as a sine is accurate for psi close to pi
        left = np.sin(theta + 0.5 * (np.pi - self.angle)) / (2.0 * np.sin(theta) * np.sin(0.5 * self.angle))
        left = np.clip(left, 0.0, 1.0)
        most, most_mirror = self._most_hits(theta), self._most_hits(mirror)
        fewer = np.clip(self._fraction_of_fewer(theta, most), 0.0, left)
        fewer_mirror = np.clip(self._fraction_of_fewer(mirror, most_mirror), 0.0, 1.0 - left)
        probability = np.stack([fewer, left - fewer, 1.0 - left - fewer_mirror, fewer_mirror], axis=-1)
        outgoing = np.stack(
            [
                self._reflected(theta, most - 1.0),
                self._reflected(theta, most),
                np.pi - self._reflected(mirror, most_mirror),
                np.pi - self._reflected(mirror, most_mirror - 1.0),
            ],
            axis=-1,
        )
        return merged(probability, outgoing)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles where N or an active bound on X changes; if there are too many, the ones nearest to pi/2."""
        psi, limit = self.angle, whole_number("limit", limit, 0)
        # No ray with theta >= (pi + psi)/2 passes on the left, so larger multiples of psi/2 are no breakpoints.
        last = int(np.ceil((np.pi + psi) / psi))
        first = max(1, last - limit)
        around = np.floor(np.pi / psi) + np.array([-1.0, 0.0, 1.0])
        left = np.concatenate(
            [
                0.5 * psi * np.arange(first, last + 1),
                [0.5 * (np.pi - psi), 0.5 * (np.pi + psi)],
                (around + 0.5) * psi - 0.5 * np.pi,
            ]
        )
        breakpoints = np.sort(np.concatenate([left, np.pi - left]))
        breakpoints = breakpoints[(breakpoints > BREAKPOINT_SPACING) & (breakpoints < np.pi - BREAKPOINT_SPACING)]
        breakpoints = breakpoints[np.diff(breakpoints, prepend=-1.0) > BREAKPOINT_SPACING]
        if first == 1 and breakpoints.size <= limit:
            return breakpoints, 0.0
        return without_extremal(breakpoints, max(breakpoints.size - limit, 0))

    def isometry_table(self) -> IsometryTable | None:
        """The pieces between the breakpoints, or None if there are too many."""
        if 4.0 * np.pi / self.angle > MOST_LISTED_BREAKPOINTS:
            return None
        breakpoints, _ = self.breakpoints(2 * MOST_LISTED_BREAKPOINTS)
        edges = np.unique(np.concatenate([[0.0], breakpoints, [0.5 * np.pi, np.pi]]))
        low, high = edges[:-1], edges[1:]
        middle = 0.5 * (low + high)
        most, most_mirror = self._most_hits(middle), self._most_hits(np.pi - middle)
        # the four probabilities of `branches` times sin(theta), which are finite at the ends
        ends = []
        for theta in (low, high):
            sine, mirror = np.sin(theta), np.pi - theta
            left = np.sin(theta + 0.5 * (np.pi - self.angle)) / (2.0 * np.sin(0.5 * self.angle))
            left = np.clip(left, 0.0, sine)
            fewer = np.clip(self._density_of_fewer(theta, most), 0.0, left)
            fewer_mirror = np.clip(self._density_of_fewer(mirror, most_mirror), 0.0, sine - left)
            ends.append(np.concatenate([fewer, left - fewer, sine - left - fewer_mirror, fewer_mirror]))
        count = np.concatenate([most - 1.0, most, most_mirror, most_mirror - 1.0])
        left_side = np.repeat([True, True, False, False], low.size)
        even, turn = np.mod(count, 2.0) == 0.0, count * self.angle
        offset = np.where(even, np.pi - turn, turn)
        offset = np.where(left_side, offset, np.where(even, -offset, 2.0 * np.pi - offset))
        return IsometryTable(np.where(even, 1.0, -1.0), offset, np.tile(low, 4), np.tile(high, 4), *ends)

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        right, base, count = self._unfolded(*entries(x, theta))
        outgoing = clipped_inside(self._reflected(base, count))
        return np.where(right, mirrored_angle(outgoing), outgoing)

    def hits(self, x: ArrayLike, theta: ArrayLike) -> NDArray[np.int64]:
        """Number of reflections of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        return np.asarray(self._unfolded(*entries(x, theta))[2].astype(np.int64))

    def _unfolded(self, x: Floats, theta: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Whether the ray passes right of the bottom, its angle (mirrored in this case), and its number of hits."""
        angle, complement = mixed_arccos(1.0 - x, theta, 0.5 * self.angle)
        right = angle > complement
        base = np.where(right, np.pi - theta, theta)
        most = self._most_hits(base)
        count = np.floor((base + np.minimum(angle, complement)) / self.angle + 0.5)
        # The bounds are exact; without them rounding could turn the single hit of a grazing ray into none.
        return right, base, np.clip(count, np.maximum(most - 1.0, 1.0), most)

    def _most_hits(self, theta: Floats) -> Floats:
        return np.maximum(np.ceil(2.0 * theta / self.angle), 1.0)

    def _fraction_of_fewer(self, theta: Floats, most: Floats) -> Floats:
        """The X below which a ray left of the bottom has N - 1 hits, as a product, which avoids cancellation."""
        return np.asarray(self._density_of_fewer(theta, most) / np.sin(theta))

    def _density_of_fewer(self, theta: Floats, most: Floats) -> Floats:
        half = 0.5 * self.angle
        return np.asarray(np.sin((most - 1.0) * half) * np.sin(most * half - theta) / np.sin(half))

    def _reflected(self, theta: Floats, count: Floats) -> Floats:
        turn = count * self.angle
        return np.where(np.mod(count, 2.0) == 0.0, np.pi + theta - turn, turn - theta)
