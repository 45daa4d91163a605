"""The methods in the order in which `auto` tries them, and their application to compound laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias, cast, get_args

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.assembly import is_mirror_symmetric, mirror_image, mirror_refinement
from ..bases.basis import Basis
from ..bases.partitions import Bins, Panels
from ..bases.polynomials import Directions, Legendre
from ..laws.density import DensityLaw
from ..laws.deterministic import LeastResistanceLaw
from ..laws.law import Combination, Composition, Law, SpecularFrame, sum_of
from ..laws.matrix_law import acts_on_bins
from ..laws.structure import LONGEST_WORD, has_chain, holds_of_all, lists_branches, multiplied_out
from ..matrices.defects import SymmetryDefect
from ..matrices.matrix import KernelMatrix
from ..walls.circular_arc import CircularArcLaw
from ..walls.wall_law import WallLaw
from .arcs import by_arc_polygons
from .isometries import by_branches, by_isometry_table
from .method import Budget, Method, MethodName, by_independent_rays, by_sobol_rays
from .products import by_panels
from .quadrature import (
    by_blocks,
    by_conditionals,
    by_density,
    by_eigenvalues,
    by_interval_masses,
    by_map,
    has_conditionals,
)
from .radiosity import by_radiosity, has_radiosity
from .traced import by_adaptive_angles, by_rays_or_conditionals


def _of(kind: type[Law], where: Callable[[Any, Basis], bool] = lambda law, basis: True) -> Callable[[Law, Basis], bool]:
    """The test for laws of one kind, for which the method is a theorem, perhaps with a condition."""
    return lambda law, basis: isinstance(law, kind) and where(law, basis)


# Methods without rays, except the first and the last. The docstring of `discretise` states the table.
METHODS: tuple[Method, ...] = (
    Method("auto", _of(WallLaw, where=lambda law, _: sum_of(law.parts) is law), by_rays_or_conditionals),
    Method("exact", lambda law, _: law.isometry_table() is not None, by_isometry_table),
    # compositions can have too many isometries; see `_of_chain`
    Method("exact", lambda law, _: lists_branches(law) and not has_chain(law), by_branches),
    Method(
        "exact", lambda law, basis: law.eigenvalue_ratio is not None and isinstance(basis, Legendre), by_eigenvalues
    ),
    Method("exact", lambda law, _: acts_on_bins(law), by_blocks),
    Method("quadrature", _of(CircularArcLaw), by_arc_polygons),
    # `by_conditionals` integrates the three smooth functions of Directions for each incoming angle on the law's panels
    Method("quadrature", _of(DensityLaw, where=lambda _, basis: not isinstance(basis, Directions)), by_density),
    Method("quadrature", _of(LeastResistanceLaw, where=lambda _, basis: isinstance(basis, Bins)), by_interval_masses),
    Method("quadrature", lambda law, _: law.angle_map is not None, by_map),
    Method("quadrature", has_conditionals, by_conditionals),
    Method("qmc", has_radiosity, by_radiosity),
)
# Methods with rays. They are tried if no method above accepts the law and its parts do not give its matrix.
SAMPLED: tuple[Method, ...] = (
    Method("qmc", lambda law, _: law.random_map() is not None, by_sobol_rays),
    Method("quadrature", lambda law, _: law.traced_wall is not None, by_adaptive_angles),
    Method("monte-carlo", lambda law, _: True, by_independent_rays),
)
# Panels for the question whether a factor needs rays, whose answer is the same on all panels.
ANY_PANELS = Panels(np.array([0.0, np.pi]), 0)

# The computation of a matrix within a budget.
Computation: TypeAlias = Callable[[Budget], KernelMatrix]


def matrix_by(law: Law, wanted: str, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law by the first method of the wanted kind that accepts it, or from its parts.

    Raises InputError if the law does not have this kind of method.
    """
    # Independent rays use the law without simplification.
    wanted = "monte-carlo" if wanted == by_independent_rays.__name__ else wanted
    given = law if wanted == "monte-carlo" else multiplied_out(law)
    found = computation(given, wanted, basis)
    if found is None:
        names = ", ".join(name for name in get_args(MethodName)[1:] if computation(given, name, basis) is not None)
        raise InputError(f"method: {law!r} has no method {wanted!r}; it has {names}")
    if budget.engine and _method(SAMPLED, given, wanted, basis) is None:
        raise InputError(
            f"method: checkpoint and client take rays of one kind, and {wanted!r} computes {law!r} from its parts; "
            "use 'monte-carlo'"
        )
    return found(budget)


def computation(law: Law, wanted: str, basis: Basis) -> Computation | None:
    """The computation by the first method of the wanted kind that accepts a law, or from its parts, if there is one."""
    from_rays = _method(SAMPLED, law, wanted, basis)
    if wanted == "auto":
        return _without_rays(law, basis) or from_rays
    return _method(METHODS, law, wanted, basis) or from_rays or _from_parts(law, wanted, basis)


def _without_rays(law: Law, basis: Basis) -> Computation | None:
    return _method(METHODS, law, "auto", basis) or _from_parts(law, "auto", basis)


def _method(methods: Sequence[Method], law: Law, wanted: str, basis: Basis) -> Computation | None:
    named = (method for method in methods if wanted in ("auto", method.name, method.matrix.__name__))
    return next((partial(method.matrix, law, basis) for method in named if method.accepts(law, basis)), None)


def _from_parts(law: Law, wanted: str, basis: Basis) -> Computation | None:
    kinds: dict[type, Callable[[Any, str, Basis], Computation | None]]
    kinds = {Combination: _of_sum, Composition: _of_chain, SpecularFrame: _of_mirrored}
    return kinds[type(law)](law, wanted, basis) if type(law) in kinds else None


def _of_sum(law: Combination, wanted: str, basis: Basis) -> Computation | None:
    """Each term by its own method."""
    # If the whole sum has too many chains to be multiplied out, single terms can still be.
    terms = [(weight, multiplied_out(term)) for weight, term in law.terms]
    found = [(weight, computation(term, wanted, basis)) for weight, term in terms]
    parts = [(weight, one) for weight, one in found if one is not None]
    if wanted == "monte-carlo" or len(parts) < len(terms):
        return None
    exact = [computation(term, "exact", basis) is not None for _, term in terms]
    return lambda budget: _added(_matrices(parts, exact, budget), budget)


def _added(made: list[tuple[float, KernelMatrix]], budget: Budget) -> KernelMatrix:
    """The weighted sum of the matrices of terms, which are taken out of the list."""
    methods = " + ".join(dict.fromkeys(matrix.method for _, matrix in made))
    sampled = [(weight, matrix.samples, matrix.unresolved) for weight, matrix in made if matrix.samples]
    defects = [(weight * _norm(matrix), matrix.symmetry_defect()) for weight, matrix in made if matrix.samples]
    weight, matrix = made.pop(0)
    total = weight * matrix
    while made:  # no matrix is kept that has been added
        weight, matrix = made.pop(0)
        total = total + weight * matrix
    del matrix
    # The other terms are not random, so a single sampled term alone has a raw symmetry defect.
    single = defects[0] if len(defects) == 1 else None
    return replace(
        total,
        method=methods,
        samples=sum(samples for _, samples, _ in sampled),
        unresolved=sum(weight * unresolved for weight, _, unresolved in sampled),
        symmetrised=budget.symmetrise and bool(sampled),
        raw_defect=single and SymmetryDefect(single[0] / (_norm(total) or 1.0) * single[1], z_score=single[1].z_score),
        error=replace(total.error, method="sum over the terms: " + total.error.method),
        norm_bound=1.0,
    )


def _matrices(
    parts: Sequence[tuple[float, Computation]], exact: Sequence[bool], budget: Budget
) -> list[tuple[float, KernelMatrix]]:
    """The matrices of the terms: exact ones, whose errors do not depend on the tolerance, leave the others more."""
    found: dict[int, KernelMatrix] = {}
    share = budget.tolerance
    for wanted_exact in (True, False):
        for k in (k for k, is_exact in enumerate(exact) if is_exact is wanted_exact):
            found[k] = parts[k][1](replace(budget, tolerance=share))
        left = budget.tolerance - sum(parts[k][0] * float(matrix.error) for k, matrix in found.items())
        weight_left = sum(weight for k, (weight, _) in enumerate(parts) if k not in found)
        share = max(share, left / weight_left) if weight_left > 0.0 else share
    return [(weight, found[k]) for k, (weight, _) in enumerate(parts)]


def _of_chain(law: Composition, wanted: str, basis: Basis) -> Computation | None:
    """By isometries, else through panels, which requires that no part of the chain needs rays.

    The first of these matrices that meets the tolerance is returned, or else the most exact one.
    """
    if len(law.laws) > LONGEST_WORD:
        raise InputError(
            f"law: expected compositions of at most {LONGEST_WORD} laws, got {len(law.laws)}; compose the matrices: "
            "discretise(law, basis) ** n"
        )
    found: list[Computation] = []
    if wanted in ("auto", "exact") and all(map(lists_branches, law.laws)):
        found.append(partial(by_branches, law, basis))
    if wanted in ("auto", "quadrature") and holds_of_all(law, _needs_no_rays):
        found.append(
            lambda budget: by_panels(law.laws, basis, budget, lambda part, on, own: matrix_by(part, "auto", on, own))
        )
    return partial(_most_exact, found) if found else None


def _needs_no_rays(law: Law) -> bool:
    return any(method.accepts(law, ANY_PANELS) for method in METHODS if method.name not in ("auto", "qmc"))


def _most_exact(computations: Sequence[Computation], budget: Budget) -> KernelMatrix:
    best: KernelMatrix | None = None
    for compute in computations:
        try:
            found = compute(budget)
        except InputError:
            # Too many branches to list, or too many panels for the memory.
            if compute is computations[-1] and best is None:
                raise
            continue
        best = found if best is None else min(best, found, key=lambda matrix: float(matrix.error))
        if float(best.error) <= budget.tolerance:
            break
    assert best is not None  # else the last one raised
    return best


def _of_mirrored(law: SpecularFrame, wanted: str, basis: Basis) -> Computation | None:
    """A law in the other frame, from the law's matrix in a mirror-symmetric basis."""

    def inner_on(chosen: Basis) -> Computation | None:
        # If rays are the best method of the law, rays of the law in the other frame are as good.
        return _without_rays(law.law, chosen) if wanted == "auto" else computation(law.law, wanted, chosen)

    if wanted not in ("auto", "exact", "quadrature") or inner_on(basis) is None:
        return None

    finer, restriction = (basis, None) if is_mirror_symmetric(basis) else mirror_refinement(basis)
    matrix_of_law = cast(Computation, inner_on(finer))

    def mirrored(part: Any) -> Floats:
        image = mirror_image(part, finer, rows=False)
        return image if restriction is None else restriction @ image @ restriction.T

    def matrix(budget: Budget) -> KernelMatrix:
        inner = matrix_of_law(budget)
        return KernelMatrix(
            mirrored(inner.symmetric),
            basis,
            inner.error,
            method=inner.method,
            replicates=tuple(map(mirrored, inner.replicates)),
            samples=inner.samples,
            unresolved=inner.unresolved,
        )

    return matrix


def _norm(matrix: KernelMatrix) -> float:
    return float(np.linalg.norm(matrix.symmetric))
