"""The methods in the order in which `auto` tries them, and their application to compound laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast, get_args

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.mirror import is_mirror_symmetric, mirror_image, mirror_refinement
from ..laws.law import Law, retroreflection, specular
from ..laws.structure import LONGEST_WORD, Rules, fold, has_chain, law_of, words_of
from ..matrices.defects import SymmetryDefect
from ..matrices.matrix import KernelMatrix
from .actions import Actions
from .arcs import Arcs
from .densities import Densities, Diagonal, LeastResistance, Maps
from .isometries import Isometries
from .isometry_tables import IsometryTables
from .method import Budget, Method, MethodName, Recipe
from .products import Chain, Factor
from .rays_or_conditionals import RaysOrConditionals
from .sampled import MonteCarlo, Sobol
from .traced import Traced

# Methods without rays, except the first. The docstring of `discretise` states the table in this order.
METHODS: tuple[Method, ...] = (
    RaysOrConditionals(), IsometryTables(), Isometries(), Diagonal(), Arcs(), Densities(), LeastResistance(), Maps(),
    Actions(),
)  # fmt: skip
# Methods with rays. They are tried if no method above accepts the law and its parts do not give its matrix.
SAMPLED: tuple[Method, ...] = (Sobol(), Traced(), MonteCarlo())
# The kinds of methods of a compound law, in the order of the error message.
NAMES: tuple[MethodName, ...] = get_args(MethodName)[1:]


def recipe(law: Law, wanted: MethodName) -> Callable[[Basis, Budget], KernelMatrix]:
    """The function of basis and budget that computes a law's matrix by the first method that accepts it, or by parts.

    This function raises InputError if the law does not have the wanted kind of method.
    """

    def made(basis: Basis, budget: Budget) -> KernelMatrix:
        # Independent rays use the law without simplification.
        found = _Law(law) if wanted == "monte-carlo" else _simplified(law)
        if wanted != "auto" and not found.has(wanted, basis):
            names = ", ".join(_names(found, basis))
            raise InputError(f"method: {law!r} has no method {wanted!r}; it has {names}")
        if budget.engine and (isinstance(found, _Sum) or not found.has_whole(wanted, basis)):
            raise InputError(
                f"method: checkpoint and client take rays of one kind, and {wanted!r} computes {law!r} from its parts; "
                "use 'monte-carlo'"
            )
        return found.matrix(wanted, basis, budget)

    return made


class _Law:
    """The computation of a law's matrix by the first method that accepts the law, else from its parts."""

    def __init__(self, law: Law, parts: Recipe | None = None) -> None:
        self.law, self.parts = law, parts

    @property
    def terms(self) -> Sequence[tuple[float, _Law]]:
        """The terms of the law as a weighted sum."""
        return self.parts.terms if isinstance(self.parts, _Sum) else ((1.0, self),)

    @property
    def factors(self) -> Sequence[Factor]:
        """The factors of the law as a chain."""
        return self.parts.factors if isinstance(self.parts, (Chain, _Mirrored)) else (self,)

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        return self._method(wanted, basis) is not None or (self.parts is not None and self.parts.has(wanted, basis))

    def has_whole(self, wanted: MethodName, basis: Basis) -> bool:
        """Whether a method takes the law, not its parts."""
        return self._method(wanted, basis) is not None

    def without_rays(self, basis: Basis) -> bool:
        if self.parts is not None:
            return self.parts.without_rays(basis)
        return any(method.accepts(self.law, basis) for method in METHODS if method.name != "auto")

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        method = self._method(wanted, basis)
        if method is not None:
            return method.matrix(self.law, basis, budget)
        assert self.parts is not None  # `has` was True, and any other law can be sampled
        return self.parts.matrix(wanted, basis, budget)

    def _method(self, wanted: MethodName, basis: Basis) -> Method | None:
        found = self._first(METHODS, wanted, basis)
        if found is None and wanted == "auto" and self.parts is not None and self.parts.has("auto", basis):
            return None
        return found or self._first(SAMPLED, wanted, basis)

    def _first(self, methods: Sequence[Method], wanted: MethodName, basis: Basis) -> Method | None:
        named = (method for method in methods if wanted in ("auto", method.name))
        return next((method for method in named if method.accepts(self.law, basis)), None)


class _Sum:
    """The computation of a weighted sum, each term by its own method."""

    def __init__(self, terms: Sequence[tuple[float, _Law]]) -> None:
        # If the whole sum has too many chains to be multiplied out, single terms can still be simplified.
        self.parts = [(weight, _simplified(one.law) if isinstance(one.parts, Chain) else one) for weight, one in terms]

    @property
    def terms(self) -> Sequence[tuple[float, _Law]]:
        return [(weight * fraction, one) for weight, part in self.parts for fraction, one in part.terms]

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        return wanted != "monte-carlo" and all(part.has(wanted, basis) for _, part in self.parts)

    def without_rays(self, basis: Basis) -> bool:
        return all(part.without_rays(basis) for _, part in self.parts)

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        made = self._matrices(wanted, basis, budget)
        methods = " + ".join(dict.fromkeys(matrix.method for _, matrix in made))
        sampled = [(weight, matrix.samples, matrix.unresolved) for weight, matrix in made if matrix.samples]
        parts = [(weight * _norm(matrix), matrix.symmetry_defect()) for weight, matrix in made if matrix.samples]
        weight, matrix = made.pop(0)
        total = weight * matrix
        while made:  # no matrix is kept that has been added
            weight, matrix = made.pop(0)
            total = total + weight * matrix
        del matrix
        # The other terms are not random, so a single sampled term alone has a raw symmetry defect.
        single = parts[0] if len(parts) == 1 else None
        return replace(
            total,
            method=methods,
            samples=sum(samples for _, samples, _ in sampled),
            unresolved=sum(weight * unresolved for weight, _, unresolved in sampled),
            symmetrised=budget.symmetrise and bool(sampled),
            raw_defect=single
            and SymmetryDefect(single[0] / (_norm(total) or 1.0) * single[1], z_score=single[1].z_score),
            error=replace(total.error, method="sum over the terms: " + total.error.method),
            norm_bound=1.0,
        )

    def _matrices(self, wanted: MethodName, basis: Basis, budget: Budget) -> list[tuple[float, KernelMatrix]]:
        """The matrices of the terms: exact ones, whose errors do not depend on the tolerance, leave the others more."""
        exact = [part.has("exact", basis) for _, part in self.parts]
        found: dict[int, KernelMatrix] = {}
        share = budget.tolerance
        for wanted_exact in (True, False):
            chosen = [k for k, is_exact in enumerate(exact) if is_exact is wanted_exact]
            for k in chosen:
                found[k] = self.parts[k][1].matrix(wanted, basis, replace(budget, tolerance=share))
            left = budget.tolerance - sum(self.parts[k][0] * float(matrix.error) for k, matrix in found.items())
            weight_left = sum(weight for k, (weight, _) in enumerate(self.parts) if k not in found)
            share = max(share, left / weight_left) if weight_left > 0.0 else share
        return [(weight, found[k]) for k, (weight, _) in enumerate(self.parts)]


class _Mirrored:
    """The computation of a law in the other frame, from the law's matrix in a mirror-symmetric basis."""

    def __init__(self, inner: _Law) -> None:
        self.inner = inner

    @property
    def factors(self) -> Sequence[Factor]:
        return (*self.inner.factors, _Law(specular()))

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        if wanted == "auto":
            # If rays are the best method of the law, rays of the law in the other frame are as good.
            return self._has_choice(basis) or _names(self.inner, basis)[0] in ("exact", "quadrature")
        return wanted in ("exact", "quadrature") and self.inner.has(wanted, basis)

    def without_rays(self, basis: Basis) -> bool:
        return self.inner.without_rays(basis)

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        finer, restriction = (basis, None) if is_mirror_symmetric(basis) else mirror_refinement(basis)
        if wanted == "auto" and not self._has_choice(finer):
            wanted = "quadrature"
        inner = self.inner.matrix(wanted, finer, budget)

        def mirrored(part: Any) -> Floats:
            image = mirror_image(part, finer, rows=False)
            return image if restriction is None else restriction @ image @ restriction.T

        return KernelMatrix(
            mirrored(inner.symmetric),
            basis,
            inner.error,
            method=inner.method,
            replicates=tuple(map(mirrored, inner.replicates)),
            samples=inner.samples,
            unresolved=inner.unresolved,
        )

    def _has_choice(self, basis: Basis) -> bool:
        """Whether the law has walls, whose method the tolerance decides."""
        return any(RaysOrConditionals().accepts(term.law, basis) for _, term in self.inner.terms)


def _chain(parts: Sequence[_Law]) -> Recipe:
    factors = [factor for part in parts for factor in part.factors]
    if len(factors) > LONGEST_WORD:
        raise InputError(
            f"law: expected compositions of at most {LONGEST_WORD} laws, got {len(factors)}; compose the matrices: "
            "discretise(law, basis) ** n"
        )
    return Chain(factors) if factors else _Law(retroreflection())


def _simplified(law: Law) -> _Law | _Sum:
    """The recipe of a law, whose chains are first simplified by the algebra unless this gives too many terms."""
    words = words_of(law) if has_chain(law) else None
    if words is None:
        return cast(_Law, fold(law, RULES))
    terms = [(weight, cast(_Law, fold(law_of(word), RULES))) for word, weight in words.items()]
    return terms[0][1] if len(terms) == 1 else _Sum(terms)


# `_Law` wraps every compound law and tries the methods first, so all facts in these rules are of type `_Law`.
RULES: Rules[Any] = Rules(_Law, _Sum, _chain, _Mirrored, _Law)


def _names(found: _Law | _Sum, basis: Basis) -> tuple[MethodName, ...]:
    """The kinds of methods of a law, the best first."""
    if isinstance(found, _Law) and found.parts is None:
        accepted = [method.name for method in METHODS + SAMPLED if method.accepts(found.law, basis)]
        return tuple(dict.fromkeys(name for name in accepted if name != "auto"))
    return tuple(name for name in NAMES if name == "monte-carlo" or found.has(name, basis))


def _norm(matrix: KernelMatrix) -> float:
    return float(np.linalg.norm(matrix.symmetric))
