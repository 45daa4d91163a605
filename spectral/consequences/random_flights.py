"""Paths X_t of particles in a straight or bent channel, and the variance of both central limit theorems."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, frozen, generator, positive_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, Estimate, Summary, student_95
from ...core.long_runs import reported
from ...core.tables import axes_or_new
from ...kernels import Law
from .channel import MOST_FLIGHTS, Arrangement, Channel, checked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Groups of particles, left out one by one, for the standard error of a function of means.
GROUPS = 32


@dataclass(frozen=True, repr=False)
class ChannelPaths(Summary):
    """Positions along a channel of particles that start at 0 on a wall, with angles as sin(theta)/2 d theta.

    Attributes
    ----------
    times : array, shape (n,)
        Increasing.
    positions : array, shape (particles, n)
        X_t, in a bent channel the arc length along its middle line.
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    bend : float
        Radius of the middle line; inf for a straight channel.
    """

    times: Floats
    positions: Floats
    radius: float
    speed: float
    bend: float

    def variance_rate(self) -> Estimate:
        r"""The variance of the limit of X_t/t^(1/2) in a bent channel, lim E[X_t^2]/t.

        The increase of E[X_t^2] between the middle and the last of the times. The error is a 95 % half width of the
        sampling error, plus the amount by which the rate before the middle differs beyond its sampling error.

        Raises
        ------
        InputError
            In a straight channel, where this limit is infinite.
        """
        if math.isinf(self.bend):
            raise InputError("bend: expected a bent channel; flights in a straight one have no variance")
        middle = len(self.times) // 2
        squares = self.positions[:, [0, middle, -1]] ** 2
        rates = np.diff(squares, axis=1) / np.diff(self.times[[0, middle, -1]])
        value, drift = rates[:, 1], rates[:, 1] - rates[:, 0]
        half, half_of_drift = (NORMAL_95 * float(one.std(ddof=1)) / math.sqrt(len(one)) for one in (value, drift))
        excess = max(abs(float(drift.mean())) - half_of_drift, 0.0)
        return Estimate(float(value.mean()), half + excess, "estimate", f"{len(value)} paths to t = {self.times[-1]:g}")

    def limit_variance(self) -> Estimate:
        r"""The variance of the limit of X_t/(t ln t)^(1/2) in a straight channel.

        The law must preserve sin(theta) d theta. It is half of `diffusivity`, although E[X_t^2] grows like D t ln t:
        half of this comes from few flights that are longer than t^(1/2). The slope of -2 ln E[cos(l X_t)]/(l^2 t) in ln
        t with l = c t^(-1/2), a weighted least squares line through all times. The error is a half width of 95 % from
        leaving out each of 32 groups of particles, plus the amount by which the slope of the later half of the times
        differs beyond its sampling error, plus the change of the slope by an unknown term of relative size (speed
        t/radius)^(-1/2), which flights cause that are under way at t.

        Raises
        ------
        InputError
            In a bent channel, where this limit is 0, or with fewer than 320 particles.
        """
        if math.isfinite(self.bend):
            raise InputError("bend: expected a straight channel; in a bent one the limit of X_t/(t ln t)^(1/2) is 0")
        if len(self.positions) < 10 * GROUPS:
            raise InputError(f"particles: expected at least {10 * GROUPS}, got {len(self.positions)}")
        # of the order of the inverse typical size of X_t/t^(1/2) at the last time
        scale = math.sqrt(self.times[-1]) / float(np.median(np.abs(self.positions[:, -1])))
        wave = np.cos(scale / np.sqrt(self.times) * self.positions)
        group = np.arange(len(wave)) % GROUPS
        sums = np.stack([wave[group == k].sum(axis=0) for k in range(GROUPS)])
        counts = np.bincount(group)
        left = self._slopes((sums.sum(axis=0) - sums) / (len(wave) - counts)[:, None], scale)
        whole = self._slopes(wave.mean(axis=0)[None], scale)[0]
        spread = np.sqrt((GROUPS - 1) / GROUPS * np.sum((left - left.mean(axis=0)) ** 2, axis=0))
        difference = left[:, 1] - left[:, 0]
        noise = math.sqrt((GROUPS - 1) / GROUPS * float(np.sum((difference - difference.mean()) ** 2)))
        quantile = student_95(GROUPS)
        excess = max(abs(float(whole[1] - whole[0])) - quantile * noise, 0.0)
        # at t the flights that are under way change the variance by a part of the order of (speed t/radius)^(-1/2)
        first, last = self.times[[0, -1]] * self.speed / self.radius
        under_way = 2.0 * abs(float(whole[0])) * (first**-0.5 - last**-0.5) / math.log(last / first)
        error = quantile * float(spread[0]) + excess + under_way
        return Estimate(float(whole[0]), error, "estimate", f"characteristic function of {len(wave)} paths")

    def draw(self, variance: Estimate | float, ax: Axes | None = None) -> Axes:
        """Draw a histogram of the last positions over their scale, with the normal density of a variance.

        The scale is t^(1/2) in a bent channel and (t ln t)^(1/2) in a straight one, with t in units of radius/speed.
        """
        axes = axes_or_new(ax)
        time = float(self.times[-1])
        is_straight = math.isinf(self.bend)
        growth = math.log(time * self.speed / self.radius) if is_straight else 1.0
        width = math.sqrt(float(variance))
        at = np.linspace(-4.0 * width, 4.0 * width, 201)
        scaled = self.positions[:, -1] / math.sqrt(time * growth)
        axes.hist(scaled, bins=np.linspace(at[0], at[-1], 41).tolist(), density=True, color="0.8", label="paths")
        normal = np.exp(-0.5 * (at / width) ** 2) / (width * math.sqrt(2.0 * math.pi))
        axes.plot(at, normal, color="C0", label="normal limit")
        scale = r"$X_t/\sqrt{t\,\ln t}$" if is_straight else r"$X_t/\sqrt{t}$"
        axes.set_xlabel(f"{scale}  (length / time$^{{1/2}}$)")
        axes.set_ylabel("probability density")
        axes.legend()
        return axes

    def _slopes(self, means: Floats, scale: float) -> Floats:
        """Slopes in ln t over all times and over the later half, shape (rows, 2), from means of cosines."""
        if np.any(means <= 0.0):
            raise InputError("particles: too few to measure the characteristic function; pass more")
        growth, level = -2.0 * np.log(means) / scale**2, np.log(self.times)
        found = []
        for first in (0, min(len(level) // 2, len(level) - 2)):
            at = level[first:] - level[first:].mean()
            found.append(growth[:, first:] @ at / (at @ at))
        return np.stack(found, axis=1)


@reported("channel paths")
def channel_paths(
    law: Law,
    times: ArrayLike,
    particles: int = 4096,
    rng: Rng = None,
    *,
    radius: float = 1.0,
    speed: float = 1.0,
    bend: float = math.inf,
    arrangement: Arrangement = "mirror",
    other: Law | None = None,
) -> ChannelPaths:
    r"""Simulate the flights of particles between two rough walls.

    Parameters
    ----------
    law : Law
        The law of both walls, or of the lower or inner one, in either convention.
    times : array_like, shape (n,)
        At least three increasing positive times.
    particles : int
    rng : None, int or numpy.random.Generator
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    bend : float
        Radius of the middle line of a channel between two concentric circles, greater than ``radius``; by default the
        channel is straight.
    arrangement : {"mirror", "half-turn"}
        The upper or outer wall is the mirror image of the other one, or is rotated by pi.
    other : Law, optional
        The law of the upper or outer wall, as it is when this wall lies below, in the same convention.

    Returns
    -------
    ChannelPaths

    Raises
    ------
    InputError
        If an argument is not as described, or a particle makes more than 10^6 flights.

    Notes
    -----
    In a straight channel flights have infinite variance, and X_t/(t ln t)^(1/2) tends to a normal variable. In a bent
    one no flight is longer than the tangent of the inner circle, and X_t/t^(1/2) does. A particle starts on each of
    the walls with a probability proportional to its length.

    Source: Rudzis 2022, section 1.2.6; T. Chumley, R. Feres and H.-K. Zhang, Multiscale Model. Simul. 11 (2013) 1179,
    for the straight channel.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> straight = spec.channel_paths(ker.lambertian(), [50, 200, 800], 4000, rng=1)
    >>> found = straight.limit_variance()
    >>> abs(float(found) - 0.5 * float(spec.diffusivity(ker.lambertian()))) < found.error
    True

    Particles between smooth walls keep their direction:

    >>> smooth = spec.channel_paths(ker.specular(), [1.0, 2.0, 4.0], 3, rng=0)
    >>> bool(np.allclose(smooth.positions[:, 2], 4.0 * smooth.positions[:, 0]))
    True
    """
    laws, moments = checked(law, other, "times", times, arrangement, particles)
    half, pace = positive_number("radius", radius), positive_number("speed", speed)
    middle = math.inf if isinstance(bend, float) and bend == math.inf else positive_number("bend", bend)
    if not middle > half:
        raise InputError(f"bend: expected a number greater than the radius {half:g}, got {bend!r}")
    channel = Channel(half, middle, arrangement == "half-turn")
    latest = MOST_FLIGHTS * channel.longest / pace
    if not moments[-1] <= latest:
        raise InputError(f"times: expected at most {latest:.3g} ({MOST_FLIGHTS} flights), got {moments[-1]:.3g}")
    source = generator(rng)
    outer = source.random(particles) < (0.5 if channel.is_straight else 0.5 * (1.0 + half / middle))
    positions = channel.crossings(laws, pace * moments, outer.astype(np.float64), source, of_x=False)
    return ChannelPaths(frozen(moments), frozen(positions), half, pace, middle)
