"""Named walls made of a few pieces, with period 1, the Koch curve, and walls that send nearly every ray back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import instance, number_between, positive_number, sequence, whole_number
from ...core.errors import InputError
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.curve import Curve
from ..curves.segment import Segment
from ..disk.disk import Disk
from .wall import Wall

# 4^10 is a million segments; more pieces do not fit the memory of a laptop.
MOST_GENERATIONS = 10
UNIFORM_DISK = Disk()


def flat() -> Wall:
    """Return the flat wall y = 0: every reflection is specular.

    Examples
    --------
    >>> flat()
    Wall(1 segment, period 1, depth 0, closes)
    """
    return Wall([Segment((0.0, 0.0), (1.0, 0.0))])


def triangular_teeth(angle: float = 0.7) -> Wall:
    """Return triangular teeth with tips at the integers.

    Parameters
    ----------
    angle : float
        The apex angle psi in (0, pi), radians, of the teeth and of the notches; the depth is cot(psi/2)/2.

    Raises
    ------
    InputError
        If the angle is outside (0, pi).

    Notes
    -----
    Rudzis 2022, section 2.2.2, with the tooth function corrected.

    Examples
    --------
    >>> bool(abs(triangular_teeth(math.pi / 2).depth - 0.5) < 1e-15)
    True
    """
    psi = number_between("angle", angle, 0.0, math.pi)
    return Wall.from_vertices([(0.0, 0.0), (0.5, -0.5 / math.tan(0.5 * psi)), (1.0, 0.0)])


def rectangular_teeth(height_to_width: float = 1.0) -> Wall:
    """Return rectangular teeth: a flat top on [0, 1/2] and a crevice on [1/2, 1].

    Parameters
    ----------
    height_to_width : float
        r > 0: the depth r/2 of the crevice over its width 1/2.

    Raises
    ------
    InputError
        If ``height_to_width`` is not greater than 0.

    Notes
    -----
    Rudzis 2022, sections 1.2.3 and 2.2.1, with the period corrected.

    Examples
    --------
    >>> rectangular_teeth(2.0).vertices.tolist()
    [[0.0, 0.0], [0.5, 0.0], [0.5, -1.0], [1.0, -1.0], [1.0, 0.0]]
    """
    floor = -0.5 * positive_number("height_to_width", height_to_width)
    return Wall.from_vertices([(0.0, 0.0), (0.5, 0.0), (0.5, floor), (1.0, floor), (1.0, 0.0)])


def focusing_arcs(half_angle: float = 1.2) -> Wall:
    """Return the wall of one circular arc per period, below its chord [0, 1].

    Parameters
    ----------
    half_angle : float
        xi in (0, pi/2], radians: the arc subtends 2 xi; its radius is 1/(2 sin xi), its depth tan(xi/2)/2.

    Raises
    ------
    InputError
        If the half angle is outside (0, pi/2].

    Notes
    -----
    Rudzis 2022, section 2.2.3.

    Examples
    --------
    >>> focusing_arcs(math.pi / 2).arc_length == math.pi / 2
    True
    """
    xi = number_between("half_angle", half_angle, 0.0, 0.5 * math.pi, closed="high")
    radius = 0.5 / math.sin(xi)
    arc = Arc((0.5, radius * math.cos(xi)), radius, -0.5 * math.pi - xi, -0.5 * math.pi + xi)
    return Wall([arc.pinned((0.0, 0.0), (1.0, 0.0))])


def dispersing_arcs(curvature: float = 1.0) -> Wall:
    """Return circular bumps with tops at the integers and a corner at x = 1/2.

    Parameters
    ----------
    curvature : float
        K in (0, 2]: the radius is 1/K. At K = 2 the corner is a cusp.

    Raises
    ------
    InputError
        If the curvature is outside (0, 2].

    Examples
    --------
    >>> dispersing_arcs(2.0).depth
    0.5
    """
    k = number_between("curvature", curvature, 0.0, 2.0, closed="high")
    radius, span = 1.0 / k, math.asin(0.5 * k)
    # R - R cos(span) without cancellation
    corner = (0.5, -0.5 * k * 0.5 / (1.0 + math.cos(span)))
    top = 0.5 * math.pi
    fall = Arc((0.0, -radius), radius, top, top - span).pinned((0.0, 0.0), corner)
    rise = Arc((1.0, -radius), radius, top + span, top).pinned(corner, (1.0, 0.0))
    return Wall([fall, rise])


def elliptical_arcs(half_angle: float = 1.2, disk: Disk = UNIFORM_DISK) -> Wall:
    """Return the wall of elliptical arcs whose foreshortened wall is ``focusing_arcs(half_angle)``.

    Parameters
    ----------
    half_angle : float
        xi in (0, pi/2], radians.
    disk : Disk
        The disk for which the wall acts as circular arcs, by default a uniform one; only its ratio of inertia matters.

    Raises
    ------
    InputError
        If the half angle is outside (0, pi/2].

    Notes
    -----
    Rudzis 2022, section 2.3.3, with the whole tooth function scaled by (1 + m/J)^(-1/2).

    Examples
    --------
    >>> disk = Disk(mass=1.0, inertia_ratio=0.5)
    >>> elliptical_arcs(0.9, disk).foreshorten(disk).pieces[0].is_circular
    True
    """
    instance("disk", disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
    return focusing_arcs(half_angle).unforeshorten(disk)


def double_parabola() -> Wall:
    """Return Plakhov's double parabola x = y^2/4, x = 1 - y^2/4, which nearly retroreflects.

    As a retroreflector it is known as the helmet: each parabola has its focus at the vertex of the other.

    Examples
    --------
    >>> double_parabola().depth == math.sqrt(2.0)
    True
    """
    depth = math.sqrt(2.0)
    left: list[Any] = [(0.0, 0.0), (0.0, -0.5 * depth), (0.5, -depth)]
    right: list[Any] = [(1.0 - x, y) for x, y in reversed(left)]
    return Wall([Bezier(left), Bezier(right)])


def sinusoid(amplitude: float = 0.2) -> Wall:
    """Return the wall y = -amplitude (1 - cos 2 pi x)/2, within 1e-9, by `Wall.from_function`.

    Parameters
    ----------
    amplitude : float
        The depth, greater than 0 and at most 100; half of it multiplies the cosine.

    Raises
    ------
    InputError
        If the amplitude is outside (0, 100].

    Examples
    --------
    >>> sinusoid(0.5).depth
    0.5
    """
    depth = number_between("amplitude", amplitude, 0.0, 100.0, closed="high")
    return Wall.from_function(lambda x: -depth * np.sin(np.pi * x) ** 2)


def koch(generations: int = 4) -> Wall:
    """Return the Koch curve pointing downwards, a wall of 4^generations segments.

    Parameters
    ----------
    generations : int
        From 0 (flat) to 10.

    Raises
    ------
    InputError
        If ``generations`` is not a whole number from 0 to 10.

    Notes
    -----
    The vertices are exactly mirror symmetric in x = 1/2, and the heights on the baseline are exactly 0. The arc
    length is (4/3)^generations.

    Examples
    --------
    >>> len(koch(2).pieces)
    16
    >>> [(hollow.first, hollow.last) for hollow in koch(1).hollows]
    [(1, 3)]
    """
    count = whole_number("generations", generations, 0)
    if count > MOST_GENERATIONS:
        raise InputError(f"generations: expected at most {MOST_GENERATIONS}, got {count}")
    points = np.array([0.0, 1.0], dtype=np.complex128)
    down = np.exp(-1j * math.pi / 3.0)
    for _ in range(count):
        third = points / 3.0
        left = np.concatenate([third[:-1], 1.0 / 3.0 + down * third])
        left[-1] = 0.5 - 1j * math.sqrt(3.0) / 6.0
        # 1 - (1 - x) is the nearest number whose mirror image 1 - x is exact
        x = 1.0 - (1.0 - left.real)
        left = x + 1j * left.imag
        right = (1.0 - x[-2::-1]) + 1j * left.imag[-2::-1]
        points = np.concatenate([left, right])
    return Wall.from_vertices(np.column_stack([points.real, points.imag]))


# Walls with more pieces than this do not fit the memory of a laptop.
MOST_STEPS = 1_000_000
# Thickness of a plate over its height. A ray that meets the rim of a plate keeps its vertical direction.
THICKNESS = 1e-3


def notched_angle(angle: float, notches: int) -> Wall:
    """Return Plakhov's notched angle: a wedge that narrows downwards, its sides cut into vertical and horizontal steps.

    A ray that is less steep than the sides is sent back by the corner between a step and the side above it. It then
    retraces its path up to a shift of the size of the steps. So the law tends to retroreflection when first the notches
    become fine, and then the angle small.

    Parameters
    ----------
    angle : float
        Opening angle of the wedge in (0, pi), radians; its depth is cot(angle/2)/2.
    notches : int
        Notches on each side, from 1 to 10^6.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Notes
    -----
    Source: A. Plakhov, "Mathematical retroreflectors", Discrete Contin. Dyn. Syst. 30 (2011) 1211, for the idea; the
    measures here are chosen so that the steps have equal size.

    Examples
    --------
    One notch on each side is a crevice:

    >>> notched_angle(math.pi / 2, 1)
    Wall(3 segments, period 1, depth 0.5, closes)
    """
    opening = number_between("angle", angle, 0.0, math.pi)
    count = whole_number("notches", notches, 1)
    if count > MOST_STEPS:
        raise InputError(f"notches: expected at most {MOST_STEPS}, got {count}")
    depth = 0.5 / math.tan(0.5 * opening)
    steps = [(0.5 * (k // 2) / count, -depth * ((k + 1) // 2) / count) for k in range(2 * count)]
    return _symmetric(steps)


def tube(plates: int, height: float, spacing: float = 1.0) -> Wall:
    """Return the tube of Bachurin, Khanin, Marklof and Plakhov, cut off: a shaft with thin plates on both its sides.

    A ray that is sent up by a plate after k plates passes k plates on the way back. If it meets none of them, its
    horizontal direction is reversed as well: the height at which it met the plate is nearly that of a reflection at a
    side. The law tends to retroreflection when the plates become short, in a tube of infinite depth.

    Parameters
    ----------
    plates : int
        Plates on each side, from 1 to 10^6. The floor is one spacing below the last.
    height : float
        Length of each plate in (0, 1/2), in units of the tube's width 1. Its thickness is a thousandth of this.
    spacing : float
        Vertical distance of the plates, at least the height.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Notes
    -----
    Source: P. Bachurin, K. Khanin, J. Marklof and A. Plakhov, "Perfect retroreflectors and billiard dynamics", J. Mod.
    Dyn. 5 (2011) 33.

    Examples
    --------
    >>> tube(2, 0.125)
    Wall(19 segments, period 1, depth 3, closes)
    """
    count, length = whole_number("plates", plates, 1), number_between("height", height, 0.0, 0.5)
    if count > MOST_STEPS:
        raise InputError(f"plates: expected at most {MOST_STEPS}, got {count}")
    apart = number_between("spacing", spacing, 0.0, math.inf)
    if apart < length:
        raise InputError(f"spacing: expected at least the height {length:g}, got {apart:g}")
    half = 0.5 * THICKNESS * length
    left = [(0.0, 0.0)]
    for k in range(1, count + 1):
        upper, lower = -apart * k + half, -apart * k - half
        left += [(0.0, upper), (length, upper), (length, lower), (0.0, lower)]
    return _symmetric([*left, (0.0, -apart * (count + 1))])


def _symmetric(left: list[tuple[float, float]]) -> Wall:
    """The polygonal wall of period 1 with these vertices on its left half, and their mirror images."""
    return Wall.from_vertices([*left, *((1.0 - x, y) for x, y in reversed(left))])


# More pieces than this are refused before they are made; the largest named walls have 10^5.
MOST_PIECES = 10**6


def join_walls(walls: Sequence[Wall], repeats: ArrayLike = 1) -> Wall:
    """Return one wall that consists of the cells of several walls, from left to right.

    The result is the finite piece of a wall on [0, period]. If every cell closes, no ray that enters it leaves it
    elsewhere, so its periodic continuation has no effect: this is a wall that is not periodic (condition A5a of the
    paper). A single curve that is no cell, such as a measured profile, is given as `Wall` itself.

    Parameters
    ----------
    walls : sequence of Wall
        Each begins at a highest point at height 0, as the named walls and every ``wall.cell`` of them do. Use
        ``wall.scaled(c)`` for another size.
    repeats : int or array_like of int
        How often each cell is repeated.

    Returns
    -------
    Wall
        Its period is the sum of the widths.

    Raises
    ------
    InputError
        If there are no walls, one begins below height 0, or a number of repeats is not a whole number of at least 1.

    Source: Rudzis 2022, sections 1.2.4 and 1.2.5.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> wall = geo.join_walls([geo.flat(), geo.Wall.from_vertices([(0, 0), (0.5, -1), (1, 0)]).scaled(0.5)], [1, 2])
    >>> wall.vertices.tolist()
    [[0.0, 0.0], [1.0, 0.0], [1.25, -0.5], [1.5, 0.0], [1.75, -0.5], [2.0, 0.0]]
    """
    walls = sequence("walls", walls, Wall, "geo.triangular_teeth(0.7)")
    if not walls:
        raise InputError("walls: expected a list of walls such as [geo.flat(), geo.triangular_teeth(0.7)], got none")
    numbers = np.asarray(repeats, dtype=object)
    if numbers.ndim and numbers.shape != (len(walls),):
        raise InputError(f"repeats: expected one whole number or {len(walls)}, got shape {numbers.shape}")
    counts = [whole_number("repeats", n, 1) for n in np.broadcast_to(numbers, (len(walls),)).tolist()]
    total = sum(len(wall.pieces) * count for wall, count in zip(walls, counts, strict=True))
    if total > MOST_PIECES:
        raise InputError(f"repeats: expected at most {MOST_PIECES} pieces in all, got {total:.3g}")
    pieces: list[Curve] = []
    islands: list[list[Curve]] = []
    right = 0.0
    for number, (wall, count) in enumerate(zip(walls, counts, strict=True)):
        if wall.pieces[0].start[1] != 0.0:
            raise InputError(
                f"walls: expected cells that begin at height 0, got one at {wall.pieces[0].start[1]:g} in wall {number}"
            )
        for _ in range(count):
            pieces += _moved(wall.pieces, right, right + wall.period)
            islands += [[piece.moved(right, 0.0) for piece in loop] for loop in wall.islands]
            right += wall.period
    return Wall(pieces, right, islands)


def _moved(pieces: Sequence[Curve], left: float, right: float) -> list[Curve]:
    """The pieces shifted by ``left``, joined exactly, the last ending at (right, 0)."""
    corners = [(left + piece.start[0], piece.start[1]) for piece in pieces] + [(right, 0.0)]
    return [
        piece.moved(left, 0.0).pinned(start, end) for piece, (start, end) in zip(pieces, pairwise(corners), strict=True)
    ]
