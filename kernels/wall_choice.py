"""Which way `auto` takes to the matrix of a wall's law that has no closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ..errors import AccuracyError
from .net import Net
from .row_quadrature import is_affordable
from .wall_law import FEW_PIECES

if TYPE_CHECKING:
    from .matrix import KernelMatrix
    from .matrix_maker import MatrixMaker
    from .wall_law import WallLaw

# So many rays tell how many the tolerance needs: the error of a scrambled net falls like their number to a power of
# about 3/4 where the integrand jumps across a curve, and is itself known to a factor 2 or so.
FIRST_RAYS, NET_ORDER, NET_MARGIN = 2**14, 0.75, 2.0
# So many rays take long enough for a look at adaptive rows, with flights that take half of the rays' time: of these a
# ray has two or three.
MANY_RAYS, ROW_FLIGHTS_A_RAY = 2**17, 1.0
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
    affordable = is_affordable(law.wall, maker.basis)
    net = Net(law, maker.basis, maker.rng)
    sooner = (lambda rays: _few_rows(maker, law, rays)) if affordable else lambda rays: None
    found, promised = _few_rays(maker, net, sooner) if affordable or _is_within_reach(maker) else (None, float("inf"))
    if found is not None:
        return found
    if law.exact_law is not None:
        return maker.make(law.exact_law, "auto")
    if not affordable:
        return maker.from_net(net, maker.samples)
    rays = _all_rays(maker, net) if promised <= maker.tolerance else None
    if rays is not None:
        promised = float(rays.error)
        if promised <= maker.tolerance:
            return rays
    rows = maker.rows(law, useless=max(ROW_ADVANTAGE * promised, maker.tolerance))
    if float(rows.error) <= maker.tolerance or float(rows.error) <= promised < float("inf"):
        return rows
    rays = _all_rays(maker, net) if rays is None else rays
    return rows if rays is None else min(rows, rays, key=lambda matrix: float(matrix.error))


def _all_rays(maker: MatrixMaker, net: Net) -> KernelMatrix | None:
    """The matrix by rays; None if too many do not escape, where rows count theirs in their error."""
    try:
        return maker.from_net(net, maker.samples)
    except AccuracyError:
        return None


def _is_within_reach(maker: MatrixMaker) -> bool:
    """Whether an order of 1 in the number of rays would meet the tolerance: if not, a look at a few is in vain."""
    return maker.tolerance * maker.samples >= 1.0


def _few_rows(maker: MatrixMaker, law: WallLaw, rays: int) -> KernelMatrix | None:
    """A matrix by adaptive rows, if they meet the tolerance in less time than so many rays would."""
    if rays < MANY_RAYS:
        return None
    rows = maker.rows(law, useless=maker.tolerance, most_flights=int(ROW_FLIGHTS_A_RAY * rays))
    return rows if float(rows.error) <= maker.tolerance else None


def _few_rays(
    maker: MatrixMaker, net: Net, sooner: Callable[[int], KernelMatrix | None]
) -> tuple[KernelMatrix | None, float]:
    """A matrix of fewer rays than asked for, if these are enough for the tolerance; and what all rays promise.

    The promise is infinite where the looks do not tell. ``sooner`` may have the matrix in less time than many rays.
    """
    number, promised = FIRST_RAYS, float("inf")
    while number < maker.samples:
        try:
            found = maker.from_net(net, number)
        except AccuracyError:
            # a bin without rays, or rays that do not escape: these few are no measure
            break
        error = float(found.error)
        if error <= maker.tolerance:
            return found, error
        promised = error * (number / maker.samples) ** NET_ORDER
        needed = NET_MARGIN * number * (error / maker.tolerance) ** (1.0 / NET_ORDER)
        if needed > maker.samples:
            break
        number = max(2 * number, int(needed))
        rows = sooner(number)
        if rows is not None:
            return rows, promised
    return None, promised
