"""The choice of method, for `auto`, for the matrix of a wall's law that has no closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...core.errors import AccuracyError
from ..sampling.sobol import Net
from ..walls.wall_law import FEW_PIECES
from .traced import is_affordable

if TYPE_CHECKING:
    from ..matrices.matrix import KernelMatrix
    from ..walls.wall_law import WallLaw
    from .methods import MatrixMaker

# So many rays tell how many the tolerance needs: the error of a scrambled net falls like their number to a power of
# about 3/4 where the integrand jumps across a curve, and is itself known to a factor 2 or so.
FIRST_RAYS, NET_ORDER, NET_MARGIN = 2**14, 0.75, 2.0
# So many rays take long enough for a look at adaptive rows, with as many flights: a ray has two or three.
MANY_RAYS = 2**17
# Rows that take longer than all rays must promise this share of their error.
ROW_ADVANTAGE = 0.5


def wall_matrix(maker: MatrixMaker, law: WallLaw) -> KernelMatrix:
    """The matrix by the way that promises the tolerance soonest, or else the least error in a second or two.

    Isometries of few pieces; as many rays as the tolerance needs, or adaptive rows where these promise it sooner;
    isometries of many pieces; adaptive rows, as long as they promise more than all the rays; all the rays. The more
    exact matrix is returned.
    """
    # found in less time than a few rays
    if len(law.wall.pieces) <= FEW_PIECES and law.exact_law is not None:
        return maker.make(law.exact_law, "auto")
    ways = _Ways(maker, law, is_affordable(law.wall, maker.basis), Net(law, maker.basis, maker.rng))
    found = ways.within_the_tolerance()
    if found is not None:
        return found
    if law.exact_law is not None:
        return maker.make(law.exact_law, "auto")
    return ways.rows_or_all_rays() if ways.affordable else ways.rays(maker.samples)


@dataclass
class _Ways:
    """Rays and adaptive rows to one matrix.

    Attributes
    ----------
    affordable : bool
        Whether rows are worth a look.
    promised : float
        The error that all rays promise, by what a few of them have shown; infinite where these do not tell.
    """

    maker: MatrixMaker
    law: WallLaw
    affordable: bool
    net: Net
    promised: float = float("inf")

    def rays(self, number: int) -> KernelMatrix:
        """The matrix by at least so many rays; the net goes on where it was."""
        return self.maker.from_net(self.net, number)

    def within_the_tolerance(self) -> KernelMatrix | None:
        """The matrix by fewer rays than asked for, or by rows where these are sooner; None if all rays are needed."""
        maker, number = self.maker, FIRST_RAYS
        # not even an order of 1 in the number of rays would meet the tolerance: a look at a few is in vain
        if not self.affordable and maker.tolerance * maker.samples < 1.0:
            return None
        while number < maker.samples:
            try:
                found = self.rays(number)
            except AccuracyError:
                # a bin without rays, or rays that do not escape: these few are no measure
                return None
            error = float(found.error)
            if error <= maker.tolerance:
                return found
            self.promised = error * (number / maker.samples) ** NET_ORDER
            needed = NET_MARGIN * number * (error / maker.tolerance) ** (1.0 / NET_ORDER)
            if needed > maker.samples:
                return None
            number = max(2 * number, int(needed))
            rows = self._few_rows(number)
            if rows is not None:
                return rows
        return None

    def _few_rows(self, rays: int) -> KernelMatrix | None:
        """The matrix by adaptive rows, if they meet the tolerance in less time than so many rays would."""
        if not self.affordable or rays < MANY_RAYS:
            return None
        rows = self.maker.rows(self.law, self.maker.tolerance, rays)
        return rows if float(rows.error) <= self.maker.tolerance else None

    def rows_or_all_rays(self) -> KernelMatrix:
        """The more exact of the two; rays are not traced where rows promise more, nor rows where rays will do."""
        tolerance = self.maker.tolerance
        rays = self._all_rays() if self.promised <= tolerance else None
        if rays is not None:
            self.promised = float(rays.error)
            if self.promised <= tolerance:
                return rays
        rows = self.maker.rows(self.law, max(ROW_ADVANTAGE * self.promised, tolerance))
        if float(rows.error) <= tolerance or float(rows.error) <= self.promised < float("inf"):
            return rows
        rays = self._all_rays() if rays is None else rays
        return rows if rays is None else min(rows, rays, key=lambda matrix: float(matrix.error))

    def _all_rays(self) -> KernelMatrix | None:
        """The matrix by rays; None if too many do not escape, where rows count theirs in their error."""
        try:
            return self.rays(self.maker.samples)
        except AccuracyError:
            return None
