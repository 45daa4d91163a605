"""A hollow with two parabolic mirrors that makes two narrow intervals of angles change places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats, Rng, generator, number_between, positive_number, whole_number
from ...core.errors import InputError
from ...core.estimates import LEVEL, Estimate
from ..bases.measure import SINE

if TYPE_CHECKING:
    from ...geometry import Wall

# Flat tops beside the hollow, as a fraction of its width.
MARGIN = 0.05
SAMPLES = 2**16


@dataclass(frozen=True)
class TwoMirrorHollow:
    r"""A wall with a small opening behind which two confocal parabolas exchange rays near two angles.

    Rays through the focus at the angle theta near a become parallel at one mirror and pass the focus again at theta'
    near b after the other,

        cot((a + b - theta)/2) cot((a + b - theta')/2) = cot(a/2) cot(b/2),

    an involution. The focus is the middle of the opening. Made by `two_mirrors`.

    Attributes
    ----------
    wall : Wall
        One hollow a period, under flat tops.
    opening : tuple of float
        Left and right end of the opening.
    windows : pair of pairs of float
        The interval around a and its image around b.
    """

    wall: Wall
    opening: tuple[float, float]
    windows: tuple[tuple[float, float], tuple[float, float]]

    def loss(self, samples: int = SAMPLES, rng: Rng = None) -> Estimate:
        """The fraction of the flux through the opening in the two windows that does not leave in the other window.

        By tracing ``samples`` rays in each window; the error is the half width of an interval of at least 95 %, from
        those of Clopper and Pearson for both windows.
        """
        from ...geometry import trace

        number = whole_number("samples", samples, 2)
        source = generator(rng, 0)
        missed_flux, flux, square = 0.0, 0.0, 0.0
        for window, other in (self.windows, self.windows[::-1]):
            low, high = SINE.cdf(window[0]), SINE.cdf(window[1])
            theta = SINE.quantile(low + (high - low) * source.random(number))
            x = self.opening[0] + (self.opening[1] - self.opening[0]) * source.random(number)
            traced = trace(self.wall, x, theta)
            missed = ~(traced.escaped & (traced.theta > other[0]) & (traced.theta < other[1]))
            fraction, mass = float(np.mean(missed)), float(high - low)
            missed_flux, flux = missed_flux + mass * fraction, flux + mass
            square += (mass * fraction_half_width(int(np.count_nonzero(missed)), number)) ** 2
        return Estimate(missed_flux / flux, float(np.sqrt(square)) / flux, "estimate", f"{2 * number} traced rays")


def fraction_half_width(count: int, number: int) -> float:
    """The longer half of Clopper and Pearson's interval of 95 % of a fraction, ``count`` of ``number``."""
    from scipy.special import betaincinv

    tail, fraction = 0.5 * (1.0 - LEVEL), count / number
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return max(high - fraction, fraction - low)


def two_mirrors(a: float, b: float, half_width: float = 0.02, opening: float = 1e-4) -> TwoMirrorHollow:
    """The two-mirror hollow that swaps the angles within ``half_width`` of ``a`` with an interval around ``b``.

    Parameters
    ----------
    a, b : float
        0 < a < b < pi, radians.
    half_width : float
        Of the interval around a; the intervals must neither touch each other nor 0 and pi.
    opening : float
        Width of the opening over the focal length of the mirror for b. The loss is of the order of the opening over
        the width of the intervals.

    Returns
    -------
    TwoMirrorHollow

    Raises
    ------
    InputError
        If the angles are not as described.

    Notes
    -----
    The axis of both parabolas points to -(cos(a + b), sin(a + b)), and their focal lengths have the ratio
    tan(a/2) tan(b/2). Many of these, one for each pair of intervals of an interval exchange, make a wall with nearly a
    given symmetric law. Source: derived here; the construction in A. Plakhov, "Exterior Billiards" (2012), ch. 4, is
    another.

    Examples
    --------
    >>> hollow = two_mirrors(0.8, 1.6)
    >>> len(hollow.wall.pieces), bool(hollow.loss().value < 0.02)
    (7, True)
    """
    a = number_between("a", a, 0.0, np.pi)
    b = number_between("b", b, a, np.pi)
    half, width = positive_number("half_width", half_width), positive_number("opening", opening)
    first = (a - half, a + half)
    # the map falls: its ends change places
    second = (_partner(first[1], a, b), _partner(first[0], a, b))
    if first[0] <= 0.0 or first[1] >= second[0] or second[1] >= np.pi:
        raise InputError(
            f"half_width: expected disjoint intervals in (0, pi), got {first} and {second}; make it smaller"
        )
    return _built(a, b, (first, second), width)


def _partner(theta: float, a: float, b: float) -> float:
    """theta' of a ray through the focus."""
    cotangent = np.tan(0.5 * (a + b - theta)) / (np.tan(0.5 * a) * np.tan(0.5 * b))
    return float(a + b - 2.0 * np.arctan2(1.0, cotangent))


def _built(
    a: float, b: float, windows: tuple[tuple[float, float], tuple[float, float]], width: float
) -> TwoMirrorHollow:
    from ...geometry import Bezier, Segment, Wall

    focal = np.tan(0.5 * a) * np.tan(0.5 * b)
    # heights above the axis, and control points in (along, above) the axis, of both arcs
    near = 2.0 * focal / np.tan(0.5 * (a + b - np.array(windows[0])))
    far = 2.0 * np.tan(0.5 * (a + b - np.array(windows[1])))
    first = np.array([[h * k / (4.0 * focal) - focal, 0.5 * (h + k)] for h, k in _corners(near)])
    second = np.array([[1.0 - 0.25 * h * k, 0.5 * (h + k)] for h, k in _corners(far)])
    axis = -np.array([np.cos(a + b), np.sin(a + b)])
    frame = np.array([axis, [axis[1], -axis[0]]])
    first, second = first @ frame, second @ frame
    every = np.concatenate((first, second, [[-width, 0.0], [width, 0.0]]))
    margin = MARGIN * float(np.ptp(every[:, 0]))
    shift = np.array([margin - every[:, 0].min(), 0.0])
    period = float(np.ptp(every[:, 0])) + 2.0 * margin
    half = np.array([0.5 * width, 0.0])
    left, right = shift - half, shift + half
    first, second = first + shift, second + shift
    pieces = [
        Segment((0.0, 0.0), left),
        Segment(left, first[0]),
        Bezier(first),
        Segment(first[-1], second[0]),
        Bezier(second),
        Segment(second[-1], right),
        Segment(right, (period, 0.0)),
    ]
    return TwoMirrorHollow(Wall(pieces, period=period), (float(left[0]), float(right[0])), windows)


def _corners(ends: Floats) -> tuple[tuple[float, float], ...]:
    """Pairs of heights whose polar forms are the control points of an arc of a parabola."""
    return (ends[0], ends[0]), (ends[0], ends[1]), (ends[1], ends[1])
