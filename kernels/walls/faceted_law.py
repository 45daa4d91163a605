"""The law of a wall whose facets reflect by a law of their own: diffuse in part, or rough on a second scale.

Rays fly from facet to facet, and leave each at an angle that the caller gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, angles, generator, instance
from ...core.errors import AccuracyError, AsperityError, InputError
from ...core.long_runs import slices
from ...geometry import Wall
from ...geometry.curves import columns as c
from ...geometry.curves.columns import Struct
from ...geometry.tracing.compiled.pieces.records import FLYING, NO_STATES, OPENING, States
from ...geometry.tracing.threads import in_blocks
from ...geometry.tracing.tracing import Status, entries
from ..bases.measure import SINE
from ..expectations.conditionals import Conditionals
from ..laws.law import ENTRY_POINTS, Law, check_paper_frame, entry_inside, retroreflection, sum_of
from ..laws.structure import Rules, fold
from .conditionals import if_escaped
from .wall_law import WallLaw

T = TypeVar("T")
# Rays that are followed together, so that their states stay in the cache.
CHUNK = 2**16
# Limit on the hits of a ray, some seconds of work for the last rays.
MOST_HITS = 100_000
# What may become of rays.
LOST = f"they met corners, were inside after {MOST_HITS} hits, or were not resolved by the facets' law"


@dataclass(frozen=True)
class FacetedLaw(Law):
    r"""The law of a wall whose facets reflect by the law ``facets``, in the frame of the facet's tangent and normal.

    Parameters
    ----------
    wall : Wall
    facets : Law
        A law in the paper's convention: `maxwell` for a diffuse fraction, `WallLaw` of a finer wall for roughness of a
        second scale, or another FacetedLaw. Flat tops reflect by it too.

    Attributes
    ----------
    parts : tuple of (float, Law)
        Of specular facets the parts of `WallLaw`, of retroreflecting ones retroreflection, of a flat wall ``facets``;
        otherwise this law alone.
    reversible, mirror_symmetric : bool or None
        True if the facets are reversible, and if wall and facets are mirror-symmetric; else None (not known).
    diffuse_fraction : float or None
        The a of facets a Lambertian + (1 - a) specular; None for others.

    Raises
    ------
    InputError
        If ``facets`` is no law in the paper's convention, or its weights do not sum to 1.
    AccuracyError
        In `sample`, if more than a fraction of 1e-4 of the rays did not escape: they met a corner, or were inside after
        10^5 hits, or a finer wall did not resolve them. Such rays count as retroreflected.

    Notes
    -----
    Rays are drawn: at each hit the arriving angle becomes the incoming one of ``facets``. A conditional distribution
    consists of 4096 drawn angles, without a known error. `discretise` takes view factors between parts of the boundary
    for `maxwell` facets on closed walls of at most 640 segments and arcs, and independent rays for all others, among
    them walls with Bezier pieces such as `sinusoid`.

    For a disk, ``CollisionLaw(FacetedLaw(wall.foreshorten(disk), facets), disk)`` has the law of the facets in the
    metric of the energy; foreshortening does not commute with it (see the page on facets).

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> from asperity.kernels import maxwell, specular
    >>> FacetedLaw(geo.flat(), maxwell(0.2)).parts
    ((1.0, 0.2*lambertian() + 0.8*specular()),)
    >>> FacetedLaw(geo.triangular_teeth(0.7), specular()).parts
    ((1.0, TriangularTeethLaw(angle=0.7)),)
    """

    wall: Wall
    facets: Law

    def __post_init__(self) -> None:
        instance("wall", self.wall, Wall, "geo.triangular_teeth(0.7)")
        check_paper_frame("facets", self.facets, "ker.maxwell(0.2)")
        self._set(reversible=self.facets.reversible or None)
        self._named(lambda: self.facets.parts)
        whole = self.wall.is_mirror_symmetric and self.facets.mirror_symmetric
        known = sum_of(self._known).mirror_symmetric if self._known else whole
        self._set(mirror_symmetric=known or None)

    @property
    def parts(self) -> tuple[tuple[float, Law], ...]:
        return self._known or ((1.0, self),)

    @cached_property
    def _known(self) -> tuple[tuple[float, Law], ...] | None:
        only = self.facets.parts[0][1] if len(self.facets.parts) == 1 else self.facets
        if only.retro is not None:
            return ((1.0, retroreflection()),) if only.retro else WallLaw(self.wall).parts
        is_flat = self.wall.closes and not self.wall.cell.hollows
        return ((1.0, self.facets),) if is_flat else None

    @cached_property
    def diffuse_fraction(self) -> float | None:
        def of_leaf(law: Law) -> float:
            return 1.0 if law.is_lambertian else 0.0 if law.retro is False else math.nan

        rules: Rules[float] = Rules(
            of_leaf,
            lambda terms: sum(weight * fraction for weight, fraction in terms),
            lambda fractions: fractions[0] if len(fractions) == 1 else math.nan,
            lambda fraction: 1.0 if fraction == 1.0 else math.nan,
        )
        found = fold(self.facets, rules)
        return None if math.isnan(found) else min(found, 1.0)

    def adjoint(self) -> Law:
        """The law of the same wall with the adjoint law of the facets."""
        return self if self.reversible else FacetedLaw(self.wall, self._named(self.facets.adjoint))

    def _named(self, call: Callable[[], T]) -> T:
        """What a call of the facets' law returns; its refusals name this law."""
        try:
            return call()
        except AsperityError as reason:
            message = f"facets: {self.facets!r} on {self.wall!r}: {reason}"
            if isinstance(reason, AccuracyError):
                raise AccuracyError(message, reason.defect) from reason
            raise InputError(message) from reason

    def _sample_with_status(self, theta: Floats, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_] | None]:
        if self._known:
            return sum_of(self._known)._sample_with_status(theta, rng)
        return self._followed(rng.random(theta.shape), theta, rng)

    def _followed(self, x: Floats, theta: Floats, rng: np.random.Generator) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles of rays that enter at fractions ``x`` of the period, and which of them escaped."""
        incoming, resolved = theta.ravel(), np.ones(theta.size, dtype=np.bool_)

        def turn(angle: Floats, who: NDArray[np.int64]) -> Floats:
            left, known = self._named(lambda: self.facets._sample_with_status(angle, rng))
            resolved[who] &= True if known is None else known
            return left

        left, escaped = self._turned(x.ravel(), incoming, turn)
        resolved &= escaped
        return np.where(resolved, left, incoming).reshape(theta.shape), resolved.reshape(theta.shape)

    def scattered(self, theta: ArrayLike, rng: Rng = None) -> tuple[Floats, NDArray[np.bool_]]:
        """`sample` for facets diffuse in part, shape (n,), and which rays met a diffuse facet."""
        source, incoming = generator(rng), angles("theta", theta).ravel()
        fraction, found = self.diffuse_fraction or 0.0, np.zeros(incoming.size, dtype=np.bool_)

        def turn(angle: Floats, who: NDArray[np.int64]) -> Floats:
            is_diffuse = source.random(angle.size) < fraction
            found[who] |= is_diffuse
            return np.where(is_diffuse, SINE.sample(angle.size, source), np.pi - angle)

        return if_escaped(self, *self._turned(source.random(incoming.size), incoming, turn), LOST), found

    def _turned(
        self, x: Floats, theta: Floats, turn: Callable[[Floats, NDArray[np.int64]], Floats]
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Outgoing angles and escapes of rays, shape (n,), which ``turn`` turns at facets; it takes their numbers."""
        outgoing, escaped = np.empty(theta.size), np.empty(theta.size, dtype=np.bool_)
        entry = entry_inside(x) * self.wall.period
        for some in slices(theta.size, CHUNK):
            own = lambda angle, who, first=some.start: turn(angle, first + who)  # noqa: E731
            outgoing[some], _, status = follow_facets(self.wall, entry[some], theta[some], own)
            escaped[some] = status == Status.ESCAPED
        return outgoing, escaped

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        if self._known:
            return sum_of(self._known).sample(theta, rng)
        return if_escaped(self, *self._followed(rng.random(theta.shape), theta, rng), LOST)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Those of the parts, or drawn angles of rays that enter at equal distances."""
        if self._known:
            return sum_of(self._known)._conditionals(theta, tolerance, degree, edges)
        x, incoming = np.broadcast_arrays((np.arange(ENTRY_POINTS) + 0.5) / ENTRY_POINTS, theta[:, None])
        outgoing = if_escaped(self, *self._followed(x, incoming, np.random.default_rng(0)), LOST)
        return Conditionals.of_atoms(outgoing, np.full(outgoing.shape, 1.0 / ENTRY_POINTS), np.nan)


@dataclass(frozen=True)
class FacetRays:
    """Rays on facets of a wall or on its openings; `advance` moves them on, and changes the arrays of ``states``."""

    wall: Wall
    states: States

    @classmethod
    def entering(cls, wall: Wall, x: Floats, theta: Floats) -> FacetRays:
        """Rays that enter at y = 0 as those of `geometry.trace`; those on flat tops have kind -1."""
        scene, count = wall.scene, len(x)
        at = entries(wall, x, theta)
        at -= np.floor(at / scene.cell) * scene.cell
        hollow = np.searchsorted(scene.hollows[:, c.LEFT], at, side="right") - 1
        is_flat = (hollow < 0) | (at >= scene.hollows[hollow, c.RIGHT]) if len(scene.hollows) else np.ones(count, bool)
        kind = np.where(is_flat & (not scene.is_open), -1, OPENING)
        # an opening, seen from below, has the free side on the left of (-1, 0)
        tangent = np.broadcast_to([-1.0, 0.0], (count, 2)).copy()
        point = np.column_stack([at, np.zeros(count)])
        return cls.leaving(wall, np.maximum(hollow, 0), kind, np.full(count, -1), point, tangent, np.array(theta))

    @classmethod
    def leaving(cls, wall: Wall, *start: NDArray[Any]) -> FacetRays:
        """Rays that leave segments, arcs or openings, by hollow, kind, number, point, tangent and angle of `States`."""
        hollow, kind, number, point, tangent, angle = map(np.ascontiguousarray, start)
        at, status = np.full(len(angle), -1.0), np.full(len(angle), FLYING, np.uint8)
        return cls(wall, States(NO_STATES.who, hollow, kind, number, at, point, tangent, angle, status))

    def advance(self, who: NDArray[np.int64], threads: int | None = None) -> NDArray[np.int64]:
        """Let some rays fly to their next facet, and return those that are on one, for any number of threads."""
        from ...geometry.scene.compiled.compiling import checked
        from ...geometry.tracing.compiled.blocks import next_facets
        from ...geometry.tracing.compiled.rays import SLOTS

        if not len(who):
            return who
        states, tables = Struct(self.states._replace(who=np.ascontiguousarray(who))), self.wall.scene.tables

        def run(part: slice) -> None:
            checked(lambda: next_facets(part.start, part.stop, states.address, tables.address, SLOTS.address))

        in_blocks(run, len(who), threads)
        return np.asarray(who[self.states.status[who] == FLYING])


def follow_facets(
    wall: Wall, x: Floats, theta: Floats, turn: Callable[[Floats, NDArray[np.int64]], Floats]
) -> tuple[Floats, NDArray[np.int64], NDArray[np.uint8]]:
    """Reflect rays, shape (n,), by facets whose law is ``turn``: outgoing angles, numbers of hits, and `Status`.

    ``turn`` takes the reversed arriving angles of some rays, in the frame of their facets, with the numbers of the
    rays, and returns the angles at which they leave. Rays that are still inside after `MOST_HITS` hits end with
    ``Status.BOUNCE_LIMIT``. The angle of a ray that does not escape is its incoming one.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> theta, hits, _ = follow_facets(geo.triangular_teeth(1.0), np.array([0.3]), np.array([1.2]), lambda a, _: a)
    >>> theta.round(12).tolist(), hits.tolist()
    ([1.2], [1])
    """
    rays = FacetRays.entering(wall, x, theta)
    kind, angle, status = rays.states.kind, rays.states.angle, rays.states.status
    hits = np.zeros(len(x), np.int64)
    is_flat = kind < 0
    flat, who = np.flatnonzero(is_flat), np.flatnonzero(~is_flat)
    if len(flat):
        angle[flat], hits[flat], status[flat] = turn(angle[flat], flat), 1, Status.ESCAPED
    for most in range(MOST_HITS + 1):
        who = rays.advance(who)
        if not len(who) or most == MOST_HITS:
            break
        hits[who] += 1
        angle[who] = turn(angle[who], who)
    status[who] = Status.BOUNCE_LIMIT
    return np.where(status == Status.ESCAPED, angle, theta), hits, status
