"""Direct simulation of a channel: exit times of particles that fly from wall to wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, frozen, generator, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate
from ...kernels import Law
from ...kernels.bases.measure import SINE
from .diffusion import Arrangement, check_arrangement

# pi - theta for a theta below half a spacing of pi would be pi itself.
SMALLEST = float(np.spacing(np.pi))
# Flights after which a particle that has not left is a sign of a law that goes back and forth.
MOST_CROSSINGS = 1_000_000


@dataclass(frozen=True)
class ExitTimes:
    """Mean times to leave |x| < L, starting at x = 0 from a wall with the invariant distribution of angles.

    Attributes
    ----------
    lengths : array of shape (n,)
        L, increasing.
    times : array of shape (particles, n)
        Of every particle the time at which it first reaches each L.
    radius, speed : float
        Half the width of the channel and the speed.
    """

    lengths: Floats
    times: Floats
    radius: float
    speed: float

    @property
    def means(self) -> Floats:
        """Mean exit times, shape (n,)."""
        return np.asarray(self.times.mean(axis=0))

    @property
    def scaled(self) -> Floats:
        """L^2/(D_0 tau(L)), which grows like eta ln(L/r)."""
        return self.lengths**2 / (4.0 * self.radius * self.speed / np.pi * self.means)

    def eta(self) -> Estimate:
        """The slope of L^2/(D_0 tau) in ln L: D over that of diffuse walls.

        The slope settles as L grows, so that the upper half of the lengths gives the value; the error is the
        half width of its interval of 95 %, by the delta method over particles, plus its difference from that of the
        lower half.
        """
        log = np.log(self.lengths)
        middle = len(log) // 2
        upper, lower = _slope_weights(log[middle:]), _slope_weights(log[: middle + 1])
        value = float(upper @ self.scaled[middle:])
        drift = abs(value - float(lower @ self.scaled[: middle + 1]))
        # to first order scaled moves by -scaled/mean times the mean's error, for every L
        influence = (self.times / self.means)[:, middle:] @ (-self.scaled[middle:] * upper)
        spread = float(influence.std(ddof=1) / np.sqrt(len(self.times)))
        method = f"slope of L^2/(D_0 tau) in ln L, {len(self.times)} particles"
        return Estimate(value, NORMAL_95 * spread + drift, "estimate", method)


def _slope_weights(log: Floats) -> Floats:
    deviation = log - log.mean()
    return np.asarray(deviation / np.sum(deviation**2))


def exit_times(
    law: Law,
    lengths: ArrayLike,
    particles: int,
    rng: np.random.Generator,
    radius: float = 1.0,
    speed: float = 1.0,
    arrangement: Arrangement = "mirror",
) -> ExitTimes:
    """Simulate a channel of two rough walls, flight by flight.

    Parameters
    ----------
    law : Law
        In either convention; it is converted to the paper's.
    lengths : array_like
        Increasing L at which exits are timed.
    particles : int
    rng : numpy.random.Generator
    radius, speed : float
        Half the width of the channel, and the speed.
    arrangement : {"mirror", "half-turn"}
        How the upper wall is made from the lower one.

    Returns
    -------
    ExitTimes

    Raises
    ------
    InputError
        If the lengths do not increase, or a particle has not left after 10^6 flights.

    Examples
    --------
    >>> from asperity.kernels.laws.ideal import lambertian
    >>> found = exit_times(lambertian(), [5.0, 10.0, 20.0], 500, np.random.default_rng(0))
    >>> bool(found.means[0] < found.means[1])
    True
    """
    if not isinstance(law, Law):
        raise InputError(f"law: expected a law such as WallLaw(wall), got {law!r}")
    levels = finite_array("lengths", lengths).ravel()
    if levels.size < 3 or levels[0] <= 0.0 or np.any(np.diff(levels) <= 0.0):
        raise InputError(f"lengths: expected at least three increasing positive lengths, got {lengths!r}")
    check_arrangement(arrangement)
    whole_number("particles", particles, 2)
    width, pace = 2.0 * positive_number("radius", radius), positive_number("speed", speed)
    generator(rng)
    paper = law.in_specular_frame() if law.frame == "specular" else law
    times = np.full((particles, levels.size), np.nan)
    inside = np.arange(particles)
    x, clock, reached = np.zeros(particles), np.zeros(particles), np.zeros(particles, dtype=np.int64)
    # the angle at which a particle leaves a wall, in that wall's own frame, and the sign of its x axis in the channel's
    theta, sign = SINE.sample(particles, rng), 1.0
    for _ in range(MOST_CROSSINGS):
        shift = sign * width * np.cos(theta) / np.sin(theta)
        duration = width / (pace * np.sin(theta))
        target = x + shift
        crossing = np.flatnonzero(np.abs(target) >= levels[reached])
        while crossing.size:
            # the flight is straight: the fraction of it up to |x| = L
            ahead = np.copysign(levels[reached[crossing]], target[crossing]) - x[crossing]
            moment = clock[crossing] + ahead / shift[crossing] * duration[crossing]
            times[inside[crossing], reached[crossing]] = moment
            reached[crossing] += 1
            crossing = crossing[reached[crossing] < levels.size]
            crossing = crossing[np.abs(target[crossing]) >= levels[reached[crossing]]]
        stays = reached < levels.size
        if not stays.any():
            return ExitTimes(frozen(levels), frozen(times), 0.5 * width, pace)
        inside, reached, x, clock = inside[stays], reached[stays], target[stays], (clock + duration)[stays]
        incoming = theta[stays] if arrangement == "half-turn" else np.pi - theta[stays]
        theta = paper.sample(np.clip(incoming, SMALLEST, np.pi - SMALLEST), rng)
        sign = -sign if arrangement == "half-turn" else sign
    raise InputError(f"law: {law!r} keeps {x.size} particles within L = {levels[-1]:g} after {MOST_CROSSINGS} flights")
