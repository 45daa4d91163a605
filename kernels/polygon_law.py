"""The exact law of a polygonal wall."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Floats, positive_number, whole_number
from ..errors import InputError
from ..estimates import Estimate
from .isometry_table import Crevice, IsometryTable
from .law import BranchLaw
from .triangular import TriangularTeethLaw

if TYPE_CHECKING:
    from ..geometry import Wall
    from ..geometry.beams import Beams

# Hollows whose vertices agree to this share of their width are computed once; the same tolerance decides whether a
# hollow is a rectangle or an isosceles triangle, whose law is known in closed form.
SAME_SHAPE = 64.0 * np.finfo(np.float64).eps
BEAM_TOLERANCE, MOST_BEAMS = 1e-13, 200_000
# Angles looked at to tell how many branches there are: it is the cost of `apply`, and need not be exact.
MOST_PROBES = 512


@dataclass(frozen=True)
class PolygonLaw(BranchLaw):
    r"""The law P~ of a wall made of segments, without sampling: a finite list of isometries and their probabilities.

    Each hollow is resolved into beams, sets of rays that hit the same segments in the same order: all of them leave by
    one isometry theta' = +-theta + const, and the probability of a beam given theta is piecewise linear in cot(theta).

    Parameters
    ----------
    wall : Wall
        Polygonal, and closing (condition B5).
    tolerance : float
        Share of a hollow's flux that may stay unresolved.
    max_beams : int
        Beams a hollow at most; what is left then stays unresolved.

    Attributes
    ----------
    unresolved : Estimate
        A bound of the flux whose way through the wall was not found. Such rays are sent back, theta' = theta: the law
        stays Markov and reversible, and its distance in total variation is at most this share.
    mirror_symmetric : bool or None
        True if the wall's cell is; otherwise not known.

    Raises
    ------
    InputError
        If the wall has curved pieces or does not close.

    Notes
    -----
    The beams are computed on first use. Hollows of the same shape, also in another size or mirrored, are computed
    once; rectangles and isosceles triangles have closed forms, so that a rectangle of any depth costs nothing.

    Examples
    --------
    A corner of a right angle sends every ray back that hits both of its sides, whichever way it is turned.

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
        if not hasattr(wall, "hollows"):
            raise InputError(f"wall: expected a Wall such as geo.triangular_teeth(0.7), got {wall!r}")
        if not wall.is_polygonal:
            raise InputError(f"wall: expected segments only, got {wall!r}; use WallLaw(wall), which traces curves")
        if not wall.closes:
            raise InputError(
                f"wall: expected one that touches y = 0 at the ends of its period and has no islands, got {wall!r}; "
                "use WallLaw(wall), which traces with periodic wrap"
            )
        positive_number("tolerance", self.tolerance)
        whole_number("max_beams", self.max_beams, 1)
        object.__setattr__(self, "mirror_symmetric", True if wall.is_mirror_symmetric else None)

    @cached_property
    def _table(self) -> IsometryTable:
        wall = self.wall
        level = wall.period - math.fsum(hollow.width for hollow in wall.hollows)
        parts = [IsometryTable.flat(level / wall.period)] if level > SAME_SHAPE * wall.period else []
        known: list[tuple[Floats, IsometryTable]] = []
        for hollow in wall.hollows:
            width = hollow.width
            chain = (wall.vertices[hollow.first : hollow.last + 1] - [hollow.left, 0.0]) / width
            chain[-1, 0] = 1.0
            parts.append(self._of_hollow(chain, known).scaled(width / wall.period))
        return IsometryTable.joined(parts)

    def _of_hollow(self, chain: Floats, known: list[tuple[Floats, IsometryTable]]) -> IsometryTable:
        """The table of a hollow of width 1, looked up among those computed before."""
        reflected = np.column_stack([1.0 - chain[::-1, 0], chain[::-1, 1]])
        for other, found in known:
            if _same(chain, other):
                return found
            if _same(reflected, other):
                return found.mirrored()
        table = _closed_form(chain)
        if table is None:
            from ..geometry.beams import beams_of

            table = table_of_beams(beams_of(chain, tolerance=self.tolerance, max_beams=self.max_beams))
        known.append((chain, table))
        return table

    def table(self) -> IsometryTable:
        """All isometries with their probabilities."""
        return self._table

    @property
    def unresolved(self) -> Estimate:
        """The share of the flux that is sent back because its way through the wall was not found."""
        share = self._table.unresolved
        return Estimate(share, share, "bound", f"beams of at most {self.max_beams} a hollow")

    @cached_property
    def fan_out(self) -> int:  # type: ignore[override]
        """The largest number of branches at an angle, of up to a few hundred angles spread over (0, pi)."""
        edges = np.concatenate([[0.0], self._table.ends, [np.pi]])
        edges = edges[:: edges.size // MOST_PROBES + 1]
        return int(self._table.rows(0.5 * (edges[:-1] + edges[1:]))[0].shape[-1])

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles, merged by isometry, shape ``theta.shape + (branches,)``."""
        return self._table.branches(theta)

    def kinks(self, limit: int) -> tuple[Floats, float]:
        return self._table.kinks(limit)

    def respond(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle, by tracing, of the ray that enters at ``x`` in (0, 1), as a share of the period."""
        from .wall_law import WallLaw

        return WallLaw(self.wall).respond(x, theta)


def table_of_beams(beams: Beams) -> IsometryTable:
    """The table of one hollow, its opening the whole period; unresolved beams are sent back."""
    columns = beams.sign, beams.offset, beams.low, beams.high, beams.sine, beams.cosine
    resolved = IsometryTable.of_pieces(*columns, unresolved=float(beams.rounding))
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


def _same(chain: Floats, other: Floats) -> bool:
    size = SAME_SHAPE * max(1.0, float(np.abs(chain[:, 1]).max()))
    return chain.shape == other.shape and bool(np.all(np.abs(chain - other) <= size))


def _closed_form(chain: Floats) -> IsometryTable | None:
    """The table of a rectangle or an isosceles triangle of width 1, or None."""
    if len(chain) == 3 and abs(chain[1, 0] - 0.5) <= SAME_SHAPE:
        return TriangularTeethLaw(2.0 * math.atan2(0.5, -chain[1, 1])).table()
    if len(chain) == 4:
        depth = -chain[1, 1]
        tilt = max(abs(chain[1, 0]), abs(chain[2, 0] - 1.0), abs(chain[2, 1] / depth + 1.0))
        if tilt <= SAME_SHAPE:
            nothing = np.empty(0)
            return IsometryTable(*(nothing,) * 6, crevices=(Crevice(1.0, float(depth)),))
    return None
