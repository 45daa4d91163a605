"""The member of a family of walls with the least or the greatest resistance."""

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
        Parameters of the best member found.
    member : Wall or Law
        The best member found.
    resistance : Estimate
        Its resistance. The error does not cover better members missed by the grid.
    tried : ndarray, shape (members, parameters + 1)
        All parameters tried, in order, each with its resistance.
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
    """Find the member of a family of walls or laws with the least or greatest resistance.

    Parameters
    ----------
    family : callable
        ``family(*parameters)`` returns a wall or a law, for example ``geo.triangular_teeth`` or ``ker.CircularArcLaw``.
    bounds : sequence of (float, float)
        Smallest and largest value of each parameter; the grid excludes these values.
    which : {"min", "max"}
    tolerance : float
        Wanted error of the extremal resistance. The error of the parameters at an interior extremum is about its square
        root.
    grid : int
        Number of values of each parameter on the starting grid; resistances may have several extrema.

    Returns
    -------
    BestHollow

    Raises
    ------
    InputError
        If the bounds are not increasing pairs, or a member is neither a wall nor a law.

    See Also
    --------
    design_wall : The same search for other quantities, also with constraints.

    Examples
    --------
    The best isosceles triangles are slightly sharper than right-angled ones, whose resistance is sqrt(2).

    >>> from asperity import kernels as ker
    >>> best = best_hollow(ker.TriangularTeethLaw, [(0.2, 3.0)])
    >>> round(float(best.parameters[0]), 3), round(float(best.resistance), 6)
    (1.459, 1.426212)
    """
    found = design_wall(resistance, family, bounds, which, tolerance, grid)
    return BestHollow(found.parameters, found.member, found.value, found.tried)
