"""The scattering law and the resistance of a convex body with a rough boundary."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Rng,
    finite_array,
    finite_number,
    frozen,
    generator,
    positive_number,
    sequence,
    shaped,
    whole_number,
)
from ...core.errors import AsperityError, InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...core.given import Vectorised
from ...core.rounding import EPS
from ..bases.angles import bisected
from ..bases.basis import AngleFunction
from ..bases.measure import SINE
from ..laws.density import split_panels
from ..laws.law import Law, check_paper_frame
from ..matrices.defects import SymmetryDefect, defect_of_pairs
from .drag import PANELS, StreamForce, integral, normals_at_breakpoints, pushes, resistance, scaled

TURN = 2.0 * math.pi
# Equal steps of the direction between which a change of the law is sought, and changes of a law that does not vary
# continuously.
STEPS, MOST_CHANGES = 4096, 256
# Panels around the flat sides of an ellipse begin at this fraction of the directions of half of a side, and grow by it.
GRADING = 0.25
# Rounding of integrals along the boundary, and how far it may miss itself, relative to the perimeter.
ROUNDING, CLOSED = 4e-15, 1e-9
# The rule for a cost of one's own on each panel, and halvings of all panels.
(GAUSS_NODES, GAUSS_WEIGHTS), MOST_LEVELS = np.polynomial.legendre.leggauss(6), 5
# Cells of a panel in which normals are drawn uniformly; the error of their distribution function is below 1e-6.
CELLS = 256
QUADRATURE = "sums over sides, polynomials on panels of curves"
# Bins of directions in the test of symmetry.
DIRECTION_BINS = 24
# The measure sin(theta) d theta has the mass 2.
SINE_MASS = 2.0

DirectionCost = Callable[[Floats, Floats], Floats]
LawOfNormal = Callable[[float], Law]
RowsOf = Callable[[Law, Floats], Floats]
Laws: TypeAlias = "Law | Sequence[Law] | LawOfNormal"
Indices: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, eq=False, repr=False)
class RoughBody(Summary):
    r"""A convex body in the plane with a rough boundary, given by its normals and their reflection law.

    A particle with velocity -u that meets an element with outer normal n leaves with velocity u'. The scattering law
    is the measure nu(du du' dn) on triples of directions: the length of the boundary with this normal, times
    (u . n)_+ du, times the law P~ of u' given u in the frame of the element. It is symmetric in u and u' if P~ is
    reversible, as for every wall.

    Parameters
    ----------
    normals : array_like, shape (sides,)
        Directions of the outer normals of straight sides, radians; may be empty.
    lengths : array_like, shape (sides,)
        Lengths of the sides.
    law : Law, sequence of Laws, or callable
        P~, in the paper's convention, for example of a wall much finer than the body. For a body whose roughness
        changes along its boundary, one law for every side, or a function from the direction of the normal, in
        [0, 2 pi), to a law.
    radius : callable, optional
        The radius of curvature of the rest of the boundary, a vectorised function of the direction of the normal.
    breakpoints : array_like, optional
        Directions of normals at which law or radius are not smooth.

    Raises
    ------
    InputError
        If lengths are not positive or do not fit the normals, a radius is negative, the boundary does not close, or the
        law is in the specular frame.

    Notes
    -----
    Integrals along the boundary are computed on panels that are halved until their error meets the tolerance. Between
    the breakpoints, a strip of another law or radius is certainly found if it is wider than 0.02 in the direction of
    the normal, radians, and if the law is one of a few, if it is wider than 0.0016. The errors hold if narrower strips
    have their ends among the breakpoints.

    Source: Rudzis 2022, section 1.2.7, corrected: the resistance is the integral of c(u, u') against nu, which already
    contains (u . n)_+; A. Plakhov, "Exterior Billiards" (2012).

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> body = RoughBody.disk(ker.specular())
    >>> round(float(body.resistance(cost=lambda u, v: np.ones(np.broadcast(u, v).shape))) / np.pi, 12)
    4.0
    >>> round(3.0 * float(body.force(0.0).along), 9)          # a smooth disk: 8/3 along the stream
    8.0

    A stadium, whose straight sides have another law than its ends:

    >>> sides = np.pi * np.array([0.5, 1.5])
    >>> laws = lambda normal: ker.retroreflection() if normal in sides else ker.specular()
    >>> stadium = RoughBody(sides, [1.0, 1.0], laws, radius=np.ones_like)
    >>> round(3.0 * float(stadium.resistance()) / 8.0 - 2.0 * np.pi, 9)
    3.0
    """

    normals: Floats
    lengths: Floats
    law: Laws
    radius: AngleFunction | None = None
    breakpoints: ArrayLike = ()
    perimeter: Estimate = field(init=False, repr=False)
    # directions between which law and radius are smooth, and the laws, if they are few
    _edges: Floats = field(init=False, repr=False)
    _laws: tuple[Law, ...] = field(init=False, repr=False)

    _show = "law perimeter"

    def __post_init__(self) -> None:
        given = ("normals", "lengths", "breakpoints")
        arrays = [np.atleast_1d(finite_array(name, getattr(self, name))) for name in given]
        normals, lengths, cuts = (shaped(name, array, "n") for name, array in zip(given, arrays, strict=True))
        if normals.size != lengths.size:
            raise InputError(f"lengths: expected one for each of {normals.size} normals, got shape {lengths.shape}")
        if lengths.min(initial=1.0) <= 0.0:
            raise InputError(f"lengths: expected numbers greater than 0, got {lengths.min():g}")
        laws = self.law
        if not (isinstance(laws, Law) or callable(laws)):
            laws = sequence("law", laws, Law, "ker.lambertian()")
            if self.radius is not None or len(laws) != normals.size:
                raise InputError(
                    f"law: expected one, a function or {normals.size}, one for every side, got {len(laws)}"
                )
        self._set(normals=frozen(normals), lengths=frozen(lengths), breakpoints=frozen(cuts), law=laws)
        found, changes = self._changes()
        edges = np.concatenate((np.linspace(0.0, TURN, PANELS + 1), np.mod(cuts, TURN), changes))
        self._set(_laws=found, _edges=frozen(np.unique(edges)))
        (size, *miss), errors, _ = self._integral(_components, 4, 0.0, self._edges)
        if not np.hypot(*miss) <= CLOSED * size + errors[0] or size == 0.0:
            raise InputError(
                f"normals: expected the boundary of a body, got one of length {size:.3g} that misses itself by "
                f"{np.hypot(*miss):.3g}"
            )
        self._set(perimeter=Estimate(size, errors[0], "estimate", QUADRATURE))

    @classmethod
    def disk(cls, law: Laws, radius: float = 1.0, breakpoints: ArrayLike = ()) -> RoughBody:
        """A disk of the given radius."""
        return cls.ellipse(law, radius, radius, breakpoints)

    @classmethod
    def ellipse(cls, law: Laws, a: float, b: float, breakpoints: ArrayLike = ()) -> RoughBody:
        """An ellipse with the semi-axes a (along x1) and b."""
        a, b = positive_number("a", a), positive_number("b", b)
        ratio = min(a, b) / max(a, b)
        peak, near = (0.5 * np.pi if a > b else 0.0), max(ratio, EPS)
        graded = near * GRADING ** -np.arange(math.log(near) / math.log(GRADING) + 1.0)
        cuts = peak + np.concatenate([side + np.outer([-1.0, 1.0], graded).ravel() for side in (0.0, np.pi)])
        largest = max(a, b) * (max(a, b) / min(a, b))
        along, across = (np.sin, np.cos) if a > b else (np.cos, np.sin)
        # (a b)^2 / ((a cos n)^2 + (b sin n)^2)^(3/2), without products that overflow
        return cls(
            np.empty(0), np.empty(0), law, lambda n: largest * (ratio / np.hypot(ratio * along(n), across(n))) ** 3,
            np.append(cuts, finite_array("breakpoints", breakpoints)),
        )  # fmt: skip

    @classmethod
    def polygon(cls, law: Laws, vertices: ArrayLike) -> RoughBody:
        """A convex polygon with counterclockwise vertices, shape (n, 2)."""
        points = shaped("vertices", vertices, "n", 2)
        if len(points) < 3:
            raise InputError(f"vertices: expected at least three points, got {len(points)}")
        side = np.roll(points, -1, axis=0) - points
        after = np.roll(side, -1, axis=0)
        turn = np.arctan2(side[:, 0] * after[:, 1] - side[:, 1] * after[:, 0], np.sum(side * after, axis=1))
        if turn.min() < -CLOSED or turn.max() > math.pi - CLOSED or turn.sum() > 1.5 * TURN:
            raise InputError(
                "vertices: expected a convex polygon, its vertices once round against the clock, got turns from "
                f"{turn.min():.3g} to {turn.max():.3g} radians, in sum {turn.sum() / TURN:.3g} times 2 pi; for the "
                "hull of any points pass points[scipy.spatial.ConvexHull(points).vertices]"
            )
        return cls(np.arctan2(-side[:, 0], side[:, 1]), np.hypot(side[:, 0], side[:, 1]), law)

    def resistance(
        self, tolerance: float = 1e-8, *, cost: DirectionCost | None = None, directions: AngleFunction | None = None
    ) -> Estimate:
        r"""The integral of c(u, u') against nu; ``cost(u, v)`` of two directions in radians, by default 1 + u . u'.

        The default gives 8/3 times the perimeter times the resistance of the law, for a body of any shape; if the law
        changes along the body, the sum of these over its parts.

        Parameters
        ----------
        tolerance : float
            Wanted error of each law's mean, relative to the perimeter.
        cost : callable, optional
        directions : callable, optional
            The density of a measure chi of the directions u, in place of du: smooth and of period 2 pi.

        Examples
        --------
        With the density 1/(2 pi), the mean over all directions of a stream on a smooth disk, 8/3 r:

        >>> from asperity import kernels as ker
        >>> body = RoughBody.disk(ker.specular())
        >>> round(3 * float(body.resistance(directions=lambda u: 0 * u + 0.5 / np.pi)), 9)
        8.0
        """
        positive_number("tolerance", tolerance)
        known: dict[Hashable, Estimate] = {}

        def mean(law: Law, normals: Floats) -> Floats:
            if (key := _key(law)) not in known:
                known[key] = resistance(law, tolerance)
            return np.tile([[known[key].value], [known[key].error]], normals.size)

        size = float(self.perimeter)
        (value,), (error,), panels = self._integral(mean, 2, tolerance * size, self._edges)
        parts: Sequence[Estimate] = list(known.values())
        if cost is not None or directions is not None:
            # the momentum transfer along the stream
            chosen = Vectorised(cost or (lambda u, v: 1.0 + np.cos(v - u)), scalar=True)
            density = Vectorised(directions or (lambda direction: 1.0), scalar=True)
            value, error, parts = self._mean_cost(
                lambda u, v: chosen(u, v) * density(u), 0.75 * tolerance * size, panels
            )
        kind: ErrorKind = "bound" if self.radius is None and all(one.kind == "bound" for one in parts) else "estimate"
        return scaled(Estimate(value, error, kind, f"{parts[0].method}; {QUADRATURE}"), SINE_MASS / 0.75)

    def _mean_cost(
        self, cost: DirectionCost, tolerance: float, panels: Floats
    ) -> tuple[float, float, Sequence[Estimate]]:
        """The integral of 3/4 of the mean cost, its error and its parts, by rules on panels until two of them agree."""

        def part(law: Law, normals: Floats, lengths: Floats) -> Estimate:
            def averaged(theta: Floats, outgoing: Floats) -> Floats:
                total: Floats | float = 0.0
                for tangent, length in zip(normals - 0.5 * np.pi, lengths, strict=True):
                    total = total + 0.75 * length * cost(tangent + theta, tangent + outgoing)
                return np.asarray(total)

            return resistance(law, tolerance, cost=averaged)

        last = math.inf
        for level in range(MOST_LEVELS):
            normals, lengths = self._rule(split_panels(panels, 2**level))
            parts = [part(law, normals[here], weights) for law, here, weights in self._parts(normals, lengths)]
            value, error = math.fsum(one.value for one in parts), math.fsum(one.error for one in parts)
            missed, last = 2.0 * abs(value - last), value
            if missed <= max(tolerance, error):
                break
        return value, error + missed, parts

    def force(self, direction: float, tolerance: float = 1e-8) -> StreamForce:
        """The force on the body of a stream of particles with velocity -u, as components along and across -u.

        The unit is the stream's momentum flux; u has the angle ``direction``, radians. The component across is positive
        to the left of the stream. The wanted error is relative to the perimeter.
        """
        source, size = finite_number("direction", direction), float(self.perimeter)
        wanted = positive_number("tolerance", tolerance) * size
        cuts = np.concatenate([[-0.5 * np.pi, 0.5 * np.pi], *(normals_at_breakpoints(law, 0.0) for law in self._laws)])
        edges = np.unique(np.concatenate((self._edges, np.mod(source + cuts, TURN))))
        values, errors, _ = self._integral(lambda law, normal: pushes(law, normal - source, 0.0), 4, wanted, edges)
        along, across, _ = (Estimate(*one, "estimate", QUADRATURE) for one in zip(values, errors, strict=True))
        return StreamForce(along, across)

    def sample(self, n: int, rng: Rng = None) -> tuple[Floats, Floats, Floats]:
        """Directions u, u' and n of ``n`` independent triples drawn from nu, divided by its mass, in [0, 2 pi).

        On curves the distribution function of the normal has an error below 1e-6.
        """
        whole_number("n", n, 1)
        source = generator(rng)
        edges, sides = split_panels(self._edges, CELLS), self.normals.size
        lengths = self._rule(edges)[1]
        # the elements are the sides, then cells on curves
        weights = np.append(self.lengths, lengths[sides:].reshape(-1, GAUSS_NODES.size).sum(axis=1))
        element = source.choice(weights.size, size=n, p=weights / weights.sum())
        normal = np.append(self.normals, edges[:-1])[element]
        normal += np.append(np.zeros(sides), np.diff(edges))[element] * source.random(n)
        incoming, outgoing = SINE.sample(n, source), np.empty(n)
        laws = self._laws_at(normal, element)
        numbers = np.array([id(law) for law in laws])
        for number in np.unique(numbers):
            here = np.flatnonzero(numbers == number)
            outgoing[here] = laws[here[0]].sample(incoming[here], source)
        tangent = normal - 0.5 * np.pi
        u, v = (np.mod(tangent + angle, TURN) for angle in (incoming, outgoing))
        return u, v, np.mod(normal, TURN)

    def symmetry_defect(self, n: int, rng: Rng = None) -> SymmetryDefect:
        """How far nu is from symmetric in u and u', from ``n`` samples, with the z-score of the difference."""
        u, v, _ = self.sample(n, rng)
        scale = DIRECTION_BINS / TURN
        return defect_of_pairs(u * scale, v * scale, DIRECTION_BINS)

    def _integral(self, function: RowsOf, count: int, tolerance: float, edges: Floats) -> tuple[Floats, Floats, Floats]:
        """The `integral` along the boundary of a function of the law and normals, shape (count, normals)."""

        def rows(normals: Floats, lengths: Floats) -> Floats:
            found = np.zeros((normals.size, count))
            for law, here, weights in self._parts(normals, lengths):
                np.add.at(found, here, (weights * function(law, normals[here])).T)
            return found.T

        values, errors, panels = integral(lambda normals: rows(normals, self._radii(normals)), edges, tolerance)
        *sides, error = rows(self.normals, self.lengths).sum(axis=1)
        return values + np.array(sides), errors + error, panels

    def _parts(self, normals: Floats, lengths: Floats) -> list[tuple[Law, Indices, Floats]]:
        """The `parts` of the laws, where they are among sides or normals on curves, and lengths times weights there."""
        used = np.flatnonzero(lengths > 0.0)
        expanded: dict[int, list[tuple[float, Law, Hashable]]] = {}
        found: dict[Hashable, tuple[Law, list[int], list[float]]] = {}
        # the laws are kept, so that no other object has their number
        laws = self._laws_at(normals[used], used)
        for k, law in zip(used.tolist(), laws, strict=True):
            if id(law) not in expanded:
                expanded[id(law)] = [(weight, part, _key(part)) for weight, part in law.parts]
            for weight, part, key in expanded[id(law)]:
                _, here, weights = found.setdefault(key, (part, [], []))
                here.append(k)
                weights.append(weight)
        return [(law, np.array(here), np.array(weights) * lengths[here]) for law, here, weights in found.values()]

    def _laws_at(self, normals: Floats, sides: Indices) -> list[Law]:
        """The law of every normal; of sides with laws of their own the numbers tell which."""
        laws = self.law
        try:
            if callable(laws):
                each = [laws(normal) for normal in np.mod(normals, TURN).tolist()]
            else:
                each = [laws] * normals.size if isinstance(laws, Law) else [laws[k] for k in sides]
        except AsperityError:
            raise
        except (TypeError, ValueError) as reason:
            raise InputError(
                f"law: expected a function from the direction of a normal to a law, it failed: {reason}"
            ) from reason
        for law in each:
            check_paper_frame("law", law)
        return each

    def _changes(self) -> tuple[tuple[Law, ...], Floats]:
        """The laws along curves, and the normals between them; none if there are many, as of a continuous change."""
        at = np.asarray(TURN / STEPS * np.arange(STEPS), dtype=np.float64)
        none = np.empty(0, dtype=np.intp)
        laws = [] if self.radius is None else self._laws_at(at, none)
        keys = [_key(law) for law in laws]
        changed = [k for k, (key, after) in enumerate(pairwise(keys)) if key != after]
        if len(changed) > MOST_CHANGES:
            return (), np.empty(0)

        def unchanged(normals: Floats) -> NDArray[np.bool_]:
            return np.array(
                [_key(law) == keys[k] for k, law in zip(changed, self._laws_at(normals, none), strict=True)]
            )

        low = at[np.array(changed, dtype=np.intp)]
        return tuple(dict(zip(keys, laws, strict=True)).values()), bisected(low, low + at[1], unchanged)

    def _rule(self, edges: Floats) -> tuple[Floats, Floats]:
        """The sides, then Gauss nodes between the edges: normals and lengths."""
        width = np.diff(edges)[:, None]
        normals = (edges[:-1, None] + 0.5 * width * (1.0 + GAUSS_NODES)).ravel()
        lengths = (0.5 * width * GAUSS_WEIGHTS).ravel() * self._radii(normals)
        return np.append(self.normals, normals), np.append(self.lengths, lengths)

    def _radii(self, normals: Floats) -> Floats:
        if self.radius is None:
            return np.zeros(normals.size)
        found = finite_array("radius", Vectorised(self.radius, scalar=True)(normals))
        if found.min() < 0.0:
            raise InputError(f"radius: expected radii of curvature of at least 0, got {found.min():g}")
        return found


def _key(law: Law) -> Hashable:
    """Equal for laws that are known to be the same."""
    try:
        hash(law)
    except TypeError:  # of arrays
        return id(law)
    return law


def _components(law: Law, normals: Floats) -> Floats:
    """1 and the unit vector, with their rounding."""
    one = np.ones(normals.size)
    return np.stack([one, np.cos(normals), np.sin(normals), ROUNDING * one])
