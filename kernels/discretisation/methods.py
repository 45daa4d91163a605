"""The matrix of a law by the method that suits it: laws are taken apart, and each part is done on its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.estimates import ErrorKind
from ..bases.basis import Basis
from ..bases.mirror import mirror_refinement, reflection_matrix
from ..laws.law import Combination, DrivenLaw, Law, SpecularFrame
from ..laws.random_map import responder
from ..laws.structure import has_chain, holds_of_all, lists_branches
from ..matrices.defects import SymmetryDefect
from ..matrices.matrix import KernelMatrix, frobenius_error
from ..sampling.counts import SampledArray
from ..sampling.monte_carlo import independent_rays
from ..sampling.sobol import PARTS, Net
from ..walls.circular_arc import CircularArcLaw
from ..walls.conditionals import is_few
from ..walls.wall_law import WallLaw
from ..walls.words import Word, factors_of, law_of, words_of
from .actions import Actions
from .arcs import Arcs
from .auto_wall import wall_matrix
from .densities import Densities, LeastResistance, Maps
from .entry_points import entry_matrix
from .isometries import Isometries, isometric_matrix
from .isometry_tables import IsometryTables
from .method import MOST_SEGMENTS, QUICK_SEGMENTS, Budget, Method, MethodName, isometric_rounding, rounding
from .products import product_matrix
from .scattering import Diagonal, is_scattered, scattered_matrix
from .traced import Traced

EXACT: tuple[Method, ...] = (IsometryTables(), Diagonal(), Isometries())
COMPUTED: tuple[Method, ...] = (Arcs(), Densities(), LeastResistance(), Maps(), Actions())

# Methods that a sum has if all its terms have them.
SUMMABLE: tuple[MethodName, ...] = ("exact", "quadrature", "qmc")


@dataclass(frozen=True)
class MatrixMaker:
    """The arguments of `discretise`, which stay the same while a law is taken apart.

    ``patient``: adaptive rows were asked for by name. ``thorough``: they may take some seconds where neither rays nor
    rows met the tolerance in one.
    """

    basis: Basis
    tolerance: float
    samples: int
    rng: np.random.Generator
    symmetrise: bool
    patient: bool
    thorough: bool = False

    def make(self, law: Law, method: MethodName) -> KernelMatrix:
        """The matrix of a law; the facts of the whole law are put in by `discretise`."""
        if isinstance(law, WallLaw) and law.closed_form is None and method in ("auto", "qmc", "monte-carlo"):
            # before its exact law is looked for, which may take a second
            return self._of_wall(law) if method == "auto" else self.sampled(law, method)
        closed_form = _replacement(law)
        if closed_form is not None and (method == "auto" or method in self.methods(closed_form)[:-1]):
            return self.make(closed_form, method)
        if has_chain(law) and method != "monte-carlo":
            return self._chained(law, method)
        if method != "auto":
            return self._made_by(law, method)
        best = self.methods(law)[0]
        return self._sum(law, "auto") if isinstance(law, Combination) and best != "exact" else self._made_by(law, best)

    def _of_wall(self, law: WallLaw) -> KernelMatrix:
        found = wall_matrix(self, law)
        if not self.thorough or float(found.error) <= self.tolerance or not is_few(law.wall):
            return found
        rows = self.rows(law, float("inf"), MOST_SEGMENTS)
        return min(found, rows, key=lambda matrix: float(matrix.error))

    def sampled(self, law: Law, method: MethodName) -> KernelMatrix:
        """The matrix by rays."""
        if method == "qmc":
            return self.from_net(Net(law, self.basis, self.rng), self.samples)
        found = independent_rays(law, self.basis, self.samples, self.rng, self.symmetrise)
        spread = "variance of multinomial counts" if self.basis.is_partition else "spread of parts"
        return self._from_rays("monte-carlo", found, spread)

    def from_net(self, net: Net, samples: int) -> KernelMatrix:
        """The matrix by at least so many rays of a net."""
        found = net.sampled(samples, symmetrise=self.symmetrise)
        return self._from_rays("qmc", found, f"spread of {PARTS} nets")

    def _from_rays(self, method: MethodName, found: tuple[SampledArray, int, float], how: str) -> KernelMatrix:
        array, used, lost = found
        if lost:
            how += ", plus a bound for rays that did not escape"
        return replace(
            self._result(array.symmetric, method, array.error, "estimate", how),
            counts=array.counts,
            replicates=array.replicates,
            symmetrised=self.symmetrise,
            samples=used,
            unresolved=lost,
            raw_defect=array.raw_defect,
        )

    def rows(self, law: WallLaw, fallback: float, segments: int = QUICK_SEGMENTS) -> KernelMatrix:
        """The matrix by adaptive rows; unless they were asked for, within a second or so, if they can be of use."""
        segments, fallback = (MOST_SEGMENTS, float("inf")) if self.patient else (segments, fallback)
        return Traced().matrix(law, self.basis, Budget(self.tolerance, segments=segments, fallback=fallback))

    def methods(self, law: Law) -> tuple[MethodName, ...]:
        """The methods that a law has, the best first; ``"monte-carlo"``, which all have, last."""
        closed_form = _replacement(law)
        driven: tuple[MethodName, ...] = ("qmc",) if responder(law) is not None else ()
        found: tuple[MethodName, ...]
        if closed_form is not None:
            found = (*self.methods(closed_form)[:-1], *driven)
        elif has_chain(law):
            found = _common([self._word_methods(word) for _, word in self._terms(law)])
        elif lists_branches(law):
            found = ("exact", "quadrature", *driven)
        elif Diagonal().accepts(law, self.basis):
            found = ("exact", "quadrature")
        elif isinstance(law, Combination):
            found = _common([self.methods(term) for _, term in law.terms_checked()])
        elif isinstance(law, SpecularFrame):
            found = tuple(name for name in self.methods(law.law)[:-1] if name != "exact")
        elif isinstance(law, DrivenLaw):
            rows = Traced().accepts(law, self.basis)
            accurate = isinstance(law, CircularArcLaw) or rows or Actions().accepts(law, self.basis)
            found = ("quadrature", "qmc") if accurate else ("qmc", "quadrature")
        else:
            found = ("quadrature", *driven)
        return (*dict.fromkeys(found), "monte-carlo")

    def _check_method(self, law: Law, method: MethodName) -> None:
        methods = self.methods(law)
        if method != "auto" and method not in methods:
            raise InputError(f"method: {law!r} has no method {method!r}; it has {', '.join(methods)}")

    def _made_by(self, law: Law, method: MethodName) -> KernelMatrix:
        self._check_method(law, method)
        if method == "exact":
            return self._sum(law, method) if _is_sum_of_others(law) else self._exact(law)
        if method == "quadrature":
            return self._quadrature(law)
        if method == "qmc" and isinstance(law, Combination):
            return self._sum(law, method)
        return self.sampled(law, method)

    def _exact(self, law: Law) -> KernelMatrix:
        budget = Budget(self.tolerance)
        for method in EXACT[:-1]:
            if method.accepts(law, self.basis):
                return method.matrix(law, self.basis, budget)
        return EXACT[-1].matrix(law, self.basis, budget)

    # ---- laws one after the other ----------------------------------------------------------------------------
    def _terms(self, law: Law) -> list[tuple[float, Word]]:
        """The law as a sum of chains; as one chain, of sums too, where that would be too many."""
        words = words_of(law)
        return [(1.0, factors_of(law))] if words is None else [(weight, word) for word, weight in words.items()]

    def _word_methods(self, word: Word) -> tuple[MethodName, ...]:
        if _is_short(word):
            return self.methods(law_of(word))
        if all(map(lists_branches, word)):
            return ("exact", "quadrature", "monte-carlo")
        return ("quadrature", "monte-carlo") if all(map(_is_computable, word)) else ("monte-carlo",)

    def _chained(self, law: Law, method: MethodName) -> KernelMatrix:
        self._check_method(law, method)
        terms = self._terms(law)
        made = [(weight, self._word(word, method)) for weight, word in terms]
        return made[0][1] if len(terms) == 1 else self._summed(made)

    def _word(self, word: Word, method: MethodName) -> KernelMatrix:
        """The matrix of a chain: by the first way that meets the tolerance, or else with the least error."""
        if _is_short(word):
            return self.make(law_of(word), method)
        found: list[KernelMatrix] = []
        reasons: list[InputError] = []
        for way in self._ways(word, method):
            try:
                found.append(way(word))
            except InputError as reason:
                # more branches than can be listed, or panels than can be held
                reasons.append(reason)
            if found and float(found[-1].error) <= self.tolerance:
                break
        if not found:
            raise reasons[-1]
        return min(found, key=lambda matrix: float(matrix.error))

    def _ways(self, word: Word, method: MethodName) -> list[Callable[[Word], KernelMatrix]]:
        methods = self._word_methods(word)
        ways: list[Callable[[Word], KernelMatrix]] = []
        if method != "quadrature" and "exact" in methods:
            ways.append(lambda chain: self._exact(law_of(chain)))
        if method != "exact" and "quadrature" in methods:
            if is_scattered(word):
                ways.append(self._scattered)
            ways.append(self._product)
        return ways or [lambda chain: self.sampled(law_of(chain), "monte-carlo")]

    def _scattered(self, word: Word) -> KernelMatrix:
        def isometric(chain: Sequence[Law], basis: Basis) -> tuple[Floats, float]:
            symmetric, omitted = isometric_matrix(law_of(tuple(chain)), basis, self.tolerance)
            return symmetric, omitted + isometric_rounding(basis)

        symmetric, error = scattered_matrix(word, self.basis, isometric)
        how = "eigenvalues of scatterings between isometries, to rounding, plus omitted kinks and polynomials"
        return self._result(symmetric, "quadrature", error, "estimate", how)

    def _product(self, word: Word) -> KernelMatrix:
        share = self.tolerance / (2.0 * len(word))

        def make(law: Law, panels: Basis) -> KernelMatrix:
            return replace(self, basis=panels, tolerance=share).make(law, "auto")

        symmetric, error = product_matrix(word, self.basis, make, self.tolerance)
        how = "what panels leave out between the factors, from their last coefficients, plus the factors' errors"
        return self._result(symmetric, "quadrature", error + isometric_rounding(self.basis), "estimate", how)

    def _quadrature(self, law: Law) -> KernelMatrix:
        if isinstance(law, Combination):
            return self._sum(law, "quadrature")
        if isinstance(law, SpecularFrame):
            return self._flipped(law)
        if isinstance(law, WallLaw):
            # asked for by name, or there is nothing else for the law that this one is a part of
            return self.rows(law, float("inf"))
        for method in COMPUTED:
            if method.accepts(law, self.basis):
                return method.matrix(law, self.basis, Budget(self.tolerance))
        symmetric, error = entry_matrix(cast(DrivenLaw, law), self.basis, self.samples)
        how = "difference of the last two levels of quadrature"
        return self._result(symmetric, "quadrature", error + rounding(self.basis), "estimate", how)

    def _sum(self, law: Law, method: MethodName) -> KernelMatrix:
        return self._summed([(weight, self.make(term, method)) for weight, term in Combination.of(law).terms_checked()])

    def _summed(self, terms: list[tuple[float, KernelMatrix]]) -> KernelMatrix:
        total = sum((weight * matrix for weight, matrix in terms[1:]), start=terms[0][0] * terms[0][1])
        sampled = [(weight, matrix) for weight, matrix in terms if matrix.samples]
        single = sampled[0] if len(sampled) == 1 else None
        return replace(
            total,
            method=" + ".join(dict.fromkeys(matrix.method for _, matrix in terms)),
            samples=sum(matrix.samples for _, matrix in sampled),
            unresolved=sum(weight * matrix.unresolved for weight, matrix in sampled),
            symmetrised=self.symmetrise and bool(sampled),
            # the other terms are not random: the evidence against symmetry is that of the sampled one
            raw_defect=_scaled_defect(single, total) if single else None,
            error=replace(total.error, method="sum over the terms: " + total.error.method),
            norm_bound=1.0,
        )

    def _flipped(self, law: SpecularFrame) -> KernelMatrix:
        finer, restriction = mirror_refinement(self.basis)
        inner = replace(self, basis=finer).make(law.law, "quadrature")
        flip = reflection_matrix(finer)
        return replace(
            self._result(restriction @ inner.symmetric @ flip @ restriction.T, inner.method, 0.0, "bound", ""),
            error=inner.error,
        )

    def _result(self, symmetric: Floats, method: str, error: float, kind: ErrorKind, how: str) -> KernelMatrix:
        return KernelMatrix(symmetric, self.basis, frobenius_error(error, kind, how), method=method)


def _replacement(law: Law) -> Law | None:
    """The exact law of a wall, in closed form or as a table of isometries; None for other laws."""
    found = getattr(law, "closed_form", None)
    return getattr(law, "exact_law", None) if found is None else found


def _is_sum_of_others(law: Law) -> bool:
    return isinstance(law, Combination) and not lists_branches(law)


def _common(each: Sequence[tuple[MethodName, ...]]) -> tuple[MethodName, ...]:
    return tuple(name for name in SUMMABLE if all(name in names for names in each))


def _is_short(word: Word) -> bool:
    """Whether a chain is the identity, a single law, or that in the other frame."""
    return len(word) < 2 or isinstance(law_of(word), SpecularFrame)


def _is_computable(law: Law) -> bool:
    """Whether no part of a law needs rays."""
    return holds_of_all(
        law,
        lambda part: (
            not isinstance(part, DrivenLaw)
            or isinstance(part, CircularArcLaw)
            or getattr(part, "exact_law", None) is not None
        ),
    )


def _scaled_defect(single: tuple[float, KernelMatrix], total: KernelMatrix) -> SymmetryDefect | None:
    weight, matrix = single
    raw = matrix.symmetry_defect()
    share = weight * float(np.linalg.norm(matrix.symmetric)) / (float(np.linalg.norm(total.symmetric)) or 1.0)
    return SymmetryDefect(share * float(raw), z_score=raw.z_score)
