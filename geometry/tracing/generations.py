"""Rays into many generations of mushrooms, whose pieces are not listed: the mushroom of a ray is looked up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, broadcast, finite_array, read_only, whole_number
from ..walls.mushroom import checked_mushrooms, fewest_per_top, mushrooms
from ..walls.wall import Wall
from .tracing import MAX_COLLISIONS, Status, Trace, trace


@dataclass(frozen=True)
class MushroomGenerations:
    """The wall ``mushrooms(stem_to_cap, stem_aspect, generations)`` with any number of generations.

    Generation k + 1 divides every flat top of generation k into equal cells with mushrooms of the same proportions. The
    number of pieces grows exponentially. So no piece but those of one mushroom is stored: the mushroom that a ray
    enters is found from its position, in exact arithmetic, and the ray is traced in the mushroom of generation 1.

    Parameters
    ----------
    stem_to_cap : float
        s in (0, 1): the width of the stem over the width of the cap.
    stem_aspect : float
        a > 0: the length of the stem over its width; for one generation also 0.
    generations : int
        At least 1.

    Attributes
    ----------
    mushroom : Wall
        Generation 1, of period 1.
    per_top : int
        The number of mushrooms of the next generation in each flat top.
    opened : float
        1 - (1 - s)^generations, the fraction of the period that openings cover.

    Raises
    ------
    InputError
        If a parameter is out of range, or stems without length have more than one generation.

    Notes
    -----
    A flat top of width (1 - s)/2 holds floor((1 - s)(a s + 1/2)/(2 a s)) + 1 mushrooms, the fewest that fit strictly
    above the caps. As s, a and (1 - s)^generations tend to 0, the law tends to retroreflection (Rudzis 2022, section
    2.2.4, where it gives K_no-slip: section 2.3.4).

    Examples
    --------
    >>> wall = MushroomGenerations(0.25, 0.5, 2)
    >>> wall.per_top, wall.opened, MushroomGenerations(0.25, 0.5, 100).opened < 1.0
    (2, 0.4375, True)

    A ray above the stem of generation 1, and one above the first stem of generation 2, which is 3/16 wide:

    >>> wall.generation([0.5, 0.09375]).tolist(), wall.width(2)
    ([1, 2], 0.1875)
    """

    stem_to_cap: float
    stem_aspect: float
    generations: int

    def __post_init__(self) -> None:
        numbers = checked_mushrooms(self.stem_to_cap, self.stem_aspect, self.generations)
        for name, number in zip(("stem_to_cap", "stem_aspect", "generations"), numbers, strict=True):
            object.__setattr__(self, name, number)

    @cached_property
    def mushroom(self) -> Wall:
        return mushrooms(self.stem_to_cap, self.stem_aspect)

    @cached_property
    def per_top(self) -> int:
        return fewest_per_top(self.stem_to_cap, self.stem_aspect)

    @property
    def opened(self) -> float:
        return -math.expm1(self.generations * math.log1p(-self.stem_to_cap))

    @property
    def opening(self) -> tuple[float, float]:
        """The ends of the opening of ``mushroom``."""
        hollow = self.mushroom.hollows[0]
        return hollow.left, hollow.right

    def width(self, generation: int) -> float:
        """Return the width of a mushroom of the given generation, 1, ..., generations."""
        number = whole_number("generation", generation, 1)
        left, _ = self.opening
        return (left / self.per_top) ** (number - 1) if number > 1 else 1.0

    def generation(self, x: ArrayLike) -> NDArray[np.int64]:
        """Return the generation of the mushroom whose opening is at each position; 0 on a flat top."""
        numbers, _ = self._looked_up(np.ravel(finite_array("x", x)))
        return numbers.reshape(np.shape(x))

    def _looked_up(self, x: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Return generations, 0 on a flat top, and the positions in the mushroom of generation 1.

        Positions are ratios of integers: the map to the next generation magnifies a rounding error at least twofold.
        """
        left, right = (Fraction(end) for end in self.opening)
        unit = math.lcm(left.denominator, right.denominator)
        low, high = int(left * unit), int(right * unit)
        numbers, inside = np.zeros(len(x), dtype=np.int64), np.zeros(len(x))
        for row, start in enumerate(x):
            top, bottom = (float(start) % 1.0 if abs(start) < 2.0**52 else 0.0).as_integer_ratio()
            for number in range(1, self.generations + 1):
                # top/bottom against low/unit and high/unit
                scaled = top * unit
                if low * bottom <= scaled <= high * bottom:
                    numbers[row], inside[row] = number, top / bottom
                    break
                if scaled > high * bottom:
                    # from the right end of the stem on
                    scaled -= high * bottom
                top, bottom = (scaled * self.per_top) % (bottom * low), bottom * low
        return numbers, inside

    def trace(
        self, x: ArrayLike, theta: ArrayLike, *, max_collisions: int = MAX_COLLISIONS, threads: int | None = None
    ) -> Trace:
        """Reflect rays, as `geometry.trace` does for a wall; the period is 1.

        Parameters
        ----------
        x : array_like
            Entry points, finite.
        theta : array_like
            Incoming angles in (0, pi), radians.
        max_collisions, threads
            As in `geometry.trace`.

        Returns
        -------
        Trace
            If the mushroom is narrower than the distance of doubles next to x, the outgoing x rounds to the same double
            as many others; the angle is that of the position x, exactly as given.

        Examples
        --------
        A vertical ray along the axis of a mushroom returns on itself:

        >>> rays = MushroomGenerations(0.25, 0.5, 40).trace([0.5, 0.09375], 1.5707963267948966)
        >>> rays.x.tolist(), rays.collisions.tolist()
        ([0.5, 0.09375], [1, 1])
        """
        x_all, theta_all = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
        whole_number("max_collisions", max_collisions, 1)
        start, incoming = x_all.flatten(), theta_all.flatten()
        numbers, inside = self._looked_up(start)
        out_x, out_theta = start.copy(), np.pi - incoming
        collisions = np.ones(start.shape, dtype=np.int64)
        status = np.full(start.shape, Status.ESCAPED, dtype=np.uint8)
        entering = numbers > 0
        rays = trace(
            self.mushroom, inside[entering], incoming[entering], max_collisions=max_collisions, threads=threads
        )
        left, _ = self.opening
        widths = (left / max(self.per_top, 1)) ** (numbers[entering] - 1.0)
        out_x[entering] += widths * (rays.x - inside[entering])
        out_theta[entering], collisions[entering], status[entering] = rays.theta, rays.collisions, rays.status
        shape = x_all.shape
        results = (out_x.reshape(shape), out_theta.reshape(shape), collisions.reshape(shape), status.reshape(shape))
        return Trace(*map(read_only, results))
