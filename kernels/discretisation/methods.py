"""The methods in the order in which `auto` asks them, and what they make of laws that are made of others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, cast, get_args

import numpy as np

from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.mirror import mirror_refinement, reflection_matrix
from ..laws.law import Law, retroreflection, specular
from ..laws.structure import Rules, fold, has_chain
from ..matrices.defects import SymmetryDefect
from ..matrices.matrix import KernelMatrix
from ..walls.words import law_of, words_of
from .actions import Actions
from .arcs import Arcs
from .auto_wall import AutoWall
from .densities import Densities, LeastResistance, Maps
from .entry_points import EntryPoints
from .isometries import Isometries
from .isometry_tables import IsometryTables
from .method import Budget, Method, MethodName, Recipe
from .products import Chain, Factor
from .sampled import MonteCarlo, Sobol
from .scattering import Diagonal
from .traced import Traced

# Without rays, but for AutoWall; the docstring of `discretise` states the table in this order.
METHODS: tuple[Method, ...] = (
    AutoWall(), IsometryTables(), Isometries(), Diagonal(), Arcs(), Densities(), LeastResistance(), Maps(), Actions(),
)  # fmt: skip
# By rays: asked where nothing above accepts the law, nor can its matrix be made from those of its parts.
SAMPLED: tuple[Method, ...] = (Traced(), Sobol(), Traced(any_wall=True), EntryPoints(), MonteCarlo())
# The methods of a law that is made of others, in the order in which a refusal names them.
NAMES: tuple[MethodName, ...] = get_args(MethodName)[1:]


def recipe(law: Law, wanted: MethodName) -> Callable[[Basis, Budget], KernelMatrix]:
    """How the matrix of a law is made: by the first method that accepts it whole, or from its parts.

    Raises an InputError, when it is called, if the law does not have the method.
    """

    def made(basis: Basis, budget: Budget) -> KernelMatrix:
        # independent rays need nothing but the law as it stands
        found = _Law(law) if wanted == "monte-carlo" else _simplified(law)
        if wanted != "auto" and not found.has(wanted, basis):
            names = ", ".join(_names(found, basis))
            raise InputError(f"method: {law!r} has no method {wanted!r}; it has {names}")
        return found.matrix(wanted, basis, budget)

    return made


class _Law:
    """A law, by the first method that accepts it whole; or else from its parts, if it has any."""

    def __init__(self, law: Law, parts: Recipe | None = None) -> None:
        self.law, self.parts = law, parts

    @property
    def terms(self) -> Sequence[tuple[float, _Law]]:
        """The weighted laws that it is a sum of."""
        return self.parts.terms if isinstance(self.parts, _Sum) else ((1.0, self),)

    @property
    def factors(self) -> Sequence[Factor]:
        """The laws that it is a chain of."""
        return self.parts.factors if isinstance(self.parts, (Chain, _Mirrored)) else (self,)

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        return self._method(wanted, basis) is not None or (self.parts is not None and self.parts.has(wanted, basis))

    def without_rays(self, basis: Basis) -> bool:
        if self.parts is not None:
            return self.parts.without_rays(basis)
        return any(method.accepts(_resolved(self.law), basis) for method in METHODS if method.name != "auto")

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        method = self._method(wanted, basis)
        if method is not None:
            return method.matrix(self._law(wanted), basis, budget)
        assert self.parts is not None  # anything else can be sampled, or `has` was not asked
        return self.parts.matrix(wanted, basis, budget)

    def _method(self, wanted: MethodName, basis: Basis) -> Method | None:
        found = self._first(METHODS, wanted, basis)
        if found is None and wanted == "auto" and self.parts is not None and self.parts.has("auto", basis):
            return None
        return found or self._first(SAMPLED, wanted, basis)

    def _first(self, methods: Sequence[Method], wanted: MethodName, basis: Basis) -> Method | None:
        named = (method for method in methods if wanted in ("auto", method.name))
        return next((method for method in named if method.accepts(self._law(wanted), basis)), None)

    def _law(self, wanted: MethodName) -> Law:
        """The law; where it is to be computed, that of a polygonal wall as a table of isometries."""
        return _resolved(self.law) if wanted in ("exact", "quadrature") else self.law


class _Sum:
    """A weighted sum, each term by its own method."""

    def __init__(self, terms: Sequence[tuple[float, _Law]]) -> None:
        # of a sum in which some chains are too many to be multiplied out, the others may be simplified
        self.parts = [(weight, _simplified(one.law) if isinstance(one.parts, Chain) else one) for weight, one in terms]

    @property
    def terms(self) -> Sequence[tuple[float, _Law]]:
        return [(weight * fraction, one) for weight, part in self.parts for fraction, one in part.terms]

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        return wanted != "monte-carlo" and all(part.has(wanted, basis) for _, part in self.parts)

    def without_rays(self, basis: Basis) -> bool:
        return all(part.without_rays(basis) for _, part in self.parts)

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        made = [(weight, part.matrix(wanted, basis, budget)) for weight, part in self.parts]
        total = sum((weight * matrix for weight, matrix in made[1:]), start=made[0][0] * made[0][1])
        sampled = [(weight, matrix) for weight, matrix in made if matrix.samples]
        single = sampled[0] if len(sampled) == 1 else None
        return replace(
            total,
            method=" + ".join(dict.fromkeys(matrix.method for _, matrix in made)),
            samples=sum(matrix.samples for _, matrix in sampled),
            unresolved=sum(weight * matrix.unresolved for weight, matrix in sampled),
            symmetrised=budget.symmetrise and bool(sampled),
            # the other terms are not random: the evidence against symmetry is that of the sampled one
            raw_defect=_scaled_defect(*single, total) if single else None,
            error=replace(total.error, method="sum over the terms: " + total.error.method),
            norm_bound=1.0,
        )


class _Mirrored:
    """A law in the other frame, by quadrature of the law in a basis that the flip keeps."""

    def __init__(self, inner: _Law) -> None:
        self.inner = inner

    @property
    def factors(self) -> Sequence[Factor]:
        return (*self.inner.factors, _Law(specular()))

    def has(self, wanted: MethodName, basis: Basis) -> bool:
        if wanted == "auto":
            # where rays of the law would come first, rays of the law in the other frame are as good
            return _names(self.inner, basis)[0] in ("exact", "quadrature")
        return wanted in ("exact", "quadrature") and self.inner.has(wanted, basis)

    def without_rays(self, basis: Basis) -> bool:
        return self.inner.without_rays(basis)

    def matrix(self, wanted: MethodName, basis: Basis, budget: Budget) -> KernelMatrix:
        finer, restriction = mirror_refinement(basis)
        inner = self.inner.matrix("exact" if wanted == "exact" else "quadrature", finer, budget)
        flip = reflection_matrix(finer)
        symmetric = restriction @ inner.symmetric @ flip @ restriction.T
        return KernelMatrix(symmetric, basis, inner.error, method=inner.method)


def _chain(parts: Sequence[_Law]) -> Recipe:
    factors = [factor for part in parts for factor in part.factors]
    return Chain(factors) if factors else _Law(retroreflection())


def _simplified(law: Law) -> _Law | _Sum:
    """Chains by the algebra first, as long as not too many come of them; of other laws only what they are made of."""
    words = words_of(law) if has_chain(law) else None
    if words is None:
        return cast(_Law, fold(law, RULES))
    terms = [(weight, cast(_Law, fold(law_of(word), RULES))) for word, weight in words.items()]
    return terms[0][1] if len(terms) == 1 else _Sum(terms)


# Of every law that is made of others `_Law` asks the methods first, so all facts that these rules see are such.
RULES: Rules[Any] = Rules(_Law, _Sum, _chain, _Mirrored, _Law)


def _names(found: _Law | _Sum, basis: Basis) -> tuple[MethodName, ...]:
    """The methods of a law, the best first."""
    if isinstance(found, _Law) and found.parts is None:
        law = _resolved(found.law)
        accepted = [method.name for method in METHODS + SAMPLED if method.accepts(law, basis)]
        return tuple(dict.fromkeys(name for name in accepted if name != "auto"))
    return tuple(name for name in NAMES if name == "monte-carlo" or found.has(name, basis))


def _resolved(law: Law) -> Law:
    """The law; of a polygonal wall that is resolved into isometries, the table of these."""
    return law.exact_law or law


def _scaled_defect(weight: float, matrix: KernelMatrix, total: KernelMatrix) -> SymmetryDefect:
    raw = matrix.symmetry_defect()
    fraction = weight * float(np.linalg.norm(matrix.symmetric)) / (float(np.linalg.norm(total.symmetric)) or 1.0)
    return SymmetryDefect(fraction * float(raw), z_score=raw.z_score)
