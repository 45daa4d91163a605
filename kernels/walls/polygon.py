"""The exact law of a wall of straight pieces, from beams."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_number, instance, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...geometry import Wall
from ..expectations.conditionals import Conditionals
from ..laws.isometry_table import IsometryTable
from ..laws.law import BranchLaw
from .traced_map import if_escaped, traced_reflection
from .triangular import TriangularTeethLaw

if TYPE_CHECKING:
    from ...geometry.cells.hollow_shape import HollowShape
    from ...geometry.polygons.beams import Beams

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
        object.__setattr__(self, "mirror_symmetric", True if wall.is_mirror_symmetric else None)

    @cached_property
    def _shapes(self) -> list[tuple[HollowShape, float]]:
        """The shapes of the hollows, and the widths of all hollows of each, as fractions of the period."""
        from ...geometry.cells.hollow_shape import distinct_hollows

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
        from ...geometry.polygons.beams import beams_of

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
