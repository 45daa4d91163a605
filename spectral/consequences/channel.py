"""Exit times of particles from a channel with rough walls, by direct simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Unpack, get_args

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
    instance,
    number_between,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, with_errors
from ...core.long_runs import Engine, all_parts, reported
from ...core.version import __version__
from ...kernels import Law, PolygonLaw, RectangularTeethLaw, WallLaw
from ...kernels.bases.measure import SINE
from ...kernels.laws.law import IsometryLaw
from ...kernels.laws.structure import holds_of_all

Arrangement = Literal["mirror", "half-turn"]

# Smallest angle; below half of it, pi - theta would round to pi.
SMALLEST = float(np.spacing(np.pi))
# Limit on the flights of a particle; a law that retroreflects for ever reaches it.
MOST_FLIGHTS = 1_000_000
# Larger radii and speeds overflow in products with lengths.
LARGEST = 1e150
# Particles of a part: their random numbers depend on its number alone.
TOGETHER = 4096


@dataclass(frozen=True, repr=False)
class ExitTimes(Summary):
    """Times to leave -L < x < L, for particles that start at x = 0 with the invariant distribution of angles.

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
        the lengths are well above ``Diffusivity.onset``.
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
    **engine: Unpack[Engine],
) -> ExitTimes:
    """Simulate exit times of particles from a channel between two rough walls.

    Parameters
    ----------
    law : Law
        The law of the walls, in either convention.
    lengths : array_like
        At least three increasing values of L at which exits are timed.
    particles : int
        Number of particles, at least 2.
    rng : None, int or numpy.random.Generator
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    arrangement : {"mirror", "half-turn"}
        The upper wall is the mirror image of the lower one, or is rotated by pi.
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
    >>> from asperity.kernels.laws.ideal import lambertian
    >>> found = exit_times(lambertian(), [5.0, 10.0, 20.0], 500, np.random.default_rng(0))
    >>> bool(found.means[0] < found.means[1])
    True
    """
    return simulated_times(law, lengths, particles, rng, radius, speed, arrangement, engine)


def simulated_times(
    law: Law,
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
    paper, levels = checked(law, "lengths", lengths, arrangement, particles, least)
    refuse_kept_sines(paper)
    width, pace = 2.0 * number_between("radius", radius, 0.0, LARGEST), number_between("speed", speed, 0.0, LARGEST)
    root = tuple(int(word) for word in generator(rng).integers(0, 2**63, size=2))
    job = _Particles(paper, levels, particles, root, width, pace, arrangement)
    parts = all_parts(job.times, -(-particles // TOGETHER), job.identity(), engine, job.stored)
    return ExitTimes(frozen(levels), frozen(np.concatenate([part["times"] for part in parts])), 0.5 * width, pace)


def in_paper_frame(law: Law) -> Law:
    """The law in the paper's convention; an InputError if it is no law."""
    instance("law", law, Law, "ker.WallLaw(wall)")
    return law.in_specular_frame() if law.frame == "specular" else law


def checked(
    law: Law, name: str, levels: ArrayLike, arrangement: str, particles: int, least: int = 3
) -> tuple[Law, Floats]:
    """The law in the paper's convention and increasing levels, at which each particle gives a number."""
    paper, found = in_paper_frame(law), finite_array(name, levels).ravel()
    if found.size < least or found[0] <= 0.0 or np.any(np.diff(found) <= 0.0):
        count = {1: "one or more", 3: "at least three"}[least]
        raise InputError(f"{name}: expected {count} increasing positive {name}, got {shortened(levels)}")
    choice("arrangement", arrangement, get_args(Arrangement))
    check_memory("particles", f"the table of {name}", 2 * found.size * whole_number("particles", particles, 2))
    return paper, found


def refuse_kept_sines(law: Law) -> None:
    """An InputError if every ray keeps its angle to the wall."""
    if holds_of_all(law, _keeps_sines):
        raise InputError(
            "law: every ray keeps its angle to the wall, so all flights of a particle are equally long, the mean "
            f"exit times are infinite and the particles have no common diffusivity; got {law!r}, expected a law that "
            "changes angles, as a mixture with lambertian() does"
        )


def _keeps_sines(law: Law) -> bool:
    """Whether a law is known to consist of theta' = theta and theta' = pi - theta."""
    if isinstance(law, (WallLaw, PolygonLaw)):
        wall = law.wall
        steps = [np.subtract(piece.end, piece.start) for loop in (wall.pieces, *wall.islands) for piece in loop]
        return wall.is_polygonal and all(np.count_nonzero(step) == 1 for step in steps)
    return isinstance(law, (IsometryLaw, RectangularTeethLaw))


def reflected(law: Law, incoming: Floats, rng: np.random.Generator) -> Floats:
    """Outgoing angles; incoming ones that rounding took to 0 or pi are moved inside."""
    return law.sample(np.clip(incoming, SMALLEST, np.pi - SMALLEST), rng)


def passed(levels: Floats, reached: NDArray[np.int64], ends: Floats) -> tuple[NDArray[np.int64], ...]:
    """Particles and the levels that their flights to these ends pass, as index pairs; then all numbers of levels."""
    after = np.maximum(reached, np.searchsorted(levels, ends, side="right"))
    particle = np.repeat(np.arange(len(ends)), after - reached)
    return particle, np.arange(len(particle)) - np.repeat(np.cumsum(after - reached) - after, after - reached), after


@dataclass(frozen=True)
class _Particles:
    """Particles in a channel, ``TOGETHER`` of them at a time; what a worker is sent."""

    law: Law
    levels: Floats
    particles: int
    root: tuple[int, ...]
    width: float
    speed: float
    arrangement: Arrangement

    def identity(self) -> dict[str, Any]:
        """What tells these particles from others."""
        return {
            "computation": "exit times", "version": __version__, "law": self.law,
            "lengths": self.levels, "particles": self.particles, "seed": self.root,
            "width": self.width, "speed": self.speed, "arrangement": self.arrangement,
        }  # fmt: skip

    def stored(self, part: int) -> dict[str, Stored]:
        """What the arrays of a part must be."""
        shape = min(TOGETHER, self.particles - part * TOGETHER), self.levels.size
        return {"times": Stored("f", shape, 0.0)}

    def times(self, part: int) -> dict[str, Floats]:
        """Exit times of the particles of one part, which depend on its number alone."""
        rng = np.random.default_rng([*self.root, part])
        count, levels = min(TOGETHER, self.particles - part * TOGETHER), self.levels
        times, inside = np.full((count, levels.size), np.nan), np.arange(count)
        x, clock, reached = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.int64)
        # angle at which a particle leaves a wall, in the frame of this wall, and the sign of its x axis in the channel
        theta, sign = SINE.sample(count, rng), 1.0
        half_turn = self.arrangement == "half-turn"
        for _ in range(MOST_FLIGHTS):
            shift = sign * self.width * np.cos(theta) / np.sin(theta)
            duration = self.width / (self.speed * np.sin(theta))
            target = x + shift
            out, level, reached = passed(levels, reached, np.abs(target))
            # fraction of the ray segment up to |x| = L
            ahead = np.copysign(levels[level], target[out]) - x[out]
            times[inside[out], level] = clock[out] + ahead / shift[out] * duration[out]
            stays = reached < levels.size
            if not stays.any():
                return {"times": times}
            inside, reached, x, clock = inside[stays], reached[stays], target[stays], (clock + duration)[stays]
            incoming = theta[stays] if half_turn else np.pi - theta[stays]
            theta = reflected(self.law, incoming, rng)
            sign = -sign if half_turn else sign
        raise InputError(
            f"law: {self.law!r} keeps {x.size} particles within L = {levels[-1]:g} after {MOST_FLIGHTS} flights"
        )
