"""The plan of a trace: skipped pieces and hollows, hollows in closed form, grids and symmetry."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.estimates import Summary
from ..cells.cell import Cell
from ..cells.hollow_shape import distinct_hollows
from ..curves import columns as c
from .scene import Scene


@dataclass(frozen=True, repr=False)
class TracePlan(Summary):
    """The optimisations that `trace` applies to a wall; made by ``wall.plan()``.

    Attributes
    ----------
    primitives : tuple of str
        The kinds of pieces of the wall, from "lines", "circles", "ellipses" and "beziers".
    hollows : int
        Number of openings, each traced separately against its own pieces only; 1 for an open wall.
    pieces_traced, pieces_left_out : int
        Numbers of pieces that rays are tested against, and of flat tops, which need no tracing.
    flat_fraction : float
        Fraction of the period that is flat top.
    arcs_with_runs : int
        Number of circular arcs on which a run of hits is computed in one step.
    channels, wedges : int
        Numbers of parallel and of other pairs of lines that face each other with nothing in between. A run of hits
        between them is computed in one step. Wedges of more than 0.3 radians have no long runs and are not counted.
    closed_forms : int
        Number of hollows whose rays are computed by a formula from the opening to the exit: wedges (two lines that
        meet at more than 0.3 radians, apex below the opening) and circular hollows (one arc of half angle 0.05 to
        pi/2). Rays within 1e-9 of a corner are traced segment by segment.
    hollows_with_grid : int
        Number of hollows with so many lines that a tree of boxes selects the lines to test; elsewhere every piece is
        tested.
    distinct_hollows : int
        Number of hollows that differ by more than translation and scale, to 64 rounding errors. The law of the wall
        is a mixture of the laws of these hollows.
    mirror_symmetric : bool
        Whether the wall has a mirror axis; half of the angles then determine the other half.
    wraps : bool
        Whether rays pass from cell to cell because the wall does not close.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> plan = geo.rectangular_teeth(3.0).plan()
    >>> plan.pieces_left_out, plan.flat_fraction, plan.channels, plan.mirror_symmetric
    (1, 0.5, 1, True)
    >>> plan = geo.mushrooms(0.3, 0.5, 2).plan()
    >>> plan.hollows, plan.distinct_hollows, plan.arcs_with_runs
    (5, 1, 5)
    >>> geo.triangular_teeth(0.7).plan().closed_forms
    1
    """

    primitives: tuple[str, ...]
    hollows: int
    pieces_traced: int
    pieces_left_out: int
    flat_fraction: float
    arcs_with_runs: int
    wraps: bool
    channels: int
    wedges: int
    closed_forms: int
    hollows_with_grid: int
    distinct_hollows: int
    mirror_symmetric: bool


def plan_of(wall: Cell, scene: Scene, is_mirror_symmetric: bool) -> TracePlan:
    """Return the plan of a wall that is its own cell, read from the tables of the tracer."""
    pieces = len(wall.pieces) + sum(map(len, wall.islands))
    traced = sum(h.last - h.first for h in wall.hollows) if wall.closes else pieces
    runs = int((scene.arcs[:, c.RUN_SINE] > 0.0).sum())
    # every pair has two rows, one for each line
    parallel = int((scene.pairs[:, c.PAIR_ANGLE] == 0.0).sum()) // 2
    return TracePlan(
        primitives=scene.primitives,
        hollows=len(scene.hollows),
        pieces_traced=traced,
        pieces_left_out=pieces - traced,
        flat_fraction=wall.flat_top / wall.period if wall.closes else 0.0,
        arcs_with_runs=runs,
        wraps=scene.is_open,
        channels=parallel,
        wedges=len(scene.pairs) // 2 - parallel,
        closed_forms=int((scene.hollows[:, c.FORM] != c.NO_FORM).sum()),
        hollows_with_grid=int((scene.hollows[:, c.TREE_LEVELS] > 0.0).sum()),
        distinct_hollows=len(distinct_hollows(wall)) if wall.closes else 1,
        mirror_symmetric=is_mirror_symmetric,
    )
