"""Flights of particles in a channel with rough walls, and the times after which they leave it, by simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checkpoints import Stored
from ...core.checks import (
    Floats,
    Rng,
    check_memory,
    choice,
    finite_array,
    frozen,
    generator,
    new_seed,
    number_between,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, with_errors
from ...core.long_runs import Engine, all_parts, identity_of, reported
from ...kernels import Law
from ...kernels.bases.angles import joined_lists
from ...kernels.bases.measure import SINE
from ...kernels.hemisphere.hemisphere_law import DirectionLaw
from ...kernels.laws.law import in_frame
from ...kernels.laws.matrix_law import check_law
from ...kernels.laws.structure import holds_of_all

Arrangement = Literal["mirror", "half-turn"]
L = TypeVar("L", Law, DirectionLaw)

# Smallest angle; below half of it, pi - theta would round to pi.
SMALLEST = float(np.spacing(np.pi))
# Limit on the flights of a particle; a law that retroreflects for ever reaches it.
MOST_FLIGHTS = 1_000_000
# Larger radii and speeds overflow in products with lengths, as do their inverses.
LARGEST = 1e150
# Particles of a part: their random numbers depend on its number alone.
TOGETHER = 4096


@dataclass(frozen=True, repr=False)
class ExitTimes(Summary):
    """Times to leave -L < x < L, for particles that start at x = 0 with the angles' distribution sin(theta)/2 d theta.

    Attributes
    ----------
    lengths : array of shape (n,)
        Increasing values of L.
    times : array of shape (particles, n)
        Time at which a particle first reaches x = L or x = -L.
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    """

    lengths: Floats
    times: Floats
    radius: float
    speed: float
    _unit = "times in length / speed"

    def _facts(self) -> dict[str, object]:
        half = NORMAL_95 * self.times.std(axis=0, ddof=1) / np.sqrt(len(self.times))
        return {"lengths": self.lengths, "means": with_errors(self.means, half), "particles": len(self.times)}

    @property
    def means(self) -> Floats:
        """Mean exit times, shape (n,)."""
        return np.asarray(self.times.mean(axis=0))

    @property
    def scaled(self) -> Floats:
        """The ratio L^2/(D_0 tau(L)), which is eta ln(L/r) plus a constant for L well above ``Diffusivity.onset``."""
        return self.lengths**2 / (4.0 * self.radius * self.speed / np.pi * self.means)

    def eta(self) -> Estimate:
        """The ratio eta of D to its value D_0 for diffuse walls, from the slope of L^2/(D_0 tau) in ln L.

        The value is the slope over the upper half of the lengths. The error is the half width of its 95 % interval, by
        the delta method over particles, plus the difference from the slope over the lower half. It is the limit only if
        the lengths are well above ``Diffusivity.onset``, and the law preserves sin(theta) d theta.
        """
        log = np.log(self.lengths)
        middle = len(log) // 2
        upper, lower = _slope_weights(log[middle:]), _slope_weights(log[: middle + 1])
        value = float(upper @ self.scaled[middle:])
        drift = abs(value - float(lower @ self.scaled[: middle + 1]))
        # to first order an error e of the mean changes scaled by -scaled/mean e, for every L
        influence = (self.times / self.means)[:, middle:] @ (-self.scaled[middle:] * upper)
        spread = float(influence.std(ddof=1) / np.sqrt(len(self.times)))
        method = f"slope of L^2/(D_0 tau) in ln L, {len(self.times)} particles"
        return Estimate(value, NORMAL_95 * spread + drift, "estimate", method)


def _slope_weights(log: Floats) -> Floats:
    deviation = log - log.mean()
    return np.asarray(deviation / np.sum(deviation**2))


@reported("exit times")
def exit_times(
    law: Law,
    lengths: ArrayLike,
    particles: int,
    rng: Rng = None,
    radius: float = 1.0,
    speed: float = 1.0,
    arrangement: Arrangement = "mirror",
    other: Law | None = None,
    **engine: Unpack[Engine],
) -> ExitTimes:
    """Simulate exit times of particles from a channel between two rough walls.

    Parameters
    ----------
    law : Law
        The law of both walls, or of the lower one, in either convention.
    lengths : array_like
        At least three increasing values of L at which exits are timed.
    particles : int
        Number of particles, at least 2.
    rng : None, int or numpy.random.Generator
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    arrangement : {"mirror", "half-turn"}
        The upper wall is the mirror image of the lower one, or is rotated by pi.
    other : Law, optional
        The law of the upper wall, as it is when this wall lies below, in the same convention. Every second particle
        then starts at it.
    checkpoint : path, optional
        A file to which the times of every 4096 particles are added; the same call goes on with it.
    client : int, str or distributed.Client, optional
        As of `sweep`. The times are the same to the last bit without checkpoint and workers.
    key : str, optional
        As of `sweep`.

    Returns
    -------
    ExitTimes

    Raises
    ------
    InputError
        If the lengths do not increase, a particle has not left after 10^6 flights, or every ray keeps its angle to the
        wall, so that the mean exit times are infinite; if the checkpoint is of another simulation.

    Examples
    --------
    >>> from asperity.kernels.laws.density import lambertian
    >>> found = exit_times(lambertian(), [5.0, 10.0, 20.0], 500, np.random.default_rng(0))
    >>> bool(found.means[0] < found.means[1])
    True
    """
    return simulated_times(law, other, lengths, particles, rng, radius, speed, arrangement, engine)


def simulated_times(
    law: Law,
    other: Law | None,
    lengths: ArrayLike,
    particles: int,
    rng: Rng,
    radius: float,
    speed: float,
    arrangement: Arrangement,
    engine: Engine,
    least: int = 3,
) -> ExitTimes:
    """`exit_times` at ``least`` lengths or more."""
    laws, levels = checked(law, other, "lengths", lengths, arrangement, particles, least)
    refuse_kept_sines(*laws)
    half = number_between("radius", radius, 1.0 / LARGEST, LARGEST)
    pace = number_between("speed", speed, 1.0 / LARGEST, LARGEST)
    root = new_seed(generator(rng))
    job = _Particles(laws[0], laws[-1], levels, particles, root, half, pace, arrangement)
    parts = all_parts(job.times, -(-particles // TOGETHER), identity_of("exit times", job), engine, job.stored)
    return ExitTimes(frozen(levels), frozen(np.concatenate([part["times"] for part in parts])), half, pace)


def in_paper_frame(law: Law) -> Law:
    """The law in the paper's convention; an InputError if it is no law."""
    check_law("law", law, "a Law such as ker.WallLaw(wall)")
    return in_frame(law, "paper")


def laws_of_walls(law: Law, other: Law | None) -> tuple[Law, ...]:
    """The laws of the lower and of the upper wall in the paper's convention; one law if they are the same."""
    paper = in_paper_frame(law)
    if other is None:
        return (paper,)
    check_law("other", other, "a Law in the plane such as ker.WallLaw(wall), as the first is")
    if other.frame != law.frame:
        raise InputError(
            f"other: expected a law in the convention of the first, {law!r}, got {other!r}; call in_specular_frame() "
            "on one of them"
        )
    return tuple(dict.fromkeys((paper, in_frame(other, "paper"))))


def checked(
    law: Law, other: Law | None, name: str, levels: ArrayLike, arrangement: str, particles: int, least: int = 3
) -> tuple[tuple[Law, ...], Floats]:
    """The laws of the walls in the paper's convention and increasing levels, at which each particle gives a number."""
    laws, found = laws_of_walls(law, other), finite_array(name, levels).ravel()
    if found.size < least or found[0] <= 0.0 or np.any(np.diff(found) <= 0.0):
        raise InputError(f"{name}: expected at least {least} increasing positive {name}, got {shortened(levels)}")
    choice("arrangement", arrangement, get_args(Arrangement))
    check_memory("particles", f"the table of {name}", 2 * found.size * whole_number("particles", particles, 2))
    return laws, found


def refuse_kept_sines(*laws: Law) -> None:
    """An InputError if at these walls every ray keeps its angle to the wall."""
    if all(holds_of_all(law, lambda part: part.keeps_sine) for law in laws):
        raise InputError(
            "law: every ray keeps its angle to the wall, so all flights of a particle are equally long, the mean "
            "exit times are infinite and the particles have no common diffusivity; got "
            f"{' and '.join(map(repr, laws))}, expected a law that changes angles, as a mixture with lambertian() does"
        )


def sampled(laws: Sequence[L], incoming: Floats, wall: Floats, rng: np.random.Generator) -> Floats:
    """What the laws of the walls draw for incoming angles or velocities at walls of these numbers."""
    if len(laws) == 1:
        return laws[0].sample(incoming, rng)
    found = np.empty_like(incoming)
    for number, law in enumerate(laws):
        here = wall == number
        if here.any():
            found[here] = law.sample(incoming[here], rng)
    return found


def reflected(laws: Sequence[Law], incoming: Floats, wall: Floats, rng: np.random.Generator) -> Floats:
    """Outgoing angles; incoming ones that rounding took to 0 or pi are moved inside."""
    return sampled(laws, np.clip(incoming, SMALLEST, np.pi - SMALLEST), wall, rng)


@dataclass(frozen=True)
class Channel:
    """Flights between two walls: number 0 is the lower or inner one, number 1 the other.

    ``direction`` is the angle in (0, pi) between the direction of flight and the walls where the flight begins; its
    cosine is positive in the direction of the channel.
    """

    half: float
    # radius of the middle line; inf in a straight channel
    bend: float
    # whether the x axis of the upper wall's frame runs against the channel
    turned: bool

    @property
    def is_straight(self) -> bool:
        """Whether the walls are lines."""
        return math.isinf(self.bend)

    @property
    def longest(self) -> float:
        """The longest flight: in a straight channel at the least angle, in a bent one along the inner circle."""
        return 2.0 * self.half / SMALLEST if self.is_straight else 4.0 * math.sqrt(self.half) * math.sqrt(self.bend)

    def framed(self, angle: Floats, wall: Floats) -> Floats:
        """The angle in the frame of the wall, from that in the channel, and the other way round."""
        return np.where((wall > 0) & self.turned, math.pi - angle, angle)

    def flight(self, direction: Floats, wall: Floats) -> tuple[Floats, Floats, Floats]:
        """Length of the flight, the wall at its end, and the angle of the same direction with this wall."""
        sine, cosine = np.sin(direction), np.cos(direction)
        if self.is_straight:
            return 2.0 * self.half / sine, 1.0 - wall, direction
        inner, outer = self.bend - self.half, self.bend + self.half
        start, end = np.where(wall > 0, outer, inner), np.where(wall > 0, inner, outer)
        # distance of the line from the centre is start * cosine; at the other wall the angle has this cosine
        level = start * cosine / end
        passes = (wall > 0) & (np.abs(level) >= 1.0)
        level = np.clip(level, -1.0, 1.0)
        rise = end * np.sqrt((1.0 - level) * (1.0 + level))
        length = np.where(passes, 2.0 * outer * sine, np.abs(rise - start * sine))
        return length, np.where(passes, wall, 1.0 - wall), np.where(passes, direction, np.arccos(level))

    def advance(self, direction: Floats, wall: Floats, length: Floats) -> Floats:
        """The increase of X along a part of this length of a flight."""
        along, up = length * np.cos(direction), length * np.sin(direction)
        if self.is_straight:
            return along
        radial = np.where(wall > 0, self.bend + self.half - up, self.bend - self.half + up)
        return np.asarray(self.bend * np.arctan2(along, radial))

    def crossings(
        self, laws: Sequence[Law], levels: Floats, wall: Floats, rng: np.random.Generator, *, of_x: bool
    ) -> Floats:
        """Where particles that start at X = 0 on these walls cross increasing levels, shape (particles, n).

        Levels of abs(X), in a straight channel: the lengths of path up to them. Levels of the length of path: X there.
        """
        found, going = np.full((len(wall), levels.size), np.nan), np.arange(len(wall))
        x, run, reached = np.zeros(len(wall)), np.zeros(len(wall)), np.zeros(len(wall), dtype=np.int64)
        direction = self.framed(SINE.sample(len(wall), rng), wall)
        for _ in range(MOST_FLIGHTS):
            length, after, arriving = self.flight(direction, wall)
            shift = self.advance(direction, wall, length)
            x_end, run_end = x + shift, run + length
            who, level, reached = _passed(levels, reached, np.abs(x_end) if of_x else run_end)
            if of_x:
                ahead = np.copysign(levels[level], x_end[who]) - x[who]
                found[going[who], level] = run[who] + ahead / shift[who] * length[who]
            else:
                ahead = levels[level] - run[who]
                found[going[who], level] = x[who] + self.advance(direction[who], wall[who], ahead)
            stays = reached < levels.size
            if not stays.any():
                return found
            x, run, wall = x_end[stays], run_end[stays], after[stays]
            going, reached = going[stays], reached[stays]
            incoming = math.pi - self.framed(arriving[stays], wall)
            direction = self.framed(reflected(laws, incoming, wall, rng), wall)
        walls = " and ".join(map(repr, laws))
        raise InputError(f"law: {walls} keeps {len(x)} particles below {levels[-1]:g} after {MOST_FLIGHTS} flights")


def _passed(levels: Floats, reached: NDArray[np.int64], ends: Floats) -> tuple[NDArray[np.int64], ...]:
    """Particles and the levels that their flights to these ends pass, as index pairs; then all numbers of levels."""
    after = np.maximum(reached, np.searchsorted(levels, ends, side="right"))
    particle, rank = joined_lists(after - reached)
    return particle, reached[particle] + rank, after


@dataclass(frozen=True)
class _Particles:
    """Particles in a channel, ``TOGETHER`` of them at a time; what a worker is sent."""

    law: Law
    other: Law
    lengths: Floats
    particles: int
    seed: tuple[int, ...]
    radius: float
    speed: float
    arrangement: Arrangement

    def count(self, part: int) -> int:
        """The particles of a part."""
        return min(TOGETHER, self.particles - part * TOGETHER)

    def stored(self, part: int) -> dict[str, Stored]:
        """What the arrays of a part must be."""
        return {"times": Stored("f", (self.count(part), self.lengths.size), 0.0)}

    def times(self, part: int) -> dict[str, Floats]:
        """Exit times of the particles of one part, which depend on its number alone."""
        channel = Channel(self.radius, math.inf, self.arrangement == "half-turn")
        laws = tuple(dict.fromkeys((self.law, self.other)))
        wall, rng = np.arange(self.count(part)) % len(laws), np.random.default_rng([*self.seed, part])
        return {"times": channel.crossings(laws, self.lengths, wall.astype(np.float64), rng, of_x=True) / self.speed}
