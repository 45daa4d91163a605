"""The plan of a trace: pieces and hollows that are skipped, hollows in closed form, grids and symmetry."""

from __future__ import annotations

from dataclasses import dataclass

from ..cells.cell import Cell
from ..cells.hollow_shape import distinct_hollows
from .columns import FORM, GRID_COLUMNS, NO_FORM, PAIR_ANGLE, RUN_SINE
from .scene import Scene


@dataclass(frozen=True)
class TracePlan:
    """How `trace` treats a wall; made by ``wall.plan()``.

    Attributes
    ----------
    primitives : tuple of str
        What the wall has, of "lines", "circles", "ellipses" and "beziers".
    hollows : int
        Openings that are traced separately, each against its own pieces only; 1 for an open wall.
    pieces_traced, pieces_left_out : int
        Pieces that rays are tested against, and flat tops, which are answered without tracing.
    flat_share : float
        Share of the period that is flat top.
    arcs_with_runs : int
        Circular arcs on which a run of hits is computed in one step.
    channels, wedges : int
        Pairs of lines, parallel or not, that face each other with nothing in between: there, too, a run of hits is
        computed in one step. Wedges of more than 0.3 radians have no long runs and are not among them.
    closed_forms : int
        Hollows of two lines or of one circular arc whose rays are followed by a formula from the opening to the exit:
        wedges (lines that meet at more than 0.3 radians, their apex below the opening) and circular hollows (half
        angles from 0.05 to pi/2). Rays within 1e-9 of a corner are followed flight by flight there, too.
    hollows_with_grid : int
        Hollows of so many lines that rays walk through the cells of a grid; in the others every piece is tested.
    distinct_hollows : int
        Hollows that remain when those equal to another but for their position and size, to 64 rounding errors, are left
        out. The law of the wall is a mixture of theirs.
    mirror_symmetric : bool
        Whether the wall has a mirror axis: half of the angles then give the other half.
    wraps : bool
        Whether rays pass from cell to cell, because the wall does not close its hollows.

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
    """Read the plan of a wall that is its own cell off the tables that the tracer uses."""
    pieces = len(wall.pieces) + sum(map(len, wall.islands))
    traced = sum(h.last - h.first for h in wall.hollows) if wall.closes else pieces
    runs = 0 if scene.circles is None else int((scene.circles[:, RUN_SINE] > 0.0).sum())
    # every pair has a row for each of its two lines
    parallel = 0 if scene.pairs is None else int((scene.pairs[:, PAIR_ANGLE] == 0.0).sum()) // 2
    return TracePlan(
        primitives=scene.primitives,
        hollows=len(scene.hollows),
        pieces_traced=traced,
        pieces_left_out=pieces - traced,
        flat_fraction=wall.flat_top / wall.period if wall.closes else 0.0,
        arcs_with_runs=runs,
        wraps=scene.is_open,
        channels=parallel,
        wedges=0 if scene.pairs is None else len(scene.pairs) // 2 - parallel,
        closed_forms=0 if scene.closed is None else int((scene.closed[:, FORM] != NO_FORM).sum()),
        hollows_with_grid=int((scene.hollows[:, GRID_COLUMNS] > 0.0).sum()),
        distinct_hollows=len(distinct_hollows(wall)) if wall.closes else 1,
        mirror_symmetric=is_mirror_symmetric,
    )
