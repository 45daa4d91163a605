"""Deterministic laws: measure-preserving involutions of (0, pi)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, finite_array
from ...core.errors import InputError
from ..bases.angles import clipped_inside
from ..bases.basis import AngleFunction
from ..bases.intervals import bisected
from ..bases.measure import SINE
from .distribution import Distribution
from .law import Law, RandomMap

PROBES = 4096
# Width of a probe pair in probability. Rounding of the map (1e-16 or so) then shows as 1e-10 in the slope.
PAIR_MASS = 1e-6
SLOPE_TOLERANCE = 1e-5
RETURN_TOLERANCE = 1e-9
# Pairs that straddle a jump of the map: with fewer than 10^4 jumps their fraction stays below this.
JUMP_FRACTION = 0.01
# Equal cells of the probability are hit by equally many probes, up to one probe at each side of a jump.
CELLS = 32
CELL_TOLERANCE = 0.25
# A measure-preserving map keeps measures of intervals; rounding of the map and of the measure stays below this.
JUMP_TOLERANCE = 1e-9


@dataclass(frozen=True)
class InvolutionLaw(Law):
    """The law theta' = T(theta) of a measure-preserving involution T.

    Reversibility forces T to be an involution: T(T(theta)) = theta and sin(theta) d theta is preserved.

    Parameters
    ----------
    map : callable
        Vectorised, from angles in (0, pi) to angles in (0, pi), radians.

    Raises
    ------
    InputError
        If, on 4096 probes, T leaves (0, pi), T(T(theta)) differs from theta by more than 1e-9, or T does not
        preserve sin(theta) d theta: it stretches probability anywhere but at isolated jumps, or fills a cell twice.

    Notes
    -----
    Source: Rudzis 2022, section 1.2.5, corrected: deterministic laws are measure-preserving *involutions*.

    Examples
    --------
    >>> law = InvolutionLaw(lambda theta: np.pi - theta)
    >>> float(law.apply(np.cos, np.pi / 3).round(15)), law.mirror_symmetric
    (-0.5, True)
    >>> InvolutionLaw(lambda theta: theta / 2)    # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: map: expected an involution, got T(T(theta)) = 0.779... at theta = 3.117...
    """

    map: Callable[[Floats], Floats]

    reversible = True
    exact_apply = True

    def __post_init__(self) -> None:
        if not callable(self.map):
            raise InputError(f"map: expected a function from angles to angles, got {self.map!r}")
        # An irrational offset keeps probes off jumps at rational fractions.
        fraction = (np.arange(PROBES) + np.sqrt(2.0) - 1.0) / PROBES
        theta, beside = SINE.quantile(fraction), SINE.quantile(fraction - PAIR_MASS)
        image = self._mapped(theta)
        self._check_return(theta, self._mapped(image))
        self._check_measure(theta, beside, image)
        mirrored = np.pi - self._mapped(np.pi - theta)
        object.__setattr__(self, "mirror_symmetric", bool(np.max(np.abs(mirrored - image)) <= RETURN_TOLERANCE))

    def _mapped(self, theta: Floats) -> Floats:
        image = finite_array("map", self.map(theta))
        if image.shape != theta.shape:
            raise InputError(f"map: expected a vectorised function, got shape {image.shape} for shape {theta.shape}")
        bad = (image < 0.0) | (image > np.pi)
        if bad.any():
            where = tuple(np.argwhere(bad)[0])
            raise InputError(
                f"map: expected angles in (0, pi), got {image[where]:.9g} at theta = {np.asarray(theta)[where]:.9g}"
            )
        return clipped_inside(image)

    def _check_return(self, theta: Floats, back: Floats) -> None:
        worst = int(np.argmax(np.abs(back - theta)))
        if abs(back[worst] - theta[worst]) > RETURN_TOLERANCE:
            raise InputError(
                f"map: expected an involution, got T(T(theta)) = {back[worst]:.9g} at theta = {theta[worst]:.9g}"
            )

    def _check_measure(self, theta: Floats, beside: Floats, image: Floats) -> None:
        stretch = np.abs(SINE.mass(self._mapped(beside), image)) / SINE.mass(beside, theta)
        wrong = np.abs(stretch - 1.0) > SLOPE_TOLERANCE
        cells = np.histogram(SINE.cdf(image), bins=CELLS, range=(0.0, 1.0))[0] * (CELLS / PROBES)
        if np.mean(wrong) > JUMP_FRACTION:
            worst = int(np.argmax(np.where(wrong, np.abs(np.log(np.maximum(stretch, 1e-300))), -1.0)))
            raise InputError(
                f"map: expected sin(theta) d theta to be preserved, got {stretch[worst]:.6g} times as much at theta = "
                f"{theta[worst]:.6g} ({int(wrong.sum())} of {PROBES} probes)"
            )
        if np.max(np.abs(cells - 1.0)) > CELL_TOLERANCE:
            raise InputError(
                f"map: expected sin(theta) d theta to be preserved, got {cells.min():.3g} to {cells.max():.3g} of what "
                f"each of {CELLS} equal cells should receive"
            )

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Where the map jumps or turns round, as far as 4096 probes show it."""
        return jumps_of_map(self.map), 0.0

    def distribution(self, theta: Floats, edges: Floats) -> Distribution:
        """The image is the one atom."""
        image = np.asarray(self.map(theta), dtype=np.float64)
        return Distribution.of_atoms(edges, clipped_inside(image)[:, None], np.ones((theta.size, 1)))

    def random_map(self) -> RandomMap:
        """The map, whatever the number."""
        return lambda x, theta: (np.asarray(self.map(theta), dtype=np.float64), None)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self._mapped(theta)

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        return np.asarray(function(self._mapped(theta)), dtype=np.float64)

    def __repr__(self) -> str:
        # the user's function, which may be any callable
        return f"InvolutionLaw({getattr(self.map, '__name__', repr(self.map))})"


def jumps_of_map(map_angle: Callable[[Floats], Floats]) -> Floats:
    """Where a measure-preserving map jumps or turns round: there the measure between two images changes."""
    probe = SINE.quantile((np.arange(PROBES) + 0.5) / PROBES)
    image = SINE.cdf(np.asarray(map_angle(probe), dtype=np.float64))
    broken = np.abs(np.abs(np.diff(image)) - SINE.mass(probe[:-1], probe[1:])) > JUMP_TOLERANCE
    low, high, start = probe[:-1][broken], probe[1:][broken], image[:-1][broken]

    def still_whole(middle: Floats) -> NDArray[np.bool_]:
        moved = np.abs(SINE.cdf(np.asarray(map_angle(middle), dtype=np.float64)) - start)
        return np.asarray(np.abs(moved - SINE.mass(low, middle)) <= JUMP_TOLERANCE)

    return bisected(low, high, still_whole)
