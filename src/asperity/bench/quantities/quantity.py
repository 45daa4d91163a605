"""A quantity of the standard set: its problem on each wall, with methods and budgets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...geometry import Wall
from ...spectral import WorkMethod

# Methods with their budgets in the quick set and in the full set.
Methods = list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]
# Numbers of rays of sampling methods; the full ladder resolves orders to 0.15.
QUICK_RAYS, RAYS = tuple(4.0**k for k in (6, 7, 8)), tuple(4.0**k for k in (5, 6, 7, 8, 9, 10))


@dataclass(frozen=True)
class Quantity:
    """A quantity of a wall.

    Attributes
    ----------
    name : str
    methods : callable
        ``methods(wall)`` returns triples of a `WorkMethod` and its budgets (quick, full).
    scenes : tuple of str
        Scenes of the standard set on which the quantity is measured.
    """

    name: str
    methods: Callable[[Wall], Methods]
    scenes: tuple[str, ...]
