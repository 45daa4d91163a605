"""The law of any number of generations of mushrooms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, instance
from ...geometry import MushroomGenerations
from ..expectations.conditionals import Conditionals
from ..laws.law import LARGEST, DrivenLaw, entry_points
from .conditionals import if_escaped, traced_reflection
from .wall_law import WallLaw


@dataclass(frozen=True)
class MushroomLaw(DrivenLaw):
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

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle for the entry point ``x`` in (0, 1), see `reflect_with_status`, and the angle ``theta``."""
        return if_escaped(self, *self.reflect_with_status(x, theta))

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Those of generation 1, with its flat tops reduced to those of the last generation."""
        left, right = self.wall.opening
        found = WallLaw(self.wall.mushroom)._conditionals(theta, tolerance, degree, edges)
        factor, level = self.wall.opened / (right - left), found.nodes == (np.pi - theta)[found.owner]
        weights = np.where(level, 0.0, factor * found.weights)
        # the flat top is the last node
        weights[found.starts[1:] - 1] = 1.0 - self.wall.opened
        return found._replace(weights=weights, error=factor * found.error)
