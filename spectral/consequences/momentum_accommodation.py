"""Momentum accommodation of a surface, and the Maxwell law that is nearest to it in mean reflected velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, angles, frozen, generator, positive_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, ErrorKind, Estimate
from ...core.kinds import explained
from ...core.rounding import EPS
from ...kernels import SINE, KernelMatrix, Law, Panels, discretise
from ...kernels.bases.basis import Basis
from ...kernels.bases.directions import MEAN_SINE, SINE_NORM, Directions
from ...kernels.laws.structure import has_chain
from ..bounds.operator_residuals import image_rule

# cos(theta) and sin(theta) are polynomials of this degree on so many panels, to 1e-14.
PANELS, DEGREE = 4, 10
PANELS_MISS = 1e-14
# Angles at which coefficients are given by default: midpoints of so many cells of equal measure, none at a pole.
DEFAULT_ANGLES = 32
# A momentum this close to the accommodated one leaves nothing to divide by.
POLE = 1e-9
# Draws at each angle, of laws whose conditional means have no error of their own.
DRAWS = 2**12
# Panels of the coarser rule of the misfit, the nodes on each, and breakpoints of the law that are edges too.
MISFIT_PANELS, MISFIT_NODES, BREAKPOINTS = 8, 4, 16
# E cos(theta)^2 and E (sin(theta) - pi/4)^2 for sin(theta)/2 d theta: weights of the two coefficients in the fraction.
TANGENTIAL_WEIGHT, NORMAL_WEIGHT = 1.0 / 3.0, SINE_NORM**2


@dataclass(frozen=True)
class Accommodation:
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
        Angles of incidence, radians.
    tangential_at, normal_at : array of shape (n,)
        The coefficients at these angles.
    tangential_errors, normal_errors : array of shape (n,)
        Their errors, of the kind ``kind_at``.
    kind_at : {"bound", "estimate"}
    """

    tangential: Estimate
    normal: Estimate
    maxwell_fraction: Estimate
    misfit: Estimate
    theta: Floats
    tangential_at: Floats
    tangential_errors: Floats
    normal_at: Floats
    normal_errors: Floats
    kind_at: ErrorKind


@explained
def accommodation(law: Law, tolerance: float = 1e-8, theta: ArrayLike | None = None, rng: Rng = None) -> Accommodation:
    r"""Tangential and normal momentum accommodation coefficients, and the Maxwell fraction that fits a law best.

    Parameters
    ----------
    law : Law
        In either convention; it is converted to the paper's.
    tolerance : float
        Wanted error of the law's matrix and of its conditional means.
    theta : array_like, optional
        Angles at which the coefficients are given; by default the midpoints of 32 cells of equal measure.
    rng : None, int or numpy.random.Generator
        For laws that are traced or sampled; ``np.random.default_rng(0)`` by default, so that results repeat.

    Returns
    -------
    Accommodation

    Raises
    ------
    InputError
        If an angle is pi/2, where the tangential momentum is 0, or one with sin(theta) = pi/4, where the normal
        momentum is the accommodated one: a coefficient is a quotient of differences, and both are 0 there.

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

    Means that a law knows with errors are used; of other laws each angle is sampled.

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
    """
    if not isinstance(law, Law):
        raise InputError(f"law: expected a law such as WallLaw(wall), got {law!r}")
    wanted = positive_number("tolerance", tolerance)
    incoming = _default_angles() if theta is None else _checked(theta)
    source = generator(rng, 0)
    paper = law.in_specular_frame() if law.frame == "specular" else law
    basis: Basis = Panels(np.linspace(0.0, np.pi, PANELS + 1), DEGREE) if has_chain(paper) else Directions()
    matrix = discretise(paper, basis, tolerance=wanted, rng=source)
    tangential, normal, fraction = _averaged(matrix)
    means = _Means(paper, 0.1 * wanted, source)
    tangential_at, tangential_errors, normal_at, normal_errors = _coefficients(means, incoming)
    return Accommodation(
        tangential, normal, fraction, _misfit(paper, means, fraction), frozen(incoming), frozen(tangential_at),
        frozen(tangential_errors), frozen(normal_at), frozen(normal_errors), means.kind,
    )  # fmt: skip


def _default_angles() -> Floats:
    return SINE.quantile((np.arange(DEFAULT_ANGLES) + 0.5) / DEFAULT_ANGLES)


def _checked(theta: ArrayLike) -> Floats:
    incoming = np.atleast_1d(angles("theta", theta)).ravel()
    if not incoming.size:
        raise InputError("theta: expected at least one angle, got none")
    for name, rest in (("pi/2", np.cos(incoming)), ("arcsin(pi/4)", np.sin(incoming) - MEAN_SINE)):
        bad = np.abs(rest) < POLE
        if bad.any():
            raise InputError(
                f"theta: expected angles other than {name} (or pi minus it), where the change of momentum is 0 by any "
                f"law, got {incoming[bad][0]!r}; take one beside it"
            )
    return incoming


def _averaged(matrix: KernelMatrix) -> tuple[Estimate, Estimate, Estimate]:
    """The mean coefficients and the Maxwell fraction, from the matrix on functions that contain cos and sin."""
    along, across = (matrix.basis.project(function) for function in (_cosine, _sine))
    # both have norm 1: the projections are exact to rounding
    error = float(matrix.error) + PANELS_MISS
    tangential = 1.0 + float(along @ matrix.symmetric @ along)
    normal = 1.0 - float(across @ matrix.symmetric @ across)
    how = f"{matrix.method} on {matrix.basis!r} ({matrix.error.method})"
    kind = matrix.error.kind
    whole = TANGENTIAL_WEIGHT + NORMAL_WEIGHT
    mean = (TANGENTIAL_WEIGHT * tangential + NORMAL_WEIGHT * normal) / whole
    # a sum of two entries of an error of this Frobenius norm; cutting moves no two numbers apart
    spread = error * float(np.hypot(TANGENTIAL_WEIGHT, NORMAL_WEIGHT)) / whole
    return (
        Estimate(tangential, error, kind, how),
        Estimate(normal, error, kind, how),
        Estimate(min(max(mean, 0.0), 1.0), spread + PANELS_MISS, kind, f"nearest mean velocities; {how}"),
    )


def _cosine(theta: Floats) -> Floats:
    """Normalised for sin(theta)/2 d theta."""
    return np.asarray(np.sqrt(3.0) * np.cos(theta))


def _sine(theta: Floats) -> Floats:
    """Orthogonal to the constants and normalised."""
    return np.asarray((np.sin(theta) - MEAN_SINE) / SINE_NORM)


class _Means:
    """E[cos(theta') | theta] and E[sin(theta') | theta] with an error each, from what the law knows or from draws."""

    def __init__(self, law: Law, tolerance: float, rng: np.random.Generator) -> None:
        self.law, self.tolerance, self.rng = law, tolerance, rng
        self.panels = Panels(np.linspace(0.0, np.pi, PANELS + 1), DEGREE)
        vectors = np.stack([self.panels.project(np.cos), self.panels.project(np.sin)], axis=1)
        self.kind: ErrorKind = "bound" if law.exact_apply else "estimate"
        costly = law.expectations(self.panels).are_costly()
        try:
            self.rule = None if costly else image_rule(law, self.panels, vectors)
        except InputError:
            self.rule = None

    @property
    def how(self) -> str:
        """In words."""
        return "conditional means" if self.rule else f"{DRAWS} draws an angle"

    def __call__(self, theta: Floats) -> tuple[Floats, Floats]:
        """The means and their errors, both of shape (angles, 2)."""
        if self.rule is not None:
            found, errors = self.rule(theta, self.tolerance)
            if np.isfinite(errors).all():
                # rounding of the sums over branches or panels, and the panels' own miss
                return found, errors[:, None] + np.full(found.shape, PANELS_MISS + 16.0 * EPS)
        outgoing = self._drawn(theta)
        drawn = np.stack([np.cos(outgoing), np.sin(outgoing)], axis=2)
        spread = drawn.std(axis=1, ddof=1) / np.sqrt(DRAWS)
        return drawn.mean(axis=1), NORMAL_95 * spread + 16.0 * EPS

    def _drawn(self, theta: Floats) -> Floats:
        """Outgoing angles, shape (angles, draws)."""
        return self.law.sample(np.repeat(theta[:, None], DRAWS, axis=1), self.rng)


def _coefficients(means: _Means, theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    found, errors = means(theta)
    along, raised = np.cos(theta), np.sin(theta) - MEAN_SINE
    tangential, normal = 1.0 + found[:, 0] / along, (np.sin(theta) - found[:, 1]) / raised
    return tangential, errors[:, 0] / np.abs(along), normal, errors[:, 1] / np.abs(raised)


def _misfit(law: Law, means: _Means, fraction: Estimate) -> Estimate:
    """The root mean square of E[v' | theta] less that of Maxwell's law, by two Gauss rules."""
    breakpoints, _ = law.breakpoints(BREAKPOINTS)
    least = []
    for panels in (MISFIT_PANELS, 2 * MISFIT_PANELS):
        edges = np.unique(np.concatenate([np.linspace(0.0, np.pi, panels + 1), breakpoints]))
        angle, weight = SINE.quadrature(edges, MISFIT_NODES)
        found, errors = means(angle)
        keeps = 1.0 - fraction.value
        maxwell = np.stack([-keeps * np.cos(angle), MEAN_SINE + keeps * (np.sin(angle) - MEAN_SINE)], axis=1)
        least.append(float(np.sqrt(weight @ np.sum((found - maxwell) ** 2, axis=1))))
    # a norm: what the means are wrong by, and what the fraction is, change it by no more than their own norms
    doubt = float(np.sqrt(weight @ np.sum(errors**2, axis=1)))
    doubt += fraction.error * float(np.sqrt(TANGENTIAL_WEIGHT + NORMAL_WEIGHT))
    method = f"Gauss rules on {panels} panels and half of them, {means.how}"
    return Estimate(least[1], abs(least[1] - least[0]) + doubt, "estimate", method)
