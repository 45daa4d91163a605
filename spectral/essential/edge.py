"""The edge of the essential spectrum of a law, and the law without the identity in it.

The part of a wall's law from rays that meet straight pieces only is a sum of isometries, whose edge is found by orbits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, instance
from ...core.estimates import ErrorKind, Summary, student_95, with_error
from ...core.long_runs import progress_bar
from ...geometry import Wall
from ...kernels import Bins, FacetedLaw, Law, WallLaw
from ...kernels.discretisation.radiosity import specular_sums
from ...kernels.laws.law import in_frame, is_identity, sum_of
from ...kernels.laws.structure import Rules, fold
from ...kernels.walls.conditionals import WallConditionals, is_chaotic, is_few
from ...kernels.walls.wall_law import made_of_isometries
from .grazing import REMEMBERED, SWAP, GrazingLimit, grazing_limit

ROUNDING = 1e-15


@dataclass(frozen=True, repr=False)
class EssentialEdge(Summary):
    """An interval that contains the supremum of the essential spectrum.

    Attributes
    ----------
    low, high : float
        Ends of the interval, between 0 and 1; equal if the supremum follows from the structure of the law.
    kind : {"bound", "estimate"}
    reasons : tuple of str
    """

    low: float
    high: float
    kind: ErrorKind
    reasons: tuple[str, ...]

    @property
    def value(self) -> float:
        """The midpoint of the interval."""
        return 0.5 * (self.low + self.high)

    @property
    def error(self) -> float:
        """Half of the width of the interval."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class _Part:
    """The action of a law on fast oscillations and on functions of grazing angles."""

    # an interval for the top of the spectrum of its isometries Q; ``fraction`` is <1, Q 1>
    modulus: tuple[float, float]
    grazing: Floats
    error: float
    entry_error: float
    certain: bool
    notes: tuple[str, ...] = ()
    fraction: float = 0.0


def essential_edge(law: Law) -> EssentialEdge:
    r"""The supremum of the essential spectrum of a reversible law, as an interval.

    Parameters
    ----------
    law : Law

    Returns
    -------
    EssentialEdge

    Notes
    -----
    A law is the sum of a compact part and of two parts that are not compact. *Isometries*, theta' = +-theta + c: for
    suitable large n all n c are nearly multiples of 2 pi, so cos(n theta) times a slow function is mapped to
    cos(n theta) times a slow function. Therefore the whole spectrum of the isometric part Q, a sub-Markov operator, is
    essential; see `straight_part`. *Grazing rays*: see `grazing_limit`. Sums and products of laws have the sums and
    products of these symbols. The remainder is compact by a theorem for densities and matrices. For curved walls this
    assumes that the outgoing angle is a piecewise analytic function of the entry point, so the edge is an estimate.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> essential_edge(0.25 * ker.lambertian() + 0.75 * ker.TriangularTeethLaw(0.7)).value
    0.75
    """
    instance("law", law, Law, "ker.WallLaw(wall)")
    part = fold(law, ISOMETRIES) if made_of_isometries(law) else _taken_apart(law)
    matrix = part.grazing
    root = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])
    low = min(max(part.modulus[0], root - part.error), 1.0)
    high = min(max(part.modulus[1], root + part.error, low), 1.0)
    notes = tuple(dict.fromkeys(part.notes))
    if part.certain and part.modulus[0] == part.modulus[1] >= root - ROUNDING - part.error:
        # fast oscillations attain the norm of the part that is not compact
        low = high = min(part.modulus[0], 1.0)
    return EssentialEdge(low, high, "bound" if part.certain and low == high else "estimate", notes)


def grazing_symbol(law: Law) -> GrazingLimit:
    """The `grazing_limit` of a law, from sums and products of the limits of its parts."""
    part = _taken_apart(law)
    return GrazingLimit(part.grazing, part.error, part.entry_error)


def _taken_apart(law: Law) -> _Part:
    return fold(law, Rules(_leaf, _mixture, _chain, _in_other_frame))


def _leaf(law: Law) -> _Part:
    if law.is_compact:
        return _Part((0.0, 0.0), np.zeros((2, 2)), 0.0, 0.0, True, (f"{law!r} is compact",))
    if made_of_isometries(law):
        if law.retro is not None:
            return replace(_isometric(law), grazing=np.eye(2) if law.retro else SWAP)
        limit = grazing_limit(law)
        # the grazing limit of an isometric law matters in sums with other laws only
        return replace(_isometric(law), grazing=limit.matrix, error=limit.error, entry_error=limit.entry_error)
    limit = grazing_limit(law)
    if isinstance(law, FacetedLaw):
        return _of_facets(law, limit)
    errors = (limit.error, limit.entry_error)
    how = f"-> {with_error(limit.root, limit.error)} as theta -> 0 or pi"
    if not limit.resolved:
        how = "has no limit that can be told in double precision, so the essential spectrum may reach 1"
    elif limit.error == 0.0:
        how += ", by the shape of the wall at y = 0"
    note = f"{law!r}: grazing rays, E[sin(theta)/sin(theta')] {how}"
    if law.has_density:
        return _Part((0.0, 0.0), limit.matrix, *errors, False, (note, f"{law!r} has a density, taken as bounded"))
    if law.angle_map is not None and law.reversible:
        reason = f"{law!r} is an involution: f + f o T is kept for every f"
        return _Part((0.0, 1.0), limit.matrix, *errors, True, (reason,))
    modulus, fraction = (0.0, 0.0), 0.0
    notes = [note]
    if isinstance(law, WallLaw):
        straight = straight_part(law)
        modulus, fraction = (straight.low, straight.high), straight.fraction
        if straight.high > 0.0:
            reach = f"{modulus[0]:.6g}" if modulus[0] == modulus[1] else f"{modulus[0]:.6g} to {modulus[1]:.6g}"
            notes.append(
                f"a fraction {fraction:.4g} of the rays meets straight pieces only: isometries, whose part of the law "
                f"has a spectrum up to {reach}"
            )
    return _Part(modulus, limit.matrix, *errors, False, tuple(notes), fraction)


def _of_facets(law: FacetedLaw, limit: GrazingLimit) -> _Part:
    """The part of a wall with facets of their own: specular rays of weight (1 - a)^N, beside a compact rest."""
    errors = (limit.error, limit.entry_error)
    if law.diffuse_fraction is None or not law.wall.closes:
        what = (
            "facets that are not diffuse in part and else specular" if law.wall.closes else "a wall that does not close"
        )
        return _Part(
            (0.0, 1.0), limit.matrix, *errors, False, (f"{law!r}: {what}: the essential spectrum may reach 1",)
        )
    found = specular_part(law)
    note = (
        f"{law!r}: the essential spectrum is that of specular rays with the weight (1 - a)^N after N hits, a = "
        f"{law.diffuse_fraction:.6g}, because rays that a facet scatters are argued to add a compact operator: of "
        f"straight pieces it reaches {found.low:.6g} to {found.high:.6g}, at grazing "
        f"{with_error(limit.root, limit.error)}"
    )
    return _Part((found.low, found.high), limit.matrix, *errors, False, (note,), found.fraction)


def _isometric(law: Law) -> _Part:
    """The part of an isometric law, which has the edge 1, without its grazing limit."""
    note = f"{law!r} is made of isometries theta' = +-theta + const: cos(n theta) is nearly kept for suitable n"
    return _Part((1.0, 1.0), np.zeros((2, 2)), 0.0, 0.0, True, (note,), 1.0)


def _mixture(terms: Sequence[tuple[float, _Part]]) -> _Part:
    fraction = sum(w * part.fraction for w, part in terms)
    return _Part(
        # for positive operators the top of a sum is at least the top of each weighted term, and at least its fraction
        (max(fraction, *(w * part.modulus[0] for w, part in terms)), sum(w * part.modulus[1] for w, part in terms)),
        sum((w * part.grazing for w, part in terms), np.zeros((2, 2))),
        sum(w * part.error for w, part in terms),
        sum(w * part.entry_error for w, part in terms),
        all(part.certain for _, part in terms),
        tuple(note for _, part in terms for note in part.notes),
        fraction,
    )


def _chain(parts: Sequence[_Part]) -> _Part:
    whole = reduce(_product, parts, _Part((1.0, 1.0), np.eye(2), 0.0, 0.0, True, fraction=1.0))
    if parts and all(part is parts[0] for part in parts):
        # a power
        low, high = parts[0].modulus
        whole = replace(whole, modulus=(low ** len(parts), high ** len(parts)))
    return whole


def _product(first: _Part, second: _Part) -> _Part:
    fraction = first.fraction * second.fraction
    # a factor whose top is 1 does not change the top
    low = {(True, True): 1.0, (True, False): second.modulus[0], (False, True): first.modulus[0]}.get(
        (first.modulus[0] == 1.0, second.modulus[0] == 1.0), fraction
    )
    return _Part(
        (low, first.modulus[1] * second.modulus[1]),
        first.grazing @ second.grazing,
        # row sums are at most 1 plus the errors
        first.error + second.error + first.error * second.error,
        2.0 * (first.entry_error + second.entry_error + first.entry_error * second.entry_error),
        first.certain and second.certain,
        first.notes + second.notes,
        fraction,
    )


def _in_other_frame(part: _Part) -> _Part:
    return replace(part, grazing=part.grazing @ SWAP)


# The rules for laws made of isometries only, whose grazing limits are not needed.
ISOMETRIES = Rules(_isometric, _mixture, _chain, _in_other_frame)


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    return _without(law, is_identity)


def without_lambertian(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a L + (1 - a) R, if P is a sum with a Lambertian term; else 1 and P.

    Off the constants P is (1 - a) R.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_lambertian(0.75 * ker.lambertian() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    return _without(law, lambda term: term.is_lambertian)


def _without(law: Law, is_left_out: Callable[[Law], bool]) -> tuple[float, Law]:
    terms = [(weight, in_frame(term, law.frame)) for weight, term in in_frame(law, "paper").parts]
    rest = [(weight, term) for weight, term in terms if not is_left_out(term)]
    if len(rest) in (0, len(terms)):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, sum_of(tuple((weight / fraction, term) for weight, term in rest))


# Outgoing angles of two rays of one itinerary that are closer than this are those of an isometry, for a curved piece
# changes them. Of sampled rays the second one begins this step apart.
SAME_ANGLE, STEP = 1e-11, 1e-7
# Nodes that agree at least on a straight piece, whose rule has nine or more.
ALIKE = 5
# Outgoing angles closer than this are one node of an orbit.
SAME_NODE = 1e-8
# Errors of conditional distributions on the first levels, on the last ones, and at the largest values; and the numbers
# of rays where a direction takes more than so many ray segments, so that conditional distributions are slow.
ROUGH, FINE, FINEST, SLOW = 1e-6, 1e-7, 1e-9, 8_000
RAYS = {ROUGH: 2**8, FINE: 2**11, FINEST: 2**15}
# Bisections of the entry points where sampled rays change their isometry.
HALVINGS = 24
# Intervals in each of which the widest pieces that appear or disappear are looked for.
INTERVALS = 16
# Number of initial angles, layers of an orbit, and limit on its nodes.
ANGLES, LAYERS, MOST_NODES = 96, 6, 60
# Search near the largest values: peaks, levels, fine levels, ratio of spacings.
PEAKS, LEVELS, FINE_LEVELS, NEARER = 4, 5, 2, 6
# Least and largest angle of an orbit.
LIMITS = 1e-6, np.pi - 1e-6
# Error as a multiple of the change by the last level plus the last layer, and its least value.
BEYOND, LEAST_ERROR = 2.0, 1e-9
# Of specular rays between facets: points of each Sobol sequence, its seed, and numbers of bins of trial functions.
POINTS_OF_FACETS, SEED, CELLS = 2**15, (0,), (1, 32, 128, 512)


@dataclass(frozen=True)
class StraightPart:
    """The operator Q of the rays of a wall that meet straight pieces only, 0 <= Q <= P.

    Attributes
    ----------
    fraction : float
        <1, Q 1>, the probability of these rays.
    low, high : float
        An interval that contains the top of the spectrum of Q, all of which is essential. It is estimated, unless the
        ends are equal.
    """

    fraction: float
    low: float
    high: float


@lru_cache(maxsize=REMEMBERED)
def straight_part(law: WallLaw) -> StraightPart:
    r"""The operator Q of the rays that meet straight pieces only: its fraction and the top of its spectrum.

    Notes
    -----
    Q f(theta) = sum of q_k(theta) f(+-theta + c_k) is symmetric and positive. So is its restriction to the orbit of one
    angle under the isometries, a matrix with the entries q_k(theta) (sin(theta)/sin(theta'))^(1/2). The top of Q is the
    supremum over all orbits of the largest eigenvalues of these matrices, as functions near the points of an orbit
    show. Truncated orbits give lower values. The supremum is searched on a grid of angles and near its largest values.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> bowl = geo.Bezier([(0, 0), (0.5, -1), (1, 0)])
    >>> wall = geo.Wall([bowl, geo.Segment((1, 0), (2, 0))], period=2.0)
    >>> straight_part(WallLaw(wall))
    StraightPart(fraction=0.5, low=0.5, high=0.5)
    """
    flat = law.wall.flat_top / law.wall.period
    if not _has_straight_pieces_below(law.wall):
        return StraightPart(flat, flat, flat)
    with progress_bar(LAYERS * (2 + LEVELS), "layer", "essential edge") as bar:
        return _searched(law, flat, bar)


@lru_cache(maxsize=REMEMBERED)
def specular_part(law: FacetedLaw) -> StraightPart:
    r"""The isometries of a wall with facets a Lambertian + (1 - a) specular: rays that no facet scatters.

    Notes
    -----
    B f(theta) = E[(1 - a)^N f(theta')], with N hits of a specular ray. For straight pieces B is made of isometries, so
    its whole spectrum is essential. Its top is at least the quotient of any function: of constants, E[(1 - a)^N], and
    of the top function of a matrix from one half of the rays, with the other half. Since N >= 1 it is at most 1 - a.
    With curved pieces only the rays that meet straight ones alone count.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> found = specular_part(FacetedLaw(geo.triangular_teeth(0.9), ker.maxwell(0.2)))
    >>> 0.7 < found.low < found.high == 0.8
    True
    """
    wall, kept = law.wall, 1.0 - (law.diffuse_fraction or 0.0)
    if not wall.is_polygonal:
        flat = kept * wall.flat_top / wall.period
        return StraightPart(flat, flat, kept * straight_part(WallLaw(wall)).high)
    bounds, most = [], CELLS[-1]
    fine, _ = specular_sums(wall.cell, kept, Bins(most), POINTS_OF_FACETS, SEED)
    for cells in CELLS:
        each = most // cells
        parts = fine.reshape(-1, cells, each, cells, each).sum(axis=(2, 4)) / each
        seen, others = np.split(parts, 2)
        top = np.linalg.eigh(seen.sum(axis=0) + seen.sum(axis=0).T)[1][:, -1]
        quotients = others @ top @ top
        bounds.append(
            max(float(quotients.mean() - student_95(len(others)) * quotients.std(ddof=1) / np.sqrt(len(others))), 0.0)
        )
    return StraightPart(bounds[0], max(bounds), kept)


def _searched(law: WallLaw, flat: float, bar: Any) -> StraightPart:
    """The straight part of a wall with straight pieces below its top, of which a fraction is flat."""
    slow = not is_few(law.wall) or is_chaotic(law.wall, SLOW, FINE)
    isometries = _Sampled(law) if slow else _Distributions(law.wall)
    angle = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    candidates = np.append(angle, _square_to_sides(law.wall))
    found = _largest_of_orbits(isometries, candidates, ROUGH, bar)
    fraction = float(found.fractions[:ANGLES] @ np.sin(angle) / np.sin(angle).sum())
    if np.all(found.fractions <= flat + found.errors):
        # more straight rays would be fewer than the errors
        return StraightPart(max(fraction, flat), flat, min(flat + float(found.errors.max()), 1.0))
    spacing, values = np.pi / ANGLES, found.roots
    axes = np.clip(np.append(_axes(candidates, found.reached), isometries.critical_angles()), *LIMITS)
    for level in range(LEVELS):
        peaks = _peaks(candidates, values, PEAKS if level == 0 else 2, 1.5 * spacing)
        # a peak that is steep on one side may be a whole spacing away from the largest value
        steps = spacing * np.linspace(-1.0, 1.0, 2 * NEARER + 1)
        spacing /= NEARER
        candidates = np.union1d(np.clip(peaks[:, None] + steps, *LIMITS), axes)
        before, tolerance = values, FINE if level >= LEVELS - FINE_LEVELS else ROUGH
        found = _largest_of_orbits(isometries, candidates, tolerance, bar)
        values = found.roots
        axes = _peaks(axes, values[np.searchsorted(candidates, axes)], PEAKS, 0.0)
    best = _largest_of_orbits(isometries, _peaks(candidates, values, 2, 0.0), FINEST, bar)
    top = int(np.argmax(best.roots))
    change = abs(float(values.max() - before.max())) + abs(float(best.roots[top] - values.max()))
    # a cusp between two angles is higher by as much as the values next to the largest one are lower
    peak = int(np.argmax(values))
    near = np.abs(candidates - candidates[peak]) <= 1.5 * spacing
    steep = float(values[peak] - values[near].min())
    value, error = float(best.roots[top]), float(best.errors[top]) + LEAST_ERROR
    low, high = value - error, value + BEYOND * (change + float(best.missing[top])) + steep + error
    return StraightPart(max(fraction, flat), max(low, flat), min(max(high, flat), 1.0))


def _square_to_sides(wall: Wall) -> Floats:
    """The angles at which rays hit a straight piece at right angles."""
    pieces = [piece for loop in (wall.pieces, *wall.islands) for piece in loop]
    sides = [np.subtract(piece.end, piece.start) for piece in pieces if piece.is_straight]
    return np.unique(np.clip([np.mod(np.arctan2(y, x) + 0.5 * np.pi, np.pi) for x, y in sides], *LIMITS))


def _axes(starts: Floats, reached: list[Floats]) -> Floats:
    """Angles that an isometry c - theta keeps: c/2, and those at right angles to a straight piece.

    There an orbit and its mirror image meet, so that the largest eigenvalue has a cusp.
    """
    halves = np.concatenate([0.5 * (theta + np.unique(out)) for theta, out in zip(starts, reached, strict=True)])
    _, first, count = np.unique(np.rint(halves / SAME_NODE), return_index=True, return_counts=True)
    return np.asarray(np.clip(np.append(halves[first[count > 1]], starts[ANGLES:]), *LIMITS))


def _peaks(candidates: Floats, values: Floats, number: int, apart: float) -> Floats:
    """The angles of the largest values, no two of them closer than ``apart``."""
    chosen: list[float] = []
    for angle in candidates[np.argsort(-values, kind="stable")].tolist():
        if len(chosen) < number and all(abs(angle - other) > apart for other in chosen):
            chosen.append(angle)
    return np.array(chosen)


class _Orbits(NamedTuple):
    """For each initial angle the largest eigenvalue of its orbit, its change by the last layer, and its straight rays.

    Of the eigenvalue the error by those of conditional distributions; of these rays the fraction and outgoing angles.
    """

    roots: Floats
    missing: Floats
    errors: Floats
    fractions: Floats
    reached: list[Floats]


class _Isometries(NamedTuple):
    """The weights and outgoing angles of the straight rays at one angle, with the error of the weights."""

    weights: Floats
    outgoing: Floats
    error: float


class _Source(Protocol):
    """What finds the isometries of a wall at some angles, with weights to a tolerance."""

    def __call__(self, theta: Floats, tolerance: float) -> list[_Isometries]: ...

    def critical_angles(self) -> Floats:
        """Angles where pieces appear or disappear between angles of earlier calls."""


def _largest_of_orbits(isometries: _Source, starts: Floats, tolerance: float, bar: Any) -> _Orbits:
    known: dict[int, _Isometries] = {}
    orbits = [[_node(theta)] for theta in starts]
    angles = {_node(theta): float(theta) for theta in starts}
    roots = np.zeros((LAYERS, len(starts)))
    fresh = list(angles)
    for layer in range(LAYERS):
        if fresh:
            found = isometries(np.array([angles[node] for node in fresh]), tolerance)
            known |= zip(fresh, found, strict=True)
        fresh = []
        for k, orbit in enumerate(orbits):
            roots[layer, k] = _root(orbit, known, angles)
            new = _next_nodes(orbit, known, angles) if layer < LAYERS - 1 else []
            orbit.extend(new)
            fresh += [node for node in new if node not in known]
        fresh = list(dict.fromkeys(fresh))
        bar.update()
    straight = [known[_node(theta)] for theta in starts]
    return _Orbits(
        roots[-1], roots[-1] - roots[-2], np.array([max(known[node].error for node in orbit) for orbit in orbits]),
        np.array([each.weights.sum() for each in straight]), [each.outgoing for each in straight],
    )  # fmt: skip


def _next_nodes(orbit: list[int], known: dict[int, _Isometries], angles: dict[int, float]) -> list[int]:
    """The nodes that an orbit reaches, whose angles become known; none if they are too many."""
    reached = {_node(out): out for node in orbit for out in known[node].outgoing.tolist()}
    new = [node for node in reached if _index(node, orbit) is None]
    if len(orbit) + len(new) > MOST_NODES:
        return []
    for node in new:
        angles.setdefault(node, reached[node])
    return new


def _node(theta: float) -> int:
    return round(float(theta) / SAME_NODE)


def _index(node: int, orbit: list[int]) -> int | None:
    """The index of the first node of an orbit that is within rounding of a node."""
    return next((j for j, other in enumerate(orbit) if abs(other - node) <= 1), None)


def _root(orbit: list[int], known: dict[int, _Isometries], angles: dict[int, float]) -> float:
    """The largest eigenvalue on the nodes of an orbit."""
    matrix = np.zeros((len(orbit), len(orbit)))
    for i, node in enumerate(orbit):
        for weight, out in zip(known[node].weights, known[node].outgoing, strict=True):
            if (j := _index(_node(out), orbit)) is not None:
                matrix[i, j] += weight * np.sqrt(np.sin(angles[node]) / np.sin(angles[orbit[j]]))
    return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])


class _Distributions:
    """The parts of conditional distributions from straight pieces: nodes of a rule that agree, and a flat top."""

    def __init__(self, wall: Wall) -> None:
        self.conditionals = WallConditionals(wall, 1, np.empty(0))

    def critical_angles(self) -> Floats:
        """The critical angles of the widest pieces, in each of some intervals."""
        parts = np.linspace(*LIMITS, INTERVALS + 1)
        return np.concatenate([self.conditionals.critical_angles(low, high) for low, high in pairwise(parts.tolist())])

    def __call__(self, theta: Floats, tolerance: float) -> list[_Isometries]:
        found, unresolved = self.conditionals(theta, tolerance)
        listed = []
        for k, angle in enumerate(theta.tolist()):
            own = slice(found.starts[k], found.starts[k + 1])
            order = np.argsort(found.nodes[own])
            out, weight = found.nodes[own][order], found.weights[own][order]
            group = np.cumsum(np.append(True, np.diff(out) > SAME_ANGLE)) - 1
            weights, first = np.bincount(group, weight), np.searchsorted(group, np.arange(group[-1] + 1))
            # in intervals that are too narrow to be decided few nodes agree; these are in the error
            straight = (np.bincount(group) >= ALIKE) | (np.abs(out[first] - (np.pi - angle)) <= SAME_ANGLE)
            error = float(found.error[k] + unresolved[k])
            listed.append(_Isometries(weights[straight], out[first][straight], error))
        return listed


class _Sampled:
    """The same by rays, where conditional distributions have too many other itineraries.

    The error is that of itineraries which no ray takes: as many rays as take one alone would take these (Good).
    """

    def __init__(self, law: WallLaw) -> None:
        self.law = law

    def critical_angles(self) -> Floats:
        """None are known."""
        return np.empty(0)

    def __call__(self, theta: Floats, tolerance: float) -> list[_Isometries]:
        points = RAYS[tolerance]
        x = np.broadcast_to((np.arange(points) + 0.5) / points, (len(theta), points))
        out = self._straight(x.ravel(), np.repeat(theta, points)).reshape(len(theta), points)
        labels = _labels(out)
        row, entry = np.nonzero(np.abs(np.diff(labels, axis=1)) > 1)
        ends = x[row, entry], x[row, entry + 1], labels[row, entry], labels[row, entry + 1]
        changes = self._changes(theta[row], *ends)
        listed = []
        for k in range(len(theta)):
            own = row == k
            first = np.concatenate([[0], entry[own] + 1])
            here, width = out[k, first], np.diff(np.concatenate([[0.0], changes[own], [1.0]]))
            alone, finite = int(np.sum(np.diff(np.append(first, points)) == 1)), np.isfinite(here)
            listed.append(_Isometries(width[finite], here[finite], 2.0 * (1 + alone) / points))
        return listed

    def _changes(
        self, theta: Floats, low: Floats, high: Floats, before: NDArray[np.int64], after: NDArray[np.int64]
    ) -> Floats:
        """Where the label changes that is ``before`` at ``low``.

        A ray that meets a curved piece has the angle of an isometry with probability 0, so one ray tells a straight
        label.
        """
        curved = before == _labels(np.array([np.nan]))
        known = np.where(curved, after, before)
        for _ in range(HALVINGS if low.size else 0):
            middle = 0.5 * (low + high)
            same = (np.abs(_labels(self.law.reflect_with_status(middle, theta)[0]) - known) <= 1) != curved
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return 0.5 * (low + high)

    def _straight(self, x: Floats, theta: Floats) -> Floats:
        """Outgoing angles of the rays that meet straight pieces only, and nan for other rays."""
        here, there = (
            self.law.reflect_with_status(entry, theta)[0] for entry in (x, np.minimum(x + STEP, 1.0 - 2.0**-53))
        )
        return np.where(np.abs(here - there) <= SAME_ANGLE, here, np.nan)


def _labels(out: Floats) -> NDArray[np.int64]:
    """The nodes of outgoing angles, and one number for all other rays."""
    return np.rint(np.nan_to_num(out, nan=-1.0) / SAME_NODE).astype(np.int64)


def _has_straight_pieces_below(wall: Wall) -> bool:
    loops = [wall.pieces, *wall.islands]
    if wall.closes:
        loops = [wall.cell.pieces[hollow.first : hollow.last] for hollow in wall.hollows]
    return any(piece.is_straight for loop in loops for piece in loop)
