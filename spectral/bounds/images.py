"""Conditional expectations of the functions of a basis under a law, at many incoming angles, with their errors."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE, count_time, slices
from ...core.rounding import EPS
from ...kernels import Basis, CircularArcLaw, Law, Panels
from ...kernels.bases.angles import cell_among
from ...kernels.bases.assembly import is_mirror_symmetric, reflection_matrix
from ...kernels.bases.measure import SINE
from ...kernels.expectations.conditionals import Means, functions_of, height_of, weighted_means
from ...kernels.laws.law import Composition, Power, SpecularFrame, knows_errors, sum_of
from ...kernels.laws.matrix_law import ENTRY_ROUNDING, MatrixLaw, uniform_on_bins
from ...kernels.laws.structure import holds_of_all
from ...kernels.walls.circular_arc import ArcMeans
from ...kernels.walls.conditionals import MANY_SEGMENTS, WallConditionals, is_chaotic, is_few, traced_conditionals

# Incoming angles at a time, and nominal time of an outgoing angle, in seconds; traced walls count their rays too.
ANGLES_AT_ONCE, NODE_TIME = 512, 1e-7
# From this tolerance on, outgoing angles are interpolated for polynomials on panels, which hardly jump at the edges:
# errors were a twentieth to a thousandth of the reported ones, and rays a seventh of those for rules between the edges.
ROUGH = 1e-9
# Places in a panel between which a slope is taken.
SLOPE_PROBES = np.linspace(1e-3, 1.0 - 1e-3, 9)


def suits_panels(law: Law) -> bool:
    """Whether expectations on many panels have errors, at a bearable cost.

    Products have none, walls of many pieces take too long, and polynomials suffice for densities.
    """
    whole = sum_of(law.parts)
    if whole is not law:
        return all(suits_panels(term) for _, term in law.parts)
    if isinstance(law, SpecularFrame):
        # panels adapted to the law are mirror-symmetric then
        return law.mirror_symmetric is True and suits_panels(law.law)
    if isinstance(law, (Composition, Power)):
        return False
    if law.has_density:
        return law.is_lambertian
    return knows_errors(law) if law.traced_wall is None else is_few(law.traced_wall)


def is_traced(law: Law) -> bool:
    """Whether rays are traced. This takes about a millisecond per angle, fifty times as long as closed forms."""
    return not holds_of_all(law, lambda part: part.traced_wall is None)


def is_costly(law: Law, segments: int = MANY_SEGMENTS) -> bool:
    """Whether a thousand angles take minutes, because a hollow is chaotic: rays take more than so many segments."""
    return not holds_of_all(law, lambda part: part.traced_wall is None or not is_chaotic(part.traced_wall, segments))


def expectations(law: Law, basis: Basis) -> Means:
    """E[e_j(Theta') | theta] for all functions of a basis and the errors for functions of sup norm 1."""
    if sum_of(law.parts) is not law:
        return weighted_means([(weight, expectations(term, basis)) for weight, term in law.parts])
    if isinstance(law, SpecularFrame) and is_mirror_symmetric(basis):
        inner, flip = expectations(law.law, basis), reflection_matrix(basis)

        def mirrored(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
            images, errors = inner(theta, tolerance)
            return images @ flip, errors

        return mirrored
    if isinstance(law, MatrixLaw):
        rows = law.array @ uniform_on_bins(law.edges, *functions_of(basis)).in_basis(basis)
        exact = np.full(len(rows), ENTRY_ROUNDING)
        return lambda theta, tolerance: (rows[cell := cell_among(law.edges, theta)], exact[cell])
    if law.is_lambertian:
        return lambda theta, tolerance: (np.tile(basis.constant, (theta.size, 1)), np.zeros(theta.size))
    return _of_nodes(law, basis)


def expectations_of(law: Law, basis: Basis, vectors: Floats) -> Means:
    """The expectations of functions with coefficients ``vectors``, shape (n, k), with errors for the worst one."""
    if isinstance(law, CircularArcLaw) and isinstance(basis, Panels):
        return ArcMeans(law.half_angle, basis, vectors)
    height, each = height_of(basis, vectors), expectations(law, basis)
    if law.traced_wall is not None and isinstance(basis, Panels):
        # outgoing angles have errors too
        height = max(height, _slope(basis, vectors))

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        finer = tolerance / max(height, 1.0)
        parts = [each(theta[part], finer) for part in slices(theta.size, max(1, NUMBERS_AT_ONCE // basis.size))]
        images = np.concatenate([image @ vectors for image, _ in parts])
        return images, height * np.concatenate([error for _, error in parts])

    return means


def _slope(basis: Panels, vectors: Floats) -> float:
    """The largest mean slope of the functions with these coefficients, for errors of angles unrelated to it."""
    theta = basis.edges[:-1, None] + np.diff(basis.edges)[:, None] * SLOPE_PROBES
    middle = 0.5 * (theta[:, 1:] + theta[:, :-1])
    changes = np.diff((basis.evaluate(theta.ravel()) @ vectors).reshape(*theta.shape, -1), axis=1)
    return float(np.sum(SINE.density(middle)[..., None] * np.abs(changes), axis=(0, 1)).max())


def _of_nodes(law: Law, basis: Basis) -> Means:
    """Expectations from conditional distributions. Those of a traced wall share what they find at other angles."""
    degree, edges = functions_of(basis)
    wall = law.traced_wall
    few = wall if wall is not None and is_few(wall) else None

    @cache
    def shared(rough: bool) -> WallConditionals | None:
        if few is None:
            return None
        return WallConditionals(few, 1, np.empty(0), cuts=edges) if rough else traced_conditionals(few, degree, edges)

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        images, errors = [np.empty((0, basis.size))], [np.empty(0)]
        traced = shared(tolerance >= ROUGH and degree > 0 and edges.size > 0)
        for some in (theta[part] for part in slices(theta.size, ANGLES_AT_ONCE)):
            if traced is None:
                found = law.conditionals(some, max(tolerance, EPS), degree, edges)
            else:
                found, _ = traced(some, tolerance)
            count_time(NODE_TIME * found.nodes.size)
            images.append(found.in_basis(basis))
            errors.append(found.error)
        return np.concatenate(images), np.concatenate(errors)

    return means
