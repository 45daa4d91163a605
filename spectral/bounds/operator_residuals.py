"""Residuals of trial functions under the law (not under its matrix)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from ...core.checks import Floats
from ...core.errors import AccuracyError, InputError
from ...core.rounding import EPS
from ...kernels import Basis, Bins, DensityLaw, Law, Panels
from ...kernels.bases.assembly import mirror_refinement, reflection_matrix
from ...kernels.bases.measure import SINE
from ...kernels.discretisation.quadrature import GRAZING_EDGES
from ...kernels.expectations.angle_panels import KRONROD, NODES, NULL_RULES, error_of_null_rules
from ...kernels.expectations.conditionals import Means, weighted_means
from ...kernels.laws.law import Composition, SpecularFrame, is_atomic, knows_errors
from ...kernels.laws.structure import holds_of_all, law_of, words_of
from ...kernels.walls.conditionals import is_few
from .images import expectations_of, is_traced

# Wanted relative error of squared residuals, limit on the incoming angles, and least width of a panel.
FRACTION, MOST_ANGLES, NARROWEST = 0.1, 900, 1e-9
# A panel must begin below pi/2 by more than this to belong to the left half.
HALF_ROUNDING = 1e-12
# Fraction of the squared residuals in marked panels.
MARKED = 0.9
# Default error of conditional expectations.
MEAN_TOLERANCE = 1e-8
# Where a law does not know all its breakpoints a jump may lie in any panel. The differences of two rules have this
# margin then, and panels are cut at this fraction, because adapted trial functions fit the law at the nodes of theirs.
MARGIN, CUT = 4.0, 0.4
# The same for traced walls, where rays take some itineraries in narrow intervals of angles only.
OF_TRACED = 2.0
# Two points just inside the ends of a panel, and the values there of the polynomial through the values at the nodes.
ENDS = (1.0 - 1e-6) * np.array([-1.0, 1.0])
AT_ENDS = legvander(ENDS, len(NODES) - 1) @ np.linalg.inv(legvander(NODES, len(NODES) - 1))
POINTS = np.append(NODES, ENDS)


@dataclass(frozen=True)
class Residuals:
    """Rayleigh quotients and residuals of orthonormal trial functions v_i for a self-adjoint law P.

    Attributes
    ----------
    quotients : array of shape (k,)
        <v_i, P v_i>.
    quotient_errors : array of shape (k,)
        Estimated errors of the quotients.
    norms : array of shape (k,)
        ||P v_i - rho_i v_i||, with the error of the quadrature added.
    angles_used : int
        Number of incoming angles at which the law was applied.
    marks : array
        Ends of panels with most of the squared residuals, if these are larger than expected.
    """

    quotients: Floats
    quotient_errors: Floats
    norms: Floats
    angles_used: int
    marks: Floats

    def split(self, number: int) -> tuple[Residuals, Residuals]:
        """The results for the first ``number`` functions, and for the others."""
        both = (
            (self.quotients[part], self.quotient_errors[part], self.norms[part])
            for part in (slice(None, number), slice(number, None))
        )
        first, others = (Residuals(*arrays, self.angles_used, self.marks) for arrays in both)
        return first, others


def residuals(
    law: Law, basis: Basis, vectors: Floats, values: Floats, most_angles: int = MOST_ANGLES, *,
    mirrored: bool = False, quotient_error: float = 0.0, leading: int | None = None, expected: float = np.inf,
) -> Residuals:  # fmt: skip
    """Rayleigh quotients and residuals of the functions with the coefficients ``vectors``, shape (n, k).

    ``values``, shape (k,), are approximate eigenvalues. ||P v - rho v||^2 is integrated directly; the difference
    <P v, P v> - rho^2 would lose half of the digits. Panels in the incoming angle are halved where the Gauss and
    Kronrod rules differ most for the ``leading`` functions (by default all); their difference counts as error, and so
    does what they do not see between the ends of a panel and the nodes: a law that hardly changes angles smooths the
    jumps of v over less than this distance.
    ``mirrored``: each function is even or odd, and the law is mirror-symmetric. Quotients are refined until their error
    is below ``quotient_error``. Panels are marked where the ``leading`` functions together have more than twice the
    squared residuals ``expected``.
    """
    rule = image_rule(law, basis, vectors)

    def here_and_images(theta: Floats) -> tuple[Floats, Floats, Floats]:
        images, errors = rule(theta, quotient_error or MEAN_TOLERANCE)
        if np.isnan(errors).any():
            raise AccuracyError("rows without a known error are no ground for an enclosure", float("nan"))
        return expansion(basis, vectors, theta), images, errors

    low, high, margin = _first_panels(law, basis, quotient_error)
    rules = NULL_RULES if margin > 1.0 else NULL_RULES[:1]
    if mirrored:
        inside = low < 0.5 * np.pi - HALF_ROUNDING
        low, high = low[inside], np.minimum(high[inside], 0.5 * np.pi)
    known: _Integrals | None = None
    angles_used = 0
    while low.size:
        fresh = _integrals(here_and_images, values, (low, high), 2.0 if mirrored else 1.0, margin * rules, margin)
        angles_used += low.size * len(POINTS)
        known = fresh if known is None else _Integrals(*map(np.concatenate, zip(known, fresh, strict=True)))
        square = known.total[:, 1].sum(axis=0)
        # a Kato-Temple bound adds about the square to the quotient, so the error of the quotient should be smaller
        least, rounding = np.array([[1.0], [FRACTION]]) * quotient_error, np.array([[4.0 * EPS], [(8.0 * EPS) ** 2]])
        wanted = np.maximum(FRACTION * square + rounding, least)
        if np.all((known.error <= wanted)[:, :leading]):
            break
        fraction = (known.errors / wanted)[..., :leading].max(axis=(1, 2))
        affordable = max(most_angles - angles_used, 0) // (2 * len(POINTS))
        worst = np.argsort(-fraction)[:affordable]
        wide = known.high[worst] - known.low[worst] > NARROWEST
        worst = worst[(fraction[worst] * len(fraction) ** (1.0 if len(rules) == 1 else 0.5) > 1.0) & wide]
        middle = 0.5 * (known.low[worst] + known.high[worst])
        low, high = np.append(known.low[worst], middle), np.append(middle, known.high[worst])
        if low.size:
            known = _Integrals(*(np.delete(part, worst, axis=0) for part in known))
    assert known is not None  # there are panels
    correction, square = known.total.sum(axis=0)
    correction_error, square_error = known.error + known.uncertainty.sum(axis=0)
    squares = known.total[:, 1, :leading].sum(axis=1)
    order = np.argsort(-squares)
    enough = 1 + int(np.searchsorted(np.cumsum(squares[order]), MARKED * squares.sum()))
    most = order[: enough if squares.sum() > 2.0 * expected else 0]
    return Residuals(
        values + correction, correction_error, np.sqrt(np.maximum(square, 0.0) + square_error), angles_used,
        np.append(known.low[most], known.high[most]),
    )  # fmt: skip


class _Integrals(NamedTuple):
    """Integrals of v (P v - rho v) and (P v - rho v)^2 over panels, which the first axis of every array runs over.

    Null rules and what they do not see at the ends, both with the margin, tell the error; the uncertainty is the effect
    of the errors of conditional expectations.
    """

    low: Floats
    high: Floats
    total: Floats
    nulls: Floats
    ends: Floats
    uncertainty: Floats

    @property
    def errors(self) -> Floats:
        """The error of each panel."""
        squares = np.moveaxis(self.nulls, 1, 0) ** 2
        return np.asarray((np.sqrt(squares[0]) if len(squares) == 1 else error_of_null_rules(squares)) + self.ends)

    @property
    def error(self) -> Floats:
        """The error of the sums, for several null rules as that of `AnglePanels.total_error`, else their sum."""
        if self.nulls.shape[1] == 1:
            return np.asarray(self.errors.sum(axis=0))
        joint = np.mean(self.nulls.sum(axis=0) ** 2, axis=0)
        return np.asarray(np.sqrt(np.maximum(np.sum(self.errors**2, axis=0), joint)))


def _knows_breakpoints(law: Law) -> bool:
    """Whether a law is smooth between its breakpoints, or is a wall's, whose conditional distributions tell more."""
    smooth = law.eigenvalue_ratio is not None or law.traced_wall is not None
    return smooth or bool(np.isfinite(law.breakpoints(1)[1]))


def _first_panels(law: Law, basis: Basis, error: float) -> tuple[Floats, Floats, float]:
    """Panels between the edges of the basis and near grazing, for densities also between their breakpoints; a margin.

    The differences of two rules on the panels are to be multiplied by the margin.
    """
    # nearer to grazing the measure is less than the error
    grazing = GRAZING_EDGES[error < GRAZING_EDGES**2] if is_traced(law) else GRAZING_EDGES
    edges = [basis.edges, grazing, np.pi - grazing]
    for part in {part for word in words_of(law) or () for part in word}:
        if isinstance(part, DensityLaw) and not part.is_lambertian:
            # the law is symmetric: where p(theta, .) has breakpoints, p(., theta') has them
            edges += [part.outgoing_breakpoints, part.incoming_edges(basis.edges)]
            edges += [np.pi - one for one in edges[-2:]] if law.frame == "specular" else []
    joint = np.unique(np.clip(np.concatenate(edges), 0.0, np.pi))
    low, high = joint[:-1], joint[1:]
    known = holds_of_all(law, _knows_breakpoints)
    if known and not is_traced(law):
        return low, high, 1.0
    cut = low + CUT * (high - low)
    return np.append(low, cut), np.append(cut, high), OF_TRACED if known else MARGIN


def _integrals(
    function: Callable[[Floats], tuple[Floats, Floats, Floats]], values: Floats, panels: tuple[Floats, Floats],
    copies: float, rules: Floats, margin: float,
) -> _Integrals:  # fmt: skip
    """The integrals over each panel.

    The function gives v, P v, shape (angles, k), and the errors of P v. An error e of P v adds e v to the first
    integrand and 2 e (P v - rho v) + e^2 to the second.
    """
    low, high = panels
    half = 0.5 * (high - low)
    angle = (0.5 * (low + high))[:, None] + half[:, None] * POINTS
    here, image, mean_error = function(angle.ravel())
    rest, uncertainty = image - here * values, mean_error[:, None]
    shape = (*angle.shape, len(values))
    parts = np.stack([(here * rest).reshape(shape), (rest * rest).reshape(shape)], axis=2)
    effects = np.abs(here) * uncertainty, (2.0 * np.abs(rest) + uncertainty) * uncertainty
    uncertainties = np.stack([effect.reshape(shape) for effect in effects], axis=2)
    weight = copies * half[:, None, None, None] * SINE.density(angle)[..., None, None]
    at_nodes, at_ends = np.split(weight * parts, [len(NODES)], axis=1)
    beyond = np.abs(at_ends - np.einsum("eq,pqjk->pejk", AT_ENDS, at_nodes)).sum(axis=1)
    return _Integrals(
        low, high,
        np.einsum("q,pqjk->pjk", KRONROD, at_nodes),
        np.einsum("nq,pqjk->pnjk", rules, at_nodes),
        margin * (1.0 - NODES.max()) * beyond,
        np.einsum("q,pqjk->pjk", KRONROD, (weight * uncertainties)[:, : len(NODES)]),
    )  # fmt: skip


def image_rule(law: Law, basis: Basis, vectors: Floats) -> Means:
    """A function for P v of the functions with the coefficients ``vectors``, and the largest error at each angle.

    Raises
    ------
    InputError
        If the errors are unknown: for laws given by entry points, walls with more than 64 pieces, and compositions with
        laws that are not exact.
    """
    words = words_of(law)
    if words is None:
        raise _refusal(law, "it is a sum of very many compositions")
    return weighted_means([(weight, _rule(law_of(word), basis, vectors)) for word, weight in words.items()])


def _rule(law: Law, basis: Basis, vectors: Floats) -> Means:
    if isinstance(law, Composition) and not holds_of_all(law, is_atomic):
        raise _refusal(law, "it is a composition with a law whose means are integrals by quadrature")
    if isinstance(law, SpecularFrame):
        fine, coefficients = mirror_refinement(basis)
        return _rule(law.law, fine, reflection_matrix(fine) @ (coefficients.T @ vectors))
    if law.is_lambertian:
        mean = basis.constant @ vectors
        return lambda theta, tolerance: (np.tile(mean, (theta.size, 1)), np.zeros(theta.size))
    if law.traced_wall is not None and not is_few(law.traced_wall):
        raise _refusal(law, "its conditional distributions take too long")
    if knows_errors(law):
        return expectations_of(law, Panels(basis.edges, 0) if isinstance(basis, Bins) else basis, vectors)
    raise _refusal(law, "the errors of its conditional distributions are unknown")


def _refusal(law: Law, reason: str) -> InputError:
    return InputError(
        f"law: the images of trial functions under {law!r} have no known error, for {reason}; spectrum(law) and "
        "spectral_gap(law) take its matrix"
    )


def expansion(basis: Basis, vectors: Floats, theta: Floats) -> Floats:
    """Values of the functions with the coefficients ``vectors``, shape ``theta.shape + (k,)``."""
    if not isinstance(basis, Panels):
        return np.asarray(basis.evaluate(theta) @ vectors)
    panel, values = basis.local(theta)
    coefficients = vectors.reshape(-1, basis.degree + 1, vectors.shape[1])
    return np.asarray(np.einsum("...d,...dk->...k", values, coefficients[panel]))
