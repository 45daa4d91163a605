"""Laws with a density p(theta, theta') with respect to d theta': of Lambert, of Maxwell, of Henyey and Greenstein."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, common_shape, finite_array, frozen, number_between, shaped, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.given import Vectorised
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from ...core.rounding import EPS
from ..bases.angles import clipped_inside, mirrored_angle
from ..bases.measure import SINE, gauss_rule
from ..expectations.conditionals import Conditionals, gauss_nodes, stiffness_between
from .law import Combination, Law, specular

DensityFunction = Callable[[Floats, Floats], Floats]
# Tolerance for the integral 1 of a conditional density; it admits densities known to single precision.
ROW_TOLERANCE = 1e-7
# Rounding can make a zero density negative by this fraction of its largest value.
NEGATIVE_TOLERANCE = 1e-12
# The two sides of detailed balance, or of the mirror symmetry, may differ by this fraction of the largest flux. It is
# far above the rounding of a formula and far below an intended asymmetry.
SYMMETRY_TOLERANCE = 1e-9
# Numbers of panels in theta' tried in turn for the integrals of conditional densities, and Gauss nodes on each panel.
PANEL_COUNTS = (16, 32, 64, 128, 256, 512, 1024)
GAUSS_NODES = 16
CHECK_NODES = 8
# Stiffness of a density on one of its panels, where 16 Gauss nodes reach rounding; see `gauss_nodes`.
PANEL_STIFFNESS = 12.0
# Cells on each panel in the table of the cdf that is sampled.
CELLS_PER_PANEL = 16
# Nominal time of a value of a density, in seconds.
VALUE_TIME = 2e-7
# Incoming angles at which a density is examined; none is a rational multiple of pi, where a density is likely to jump.
# One more lies between two breakpoints each, at this fraction of their distance.
PROBES, BETWEEN = np.pi * (np.arange(24) + 0.5 * np.sqrt(5.0) - 1.0) / 24, 0.4567


class DensityLaw(Law):
    """A law with a density p(theta, theta') with respect to d theta'.

    Parameters
    ----------
    density : callable
        ``density(theta, theta_out)`` of two arrays that broadcast, in radians; returns the broadcast shape.
    breakpoints : array_like, optional
        Outgoing angles at which the density jumps or has a kink, independent of the incoming angle.

    Attributes
    ----------
    outgoing_breakpoints : ndarray
        The given breakpoints inside (0, pi), in increasing order.
    reversible, mirror_symmetric : bool
        Whether sin(theta) p(theta, theta') is symmetric, and whether p(pi - theta, pi - theta') = p(theta, theta').
        Both are measured at `probes` and the nodes of their rules, within 1e-9 of the largest value.
    sampling_error : float
        Largest difference, on the probes, between the cdf that `sample` inverts and the cdf by quadrature.

    Raises
    ------
    InputError
        If the density is not vectorised, not finite or negative, or does not integrate to 1 within 1e-7.
    AccuracyError
        If 1024 panels do not resolve the density in theta'; ``defect`` is the difference of two quadratures.

    Examples
    --------
    >>> law = DensityLaw(lambda theta, theta_out: 0.5 * np.sin(theta_out))
    >>> law.reversible, law.mirror_symmetric
    (True, True)
    >>> DensityLaw(lambda theta, theta_out: np.sin(theta_out))    # doctest: +ELLIPSIS
    Traceback (most recent call last):
    asperity.errors.InputError: density: expected rows that integrate to 1, got 2 at theta = 0.015...
    """

    has_density = True
    sampling_error: float = 0.0
    _function: DensityFunction
    _panel_count: int = PANEL_COUNTS[0]
    _row_error: float = 0.0

    def __init__(self, density: DensityFunction, breakpoints: ArrayLike = ()) -> None:
        if not callable(density):
            raise InputError(f"density: expected a function of (theta, theta_out), got {density!r}")
        points = np.unique(finite_array("breakpoints", breakpoints))
        inside = frozen(points[(points > 0.0) & (points < np.pi)])
        self._set(_function=density, outgoing_breakpoints=inside)
        panels, row_error = self._panels_needed()
        self._set(_panel_count=panels, _row_error=row_error)
        reversible, mirror_symmetric = self._measured_symmetries()
        sampling_error = self._measured_sampling_error()
        self._set(reversible=reversible, mirror_symmetric=mirror_symmetric, sampling_error=sampling_error)

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"{type(self).__name__} is immutable: cannot set {name}")

    # ---- methods that a subclass with its own formula overrides -----------------------------------------------
    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', for angles in (0, pi), in the shape to which both broadcast."""
        theta, theta_out = angle_pair(theta, theta_out)
        value = finite_array("density", Vectorised(self._function, scalar=True)(theta, theta_out))
        if value.size and value.min() < -NEGATIVE_TOLERANCE * max(1.0, float(value.max())):
            where_worst = [one.flat[int(np.argmin(value))] for one in np.broadcast_arrays(theta, theta_out)]
            raise InputError(
                f"density: expected values of at least 0, got {value.min():g} at theta = {where_worst[0]:g}, "
                f"theta' = {where_worst[1]:g}"
            )
        return np.asarray(np.maximum(value, 0.0))

    def panels(self, theta: Floats) -> Floats:
        """Increasing edges from 0 to pi, shape ``theta.shape + (m,)``, between which p(theta, .) is resolved."""
        edges = self._grid(self._panel_count)
        return np.broadcast_to(edges, (*finite_array("theta", theta).shape, edges.size))

    @property
    def resolution(self) -> float:
        """Width of the narrowest feature of p(theta, .), in radians; pi if the coarsest panels resolve the density."""
        return np.pi if self._panel_count == PANEL_COUNTS[0] else np.pi / self._panel_count

    def incoming_edges(self, edges: Floats) -> Floats:
        """Angles theta between which the integrals of p(theta, .) between the given edges vary smoothly."""
        finite_array("edges", edges)
        return self._grid(self._panel_count)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The outgoing breakpoints, which by detailed balance are incoming ones too; there may be others."""
        return self.outgoing_breakpoints, math.inf

    # ---- sampling, expectations and adjoint ------------------------------------------------------------------
    def adjoint(self) -> Law:
        """The law with density sin(theta') p(theta', theta) / sin(theta); the law itself if it is reversible.

        Raises InputError if this law does not preserve sin(theta) d theta, because the adjoint is then not a law.
        """
        if self.reversible:
            return self
        try:
            return DensityLaw(
                lambda theta, out: SINE.density(out) * self.density(out, theta) / SINE.density(theta),
                self.outgoing_breakpoints,
            )
        except InputError as reason:
            raise not_invariant(self, str(reason), "its adjoint is not a law") from reason

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Gauss rules between the edges of the law's panels and the given ones.

        The error is that of the masses of the law's panels at the probes, or the distance from 1 of the integral of the
        density if it is larger.
        """
        whole = np.concatenate(([0.0], edges, [np.pi]))
        row, low, high, fraction = cut_by_edges(self.panels(theta), whole)
        stiffness = PANEL_STIFFNESS * fraction + stiffness_between(edges, degree, low, high)
        owner, outgoing, weight = gauss_nodes(row, low, high, stiffness)
        weight *= self.density(theta[owner], outgoing)
        error = np.maximum(np.abs(np.bincount(owner, weights=weight, minlength=theta.size) - 1.0), self._row_error)
        return Conditionals.of_lists(owner, outgoing, weight, error)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        flat, draw = theta.reshape(-1), rng.random(theta.size)
        edges = self._cells()
        step = max(1, NUMBERS_AT_ONCE // edges.size)
        outgoing = np.empty(flat.size)
        for part in slices(flat.size, step):
            outgoing[part] = _inverse_cdf(edges, self.density(flat[part, None], clipped_inside(edges)), draw[part])
        return outgoing.reshape(theta.shape)

    def __repr__(self) -> str:
        # The user's function may be any callable.
        return f"DensityLaw({getattr(self._function, '__name__', repr(self._function))})"

    @property
    def probes(self) -> Floats:
        """The incoming angles at which the density is examined, among them one between any two breakpoints."""
        ends = np.concatenate(([0.0], self.outgoing_breakpoints, [np.pi]))
        return np.unique(np.concatenate((PROBES, ends[:-1] + BETWEEN * np.diff(ends))))

    # ---- construction ----------------------------------------------------------------------------------------
    def _grid(self, panels: int) -> Floats:
        return np.unique(np.concatenate([np.linspace(0.0, np.pi, panels + 1), self.outgoing_breakpoints]))

    def _cells(self) -> Floats:
        edges = self._grid(self._panel_count)
        # Both sides of each jump of the density.
        gap, jumps = 4.0 * EPS, self.outgoing_breakpoints
        return np.unique(np.concatenate([split_panels(edges, CELLS_PER_PANEL), jumps - gap, jumps + gap]))

    def _panels_needed(self) -> tuple[int, float]:
        """The number of panels, and the largest total of the differences of two quadratures on all panels.

        Masses and first moments of single panels are compared. The differences of masses cancel in their sum if jumps
        are mirror images, and near the middle of a panel a jump has equal masses by both rules.
        """
        probes, difference, rows = self.probes, np.inf, np.zeros(1)
        for panels in PANEL_COUNTS:
            edges, moments = self._grid(panels), []
            for order in (CHECK_NODES, GAUSS_NODES):
                outgoing, weight = gauss_rule(edges, order)
                masses = (self.density(probes[:, None], outgoing) * weight).reshape(probes.size, edges.size - 1, order)
                local = np.polynomial.legendre.leggauss(order)[0]
                moments.append(masses @ np.stack([np.ones(order), local], axis=1))
            rows = moments[1][..., 0].sum(axis=1)
            difference = float(np.abs(moments[1] - moments[0]).max(axis=2).sum(axis=1).max())
            if difference <= ROW_TOLERANCE and np.all(np.abs(rows - 1.0) <= ROW_TOLERANCE):
                return panels, difference
        worst = int(np.argmax(np.abs(rows - 1.0)))
        if difference <= 0.1 * abs(rows[worst] - 1.0):
            raise InputError(
                f"density: expected rows that integrate to 1, got {rows[worst]:.9g} at theta = {probes[worst]:.6g}"
            )
        raise AccuracyError(
            f"density: rows not resolved by {PANEL_COUNTS[-1]} panels in theta', two quadratures differ by "
            f"{difference:.2g}; give the angles where the density jumps as breakpoints",
            difference,
        )

    def _measured_symmetries(self) -> tuple[bool, bool]:
        # between probes a narrow feature of both angles shows in neither
        probes, angle = self.probes[:, None], gauss_rule(self._grid(self._panel_count), CHECK_NODES)[0]
        value, mirrored = self.density(probes, angle), self.density(np.pi - probes, np.pi - angle)
        flux, back = SINE.density(probes) * value, SINE.density(angle) * self.density(angle, probes)
        reversible = np.max(np.abs(flux - back)) <= SYMMETRY_TOLERANCE * np.max(flux)
        return bool(reversible), bool(np.max(np.abs(value - mirrored)) <= SYMMETRY_TOLERANCE * np.max(value))

    def _measured_sampling_error(self) -> float:
        edges, probes = self._cells(), self.probes
        outgoing, weight = gauss_rule(edges, CHECK_NODES)
        mass = (self.density(probes[:, None], outgoing) * weight).reshape(probes.size, edges.size - 1, CHECK_NODES)
        exact = np.cumsum(mass.sum(axis=-1), axis=-1)
        table = np.cumsum(_cell_masses(edges, self.density(probes[:, None], clipped_inside(edges))), axis=-1)
        return float(np.max(np.abs(exact / exact[:, -1:] - table / table[:, -1:])))


def not_invariant(law: Law, defect: str, reason: str) -> InputError:
    """The refusal of a law that does not preserve sin(theta) d theta."""
    return InputError(
        f"law: expected one that preserves sin(theta) d theta, or else {reason}; got {law!r} (defect {defect}). Of "
        "measured transition probabilities divide rows and columns by their sums in turn, on bins of equal measure"
    )


def angle_pair(theta: ArrayLike, theta_out: ArrayLike) -> tuple[Floats, Floats]:
    """Angles theta and theta' at which a density is asked for, in (0, pi), in shapes that broadcast."""
    incoming, outgoing = angles("theta", theta), angles("theta_out", theta_out)
    common_shape(theta=incoming, theta_out=outgoing)
    return incoming, outgoing


def split_panels(edges: Floats, parts: int) -> Floats:
    """The edges, with each interval cut into ``parts`` equal parts.

    Examples
    --------
    >>> split_panels(np.array([0.0, 1.0, 3.0]), 2).tolist()
    [0.0, 0.5, 1.0, 2.0, 3.0]
    """
    fine = edges[:-1, None] + np.arange(parts) / parts * np.diff(edges)[:, None]
    return np.append(fine, edges[-1])


def cut_by_edges(panels: Floats, edges: Floats) -> tuple[NDArray[np.int64], Floats, Floats, Floats]:
    """The intervals into which ``edges`` and each row of ``panels`` together cut (0, pi).

    Returns for each interval the index of the row, both ends, and its width as a fraction of the panel's width.
    """
    rows, count = len(panels), edges.size
    merged = np.concatenate((panels, np.broadcast_to(edges, (rows, count))), axis=1)
    # The panel of an interval has the last left edge at or before the interval.
    widths = np.concatenate((np.diff(panels, axis=1), np.zeros((rows, 1 + count))), axis=1)
    number = np.concatenate((np.arange(panels.shape[1]), np.zeros(count, dtype=np.int64)))
    order = np.argsort(merged, axis=1, kind="stable")
    merged = np.take_along_axis(merged, order, axis=1)
    panel = np.maximum.accumulate(number[order], axis=1)[:, :-1]
    width = np.diff(merged, axis=1)
    row, column = np.nonzero(width > 0.0)
    fraction = width[row, column] / widths[row, panel[row, column]]
    return row, merged[row, column], merged[row, column + 1], fraction


def _cell_masses(edges: Floats, value: Floats) -> Floats:
    return np.asarray(0.5 * (value[:, 1:] + value[:, :-1]) * np.diff(edges))


def _inverse_cdf(edges: Floats, value: Floats, draw: Floats) -> Floats:
    """Invert the cdf of the piecewise linear density in each row of ``value``, shape (rows, edges)."""
    cumulative = np.cumsum(_cell_masses(edges, value), axis=1)
    target = draw * cumulative[:, -1]
    cell = np.minimum(np.sum(cumulative <= target[:, None], axis=1), edges.size - 2)
    row = np.arange(draw.size)
    rest = target - np.where(cell > 0, cumulative[row, np.maximum(cell - 1, 0)], 0.0)
    left, right, width = value[row, cell], value[row, cell + 1], edges[cell + 1] - edges[cell]
    # The root t of left t + (right - left) t^2 / (2 width) = rest, in a form without cancellation.
    root = np.sqrt(np.maximum(left * left + 2.0 * (right - left) * rest / width, 0.0))
    step = np.divide(2.0 * rest, left + root, out=np.zeros_like(rest), where=left + root > 0.0)
    outgoing: Floats = edges[cell] + np.minimum(step, width)
    return clipped_inside(outgoing)


@dataclass(frozen=True, init=False, repr=False)
class LambertianLaw(DensityLaw):
    """The law whose outgoing angle has the density sin(theta')/2 for every incoming angle."""

    reversible = True
    mirror_symmetric = True
    is_lambertian = True

    def __init__(self) -> None:
        """Takes no arguments."""

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """sin(theta')/2, in the shape to which the two arguments broadcast."""
        incoming, outgoing = angle_pair(theta, theta_out)
        return np.broadcast_to(SINE.density(outgoing), np.broadcast_shapes(incoming.shape, outgoing.shape))

    def panels(self, theta: Floats) -> Floats:
        """One panel."""
        return np.broadcast_to([0.0, np.pi], (*finite_array("theta", theta).shape, 2))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return SINE.sample(theta.shape, rng)

    def __repr__(self) -> str:
        return "lambertian()"


def lambertian() -> LambertianLaw:
    """Diffuse reflection: theta' has the density sin(theta')/2 for every theta (Rudzis 2022, section 1.2.5).

    Examples
    --------
    >>> round(float(lambertian().apply(lambda theta: np.cos(theta) ** 2, 1.0)), 14)
    0.33333333333333
    """
    return LambertianLaw()


def maxwell(diffuse_fraction: float) -> Combination:
    """The law of Maxwell and Smoluchowski: diffuse with probability ``diffuse_fraction`` in [0, 1], else specular.

    Let a be the diffuse fraction. In the paper's convention the eigenvalues are 1 on constants, 1 - a on even functions
    of cos(theta) of mean zero, and -(1 - a) on odd functions. In the specular frame both are 1 - a.

    Examples
    --------
    >>> maxwell(0.25)
    0.25*lambertian() + 0.75*specular()
    """
    diffuse = number_between("diffuse_fraction", diffuse_fraction, 0.0, 1.0, closed="low high")
    return diffuse * lambertian() + (1.0 - diffuse) * specular()


@dataclass(frozen=True, repr=False)
class HenyeyGreensteinLaw(DensityLaw):
    r"""The law of cos(theta) if the direction on the sphere is scattered with the Henyey-Greenstein phase function.

    With u = cos(theta), the kernel with respect to du' is

        k(u, u') = sum over l of (2 l + 1)/2 g^l P_l(u) P_l(u')
                 = (1 - g^2) E(m) / (pi (A - B) sqrt(A + B)),    m = 2 B / (A + B),

    A = 1 + g^2 - 2 g u u', B = 2 g sin(theta) sin(theta'), E the complete elliptic integral. The law is reversible with
    respect to sin(theta) d theta, has the eigenvalue g^l on the polynomial P_l, and satisfies HG(g) HG(h) = HG(g h).

    Parameters
    ----------
    g : float
        Mean cosine of the scattering angle, -1 < g < 1. In the paper's convention the law tends to retroreflection
        (theta' = theta) for g -> 1 and to specular reflection (theta' = pi - theta) for g -> -1; g = 0 is Lambertian.

    Notes
    -----
    Source: L. G. Henyey and J. L. Greenstein, Astrophys. J. 93 (1941) 70. The azimuthal mean has the closed form above.

    Examples
    --------
    >>> law = henyey_greenstein(0.5)
    >>> law
    henyey_greenstein(0.5)
    >>> law.eigenvalue(3)
    0.125
    >>> round(float(law.apply(np.cos, np.pi / 3)), 14)         # g cos(theta)
    0.25
    """

    g: float

    reversible = True
    mirror_symmetric = True

    def __post_init__(self) -> None:
        g = number_between("g", self.g, -1.0, 1.0)
        self._set(g=g, is_lambertian=g == 0.0)

    @property
    def eigenvalue_ratio(self) -> float:
        return self.g

    def eigenvalue(self, degree: int) -> float:
        """The eigenvalue g^l of the Legendre polynomial of degree l in cos(theta)."""
        return float(self.g ** whole_number("degree", degree, 0))

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', in the shape to which the two arguments broadcast."""
        from scipy.special import elliprg

        theta, theta_out = angle_pair(theta, theta_out)
        weight = 2.0 * SINE.density(theta_out)
        # g < 0 is g > 0 followed by theta' -> pi - theta'. As sums of squares, A - B and A + B have no cancellation.
        g, target = abs(self.g), theta_out if self.g >= 0.0 else np.pi - theta_out
        least = (1.0 - g) ** 2 + 4.0 * g * np.sin(0.5 * (theta - target)) ** 2
        most = (1.0 - g) ** 2 + 4.0 * g * np.sin(0.5 * (theta + target)) ** 2
        # Carlson's form E(m) = 2 R_G(0, 1 - m, 1) needs 1 - m = (A - B)/(A + B), which is accurate near m = 1.
        elliptic = 2.0 * elliprg(0.0, least / most, 1.0)
        return np.asarray(weight * (1.0 - g) * (1.0 + g) * elliptic / (np.pi * least * np.sqrt(most)))

    def panels(self, theta: Floats) -> Floats:
        """Edges whose distances from the peak double; the width of the peak is about 1 - |g|."""
        distance = (1.0 - abs(self.g)) * 2.0 ** np.arange(self._doublings())
        theta = finite_array("theta", theta)
        peak = (theta if self.g >= 0.0 else np.pi - theta)[..., None]
        ends = np.zeros_like(peak)
        edges = [ends, peak - distance[::-1], peak, peak + distance, ends + np.pi]
        return np.asarray(np.clip(np.concatenate(edges, axis=-1), 0.0, np.pi))

    @property
    def resolution(self) -> float:
        """Width 1 - |g| of the peak, in radians."""
        return 1.0 - abs(self.g)

    def incoming_edges(self, edges: Floats) -> Floats:
        """Angles whose distances from the edges double, because the integrals change where the peak passes an edge."""
        edges = shaped("edges", edges, "n")
        centre = edges if self.g >= 0.0 else np.pi - edges[::-1]
        distance = self.resolution * 2.0 ** np.arange(self._doublings())
        # Distances end at the middle between two edges, beyond which the next edge is nearer.
        half = 0.5 * np.diff(centre)[:, None]
        right, left = centre[:-1, None] + distance, centre[1:, None] - distance
        near = distance <= half
        # Edges between one and two peak widths apart get a middle, so that no interval is wider than the peak.
        halved = (0.5 * self.resolution < half) & (half < self.resolution)
        middle = 0.5 * (centre[1:] + centre[:-1])[halved[:, 0]]
        return np.unique(np.concatenate((centre[1:-1], middle, right[near], left[near])))

    def _doublings(self) -> int:
        return 1 + int(np.ceil(np.log2(np.pi / (1.0 - abs(self.g)))))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        g, draw = abs(self.g), rng.random(theta.shape)
        azimuth = 2.0 * np.pi * rng.random(theta.shape)
        # The inverse cdf of the phase function, as sine and cosine of half the scattering angle, without cancellation.
        scale = 1.0 - g + 2.0 * g * draw
        half_sine = (1.0 - g) * np.sqrt((1.0 - draw) * (1.0 + g * draw)) / scale
        half_cosine = (1.0 + g) * np.sqrt(draw * (1.0 - g + g * draw)) / scale
        along, across = half_cosine**2 - half_sine**2, 2.0 * half_sine * half_cosine
        forward = along * np.cos(theta) - across * np.cos(azimuth) * np.sin(theta)
        upward = along * np.sin(theta) + across * np.cos(azimuth) * np.cos(theta)
        outgoing = clipped_inside(np.arctan2(np.hypot(upward, across * np.sin(azimuth)), forward))
        return outgoing if self.g >= 0.0 else mirrored_angle(outgoing)

    def __repr__(self) -> str:
        return f"henyey_greenstein({self.g!r})"


def henyey_greenstein(g: float) -> HenyeyGreensteinLaw:
    """The Henyey-Greenstein law with mean cosine ``g``, -1 < g < 1; see `HenyeyGreensteinLaw`.

    Raises InputError if g is not in this range.

    Examples
    --------
    >>> henyey_greenstein(-0.5).eigenvalue(3)
    -0.125
    """
    return HenyeyGreensteinLaw(g)
