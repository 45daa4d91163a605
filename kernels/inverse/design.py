"""The member of a family of walls that comes nearest to a wish, within what a workshop can make."""

from __future__ import annotations

import math
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
    from ...geometry.curves.curve import Curve

Objective = Callable[[Law, float], Estimate]

# Members looked at on a grid, in each parameter, before the best of them is improved.
GRID = 12
# On the grid values may have this multiple of the wanted error: neighbours differ by more.
GRID_SLACK = 10.0
MOST_STEPS = 200
# Points of a curved piece at which its radius of curvature is taken.
RADIUS_POINTS = 129
# Sine of the angle between the tangents of two pieces beyond which they meet in a corner.
CORNER = 1e-9


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
        All parameters tried, in order, with the objective of each; nan where a limit forbids the member.
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
    *,
    most_depth: float | None = None,
    most_pieces: int | None = None,
    smallest_radius: float | None = None,
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
    most_depth, most_pieces, smallest_radius : optional
        Limits of what can be made, for families of walls: depth and number of pieces over one period, and the smallest
        radius of curvature where the wall is hollow, which is 0 at a corner between two pieces. In units of the wall.

    Returns
    -------
    WallDesign

    Raises
    ------
    InputError
        If the bounds are not increasing pairs, a limit is given for a family of laws, or no member on the grid keeps
        to the limits.

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
    makeable = _Limits(most_depth, most_pieces, smallest_radius)
    search = _Search(objective, family, limits, goal, tolerance, makeable)
    start = search.best_on_grid(grid)
    search.improve(start, 1.0 / grid)
    best = min((entry for entry in search.tried if np.isfinite(entry[-1])), key=lambda entry: search.loss(entry[-1]))
    parameters = frozen(best[:-1])
    member = family(*parameters.tolist())
    return WallDesign(parameters, member, search.estimate(member), frozen(search.tried))


def hollow_radius(wall: Wall) -> float:
    """The smallest radius of curvature where a wall is hollow; 0 if it has a corner there, inf if it is nowhere hollow.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> hollow_radius(geo.triangular_teeth(1.0)), hollow_radius(geo.dispersing_arcs(0.5))
    (0.0, 0.0)
    >>> float(round(hollow_radius(geo.focusing_arcs(1.0)) * 2 * np.sin(1.0), 12))
    1.0
    """
    radius = math.inf
    for path in (wall.pieces, *wall.islands):
        for k, piece in enumerate(path):
            # the first piece follows the last one, of the period before or of the island
            (ax, ay), (bx, by) = path[k - 1].tangent(1.0), piece.tangent(0.0)
            if ax * by - ay * bx > CORNER:
                return 0.0
            radius = min(radius, _radius(piece))
    return radius


def _radius(piece: Curve) -> float:
    """The smallest radius of curvature of a piece where it turns left, towards the free side."""
    from ...geometry import Arc

    if isinstance(piece, Arc) and piece.is_circular:
        return piece.semi_axes[0] if piece.direction > 0 else math.inf
    s = np.linspace(0.0, 1.0, RADIUS_POINTS)
    outline_points, tangents = piece.point(s), piece.tangent(s)
    turn = tangents[:-1, 0] * tangents[1:, 1] - tangents[:-1, 1] * tangents[1:, 0]
    steps = np.hypot(*np.diff(outline_points, axis=0).T)
    left = turn > CORNER
    return float(np.min(steps[left] / np.arcsin(np.minimum(turn[left], 1.0)))) if left.any() else math.inf


@dataclass(frozen=True)
class _Limits:
    depth: float | None
    pieces: int | None
    radius: float | None

    def allow(self, member: Wall | Law) -> bool:
        if (self.depth, self.pieces, self.radius) == (None, None, None):
            return True
        if isinstance(member, Law):
            raise InputError(
                f"family: expected walls where depth, pieces or radius are limited, got the law {member!r}"
            )
        number_of_pieces = len(member.pieces) + sum(map(len, member.islands))
        return (
            (self.depth is None or member.depth <= self.depth)
            and (self.pieces is None or number_of_pieces <= self.pieces)
            and (self.radius is None or hollow_radius(member) >= self.radius)
        )


class _Search:
    """A family in the unit cube, and what has been tried of it."""

    def __init__(
        self, objective: Objective, family: Callable[..., Wall | Law], limits: Floats,
        wanted: Literal["min", "max"] | float, tolerance: float, makeable: _Limits,
    ) -> None:  # fmt: skip
        self.objective, self.family, self.limits, self.wanted = objective, family, limits, wanted
        self.tolerance, self.makeable, self.slack = tolerance, makeable, GRID_SLACK
        self.tried: list[list[float]] = []

    def loss(self, value: float) -> float:
        """What the search makes small."""
        if self.wanted == "min":
            return value
        return -value if self.wanted == "max" else abs(value - float(self.wanted))

    def estimate(self, member: Wall | Law) -> Estimate:
        return self.objective(member if isinstance(member, Law) else WallLaw(member), self.slack * self.tolerance)

    def __call__(self, fractions: Floats) -> float:
        """The loss of a member; beyond the bounds that of the nearest one, and infinite where a limit forbids it."""
        inside = np.clip(np.atleast_1d(fractions), 0.0, 1.0)
        parameters = self.limits[:, 0] + inside * (self.limits[:, 1] - self.limits[:, 0])
        member = self.family(*parameters.tolist())
        value = float(self.estimate(member)) if self.makeable.allow(member) else math.nan
        self.tried.append([*parameters.tolist(), value])
        return self.loss(value) if math.isfinite(value) else math.inf

    def best_on_grid(self, grid: int) -> Floats:
        axis = (np.arange(grid) + 0.5) / grid
        points = np.stack(np.meshgrid(*[axis] * len(self.limits), indexing="ij"), axis=-1).reshape(-1, len(self.limits))
        losses = [self(point) for point in points]
        if not np.isfinite(losses).any():
            raise InputError("most_depth, most_pieces, smallest_radius: no member on the grid keeps to them")
        return np.asarray(points[int(np.argmin(losses))])

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
