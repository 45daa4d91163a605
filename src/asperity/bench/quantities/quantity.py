"""A quantity of the standard set: its problem on each wall, with methods and budgets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...spectral import WorkMethod

if TYPE_CHECKING:
    from ...geometry import Wall

# A method with its budgets, those of the quick set and those of the full one.
Methods = list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]
# Rays of sampling methods: the full ladder is long enough for orders to be told apart to 0.15.
QUICK_RAYS, RAYS = tuple(4.0**k for k in (6, 7, 8)), tuple(4.0**k for k in (5, 6, 7, 8, 9, 10))


@dataclass(frozen=True)
class Quantity:
    """A quantity of a wall.

    Attributes
    ----------
    name, summary : str
    methods : callable
        ``methods(wall)`` gives triples of a `WorkMethod` and its budgets (quick, full).
    scenes : tuple of str
        Scenes of the standard set for which it is measured.
    """

    name: str
    summary: str
    methods: Callable[[Wall], Methods]
    scenes: tuple[str, ...]
