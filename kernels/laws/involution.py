"""Deterministic laws: measure-preserving involutions of (0, pi)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, finite_array
from ...core.errors import InputError
from ..bases.angles import clipped_inside
from ..bases.intervals import bisected
from ..bases.measure import SINE
from ..expectations.conditionals import Conditionals
from .law import Law, RandomMap

PROBES = 4096
# Width of a probe pair in probability. Rounding of the map by about 1e-16 then changes the slope by about 1e-10.
PAIR_MASS = 1e-6
SLOPE_TOLERANCE = 1e-5
RETURN_TOLERANCE = 1e-9
# Bound on the fraction of pairs with a jump of the map between them, for maps with fewer than 10^4 jumps.
JUMP_FRACTION = 0.01
# Cells of equal probability receive equal numbers of probes, up to one probe at each side of a jump.
CELLS = 32
CELL_TOLERANCE = 0.25
# Bound on the rounding error of the measure of an interval under a measure-preserving map.
JUMP_TOLERANCE = 1e-9


@dataclass(frozen=True)
class InvolutionLaw(Law):
    """The law theta' = T(theta) of a measure-preserving involution T.

    A reversible deterministic law has T(T(theta)) = theta and preserves sin(theta) d theta.

    Parameters
    ----------
    map : callable
        Vectorised function from angles to angles, both in (0, pi), in radians.

    Raises
    ------
    InputError
        If, on 4096 probes, T leaves [0, pi], T(T(theta)) differs from theta by more than 1e-9, or T does not preserve
        sin(theta) d theta: it stretches probability elsewhere than at isolated jumps, or fills cells unequally.

    Notes
    -----
    Source: Rudzis 2022, section 1.2.5, corrected: T must be an *involution*, not only measure-preserving.

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

    def __post_init__(self) -> None:
        if not callable(self.map):
            raise InputError(f"map: expected a function from angles to angles, got {self.map!r}")
        # With an irrational offset no probe hits a jump at a rational fraction.
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
        """The angles where the map jumps or reverses direction, as far as 4096 probes show them."""
        return jumps_of_map(self.map), 0.0

    def random_map(self) -> RandomMap:
        """The map T, independent of the uniform number."""
        return lambda x, theta: (np.asarray(self.map(theta), dtype=np.float64), None)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self._mapped(theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return Conditionals.of_atoms(self._mapped(theta)[:, None], np.ones((theta.size, 1)), 0.0)

    def __repr__(self) -> str:
        # The user's function may be any callable.
        return f"InvolutionLaw({getattr(self.map, '__name__', repr(self.map))})"


def jumps_of_map(map_angle: Callable[[Floats], Floats]) -> Floats:
    """The angles where a measure-preserving map jumps or reverses direction, found from the measure between images."""
    probe = SINE.quantile((np.arange(PROBES) + 0.5) / PROBES)
    image = SINE.cdf(np.asarray(map_angle(probe), dtype=np.float64))
    broken = np.abs(np.abs(np.diff(image)) - SINE.mass(probe[:-1], probe[1:])) > JUMP_TOLERANCE
    low, high, start = probe[:-1][broken], probe[1:][broken], image[:-1][broken]

    def still_whole(middle: Floats) -> NDArray[np.bool_]:
        moved = np.abs(SINE.cdf(np.asarray(map_angle(middle), dtype=np.float64)) - start)
        return np.asarray(np.abs(moved - SINE.mass(low, middle)) <= JUMP_TOLERANCE)

    return bisected(low, high, still_whole)
