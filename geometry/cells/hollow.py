"""The hollows of a wall: each opening with the pieces below it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from ...core.checks import Floats
from ..curves.curve import Curve


@dataclass(frozen=True)
class Hollow:
    """One opening of a wall with the pieces below it.

    Parameters
    ----------
    left, right : float
        The opening is left < x < right at the level of the wall's highest points.
    first, last : int
        ``wall.cell.pieces[first:last]`` is the boundary of the hollow from its left end to its right end. A wall that
        begins at (0, 0), and no side or curve of which is cut in parts, is its own ``cell``.
    """

    left: float
    right: float
    first: int
    last: int

    @property
    def width(self) -> float:
        """The width of the opening."""
        return self.right - self.left


def flat_tops(pieces: Sequence[Curve], vertices: Floats) -> list[int]:
    """Return the indices of the pieces that run rightward along y = 0."""
    level = (vertices[:-1, 1] == 0.0) & (vertices[1:, 1] == 0.0) & (vertices[1:, 0] > vertices[:-1, 0])
    return [i for i in level.nonzero()[0].tolist() if pieces[i].is_straight]


def hollows_between(tops: Sequence[int], vertices: Floats) -> tuple[Hollow, ...]:
    """Return the hollows of a closed wall: the chains of pieces between flat tops, cut at joints at height 0.

    Only joints with x strictly between the ends of a chain cut it. The other joints at height 0 belong to pieces that
    run back below a flat top (a plate of zero thickness).
    """
    found: list[Hollow] = []
    count = len(vertices) - 1
    edges = [-1, *tops, count]
    touching = vertices[:, 1] == 0.0
    for before, after in pairwise(edges):
        first, last = before + 1, after
        if first == last:
            continue
        left, right = float(vertices[first, 0]), float(vertices[last, 0])
        for joint in (first + 1 + touching[first + 1 : last].nonzero()[0]).tolist():
            x = float(vertices[joint, 0])
            if left < x < right:
                found.append(Hollow(left, x, first, joint))
                left, first = x, joint
        if left < right:
            found.append(Hollow(left, right, first, last))
    return tuple(found)
