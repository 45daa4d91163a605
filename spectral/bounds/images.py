"""Conditional expectations of the functions of a basis under a law, at many incoming angles, with their errors."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE
from ...kernels import Basis, CircularArcLaw, DensityLaw, Law, Panels, WallLaw
from ...kernels.bases.mirror import is_mirror_symmetric, reflection_matrix
from ...kernels.expectations.arcs import ArcMeans
from ...kernels.expectations.basis_means import Means, height_of, means_of_basis, weighted_means
from ...kernels.laws.ideal import LambertianLaw
from ...kernels.laws.law import Combination, Composition, Power, SpecularFrame, knows_errors
from ...kernels.laws.structure import holds_of_all
from ...kernels.walls.circular_arc import followed_hits
from ...kernels.walls.conditionals import is_chaotic, is_few, traced_conditionals

# Incoming angles at a time.
ANGLES_AT_ONCE = 512


def suits_panels(law: Law) -> bool:
    """Whether expectations on many panels have errors, at a bearable cost.

    Products have none, walls of many pieces take too long, and polynomials suffice for densities.
    """
    if isinstance(law, Combination):
        return all(suits_panels(term) for weight, term in law.terms_checked() if weight > 0.0)
    if isinstance(law, SpecularFrame):
        # panels adapted to the law are mirror-symmetric then
        return law.mirror_symmetric is True and suits_panels(law.law)
    if isinstance(law, (Composition, Power)):
        return False
    if isinstance(law, DensityLaw):
        return isinstance(law, LambertianLaw)
    if isinstance(law, WallLaw):
        known = _known(law)
        return is_few(law.wall) if known is None else suits_panels(known)
    return knows_errors(law)


def is_traced(law: Law) -> bool:
    """Whether rays are traced. This takes about a millisecond per angle, fifty times as long as closed forms."""
    return not holds_of_all(law, lambda part: not isinstance(part, WallLaw) or part.exact_law is not None)


def is_costly(law: Law) -> bool:
    """Whether a thousand angles take minutes, because a hollow is chaotic."""
    return not holds_of_all(law, lambda part: not is_traced(part) or not is_chaotic(part.wall))  # type: ignore[attr-defined]


def expectations(law: Law, basis: Basis) -> Means:
    """E[e_j(Theta') | theta] for all functions of a basis and the errors for functions of sup norm 1."""
    if isinstance(law, Combination):
        terms = [(weight, term) for weight, term in law.terms_checked() if weight > 0.0]
        return weighted_means([(weight, expectations(term, basis)) for weight, term in terms])
    if isinstance(law, SpecularFrame) and is_mirror_symmetric(basis):
        inner, flip = expectations(law.law, basis), reflection_matrix(basis)

        def mirrored(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
            images, errors = inner(theta, tolerance)
            return images @ flip, errors

        return mirrored
    if isinstance(law, LambertianLaw):
        return lambda theta, tolerance: (np.tile(basis.constant, (theta.size, 1)), np.zeros(theta.size))
    if isinstance(law, WallLaw):
        known = _known(law)
        return _of_nodes(law, basis) if known is None else expectations(known, basis)
    return _of_nodes(law, basis)


def expectations_of(law: Law, basis: Basis, vectors: Floats) -> Means:
    """The expectations of functions with coefficients ``vectors``, shape (n, k), with errors for the worst one."""
    if isinstance(law, CircularArcLaw) and isinstance(basis, Panels):
        means_of_arcs = ArcMeans(law.half_angle, law.pieces, basis, vectors)
        return lambda theta, tolerance: means_of_arcs(theta, followed_hits(tolerance))
    height, each = height_of(basis, vectors), expectations(law, basis)

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        step = max(1, NUMBERS_AT_ONCE // basis.size)
        finer = tolerance / max(height, 1.0)
        parts = [each(theta[start : start + step], finer) for start in range(0, theta.size, step)]
        images = np.concatenate([image @ vectors for image, _ in parts])
        return images, height * np.concatenate([error for _, error in parts])

    return means


def _known(law: WallLaw) -> Law | None:
    """The exact law of a wall, or else the sum of its hollows if they have few pieces."""
    return law.exact_law or law.replacement


def _of_nodes(law: Law, basis: Basis) -> Means:
    """Expectations from conditional distributions. Those of a traced wall share what they find at other angles."""
    edges, degree = np.empty(0), max(1, basis.size - 1)
    if not basis.is_polynomial:
        edges = basis.edges[1:-1]
        degree = basis.degree if isinstance(basis, Panels) else 0 if basis.is_partition else basis.nodes_per_interval
    shared = traced_conditionals(law.wall, degree, edges) if isinstance(law, WallLaw) and is_few(law.wall) else None

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        images, errors = [np.empty((0, basis.size))], [np.empty(0)]
        for start in range(0, theta.size, ANGLES_AT_ONCE):
            some = theta[start : start + ANGLES_AT_ONCE]
            if shared is None:
                found = law.conditionals(some, tolerance, degree, edges)
            else:
                found = shared(some, tolerance).conditionals
            images.append(means_of_basis(basis, found.nodes, found.weights, found.starts))
            errors.append(found.error)
        return np.concatenate(images), np.concatenate(errors)

    return means
