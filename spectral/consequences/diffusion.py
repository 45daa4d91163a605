"""Diffusion in a channel with rough walls: its slope in the logarithm of the length, and its value at a length."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, choice, frozen, positive_number
from ...core.errors import AccuracyError, AsperityError, InputError
from ...core.estimates import NORMAL_95, ErrorKind, Estimate, Summary
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...kernels import Law
from ..bounds.contraction import refuse_unless_invariant
from ..essential.edge import grazing_symbol
from .channel import Arrangement, in_paper_frame, laws_of_walls, refuse_kept_sines, simulated_times

# Sign of the displacement of rays that leave near theta = 0 and near theta = pi.
DIRECTION = np.array([1.0, -1.0])
# A persistence within this distance of 1 counts as 1: the particle never reverses its direction.
BALLISTIC = 1e-12
# With a larger error of the persistence it is not known whether the particle reverses its direction.
LARGEST_UNCERTAINTY = 1e-3

# Incoming angles, and rays at each, for the length from which on the limit holds within this distance of zeta.
ONSET_ANGLES, ONSET_RAYS, NEAR_LIMIT = 10.0 ** -np.arange(0.25, 3.1, 0.25), 2000, 0.1
# Onsets beyond this multiple of the radius are warned of.
FAR_ONSET = 1000.0


@dataclass(frozen=True, repr=False)
class Diffusivity(Estimate):
    r"""The slope D of L^2/tau(L) against ln(L/r) in a channel with two parallel rough walls, for long channels.

    tau(L) is the mean time to leave -L < x < L. The displacements between collisions have infinite variance, and the
    tails of their distribution determine D, the limit of the slope. It is the same, 4 r s / pi, for all walls that turn
    grazing flights, whatever their shape. D is not L^2/tau of a channel: to D ln(L/r) this adds a constant, which for
    shallow or nearly smooth walls is many times larger at any length of use. `channel_diffusivity` gives the
    diffusivity at a length. The unit is that of radius x speed.

    Attributes
    ----------
    onset : float
        The length from which on flights are turned as in the limit, in the unit of ``radius``; D is the slope for
        L well above it. At incoming angles theta with 2 r cot(theta) above it, the persistence is within 0.1 of zeta,
        by 2000 rays at each of some angles down to 1e-3. ``inf`` if it is not reached there, at 2000 r.
    eta : float
        D / D_0, where D_0 = 4 r s / pi is the diffusivity for diffuse walls.
    zeta : float
        Persistence of grazing ray segments, lim E[cot(Theta) / cot(theta)] in Feres' convention.
        eta = (1 + zeta)/(1 - zeta) for mirror-symmetric laws.
    eta_error, zeta_error : float
        Errors of ``eta`` and ``zeta``.
    arrangement : {"mirror", "half-turn"}
    """

    eta: float
    eta_error: float
    zeta: float
    zeta_error: float
    arrangement: Arrangement
    onset: float
    _unit = "radius x speed"

    def __str__(self) -> str:
        far = f"well above {self.onset:.2g}" if np.isfinite(self.onset) else "beyond 2000 r at least"
        return f"{super().__str__()}, the slope of L^2/tau against ln(L/r) for L {far}"

    def _headline(self) -> str:
        same = ", the same for all walls that turn grazing flights" if abs(self.eta - 1.0) <= self.eta_error else ""
        return f"{self}{same}"


def diffusivity(law: Law, radius: float = 1.0, speed: float = 1.0, arrangement: Arrangement = "mirror") -> Diffusivity:
    r"""The slope D of L^2/tau(L) against ln(L/r) for the mean exit time tau of a long channel: see `Diffusivity`.

    It is the same number for all walls that turn grazing flights. For the diffusivity of a channel of given length use
    `channel_diffusivity`, which is L^2/(2 tau): far out it grows like half of D ln(L/r), because the factor 1/2 of
    Fick's law is not in D. A `UserWarning` says so where D is the slope beyond a length of 1000 r only.

    Parameters
    ----------
    law : Law
        The law of the walls, in either convention.
    radius : float
        Half the width r of the channel.
    speed : float
        Speed s of the particles.
    arrangement : {"mirror", "half-turn"}
        The upper wall is the mirror image of the lower one, or is rotated by pi. For mirror-symmetric cells both are
        the same.

    Returns
    -------
    Diffusivity

    Raises
    ------
    InputError
        If the law preserves the direction of grazing rays, like specular reflection: D is infinite. If every ray leaves
        at its own or at the mirrored angle, as at rectangular teeth: the length of all flights of a particle is then
        the same, so that the particles do not share one diffusivity. If the law does not preserve sin(theta) d theta:
        its particles drift or have flights of another distribution, and L^2/tau has no slope.
    AccuracyError
        If the limit at grazing is not known well enough to bound D; ``defect`` is the error of zeta.

    Notes
    -----
    A ray segment at the angle theta has the displacement 2 r cot(theta). Under sin(theta) d theta displacements have
    a density with tails of order -3, so their variance grows like ln L. D depends on the correlation of successive long
    displacements. With the matrix M of `grazing_symbol` and c = (1, -1), eta = c^T (2 (1 - F)^(-1) - 1) c / 2, where
    F = M SWAP for mirror images and F = -M for half-turns.

    Source: T. Chumley, R. Feres and H.-K. Zhang, Multiscale Model. Simul. 11 (2013) 1179, for the mirror-symmetric
    case.

    Examples
    --------
    Maxwell's law with a diffuse fraction a has eta = (2 - a)/a:

    >>> from asperity import kernels as ker, spectral as spec
    >>> found = spec.diffusivity(ker.maxwell(0.5))
    >>> round(found.eta, 12), round(found.value * np.pi, 12)
    (3.0, 12.0)
    """
    found = logarithmic_slope(law, radius, speed, arrangement)
    if found.onset > FAR_ONSET * radius:
        warnings.warn(
            f"diffusivity: D = {found.value:.4g} is the slope of L^2/tau against ln(L/r) for lengths L beyond "
            f"{FAR_ONSET:g} r only, and says nothing about shorter channels; channel_diffusivity(law, lengths) gives "
            "the diffusivity at their lengths",
            stacklevel=2,
        )
    return found


@dataclass(frozen=True, repr=False)
class ChannelDiffusivity(Summary):
    r"""Mean exit times tau(L) from channels -L < x < L, and the diffusivity L^2/(2 tau) at each length.

    Particles that diffuse by Fick's law, with the variance 2 D_F t, leave in the mean time L^2/(2 D_F). So L^2/(2 tau)
    is the coefficient D_F of the channel of this length. Far beyond ``onset``, twice this coefficient grows like
    D ln(L/r) with the D of `diffusivity`.

    Attributes
    ----------
    lengths : array, shape (n,)
        Increasing values of L, half of the distance between the ends.
    times, time_errors : array, shape (n,)
        Mean exit times tau(L) of particles that start at x = 0 on a wall with angles as sin(theta)/2
        d theta, and half widths of their 95 % intervals.
    onset : float
        As of `Diffusivity`: the logarithmic law holds for L well above it. ``inf`` also where `diffusivity` refuses the
        law.
    particles : int
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    """

    lengths: Floats
    times: Floats
    time_errors: Floats
    onset: float
    particles: int
    radius: float
    speed: float
    _show = "lengths values onset particles"
    _unit = "values in radius x speed"

    @property
    def values(self) -> Floats:
        """The diffusivities L^2/(2 tau), shape (n,), in the unit of radius x speed."""
        return np.asarray(0.5 * self.lengths**2 / self.times)

    @property
    def errors(self) -> Floats:
        """Half widths of the 95 % intervals of ``values``, to first order."""
        return np.asarray(self.values * self.time_errors / self.times)


@reported("channel diffusivity")
def channel_diffusivity(
    law: Law,
    lengths: ArrayLike,
    particles: int = 4096,
    rng: Rng = None,
    *,
    radius: float = 1.0,
    speed: float = 1.0,
    arrangement: Arrangement = "mirror",
    other: Law | None = None,
) -> ChannelDiffusivity:
    """The diffusivity L^2/(2 tau) of channels of given lengths between two rough walls, by simulated exit times tau.

    Without the 1/2, L^2/tau grows like D ln(L/r) in long channels, with the slope D of `diffusivity`. Particles start
    with the distribution sin(theta)/2 d theta, which the law need not preserve.

    Parameters
    ----------
    law : Law
        The law of both walls, or of the lower one, in either convention.
    lengths : array_like
        Increasing values of L, half of the distance between the ends, in the unit of ``radius``.
    particles : int
        Number of particles, at least 2. The relative error is about 1.6 divided by the square root of it.
    rng : None, int or numpy.random.Generator
    radius, speed : float
        Half the width of the channel, and the speed of the particles.
    arrangement : {"mirror", "half-turn"}
        The upper wall is the mirror image of the lower one, or is rotated by pi.
    other : Law, optional
        The law of the upper wall, as it is when this wall lies below, in the same convention. Half of the particles
        start at each wall, and ``onset`` is the larger one of both laws.

    Returns
    -------
    ChannelDiffusivity

    Raises
    ------
    InputError
        If an argument is not as described, a particle has not left after 10^6 flights, or every ray keeps its angle to
        the wall, so that the mean exit time is infinite.

    Examples
    --------
    `diffusivity` is the same for diffuse walls and for shallow arcs; at a length of 20 r their diffusivities differ:

    >>> from asperity import kernels as ker, spectral as spec
    >>> spec.channel_diffusivity(ker.lambertian(), [20.0], rng=1)
    ChannelDiffusivity
    lengths   20
    values    1.26(4)
    onset     3.17352
    particles 4096
    unit      values in radius x speed
    more      .times, .time_errors, .radius, .speed, .errors
    >>> shallow = spec.channel_diffusivity(ker.CircularArcLaw(0.3), [20.0], rng=1)
    >>> print(*shallow.values.round(2), round(shallow.onset))
    3.63 36

    A smooth wall doubles a channel: its image is a channel of twice the radius with the other wall on both sides.

    >>> half = spec.channel_diffusivity(ker.lambertian(), [40.0], rng=1, other=ker.specular())
    >>> double = spec.channel_diffusivity(ker.lambertian(), [40.0], rng=2, radius=2.0)
    >>> bool(abs(half.values[0] - double.values[0]) < half.errors[0] + double.errors[0])
    True
    """
    found = simulated_times(law, other, lengths, particles, rng, radius, speed, arrangement, {}, least=1)
    errors = NORMAL_95 * found.times.std(axis=0, ddof=1) / np.sqrt(len(found.times))
    try:
        onset = _onset_in_channel(laws_of_walls(law, other), found.radius)
    except AsperityError:
        onset = np.inf
    return ChannelDiffusivity(
        found.lengths, frozen(found.means), frozen(errors), onset, len(found.times), found.radius, found.speed
    )


def logarithmic_slope(law: Law, radius: float, speed: float, arrangement: Arrangement) -> Diffusivity:
    """`diffusivity` without a warning."""
    paper = in_paper_frame(law)
    refuse_unless_invariant(paper, "L^2/tau has no slope in ln L; channel_diffusivity(law, lengths) simulates channels")
    scale = 4.0 * positive_number("radius", radius) * positive_number("speed", speed) / np.pi
    choice("arrangement", arrangement, get_args(Arrangement))
    symbol = grazing_symbol(paper)
    # F, from one long displacement to the next, in the frame of the channel
    step = symbol.matrix[:, ::-1] if arrangement == "mirror" else -symbol.matrix
    zeta = float(0.5 * DIRECTION @ step @ DIRECTION)
    uncertainty = 2.0 * symbol.entry_error
    known = uncertainty <= LARGEST_UNCERTAINTY
    if known and abs(np.linalg.eigvals(step)).max() >= 1.0 - BALLISTIC and zeta > 1.0 - uncertainty - BALLISTIC:
        raise InputError(
            f"law: {law!r} keeps the direction of grazing flights (zeta = {zeta:.6g}), so the diffusivity is infinite; "
            "expected a law that turns them round at times, as a mixture with lambertian() does"
        )
    refuse_kept_sines(law)
    # the limit follows from the structure of the law, or from the shape of the wall at y = 0
    exact = symbol.entry_error == 0.0
    if not exact and zeta + uncertainty >= 1.0 - BALLISTIC:
        raise AccuracyError(
            f"law: the limit of grazing rays under {law!r} is known to {uncertainty:.2g} only (zeta = {zeta:.3g}), "
            "which does not bound the diffusivity; deep hollows with vertical sides turn these rays round or not with "
            "every change of the angle. channel_diffusivity(law, lengths) simulates channels of given lengths",
            uncertainty,
        )
    eta = float(0.5 * DIRECTION @ (2.0 * np.linalg.inv(np.eye(2) - step) - np.eye(2)) @ DIRECTION)
    # from the derivative of (1 + zeta)/(1 - zeta) at the worst end of the interval of zeta
    eta_error = 2.0 * uncertainty / max(1.0 - zeta - uncertainty, BALLISTIC) ** 2
    kind: ErrorKind = "bound" if exact else "estimate"
    if exact:
        eta_error = 8.0 * EPS * (1.0 + eta) / (1.0 - zeta)
        uncertainty = 4.0 * EPS
    method = f"limit of the persistence of grazing flights, upper wall as {arrangement}"
    method += ", by the law's structure or the shape of the wall at y = 0" if exact else ", at decreasing angles"
    onset = 2.0 * radius * _onset(paper, zeta)
    return Diffusivity(
        eta * scale, eta_error * scale, kind, method, eta, eta_error, zeta, uncertainty, arrangement, onset
    )


def _onset_in_channel(laws: Sequence[Law], radius: float) -> float:
    """The larger onset of the laws of both walls; an AsperityError if they keep the direction of grazing flights."""
    if len(laws) == 1:
        return logarithmic_slope(laws[0], radius, 1.0, "mirror").onset
    zetas = []
    for law in laws:
        refuse_unless_invariant(law, "L^2/tau has no slope in ln L; the other fields are simulated")
        zetas.append(float(-0.5 * DIRECTION @ grazing_symbol(law).matrix @ DIRECTION))
    if min(zetas) >= 1.0 - BALLISTIC:
        return math.inf
    return 2.0 * radius * max(_onset(law, zeta) for law, zeta in zip(laws, zetas, strict=True))


def _onset(law: Law, zeta: float) -> float:
    """The cotangent of the largest of some angles below which the persistence is near its limit zeta."""
    angle = np.concatenate((ONSET_ANGLES, np.pi - ONSET_ANGLES))
    outgoing = law.sample(np.broadcast_to(angle, (ONSET_RAYS, angle.size)), np.random.default_rng(0))
    means = (np.tan(angle) / np.tan(outgoing)).mean(axis=0).reshape(2, -1).mean(axis=0)
    far = np.abs(means + zeta) > NEAR_LIMIT
    first = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
    return float(1.0 / np.tan(ONSET_ANGLES[first])) if first < ONSET_ANGLES.size else np.inf
