"""The scattering law and the resistance of a convex body with a rough boundary."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, finite_array, finite_number, frozen, generator, positive_number, whole_number
from ...core.errors import AsperityError, InputError
from ...core.estimates import Estimate, Summary
from ...core.rounding import EPS
from ..bases.basis import AngleFunction
from ..bases.given import Vectorised
from ..bases.intervals import bisected
from ..bases.measure import SINE
from ..laws.density import split_panels
from ..laws.law import Law
from ..matrices.defects import SymmetryDefect, defect_of_pairs
from .drag import StreamForce, resistance, scaled
from .spinning_disk import NODES, PANELS, SAFETY, WEIGHTS, integral, normals_at_breakpoints, pushes

TURN = 2.0 * math.pi
# Equal steps of the direction between which a change of the law is sought, and changes of a law that does not vary
# continuously.
STEPS, MOST_CHANGES = 4096, 256
# Panels around the flat sides of an ellipse begin at this fraction of the directions of half of a side, and grow by it.
GRADING = 0.25
# Rounding of integrals along the boundary, and how far it may miss itself, relative to the perimeter.
ROUNDING, CLOSED = 4e-15, 1e-9
# Halvings of all panels for a cost of one's own.
MOST_LEVELS = 5
# Margin for the largest radius of curvature between the nodes of a panel.
MARGIN = 1.25
# Bins of directions in the test of symmetry.
DIRECTION_BINS = 24
# The measure sin(theta) d theta has the mass 2.
SINE_MASS = 2.0

DirectionCost = Callable[[Floats, Floats], Floats]
LawOfNormal = Callable[[float], Law]
Rows = Callable[[Floats], Floats]
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
        normals = np.atleast_1d(finite_array("normals", self.normals))
        lengths = np.atleast_1d(finite_array("lengths", self.lengths))
        if normals.shape != lengths.shape or normals.ndim != 1:
            raise InputError(f"lengths: expected one for each of {normals.size} normals, got shape {lengths.shape}")
        if lengths.size and lengths.min() <= 0.0:
            raise InputError(f"lengths: expected numbers greater than 0, got {lengths.min():g}")
        if self.radius is None and not normals.size:
            raise InputError("normals: expected at least one, or a radius of curvature")
        if not (isinstance(self.law, Law) or callable(self.law)) and np.iterable(self.law):
            object.__setattr__(self, "law", tuple(self.law))
            if self.radius is not None or len(self.law) != normals.size:
                fit = f"{normals.size}, one for every side" if self.radius is None else "a function of the normal"
                raise InputError(f"law: expected one or {fit}, got {len(self.law)}")
        object.__setattr__(self, "normals", frozen(normals))
        object.__setattr__(self, "lengths", frozen(lengths))
        cuts = np.unique(np.mod(np.atleast_1d(finite_array("breakpoints", self.breakpoints)), TURN))
        object.__setattr__(self, "breakpoints", frozen(cuts))
        laws, changes = self._changes()
        object.__setattr__(self, "_laws", laws)
        cuts = np.unique(np.concatenate((np.linspace(0.0, TURN, PANELS + 1), cuts, changes)))
        object.__setattr__(self, "_edges", frozen(cuts))
        (size, *gap), errors, _ = self._integral(_components, 0.0, cuts)
        if np.hypot(*gap) > CLOSED * size + errors.max():
            miss = np.hypot(*gap)
            raise InputError(f"normals: expected the boundary of a body, got one that misses itself by {miss:.3g}")
        how = "sum of the sides" if self.radius is None else "Gauss rules on panels and their halves"
        object.__setattr__(self, "perimeter", Estimate(size, errors[0], "estimate", how))

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
            (), (), law, lambda n: largest * (ratio / np.hypot(ratio * along(n), across(n))) ** 3,
            np.append(cuts, finite_array("breakpoints", breakpoints)),
        )  # fmt: skip

    @classmethod
    def polygon(cls, law: Laws, vertices: ArrayLike) -> RoughBody:
        """A convex polygon with counterclockwise vertices, shape (n, 2)."""
        points = finite_array("vertices", vertices)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
            raise InputError(f"vertices: expected at least three points, got shape {points.shape}")
        side = np.roll(points, -1, axis=0) - points
        after = np.roll(side, -1, axis=0)
        turn = np.arctan2(side[:, 0] * after[:, 1] - side[:, 1] * after[:, 0], np.sum(side * after, axis=1))
        if turn.min() < -CLOSED or turn.max() > math.pi - CLOSED or turn.sum() > 1.5 * TURN:
            raise InputError(
                "vertices: expected a convex polygon, its vertices once round against the clock, got turns from "
                f"{turn.min():.3g} to {turn.max():.3g} radians, in sum {turn.sum() / TURN:.3g} times 2 pi; for the hull "
                "of any points pass points[scipy.spatial.ConvexHull(points).vertices]"
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
        found: dict[Hashable, Estimate] = {}

        def mean(law: Law, normals: Floats) -> Floats:
            key = _key(law)
            if key not in found:
                found[key] = resistance(law, tolerance)
            one = found[key]
            return np.broadcast_to(np.array([[one.value], [one.error]]), (2, normals.size))

        size = float(self.perimeter)
        (value,), (error,), panels = self._integral(self._by_law(mean), tolerance * size, self._edges)
        if cost is not None or directions is not None:
            return self._with_cost(_momentum if cost is None else cost, directions, tolerance, panels)
        bound = self.radius is None and all(one.kind == "bound" for one in found.values())
        how = f"{next(iter(found.values())).method}; {len(found)} laws; {self.perimeter.method}"
        return scaled(Estimate(value, error, "bound" if bound else "estimate", how), SINE_MASS / 0.75)

    def _with_cost(
        self, cost: DirectionCost, directions: AngleFunction | None, tolerance: float, panels: Floats
    ) -> Estimate:
        """The integral of a cost, by Gauss rules on panels that are halved until two of them agree."""
        chosen = Vectorised(cost, scalar=True)
        density = Vectorised(directions or (lambda direction: 1.0), scalar=True)

        def part(law: Law, normals: Floats, lengths: Floats) -> Estimate:
            def averaged(theta: Floats, outgoing: Floats) -> Floats:
                total: Floats | float = 0.0
                for tangent, length in zip(normals - 0.5 * np.pi, lengths / size, strict=True):
                    total = total + length * chosen(tangent + theta, tangent + outgoing) * density(tangent + theta)
                return np.asarray(total)

            return resistance(law, tolerance, cost=averaged)

        size, last = float(self.perimeter), math.nan
        for level in range(1 if self.radius is None else MOST_LEVELS):
            edges = split_panels(panels, 2**level)
            normals, lengths = self._rule(edges)
            parts = [part(law, normals[here], lengths[here]) for law, here in self._groups(normals)]
            value, error = math.fsum(one.value for one in parts), math.fsum(one.error for one in parts)
            missed = 0.0 if self.radius is None else SAFETY * abs(value - last)
            last = value
            if missed <= max(tolerance, error):
                break
        bound = self.radius is None and all(one.kind == "bound" for one in parts)
        how = f"{len(parts)} laws, {normals.size} normals: {parts[0].method}"
        return scaled(Estimate(value, error + missed, "bound" if bound else "estimate", how), SINE_MASS * size)

    def force(self, direction: float, tolerance: float = 1e-8) -> StreamForce:
        """The force on the body of a stream of particles with velocity -u, as components along and across -u.

        The unit is the stream's momentum flux; u has the angle ``direction``, radians. The component across is positive
        to the left of the stream. The wanted error is relative to the perimeter.
        """
        source, size = finite_number("direction", direction), float(self.perimeter)
        wanted = positive_number("tolerance", tolerance) * size
        cuts = np.concatenate([[-0.5 * np.pi, 0.5 * np.pi], *(normals_at_breakpoints(law, 0.0) for law in self._laws)])
        edges = np.unique(np.concatenate((self._edges, np.mod(source + cuts, TURN))))
        rows = self._by_law(lambda law, normal: pushes(law, normal - source, 0.0))
        values, errors, panels = self._integral(rows, wanted, edges)
        how = "sum of the sides" if self.radius is None else f"Gauss rules on {panels.size - 1} panels and their halves"
        along, across, _ = (Estimate(*one, "estimate", how) for one in zip(values, errors, strict=True))
        return StreamForce(along, across)

    def sample(self, n: int, rng: Rng = None) -> tuple[Floats, Floats, Floats]:
        """Directions u, u' and n of ``n`` independent triples drawn from nu, divided by its mass, in [0, 2 pi)."""
        whole_number("n", n, 1)
        source = generator(rng)
        _, _, panels = self._integral(_components, 0.0, self._edges)
        normals, lengths = self._rule(panels)
        # elements are the sides, then the panels
        sides, rule = self.normals.size, (panels.size - 1, NODES.size)
        weights = np.append(self.lengths, lengths[sides:].reshape(rule).sum(axis=1))
        element = source.choice(weights.size, size=n, p=weights / weights.sum())
        normal = normals[np.minimum(element, sides)]
        pending = np.flatnonzero(element >= sides)
        if pending.size:
            nodes, ends = self._radius(normals[sides:]).reshape(rule), self._radius(panels)
            largest = MARGIN * np.max([nodes.max(axis=1), ends[:-1], ends[1:]], axis=0)
        while pending.size:
            panel = element[pending] - sides
            normal[pending] = panels[panel] + np.diff(panels)[panel] * source.random(pending.size)
            pending = pending[source.random(pending.size) * largest[panel] > self._radius(normal[pending])]
        incoming, outgoing = SINE.sample(n, source), np.empty(n)
        for law, here in self._groups(normal, element):
            outgoing[here] = law.sample(incoming[here], source)
        tangent = normal - 0.5 * np.pi
        u, v = (np.mod(tangent + angle, TURN) for angle in (incoming, outgoing))
        return u, v, np.mod(normal, TURN)

    def symmetry_defect(self, n: int, rng: Rng = None) -> SymmetryDefect:
        """How far nu is from symmetric in u and u', from ``n`` samples, with the z-score of the difference."""
        u, v, _ = self.sample(n, rng)
        scale = DIRECTION_BINS / TURN
        return defect_of_pairs(u * scale, v * scale, DIRECTION_BINS)

    def _integral(self, rows: Rows, tolerance: float, edges: Floats) -> tuple[Floats, Floats, Floats]:
        """The `integral` along the boundary of functions of the normal."""
        values, errors, panels = 0.0, 0.0, edges
        if self.radius is not None:
            values, errors, panels = integral(lambda normal: rows(normal) * self._radius(normal), edges, tolerance)
        if self.normals.size:
            *sides, error = rows(self.normals) @ self.lengths
            values, errors = values + np.array(sides), errors + np.full(len(sides), error)
        return values, errors, panels

    def _by_law(self, function: Callable[[Law, Floats], Floats]) -> Rows:
        """The function of normals, shape (rows, normals), from one of the law and normals that have it."""

        def rows(normals: Floats) -> Floats:
            parts = [(here, function(law, normals[here])) for law, here in self._groups(normals)]
            found = np.empty((len(parts[0][1]), normals.size))
            for here, part in parts:
                found[:, here] = part
            return found

        return rows

    def _groups(self, normals: Floats, sides: Indices | None = None) -> list[tuple[Law, Indices]]:
        """The laws at these normals, by default those of the sides, with the indices of the normals that have them."""
        laws = self.law
        if isinstance(laws, Law):
            each: Sequence[Law] = (laws,)
        elif callable(laws):
            each = _laws_at(np.mod(normals, TURN), laws)
        else:
            each = [laws[k] for k in (range(len(laws)) if sides is None else sides)]
        groups: dict[Hashable, tuple[Law, list[int]]] = {}
        for k, law in enumerate(each):
            if not isinstance(law, Law) or law.frame != "paper":
                raise InputError(f"law: expected one in the paper's convention, got {law!r}")
            groups.setdefault(_key(law), (law, []))[1].append(k)
        if isinstance(laws, Law):
            return [(laws, np.arange(normals.size))]
        return [(law, np.array(here)) for law, here in groups.values()]

    def _changes(self) -> tuple[tuple[Law, ...], Floats]:
        """The laws along curves, and the normals between them; none if there are many, as of a continuous change."""
        at = np.minimum(np.arange(STEPS + 1) * (TURN / STEPS), np.nextafter(TURN, 0.0))
        if self.radius is None or isinstance(self.law, Law):
            return tuple(law for law, _ in self._groups(self.normals)), np.empty(0)
        groups, which = self._groups(at), np.empty(at.size, dtype=np.intp)
        for k, (_, here) in enumerate(groups):
            which[here] = k
        changed = np.flatnonzero(np.diff(which))
        if changed.size > MOST_CHANGES:
            return (), np.empty(0)
        before = [_key(groups[k][0]) for k in which[changed]]

        def unchanged(normals: Floats) -> NDArray[np.bool_]:
            laws = _laws_at(normals, self.law)
            return np.array([_key(law) == key for law, key in zip(laws, before, strict=True)])

        return tuple(law for law, _ in groups), bisected(at[changed], at[changed + 1], unchanged)

    def _rule(self, edges: Floats) -> tuple[Floats, Floats]:
        """The sides, then Gauss nodes between the edges: normals and lengths."""
        if self.radius is None:
            return self.normals, self.lengths
        half = 0.5 * np.diff(edges)[:, None]
        normals = (edges[:-1, None] + half * (1.0 + NODES)).ravel()
        lengths = (half * WEIGHTS).ravel() * self._radius(normals)
        return np.append(self.normals, normals), np.append(self.lengths, lengths)

    def _radius(self, normals: Floats) -> Floats:
        found = finite_array("radius", Vectorised(self.radius, scalar=True)(normals))
        if found.min() < 0.0:
            raise InputError(f"radius: expected radii of curvature of at least 0, got {found.min():g}")
        return found


def _laws_at(normals: Floats, laws: LawOfNormal) -> tuple[Law, ...]:
    """The law of every element by a function from the direction of its normal."""
    try:
        return tuple(map(laws, normals.tolist()))
    except AsperityError:
        raise
    except (TypeError, ValueError) as reason:
        raise InputError(
            f"law: expected a function from the direction of a normal to a law, it failed: {reason}"
        ) from reason


def _key(law: Law) -> Hashable:
    """Equal for laws that are known to be the same."""
    try:
        hash(law)
    except TypeError:  # of arrays
        return id(law)
    return law


def _components(normals: Floats) -> Floats:
    """1 and the unit vector, with their rounding."""
    one = np.ones(normals.size)
    return np.stack([one, np.cos(normals), np.sin(normals), ROUNDING * one])


def _momentum(incoming: Floats, outgoing: Floats) -> Floats:
    """1 + u . u', the momentum transfer along the stream."""
    return np.asarray(1.0 + np.cos(outgoing - incoming))
