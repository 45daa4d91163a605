"""A wall for a wanted law: hollows side by side whose mixture has the law's moments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import (
    Floats,
    Rng,
    frozen,
    generator,
    instance,
    number_between,
    positive_number,
    sequence,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...geometry import Disk, Wall, draw_wall, join_walls
from ...geometry.cells.output import wall_miniature
from ..bases.measure import SINE
from ..bases.polynomials import Legendre
from ..collisions.collision_law import CollisionLaw
from ..discretisation.discretisation import discretise
from ..distances.distances import Distance, distance
from ..laws.law import Law, in_frame
from ..laws.matrix_law import MatrixLaw, check_law
from ..matrices.matrix import KernelMatrix
from ..walls.wall_law import WallLaw
from .hollows import (
    UnitHollow,
    few_weights,
    nearest_weights,
    possible_gain,
    random_polygons,
    retroreflector,
    simple_hollows,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# The search draws this many polygons at a time, with one vertex more every second time up to the most, ...
DRAWN, MOST_VERTICES, ROUNDS = 60, 6, 14
# ... and then moves the vertices of the best ones, this many at a time, each by so many trials.
DESCENTS, MOVED, EVALUATIONS = 16, 3, 80
# Openings narrower than this fraction of the period are left out where the moments can be met without them.
SMALLEST_OPENING = 1e-5
# Moments of a law that is mirror-symmetric have no more than this between even and odd functions.
SYMMETRIC = 1e-12
# The moments of the wanted law are computed to this fraction of the tolerance.
TARGET_FRACTION = 0.01
OUTSIDE = 1e3
# The notched angle takes seconds and is traced with an error: it is worth it for laws far from those of polygons, where
# a perfect retroreflector would leave at most this fraction of the defect.
TRACED_FROM, RETROREFLECTED = 0.1, 0.5
# A step of the search that makes the defect smaller by less than this fraction is the last.
LEAST_PROGRESS = 1e-3
# Joint distances are of interest to two digits.
DISTANCE_TOLERANCE = 1e-2
UNSYMMETRIC = "law: expected one that is symmetric for sin(theta) d theta, as every wall's is"
# Rounding of a moment, for each of them.
ROUNDED = 64.0 * EPS


@dataclass(frozen=True, eq=False, repr=False)
class WallForLaw(Summary):
    """A wall whose law has the moments of a wanted law; made by `wall_for`.

    Attributes
    ----------
    wall : Wall
        The hollows side by side, the widest first; period 1.
    hollows : tuple of UnitHollow
        Each below an opening of width 1.
    weights : ndarray, shape (hollows,)
        The widths of their openings in the wall; they add up to 1.
    defect : Estimate
        Frobenius distance of the moments <e_l, P e_m>, l, m < ``moments``, of the law of the finished wall from the
        wanted ones, computed anew from that wall.
    bound : Estimate
        By how much the defect of any other mixture could be smaller, at most: of the same hollows where ``hollows``
        were given (a bound), of all polygons of the family as far as the last step of the search could see (an
        estimate). Never more than the defect itself.
    history : ndarray, shape (steps, 3)
        Before each step of the search: hollows tried, the defect, and by how much those that the step adds could make
        it smaller, at most.
    law : Law or None
        The wanted law, in the paper's convention; None where moments alone were wanted.
    moments : int
    disk : Disk or None
        Of `collision_for`: the law is that of the wall foreshortened by this disk.
    """

    wall: Wall
    hollows: tuple[UnitHollow, ...]
    weights: Floats
    defect: Estimate
    bound: Estimate
    history: Floats
    law: Law | None
    moments: int
    disk: Disk | None = None
    _show = "law disk wall weights moments defect bound"
    _more = ".wall, .hollows, .distance, .history, .plot()"

    @property
    def wall_law(self) -> WallLaw:
        """The law that the wall has, foreshortened where a disk feels it."""
        return WallLaw(self.wall if self.disk is None else self.wall.foreshorten(self.disk))

    @cached_property
    def distance(self) -> Distance:
        """The joint Wasserstein distance of the law of the wall from the wanted law: moments beyond the first count.

        Raises
        ------
        InputError
            If moments alone were wanted.
        """
        if self.law is None:
            raise InputError("distance: expected a wanted law, got moments alone; compare with a law by ker.distance")
        return distance(self.wall_law, self.law, kind="joint", tolerance=DISTANCE_TOLERANCE)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the wall."""

        axes = draw_wall(self.wall, ax=ax)
        axes.set_title(f"{len(self.hollows)} hollows, defect {float(self.defect):.2g} in {self.moments} moments")
        return axes

    def _picture(self) -> str:
        return wall_miniature(self.wall)


@reported("wall for a law")
def wall_for(
    law: Law | KernelMatrix,
    moments: int = 10,
    tolerance: float = 1e-10,
    hollows: Sequence[Wall] | None = None,
    rng: Rng = None,
    *,
    most_hollows: int | None = None,
    smallest_opening: float = SMALLEST_OPENING,
) -> WallForLaw:
    r"""A wall whose reflection law has the moments <e_l, P e_m>, l, m < ``moments``, of a wanted law.

    Parameters
    ----------
    law : Law or KernelMatrix
        Reversible. A law in the specular frame is turned back first. A matrix in bins stands for its `MatrixLaw`, one
        in Legendre polynomials for its moments, as many of them as it has.
    moments : int
        At least 2. The polynomials e_l are those of `Legendre`.
    tolerance : float
        Wanted defect.
    hollows : sequence of Wall, optional
        Walls of which a mixture is wanted, instead of a search. Each is taken with its mirror image.
    rng : None, int or numpy.random.Generator
        For the search; ``np.random.default_rng(0)`` by default, so that the same call gives the same wall.
    most_hollows : int, optional
        The wall has at most this many hollows, and a larger defect.
    smallest_opening : float
        Hollows with a narrower opening, as a fraction of the period, are left out, if the defect allows it.

    Returns
    -------
    WallForLaw
        Also where the tolerance was not met: ``defect`` says what was reached, ``bound`` how much could be missing.

    Raises
    ------
    InputError
        If the law is not reversible, an argument is unsuitable, or no wall of ``hollows`` closes.

    Notes
    -----
    The law of a wall whose hollows k have openings of width w_k is the mixture of their laws, sum w_k P_k. A law is
    met in all its moments by finitely many hollows if its moments lie in the convex hull of those of hollows; every
    symmetric law is a limit of such mixtures (Rudzis 2022, theorem 1.23 and corollary 1.8; Plakhov 2012, ch. 4). The
    weights are those of the point of the hull that is nearest; hollows are isosceles triangles, rectangles and random
    polygons of a growing number of vertices, whose laws are known exactly. Where these do not reach, the vertices of
    the hollows along which the defect falls most are moved: a fully corrective conditional gradient. Laws close to
    retroreflection get a notched angle, whose law is known from rays.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = wall_for(ker.maxwell(0.5), moments=4)
    >>> float(found.defect) < 1e-10, found.wall.closes, round(float(found.weights.sum()), 12)
    (True, True, 1.0)
    """
    whole_number("moments", moments, 2)
    positive_number("tolerance", tolerance)
    number_between("smallest_opening", smallest_opening, 0.0, 1.0, closed="low")
    if most_hollows is not None:
        whole_number("most_hollows", most_hollows, 1)
    rng = generator(rng, 0)
    wanted, target, target_error = _target(law, moments, tolerance)
    basis = Legendre(len(target))
    search = _Search(basis, target, tolerance)
    if hollows is None:
        search.run(rng)
    else:
        search.add(_given(hollows))
    # no mixture is nearer, of the given hollows, or of those that the last step of the search could see
    gain = (
        float(search.history[-1][2]) if hollows is None else possible_gain(search.points, search.target, search.weights)
    )
    least = search.defect - gain
    chosen, weights = search.result(most_hollows, smallest_opening)
    # the last opening ends where the period does
    weights[-1] = 1.0 - float(np.cumsum([0.0, *weights])[-2])
    wall = join_walls([hollow.wall.cell.scaled(width) for hollow, width in zip(chosen, weights.tolist(), strict=True)])
    finished = discretise(WallLaw(wall), basis, tolerance=0.1 * tolerance)
    value = float(np.linalg.norm(finished.symmetric - target))
    kind: ErrorKind = "bound" if {finished.error.kind, target_error.kind} == {"bound"} else "estimate"
    defect = Estimate(value, float(finished.error) + float(target_error), kind, "moments of the finished wall")
    excess = min(max(value - least, 0.0), value)
    if hollows is not None:
        bound = Estimate(excess, ROUNDED * moments, "bound", f"duality gap over {len(search.hollows)} hollows")
    else:
        # traced hollows have an error, in the search and in the finished wall
        error = float(finished.error) + float(target_error) + abs(value - search.defect)
        bound = Estimate(excess, error, "estimate", "duality gap over the hollows of the last step")
    history = frozen(np.array(search.history).reshape(-1, 3))
    return WallForLaw(wall, tuple(chosen), frozen(weights), defect, bound, history, wanted, len(target))


def collision_for(
    collision: CollisionLaw, disk: Disk | None = None, moments: int = 10, tolerance: float = 1e-10, **search: Any
) -> WallForLaw:
    """The wall on which a disk has a wanted rough collision law: that of its P~, unforeshortened.

    Parameters
    ----------
    collision : CollisionLaw
        K = delta (x) P~ (x) delta_{pi - psi}.
    disk : Disk, optional
        By default ``collision.disk``.
    moments, tolerance, **search
        As of `wall_for`, which finds a wall for P~.

    Returns
    -------
    WallForLaw
        Its ``wall``, foreshortened by the disk, has the law P~ (Rudzis 2022, section 1.3.7); ``defect`` and
        ``distance`` are those of that foreshortened wall.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> wanted = ker.CollisionLaw(ker.maxwell(0.5), geo.Disk(1.0, 0.5))
    >>> found = collision_for(wanted, moments=3)
    >>> float(found.defect) < 1e-10, found.wall.foreshorten(wanted.disk).closes
    (True, True)
    """

    instance("collision", collision, CollisionLaw, "ker.CollisionLaw(law, disk)")
    felt = collision.disk if disk is None else disk
    instance("disk", felt, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
    found = wall_for(collision.law, moments, tolerance, **search)
    return replace(found, wall=found.wall.unforeshorten(felt), disk=felt)


def _target(law: Law | KernelMatrix, moments: int, tolerance: float) -> tuple[Law | None, Floats, Estimate]:
    """The wanted law, if there is one, its moments and their error; refused unless they can be those of a wall."""
    wanted: Law | None = None
    if isinstance(law, KernelMatrix) and isinstance(law.basis, Legendre):
        matrix = law if law.frame == "paper" else law.in_specular_frame()
        if law.basis.measure != SINE or law.size < 2:
            raise InputError(
                f"law: expected at least 2 moments for the weight sin(theta), got a matrix in {law.basis!r}"
            )
    else:
        # a matrix in bins stands for its law
        wanted = MatrixLaw(law) if isinstance(law, KernelMatrix) else law
        check_law("law", wanted, "a Law such as ker.lambertian() or a KernelMatrix")
        if wanted.reversible is False:
            raise InputError(f"{UNSYMMETRIC}, got {law!r}")
        # the change is its own inverse
        wanted = in_frame(wanted, "paper")
        matrix = discretise(wanted, Legendre(moments), tolerance=TARGET_FRACTION * tolerance)
    symmetric = matrix.symmetric[:moments, :moments]
    allowed = 4.0 * float(matrix.error) + ROUNDED * len(symmetric)
    defect = float(np.linalg.norm(symmetric - symmetric.T))
    if defect > allowed:
        raise InputError(f"{UNSYMMETRIC}, got {law!r}; its moments differ from their transpose by {defect:.2g}")
    missing = float(np.linalg.norm(symmetric[0] - np.eye(len(symmetric))[0]))
    if missing > allowed:
        raise InputError(
            f"law: expected probabilities, got {law!r}; its moments with the constant miss those of a law by "
            f"{missing:.2g}"
        )
    return wanted, 0.5 * (symmetric + symmetric.T), matrix.error


def _given(walls: Sequence[Wall]) -> list[UnitHollow]:

    found = []
    for k, wall in enumerate(sequence("hollows", walls, Wall, "geo.focusing_arcs(1.0)")):
        if not wall.closes:
            raise InputError(f"hollows[{k}]: expected a Wall without islands, got {wall!r}")
        found.append(UnitHollow(wall.scaled(1.0 / wall.period)))
    if not found:
        raise InputError("hollows: expected at least one wall, got none")
    return found


class _Search:
    """Hollows, the points of their moments, and the mixture of them that is nearest to the target."""

    def __init__(self, basis: Legendre, target: Floats, tolerance: float) -> None:
        n = len(target)
        self.basis, self.tolerance = basis, tolerance
        self.sign = (-1.0) ** np.arange(n)
        odd = np.abs(target - self.sign[:, None] * target * self.sign)
        self.is_symmetric = bool(odd.max() <= SYMMETRIC)
        row, column = np.triu_indices(n)
        # of every law the first row and column are those of the identity
        used = (row > 0) & (((row + column) % 2 == 0) | (not self.is_symmetric))
        self.row, self.column = row[used], column[used]
        self.scale = np.where(self.row == self.column, 1.0, np.sqrt(2.0))
        self.target = target[self.row, self.column] * self.scale
        self.hollows: list[UnitHollow] = []
        self.points = np.empty((0, len(self.target)))
        self.weights = np.empty(0)
        self.history: list[tuple[float, float, float]] = []

    def point(self, hollow: UnitHollow) -> Floats | None:
        """The moments that count, of the hollow with its mirror image beside it where the target is symmetric."""
        matrix = hollow.moments(self.basis)
        return None if matrix is None else np.asarray(matrix[self.row, self.column] * self.scale)

    def add(self, hollows: Sequence[UnitHollow]) -> None:
        """Take hollows among those that are mixed; with their mirror images where the target is not symmetric."""
        points = []
        for hollow in hollows:
            point = self.point(hollow)
            if point is None:
                continue
            self.hollows.append(hollow)
            points.append(point)
            if not (self.is_symmetric or hollow.is_symmetric):
                self.hollows.append(hollow.mirrored())
                points.append(point * (self.sign[self.row] * self.sign[self.column]))
        if not self.hollows:
            raise InputError("hollows: expected one whose moments are known to rounding, got none")
        if points:
            self.points = np.vstack([self.points, *points])
        if self.weights.size:
            weights = np.concatenate([self.weights, np.zeros(len(points))])
            gain = possible_gain(self.points, self.target, weights)
            self.history.append((float(len(weights) - len(points)), self.defect, gain))
        self.weights = nearest_weights(self.points, self.target)

    @property
    def defect(self) -> float:
        return float(np.linalg.norm(self.weights @ self.points[: self.weights.size] - self.target))

    @property
    def is_done(self) -> bool:
        """Whether the tolerance is met, with room for what the finished wall rounds."""
        return self.defect <= 0.1 * self.tolerance

    def run(self, rng: np.random.Generator) -> None:
        """Random polygons of more and more vertices, then moved ones."""
        self.add(simple_hollows())
        for step in range(ROUNDS):
            self.add(random_polygons(DRAWN, min(2 + step // 2, MOST_VERTICES), rng))
            if self.is_done:
                return
        if self.defect > TRACED_FROM and self.with_retroreflection() < RETROREFLECTED * self.defect:
            self.add([retroreflector()])
        for _ in range(DESCENTS):
            before = self.defect
            self.add([self.moved(hollow) for hollow in self.promising()])
            if self.is_done or self.defect > (1.0 - LEAST_PROGRESS) * before:
                return

    def with_retroreflection(self) -> float:
        """The defect of the nearest mixture of the hollows and retroreflection."""
        points = np.vstack([self.points, self.row == self.column])
        return float(np.linalg.norm(nearest_weights(points, self.target) @ points - self.target))

    def promising(self) -> list[UnitHollow]:
        """The polygons along which the defect falls most."""
        order = np.argsort(self.points @ (self.weights @ self.points - self.target))
        polygons = [self.hollows[k] for k in order if self.hollows[k].is_exact and self.hollows[k].pieces > 1]
        return polygons[:MOVED]

    def moved(self, hollow: UnitHollow) -> UnitHollow:
        """The polygon with its vertices where the defect falls more, if Nelder and Mead's method finds such places."""
        from scipy.optimize import minimize

        residual = self.weights @ self.points - self.target
        start = hollow.wall.vertices[1:-1]

        def slope(corners: Floats) -> float:
            candidate = UnitHollow.polygon(corners.reshape(-1, 2))
            point = None if candidate is None else self.point(candidate)
            return OUTSIDE if point is None else float(point @ residual)

        found = minimize(slope, start.ravel(), method="Nelder-Mead", options={"maxfev": EVALUATIONS})
        return UnitHollow.polygon(found.x.reshape(-1, 2)) or hollow

    def result(self, most: int | None, smallest: float) -> tuple[list[UnitHollow], Floats]:
        """The hollows with weight, the widest first, and their weights, which sum to 1."""
        doubled = np.array([1.0 if not self.is_symmetric or h.is_symmetric else 2.0 for h in self.hollows])
        if most is not None and np.sum(doubled[self.weights > 0.0]) > most:
            self.weights = few_weights(self.points, self.target, doubled, float(most))
        usable = np.ones(len(self.hollows), dtype=bool)
        while True:
            narrow = (self.weights > 0.0) & (self.weights < smallest * doubled)
            if not narrow.any() or most is not None:
                break
            usable &= ~narrow
            weights = np.zeros(len(self.hollows))
            weights[usable] = nearest_weights(self.points[usable], self.target)
            if float(np.linalg.norm(weights @ self.points - self.target)) > max(
                2.0 * self.defect, 0.1 * self.tolerance
            ):
                break
            self.weights = weights
        chosen: list[UnitHollow] = []
        widths: list[float] = []
        for k in np.argsort(-self.weights, kind="stable"):
            if self.weights[k] <= 0.0:
                break
            hollow = self.hollows[k]
            both = [hollow] if doubled[k] == 1.0 else [hollow, hollow.mirrored()]
            chosen += both
            widths += [float(self.weights[k]) / len(both)] * len(both)
        return chosen, np.array(widths)
