"""The law of a wall as the sum of the laws of its flat tops and hollows, and of any number of generations of mushrooms.

For each part there are closed forms, beams or traced rays.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, instance
from ...core.errors import AccuracyError
from ...core.rounding import EPS
from ...geometry import Arc, MushroomGenerations, Wall
from ...geometry.cells.cell import Hollow
from ...geometry.cells.hollow_shape import HollowShape, side_by_side
from ..expectations.conditionals import Conditionals
from ..laws.isometry_table import IsometryTable
from ..laws.law import LARGEST, DrivenLaw, Law, entry_points, specular, sum_of
from ..laws.structure import holds_of_all
from .circular_arc import CircularArcLaw
from .conditionals import UNRESOLVED_TOLERANCE, if_escaped, is_few, traced_conditionals, traced_reflection
from .polygons import PolygonLaw, TriangularTeethLaw, has_sides_of_axes
from .rectangular import RectangularTeethLaw

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
# A wall whose hollows include more different curved ones without closed form is not divided: sampling each of them
# would take longer than sampling the wall.
MOST_CURVED = 4
# The least tolerance for walls with many pieces, some ten milliseconds for an angle.
MANY_TOLERANCE = 1e-4


class _TracedLaw(DrivenLaw):
    """A law whose rays are traced."""

    @abstractmethod
    def reflect_with_status(self, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]: ...

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle, by tracing, of the ray that enters at ``x`` in (0, 1), as a fraction of the period."""
        return if_escaped(self, *self.reflect_with_status(x, theta))


@dataclass(frozen=True)
class WallLaw(_TracedLaw):
    """The law P~ of a wall, for rays that enter at a uniform point of the period.

    `reflect` and `reflect_with_status` trace rays, and `sample` does so unless every part has a closed form. `apply`,
    `conditionals`, `branches`, `breakpoints` and `discretise` use the parts, and of polygonal ones the isometries, if
    the beams of the wall resolve within about a second.

    The wanted error of a traced `apply` is 1e-8 times the sup norm of the function, and 1e-4 with more than 64 pieces.
    Rough walls may not reach it; the error reached is that of `conditionals`.

    Parameters
    ----------
    wall : Wall

    Attributes
    ----------
    parts : tuple of (float, Law)
        The laws of flat tops and hollows, with their fractions of the period. Isosceles triangles, rectangles (in total
        not wider than the flat tops; the law of each includes a flat top of its width) and circular arcs up to a
        semicircle have closed forms. Hollows are recognised by their shape, not by the wall's constructor. Beside
        curved hollows, the other straight hollows have one law together, and the other curved ones one for each shape.
        The only part is this law itself, without closed form, if the wall does not close; if all pieces are straight or
        all hollows alike; if more than four shapes of curved hollows have no closed form; or if hollows wider than
        their openings have no room side by side.
    mirror_symmetric : bool or None
        True if the wall's cell or every part is mirror-symmetric, otherwise None (not known).

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
    >>> WallLaw(geo.rectangular_teeth(0.75)).parts
    ((1.0, RectangularTeethLaw(height_to_width=0.75)),)
    >>> WallLaw(geo.Wall.from_vertices([(0, 0), (1, -1), (2, 0), (4, 0)])).parts
    ((0.5, TriangularTeethLaw(angle=1.5707963267948966)), (0.5, specular()))
    """

    wall: Wall

    reversible = True
    mirror_symmetric: bool | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        instance("wall", self.wall, Wall, "geo.triangular_teeth(0.7)")
        # an asymmetric cell may still have a symmetric law, hence None
        symmetric = self.wall.is_mirror_symmetric or (self._divided and sum_of(self._divided).mirror_symmetric)
        self._set(mirror_symmetric=True if symmetric else None)

    @property
    def parts(self) -> tuple[tuple[float, Law], ...]:
        return self._divided or ((1.0, self),)

    @property
    def has_traced_parts(self) -> bool:
        """Whether a part has no closed form."""
        return any(isinstance(part, WallLaw) for _, part in self.parts)

    @property
    def is_isometric(self) -> bool:
        return self.wall.is_polygonal

    @property
    def keeps_sine(self) -> bool:
        return has_sides_of_axes(self.wall)

    @property
    def traced_wall(self) -> Wall | None:
        return self.wall if self._known is None else None

    @cached_property
    def _divided(self) -> tuple[tuple[float, Law], ...] | None:
        return parts_of_wall(self.wall)

    @cached_property
    def _known(self) -> Law | None:
        """The sum of the parts, or the law of the beams of an undivided wall; None if its rays are traced."""
        return beams_law(self.wall) if self._divided is None else sum_of(self._divided)

    def reflect_with_status(self, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles by tracing, and the mask of the rays that escaped; the other rays count as retroreflected.

        ``x`` in (0, 1) is the entry point as a fraction of the period. Never raises an AccuracyError.
        """
        return traced_reflection(self.wall, x, theta)

    def _branches(self, theta: Floats) -> tuple[Floats, Floats] | None:
        return None if self._known is None else self._known._branches(theta)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Those of the isometries and closed forms; none are known of traced rays."""
        return super().breakpoints(limit) if self._known is None else self._known.breakpoints(limit)

    def isometry_table(self) -> IsometryTable | None:
        """The isometries of a wall of straight pieces whose beams resolve; else None."""
        return None if self._known is None else self._known.isometry_table()

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return super()._sample(theta, rng) if self.has_traced_parts else sum_of(self.parts).sample(theta, rng)

    def _sample_with_status(self, theta: Floats, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_] | None]:
        return super()._sample_with_status(theta, rng) if self.has_traced_parts else (self.sample(theta, rng), None)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Those of the parts or isometries, or else by tracing; rays that do not escape count in the error."""
        if self._known is not None:
            return self._known._conditionals(theta, tolerance, degree, edges)
        found, unresolved = traced_conditionals(self.wall, degree, edges)(
            theta, tolerance if is_few(self.wall) else max(tolerance, MANY_TOLERANCE)
        )
        most = float(np.mean(unresolved))
        if most > UNRESOLVED_TOLERANCE:
            raise AccuracyError(
                f"{self!r}: {most:.2g} of the rays did not escape, more than {UNRESOLVED_TOLERANCE:g}", most
            )
        return found


def made_of_isometries(law: Law) -> bool:
    """Whether a law is by theorem a mixture of isometries theta' = +-theta + const for almost every angle.

    Such laws are the laws of walls of straight pieces, whether their beams resolve or not, specular reflection,
    retroreflection, and compounds of these.
    """
    return holds_of_all(law, lambda part: part.is_isometric)


def parts_of_wall(wall: Wall) -> tuple[tuple[float, Law], ...] | None:
    """The laws of flat tops and hollows with their fractions of the period; None if the wall is not divided."""
    if not wall.closes:
        return None
    cell = wall.cell
    widths: dict[Law, float] = {}
    straight: list[Hollow] = []
    curved: list[tuple[HollowShape, list[Hollow]]] = []
    level = cell.flat_top
    for hollow in cell.hollows:
        law, width = hollow_law(cell, hollow), hollow.width
        if isinstance(law, RectangularTeethLaw):
            # with a flat top of its width, if one is left
            law = law if level - width >= -ROUNDED * cell.period else None
            level, width = (level, width) if law is None else (level - width, 2.0 * width)
        if law is not None:
            widths[law] = widths.get(law, 0.0) + width
        elif cell.is_polygonal:
            return None
        elif all(piece.is_straight for piece in cell.pieces[hollow.first : hollow.last]):
            straight.append(hollow)
        else:
            shape = HollowShape.of(cell, hollow)
            alike = next((hollows for known, hollows in curved if shape.same_as(known)), None)
            if alike is not None:
                alike.append(hollow)
            elif len(curved) < MOST_CURVED:
                curved.append((shape, [hollow]))
            else:
                return None
    groups = [(straight, straight)] if straight else []
    groups += [(hollows, hollows[:1]) for _, hollows in curved]
    if groups and len(groups) + len(widths) < 2:
        return None
    for hollows, shown in groups:
        alone, width = side_by_side(cell, shown), math.fsum(hollow.width for hollow in hollows)
        whole = width * (alone.period / math.fsum(hollow.width for hollow in shown))
        widths[WallLaw(alone)] = whole
        level -= whole - width
    if level < -ROUNDED * cell.period:
        # hollows wider than their openings have no room side by side
        return None
    if level > ROUNDED * cell.period:
        widths[specular()] = level
    total = math.fsum(widths.values())
    return tuple((width / total, law) for law, width in widths.items())


def hollow_law(cell: Wall, hollow: Hollow) -> Law | None:
    """The closed form of one hollow, or None; for a rectangle, the law includes a flat top of the same width."""
    pieces = cell.pieces[hollow.first : hollow.last]
    if len(pieces) > MOST_PIECES_KNOWN:
        return None
    shape, arc = HollowShape.of(cell, hollow), pieces[0]
    if shape.apex_angle is not None:
        return TriangularTeethLaw(shape.apex_angle)
    if shape.height_to_width is not None:
        return RectangularTeethLaw(shape.height_to_width)
    if len(pieces) > 1 or not isinstance(arc, Arc) or not arc.is_circular or arc.direction < 0:
        return None
    return CircularArcLaw(min(arc.half_span, 0.5 * np.pi)) if arc.half_span <= 0.5 * np.pi * (1.0 + ROUNDED) else None


def beams_law(wall: Wall) -> Law | None:
    """The law of a polygonal wall from beams; None if these do not resolve within about a second."""
    if not (wall.is_polygonal and wall.closes and len(wall.cell.pieces) <= MOST_PIECES):
        return None
    if len(wall.cell.pieces) > FEW_PIECES:
        # the other beams reduce the unresolved fraction at most by a factor of a hundred
        few = max(FEW_BEAMS, BEAMS_A_PIECE * len(wall.cell.pieces))
        probe = PolygonLaw(wall, max_beams=min(few, MOST_BEAMS))
        if not probe.resolves(100.0 * EXACT_ENOUGH):
            return None
        if probe.resolves(RESOLVED):
            return probe
    law = PolygonLaw(wall, max_beams=MOST_BEAMS)
    return law if law.resolves(EXACT_ENOUGH) else None


# Breakpoints asked for. Angles nearer to grazing are probed between the last breakpoint and 0 or pi.
BREAKPOINTS = 20_000


def isometries(law: Law, theta: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Probability, sign and offset of every branch of a law at the angles ``theta``.

    They are read from the law's table if it has one. Otherwise a second angle gives the sign: between two breakpoints
    every branch is one isometry.

    Parameters
    ----------
    law : Law
        A law made of isometries; other laws raise an InputError.
    theta : array_like
        Incoming angles in (0, pi), radians.

    Returns
    -------
    probability, sign, offset : arrays of shape ``theta.shape + (branches,)``
        theta' = sign theta + offset, sign = +1 or -1.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> probability, sign, offset = isometries(ker.specular(), 1.0)
    >>> probability.tolist(), sign.tolist(), (offset / np.pi).tolist()
    ([1.0], [-1.0], [1.0])
    """
    incoming = angles("theta", theta)
    table = law.isometry_table()
    if table is not None:
        return table.conditionals(incoming)
    edges = np.concatenate([[0.0], law.breakpoints(BREAKPOINTS)[0], [np.pi]])
    right = np.clip(np.searchsorted(edges, incoming, side="right"), 1, len(edges) - 1)
    low, high = edges[right - 1], edges[right]
    # the midpoint towards the farther end of the interval
    second = 0.5 * (incoming + np.where(incoming - low > high - incoming, low, high))
    # one call for both angles, so that the branches have the same order
    probability, outgoing = law.branches(np.stack([incoming, second]))
    rises = (outgoing[1] - outgoing[0]) * (second - incoming)[..., None] >= 0.0
    sign = np.where(rises, 1.0, -1.0)
    return probability[0], sign, outgoing[0] - sign * incoming[..., None]


@dataclass(frozen=True)
class MushroomLaw(_TracedLaw):
    """The law P~ of `geometry.MushroomGenerations`, for rays that enter at a uniform point of the period.

    All mushrooms are similar, and reflection does not depend on their size. So a ray enters one with the probability
    1 - (1 - s)^generations, at a uniform point of the opening, and else is reflected specularly by a flat top.

    Parameters
    ----------
    wall : geometry.MushroomGenerations

    Raises
    ------
    AccuracyError
        In `reflect`, `sample` and `apply`, if more than a fraction of 1e-4 of the rays did not escape.

    Notes
    -----
    Source: Rudzis 2022, sections 2.2.4 and 2.3.4.

    Examples
    --------
    A vertical ray of one generation either meets the flat top or falls through the stem to the bottom of the cap:

    >>> import numpy as np
    >>> from asperity import geometry as geo
    >>> law = MushroomLaw(geo.MushroomGenerations(0.25, 0.5, 40))
    >>> bool(law.reflect(0.99999999, 1.0) == np.pi - 1.0), float(law.wall.opened) > 0.9999
    (True, True)
    """

    wall: MushroomGenerations

    reversible = True
    mirror_symmetric: bool | None = True

    def __post_init__(self) -> None:
        instance("wall", self.wall, MushroomGenerations, "geo.MushroomGenerations(0.1, 0.1, 20)")

    def reflect_with_status(self, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles and the mask of the rays that escaped; the other rays count as retroreflected.

        The openings are moved to the left: ``x`` below ``wall.opened`` enters a mushroom.
        """
        # above, the ray enters on the flat top to the right of the mushroom of generation 1
        entry = np.interp(entry_points(x), [0.0, self.wall.opened, 1.0], [*self.wall.opening, LARGEST])
        return traced_reflection(self.wall.mushroom, entry, theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Those of generation 1, with its flat tops reduced to those of the last generation."""
        left, right = self.wall.opening
        found = WallLaw(self.wall.mushroom)._conditionals(theta, tolerance, degree, edges)
        factor, level = self.wall.opened / (right - left), found.nodes == (np.pi - theta)[found.owner]
        weights = np.where(level, 0.0, factor * found.weights)
        # the flat top is the last node
        weights[found.starts[1:] - 1] = 1.0 - self.wall.opened
        return found._replace(weights=weights, error=factor * found.error)
