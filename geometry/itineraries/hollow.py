"""Conditional distributions of one hollow, computed from the itineraries of neighbouring angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import count_time, slices
from ..curves.columns import LEFT, RIGHT, RUN_SINE

if TYPE_CHECKING:
    from ..curves.columns import Struct
    from ..scene.scene import Scene

Result = TypeVar("Result")
# A ray is unresolved after MOST_COLLISIONS collisions.
MOST_COLLISIONS = 100_000
# No limit on the ray segments of one conditional distribution, or on the collisions of a ray in a channel.
NO_LIMIT = 2**62
# Rounds in which conditional distributions are recomputed because a neighbour has a piece that they missed.
MOST_ROUNDS = 8
# Steps between the angles of a round of one computation: about those of a panel at first, then their middles.
WIDEST_STEP, STEPS = 16, (8, 4, 2, 1)
# Angles whose pieces are compared at a time.
ANGLES_AT_ONCE = 64
# Changes of itinerary from which on a prediction takes less time than the rays that it saves.
MANY_CHANGES = 16
# Least distance of a sample from a predicted change, in the error of the change that the tolerance allows.
SAMPLE_DISTANCE = 0.1
# Critical angles per search, and the least width of their pieces as a fraction of the widest piece.
MOST_CUTS, CUT_FRACTION = 6, 0.1
# Nominal times of an incoming angle and of a ray, in seconds, beside this fraction of that of its segments.
ANGLE_TIME, RAY_TIME, SEGMENT_FRACTION = 2e-4, 3.5e-7, 0.55
# Samples per incoming angle, at irregular positions, so that no symmetry of the wall hides a piece from all samples.
FIRST_SAMPLES = 32
GOLDEN = 0.6180339887498949
# Shift of the positions per radian; any large number without pattern gives neighbouring angles other positions.
ANGLE_SHIFT = 12345.6789
# Further samples at each end of the opening, at geometrically decreasing distances from the end.
END_SAMPLES, END_RATIO = 10, 0.3
# Distance of the first and last sample from the ends, as a fraction of the tolerance or, times MARGIN, of the opening.
MARGIN = 1e-3
_NUMBERS = np.arange(FIRST_SAMPLES)
_ENDS = END_RATIO ** np.arange(1, END_SAMPLES + 1) / FIRST_SAMPLES


class Conditional(NamedTuple):
    """Outgoing angles, the widths of the opening that lead to them, the error of integrals, the unresolved width.

    Rays that do not escape count as retroreflected, and in the error.
    """

    nodes: Floats
    widths: Floats
    error: float
    unresolved: float


def _rounds(count: int) -> list[NDArray[np.int64]]:
    """The numbers of increasing angles in the order of their computation, in rounds.

    Every angle of a round lies in the middle between angles of earlier rounds, except in the first round.
    """
    number = np.arange(count)
    return [number[::WIDEST_STEP], *(number[step :: 2 * step] for step in STEPS if step < count)]


def first_nodes(theta: Floats, left: float, right: float, goal: Floats) -> Floats:
    """Return the positions of the first samples at incoming angles, shape (angles, samples), in any order.

    The positions differ from angle to angle, so that all angles together leave no large part of the rays unsampled.
    The positions accumulate at the ends of the opening, where the pieces of a smooth hollow become narrow.
    """
    whole, count = right - left, len(theta)
    shift = (theta * ANGLE_SHIFT % 1.0)[:, None]
    inside = (_NUMBERS + 0.25 + 0.5 * ((_NUMBERS * GOLDEN + shift) % 1.0)) / FIRST_SAMPLES
    ends = np.column_stack([np.tile(_ENDS * whole, (count, 1)), MARGIN * np.minimum(goal, MARGIN * whole)])
    return np.hstack((left + whole * inside, left + ends, right - ends))


def compiled_result(call: Callable[[], Result]) -> Result:
    """Return the result of a compiled call that may take seconds."""
    from ..scene.compiled.compiling import checked
    from ..tracing.threads import interruptibly

    return interruptibly(lambda: checked(call))


@dataclass
class HollowConditionals:
    """Conditional distributions of one hollow for one kind of functions; see `WallConditionals`.

    A piece narrower than the spacing of the samples can be missed at one angle and found at a neighbouring angle.
    Therefore each new conditional distribution is compared with its two neighbours.
    """

    scene: Scene
    hollow: int
    degree: int
    edges: Floats
    sizes: Floats
    least_level: int
    most_segments: int = NO_LIMIT
    cuts: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        self.rays, self.segments = 0, 0
        self._size = float(np.median(self.sizes))
        self._theta = np.empty(0)
        self._pieces: dict[float, Pieces] = {}
        self._missed: dict[float, list[float]] = {}
        self._critical: dict[tuple[int, float, float], float] = {}

    @property
    def width(self) -> float:
        """Width of the opening."""
        left, right = self.scene.hollows[self.hollow, [LEFT, RIGHT]]
        return float(right - left)

    @property
    def _setting(self) -> Struct:
        """Data of the compiled functions, new for each call: an interrupted call continues to use its own."""
        from .compiled.changes import setting_of

        scene = self.scene
        has_channels = len(scene.pairs) > 0
        has_runs = has_channels or bool(np.any(scene.arcs[:, RUN_SINE] > 0.0))
        most = NO_LIMIT if has_channels else MOST_COLLISIONS
        limits = most, has_runs, self.most_segments
        return setting_of(scene, self.hollow, limits, self.degree, self.edges, self.sizes)

    def march(self, theta: Floats, tolerances: Floats) -> tuple[dict[float, Conditional], set[float]]:
        """Conditional distributions at increasing angles, and the angles of earlier calls now known to miss a piece."""
        found_conditionals: dict[float, Conditional] = {}
        asked, outdated = set(theta.tolist()), set[float]()
        pending = np.ones(len(theta), dtype=np.bool_)
        for _ in range(MOST_ROUNDS):
            ordered = np.flatnonzero(pending)
            for chosen in _rounds(len(ordered)):
                own = ordered[chosen]
                found_conditionals.update(self._march_once(theta[own], tolerances[own]))
            missed = self._compare(theta[pending])
            outdated |= missed - asked
            pending = np.isin(theta, list(missed & asked))
            if not pending.any():
                break
        return found_conditionals, outdated

    def pieces(self, angle: float) -> Pieces:
        """The pieces at an angle at which conditional distributions were computed."""
        return self._pieces[angle]

    def trace(self, entries: Floats, angles: Floats, labels: NDArray[np.uint64]) -> tuple[Floats, set[float]]:
        """The outgoing angles of rays, and the angles of those with other labels than these, which miss a piece there.

        The entry points of the latter are noted.
        """
        from .compiled.changes import trace_points

        outs, found = np.empty(len(entries)), np.empty(len(entries), np.uint64)
        setting = self._setting
        compiled_result(lambda: trace_points(entries, angles, setting.address, outs, found))
        self.rays, self.segments = self.rays + len(entries), self.segments + int(setting.values.spent[0])
        missed = found != labels
        for angle, x in zip(angles[missed].tolist(), entries[missed].tolist(), strict=True):
            self._missed.setdefault(angle, []).append(x)
        return outs, set(angles[missed].tolist())

    def _march_once(self, theta: Floats, tolerances: Floats) -> dict[float, Conditional]:
        from .compiled.march import marched_angles, nested_rules

        # the width whose error is one tolerance
        least = tolerances * self.width / self._size
        seeds = self._seeds(theta, least)
        rules = nested_rules(self.least_level, self.cuts)
        marched = compiled_result(lambda: marched_angles(theta, tolerances, self._setting, rules, seeds))
        rays = sum(found.rays for found in marched)
        segments = sum(found.segments for found in marched)
        self.rays, self.segments = self.rays + rays, self.segments + segments
        of_segments = SEGMENT_FRACTION * segments * self.scene.segment_time
        count_time(of_segments + rays * RAY_TIME + len(theta) * ANGLE_TIME)
        found_conditionals = {}
        for angle, width, found in zip(theta.tolist(), least.tolist(), marched, strict=True):
            found_conditionals[angle] = Conditional(*found.nodes, found.error, found.unresolved)
            # at the limit of ray segments pieces are missing, and the error reports it: no comparison
            matters = np.inf if found.segments >= self.most_segments else width
            self._pieces[angle] = Pieces(angle, *found.pieces, matters)
        self._theta = np.union1d(self._theta, theta)
        return found_conditionals

    def _seeds(self, theta: Floats, least: Floats) -> list[Floats]:
        """Start samples at each angle, in increasing order.

        They include the points of missed pieces, and the changes of itinerary found before at this angle, else samples
        on both sides of the changes that are predicted from the neighbouring known angles.
        """
        from .compiled.changes import MOST_SAMPLES

        left, right = self.scene.hollows[self.hollow, [LEFT, RIGHT]].tolist()
        first, number = first_nodes(theta, left, right, least), np.searchsorted(self._theta, theta).tolist()
        seeds = []
        for angle, width, k, entries in zip(theta.tolist(), least.tolist(), number, list(first), strict=True):
            samples = [entries]
            if angle in self._missed:
                samples.append(np.array(self._missed[angle]))
            if angle in self._pieces:
                samples += [self._pieces[angle].low, self._pieces[angle].high]
            else:
                before, after = self._theta[max(0, k - 2) : k], self._theta[k : k + 2]
                known = [self._pieces[near] for near in (*before[-1:].tolist(), *after[:1].tolist())]
                if len(known) == 2 and min(len(pieces.label) for pieces in known) > MANY_CHANGES:
                    farther = [self._pieces[far] for far in (*before[:-1].tolist(), *after[1:].tolist())]
                    samples.append(samples_between(angle, (known[0], known[1]), farther, SAMPLE_DISTANCE * width))
                else:
                    samples += [pieces.middles(width) for pieces in known]
            together = np.sort(np.concatenate(samples))
            seeds.append(together[:: 1 + 2 * len(together) // MOST_SAMPLES])
        return seeds

    def _compare(self, theta: Floats) -> set[float]:
        """The angles among ``theta`` and their neighbours at which a piece was missed.

        The entry points tried at an angle are the middles of the pieces at a neighbouring one.
        """
        position = np.searchsorted(self._theta, theta)
        near = np.unique(np.clip(np.concatenate((position - 1, position, position + 1)), 0, len(self._theta) - 1))
        fresh = np.isin(near, position)
        compared = (np.diff(near) == 1) & (fresh[1:] | fresh[:-1])
        known = [self._pieces[angle] for angle in self._theta[near].tolist()]
        tried = [
            unlike_pieces(known[part.start : part.stop + 1], compared[part], 2.0 * self.width)
            for part in slices(len(compared), ANGLES_AT_ONCE)
        ]
        if not tried:
            return set()
        angles, entries, labels = (np.concatenate(column) for column in zip(*tried, strict=True))
        return self.trace(entries, angles, labels)[1]

    def shared(self, theta: Floats) -> Floats:
        """The fraction of the opening whose itinerary also exists at the next of these known angles."""
        known = [self._pieces[angle] for angle in theta.tolist()]
        return np.array([pieces.shared(after) for pieces, after in pairwise(known)]) / self.width

    def critical_angles(self, low: float, high: float) -> list[tuple[float, float]]:
        """Angles in (low, high) where a piece appears or disappears, with the piece's width at the nearest known angle.

        Only changes between two neighbouring known angles are found.
        """
        first = max(0, int(np.searchsorted(self._theta, low)) - 1)
        last = int(np.searchsorted(self._theta, high, side="right")) + 1
        angles = self._theta[first:last].tolist()
        found = []
        for before, after in pairwise(angles):
            for present, absent in ((before, after), (after, before)):
                there = set(self._pieces[absent].label.tolist())
                conditional = self._pieces[present]
                for k, label in enumerate(conditional.label.tolist()):
                    if label not in there and conditional.high[k] - conditional.low[k] > conditional.matters:
                        found.append((float(conditional.high[k] - conditional.low[k]), label, present, absent, k))
        found.sort(reverse=True)
        cuts = []
        for width, label, present, absent, k in found[:MOST_CUTS]:
            if width < CUT_FRACTION * found[0][0]:
                break
            angle = self._located(label, present, absent, k)
            if low < angle < high:
                cuts.append((angle, width))
        return cuts

    def _located(self, label: int, present: float, absent: float, k: int) -> float:
        from .compiled.changes import find_critical

        key = (label, min(present, absent), max(present, absent))
        for (name, low, high), angle in self._critical.items():
            if name == label and low <= angle <= high and key[1] <= angle <= key[2]:
                return angle
        conditional = self._pieces[present]
        low, high = float(conditional.low[k]), float(conditional.high[k])
        position = int(np.searchsorted(self._theta, present)) + (1 if absent < present else -1)
        drift = 0.0
        if 0 <= position < len(self._theta):
            beyond = float(self._theta[position])
            other = np.flatnonzero(self._pieces[beyond].label == np.uint64(label))
            if len(other) == 1:
                there = self._pieces[beyond]
                middle = 0.5 * float(there.low[other[0]] + there.high[other[0]])
                drift = (0.5 * (low + high) - middle) / (present - beyond)
        piece, setting = (np.uint64(label), present, absent, low, high, drift), self._setting
        angle = float(compiled_result(lambda: find_critical(*piece, setting.address)))
        self._critical[key] = angle
        return angle


# Mixes the labels on both sides of a change to its key; any odd number without pattern.
KEY_FACTOR = np.uint64(6364136223846793005)
# Distance of the samples on both sides of a predicted change from it: a fraction of the last term of the interpolation
# by a cubic, a parabola and a line. The remainder is smaller by a factor of the angles' distance; if the samples do not
# enclose the change, the search between its neighbours finds it.
CUBIC_UNCERTAINTY, PARABOLA_UNCERTAINTY, LINE_UNCERTAINTY = 0.1, 0.3, 0.05
# Multiple of the errors of known changes in a prediction, for a cubic in the middle of four, of weights 9/16 and -1/16.
KNOWN_UNCERTAINTY = 1.25


class Changes(NamedTuple):
    """Changes between pieces by the order of their keys, without keys that occur twice.

    Keys, positions, the errors of these, and the numbers of the pieces before them.
    """

    keys: NDArray[np.uint64]
    positions: Floats
    errors: Floats
    number: NDArray[np.int64]

    def places(self, keys: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The places of the changes with the keys, and whether there is such a change."""
        return _places(self.keys, keys)


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of one incoming angle in increasing order: their first and last positions, and their labels.

    ``out`` are the outgoing angles of the rays at the first positions, and ``matters`` is the width from which on a
    missed piece matters.
    """

    angle: float
    low: Floats
    high: Floats
    label: NDArray[np.uint64]
    out: Floats
    matters: float

    @cached_property
    def changes(self) -> Changes:
        """The changes between the pieces."""
        key = self.label[:-1] * KEY_FACTOR + self.label[1:]
        number = np.argsort(key)
        differs = np.ones(len(key) + 1, dtype=np.bool_)
        if len(key):
            ordered = key[number]
            differs[1:-1] = ordered[1:] != ordered[:-1]
        number = number[differs[:-1] & differs[1:]]
        before, after = self.high[number], self.low[number + 1]
        return Changes(key[number], 0.5 * (before + after), 0.5 * (after - before), number)

    def escaped(self) -> tuple[Floats, Floats]:
        """The widths of the pieces whose rays escape, with half of the gaps beside them, and their outgoing angles."""
        from .compiled.changes import FIRST_LABEL

        ends = np.concatenate([self.low[:1], 0.5 * (self.low[1:] + self.high[:-1]), self.high[-1:]])
        left = (self.label >= FIRST_LABEL) & (self.out >= 0.0)
        return np.diff(ends)[left], self.out[left]

    def middles(self, least: float, known: NDArray[np.int64] | None = None) -> Floats:
        """The middles of the pieces wider than ``least``, unless the changes at both ends are among the known ones."""
        ends = np.zeros(len(self.low) + 1, dtype=np.bool_)
        if known is not None:
            ends[[0, -1]] = ends[known + 1] = True
        wanted = (self.high - self.low > least) & ~(ends[:-1] & ends[1:])
        return np.asarray(0.5 * (self.low + self.high)[wanted])

    def shared(self, other: Pieces) -> float:
        """The total width of the pieces whose itinerary also exists at the other angle."""
        _, same = _places(np.sort(other.label), self.label)
        return float(np.sum((self.high - self.low)[same]))


def _places(ordered: NDArray[np.uint64], wanted: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The places of wanted numbers among increasing ones, and whether they are there; faster than `numpy.isin`."""
    if not len(ordered):
        return np.zeros(len(wanted), np.int64), np.zeros(len(wanted), np.bool_)
    place = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
    return place, ordered[place] == wanted


def unlike_pieces(known: list[Pieces], compared: NDArray[np.bool_], span: float) -> tuple[Floats, ...]:
    """Where a piece of an angle lies inside one with another label at the next or the last one, if it matters there.

    The angles of the latter pieces, the middles of the former, and the labels of the latter. Of each angle and the next
    it is told whether they are ``compared``. Positions in gaps are left out, because the error of the angle includes
    the gaps. ``span`` is above the distance of two positions.
    """
    low, high, label = (np.concatenate(parts) for parts in zip(*((p.low, p.high, p.label) for p in known), strict=True))
    count, matters = np.array([len(pieces.low) for pieces in known]), np.array([pieces.matters for pieces in known])
    owner, end = np.repeat(np.arange(len(known)), count), np.cumsum(count)
    middle, angle, found = 0.5 * (low + high), np.array([pieces.angle for pieces in known]), []
    increasing = high + span * owner
    for step, asked in ((1, np.append(compared, False)), (-1, np.append(False, compared))):
        own = np.flatnonzero(asked[owner])
        other = owner[own] + step
        inside = np.searchsorted(increasing, middle[own] + span * other, side="right")
        inside = np.clip(inside, end[other] - count[other], end[other] - 1)
        unlike = (high - low)[own] > matters[other]
        unlike &= (label[own] != label[inside]) & (low[inside] < middle[own]) & (middle[own] < high[inside])
        found.append((angle[other[unlike]], middle[own[unlike]], label[inside[unlike]]))
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))


def samples_between(angle: float, nearest: tuple[Pieces, Pieces], farther: list[Pieces], least: float) -> Floats:
    """Positions that enclose the changes at an angle between two known ones, in any order.

    A change present at both angles is interpolated, with the help of up to two farther angles. It gets one position on
    either side, at a distance of at least ``least`` divided by the number of changes. Pieces wider than ``least`` of
    which a change is not present at both angles get a position in their middle.
    """
    before, after = nearest[0].changes, nearest[1].changes
    place, same = after.places(before.keys)
    left, right, keys = before.number[same], after.number[place[same]], before.keys[same]
    unmatched = nearest[0].middles(least, left), nearest[1].middles(least, right)
    first, second = before.positions[same], after.positions[place[same]]
    known = KNOWN_UNCERTAINTY * np.maximum(before.errors[same], after.errors[place[same]])
    slope = (second - first) / (nearest[1].angle - nearest[0].angle)
    line, product = first + (angle - nearest[0].angle) * slope, (angle - nearest[0].angle) * (angle - nearest[1].angle)
    found, uncertainty = line, LINE_UNCERTAINTY * np.abs(second - first)
    bends = []
    for far in farther:
        place, same = far.changes.places(keys)
        there = far.changes.positions[place] if len(far.changes.keys) else np.full(len(keys), np.nan)
        there[~same] = np.nan
        bend = ((there - first) / (far.angle - nearest[0].angle) - slope) / (far.angle - nearest[1].angle)
        bends.append(bend)
        found = np.where(same, line + product * bend, found)
        uncertainty = np.where(same, PARABOLA_UNCERTAINTY * np.abs(product * bend), uncertainty)
    if len(bends) == 2:
        rate = (bends[1] - bends[0]) / (farther[1].angle - farther[0].angle)
        both = np.isfinite(rate)
        found = np.where(both, line + product * (bends[0] + (angle - farther[0].angle) * rate), found)
        uncertainty = np.where(both, CUBIC_UNCERTAINTY * np.abs(product * (bends[1] - bends[0])), uncertainty)
    uncertainty = np.maximum(uncertainty, least / max(1, len(keys))) + known
    return np.concatenate((found - uncertainty, found + uncertainty, *unmatched))
