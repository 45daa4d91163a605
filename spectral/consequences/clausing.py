"""The probability that a particle passes a channel or a tube with rough walls (Clausing's problem)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from ...core.checks import Floats, Rng, choice, generator, number_between, positive_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, RULE_OF_THREE, Estimate
from ...core.rounding import EPS
from ...kernels import Law, lambertian, specular
from ...kernels.hemisphere.hemisphere_law import DirectionLaw
from ...kernels.laws.structure import words_of
from .channel import LARGEST, in_paper_frame, reflected

Section = Literal["channel", "tube"]
Function: TypeAlias = Callable[[Floats], Floats]
# Directions of flight, and the displacements along the axis and directions that follow after a reflection.
Reflections: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]

# Gauss nodes of a panel in two resolutions, whose difference is the error; longest panel in units of the half width of
# the strip in which the kernel is analytic; limit on the panels.
NODES, PANEL_LENGTH, MOST_PANELS = (8, 10), 1.0, 300
# Least diffuse fraction of the integral equation, and the terms of its kernel in units of the inverse fraction: the
# terms beyond sum to less than rounding.
LEAST_DIFFUSE, TERMS = 0.01, 50.0
# Particles at a time, the limit on their reflections, about ten seconds of a law with a closed form, and the particles
# of which one reflection takes as long as the calls that it needs.
TOGETHER, MOST_REFLECTIONS, LEAST_TOGETHER = 2**16, 5 * 10**7, 500


@dataclass(frozen=True)
class _Geometry:
    """Fractions of diffuse particles by the distance z >= 0 along the axis; ``width`` is where they begin to fall.

    Attributes
    ----------
    kernel : callable
        From a place on the wall to the wall at the distance z, a density.
    beyond : callable
        From a place on the wall to the section at the distance z and through it: the integral of the kernel beyond z.
    passing : callable
        From an end through the section at the distance z without collision.
    """

    kernel: Function
    beyond: Function
    passing: Function
    width: float


def _beyond_in_tube(z: Floats) -> Floats:
    root = np.sqrt(z * z + 4.0)
    return np.asarray(4.0 / (root * (root + z) ** 2))


# In the channel of width 1 the fractions are those of the plane: the cosine law in space projects to that in the plane.
GEOMETRIES: dict[Section, _Geometry] = {
    "channel": _Geometry(
        lambda z: 0.5 * (1.0 + z * z) ** -1.5,
        lambda z: 0.5 / (np.sqrt(1.0 + z * z) * (np.sqrt(1.0 + z * z) + z)),
        lambda z: 1.0 / (np.sqrt(1.0 + z * z) + z),
        1.0,
    ),
    # radius 1
    "tube": _Geometry(
        lambda z: 0.5 * (1.0 - z * (z * z + 6.0) * (z * z + 4.0) ** -1.5),
        _beyond_in_tube,
        lambda z: 4.0 / (np.sqrt(z * z + 4.0) + z) ** 2,
        2.0,
    ),
}


def transmission(
    law: Law | DirectionLaw, length: float, section: Section = "channel", tolerance: float = 1e-4, rng: Rng = None
) -> Estimate:
    r"""The probability that a particle that enters a channel or a tube leaves it at the other end (Clausing).

    Particles enter at one end, uniformly over the opening and with the cosine law, as from a gas at rest.

    Parameters
    ----------
    law : Law or DirectionLaw
        The law of the walls: a planar one, in either convention, or one of directions in space such as a
        `HemisphereLaw`. The upper wall of a channel is the mirror image of the lower one. The orientation of grooves is
        their angle with the axis: 0 for grooves along it, pi/2 for grooves across. In a tube ``lambertian()`` and
        ``maxwell(a)`` mean the diffuse law and its mixture in space; other planar laws are refused.
    length : float
        The length in widths of the channel, or in radii of the tube.
    section : {"channel", "tube"}
        Two parallel walls, or a round tube.
    tolerance : float
        The wanted error. Diffuse walls and mixtures with specular ones reach 1e-8.
    rng : None, int or numpy.random.Generator
        The source of the flights of other laws.

    Returns
    -------
    Estimate
        The error is that reached. For flights it exceeds the tolerance where 5 x 10^7 reflections do not reach it (ten
        seconds to a minute): an error of 1e-4 takes up to 10^8 particles, each with about as many reflections as the
        length has widths.

    Raises
    ------
    InputError
        If an argument is not as described, the tube has another planar law, a tube with these is longer than
        600 radii or has a diffuse fraction between 0 and 0.01.

    Notes
    -----
    The cosine law of the half sphere projects to that of the plane, and walls with grooves across the channel keep the
    velocity along the grooves. So a channel in space and its section in the plane have one transmission.

    At walls that reflect diffusely with probability a, else specularly, the places x of diffuse reflections form a
    Markov chain. With the fraction S of particles that go from a place of the wall beyond a distance, S_a(z) = a sum_k
    (1 - a)^(k-1) S(z/k) is the fraction without a diffuse reflection before. The probability u of leaving at the far
    end solves u(x) = S_a(L - x) - int S_a'(d) u(y) dy with the distance d of x and y, by Gauss quadrature on panels.
    For other laws particles are simulated from their first collision on; the fraction that has none is exact.

    Source: P. Clausing, Ann. Phys. 404 (1932) 961.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> print(f"{spec.transmission(ker.lambertian(), 10.0):.5f}")
    0.24056
    >>> print(f"{spec.transmission(ker.lambertian(), 10.0, 'tube'):.7f}")
    0.1909424

    Grooves across a tube hold more particles back than grooves along it:

    >>> grooves = [ker.HemisphereLaw(ker.lambertian(), angle) for angle in (0.0, np.pi / 2)]
    >>> [f"{spec.transmission(law, 2.0, 'tube', tolerance=0.01, rng=0):.2f}" for law in grooves]
    ['1.00', '0.51']

    Retroreflecting walls pass what meets no wall:

    >>> print(f"{spec.transmission(ker.retroreflection(), 0.75, rng=0):.5f}")
    0.50000
    """
    far = number_between("length", length, 0.0, LARGEST)
    choice("section", section, get_args(Section))
    wanted, source = positive_number("tolerance", tolerance), generator(rng)
    if isinstance(law, DirectionLaw):
        enter = _entered_in_tube if section == "tube" else _entered_in_channel
        return _by_flights(section, far, wanted, source, enter, lambda arriving: _leave(law, section, arriving, source))
    paper, geometry = in_paper_frame(law), GEOMETRIES[section]
    diffuse = _diffuse_fraction(paper)
    if diffuse == 0.0:
        return Estimate(1.0, 0.0, "bound", "specular reflection keeps the direction along the axis")
    in_reach = far <= MOST_PANELS * PANEL_LENGTH * geometry.width
    if diffuse is not None and diffuse >= LEAST_DIFFUSE and in_reach:
        return _by_integral_equation(geometry, diffuse, far)
    if section == "channel":
        return _by_flights("channel", far, wanted, source, _entered_in_plane, lambda angle: _turn(paper, angle, source))
    if diffuse is None:
        raise InputError(
            "law: in a tube expected lambertian(), maxwell(a) or HemisphereLaw(law, orientation), because a planar law "
            f"does not tell the direction of its grooves, got {law!r}"
        )
    raise InputError(
        f"length: in a tube expected at most {MOST_PANELS * PANEL_LENGTH * geometry.width:g} radii and a diffuse "
        f"fraction of at least {LEAST_DIFFUSE:g}, got {far:g} and {diffuse:g}"
    )


def _diffuse_fraction(law: Law) -> float | None:
    """The weight of diffuse reflection in a mixture of it with specular reflection; None for other laws."""
    words = words_of(law)
    if words is None:
        return None
    diffuse = sum(weight for word, weight in words.items() if word == (lambertian(),))
    others = {word for word, weight in words.items() if weight} - {(lambertian(),), (specular(),)}
    return None if others else float(diffuse)


# ---- the integral equation -----------------------------------------------------------------------------------------
def _by_integral_equation(geometry: _Geometry, diffuse: float, length: float) -> Estimate:
    coarse, fine = (_solved(geometry, diffuse, length, nodes) for nodes in NODES)
    panels = _panels(geometry, length)
    # the matrix is 1 minus one of nonnegative entries with row sums below 1; its condition grows like length squared
    rounding = 4.0 * EPS * panels * NODES[1]
    method = f"integral equation, {panels} panels of {NODES[1]} nodes; error from {NODES[0]}"
    return Estimate(fine, abs(fine - coarse) + rounding, "estimate", method)


def _panels(geometry: _Geometry, length: float) -> int:
    return math.ceil(length / (PANEL_LENGTH * geometry.width))


def _solved(geometry: _Geometry, diffuse: float, length: float, nodes: int) -> float:
    """The transmission, with so many Gauss nodes on each panel."""
    panels = _panels(geometry, length)
    size = length / panels
    unit, weight = np.polynomial.legendre.leggauss(nodes)
    node, weight = 0.5 * size * (unit + 1.0), 0.5 * size * weight
    terms = np.arange(1, math.ceil(TERMS / diffuse) + 1 if diffuse < 1.0 else 2)
    chance = np.asarray(diffuse * (1.0 - diffuse) ** (terms - 1), dtype=np.float64)

    def averaged(function: Function, z: Floats, factor: Floats) -> Floats:
        return np.asarray(sum(one * function(z / k) for k, one in zip(terms, factor, strict=True)))

    # blocks of all pairs of panels depend on the distance of the panels alone
    far = size * np.arange(1, panels)[:, None, None] + node - node[:, None]
    block = averaged(geometry.kernel, far, chance / terms) * weight
    own = _own_block(lambda z: averaged(geometry.kernel, z, chance / terms), unit, size)
    # to the panel before, at the same distance: by symmetry of the nodes about the middle of the panel
    every = np.concatenate((block[::-1, ::-1, ::-1], own[None], block))
    step = np.arange(panels)[None, :] - np.arange(panels)[:, None] + panels - 1
    matrix = every[step].transpose(0, 2, 1, 3).reshape(panels * nodes, panels * nodes)
    place = (size * np.arange(panels)[:, None] + node).ravel()
    leaving = averaged(geometry.beyond, length - place, chance)
    reaching = np.linalg.solve(np.eye(place.size) - matrix, leaving)
    direct = float(averaged(geometry.passing, np.array(length), diffuse * terms * chance))
    # by reversal of the paths, a place of the wall has its first diffuse particles from the end as it sends them there
    first = 2.0 * diffuse * averaged(geometry.beyond, place, chance)
    return direct + float(np.sum(first * reaching * np.tile(weight, panels)))


def _own_block(kernel: Function, unit: Floats, size: float) -> Floats:
    """Integrals of kernel(|x - y|) over a panel times the Lagrange polynomials of its nodes, for x at each node.

    On both sides of the kink y = x by Gauss quadrature.
    """
    weight = np.polynomial.legendre.leggauss(unit.size)[1]
    # nodes between -1 and x, and between x and 1
    half = 0.5 * np.stack((1.0 + unit, 1.0 - unit), axis=-1)[..., None]
    y = np.stack((unit, unit), axis=-1)[..., None] + half * (unit + np.array([[-1.0], [1.0]]))
    lagrange = np.polynomial.legendre.legvander(y, unit.size - 1) @ np.linalg.inv(
        np.polynomial.legendre.legvander(unit, unit.size - 1)
    )
    value = kernel(0.5 * size * np.abs(y - unit[:, None, None])) * half * weight * 0.5 * size
    return np.asarray(np.einsum("isq,isqj->ij", value, lagrange))


# ---- flights -------------------------------------------------------------------------------------------------------
def _by_flights(
    section: Section,
    length: float,
    tolerance: float,
    rng: np.random.Generator,
    enter: Callable[[float, np.random.Generator], tuple[Floats, Floats]],
    reflect: Reflections,
) -> Estimate:
    """The fraction without collision, exactly, and of the others the fraction that leaves at the far end, by rays."""
    direct = float(GEOMETRIES[section].passing(np.array(length)))
    through = particles = unresolved = work = 0
    value, error = math.nan, math.inf
    while error > tolerance and work < MOST_REFLECTIONS:
        x, direction = enter(length, rng)
        particles += x.size
        passed, left, done = _flown(length, x, direction, reflect)
        through, unresolved, work = through + passed, unresolved + left, work + done + TOGETHER
        count = max(particles, 1)
        fraction, half = through / count, 0.5 * unresolved / count
        spread = NORMAL_95 * math.sqrt(fraction * (1.0 - fraction) / count)
        # of particles that are still inside, none or all may leave at the far end
        value = direct + (1.0 - direct) * (fraction + half)
        error = (1.0 - direct) * (max(spread, RULE_OF_THREE / count) + half)
    method = f"flights of {particles} particles" + f", {unresolved} of them still inside" * (unresolved > 0)
    return Estimate(value, error, "estimate", method)


def _flown(length: float, x: Floats, direction: Floats, reflect: Reflections) -> tuple[int, int, int]:
    """Of particles that meet a wall the numbers that leave at the far end and that stay inside, and the work done.

    The work is the number of reflections, those of few particles at a time counted as `LEAST_TOGETHER`.
    """
    through = work = 0
    while x.size and work < MOST_REFLECTIONS:
        work += max(x.size, LEAST_TOGETHER)
        shift, direction = reflect(direction)
        x = x + shift
        through += int(np.count_nonzero(x >= length))
        inside = (x > 0.0) & (x < length)
        x, direction = x[inside], direction[inside]
    return through, x.size, work


def _entered_in_plane(length: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Where particles first meet a wall of the channel, and their angles to it."""
    passing = GEOMETRIES["channel"].passing(np.array(length))
    # the fraction that passes x without collision is uniform between its values at the ends
    fraction = 1.0 - (1.0 - passing) * rng.random(TOGETHER)
    x = 0.5 * (1.0 - fraction) * (1.0 + fraction) / fraction
    # at x the cosine of the angle is uniform above that of the ray from the opposite corner
    return x, 2.0 * np.arcsin(np.sqrt(rng.random(TOGETHER) * GEOMETRIES["channel"].beyond(x)))


def _turn(law: Law, angle: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    outgoing = reflected(law, np.pi - angle, rng)
    return 1.0 / np.tan(outgoing), outgoing


# Directions in space have components along the axis, across it in the wall, and along the normal into the interior.
def _entered_in_channel(length: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Where particles first meet a wall, and their directions; those that meet none are left out."""
    along, across, normal = _entering(rng)
    x = along * rng.random(TOGETHER) / np.abs(normal)
    return x[x < length], np.stack((along, across, -np.abs(normal)), axis=1)[x < length]


def _entered_in_tube(length: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    along, y, z = _entering(rng)
    # from the point (radius, 0) of the opening along (y, z) to the point (1 in length) of the wall
    radius, square = np.sqrt(rng.random(TOGETHER)), y * y + z * z
    time = (np.sqrt(square * (1.0 - radius) * (1.0 + radius) + (radius * y) ** 2) - radius * y) / square
    x, at_y, at_z = along * time, radius + time * y, time * z
    direction = np.stack((along, at_y * z - at_z * y, -(at_y * y + at_z * z)), axis=1)
    return x[x < length], direction[x < length]


def _entering(rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Directions of the cosine law about the axis: the component along it, and two others."""
    square, turn = rng.random(TOGETHER), 2.0 * np.pi * rng.random(TOGETHER)
    return np.sqrt(1.0 - square), np.sqrt(square) * np.cos(turn), np.sqrt(square) * np.sin(turn)


def _leave(law: DirectionLaw, section: Section, arriving: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Displacements along the axis after a reflection, and the directions in the frame of the next place."""
    outgoing = law.sample(arriving, rng)
    along, across, normal = outgoing.T
    # the chord of a circle meets it at both ends with the same components, but for the sign of the normal one
    time = 1.0 / normal if section == "channel" else 2.0 * normal / (across**2 + normal**2)
    return along * time, outgoing * [1.0, 1.0, -1.0]
