"""The scattering law and the resistance of a convex body with a rough boundary."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, finite_array, finite_number, frozen, generator, positive_number, whole_number
from ...core.errors import AsperityError, InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ..bases.basis import AngleFunction
from ..bases.given import Vectorised
from ..bases.measure import SINE
from ..laws.law import Law
from ..matrices.defects import SymmetryDefect, defect_of_pairs
from .drag import resistance, scaled

# Boundary elements of a smooth body. Means over all directions converge geometrically in their number n. The force for
# one direction, with half of the boundary in the shade, converges like n^-2.
ELEMENTS = 720
# Bins of directions in the test of symmetry.
DIRECTION_BINS = 24
# The measure sin(theta) d theta has the mass 2.
SINE_MASS = 2.0

DirectionCost = Callable[[Floats, Floats], Floats]
LawOfNormal = Callable[[float], Law]
Laws: TypeAlias = "Law | Sequence[Law] | LawOfNormal"


@dataclass(frozen=True, eq=False, repr=False)
class RoughBody(Summary):
    r"""A convex body in the plane with a rough boundary, given by boundary elements and their reflection law.

    A particle with velocity -u that meets an element with outer normal n leaves with velocity u'. The scattering law
    is the measure nu(du du' dn) on triples of directions: the length of the boundary with this normal, times
    (u . n)_+ du, times the law P~ of u' given u in the frame of the element. It is symmetric in u and u' if P~ is
    reversible, as for every wall.

    Parameters
    ----------
    normals : array_like, shape (elements,)
        Directions of the outer normals, radians.
    lengths : array_like, shape (elements,)
        Lengths of the elements.
    law : Law, sequence of Laws, or callable
        P~, in the paper's convention, for example of a wall much finer than the body. For a body whose roughness
        changes along its boundary, one law for every element, or a function from the direction of the normal (radians)
        to a law; elements that share a law object are computed together.

    Raises
    ------
    InputError
        If lengths are not positive or do not fit the normals, the boundary does not close, or the law is in the
        specular frame.

    Notes
    -----
    Source: Rudzis 2022, section 1.2.7, corrected: the resistance is the integral of c(u, u') against nu, which already
    contains (u . n)_+; A. Plakhov, "Exterior Billiards" (2012).

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> body = RoughBody.disk(ker.specular())
    >>> round(float(body.resistance(cost=lambda u, v: np.ones(np.broadcast(u, v).shape))) / np.pi, 12)
    4.0
    >>> round(float(body.force(0.0)[0]), 4)          # a smooth disk: 8/3 along the stream
    2.6667
    """

    normals: Floats
    lengths: Floats
    law: Laws
    # every law with the numbers of its elements
    _groups: tuple[tuple[Law, NDArray[np.intp]], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        normals = np.atleast_1d(finite_array("normals", self.normals))
        lengths = np.atleast_1d(finite_array("lengths", self.lengths))
        if normals.shape != lengths.shape or normals.ndim != 1:
            raise InputError(f"lengths: expected one for each of {normals.size} normals, got shape {lengths.shape}")
        if lengths.min() <= 0.0:
            raise InputError(f"lengths: expected numbers greater than 0, got {lengths.min():g}")
        gap = np.hypot(lengths @ np.cos(normals), lengths @ np.sin(normals))
        if gap > 1e-9 * lengths.sum():
            raise InputError(f"normals: expected the boundary of a body, got one that misses itself by {gap:.3g}")
        laws = self.law
        if isinstance(laws, Law) or not (callable(laws) or np.iterable(laws)):
            each = (laws,) * normals.size
        else:
            each = _laws_at(normals, laws) if callable(laws) else tuple(laws)
            object.__setattr__(self, "law", each)
            if len(each) != normals.size:
                raise InputError(f"law: expected one or {normals.size}, one for every element, got {len(each)}")
        groups: dict[int, list[int]] = {}
        for k, law in enumerate(each):
            if not isinstance(law, Law) or law.frame != "paper":
                raise InputError(f"law: expected one in the paper's convention, got {law!r}")
            groups.setdefault(id(law), []).append(k)
        object.__setattr__(self, "_groups", tuple((each[here[0]], np.array(here)) for here in groups.values()))
        object.__setattr__(self, "normals", frozen(normals))
        object.__setattr__(self, "lengths", frozen(lengths))

    @classmethod
    def disk(cls, law: Laws, radius: float = 1.0) -> RoughBody:
        """A disk of the given radius."""
        return cls.ellipse(law, radius, radius)

    @classmethod
    def ellipse(cls, law: Laws, a: float, b: float) -> RoughBody:
        """An ellipse with the semi-axes a (along x1) and b."""
        a, b = positive_number("a", a), positive_number("b", b)
        normals = 2.0 * np.pi * (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        radii = (a * b) ** 2 / np.hypot(a * np.cos(normals), b * np.sin(normals)) ** 3
        return cls(normals, radii * (2.0 * np.pi / ELEMENTS), law)

    @classmethod
    def polygon(cls, law: Laws, vertices: ArrayLike) -> RoughBody:
        """A convex polygon with counterclockwise vertices, shape (n, 2)."""
        points = finite_array("vertices", vertices)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
            raise InputError(f"vertices: expected at least three points, got shape {points.shape}")
        side = np.roll(points, -1, axis=0) - points
        turn = side[:, 0] * np.roll(side[:, 1], -1) - side[:, 1] * np.roll(side[:, 0], -1)
        if turn.min() <= 0.0:
            raise InputError("vertices: expected a convex polygon, its vertices against the clock")
        return cls(np.arctan2(-side[:, 0], side[:, 1]), np.hypot(side[:, 0], side[:, 1]), law)

    @property
    def perimeter(self) -> float:
        """The length of the boundary."""
        return float(self.lengths.sum())

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
        found = [self._part(law, here, tolerance, cost, directions) for law, here in self._groups]
        if len(found) == 1:
            return found[0]
        kind: ErrorKind = "bound" if all(one.kind == "bound" for one in found) else "estimate"
        value, error = math.fsum(one.value for one in found), math.fsum(one.error for one in found)
        return Estimate(value, error, kind, f"sum over {len(found)} laws: {found[0].method}")

    def _part(
        self,
        law: Law,
        here: NDArray[np.intp],
        tolerance: float,
        cost: DirectionCost | None,
        directions: AngleFunction | None,
    ) -> Estimate:
        """The integral over the elements ``here``, which have the same law."""
        tangents, length = self.normals[here] - 0.5 * np.pi, float(self.lengths[here].sum())
        if cost is None and directions is None:
            return scaled(resistance(law, tolerance), SINE_MASS * length / 0.75)
        chosen = _momentum if cost is None else Vectorised(cost, scalar=True)
        density = None if directions is None else Vectorised(directions, scalar=True)

        def averaged(theta: Floats, outgoing: Floats) -> Floats:
            total: Floats | float = 0.0
            for tangent, part in zip(tangents, self.lengths[here] / length, strict=True):
                value = part * chosen(tangent + theta, tangent + outgoing)
                total = total + (value if density is None else value * density(tangent + theta))
            return np.asarray(total)

        return scaled(resistance(law, tolerance, cost=averaged), SINE_MASS * length)

    def force(self, direction: float) -> Floats:
        """The force on the body of a stream of particles with velocity -u, as components along and across -u.

        The unit is the stream's momentum flux; u has the angle ``direction``, radians. The component across is positive
        to the left of the stream. The force is a sum over the boundary elements; a smooth body has 720 of them.
        """
        theta = np.mod(finite_number("direction", direction) - self.normals + 0.5 * np.pi, 2.0 * np.pi)
        total = np.zeros(2)
        for law, here in self._groups:
            lit = here[(theta[here] > 0.0) & (theta[here] < np.pi)]
            incoming = theta[lit]
            level, up = (law.apply(function, incoming) for function in (np.cos, np.sin))
            # a particle transfers the momentum -u - u' to the body; the stream has the direction -u
            along = 1.0 + level * np.cos(incoming) + up * np.sin(incoming)
            across = up * np.cos(incoming) - level * np.sin(incoming)
            flux = self.lengths[lit] * SINE_MASS * SINE.density(incoming)
            total += [flux @ along, flux @ across]
        return total

    def sample(self, n: int, rng: Rng = None) -> tuple[Floats, Floats, Floats]:
        """Directions u, u' and n of ``n`` independent triples drawn from nu, divided by its mass, in [0, 2 pi)."""
        whole_number("n", n, 1)
        source = generator(rng)
        element = source.choice(self.normals.size, size=n, p=self.lengths / self.perimeter)
        normal, incoming = self.normals[element], SINE.sample(n, source)
        outgoing = np.empty(n)
        for law, here in self._groups:
            own = np.isin(element, here)
            outgoing[own] = law.sample(incoming[own], source)
        tangent = normal - 0.5 * np.pi
        u, v = (np.mod(tangent + angle, 2.0 * np.pi) for angle in (incoming, outgoing))
        return u, v, np.mod(normal, 2.0 * np.pi)

    def symmetry_defect(self, n: int, rng: Rng = None) -> SymmetryDefect:
        """How far nu is from symmetric in u and u', from ``n`` samples, with the z-score of the difference."""
        u, v, _ = self.sample(n, rng)
        scale = DIRECTION_BINS / (2.0 * np.pi)
        return defect_of_pairs(u * scale, v * scale, DIRECTION_BINS)


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


def _momentum(incoming: Floats, outgoing: Floats) -> Floats:
    """1 + u . u', the momentum transfer along the stream."""
    return np.asarray(1.0 + np.cos(outgoing - incoming))
