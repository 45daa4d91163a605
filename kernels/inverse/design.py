"""The member of a family of walls or laws with the least, the greatest or a given value of an objective."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...core.checks import Floats, finite_array, finite_number, frozen, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary
from ...core.long_runs import reported
from ..laws.law import Law
from ..walls.wall_law import WallLaw

if TYPE_CHECKING:
    from ...geometry import Wall

Objective = Callable[[Law, float], Estimate]

# Members looked at on a grid, in each parameter, before the best of them is improved.
GRID = 12
# On the grid values may have this multiple of the wanted error: neighbours differ by more.
GRID_SLACK = 10.0
MOST_STEPS = 200


@dataclass(frozen=True, eq=False, repr=False)
class WallDesign(Summary):
    """The outcome of `design_wall`.

    Attributes
    ----------
    parameters : ndarray, shape (parameters,)
        Those of the best member found.
    member : Wall or Law
        That member.
    value : Estimate
        The objective of that member; the error says nothing about better members that the grid missed.
    tried : ndarray, shape (members, parameters + 1)
        All parameters tried, in order, with the objective of each.
    """

    parameters: Floats
    member: Wall | Law
    value: Estimate
    tried: Floats


@reported("wall design")
def design_wall(
    objective: Objective,
    family: Callable[..., Wall | Law],
    bounds: Sequence[tuple[float, float]],
    wanted: Literal["min", "max"] | float = "max",
    tolerance: float = 1e-6,
    grid: int = GRID,
) -> WallDesign:
    """The member of a family of walls, or laws, with the least, greatest or a given value of an objective.

    Parameters
    ----------
    objective : callable
        ``objective(law, tolerance)`` returns an Estimate: ``ker.resistance``, ``spec.spectral_gap``, or
        ``lambda law, tolerance: spec.diffusivity(law)``.
    family : callable
        ``family(*parameters)`` returns a wall or a law: ``geo.triangular_teeth``, ``ker.CircularArcLaw``.
    bounds : sequence of (float, float)
        Smallest and largest value of each parameter; the ends themselves are not tried on the grid.
    wanted : {"min", "max"} or float
        A number: the member whose objective is nearest to it.
    tolerance : float
        Wanted error of the objective. At an extremum inside the bounds the parameters are good to about its square
        root only.
    grid : int
        Members in each parameter among which the search starts. Objectives need not have a single extremum.

    Returns
    -------
    WallDesign

    Raises
    ------
    InputError
        If the bounds are not increasing pairs, or another argument is not as described.

    Notes
    -----
    One parameter: Brent's method between the neighbours of the best grid point; more: Nelder and Mead's, in the
    parameters as fractions of their bounds.

    Examples
    --------
    The teeth of resistance 1.2: their apex angle, and their resistance.

    >>> from asperity import geometry as geo, kernels as ker
    >>> found = design_wall(ker.resistance, geo.triangular_teeth, [(1.5, 3.0)], wanted=1.2)
    >>> round(float(found.parameters[0]), 3), round(float(found.value), 4)
    (2.1, 1.2)
    """
    limits = finite_array("bounds", bounds)
    if limits.ndim != 2 or limits.shape[1] != 2 or np.any(limits[:, 0] >= limits[:, 1]):
        raise InputError(f"bounds: expected increasing pairs, got {bounds!r}")
    if isinstance(wanted, str) and wanted not in ("min", "max"):
        raise InputError(f"wanted: expected 'min', 'max' or a number, got {wanted!r}")
    goal = wanted if isinstance(wanted, str) else finite_number("wanted", wanted)
    whole_number("grid", grid, 3)
    positive_number("tolerance", tolerance)
    tried: list[list[float]] = []

    def loss(value: float) -> float:
        if isinstance(goal, float):
            return abs(value - goal)
        return value if goal == "min" else -value

    def estimate(member: Wall | Law, error: float) -> Estimate:
        return objective(member if isinstance(member, Law) else WallLaw(member), error)

    def loss_at(fractions: Any, error: float) -> float:
        parameters = (limits[:, 0] + fractions * (limits[:, 1] - limits[:, 0])).tolist()
        tried.append([*parameters, float(estimate(family(*parameters), error))])
        return loss(tried[-1][-1])

    axis = (np.arange(grid) + 0.5) / grid
    points = np.stack(np.meshgrid(*[axis] * len(limits), indexing="ij"), axis=-1).reshape(-1, len(limits))
    start = points[int(np.argmin([loss_at(point, GRID_SLACK * tolerance) for point in points]))]
    _improve(lambda fractions: loss_at(fractions, tolerance), start, 1.0 / grid, tolerance)
    best = min(tried, key=lambda entry: loss(entry[-1]))
    parameters = frozen(best[:-1])
    member = family(*parameters.tolist())
    return WallDesign(parameters, member, estimate(member, tolerance), frozen(tried))


def _improve(loss: Callable[[Any], float], start: Floats, spacing: float, tolerance: float) -> None:
    """Evaluate a loss in the unit cube at places that come near to a minimum beside the start."""
    from scipy.optimize import minimize, minimize_scalar

    if start.size == 1:
        ends = max(start[0] - spacing, 0.0), min(start[0] + spacing, 1.0)
        minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": tolerance**0.5 * spacing})
        return
    simplex = np.clip(start + spacing * np.vstack([np.zeros(start.size), 0.5 * np.eye(start.size)]), 0.0, 1.0)
    options: Any = {"initial_simplex": simplex, "fatol": tolerance, "xatol": tolerance**0.5, "maxfev": MOST_STEPS}
    minimize(loss, start, method="Nelder-Mead", bounds=[(0.0, 1.0)] * start.size, options=options)
