"""The wall of a family with the least or the greatest resistance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ...core.checks import Floats
from ...core.estimates import Estimate
from ..inverse.design import GRID, design_wall
from ..laws.law import Law
from .drag import resistance

if TYPE_CHECKING:
    from ...geometry import Wall


@dataclass(frozen=True, eq=False)
class BestHollow:
    """The outcome of `best_hollow`.

    Attributes
    ----------
    parameters : ndarray, shape (parameters,)
        Those of the best member found.
    member : Wall or Law
        That member.
    resistance : Estimate
        Its resistance; the error says nothing about better members that the grid missed.
    tried : ndarray, shape (members, parameters + 1)
        All parameters tried, in order, with the resistance of each.
    """

    parameters: Floats
    member: Wall | Law
    resistance: Estimate
    tried: Floats


def best_hollow(
    family: Callable[..., Wall | Law],
    bounds: Sequence[tuple[float, float]],
    which: Literal["min", "max"] = "max",
    tolerance: float = 1e-6,
    grid: int = GRID,
) -> BestHollow:
    """The member of a family of walls, or laws, with the least or greatest resistance.

    Parameters
    ----------
    family : callable
        ``family(*parameters)`` returns a wall or a law: ``geo.triangular_teeth``, ``ker.CircularArcLaw``.
    bounds : sequence of (float, float)
        Smallest and largest value of each parameter; the ends themselves are not tried on the grid.
    which : {"min", "max"}
    tolerance : float
        Wanted error of the extremal resistance. At an extremum inside the bounds the parameters are good to about its
        square root only.
    grid : int
        Members in each parameter among which the search starts. Resistances need not have a single extremum.

    Returns
    -------
    BestHollow

    Raises
    ------
    InputError
        If the bounds are not increasing pairs, or a member is neither a wall nor a law.

    See Also
    --------
    design_wall : The same search for other wishes, and within limits.

    Examples
    --------
    The best isosceles triangles are a little sharper than right-angled ones, which have sqrt(2).

    >>> from asperity import kernels as ker
    >>> best = best_hollow(ker.TriangularTeethLaw, [(0.2, 3.0)])
    >>> round(float(best.parameters[0]), 3), round(float(best.resistance), 6)
    (1.459, 1.426212)
    """
    found = design_wall(resistance, family, bounds, which, tolerance, grid)
    return BestHollow(found.parameters, found.member, found.value, found.tried)
