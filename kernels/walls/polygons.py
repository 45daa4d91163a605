"""The exact law of a wall of straight pieces from beams, and of triangular teeth in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_number, instance, number_between, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...core.rounding import EPS
from ...geometry import Wall
from ...geometry.cells.hollow_shape import HollowShape, distinct_hollows
from ...geometry.polygons.beams import Beams, beams_of
from ..bases.angles import MOST_BREAKPOINTS, clipped_inside, mirrored_angle, mixed_arccos, without_extremal
from ..expectations.conditionals import Conditionals
from ..laws.isometry_table import IsometryTable
from ..laws.law import BranchLaw, entries
from ..laws.sums import merged
from .conditionals import if_escaped, traced_reflection

BEAM_TOLERANCE, MOST_BEAMS = 1e-13, 200_000


@dataclass(frozen=True)
class PolygonLaw(BranchLaw):
    r"""The exact law P~ of a wall made of segments: a finite list of isometries with their probabilities.

    Each hollow is resolved into beams, sets of rays that hit the same segments in the same order. A beam leaves by one
    isometry theta' = +-theta + const. Its probability given theta is piecewise linear in cot(theta).

    Parameters
    ----------
    wall : Wall
        A polygonal wall that closes (conditions B5 and B5': it has no islands).
    tolerance : float
        Fraction of the flux that may stay unresolved.
    max_beams : int
        Limit on the beams per hollow, which the default reaches within about a second; the rest of the flux stays
        unresolved. Cavities with narrow necks never resolve completely: for those give a larger limit, and the
        tolerance that you want. A million beams take about half a gigabyte.

    Attributes
    ----------
    unresolved : Estimate
        A bound of the unresolved fraction of the flux. Unresolved rays count as retroreflected, theta' = theta: the law
        stays Markov and reversible, and its error in total variation is at most this fraction.
    mirror_symmetric : bool or None
        True if the wall's cell is mirror-symmetric, otherwise None (not known).

    Raises
    ------
    InputError
        If the wall has curved pieces or does not close.

    Notes
    -----
    The beams are computed on first use, once for hollows of the same shape, also scaled. Rectangles of any depth and
    isosceles triangles have closed forms.

    Examples
    --------
    A right-angled corner retroreflects every ray that hits both of its sides.

    >>> from asperity import geometry as geo
    >>> law = PolygonLaw(geo.triangular_teeth(np.pi / 2))
    >>> probability, outgoing = law.branches(np.pi / 2)
    >>> probability.round(14).tolist(), (outgoing / np.pi).round(14).tolist()
    ([1.0], [0.5])
    """

    wall: Wall
    tolerance: float = BEAM_TOLERANCE
    max_beams: int = MOST_BEAMS

    mirror_symmetric: bool | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        wall = self.wall
        instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
        if not wall.is_polygonal:
            raise InputError(f"wall: expected segments only, got {wall!r}; use WallLaw(wall), which traces curves")
        if not wall.closes:
            raise InputError(
                f"wall: expected one without islands, got {wall!r}; use WallLaw(wall), which traces with periodic wrap"
            )
        positive_number("tolerance", self.tolerance)
        whole_number("max_beams", self.max_beams, 1)
        self._set(mirror_symmetric=True if wall.is_mirror_symmetric else None)

    @property
    def keeps_sine(self) -> bool:
        return has_sides_of_axes(self.wall)

    @cached_property
    def _shapes(self) -> list[tuple[HollowShape, float]]:
        """The shapes of the hollows, and the widths of all hollows of each, as fractions of the period."""

        wall = self.wall
        found = distinct_hollows(wall)
        return [(shape, math.fsum(hollow.width for hollow in hollows) / wall.period) for shape, hollows in found]

    @cached_property
    def _known(self) -> dict[int, IsometryTable]:
        """The tables of the shapes that have been computed."""
        return {}

    def _table_of(self, number: int) -> IsometryTable:
        """The table of a shape, scaled so that its opening is the whole period.

        Every hollow may leave a part of the tolerance unresolved, in proportion to its vertices.
        """
        if number not in self._known:
            size = sum(len(shape.vertices) for shape, _ in self._shapes)
            shape, width = self._shapes[number]
            self._known[number] = self._of_shape(shape, len(shape.vertices) / size / width)
        return self._known[number]

    @cached_property
    def _table(self) -> IsometryTable:
        parts = [IsometryTable.flat(self.wall.flat_top / self.wall.period)]
        parts += [self._table_of(number).scaled(width) for number, (_, width) in enumerate(self._shapes)]
        return IsometryTable.joined(parts)

    def resolves(self, most: float) -> bool:
        """Whether at most the fraction ``most`` of the flux stays unresolved; shapes of many vertices answer first."""
        left, most = 0.0, finite_number("most", most)
        for number in sorted(range(len(self._shapes)), key=lambda number: -len(self._shapes[number][0].vertices)):
            left += self._shapes[number][1] * self._table_of(number).unresolved
            if left > most:
                return False
        return True

    def _of_shape(self, shape: HollowShape, fraction: float) -> IsometryTable:
        """The table of a hollow whose opening is the whole period, with ``fraction`` times the tolerance."""
        if shape.height_to_width is not None:
            return IsometryTable.of_crevice(1.0, shape.height_to_width)
        if shape.apex_angle is not None:
            table = TriangularTeethLaw(shape.apex_angle).isometry_table()
            if table is not None:
                return table

        beams = beams_of(
            shape.vertices,
            tolerance=min(fraction * self.tolerance, 1.0),
            max_beams=self.max_beams,
            mirror_symmetric=shape.mirrored().same_as(shape),
        )
        return table_of_beams(beams)

    def isometry_table(self) -> IsometryTable:
        """All isometries with their probabilities."""
        return self._table

    @property
    def unresolved(self) -> Estimate:
        """A bound of the unresolved fraction of the flux, which counts as retroreflected."""
        fraction = self._table.unresolved
        return Estimate(fraction, fraction, "bound", f"beams of at most {self.max_beams} a hollow")

    def _branches(self, theta: Floats) -> tuple[Floats, Floats]:
        return self._table.branches(theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """The branches. Unresolved rays, a fraction s, change means by at most 2 s^(1/2) in L^2(sin(theta)/2)."""
        found = super()._conditionals(theta, tolerance, degree, edges)
        return found._replace(error=np.full(theta.size, 2.0 * math.sqrt(self._table.unresolved)))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        return self._table.breakpoints(limit)

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle, by tracing, of the ray that enters at ``x`` in (0, 1), as a fraction of the period."""
        return if_escaped(self, *traced_reflection(self.wall, x, theta))


def has_sides_of_axes(wall: Wall) -> bool:
    """Whether all pieces of a wall are horizontal or vertical segments, which keep the sine of every angle."""
    steps = [np.subtract(piece.end, piece.start) for loop in (wall.pieces, *wall.islands) for piece in loop]
    return wall.is_polygonal and all(np.count_nonzero(step) == 1 for step in steps)


def table_of_beams(beams: Beams) -> IsometryTable:
    """The table of one hollow, whose opening is the whole period; unresolved beams are retroreflected."""
    columns = beams.sign, beams.offset, beams.low, beams.high, beams.sine, beams.cosine
    resolved = IsometryTable.of_pieces(
        *columns, unresolved=float(beams.rounding), offset_error=float(beams.offset_error)
    )
    parts = [resolved]
    if np.size(beams.unresolved_low):
        parts.append(
            IsometryTable.of_pieces(
                1.0,
                0.0,
                beams.unresolved_low,
                beams.unresolved_high,
                beams.unresolved_sine,
                beams.unresolved_cosine,
                unresolved=float(beams.unresolved),
            )
        )
    return IsometryTable.joined(parts)


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
        self._set(angle=number_between("angle", self.angle, 0.0, np.pi))

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
        psi, limit = self.angle, whole_number("limit", limit, 0, most=MOST_BREAKPOINTS)
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
