"""The reflection below a channel near grazing, on patches of incoming angles and entry points.

On a patch, the pieces of one itinerary at all nodes of a panel, the outgoing angle and the exit point at the channel's
lower end are analytic in two variables, the place within the piece and the place within the panel.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...core.checks import Floats
from ...geometry import Wall
from ...geometry.itineraries.hollow import HollowConditionals
from ...geometry.itineraries.patches import LEAST_RATIO, Strips, common_pieces, ends_of, interpolation, positions
from ...geometry.itineraries.pieces import Pieces
from ...geometry.scene.columns import LEFT, RIGHT
from ..bases.measure import SINE
from ..expectations.angle_panels import NODES, STRETCHED

# Numbers of the nested rules whose positions are tried in turn on a patch.
LEVELS = (2, 3, 4, 5)
# Fraction of the tolerance for the gaps between the pieces, and their least tolerance: the first sample must lie beyond
# the rounding of the corner.
GAP_FRACTION, LEAST_GAPS = 1e-3, 4e-12
# Least tolerance of a panel: the gaps, and the rounding of angles near pi.
LEAST_TOLERANCE = 2e-10
# Fraction of the tolerance for the interpolation within one patch.
PATCH_FRACTION = 0.2
# Angles below LOWEST are left out; their measure is 4e-12. There rays are within rounding of the corners.
LOWEST = 4e-6
# Ends of the first panels, and of the blocks of grazing angles, which are tried in turn. A block of more panels than
# FEW_PANELS, of more ray segments than FEW_SEGMENTS, or with a panel of more patches than MANY_PATCHES, at the
# tolerance PROBED ends the search. Near 0 panels are coarser, up to the error of a panel of measure FAIR_FRACTION.
FIRST_PANELS = (LOWEST, 2.5e-4, 2e-3, 1.5e-2, 0.1)
BLOCKS = (0.1, 0.2, 0.4, 0.6, 0.8)
FEW_PANELS, FEW_SEGMENTS, MANY_PATCHES, PROBED = 24, 800_000, 24, 1e-7
FAIR_FRACTION = 0.02
# Limit on the ray segments of one angle; mushrooms take 2,000.
SEGMENTS_AN_ANGLE = 20_000
# Limit on the panels, and their least width.
MOST_PANELS, NARROWEST, LEAST_CUT = 200, 1e-9, 1e-7
# The phase counts for rays that cross the channel at most this often.
MOST_CROSSINGS = 180.0
# Phases change sign at their crossings, so that an error of the position counts twice.
SIGN_CHANGE = 2.0

# The places of the nodes of a panel in (0, 1), their barycentric weights, and the last Legendre coefficients of the
# polynomial through values at the nodes.
PLACES = 0.5 * (1.0 + NODES)
WEIGHTS = np.array([1.0 / np.prod(4.0 * (x - np.delete(PLACES, k))) for k, x in enumerate(PLACES)])
WEIGHTS /= np.abs(WEIGHTS).max()
TAILS = np.linalg.inv(np.polynomial.legendre.legvander(NODES, len(NODES) - 1))[-2:]


class Patch(NamedTuple):
    """One itinerary at incoming angles between ``low`` and ``high``.

    ``ends``, shape (nodes, 2), are the ends of the piece at the nodes of the panel, ``outs`` and ``exits``, shape
    (nodes, positions), the outgoing angles and exit points at the positions of the nested rule ``level``. Points are in
    widths of the opening.
    """

    low: float
    high: float
    level: int
    ends: Floats
    outs: Floats
    exits: Floats


class PatchPanel(NamedTuple):
    """The patches of one panel, and the error of the mean of a function of size 1 and of a given slope."""

    low: float
    high: float
    patches: list[Patch]
    error: float

    @property
    def measure(self) -> float:
        """Measure of the panel."""
        return float(SINE.mass(np.array(self.low), np.array(self.high)))


def _without_corners(pieces: Pieces) -> tuple[Pieces, float]:
    """The pieces without those of rays that meet a corner, and the width of these; parts of one piece are joined."""
    from ...geometry.itineraries.compiled.changes import FIRST_LABEL

    escaped = pieces.label >= FIRST_LABEL
    low, high, label = pieces.low[escaped], pieces.high[escaped], pieces.label[escaped]
    begins = np.append(True, label[1:] != label[:-1])[: len(label)]
    first, last = np.flatnonzero(begins), np.flatnonzero(np.append(begins[1:], True)[: len(label)])
    joined = Pieces.at(pieces.angle, low[first], high[last], label[first], pieces.out[escaped][first], pieces.matters)
    return joined, float(np.sum((pieces.high - pieces.low)[~escaped]))


class BelowChannel:
    """The patches of the hollow below a channel, whose law is mirror-symmetric.

    Parameters
    ----------
    wall : Wall
        The hollow below the channel alone, see `channel_of`.
    height_to_width : float
        Height of the channel over its width.
    slope : float
        Bound of the slope of the functions whose means are wanted, of size 1.

    Attributes
    ----------
    highest : float
        The angles in (0, ``highest``) have few itineraries below the channel; 0 if there are none.
    """

    def __init__(self, wall: Wall, height_to_width: float, slope: float) -> None:
        self.hollow = HollowConditionals(wall.scene, 0, 0, np.empty(0), np.ones(1), 0, SEGMENTS_AN_ANGLE)
        self.height, self.slope = height_to_width, slope
        self.highest = self._last_block()

    def _last_block(self) -> float:
        """The end of the last of the blocks that few panels resolve."""
        last = 0.0
        for end in BLOCKS:
            edges = np.array(FIRST_PANELS if last == 0.0 else (last, end))
            found = self._divided(edges, PROBED, FEW_PANELS, probes=True)
            if not all(panel.error <= PROBED * self._fair(panel, end) for panel in found):
                break
            last = end
        return last

    def panels(self, tolerance: float) -> list[PatchPanel]:
        """Panels between 0 and ``highest``, with errors below the tolerance if few panels suffice."""
        edges = np.array([*FIRST_PANELS, *(end for end in BLOCKS[1:] if end <= self.highest)])
        return self._divided(edges, max(tolerance, LEAST_TOLERANCE), MOST_PANELS)

    def _divided(self, edges: Floats, tolerance: float, most: int, probes: bool = False) -> list[PatchPanel]:
        """Panels between the edges, divided at critical angles or in the middle until their errors are small.

        A probe ends with a panel of many patches, or after too many segments; its error is infinite then.
        """
        limit = self.hollow.segments + FEW_SEGMENTS
        todo, done, made = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)), [], 0
        while todo:
            low, high = todo.pop()
            panel = self._panel(low, high, tolerance)
            made += 1
            if probes and (len(panel.patches) > MANY_PATCHES or self.hollow.segments > limit):
                return [panel._replace(error=np.inf)]
            enough = made >= most or high - low < NARROWEST
            if enough or panel.error <= tolerance * self._fair(panel, float(edges[-1])):
                done.append(panel)
                continue
            margin = LEAST_CUT * (high - low)
            found = sorted(angle for angle, _ in self.hollow.critical_angles(low + margin, high - margin))
            cuts = [low, *(found or [0.5 * (low + high)]), high]
            todo += [(a, b) for a, b in pairwise(cuts) if b - a > margin]
        return sorted(done)

    @staticmethod
    def _fair(panel: PatchPanel, end: float) -> float:
        """The factor of the tolerance on a panel: more than 1 on one of small measure."""
        return max(1.0, FAIR_FRACTION * float(SINE.cdf(np.array(end))) / panel.measure)

    def _panel(self, low: float, high: float, tolerance: float) -> PatchPanel:
        """The patches on one panel."""
        angle = low + (high - low) * STRETCHED
        self.hollow.march(angle, np.full(len(angle), max(GAP_FRACTION * tolerance, LEAST_GAPS)))
        left, right = self.hollow.scene.hollows[0, [LEFT, RIGHT]].tolist()
        rows, flagged = zip(*(_without_corners(self.hollow.pieces(theta)) for theta in angle.tolist()), strict=True)
        label = np.concatenate([row.label for row in rows])
        ends = np.concatenate([ends_of(row, left, right) for row in rows])
        common = common_pieces(list(rows))
        number = np.zeros(len(common), np.int64)
        strips = Strips(np.tile(angle, (len(common), 1)), ends[common], label[common[:, 0]], number)
        covered = (np.sum(strips.ends[..., 2] - strips.ends[..., 1], axis=0) - flagged) / (right - left)
        # what is left out has a mean of at most 1 instead of 0
        error, patches = float(np.max(1.0 - covered)), []
        for k in range(len(common)):
            patch, doubt = self._patch(strips.chosen(np.array([k])), low, high, tolerance)
            patches.append(patch)
            error += doubt
        return PatchPanel(low, high, patches, error)

    def _patch(self, strip: Strips, low: float, high: float, tolerance: float) -> tuple[Patch, float]:
        """The patch of one strip, and its error times its width."""
        left, right = self.hollow.scene.hollows[0, [LEFT, RIGHT]].tolist()
        whole, ends = right - left, strip.ends[0][:, 1:3]
        width = float(np.max(ends[:, 1] - ends[:, 0])) / whole
        known, before, error = np.empty((2, len(NODES), 0)), np.inf, np.inf
        for level in LEVELS:
            place, _ = positions(level)
            entries = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * (place * place * (3.0 - 2.0 * place))
            angles = np.broadcast_to(strip.angle[0][:, None], entries.shape)
            outs, exits, labels = (
                array.reshape(entries.shape) for array in self.hollow.trace(entries.ravel(), angles.ravel())
            )
            both = np.stack((outs, (exits - left) / whole))
            wrong = labels != strip.label[0]
            for theta, x in zip(angles[wrong].tolist(), entries[wrong].tolist(), strict=True):
                self.hollow.miss(theta, x)
            if wrong.any():
                error = 1.0
                break
            if known.shape[2]:
                expected = known @ interpolation(*positions(level - 1), place[::2]).T
                difference = self._size(expected - both[..., ::2], strip.angle[0], both[0][..., ::2], place[::2])
                error = difference * min(max(difference / before, LEAST_RATIO), 1.0)
                before = difference
                if error * width <= PATCH_FRACTION * tolerance:
                    break
            known = both
        tails = np.abs(np.einsum("tk,pkj->ptj", TAILS, both)).max(axis=1)
        error += self._size(tails[:, None], strip.angle[0], both[0], place)
        moved = float(np.abs(TAILS @ ends).max()) / whole
        patch = Patch(low, high, level, (ends - left) / whole, both[0], both[1])
        return patch, SIGN_CHANGE * (error * width + moved)

    def _size(self, errors: Floats, angle: Floats, outs: Floats, place: Floats) -> float:
        """The largest error of the mean on a patch due to errors of the outgoing angle and of the exit point.

        An error of the phase moves its crossings of integers, a whole number of them a width of the piece together.
        """
        with np.errstate(divide="ignore"):
            of_phase = np.abs(errors[0]) * self.height / np.sin(outs) ** 2 + np.abs(errors[1])
        counts = self.height < MOST_CROSSINGS * np.tan(angle)
        density = 6.0 * place * (1.0 - place)
        return float(np.max(density * (self.slope * np.abs(errors[0]) + np.where(counts[:, None], of_phase, 0.0))))
