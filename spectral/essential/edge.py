"""The edge of the essential spectrum of a law, and the law without the identity in it.

The part of a wall's law from rays that meet straight pieces only is a sum of isometries, whose edge is found by orbits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ...core.checks import Floats, instance
from ...core.estimates import ErrorKind, Summary, student_95, with_error
from ...core.long_runs import progress_bar
from ...geometry import Wall
from ...kernels import Bins, FacetedLaw, Law, WallLaw
from ...kernels.discretisation.radiosity import specular_sums
from ...kernels.laws.law import in_frame, is_identity, sum_of
from ...kernels.laws.structure import Rules, fold
from ...kernels.walls.conditionals import WallConditionals
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


# Outgoing angles closer than this are one node of an orbit.
SAME_NODE = 1e-8
# Errors of the weights on the first levels, on the last ones, and at the largest values.
ROUGH, FINE, FINEST = 1e-6, 1e-7, 1e-9
# Intervals in each of which the widest pieces that appear or disappear are looked for.
INTERVALS = 16
# Limit on the directions of lines through two joints, up to which all of the next neighbours are added.
MOST_DIRECTIONS = 128
# Number of initial angles, layers of an orbit, and limit on its nodes.
ANGLES, LAYERS, MOST_NODES = 96, 6, 60
# Isometries at an angle, in the mean, from which on orbits are not followed; then angles of the grid, iterations, and
# the least value of a function beside its largest.
MANY_ISOMETRIES, FINE_ANGLES, ITERATIONS, LEAST_VALUE = 8, 384, 64, 1e-3
# Search near the largest values: peaks, levels, rough levels, ratio of spacings, and the change that ends the search.
PEAKS, LEVELS, ROUGH_LEVELS, NEARER, SMALL_CHANGE = 4, 8, 3, 6, 1e-9
# Least and largest angle of an orbit.
LIMITS = 1e-6, np.pi - 1e-6
# Error as a multiple of the change by the last level plus the last layer, and its least value. In a chain of equal
# weights the layers beyond the sixth add 2.3 times as much as the sixth.
BEYOND, LEAST_ERROR = 3.0, 1e-9
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
    isometries = _Straight(law.wall)
    angle = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    axes = np.clip(np.append(_square_to_sides(law.wall), _along_joints(law.wall)), *LIMITS)
    first = isometries(angle, ROUGH)
    fraction = float(np.sin(angle) @ [each.weights.sum() for each in first] / np.sin(angle).sum())
    if np.mean([len(each.weights) for each in first]) > MANY_ISOMETRIES:
        low, high = _by_iteration(isometries, axes)
    else:
        low, high = _by_orbits(isometries, angle, axes, flat, bar)
    return StraightPart(max(fraction, flat), max(low, flat), min(max(high, low, flat), 1.0))


def _by_iteration(isometries: _Straight, others: Floats) -> tuple[float, float]:
    """An interval for the top of Q where orbits have too many nodes: <v, Q v>/<v, v> and sup Q v/v, for v = Q^n 1.

    Every such quotient is a lower bound, every such supremum an upper bound (Collatz and Wielandt); here they are those
    of a grid and of ``others``, with v linear in between.
    """
    grid = np.pi * (np.arange(FINE_ANGLES) + 0.5) / FINE_ANGLES
    theta = np.union1d(grid, others)
    on_grid = np.searchsorted(theta, grid)
    found = isometries(theta, ROUGH)
    owner = np.repeat(np.arange(len(theta)), [len(each.weights) for each in found])
    weights = np.concatenate([each.weights for each in found])
    outgoing = np.concatenate([each.outgoing for each in found])
    errors = np.array([each.error for each in found])
    v, low, high = np.ones(len(theta)), 0.0, np.inf
    for _ in range(ITERATIONS):
        image = np.bincount(owner, weights * np.interp(outgoing, theta, v), len(theta))
        high = min(high, float(np.max((image + errors) / v)))
        mass = np.sin(grid) * v[on_grid]
        whole, *halves = (
            float(mass[part] @ image[on_grid][part] / (mass[part] @ v[on_grid][part]))
            for part in (slice(None), slice(0, None, 2), slice(1, None, 2))
        )
        low = max(low, whole - abs(halves[0] - halves[1]) - float(errors.max()))
        v = image / image.max() + LEAST_VALUE
    return low, high


def _by_orbits(isometries: _Straight, angle: Floats, others: Floats, flat: float, bar: Any) -> tuple[float, float]:
    """An interval for the top of Q from the orbits of a grid, of other angles, and of angles near the largest roots."""
    candidates = np.append(angle, others)
    found = _largest_of_orbits(isometries, candidates, ROUGH, bar)
    if np.all(found.fractions <= flat + found.errors):
        # more straight rays would be fewer than the errors
        return flat, flat + float(found.errors.max())
    spacing, values, is_cut = np.pi / ANGLES, found.roots, found.is_cut
    axes = np.clip(np.append(_axes(candidates, found.reached), isometries.critical_angles()), *LIMITS)
    for level in range(LEVELS):
        peaks = _peaks(candidates, values, PEAKS if level == 0 else 2, 1.5 * spacing)
        # a peak that is steep on one side may be a whole spacing away from the largest value
        steps = spacing * np.linspace(-1.0, 1.0, 2 * NEARER + 1)
        spacing /= NEARER
        candidates = np.union1d(np.clip(peaks[:, None] + steps, *LIMITS), axes)
        before = values.max()
        found = _largest_of_orbits(isometries, candidates, ROUGH if level < ROUGH_LEVELS else FINE, bar)
        values, is_cut = found.roots, is_cut or found.is_cut
        axes = _peaks(axes, values[np.searchsorted(candidates, axes)], PEAKS, 0.0)
        # a cusp between two angles is higher by as much as the values next to the largest one are lower
        peak = int(np.argmax(values))
        steep = float(values[peak] - values[np.abs(candidates - candidates[peak]) <= 1.5 * spacing].min())
        change = abs(float(values[peak] - before))
        if level >= ROUGH_LEVELS and change + steep <= SMALL_CHANGE:
            break
    best = _largest_of_orbits(isometries, _peaks(candidates, values, 2, 0.0), FINEST, bar)
    top = int(np.argmax(best.roots))
    value, error = float(best.roots[top]), float(best.errors[top]) + LEAST_ERROR
    change += abs(value - float(values[peak]))
    low, high = value - error, value + BEYOND * (change + float(best.missing[top])) + steep + error
    if is_cut:
        least, most = _by_iteration(isometries, others)
        low, high = max(low, least), max(high, most)
    return low, high


def _square_to_sides(wall: Wall) -> Floats:
    """The angles at which rays hit a straight piece at right angles."""
    pieces = [piece for loop in (wall.pieces, *wall.islands) for piece in loop]
    sides = [np.subtract(piece.end, piece.start) for piece in pieces if piece.is_straight]
    return np.unique(np.mod(np.arctan2(*np.transpose(sides)[::-1]) + 0.5 * np.pi, np.pi))


def _along_joints(wall: Wall) -> Floats:
    """The directions of lines through two joints, first of neighbours: a deep channel is open for few angles only."""
    joints = np.concatenate([wall.cell.vertices, *wall.cell.island_vertices])
    found = [np.empty(0)]
    for apart in range(1, len(joints)):
        if sum(map(len, found)) > MOST_DIRECTIONS:
            break
        found.append(np.mod(np.arctan2(*(joints[apart:] - joints[:-apart]).T[::-1]), np.pi))
    return np.unique(np.concatenate(found))


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

    Of the eigenvalue the error by those of the weights; of these rays the fraction and outgoing angles. Whether an
    orbit has too many nodes.
    """

    roots: Floats
    missing: Floats
    errors: Floats
    fractions: Floats
    reached: list[Floats]
    is_cut: bool


class _Isometries(NamedTuple):
    """The weights and outgoing angles of the straight rays at one angle, with the error of the weights."""

    weights: Floats
    outgoing: Floats
    error: float


def _largest_of_orbits(isometries: _Straight, starts: Floats, tolerance: float, bar: Any) -> _Orbits:
    known: dict[int, _Isometries] = {}
    orbits = [_Orbit(float(theta)) for theta in starts]
    for layer in range(LAYERS):
        fresh = {node: angle for orbit in orbits for node, angle in orbit.last_layer() if node not in known}
        if fresh:
            found = isometries(np.array(list(fresh.values())), tolerance)
            known |= zip(fresh, found, strict=True)
        if layer < LAYERS - 1:
            for orbit in orbits:
                orbit.grow(known)
        bar.update()
    roots, before = (np.array([orbit.root(known, layers) for orbit in orbits]) for layers in (LAYERS, LAYERS - 1))
    straight = [known[_node(theta)] for theta in starts]
    return _Orbits(
        roots, roots - before, np.array([max(known[node].error for node in orbit.places) for orbit in orbits]),
        np.array([each.weights.sum() for each in straight]), [each.outgoing for each in straight],
        any(orbit.is_cut for orbit in orbits),
    )  # fmt: skip


class _Orbit:
    """The nodes that isometries reach from one angle: their angles, and how many there are after each layer."""

    def __init__(self, angle: float) -> None:
        self.places, self.angles, self.sizes, self.is_cut = {_node(angle): 0}, [angle], [0, 1], False

    def last_layer(self) -> list[tuple[int, float]]:
        """The nodes of the last layer, and their angles."""
        return list(zip(self.places, self.angles, strict=True))[self.sizes[-2] :]

    def grow(self, known: dict[int, _Isometries]) -> None:
        """Add the nodes that the last layer reaches, with those of the largest weights first if they are too many."""
        reached: dict[int, tuple[float, float]] = {}
        for node, _ in self.last_layer():
            for weight, out in zip(known[node].weights.tolist(), known[node].outgoing.tolist(), strict=True):
                if self._place(out) is None:
                    reached[_node(out)] = reached.get(_node(out), (0.0, out))[0] + weight, out
        room = MOST_NODES - len(self.places)
        self.is_cut |= len(reached) > room
        for node, (_, angle) in sorted(reached.items(), key=lambda item: -item[1][0])[:room]:
            if self._place(angle) is None:
                self.places[node] = len(self.angles)
                self.angles.append(angle)
        self.sizes.append(len(self.angles))

    def root(self, known: dict[int, _Isometries], layers: int) -> float:
        """The largest eigenvalue on the nodes of the first layers."""
        size = self.sizes[layers]
        matrix = np.zeros((size, size))
        roots = np.sqrt(np.sin(self.angles))
        for node, i in list(self.places.items())[:size]:
            for weight, out in zip(known[node].weights.tolist(), known[node].outgoing.tolist(), strict=True):
                if (j := self._place(out)) is not None and j < size:
                    matrix[i, j] += weight * roots[i] / roots[j]
        return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])

    def _place(self, angle: float) -> int | None:
        """The place of the node that is within rounding of an angle."""
        node = _node(angle)
        return next((self.places[other] for other in (node, node - 1, node + 1) if other in self.places), None)


def _node(theta: float) -> int:
    return round(theta / SAME_NODE)


class _Straight:
    """The rays of a wall that meet straight pieces only: tracing ends at the first curve."""

    def __init__(self, wall: Wall) -> None:
        self.conditionals = WallConditionals(wall, 0, np.empty(0), curves_absorb=True)

    def critical_angles(self) -> Floats:
        """Angles where the widest pieces appear or disappear between angles of earlier calls, of some intervals."""
        parts = np.linspace(*LIMITS, INTERVALS + 1)
        return np.concatenate([self.conditionals.critical_angles(low, high) for low, high in pairwise(parts.tolist())])

    def __call__(self, theta: Floats, tolerance: float) -> list[_Isometries]:
        """The isometries at some angles, with weights to a tolerance."""
        found, unresolved = self.conditionals(theta, tolerance)
        return [
            _Isometries(*self.conditionals.escaped(angle), float(found.error[k] + unresolved[k]))
            for k, angle in enumerate(theta.tolist())
        ]


def _has_straight_pieces_below(wall: Wall) -> bool:
    loops = [wall.pieces, *wall.islands]
    if wall.closes:
        loops = [wall.cell.pieces[hollow.first : hollow.last] for hollow in wall.hollows]
    return any(piece.is_straight for loop in loops for piece in loop)
