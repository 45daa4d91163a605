"""Random walls and maps: periodic Gaussian heights with a given correlation or power spectrum, by Fourier synthesis."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ...core.checks import (
    Floats,
    Rng,
    choice,
    finite_array,
    finite_number,
    generator,
    number_between,
    positive_number,
    whole_number,
)
from ...core.errors import InputError
from ...core.rounding import EPS
from ..curves.bezier import Bezier
from ..curves.curve import LARGEST_COORDINATE
from .wall import Wall

FEWEST_POINTS, MOST_POINTS = 4, 2**20
# Terms of the sum over all periods are left out once the periods span so many correlation lengths; exp(-40) is below
# the rounding error of 1.
SPAN = 40.0
# Periods to either side of a map over which correlations are summed.
MOST_IMAGES = 60
# A power below zero that is smaller than this fraction of the largest is the rounding error of a discrete Fourier
# transform of at most MOST_POINTS values.
ROUNDING = 1024.0 * EPS
CORRELATIONS: dict[str, Callable[[Floats], Floats]] = {
    "gaussian": lambda distance: np.exp(-(distance**2)),
    "exponential": lambda distance: np.exp(-distance),
}


@dataclass(frozen=True)
class HeightCorrelation:
    """The correlation function of random heights.

    Parameters
    ----------
    length : float
        The correlation length l, in the unit of the period.
    shape : {"gaussian", "exponential"} or callable
        rho(s) as a function of s = distance/l >= 0, an array: exp(-s^2), exp(-s), or a function of one's own with
        rho(0) = 1, which must fall off like exp(-s) at least. Heights of a periodic wall have the sum of rho over all
        periods, so that they are those of the open line where l is small.

    Examples
    --------
    >>> HeightCorrelation(0.1)
    HeightCorrelation(length=0.1, shape='gaussian')
    """

    length: float
    shape: str | Callable[[Floats], Floats] = "gaussian"

    def __post_init__(self) -> None:
        positive_number("length", self.length)
        if not callable(self.shape):
            choice("shape", self.shape, CORRELATIONS)

    def powers(self, points: int, period: float) -> Floats:
        """The power of each frequency 0, ..., points//2 up to a factor: the transform of the correlations."""
        period = positive_number("period", period)
        periods = int(np.ceil(SPAN * self.length / period))
        images = period * (np.arange(points) / points + np.arange(-periods, periods + 1)[:, None])
        return self._checked(np.fft.rfft(self._values(np.abs(images)).sum(axis=0)).real)

    def map_powers(self, points: tuple[int, int], periods: tuple[float, float]) -> Floats:
        """The powers of all waves of a grid in the plane, in the order of numpy's transform, up to a factor."""
        reach = [int(np.ceil(SPAN * self.length / period)) for period in periods]
        if max(reach) > MOST_IMAGES:
            most = MOST_IMAGES * min(periods) / SPAN
            raise InputError(f"length: expected at most {most:g} for the period {min(periods):g}, got {self.length}")
        total = np.zeros(points)
        for image in np.ndindex(2 * reach[0] + 1, 2 * reach[1] + 1):
            x, y = (period * (np.arange(count) / count + k - most)
                    for k, most, count, period in zip(image, reach, points, periods, strict=True))  # fmt: skip
            total += self._values(np.hypot(*np.ix_(x, y)))
        return self._checked(np.fft.fft2(total).real)

    def _values(self, distance: Floats) -> Floats:
        correlation = self.shape if callable(self.shape) else CORRELATIONS[self.shape]
        values = finite_array("shape", correlation(distance / self.length))
        if values.shape != distance.shape:
            raise InputError(f"shape: expected an array of {distance.shape} for one of that shape, got {values.shape}")
        return values

    @staticmethod
    def _checked(found: Floats) -> Floats:
        least = np.unravel_index(int(np.argmin(found)), found.shape)
        if found[least] < -ROUNDING * found.max():
            raise InputError(
                f"shape: expected a correlation function, whose power spectrum is nowhere negative; at frequency "
                f"{', '.join(map(str, least))}/period it is {found[least] / found.max():.2g} of its largest value"
            )
        return np.maximum(found, 0.0)


@dataclass(frozen=True)
class SelfAffine:
    """The power spectrum q^(-1 - 2 H) of self-affine heights.

    Parameters
    ----------
    hurst : float
        The Hurst exponent H in (0, 1).
    longest : float, optional
        Wavelength above which the spectrum is constant; by default the period.
    shortest : float, optional
        Wavelength below which there is nothing; by default two distances of points.

    Notes
    -----
    Jacobs, Junge and Pastewka, Surf. Topogr.: Metrol. Prop. 5, 013001 (2017).

    Examples
    --------
    >>> SelfAffine(0.5).powers(4, 2 * np.pi).tolist()
    [0.0, 1.0, 0.25]
    """

    hurst: float
    longest: float | None = None
    shortest: float | None = None

    def __post_init__(self) -> None:
        number_between("hurst", self.hurst, 0.0, 1.0)
        for name in ("longest", "shortest"):
            value = getattr(self, name)
            if value is not None:
                positive_number(name, value)

    def powers(self, points: int, period: float) -> Floats:
        """The power of each frequency 0, ..., points//2 up to a factor."""
        period = positive_number("period", period)
        return self.wave_powers(np.append(np.inf, period / np.arange(1, points // 2 + 1)), period, 1)

    def wave_powers(self, wavelength: Floats, period: float, dimension: int) -> Floats:
        """The powers of waves of these lengths, on a line or a plane, up to a factor."""
        capped = np.minimum(wavelength, period if self.longest is None else self.longest)
        powers = np.where(np.isinf(wavelength), 0.0, (capped / (2.0 * np.pi)) ** (dimension + 2.0 * self.hurst))
        return np.where(wavelength < (self.shortest or 0.0), 0.0, powers)


HeightSpectrum: TypeAlias = HeightCorrelation | SelfAffine | Callable[[Floats], Floats]


def random_wall(
    spectrum: HeightSpectrum,
    points: int,
    *,
    rms_slope: float | None = None,
    rms_height: float | None = None,
    period: float = 1.0,
    smooth: bool = False,
    rng: Rng = None,
) -> Wall:
    r"""A wall of random Gaussian heights, periodic by construction.

    Parameters
    ----------
    spectrum : HeightCorrelation, SelfAffine or callable
        The correlation function or the power spectrum. A callable takes wave numbers q = 2 pi k/period, k = 1, ...,
        as an array, and returns the power spectral density C(q); the mean squared height is the sum of C(q)/period
        over positive and negative q.
    points : int
        Number of heights, at equal distances.
    rms_slope, rms_height : float, optional
        The root mean squared slope of the wall as it is made, or its height about the mean, between its vertices too,
        of which one is given: the squares are expected values over all random walls, a single wall deviates. With a
        callable both may be left out; its powers are then taken as they are.
    period : float
    smooth : bool
        Whether the heights are joined by cubics with continuous slopes, which are those of the trigonometric polynomial
        through the heights; by default they are joined by straight pieces. A polygon has no spectral gap, by theorem,
        however many vertices it has; a smooth wall has one.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Wall
        A polygon of that number of segments, which begins at its highest vertex; or a wall of cubic Bézier pieces.

    Raises
    ------
    InputError
        If SurfaceTopography is not installed, which makes the heights (the extra ``profiles``); if not one of
        ``rms_slope`` and ``rms_height`` is given; if a spectrum is negative somewhere or zero everywhere.

    Notes
    -----
    The Fourier coefficients are independent complex normal numbers (amplitudes of Rayleigh's distribution, uniform
    phases), so that heights at any points are jointly normal.

    Examples
    --------
    >>> wall = random_wall(HeightCorrelation(0.1), 64, rms_slope=0.2, rng=3)
    >>> len(wall.pieces), wall.period, wall == random_wall(HeightCorrelation(0.1), 64, rms_slope=0.2, rng=3)
    (64, 1.0, True)
    """
    number = whole_number("points", points, FEWEST_POINTS, most=MOST_POINTS)
    width = positive_number("period", period)
    powers = _powers(spectrum, number, width)
    wave: Floats = 2.0 * np.pi / width * np.arange(len(powers), dtype=np.float64)
    # a frequency and its negative; the highest one of an even number of points has no other
    modes = np.append(np.full((number - 1) // 2 + 1, 2.0), np.ones(1 - number % 2))
    squares = modes * powers / width
    powers = powers * _factor(
        lambda order: squares * (1.0 if order is None else _mean_squares(wave, width / number, number, smooth, order)),
        rms_slope, rms_height, is_free=callable(spectrum),
    )  # fmt: skip
    heights = _synthesised(powers, number, width, generator(rng))
    return _smooth_wall(heights, width) if smooth else _polygon(heights, width)


def _powers(spectrum: HeightSpectrum, points: int, period: float) -> Floats:
    """The checked powers of the frequencies 0, ..., points//2; that of the mean height is 0."""
    if isinstance(spectrum, (HeightCorrelation, SelfAffine)):
        return np.append(0.0, spectrum.powers(points, period)[1:])
    wave: Floats = 2.0 * np.pi / period * np.arange(1, points // 2 + 1, dtype=np.float64)
    return np.append(0.0, _given_powers(spectrum, wave))


def _given_powers(spectrum: Callable[[Floats], Floats], wave: Floats) -> Floats:
    """The checked powers of a function of wave numbers."""
    if not callable(spectrum):
        raise InputError(
            f"spectrum: expected HeightCorrelation(0.1), SelfAffine(0.8) or a function of wave numbers, "
            f"got {spectrum!r}"
        )
    found = finite_array("spectrum", spectrum(wave))
    if found.shape != wave.shape or np.any(found < 0.0):
        raise InputError(f"spectrum: expected {len(wave)} powers of at least 0, one for each wave number, got {found}")
    return found


def _factor(
    squares: Callable[[int | None], Floats], rms_slope: float | None, rms_height: float | None, *, is_free: bool
) -> float:
    """What makes the wanted mean square of slopes (order 1) or heights (0) of powers; 1 where none is needed."""
    wanted = rms_height if rms_slope is None else rms_slope
    if wanted is not None and (rms_slope is None or rms_height is None):
        name, order = ("rms_height", 0) if rms_slope is None else ("rms_slope", 1)
        size = number_between(name, wanted, 0.0, LARGEST_COORDINATE)
        return size**2 / _positive_sum(squares(order))
    if rms_slope is not None or not is_free:
        raise InputError(
            f"rms_slope: expected one of rms_slope and rms_height, got rms_slope={rms_slope}, rms_height={rms_height}"
        )
    _positive_sum(squares(None))
    return 1.0


def random_map(
    spectrum: HeightSpectrum,
    points: tuple[int, int],
    periods: tuple[float, float],
    rms_slope: float | None,
    rms_height: float | None,
    rng: np.random.Generator,
) -> Floats:
    """Heights of a random surface; see `Surface.random`. White noise is filtered by the root of the powers."""
    counts = zip(points, periods, strict=True)
    x, y = np.ix_(*(2.0 * np.pi / period * np.fft.fftfreq(number, 1.0 / number) for number, period in counts))
    wave = np.hypot(x, y)
    if isinstance(spectrum, HeightCorrelation):
        powers = spectrum.map_powers(points, periods)
    elif isinstance(spectrum, SelfAffine):
        with np.errstate(divide="ignore"):
            powers = spectrum.wave_powers(2.0 * np.pi / wave, max(periods), 2)
    else:
        powers = np.zeros(points)
        powers.ravel()[1:] = _given_powers(spectrum, wave.ravel()[1:])
    powers[0, 0] = 0.0
    dx, dy = (period / number for period, number in zip(periods, points, strict=True))
    slopes = (2.0 * np.sin(0.5 * x * dx) / dx) ** 2 + (2.0 * np.sin(0.5 * y * dy) / dy) ** 2
    # a facet has a third of the mean products of two corners beside a third of the mean square
    levels = (3.0 + np.cos(x * dx) + np.cos(y * dy) + np.cos(x * dx + y * dy)) / 6.0
    transfer = {None: 1.0, 0: levels, 1: slopes}
    area = periods[0] * periods[1]
    powers = powers * _factor(
        lambda order: powers * transfer[order] / area, rms_slope, rms_height, is_free=callable(spectrum)
    )
    noise = np.fft.fft2(rng.standard_normal(points)) * np.sqrt(powers * powers.size / area)
    return np.asarray(np.fft.ifft2(noise).real)


def _positive_sum(squares: Floats) -> float:
    total = finite_number("spectrum", squares.sum())
    if not total > 0.0:
        raise InputError("spectrum: expected power at one frequency at least, got none; take more points")
    return total


def _mean_squares(wave: Floats, step: float, points: int, smooth: bool, order: int) -> Floats:
    """Mean squared heights (order 0) or slopes (1) of the walls through waves of unit modulus."""
    from scipy.interpolate import CubicHermiteSpline

    ends = np.exp(1j * np.outer([0.0, step], wave))
    # the interpolating polynomial has no slope from the highest frequency of an even number of points
    slopes = 1j * np.where(2.0 * np.arange(len(wave)) == points, 0.0, wave) * ends
    pieces = CubicHermiteSpline([0.0, step], ends, slopes if smooth else np.diff(ends, axis=0).repeat(2, axis=0) / step)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    return np.asarray(0.5 * weights @ np.abs(pieces(0.5 * step * (1.0 + nodes), order)) ** 2)


def _synthesised(powers: Floats, points: int, period: float, rng: np.random.Generator) -> Floats:
    """Heights of a random wall with these powers."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SurfaceTopography.Generation import fourier_synthesis
    except ImportError as reason:
        raise InputError("random_wall: needs SurfaceTopography; pip install 'asperity[profiles]'") from reason
    density = powers.copy()
    if points % 2 == 0:
        # of the highest frequency only the real part is used, half of the power
        density[-1] *= 2.0

    def amplitudes(number: int) -> Floats:
        # with the default, normal amplitudes, heights would not be normal
        return rng.rayleigh(np.sqrt(0.5), number)

    scan = fourier_synthesis(
        (points,), (period,), psd=lambda _: density, amplitude_distribution=amplitudes, rng=rng,
        # half the smallest wavelength: rounding must not cut that one off
        short_cutoff=period / points,
    )  # fmt: skip
    return finite_array("heights", scan.heights())


def _polygon(heights: Floats, period: float) -> Wall:
    along = np.linspace(0.0, period, len(heights) + 1)
    return Wall.from_profile(along, np.append(heights, heights[0]), seam="step")


def _smooth_wall(heights: Floats, period: float) -> Wall:
    """Cubics in Bézier form; their highest control point, which lies above them, is at the level 0."""
    points = len(heights)
    coefficients = 2j * np.pi / period * np.arange(points // 2 + 1) * np.fft.rfft(heights)
    if points % 2 == 0:
        # at the given points the polynomial has no slope from its highest frequency
        coefficients[-1] = 0.0
    slopes = np.fft.irfft(coefficients, points)
    first = int(np.argmax(heights))
    x = np.linspace(0.0, period, points + 1)
    y, third = np.roll(heights, -first), period / (3 * points)
    rise = third * np.roll(slopes, -first)
    after, before = y + rise, np.roll(y - rise, -1)
    top = max(y.max(), after.max(), before.max())
    ends = np.append(y, y[0]) - top
    pieces = [
        Bezier([(x[k], ends[k]), (x[k] + third, after[k] - top), (x[k + 1] - third, before[k] - top),
                (x[k + 1], ends[k + 1])])
        for k in range(points)
    ]  # fmt: skip
    return Wall(pieces, period)
