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
from ...kernels.laws.structure import words_of
from .channel import LARGEST, in_paper_frame, reflected

Section = Literal["channel", "tube"]
Function: TypeAlias = Callable[[Floats], Floats]

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
    law: Law, length: float, section: Section = "channel", tolerance: float = 1e-4, rng: Rng = None
) -> Estimate:
    r"""The probability that a particle that enters a channel or a tube leaves it at the other end (Clausing).

    Particles enter at one end, uniformly over the opening and with the cosine law, as from a gas at rest.

    Parameters
    ----------
    law : Law
        The law of the walls, in either convention. In a channel the upper wall is the mirror image of the lower one. In
        a tube ``lambertian()`` and ``maxwell(a)`` mean the diffuse law and its mixture in space; other planar laws are
        refused.
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
        If an argument is not as described, the tube has other walls than these, a tube with these is longer than
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

    Retroreflecting walls pass what meets no wall:

    >>> print(f"{spec.transmission(ker.retroreflection(), 0.75, rng=0):.5f}")
    0.50000
    """
    paper, far = in_paper_frame(law), number_between("length", length, 0.0, LARGEST)
    choice("section", section, get_args(Section))
    wanted, source = positive_number("tolerance", tolerance), generator(rng)
    diffuse, geometry = _diffuse_fraction(paper), GEOMETRIES[section]
    if diffuse == 0.0:
        return Estimate(1.0, 0.0, "bound", "specular reflection keeps the direction along the axis")
    in_reach = far <= MOST_PANELS * PANEL_LENGTH * geometry.width
    if diffuse is not None and diffuse >= LEAST_DIFFUSE and in_reach:
        return _by_integral_equation(geometry, diffuse, far)
    if section == "channel":
        return _by_flights(paper, far, wanted, source)
    if diffuse is None:
        raise InputError(
            f"law: in a tube expected lambertian() or maxwell(a), because a planar law does not tell how its walls "
            f"reflect in space; got {law!r}, which section='channel' takes"
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
def _by_flights(law: Law, length: float, tolerance: float, rng: np.random.Generator) -> Estimate:
    """The fraction without collision, exactly, and of the others the fraction that leaves at the far end, by rays."""
    direct = float(GEOMETRIES["channel"].passing(np.array(length)))
    # 1 - direct, also for short channels
    colliding = direct * length * (1.0 + length / (1.0 + math.hypot(1.0, length)))
    through = particles = unresolved = work = 0
    value, error = math.nan, math.inf
    while error > tolerance and work < MOST_REFLECTIONS:
        passed, left, done = _flown(law, length, rng)
        particles, through, unresolved, work = particles + TOGETHER, through + passed, unresolved + left, work + done
        fraction, half = through / particles, 0.5 * unresolved / particles
        spread = NORMAL_95 * math.sqrt(fraction * (1.0 - fraction) / particles)
        # of particles that are still inside, none or all may leave at the far end
        value = direct + colliding * (fraction + half)
        error = colliding * (max(spread, RULE_OF_THREE / particles) + half)
    method = f"flights of {particles} particles" + f", {unresolved} of them still inside" * (unresolved > 0)
    return Estimate(value, error, "estimate", method)


def _flown(law: Law, length: float, rng: np.random.Generator) -> tuple[int, int, int]:
    """Of particles that meet a wall the numbers that leave at the far end and that stay inside, and the work done.

    The work is the number of reflections, those of few particles at a time counted as `LEAST_TOGETHER`.
    """
    passing = GEOMETRIES["channel"].passing(np.array(length))
    # the fraction that passes x without collision is uniform between its values at the ends
    fraction = 1.0 - (1.0 - passing) * rng.random(TOGETHER)
    x = 0.5 * (1.0 - fraction) * (1.0 + fraction) / fraction
    # at x the cosine of the angle is uniform above that of the ray from the opposite corner
    theta = 2.0 * np.arcsin(np.sqrt(rng.random(TOGETHER) * GEOMETRIES["channel"].beyond(x)))
    through = work = 0
    while x.size and work < MOST_REFLECTIONS:
        work += max(x.size, LEAST_TOGETHER)
        theta = reflected(law, np.pi - theta, rng)
        x = x + 1.0 / np.tan(theta)
        through += int(np.count_nonzero(x >= length))
        inside = (x > 0.0) & (x < length)
        x, theta = x[inside], theta[inside]
    return through, x.size, work
