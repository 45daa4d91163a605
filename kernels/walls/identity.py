"""A digest that tells laws apart, walls to the last bit of their pieces."""

from __future__ import annotations

import hashlib

from ...geometry import Wall
from ..laws.law import Law
from ..laws.structure import Rules, fold
from .polygon import PolygonLaw
from .wall_law import WallLaw


def law_digest(law: Law) -> str:
    """Sixteen hexadecimal digits; of laws other than those of walls from what they are printed as.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> first, second = (WallLaw(geo.mushrooms(s, 0.5, 1)) for s in (0.2, 0.2000001))
    >>> law_digest(first) == law_digest(first), law_digest(first) == law_digest(second)
    (True, False)
    """
    words = fold(
        law,
        Rules(_leaf, lambda terms: f"sum{terms!r}", lambda parts: f"chain{parts!r}", lambda part: f"turned({part})"),
    )
    return hashlib.sha256(words.encode()).hexdigest()[:16]


def wall_digest(wall: Wall) -> str:
    """Sixteen hexadecimal digits that tell walls apart, to the last bit of their pieces."""
    return hashlib.sha256(_words(wall).encode()).hexdigest()[:16]


def _leaf(law: Law) -> str:
    return _words(law.wall) if isinstance(law, (WallLaw, PolygonLaw)) else repr(law)


def _words(wall: Wall) -> str:
    return repr((wall.period, wall.pieces, wall.islands))
