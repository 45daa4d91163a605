"""What the tracer will do with a wall, and what it leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .wall import Wall


@dataclass(frozen=True)
class TracePlan:
    """How `trace` treats a wall.

    Attributes
    ----------
    primitives : tuple of str
        What the loop is compiled for, of "lines", "circles", "ellipses" and "beziers".
    hollows : int
        Openings that are traced separately, each against its own pieces only; 1 for an open wall.
    pieces_traced, pieces_left_out : int
        Pieces that rays are tested against, and flat tops, which are answered without tracing.
    flat_share : float
        Share of the period that is flat top.
    arcs_with_runs : int
        Circular arcs on which a run of hits is computed in one step.
    wraps : bool
        Whether rays pass from cell to cell, because the wall does not close its hollows.
    """

    primitives: tuple[str, ...]
    hollows: int
    pieces_traced: int
    pieces_left_out: int
    flat_share: float
    arcs_with_runs: int
    wraps: bool


def plan_of(wall: Wall) -> TracePlan:
    """Read the plan off the tables that the tracer uses."""
    scene = wall.scene
    pieces = len(wall.pieces) + sum(map(len, wall.islands))
    traced = sum(h.last - h.first for h in wall.hollows) if wall.closes else pieces
    runs = 0 if scene.circles is None else int((scene.circles[:, 10] > 0.0).sum())
    return TracePlan(
        primitives=scene.primitives,
        hollows=len(scene.hollows),
        pieces_traced=traced,
        pieces_left_out=pieces - traced,
        flat_share=wall.flat_top / wall.period if wall.closes else 0.0,
        arcs_with_runs=runs,
        wraps=scene.is_open,
    )
