"""Momentum accommodation of a surface, and the Maxwell law that is nearest to it in mean reflected velocity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, angles, finite_array, frozen, generator, positive_number
from ...core.errors import InputError
from ...core.estimates import FEW, NORMAL_95, ErrorKind, Estimate, Summary, with_error
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...kernels import SINE, Law, Panels, PolygonLaw, SurfaceLaw, WallLaw, discretise
from ...kernels.bases.basis import Basis
from ...kernels.bases.measure import LARGEST_ANGLE, SMALLEST_ANGLE
from ...kernels.bases.polynomials import MEAN_SINE, SINE_NORM, Directions
from ...kernels.expectations.conditionals import Means
from ...kernels.hemisphere.hemisphere_law import DirectionLaw
from ...kernels.laws.law import Combination, is_atomic
from ...kernels.laws.structure import has_chain, law_of, words_of
from ..bounds.images import is_costly
from ..bounds.operator_residuals import image_rule
from ..gap.shallow import ROUNDING, Slopes, slopes_of
from .channel import in_paper_frame
from .grooves_accommodation import SpaceAccommodation, in_space
from .surface_accommodation import SurfaceAccommodation, of_surface

# cos(theta) and sin(theta) are polynomials of this degree on so many panels, to 1e-14.
PANELS, DEGREE = 4, 10
PANELS_MISS = 1e-14
# Angles at which coefficients are given by default: midpoints of so many cells of equal measure, none at a pole.
DEFAULT_ANGLES = 32
# A momentum this close to the accommodated one leaves nothing to divide by; near it errors are divided by little.
POLE, NEAR_POLE = 1e-9, 0.1
# What is said there of a coefficient that missed the tolerance.
SINGULAR = (
    " (its definition is singular at 0 degrees; maxwell_fraction_at is not)",
    " (its definition is singular at 38.24 degrees; maxwell_fraction_at is not)",
)
# Draws at each angle, of laws whose conditional means have no error of their own.
DRAWS = 2**12
# Panels of the coarser rule of the misfit, the nodes on each, and breakpoints of the law that are edges too.
MISFIT_PANELS, MISFIT_NODES, BREAKPOINTS = 8, 4, 16
# E cos(theta)^2 and E (sin(theta) - pi/4)^2 for sin(theta)/2 d theta: weights of the two coefficients in the fraction.
WEIGHTS = np.array([1.0 / 3.0, SINE_NORM**2])
# Rays that graze a shallow wall, for averages. The misfit of such a wall has so many more edges below this angle.
GRAZING_DRAWS, GRADED, GRADED_UP_TO = 2**14, 16, 0.4
# Tolerance of conditional means as a fraction of the wanted error, and the least one that tracing can reach.
RULE_SHARE, LEAST_TOLERANCE = 0.1, 1e-13


@dataclass(frozen=True, repr=False)
class Accommodation(Summary):
    r"""How far the reflected particles forget the momentum with which they came.

    Attributes
    ----------
    tangential, normal : Estimate
        The coefficients averaged over angles; of Maxwell's law with diffuse fraction f both are f.
    maxwell_fraction : Estimate
        The f in [0, 1] whose Maxwell law has the nearest mean reflected velocities.
    misfit : Estimate
        Root mean square, over angles, of the distance between the mean reflected velocities of the law and of that
        Maxwell law, in units of the speed. 0 of Maxwell's laws.
    theta : array of shape (n,)
        Incoming angles, radians.
    tangential_at, normal_at : array of shape (n,)
        The coefficients at these angles.
    tangential_errors, normal_errors : array of shape (n,)
        Their errors, of the kind ``kind_at``.
    tangential_missed, normal_missed : array of bool, shape (n,)
        Where such an error is larger than the tolerance times the coefficient, or the coefficient is not defined: at
        normal incidence the tangential one is nan, with an infinite error. Coefficients are quotients whose divisors
        are 0 there and, of the normal one, at 38.24 degrees, where sin(theta) = pi/4: nearby errors are large.
    maxwell_fraction_at, maxwell_fraction_errors : array of shape (n,)
        The f in [0, 1] whose Maxwell law has the nearest mean reflected velocity at the angle, defined at normal
        incidence too, and its error.
    misfit_at, misfit_errors : array of shape (n,)
        The distance between the two mean reflected velocities there, in units of the speed, and its error.
    kind_at : {"bound", "estimate"}
    """

    tangential: Estimate
    normal: Estimate
    maxwell_fraction: Estimate
    misfit: Estimate
    theta: Floats
    tangential_at: Floats
    tangential_errors: Floats
    tangential_missed: NDArray[np.bool_]
    normal_at: Floats
    normal_errors: Floats
    normal_missed: NDArray[np.bool_]
    maxwell_fraction_at: Floats
    maxwell_fraction_errors: Floats
    misfit_at: Floats
    misfit_errors: Floats
    kind_at: ErrorKind
    _show = "tangential normal maxwell_fraction misfit incidence_deg"
    _unit = "degrees from the normal; the misfit in units of the speed"
    _more = ".tangential_at, .tangential_errors, .normal_at, .normal_errors, .by_angle(), .tangential.method"

    def _facts(self) -> dict[str, object]:
        return {**super()._facts(), **(self.by_angle() if self.theta.size <= FEW else {})}

    def by_angle(self) -> dict[str, str]:
        """The coefficients in words, by the angle from the normal, with a word where a pole enlarges the error."""
        found = {}
        tangential = zip(self.tangential_at, self.tangential_errors, strict=True)
        normal = zip(self.normal_at, self.normal_errors, strict=True)
        missed = zip(self.tangential_missed, self.normal_missed, strict=True)
        near = (np.abs(_complete(self.theta)) < NEAR_POLE) & (np.abs(_complete(self.theta)) >= POLE)
        for degrees, *pair, bad, close in zip(self.incidence_deg, tangential, normal, missed, near, strict=True):
            words = ["not defined" if np.isnan(one[0]) else with_error(*map(float, one)) for one in pair]
            words = [text + why * bool(k and m) for text, why, k, m in zip(words, SINGULAR, bad, close, strict=True)]
            found[f"at {degrees:.6g} degrees"] = f"tangential {words[0]}, normal {words[1]}"
        return found

    @property
    def incidence_deg(self) -> Floats:
        """The incoming angles as degrees from the normal, 90 - theta."""
        return np.asarray(np.degrees(0.5 * np.pi - self.theta))


@overload
def accommodation(
    law: Law,
    tolerance: float = 1e-8,
    theta: ArrayLike | None = None,
    rng: Rng = None,
    incidence_deg: ArrayLike | None = None,
) -> Accommodation: ...
@overload
def accommodation(
    law: SurfaceLaw,
    tolerance: float = 1e-8,
    theta: None = None,
    rng: Rng = None,
    incidence_deg: ArrayLike | None = None,
    azimuth_deg: ArrayLike | None = None,
) -> SurfaceAccommodation: ...
@overload
def accommodation(
    law: DirectionLaw, tolerance: float = 1e-8, theta: None = None, rng: Rng = None, incidence_deg: None = None
) -> SpaceAccommodation: ...
@reported("accommodation")
def accommodation(
    law: Law | DirectionLaw,
    tolerance: float = 1e-8,
    theta: ArrayLike | None = None,
    rng: Rng = None,
    incidence_deg: ArrayLike | None = None,
    azimuth_deg: ArrayLike | None = None,
) -> Accommodation | SpaceAccommodation:
    r"""Tangential and normal momentum accommodation coefficients, and the Maxwell fraction that fits a law best.

    Parameters
    ----------
    law : Law, HemisphereLaw or SurfaceLaw
        In either convention; it is converted to the paper's. Of a law on the half sphere of velocities, or a mixture of
        such, the averages in space are given, and of a surface coefficients at incoming directions too.
    tolerance : float
        Wanted error of the law's matrix, and of each coefficient at an angle as a fraction of it; where the latter is
        missed, the result says so.
    theta : array_like, optional
        Angles at which the coefficients are given; by default the midpoints of 32 cells of equal measure.
    rng : None, int or numpy.random.Generator
        For laws that are traced or sampled; ``np.random.default_rng(0)`` by default, so that results repeat.
    incidence_deg : array_like, optional
        The angles in place of ``theta``, in degrees from the normal, in (-90, 90): theta is 90 degrees less this
        angle. At 0 only the normal coefficient is defined. Of a surface in [0, 90), from the normal in space.
    azimuth_deg : array_like, optional
        Of a surface, angles of the incoming tangential velocities from the wall's x axis, in degrees; they broadcast
        with ``incidence_deg``. 0 by default.

    Returns
    -------
    Accommodation, SpaceAccommodation or SurfaceAccommodation

    Raises
    ------
    InputError
        If angles are given for a law on the half sphere but a surface's, or such a law is a product. If an angle is
        pi/2, where the tangential momentum is 0, or one with sin(theta) = pi/4, where the normal momentum is the
        accommodated one: a coefficient is a quotient of differences, and both are 0 there. Of angles in degrees, 0 is
        allowed.

    Notes
    -----
    A particle of speed 1 comes with the tangential momentum -cos(theta) and the normal momentum sin(theta), counted
    towards the wall, and leaves with cos(theta') and sin(theta'). Completely accommodated, with a Lambertian law, it
    leaves on average with 0 and pi/4. A coefficient is the change of momentum over that of complete accommodation,

    sigma_t(theta) = 1 + E[cos(theta') | theta] / cos(theta),
    sigma_n(theta) = (sin(theta) - E[sin(theta') | theta]) / (sin(theta) - pi/4).

    Averages have the weights cos(theta)^2 and (sin(theta) - pi/4)^2 under sin(theta) d theta, which makes them entries
    of the law's matrix: sigma_t = 1 + 3 <cos, P cos>, and sigma_n = 1 - <s, P s> with s the normalised
    sin(theta) - pi/4. They are the coefficients of a gas that drifts or expands slowly. The nearest Maxwell law in
    mean reflected velocity, for the same measure of angles, has the mean of the two coefficients with the weights
    1/3 and 2/3 - pi^2/16, cut to [0, 1]. The speed is kept, so that no energy is accommodated.

    Changes of momentum are computed as such, without cancellation, for sums of the ideal laws and of walls with slopes
    below 0.1. With s the slope, an angle, under dx, rays steeper than three times the steepest slope have

    sigma_t(theta) = 4 E sin(s)^2 - 4 cot(2 theta) E tan(s) sin(s)^2,

    exactly. Of other laws the means that a law knows with errors are used, or else each angle is sampled.

    Source: C. Cercignani, The Boltzmann Equation and Its Applications (1988), section III.6, in two dimensions.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> found = spec.accommodation(ker.maxwell(0.25))
    >>> [round(float(x), 12) for x in (found.tangential, found.normal, found.maxwell_fraction, found.misfit)]
    [0.25, 0.25, 0.25, 0.0]

    Lambertian walls forget all, mirrors nothing, and retroreflection turns the tangential momentum round:

    >>> for law in (ker.lambertian(), ker.specular(), ker.retroreflection()):
    ...     found = spec.accommodation(law, theta=[0.5, 1.0])
    ...     print(*found.tangential_at.round(12) + 0.0, *found.normal_at.round(12) + 0.0)
    1.0 1.0 1.0 1.0
    0.0 0.0 0.0 0.0
    2.0 2.0 0.0 0.0

    By degrees from the normal:

    >>> found = spec.accommodation(ker.maxwell(0.25), incidence_deg=[0, 30, 60])
    >>> found.tangential_at.round(12).tolist(), found.normal_at.round(12).tolist()
    ([nan, 0.25, 0.25], [0.25, 0.25, 0.25])

    Grooves keep one of the two tangential components:

    >>> float(spec.accommodation(ker.HemisphereLaw(ker.lambertian())).tangential)
    0.5

    An egg carton with slopes of 1/5, at normal incidence:

    >>> from asperity import geometry as geo
    >>> carton = ker.SurfaceLaw(geo.Surface([[0.0, 0.2], [0.2, 0.4]]))
    >>> spec.accommodation(carton, 0.01, incidence_deg=0).normal_at.round(12).tolist()
    [0.444444444444]
    """
    wanted = positive_number("tolerance", tolerance)
    if isinstance(law, DirectionLaw):
        source, is_surface = generator(rng, 0), isinstance(law, SurfaceLaw)
        at = (
            {"theta": theta}
            if is_surface
            else {"theta": theta, "incidence_deg": incidence_deg, "azimuth_deg": azimuth_deg}
        )
        for name, given in at.items():
            if given is not None:
                raise InputError(f"{name}: expected none for {law!r}, of which the averages are given, got {given!r}")
        if isinstance(law, SurfaceLaw):
            return of_surface(law, wanted, incidence_deg, azimuth_deg, source)
        return in_space(
            law,
            lambda one: _averaged(_parts(in_paper_frame(one), wanted, source)),
            lambda one: of_surface(one, wanted, None, None, source),
            source,
        )
    if azimuth_deg is not None:
        raise InputError(f"azimuth_deg: expected none for {law!r}, a law in the plane, got {azimuth_deg!r}")
    midpoints = SINE.quantile((np.arange(DEFAULT_ANGLES) + 0.5) / DEFAULT_ANGLES)
    if incidence_deg is not None:
        if theta is not None:
            raise InputError("incidence_deg: expected either this or theta, got both")
        incoming = from_degrees(incidence_deg)
    else:
        incoming = midpoints if theta is None else _checked("theta", theta)
    paper = in_paper_frame(law)
    parts = _parts(paper, wanted, generator(rng, 0))
    tangential, normal, fraction = _averaged(parts)
    changes, uncertainty, missed = _changes_at(parts, incoming, wanted)
    missed.setflags(write=False)
    values, errors = _coefficients(incoming, changes, uncertainty)
    (tangential_at, normal_at), (tangential_errors, normal_errors) = frozen(values.T), frozen(errors.T)
    (fraction_at, fraction_errors), (misfit_at, misfit_errors) = _nearest_maxwell(incoming, changes, uncertainty)
    kind: ErrorKind = "bound" if all(part.kind == "bound" for _, part in parts) else "estimate"
    misfit = _misfit(paper, parts, fraction, wanted)
    return Accommodation(
        tangential, normal, fraction, misfit, frozen(incoming), tangential_at, tangential_errors, missed[:, 0],
        normal_at, normal_errors, missed[:, 1], frozen(fraction_at),
        frozen(fraction_errors), frozen(misfit_at), frozen(misfit_errors), kind,
    )  # fmt: skip


def from_degrees(incidence: ArrayLike) -> Floats:
    """Angles at which accommodation is defined, from degrees from the normal, normal incidence among them."""
    incoming = incoming_angles(incidence)
    oblique = incoming[incoming != 0.5 * np.pi]
    if oblique.size:
        _checked("incidence_deg", oblique)
    return incoming


def incoming_angles(incidence: ArrayLike) -> Floats:
    """Incoming angles in radians from degrees from the normal, normal incidence among them."""
    given = np.atleast_1d(finite_array("incidence_deg", incidence)).ravel()
    incoming = np.asarray(np.radians(90.0 - given))
    bad = (np.abs(given) >= 90.0) | (incoming <= 0.0) | (incoming >= np.pi)
    if bad.any():
        raise InputError(f"incidence_deg: expected degrees from the normal, in (-90, 90), got {float(given[bad][0])!r}")
    if not given.size:
        raise InputError("incidence_deg: expected at least one angle, got none")
    return np.where(np.abs(np.cos(incoming)) >= POLE, incoming, 0.5 * np.pi)


def _checked(name: str, theta: ArrayLike) -> Floats:
    incoming = np.atleast_1d(angles(name, theta)).ravel()
    if not incoming.size:
        raise InputError(f"{name}: expected at least one angle, got none")
    for pole, rest in (("pi/2", np.cos(incoming)), ("arcsin(pi/4)", np.sin(incoming) - MEAN_SINE)):
        bad = np.abs(rest) < POLE
        if bad.any():
            raise InputError(
                f"{name}: expected angles other than theta = {pole} (or pi minus it), where the change of momentum is "
                f"0 by any law, got {incoming[bad][0]!r}; take one beside it"
            )
    return incoming


def _parts(law: Law, tolerance: float, rng: np.random.Generator) -> list[tuple[float, _Changes]]:
    """The law as a weighted sum of laws; sums of coefficients then have the relative accuracy of their parts."""
    if isinstance(law, Combination):
        terms = [(weight, _parts(term, tolerance, rng)) for weight, term in law.parts]
        return [(outer * weight, part) for outer, parts in terms for weight, part in parts]
    slopes = slopes_of(law)
    slopes = slopes if slopes is not None and slopes.steepest > 0.0 else None
    if slopes is not None and isinstance(law, PolygonLaw):
        # grazing rays are traced at once, one by one their isometries are listed
        law = WallLaw(law.wall)
    words = None if slopes or not (has_chain(law) or law.frame == "specular") else words_of(law)
    found = {law: 1.0} if words is None else {law_of(word): weight for word, weight in words.items()}
    return [(weight, _Changes(one, slopes, tolerance, rng)) for one, weight in found.items()]


def _averaged(parts: list[tuple[float, _Changes]]) -> tuple[Estimate, Estimate, Estimate]:
    """The mean coefficients and the Maxwell fraction."""
    found = [(weight, *part.averages()) for weight, part in parts]
    values = np.asarray(sum(weight * value for weight, value, _, _ in found))
    errors = np.asarray(sum(weight * error for weight, _, error, _ in found)) + 4.0 * EPS * np.abs(values)
    how = "; ".join(dict.fromkeys(method for *_, method in found))
    kind: ErrorKind = "bound" if all(part.averages_kind == "bound" for _, part in parts) else "estimate"
    mean, spread = (float(WEIGHTS @ pair / WEIGHTS.sum()) for pair in (values, errors))
    tangential, normal = (Estimate(float(v), float(e), kind, how) for v, e in zip(values, errors, strict=True))
    # cutting moves no two numbers apart
    return tangential, normal, Estimate(min(max(mean, 0.0), 1.0), spread, kind, f"nearest mean velocities; {how}")


def _complete(theta: Floats) -> Floats:
    """The changes by complete accommodation, shape (angles, 2)."""
    return np.stack([np.cos(theta), np.sin(theta) - MEAN_SINE], axis=1)


class _Changes:
    """E[cos(theta') + cos(theta) | theta] and E[sin(theta) - sin(theta') | theta] of one law, with an error each."""

    def __init__(self, law: Law, slopes: Slopes | None, tolerance: float, rng: np.random.Generator) -> None:
        self.law, self.slopes, self.tolerance, self.rng = law, slopes, tolerance, rng
        # of specular reflection, retroreflection and the Lambertian law: factors of the complete change
        self.ideal = np.array([1.0, 1.0]) if law.is_lambertian else None
        if law.retro is not None:
            self.ideal = np.array([2.0 if law.retro else 0.0, 0.0])
        exact = self.ideal is not None or (slopes is None and is_atomic(law))
        self.kind: ErrorKind = "bound" if exact else "estimate"
        self.averages_kind: ErrorKind = self.kind

    @cached_property
    def rule(self) -> Means | None:
        """The conditional means of cos and sin with their error; None if it is unknown or too slow to compute."""
        panels = Panels(np.linspace(0.0, np.pi, PANELS + 1), DEGREE)
        vectors = np.stack([panels.project(np.cos), panels.project(np.sin)], axis=1)
        try:
            return None if is_costly(self.law) else image_rule(self.law, panels, vectors)
        except InputError:
            return None

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        """The changes and their errors, both of shape (angles, 2)."""
        complete = _complete(theta)
        if self.ideal is not None:
            return self.ideal * complete, 4.0 * EPS * np.abs(self.ideal * complete)
        found, errors = np.zeros_like(complete), np.zeros_like(complete)
        rest = np.ones(theta.size, dtype=bool)
        if self.slopes is not None:
            rest = np.minimum(theta, np.pi - theta) < self.slopes.once
            found[~rest], errors[~rest] = self.slopes.changes(theta[~rest])
        if rest.any():
            found[rest], errors[rest] = self._of_rays(theta[rest], tolerance)
        return found, errors

    def _of_rays(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found, errors = np.zeros((theta.size, 2)), np.full((theta.size, 2), np.inf)
        if self.rule is not None:
            means, uncertainty = self.rule(theta, tolerance)
            found = np.stack([np.cos(theta) + means[:, 0], np.sin(theta) - means[:, 1]], axis=1)
            # rounding of the sums over branches or panels, and the panels' own miss
            errors = np.nan_to_num(uncertainty, nan=np.inf)[:, None] + np.full(found.shape, PANELS_MISS + 16.0 * EPS)
        if self.slopes is not None or not np.isfinite(errors).all():
            each = self._drawn(np.repeat(theta[:, None], DRAWS, axis=1))
            uncertainty = NORMAL_95 * each.std(axis=1, ddof=1) / np.sqrt(DRAWS) + 4.0 * EPS
            better = uncertainty < errors
            found, errors = np.where(better, each.mean(axis=1), found), np.where(better, uncertainty, errors)
        return found, errors

    def _drawn(self, theta: Floats) -> Floats:
        """The changes of drawn rays, shape ``theta.shape + (2,)``, by products."""
        onward = np.pi - self.law.sample(theta, self.rng)
        middle, half = 0.5 * (theta + onward), 0.5 * (onward - theta)
        return np.asarray(2.0 * np.stack([np.sin(middle) * np.sin(half), -np.cos(middle) * np.sin(half)], axis=-1))

    def averages(self) -> tuple[Floats, Floats, str]:
        """The mean coefficients, their errors, and the method."""
        if self.ideal is not None:
            return self.ideal, np.zeros(2), f"{self.law!r} in closed form"
        values, errors, how = np.zeros(2), np.full(2, np.inf), ""
        if self.slopes is not None:
            values, errors = self._of_slopes(self.slopes)
            how = f"squared changes, from the slopes and {GRAZING_DRAWS} grazing rays"
            if np.all(errors <= self.tolerance * values):
                return values, errors, how
        basis: Basis = Panels(np.linspace(0.0, np.pi, PANELS + 1), DEGREE) if has_chain(self.law) else Directions()
        matrix = discretise(self.law, basis, tolerance=self.tolerance, rng=self.rng)
        # normalised for sin(theta)/2 d theta; the second is orthogonal to the constants
        along = basis.project(lambda theta: np.sqrt(3.0) * np.cos(theta))
        across = basis.project(lambda theta: (np.sin(theta) - MEAN_SINE) / SINE_NORM)
        entries = np.array([1.0 + along @ matrix.symmetric @ along, 1.0 - across @ matrix.symmetric @ across])
        # both have norm 1: the projections are exact to rounding
        error = float(matrix.error) + PANELS_MISS
        self.averages_kind = matrix.error.kind
        better = error < errors
        own = f"{matrix.method} on {matrix.basis!r} ({matrix.error.method})"
        how = how if not better.any() else own if better.all() else f"{how}; {own}"
        return np.where(better, entries, values), np.where(better, error, errors), how

    def _of_slopes(self, slopes: Slopes) -> tuple[Floats, Floats]:
        """Half the mean squared changes, <f, (1 - P) f>, over the mean squares of cos and of sin - pi/4."""
        steep = slopes.squared_changes()
        fraction = 2.0 * np.sin(0.5 * slopes.once) ** 2
        grazing = 2.0 * np.arcsin(np.sin(0.5 * slopes.once) * np.sqrt(self.rng.random(GRAZING_DRAWS)))
        grazing = np.where(self.rng.random(GRAZING_DRAWS) < 0.5, grazing, np.pi - grazing)
        square = self._drawn(np.clip(grazing, SMALLEST_ANGLE, LARGEST_ANGLE)) ** 2
        spread = NORMAL_95 * square.std(axis=0, ddof=1) / np.sqrt(GRAZING_DRAWS)
        values = 0.5 * (steep + fraction * square.mean(axis=0)) / WEIGHTS
        return values, 0.5 * fraction * spread / WEIGHTS + ROUNDING * values


def _summed(parts: list[tuple[float, _Changes]], theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """The changes under a weighted sum of laws, and their errors."""
    found = [(weight, *part(theta, tolerance)) for weight, part in parts]
    changes = np.asarray(sum(weight * change for weight, change, _ in found))
    return changes, np.asarray(sum(weight * error for weight, _, error in found)) + 4.0 * EPS * np.abs(changes)


def _changes_at(
    parts: list[tuple[float, _Changes]], theta: Floats, wanted: float
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The changes at angles, their errors, and where an error exceeds the wanted one, relative to the change.

    Where complete accommodation changes nothing there is no coefficient, and it counts as missed.
    """
    pole = np.abs(_complete(theta)) < POLE
    changes, errors = _summed(parts, theta, RULE_SHARE * wanted)
    missed = (errors > wanted * np.abs(changes)) & ~pole
    again = missed.any(axis=1)
    if again.any():
        # the rule's tolerance is absolute: the least change tells which one is needed
        least = float(np.where(pole, np.inf, np.abs(changes))[again].min())
        least = max(RULE_SHARE * wanted * least, LEAST_TOLERANCE)
        finer = _summed(parts, theta[again], least)
        better = finer[1] < errors[again]
        changes[again], errors[again] = (
            np.where(better, new, old[again]) for new, old in zip(finer, (changes, errors), strict=True)
        )
        missed = errors > wanted * np.abs(changes)
    return changes, errors, missed | pole


def _coefficients(theta: Floats, changes: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """The coefficients and their errors; nan where complete accommodation changes nothing."""
    complete = _complete(theta)
    pole = np.abs(complete) < POLE
    divisor = np.where(pole, np.nan, complete)
    return changes / divisor, np.where(pole, np.inf, errors / np.abs(divisor))


def _nearest_maxwell(
    theta: Floats, changes: Floats, errors: Floats
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """The nearest point f times the complete changes, 0 <= f <= 1, and the distance from it, each with its error.

    Neither the point nor the distance moves farther than the changes do.
    """
    complete = _complete(theta)
    size = np.hypot(*complete.T)
    fraction = np.clip(np.sum(changes * complete, axis=1) / size**2, 0.0, 1.0)
    misfit = np.hypot(*(changes - fraction[:, None] * complete).T)
    moved = np.hypot(*errors.T) + 8.0 * EPS * np.hypot(*changes.T)
    return (fraction, moved / size), (misfit, moved)


def _misfit(law: Law, parts: list[tuple[float, _Changes]], fraction: Estimate, wanted: float) -> Estimate:
    """The root mean square of E[v' | theta] less that of Maxwell's law, by two Gauss rules."""
    breakpoints, _ = law.breakpoints(BREAKPOINTS)
    once = [part.slopes.once for _, part in parts if part.slopes is not None]
    # the change of the normal momentum grows towards grazing like 1/sin(theta)
    graded = np.geomspace(min(once), GRADED_UP_TO, GRADED) if once else np.empty(0)
    least = []
    for panels in (MISFIT_PANELS, 2 * MISFIT_PANELS):
        uniform = np.linspace(0.0, np.pi, panels + 1)
        edges = np.unique(np.concatenate([uniform, breakpoints, graded, np.pi - graded]))
        angle, weight = SINE.quadrature(edges, MISFIT_NODES)
        changes, errors = _summed(parts, angle, RULE_SHARE * wanted)
        difference = changes - fraction.value * _complete(angle)
        least.append(float(np.sqrt(weight @ np.sum(difference**2, axis=1))))
    # a norm: what the means are wrong by, and what the fraction is, change it by no more than their own norms
    uncertainty = float(np.sqrt(weight @ np.sum(errors**2, axis=1)))
    uncertainty += fraction.error * float(np.sqrt(WEIGHTS.sum()))
    method = f"Gauss rules on {panels} panels and half of them"
    return Estimate(least[1], abs(least[1] - least[0]) + uncertainty, "estimate", method)
