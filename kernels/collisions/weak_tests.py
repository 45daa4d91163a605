"""Lemma 5.1, measured: the collision of the true disk minus that on the cylinder, tested on pairs of functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import (
    Floats,
    Rng,
    finite_array,
    frozen,
    generator,
    positive_number,
    shaped,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import Summary, student_95
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...geometry import Disk, Wall, collide, collide_cylinder, trace
from ...geometry.collisions.configuration_space import ConfigurationSpace
from ...geometry.collisions.rigid import in_radii
from ..bases.measure import SINE, SINE_SQUARED
from .collision_law import StateFunction

# Two functions of a state, f(y, theta, psi) of the outcome and g(y, theta, psi) of the incoming state.
Pair = tuple[StateFunction, StateFunction]
# The rounding of positions in the window, as a fraction of the period, up to which entry points are spread evenly.
FINEST = 2.0**-10
# x1, alpha, theta, psi of a state, and the entry point of the limit law.
DIMENSIONS = 5


@dataclass(frozen=True, repr=False)
class WeakLimit(Summary):
    """The differences of three laws, tested on pairs of functions; arrays of shape (scales, pairs).

    Attributes
    ----------
    scales, spacings : array, shape (scales,)
        eps and rho.
    names : tuple of str
        One for every pair of functions.
    cylinder : array
        int int (K^{Sigma, eps} f - K_cyl f) g dy nu, where nu is the probability measure of the angles,
        sin(theta)/2 d theta (2/pi) sin(psi)^2 d psi.
    limit : array
        The same with the limit law K instead of K_cyl.
    cylinder_error, limit_error : array
        Half widths of intervals of 95 %, from independent repetitions. The error includes a bound for collisions that
        double precision does not resolve.
    unresolved : array, shape (scales,)
        Fraction of these collisions.
    collisions : int
        Number of collisions at each scale.
    """

    scales: Floats
    spacings: Floats
    names: tuple[str, ...]
    cylinder: Floats
    limit: Floats
    cylinder_error: Floats
    limit_error: Floats
    unresolved: Floats
    collisions: int


def _bump(position: Floats) -> Floats:
    """The product of cos(pi y/2)^2 over both coordinates y in (-1, 1), and 0 elsewhere."""
    inside = np.clip(position, -1.0, 1.0)
    return np.asarray(np.prod(np.cos(0.5 * math.pi * inside) ** 2, axis=-1))


def _tested(of_angles: Callable[[Floats, Floats], Floats | float]) -> Pair:
    def function(position: Floats, theta: Floats, psi: Floats) -> Floats:
        return np.asarray(_bump(position) * of_angles(theta, psi))

    return function, function


# Functions with compact support, continuous with their first derivatives.
PAIRS: dict[str, Pair] = {
    "1": _tested(lambda theta, psi: 1.0),
    "cos theta": _tested(lambda theta, psi: np.cos(theta)),
    "cos psi": _tested(lambda theta, psi: np.cos(psi)),
    "cos 2 theta sin psi": _tested(lambda theta, psi: np.cos(2.0 * theta) * np.sin(psi)),
}


@reported("weak limit")
def weak_limit(
    disk: Disk,
    wall: Wall,
    scales: ArrayLike,
    pairs: dict[str, Pair] | None = None,
    rng: Rng = None,
    *,
    window: float = 1.0,
    samples: int = 2**12,
    repetitions: int = 8,
) -> WeakLimit:
    r"""Test the law of the true disk against K_cyl and against its limit K on pairs of functions (Lemma 5.1).

    Parameters
    ----------
    disk : Disk
    wall : Wall
        A wall of segments and arcs, not foreshortened.
    scales : array_like, shape (n,)
        Values of eps, at least 2^-42 ``window``/``wall.period``.
    pairs : dict of (f, g), optional
        Continuous functions of states, vectorised: f(y, theta, psi), with y = (x1, alpha) of shape (n, 2) and x1 in
        radii of the disk. By default f = g = cos(pi x1/2)^2 cos(pi alpha/2)^2 h for x1 and alpha in (-1, 1), with four
        functions h of the angles.
    rng : None, int or numpy.random.Generator
    window : float
        g is taken as 0 where abs(x1) or abs(alpha) exceeds ``window``.
    samples, repetitions : int
        Collisions of one repetition, rounded up to a power of two, and independent repetitions, at least 2.

    Returns
    -------
    WeakLimit

    Raises
    ------
    InputError
        As in `geometry.collide`, and if a number is out of range.

    Notes
    -----
    Both laws are tested on the same points. The true disk at the angle alpha rests on the satellite number -k, with
    k rho the multiple of rho nearest to alpha. The law K_cyl depends on x1 + alpha modulo the period only, so it is
    evaluated at x1 minus k rho modulo the period, where both laws nearly agree. The integral over x1 is the same, and
    the variance is much smaller.

    Source: Rudzis 2022, section 5.2, Lemma 5.1 and eq. 3.40.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> found = ker.weak_limit(geo.Disk(), geo.triangular_teeth(1.2), [1e-3, 1e-5], rng=0, samples=256)
    >>> found.cylinder.shape, bool((abs(found.cylinder[1]) < abs(found.cylinder[0]) + 0.01).all())
    ((2, 4), True)
    >>> found.names[:2]
    ('1', 'cos theta')
    """

    eps = shaped("scales", np.atleast_1d(finite_array("scales", scales)), "n")
    if not eps.size:
        raise InputError("scales: expected one number or a list of numbers, got none")
    positive_number("window", window)
    power = math.ceil(math.log2(whole_number("samples", samples, 1)))
    whole_number("repetitions", repetitions, 2)
    tested = PAIRS if pairs is None else _checked(pairs)
    source = generator(rng)
    disk = in_radii(disk)
    spaces = [ConfigurationSpace(wall, disk, float(e)) for e in eps]
    least = EPS * window / (FINEST * wall.period)
    if eps.min() < least:
        raise InputError(
            f"scales: expected at least {least:.2g}, where positions resolve a period, got {eps.min():.2g}"
        )
    runs = np.empty((len(eps), repetitions, 2, len(tested)))
    unresolved, uncertainty = np.zeros(len(eps)), np.zeros((len(eps), len(tested)))
    for i, space in enumerate(spaces):
        for k in range(repetitions):
            found, missing, largest = _tested_once(space, list(tested.values()), window, power, source)
            runs[i, k] = found
            unresolved[i] += missing / repetitions
            uncertainty[i] += 2.0 * missing * largest / repetitions
    half = student_95(repetitions) * runs.std(axis=1, ddof=1) / math.sqrt(repetitions) + uncertainty[:, None]
    means = runs.mean(axis=1)
    return WeakLimit(
        scales=frozen(eps),
        spacings=frozen([space.spacing for space in spaces]),
        names=tuple(tested),
        cylinder=frozen(means[:, 0]),
        limit=frozen(means[:, 1]),
        cylinder_error=frozen(half[:, 0]),
        limit_error=frozen(half[:, 1]),
        unresolved=frozen(unresolved),
        collisions=repetitions * 2**power,
    )


def _checked(pairs: dict[str, Pair]) -> dict[str, Pair]:
    """The pairs; raises InputError if there are none or one is not a pair of functions."""
    known = isinstance(pairs, dict) and all(
        isinstance(pair, tuple) and len(pair) == 2 and all(map(callable, pair)) for pair in pairs.values()
    )
    if not known or not pairs:
        raise InputError(f"pairs: expected a dict of pairs (f, g) of functions by their names, got {shortened(pairs)}")
    return dict(pairs)


def _tested_once(
    space: ConfigurationSpace, pairs: Sequence[Pair], window: float, power: int, rng: np.random.Generator
) -> tuple[Floats, float, Floats]:
    """Both differences for every pair, shape (2, pairs); the unresolved fraction; the largest |f g| x volume."""
    from scipy.stats.qmc import Sobol

    disk, wall, scale = space.disk, space.wall, space.scale
    period = scale * wall.period
    uniform = np.clip(Sobol(DIMENSIONS, rng=rng).random_base2(power), 2.0**-54, 1.0 - 2.0**-53)
    reach = np.array([window + period, window])
    position = (2.0 * uniform[:, :2] - 1.0) * reach
    theta, psi = SINE.quantile(uniform[:, 2]), SINE_SQUARED.quantile(uniform[:, 3])
    velocity = -disk.from_angles(theta, psi)
    shifted = position.copy()
    lag = -space.charts.nearest(position[:, 1]) * space.charts.spacing
    shifted[:, 0] += lag - period * np.round(lag / period)
    true = collide(disk, wall, scale, position, velocity, space.spacing)
    straight = collide_cylinder(disk, wall, scale, shifted, velocity)
    target = wall.foreshorten(disk)
    limit = trace(target, target.period * uniform[:, 4], theta)
    resolved = true.escaped & straight.escaped & limit.escaped
    states = [
        (true.position, *_angles(disk, true.velocity, resolved)),
        (straight.position, *_angles(disk, straight.velocity, resolved)),
        (position, np.where(resolved, limit.theta, theta), math.pi - psi),
    ]
    places = [(at, np.all(np.abs(at) <= window, axis=-1)) for at in (position, shifted, position)]
    volume = 4.0 * float(np.prod(reach))
    found, largest = np.empty((2, len(pairs))), np.empty(len(pairs))
    for j, (f, g) in enumerate(pairs):
        weights = [np.where(inside, g(at, theta, psi), 0.0) for at, inside in places]
        terms = [np.where(resolved, f(*state) * weight, 0.0) for state, weight in zip(states, weights, strict=True)]
        found[:, j] = volume * np.mean(terms[0] - terms[1]), volume * np.mean(terms[0] - terms[2])
        largest[j] = volume * max(float(np.abs(term).max()) for term in terms)
    return found, 1.0 - float(resolved.mean()), largest


def _angles(disk: Disk, velocity: Floats, resolved: Any) -> tuple[Floats, Floats]:
    """Outgoing angles; those of unresolved collisions, which are not used, are pi/2."""
    upright = disk.from_angles(0.5 * math.pi, 0.5 * math.pi)
    theta, psi = disk.to_angles(np.where(resolved[:, None], velocity, upright))
    return theta, psi
