"""The law of a wall, in closed form if the hollows allow it, else by traced rays."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, instance
from ...core.errors import AccuracyError
from ...core.rounding import EPS
from ...geometry import Wall
from ..expectations.conditionals import Conditionals
from ..laws.isometry_table import IsometryTable
from ..laws.law import Combination, DrivenLaw, Law, RandomMap, specular
from .circular_arc import CircularArcLaw
from .conditionals import is_few, traced_conditionals
from .polygon import PolygonLaw
from .rectangular import RectangularTeethLaw
from .traced_map import UNRESOLVED_TOLERANCE, traced_angles, traced_reflection
from .triangular import TriangularTeethLaw

if TYPE_CHECKING:
    from ...geometry.cells.hollow import Hollow
    from ...geometry.curves.curve import Curve

# Relative tolerance, a few roundings, for the sum of widths against the period and for an arc against a semicircle.
ROUNDED = 64.0 * EPS
# The hollows with closed forms have at most this many pieces.
MOST_PIECES_KNOWN = 3
# Polygonal walls are resolved into beams where this takes about a second, at a few microseconds per beam, and where the
# unresolved fraction of the flux is at most EXACT_ENOUGH. A kernel sampled with a million rays has an error of 1e-3.
MOST_PIECES, MOST_BEAMS, EXACT_ENOUGH = 1024, 100_000, 1e-6
# Walls with more than FEW_PIECES pieces are tried with fewer beams first. These suffice if they leave at most RESOLVED,
# as most rough profiles of 40 to 800 pieces do with 50 beams per piece.
FEW_PIECES, FEW_BEAMS, BEAMS_A_PIECE, RESOLVED = 32, 10_000, 50, 1e-11
# A wall whose hollows include more different curved ones without closed form is not taken apart: sampling each of them
# would take longer than sampling the wall.
MOST_CURVED = 4
# The least tolerance for walls with many pieces, some ten milliseconds for an angle.
MANY_TOLERANCE = 1e-4


@dataclass(frozen=True)
class WallLaw(DrivenLaw):
    """The law P~ of a wall, for rays that enter at a uniform point of the period.

    `reflect` and `reflect_with_status` trace rays. `sample` uses the closed form if there is one and traces rays
    otherwise. `apply`, `conditionals`, `branches`, `breakpoints` and `discretise` use the exact law if there is one.

    The wanted error of a traced `apply` is 1e-8 times the sup norm of the function, and 1e-4 with more than 64 pieces.
    Rough walls may not reach it; the error reached is that of `conditionals`.

    Parameters
    ----------
    wall : Wall

    Attributes
    ----------
    closed_form : Law or None
        A law in closed form, if the wall consists of flat tops and hollows that are isosceles triangles, rectangles
        (in total not wider than the flat tops), or circular arcs up to a semicircle. A Combination if the hollows
        differ. Hollows are recognised by their shape, not by the wall's constructor.
    exact_law : Law or None
        The closed form, or else the `PolygonLaw` of a polygonal wall that closes and is resolved within about a
        second, or else the sum of the exact laws of the hollows, if each has one. Computed on first use.
    replacement : Law or None
        The closed form; or, of a wall that closes with curved and several different hollows, the sum of the laws of its
        hollows and flat tops, weighted by their fractions of the period. `discretise` and other functions use it, so
        each hollow is computed by its own best method: polygonal hollows exactly.
    mirror_symmetric : bool or None
        True if the wall's cell or its closed form is mirror-symmetric, otherwise None (not known).

    Raises
    ------
    AccuracyError
        In `reflect`, `sample` and `apply`, if more than a fraction of 1e-4 of the rays did not escape; ``defect`` is
        this fraction.

    Notes
    -----
    A ray that does not escape (corner, grazing, bounce limit) counts as retroreflected, theta' = theta. The true map
    takes the set of these rays to itself, and the identity is an involution that preserves sin(theta) dx d theta. Hence
    the law stays Markov and reversible, and its error in total variation is at most the fraction of these rays.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> WallLaw(geo.rectangular_teeth(0.75)).closed_form
    RectangularTeethLaw(height_to_width=0.75)
    >>> WallLaw(geo.flat()).closed_form
    specular()
    """

    wall: Wall

    reversible = True
    mirror_symmetric: bool | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        instance("wall", self.wall, Wall, "geo.triangular_teeth(0.7)")
        # An asymmetric cell may still have a symmetric law, hence None.
        object.__setattr__(self, "mirror_symmetric", True if self.wall.is_mirror_symmetric else None)
        if self.closed_form is not None:
            object.__setattr__(self, "mirror_symmetric", self.closed_form.mirror_symmetric)

    @property
    def is_isometric(self) -> bool:
        """Whether the law is made of isometries: `is_polygonal`."""
        return self.is_polygonal

    @property
    def is_polygonal(self) -> bool:
        """Whether every piece of the wall is straight."""
        return self.wall.is_polygonal

    @cached_property
    def closed_form(self) -> Law | None:
        return _closed_form(self.wall)

    @cached_property
    def replacement(self) -> Law | None:
        return self.closed_form or _taken_apart(self.wall)

    @cached_property
    def exact_law(self) -> Law | None:
        if self.closed_form is not None:
            return self.closed_form
        if isinstance(self.replacement, Combination):
            laws = [
                (weight, law.exact_law if isinstance(law, WallLaw) else law) for weight, law in self.replacement.terms
            ]
            exact = tuple((weight, law) for weight, law in laws if law is not None)
            return Combination(exact) if len(exact) == len(laws) else None
        wall = self.wall
        if not (wall.is_polygonal and wall.closes and len(wall.pieces) <= MOST_PIECES):
            return None
        if len(wall.pieces) > FEW_PIECES:
            # the other beams reduce the unresolved fraction at most by a factor of a hundred
            few = max(FEW_BEAMS, BEAMS_A_PIECE * len(wall.pieces))
            probe = PolygonLaw(wall, max_beams=min(few, MOST_BEAMS))
            if not probe.resolves(100.0 * EXACT_ENOUGH):
                return None
            if probe.resolves(RESOLVED):
                return probe
        law = PolygonLaw(wall, max_beams=MOST_BEAMS)
        return law if law.resolves(EXACT_ENOUGH) else None

    def reflect_with_status(self, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles by tracing, and the mask of the rays that escaped; the other rays count as retroreflected.

        ``x`` in (0, 1) is the entry point as a fraction of the period. Never raises an AccuracyError.
        """
        return traced_reflection(self.wall, x, theta)

    def random_map(self) -> RandomMap:
        """The map `reflect_with_status`."""
        return self.reflect_with_status

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle, by tracing, of the ray that enters at ``x`` in (0, 1), as a fraction of the period."""
        return traced_angles(self.wall, x, theta)

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        return super().branches(theta) if self.exact_law is None else self.exact_law.branches(theta)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Breakpoints of the exact law; none are known without one."""
        return super().breakpoints(limit) if self.exact_law is None else self.exact_law.breakpoints(limit)

    def isometry_table(self) -> IsometryTable | None:
        """The table of the exact law, or None."""
        return None if self.exact_law is None else self.exact_law.isometry_table()

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return super()._sample(theta, rng) if self.closed_form is None else self.closed_form.sample(theta, rng)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Those of the exact law or of the hollows, or else by tracing; rays that do not escape count in the error."""
        known = self.exact_law or self.replacement
        if known is not None:
            return known._conditionals(theta, tolerance, degree, edges)
        found = traced_conditionals(self.wall, degree, edges)(
            theta, tolerance if is_few(self.wall) else max(tolerance, MANY_TOLERANCE)
        )
        unresolved = float(np.mean(found.unresolved))
        if unresolved > UNRESOLVED_TOLERANCE:
            raise AccuracyError(
                f"{self!r}: {unresolved:.2g} of the rays did not escape, more than {UNRESOLVED_TOLERANCE:g}", unresolved
            )
        return found.conditionals


def _closed_form(wall: Wall) -> Law | None:
    """The laws of flat tops and hollows, weighted by their fractions of the period; None if a hollow has none."""
    if not wall.closes:
        return None
    wall = wall.cell
    terms: dict[Law, float] = {}
    level = wall.flat_top
    for hollow in wall.hollows:
        law = _of_hollow(wall, hollow)
        if law is None:
            return None
        width = hollow.width
        if isinstance(law, RectangularTeethLaw):
            level, width = level - width, 2.0 * width
        terms[law] = terms.get(law, 0.0) + width
    return _joined(terms, level, wall.period)


def _joined(terms: dict[Law, float], level: float, period: float) -> Law | None:
    """The mixture of laws by their widths and of specular reflection by the width ``level``; None if it is negative."""
    if level < -ROUNDED * period:
        return None
    if level > ROUNDED * period:
        terms[specular()] = level
    if len(terms) == 1:
        return next(iter(terms))
    total = math.fsum(terms.values())
    return Combination(tuple((width / total, law) for law, width in terms.items()))


def _taken_apart(wall: Wall) -> Law | None:
    """The mixture of the laws of a wall's hollows, of straight ones in one law; None for walls of one kind of hollow.

    Also None if hollows that are wider than their openings do not have room side by side.
    """
    if not wall.closes or wall.is_polygonal or len(wall.hollows) < 2:
        return None
    from ...geometry.cells.hollow_shape import distinct_hollows, side_by_side

    wall = wall.cell
    kinds = [(set(shape.kinds) == {"Segment"}, hollows) for shape, hollows in distinct_hollows(wall)]
    if len(kinds) < 2:
        return None
    terms: dict[Law, float] = {}
    level, curved = wall.period, 0
    groups = [[hollow for straight, hollows in kinds if straight for hollow in hollows]]
    for hollows in filter(None, groups + [hollows for straight, hollows in kinds if not straight]):
        straight = hollows is groups[0]
        law = None if straight else _of_hollow(wall, hollows[0])
        width = math.fsum(hollow.width for hollow in hollows)
        if law is None:
            alone = side_by_side(wall, hollows if straight else hollows[:1])
            width *= alone.period / math.fsum(hollow.width for hollow in (hollows if straight else hollows[:1]))
            law, curved = WallLaw(alone), curved + (not straight)
        terms[law] = terms.get(law, 0.0) + width
        level -= width
    return _joined(terms, level, wall.period) if curved <= MOST_CURVED else None


def _of_hollow(wall: Wall, hollow: Hollow) -> Law | None:
    """The closed form of one hollow, or None; for a rectangle, the law includes a flat top of the same width."""
    from ...geometry.cells.hollow_shape import HollowShape

    pieces = wall.pieces[hollow.first : hollow.last]
    if len(pieces) > MOST_PIECES_KNOWN:
        return None
    shape = HollowShape.of(wall, hollow)
    if shape.apex_angle is not None:
        return TriangularTeethLaw(shape.apex_angle)
    if shape.height_to_width is not None:
        return RectangularTeethLaw(shape.height_to_width)
    return _arc(pieces)


def _arc(pieces: tuple[Curve, ...]) -> Law | None:
    from ...geometry import Arc

    arc = pieces[0]
    if len(pieces) != 1 or not isinstance(arc, Arc) or not arc.is_circular or arc.direction < 0:
        return None
    if arc.half_span > 0.5 * np.pi * (1.0 + ROUNDED):
        return None
    return CircularArcLaw(min(arc.half_span, 0.5 * np.pi))
