"""A chamber behind a small opening in which pairs of mirrors perform a whole exchange of intervals of angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, Rng, generator, instance, number_between, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, fraction_estimate
from ...core.given import Vectorised
from ...geometry import Arc, Segment, Wall, trace
from ...geometry.curves.curve import Curve
from ...geometry.tracing.tracing import Trace
from ..bases.measure import SINE
from ..laws.deterministic import IntervalExchangeLaw
from ..laws.law import Law, specular
from .mirror_layout import THICKNESS, MirrorGroup, arranged, mirror_groups

# The ceiling falls by this angle times the root of the opening: the flux below it is a 32nd of the opening.
CEILING = 0.25
# Errors of the mirrors' slopes displace rays by at most this fraction of the square of the opening, and so add this
# fraction of it to the loss; slopes are right to a few hundred roundings at best. Backs of mirrors are coarser.
DISPLACED, LEAST_TOLERANCE, BACK_TOLERANCE = 0.1, 1e-12, 1e-4
# Space between the mirrors and the sides of the chamber, relative to the largest distance of a mirror.
MARGIN = 0.05
LARGEST_OPENING = 0.1
# Rays by way of the mirrors have one collision or two; others are not followed for longer.
MOST_COLLISIONS = 8
SAMPLES = 2**17
# Gauss nodes of a piece of the exchange, for a mean and its error.
PIECE_NODES = 32, 128
# Flat tops beside the openings of many generations, over the width of an opening.
NECK = 0.01


@dataclass(frozen=True, repr=False)
class Generations(Summary):
    """The law of a wall of chambers of several generations; made by `ExchangeHollow.generations`.

    Attributes
    ----------
    number : int
        Generations.
    covered : float
        The fraction of the wall that openings cover; the rest is flat.
    limit : float
        That of infinitely many generations: the rest are the necks beside the openings.
    law : Law
        The mixture of exchange and specular reflection that the law of this wall would be with chambers of no loss.
    distance : Estimate
        Upper bound of the joint Wasserstein distance of the law of this wall, losses included, from the exchange,
        known by sampling with a half width of 95 %.
    """

    number: int
    covered: float
    limit: float
    law: Law
    distance: Estimate


@dataclass(frozen=True, eq=False, repr=False)
class ExchangeHollow(Summary):
    """A wall with a small opening behind which mirrors perform an exchange of intervals; made by `exchange_hollow`.

    Attributes
    ----------
    exchange : IntervalExchangeLaw
    wall : Wall
        One chamber a period, under flat tops; the mirrors are islands. The distance of the nearest mirror from the
        middle of the opening is 1.
    opening : tuple of float
        Left and right end of the opening.
    mirrors : int
        How many there are: one for each interval that changes its position, or more where an interval had to be
        divided, and one for each that does not.
    """

    exchange: IntervalExchangeLaw
    wall: Wall
    opening: tuple[float, float]
    mirrors: int

    def loss(self, samples: int = SAMPLES, rng: Rng = None) -> Estimate:
        """The fraction of the flux through the opening that does not leave where the exchange sends it.

        A ray is counted as missed unless it leaves, after at most 8 collisions, in the interval with which that of its
        incoming angle changes places. By tracing, with Wilson's interval of 95 %.

        Parameters
        ----------
        samples : int
            Rays, at least 2.
        rng : None, int or numpy.random.Generator
            ``np.random.default_rng(0)`` by default.
        """
        theta, traced = self._traced(samples, rng)
        missed = float(np.mean(~self._arrives(theta, traced)))
        return fraction_estimate(missed, theta.size, f"{theta.size} traced rays")

    def mean(
        self, function: Callable[[Floats, Floats], Floats], unfollowed: float, samples: int = SAMPLES, rng: Rng = None
    ) -> Estimate:
        """The mean of a function of the incoming and the outgoing angle over the flux through the opening.

        The mean over the exchange by quadrature, and the difference from it by tracing, with a half width of 95 %.

        Parameters
        ----------
        function : callable
            Of two arrays, radians; smooth.
        unfollowed : float
            The value for rays that are followed no longer: with the largest one the mean is an upper bound.
        samples : int
            Rays.
        rng : None, int or numpy.random.Generator
            ``np.random.default_rng(0)`` by default.

        Examples
        --------
        With 16 cells the resistance comes near to the least one, 0.98782.

        >>> from asperity import kernels as ker
        >>> least = ker.discretise(ker.LeastResistanceLaw(), ker.Bins(16))
        >>> hollow = exchange_hollow(ker.IntervalExchangeLaw(least), 1e-4)
        >>> found = hollow.mean(lambda theta, outgoing: 0.75 * (1.0 + np.cos(outgoing - theta)), 1.5)
        >>> round(found.value, 3), found.error < 1e-4
        (0.989, True)
        """
        function, unfollowed = Vectorised(function, scalar=True), Estimate(unfollowed, 0.0, "bound", "given").value
        ends = SINE.quantile(np.append(self.exchange.starts, 1.0))
        rules = (SINE.quadrature(ends, order) for order in PIECE_NODES)
        rough, fine = (float(weights @ function(nodes, self.exchange.image(nodes))) for nodes, weights in rules)
        theta, traced = self._traced(samples, rng)
        value = np.where(traced.escaped, function(theta, traced.theta), unfollowed)
        away = value - function(theta, self.exchange.image(theta))
        half = NORMAL_95 * float(np.std(away)) / np.sqrt(theta.size)
        total = fine + float(np.mean(away))
        return Estimate(total, half + abs(fine - rough), "estimate", f"{theta.size} traced rays")

    def _traced(self, samples: int, rng: Rng) -> tuple[Floats, Trace]:

        number = whole_number("samples", samples, 2)
        source = generator(rng, 0)
        theta = SINE.sample(number, source)
        x = self.opening[0] + (self.opening[1] - self.opening[0]) * source.random(number)
        return theta, trace(self.wall, x, theta, max_collisions=MOST_COLLISIONS)

    def _arrives(self, theta: Floats, traced: Trace) -> NDArray[np.bool_]:
        starts, widths = self.exchange.starts, self.exchange.widths
        piece = np.clip(np.searchsorted(starts, SINE.cdf(theta), side="right") - 1, 0, starts.size - 1)
        other = self.exchange.partner[piece]
        out = SINE.cdf(np.where(traced.escaped, traced.theta, 0.5 * np.pi))
        return np.asarray(traced.escaped & (out >= starts[other]) & (out <= starts[other] + widths[other]))

    def generations(self, number: int, neck: float = NECK, samples: int = SAMPLES, rng: Rng = None) -> Generations:
        """The law of a wall in which the flat tops carry smaller copies of the chamber, these copies of their own, ...

        Parameters
        ----------
        number : int
            Generations, at least 1; the first is the wall itself.
        neck : float
            Width of the flat top that is left on each side of an opening, over the width of the opening.
        samples : int
            Rays for the distance.
        rng : None, int or numpy.random.Generator
            ``np.random.default_rng(0)`` by default.

        Returns
        -------
        Generations

        Notes
        -----
        Between the flat top and the ceiling of the chamber, which falls from the opening, there is room for copies:
        at a distance from the opening a copy as deep as the ceiling there. So finitely many copies cover the flat top
        but for the necks. Copies have the law of the chamber, because it does not depend on size.

        Examples
        --------
        >>> from asperity import kernels as ker
        >>> exchange = ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
        >>> many = exchange_hollow(exchange, 1e-2).generations(5000)
        >>> round(many.covered, 4), round(many.limit, 4), bool(many.distance.value < 0.04)
        (0.9804, 0.9804, True)
        """
        whole_number("number", number, 1)
        neck = positive_number("neck", neck)
        period, width = self.wall.period, self.opening[1] - self.opening[0]
        # beyond the necks
        carried = 1.0 - (1.0 + 2.0 * neck) * width / period
        if carried <= 0.0:
            raise InputError(f"neck: expected room for copies beyond the necks, got {neck!r}")
        limit = 1.0 / (1.0 + 2.0 * neck)
        covered = -limit * float(np.expm1(number * np.log(carried)))
        theta, traced = self._traced(samples, rng)
        image = self.exchange.image(theta)
        # rays that are followed no longer count as pi away
        own = np.where(traced.escaped, np.abs(traced.theta - image), np.pi)
        away = covered * own + (1.0 - covered) * np.abs(np.pi - theta - image)
        half = NORMAL_95 * float(np.std(away)) / np.sqrt(theta.size)
        nearby = Estimate(float(np.mean(away)), half, "estimate", f"a coupling of {theta.size} traced rays")
        law = covered * self.exchange + (1.0 - covered) * specular()
        return Generations(number, covered, limit, law, nearby)


def exchange_hollow(exchange: IntervalExchangeLaw, opening: float = 1e-3) -> ExchangeHollow:
    """A chamber whose mirrors send every ray where an exchange of intervals sends it, but for the order of the opening.

    Parameters
    ----------
    exchange : IntervalExchangeLaw
    opening : float
        Width of the opening over the distance of the nearest mirror, in (0, 0.1).

    Returns
    -------
    ExchangeHollow

    Raises
    ------
    InputError
        If an argument is not as described.

    Notes
    -----
    Two intervals that change places get two mirrors that solve for the prescribed map (`MirrorPair`), an interval that
    does not an arc about the middle of the opening. Each mirror occupies exactly its interval of directions, so that
    no mirror stands between another and the opening. Their distances are chosen so that no beam between the two mirrors
    of a pair meets a third one. Two intervals side by side that change places are halved, because their mirrors would
    have to meet in a corner, and so are pairs whose mirrors shade themselves. The magnification is -1 by Abbe's sine
    condition: the images of the opening cover it but for the second order, and the loss is of the order of the opening.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> exchange = ker.IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
    >>> hollow = exchange_hollow(exchange, 1e-3)
    >>> hollow.mirrors, bool(hollow.loss().value < 0.01)
    (6, True)
    """
    instance("exchange", exchange, IntervalExchangeLaw, "ker.IntervalExchangeLaw(ker.discretise(law, ker.Bins(4)))")
    width = number_between("opening", opening, 0.0, LARGEST_OPENING)
    ends = np.concatenate([[0.0], SINE.quantile(exchange.starts[1:]), [np.pi]])
    least_angle = CEILING * float(np.sqrt(width))
    groups = mirror_groups(ends, exchange.partner.tolist(), least_angle, width)
    if not groups:
        raise InputError(f"opening: expected one over which an interval of the exchange gets a mirror, got {opening!r}")
    islands = [
        island
        for group, factor in zip(groups, arranged(groups).tolist(), strict=True)
        for island in _islands(group, factor, width)
    ]
    return _chamber(exchange, islands, width, least_angle)


def _islands(group: MirrorGroup, factor: float, width: float) -> list[list[Curve]]:
    """The mirrors of a group as closed paths: the mirror, and its enlarged copy behind it."""

    islands = []
    for which, (low, high) in enumerate(group.intervals):
        if group.pair is None:
            front: list[Curve] = [Arc((0.0, 0.0), factor, low + np.pi, high + np.pi)]
            back: list[Curve] = [front[0].stretched(1.0 + THICKNESS, 1.0 + THICKNESS)]
        else:
            tolerance = max(0.25 * DISPLACED * width**2 / (factor * group.reach), LEAST_TOLERANCE)
            front = [piece.stretched(factor, factor) for piece in group.pair.pieces(which, tolerance)]
            behind = factor * (1.0 + THICKNESS)
            back = [piece.stretched(behind, behind) for piece in group.pair.pieces(which, BACK_TOLERANCE)]
        returning = [piece.reversed() for piece in reversed(back)]
        islands.append(
            [*front, Segment(front[-1].end, returning[0].start), *returning, Segment(returning[-1].end, front[0].start)]
        )
    return islands


def _chamber(
    exchange: IntervalExchangeLaw, islands: list[list[Curve]], width: float, least_angle: float
) -> ExchangeHollow:

    boxes = np.array([piece.box for island in islands for piece in island])
    far = float(np.abs(boxes[:, [0, 2]]).max())
    side, depth = (1.0 + MARGIN) * far, -float(boxes[:, 1].min()) + MARGIN * far
    period = 2.0 * side + 2.0 * MARGIN * far
    middle, half = 0.5 * period, 0.5 * width
    fallen = (side - half) * float(np.tan(least_angle))
    left, right = middle - side, middle + side
    corners = [
        (0.0, 0.0), (middle - half, 0.0), (left, -fallen), (left, -depth), (right, -depth), (right, -fallen),
        (middle + half, 0.0), (period, 0.0),
    ]  # fmt: skip
    path = [Segment(start, end) for start, end in pairwise(corners)]
    moved = [[piece.moved(middle, 0.0) for piece in island] for island in islands]
    return ExchangeHollow(exchange, Wall(path, period, moved), (middle - half, middle + half), len(islands))
