"""The member of a family of walls or laws with the least, the greatest or a given value of an objective."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal, NamedTuple

import numpy as np

from ...core.checks import Floats, finite_array, finite_number, frozen, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary
from ...core.long_runs import reported
from ...geometry import Wall
from ..laws.law import Law
from ..walls.wall_law import WallLaw

Objective = Callable[[Law, float], Estimate]

# Members looked at on a grid, in each parameter, before the best of them is improved.
GRID = 12
# On the grid values may have this multiple of the wanted error: neighbours differ by more.
GRID_SLACK = 10.0
MOST_STEPS = 200
# Pairs of members, one below and one above a wanted value, between which a root is looked for: a family may jump.
CROSSINGS = 8
# Letters of a refusal that are kept.
LONGEST = 80


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
        The parameters of all members that have an objective, in order, with its value.
    refused : tuple of str
        The members without one, with the reason; they were left out.
    """

    parameters: Floats
    member: Wall | Law
    value: Estimate
    tried: Floats
    refused: tuple[str, ...] = ()


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
        A number: the member whose objective is that number within the tolerance, or nearest to it.
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
        If the bounds are not increasing pairs, no member on the grid has an objective, or another argument is not as
        described.

    Notes
    -----
    Extrema of one parameter: Brent's method between the neighbours of the best grid point; of more: Nelder and Mead's,
    in the parameters as fractions of their bounds. A number: Brent's root finder along the shortest line between two
    members on both sides of it; without such members that of an extremum. Members that raise a ValueError or an
    ArithmeticError, as all refusals are, or whose objective is no finite real number, are left out.

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
    # the value of a crossing may miss the wanted one by the half of the tolerance that its error leaves
    tolerance = positive_number("tolerance", tolerance) * (0.5 if isinstance(goal, float) else 1.0)
    tried: list[_Trial] = []
    refused: list[str] = []

    def value(fractions: Any, error: float) -> float:
        """The objective of a member to an error; nan if it refuses."""
        given = np.array(fractions, dtype=np.float64).reshape(-1)
        parameters = (limits[:, 0] + given * (limits[:, 1] - limits[:, 0])).tolist()
        try:
            member = family(*parameters)
            found = objective(member if isinstance(member, Law) else WallLaw(member), error)
            tried.append(_Trial(given, parameters, member, found, finite_number("objective", found)))
        except (ValueError, ArithmeticError) as reason:
            refused.append(f"({', '.join(f'{one:.6g}' for one in parameters)}): {reason}"[:LONGEST])
            return np.nan
        return tried[-1].number

    def loss(trial: _Trial) -> float:
        return abs(trial.number - goal) if isinstance(goal, float) else trial.number * (1.0 if goal == "min" else -1.0)

    def loss_at(fractions: Any) -> float:
        # of a member that refuses the largest loss known
        return max(map(loss, tried)) if np.isnan(value(fractions, tolerance)) else loss(tried[-1])

    axis = (np.arange(grid) + 0.5) / grid
    points = np.stack(np.meshgrid(*[axis] * len(limits), indexing="ij"), axis=-1).reshape(-1, len(limits))
    for point in points:
        value(point, GRID_SLACK * tolerance)
    if not tried:
        raise InputError(
            f"family: expected members with an objective within {bounds!r}, got none among {len(points)}; the first "
            f"is {refused[0]}; change the bounds, the family or the objective"
        )
    start, coarse = min(tried, key=loss).fractions, len(tried)
    value(start, tolerance)
    if not (isinstance(goal, float) and _crossed(value, tried, goal, tolerance)):
        _improve(loss_at, start, 1.0 / grid, tolerance)
        if isinstance(goal, float):
            # an extremum between members on the grid may lie beyond the wanted value
            _crossed(value, tried, goal, tolerance)
    best = min(tried[coarse:] or tried, key=loss)
    found = frozen([[*each.parameters, each.number] for each in tried])
    return WallDesign(frozen(best.parameters), best.member, best.value, found, tuple(refused))


class _Trial(NamedTuple):
    """A member of a family at a point of the unit cube, with its objective."""

    fractions: Floats
    parameters: list[float]
    member: Wall | Law
    value: Estimate
    number: float


def _crossed(value: Callable[[Any, float], float], tried: Sequence[_Trial], goal: float, error: float) -> bool:
    """Whether a root of value - goal was found, within ``error``, between two members on both sides of the goal."""
    from scipy.optimize import brentq

    ends = [[one.fractions for one in tried if (one.number < goal) == below] for below in (True, False)]
    pairs = sorted(product(*ends), key=lambda pair: float(np.linalg.norm(pair[1] - pair[0])))
    for one, other in pairs[:CROSSINGS]:
        count = len(tried)

        # the root finder ends at 0, and at nan of a member that refuses
        def excess(t: float, one: Floats = one, step: Floats = other - one) -> float:
            found = value(one + t * step, error) - goal
            return 0.0 if abs(found) <= error else found

        try:
            brentq(excess, 0.0, 1.0, disp=False)
        except ValueError:
            # or the smaller error showed that the ends are on one side
            continue
        if any(abs(trial.number - goal) <= error for trial in tried[count:]):
            return True
    return False


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
