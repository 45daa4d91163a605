"""The wall of a family with the least or the greatest resistance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...core.checks import Floats, finite_array, frozen, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ..laws.law import Law
from ..walls.wall_law import WallLaw
from .drag import resistance

if TYPE_CHECKING:
    from ...geometry import Wall

# Members looked at on a grid, in each parameter, before the best of them is improved.
GRID = 12
# On the grid resistances may have this multiple of the wanted error: neighbours differ by more.
GRID_SLACK = 10.0
MOST_STEPS = 200


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

    Notes
    -----
    One parameter: Brent's method between the neighbours of the best grid point; more: Nelder and Mead's, in the
    parameters as shares of their bounds.

    Examples
    --------
    The best isosceles triangles are a little sharper than right-angled ones, which have sqrt(2).

    >>> from asperity import kernels as ker
    >>> best = best_hollow(ker.TriangularTeethLaw, [(0.2, 3.0)])
    >>> round(float(best.parameters[0]), 3), round(float(best.resistance), 6)
    (1.459, 1.426212)
    """
    limits = finite_array("bounds", bounds)
    if limits.ndim != 2 or limits.shape[1] != 2 or np.any(limits[:, 0] >= limits[:, 1]):
        raise InputError(f"bounds: expected increasing pairs, got {bounds!r}")
    if which not in ("min", "max"):
        raise InputError(f"which: expected 'min' or 'max', got {which!r}")
    whole_number("grid", grid, 3)
    search = _Search(family, limits, 1.0 if which == "min" else -1.0, positive_number("tolerance", tolerance))
    start = search.best_on_grid(grid)
    search.improve(start, 1.0 / grid)
    best = min(search.tried, key=lambda entry: search.sign * entry[-1])
    parameters = frozen(best[:-1])
    return BestHollow(parameters, family(*parameters.tolist()), search.estimate(parameters), frozen(search.tried))


class _Search:
    """A family in the unit cube, and what has been tried of it."""

    def __init__(self, family: Callable[..., Wall | Law], limits: Floats, sign: float, tolerance: float) -> None:
        self.family, self.limits, self.sign, self.tolerance = family, limits, sign, tolerance
        self.slack = GRID_SLACK
        self.tried: list[list[float]] = []

    def estimate(self, parameters: Floats) -> Estimate:
        member = self.family(*np.asarray(parameters, dtype=np.float64).tolist())
        law = member if isinstance(member, Law) else WallLaw(member)
        return resistance(law, self.slack * self.tolerance)

    def __call__(self, shares: Floats) -> float:
        """The resistance, signed so that the best is the least; beyond the bounds that of the nearest member."""
        inside = np.clip(np.atleast_1d(shares), 0.0, 1.0)
        parameters = self.limits[:, 0] + inside * (self.limits[:, 1] - self.limits[:, 0])
        value = float(self.estimate(parameters))
        self.tried.append([*parameters.tolist(), value])
        return self.sign * value

    def best_on_grid(self, grid: int) -> Floats:
        axis = (np.arange(grid) + 0.5) / grid
        points = np.stack(np.meshgrid(*[axis] * len(self.limits), indexing="ij"), axis=-1).reshape(-1, len(self.limits))
        return np.asarray(points[int(np.argmin([self(point) for point in points]))])

    def improve(self, start: Floats, spacing: float) -> None:
        from scipy.optimize import minimize, minimize_scalar

        self.slack = 1.0
        # scipy's types ask for functions of one kind of array only
        objective: Any = self
        if start.size == 1:
            ends = max(start[0] - spacing, 0.0), min(start[0] + spacing, 1.0)
            minimize_scalar(objective, bounds=ends, method="bounded", options={"xatol": self.tolerance**0.5 * spacing})
            return
        simplex = np.clip(start + spacing * np.vstack([np.zeros(start.size), 0.5 * np.eye(start.size)]), 0.0, 1.0)
        options: Any = {
            "initial_simplex": simplex,
            "fatol": self.tolerance,
            "xatol": self.tolerance**0.5,
            "maxfev": MOST_STEPS,
        }
        minimize(objective, start, method="Nelder-Mead", options=options)
