"""The matrix of a law by the method that suits it: laws are taken apart, and each part is done on its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..checks import Floats
from ..errors import InputError
from ..estimates import ErrorKind
from ..rounding import EPS
from .algebra import lists_branches
from .arc_quadrature import arc_matrix
from .basis import Basis
from .bins import Bins
from .branch_quadrature import branch_matrix
from .circular import CircularArcLaw
from .composition import Composition, Power
from .counting import SampledArray
from .density import DensityLaw
from .directions import Directions
from .entry_quadrature import entry_matrix
from .involution import InvolutionLaw
from .isometry import table_of
from .kernel_quadrature import action_is_affordable, action_matrix, density_matrix, map_matrix
from .law import DrivenLaw, Law
from .least_resistance import LeastResistanceLaw
from .legendre import Legendre
from .matrix import KernelMatrix
from .matrix_algebra import frobenius_error
from .net import PARTS, Net
from .product_quadrature import product_matrix
from .reflection import mirror_refinement, reflection_matrix
from .responses import responder
from .row_quadrature import LARGEST_ROW, MOST_FLIGHTS, is_affordable, row_matrix
from .sampling import independent_rays
from .specular_frame import SpecularFrame
from .symmetry import SymmetryDefect
from .table_quadrature import table_matrix
from .wall_choice import wall_matrix
from .wall_law import WallLaw
from .wall_rows import is_few
from .weighted_sum import Combination

Method = Literal["auto", "exact", "quadrature", "qmc", "monte-carlo"]

# Rounding of an exact matrix: the edges of n cells carry a rounding error each, which moves a share of about n eps of
# a cell's measure; 1.2e-13 was measured where n eps is 1.1e-13.
ROUNDING = 8.0 * EPS
# Edges and offsets of isometries are rounded to about an ulp. That moves a share of about n eps of each of some n
# cells of a partition, and the n-th Legendre function, whose derivative has the norm n, by n eps: n^(3/2) eps in all.
DISPLACED = EPS
# Flights of adaptive rows that nobody asked for by name: they take about as long as two million rays; beyond them the
# shortfall is reported.
QUICK_FLIGHTS = 4_000_000
# Flights of one row, as a share of all, where a thorough answer is wanted: in some steep Bezier hollows rows with a
# fiftieth are not whole, and in bottles with a neck of a hundredth of their width rows have no end.
THOROUGH_ROW = 0.25
# Methods that a sum has if all its terms have them.
SUMMABLE: tuple[Method, ...] = ("exact", "quadrature", "qmc")


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

    def make(self, law: Law, method: Method) -> KernelMatrix:
        """The matrix of a law; the facts of the whole law are put in by `discretise`."""
        if isinstance(law, WallLaw) and law.closed_form is None and method in ("auto", "qmc", "monte-carlo"):
            # before its exact law is looked for, which may take a second
            return self._of_wall(law) if method == "auto" else self.sampled(law, method)
        closed_form = _replacement(law)
        if closed_form is not None and (method == "auto" or method in self.methods(closed_form)[:-1]):
            return self.make(closed_form, method)
        if method != "auto":
            return self._made_by(law, method)
        methods = self.methods(law)
        if methods[0] == "exact":
            try:
                return self._exact(law)
            except InputError:
                # a composition with too many branches to list; it says so only when they are listed
                methods = self.methods(law, isometries=False)
        if isinstance(law, Combination) and methods[0] != "exact":
            return self._sum(law, "auto")
        return self._made_by(law, methods[0])

    def _of_wall(self, law: WallLaw) -> KernelMatrix:
        found = wall_matrix(self, law)
        if not self.thorough or float(found.error) <= self.tolerance or not is_few(law.wall):
            return found
        rows = self.rows(law, float("inf"), MOST_FLIGHTS, THOROUGH_ROW)
        return min(found, rows, key=lambda matrix: float(matrix.error))

    def sampled(self, law: Law, method: Method) -> KernelMatrix:
        """The matrix by rays."""
        if method == "qmc":
            return self.from_net(Net(law, self.basis, self.rng), self.samples)
        found = independent_rays(law, self.basis, self.samples, self.rng, self.symmetrise)
        spread = f"spread of {PARTS} parts" if found[0].replicates else "variance of multinomial counts"
        return self._from_rays("monte-carlo", found, spread)

    def from_net(self, net: Net, samples: int) -> KernelMatrix:
        """The matrix by at least so many rays of a net."""
        found = net.sampled(samples, symmetrise=self.symmetrise)
        return self._from_rays("qmc", found, f"spread of {PARTS} nets")

    def _from_rays(self, method: Method, found: tuple[SampledArray, int, float], how: str) -> KernelMatrix:
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

    def rows(
        self, law: WallLaw, useless: float, most_flights: int = QUICK_FLIGHTS, largest_row: float = LARGEST_ROW
    ) -> KernelMatrix:
        """The matrix by adaptive rows; unless they were asked for, within a second or so, if they can be of use."""
        limits = (MOST_FLIGHTS, None) if self.patient else (most_flights, useless)
        symmetric, error, rays = row_matrix(
            law.wall, self.basis, self.tolerance, limits[0], useless=limits[1], largest_row=largest_row
        )
        how = (
            f"adaptive rows and panels, {rays} rays: Gauss against Kronrod and twice the asymmetry, "
            "plus undecided entry points"
        )
        return self._result(symmetric, "quadrature", error + ROUNDING * self.basis.size, "estimate", how)

    def methods(self, law: Law, isometries: bool = True) -> tuple[Method, ...]:
        """The methods that a law has, the best first; ``"monte-carlo"``, which all have, last."""
        closed_form = _replacement(law)
        driven: tuple[Method, ...] = ("qmc",) if responder(law) is not None else ()
        found: tuple[Method, ...]
        if closed_form is not None:
            found = (*self.methods(closed_form)[:-1], *driven)
        elif isometries and lists_branches(law):
            found = ("exact", "quadrature", *driven)
        elif isinstance(law, Combination):
            each = [self.methods(term) for _, term in law.terms_checked()]
            found = tuple(name for name in SUMMABLE if all(name in names for names in each))
        elif isinstance(law, SpecularFrame):
            found = tuple(name for name in self.methods(law.law, isometries)[:-1] if name != "exact")
        elif isinstance(law, DrivenLaw):
            rows = isinstance(law, WallLaw) and is_affordable(law.wall, self.basis)
            accurate = isinstance(law, CircularArcLaw) or rows or self._acts_accurately(law)
            found = ("quadrature", "qmc") if accurate else ("qmc", "quadrature")
        elif isinstance(law, (Composition, Power)):
            found = ("quadrature",) if all(map(self._acts_accurately, _factors(law))) else ()
        else:
            found = ("quadrature", *driven)
        return (*dict.fromkeys(found), "monte-carlo")

    def _made_by(self, law: Law, method: Method) -> KernelMatrix:
        methods = self.methods(law)
        if method not in methods:
            raise InputError(f"method: {law!r} has no method {method!r}; it has {', '.join(methods)}")
        if method == "exact":
            return self._sum(law, method) if _is_sum_of_others(law) else self._exact(law)
        if method == "quadrature":
            return self._quadrature(law)
        if method == "qmc" and isinstance(law, Combination):
            return self._sum(law, method)
        return self.sampled(law, method)

    def _exact(self, law: Law) -> KernelMatrix:
        table = table_of(law)
        if table is not None:
            symmetric, omitted = table_matrix(table, self.basis)
            how, left = (
                "masses and Gauss rules on every piece of the table of isometries, to rounding",
                "unresolved beams",
            )
        else:
            symmetric, omitted = branch_matrix(law, self.basis, self.tolerance)
            how, left = "Gauss rules between the kinks of isometries, to rounding", "omitted kinks"
        # two Markov kernels cannot be further apart than their norms together
        furthest = float(np.linalg.norm(symmetric)) + float(np.sqrt(self.basis.size))
        size = self.basis.size
        error = min(omitted + ROUNDING * size + DISPLACED * size**1.5, furthest)
        found = self._result(symmetric, "exact", error, "bound", how + (f", plus {left}" if omitted else ""))
        return found if table is None else replace(found, unresolved=table.unresolved)

    def _quadrature(self, law: Law) -> KernelMatrix:
        if isinstance(law, Combination):
            return self._sum(law, "quadrature")
        if isinstance(law, SpecularFrame):
            return self._flipped(law)
        if isinstance(law, WallLaw):
            # asked for by name, or there is nothing else for the law that this one is a part of
            return self.rows(law, useless=float("inf"))
        how = "difference of the last two levels of quadrature"
        if isinstance(law, DensityLaw) and not isinstance(self.basis, Directions):
            # three smooth functions are integrated row by row below, on the law's own panels
            symmetric, error = density_matrix(law, self.basis, self.tolerance)
        elif isinstance(law, LeastResistanceLaw) and isinstance(self.basis, Bins):
            symmetric, error = self.basis.heights[:, None] * law.flux(self.basis) * self.basis.heights, 0.0
            how = "masses of intervals, to rounding"
        elif isinstance(law, InvolutionLaw):
            symmetric, error = map_matrix(law.map, self.basis, self.tolerance)
        elif isinstance(law, CircularArcLaw):
            symmetric, error = arc_matrix(law.half_angle, self.basis)
            how = "Gauss rules on the polygons of each number of hits, plus what the remaining hits can do"
        elif isinstance(law, DrivenLaw) and not self._acts_accurately(law):
            symmetric, error = entry_matrix(law, self.basis, self.samples)
        elif isinstance(law, (Composition, Power)) and (
            self.basis.is_partition or not action_is_affordable(law, self.basis)
        ):
            symmetric, error = product_matrix(_factors(law), self.basis, self._on_finer)
            how = "difference of products in bases of two and four times the size, plus the factors' errors"
        else:
            symmetric, error = action_matrix(law, self.basis, self.tolerance)
            if law.reversible:
                # an under-resolved row of a reversible law shows as asymmetry
                error = max(error, float(np.linalg.norm(symmetric - symmetric.T)))
        error += ROUNDING * self.basis.size
        return self._result(symmetric, "quadrature", error, "estimate", how)

    def _sum(self, law: Law, method: Method) -> KernelMatrix:
        terms = [(weight, self.make(term, method)) for weight, term in Combination.of(law).terms_checked()]
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

    def _on_finer(self, law: Law, finer: Basis) -> KernelMatrix:
        return replace(self, basis=finer).make(law, "auto")

    def _acts_accurately(self, law: Law) -> bool:
        """Whether ``law.apply`` is accurate for the functions of the basis.

        A law driven by an entry point averages over a fixed rule, unless it has an `apply` of its own, which is then
        accurate for smooth functions: those of Legendre, not those with edges.
        """
        if hasattr(law, "closed_form"):
            return law.closed_form is not None and self._acts_accurately(law.closed_form)
        if isinstance(law, CircularArcLaw):
            return True
        if isinstance(law, DrivenLaw):
            return type(law)._apply is not DrivenLaw._apply and isinstance(self.basis, Legendre)
        if isinstance(law, Combination):
            return all(self._acts_accurately(term) for _, term in law.terms)
        if isinstance(law, (Composition, Power)):
            return all(map(self._acts_accurately, _factors(law)))
        return self._acts_accurately(law.law) if isinstance(law, SpecularFrame) else True

    def _result(self, symmetric: Floats, method: str, error: float, kind: ErrorKind, how: str) -> KernelMatrix:
        return KernelMatrix(symmetric, self.basis, frobenius_error(error, kind, how), method=method)


def _replacement(law: Law) -> Law | None:
    """The exact law of a wall, in closed form or as a table of isometries; None for other laws."""
    found = getattr(law, "closed_form", None)
    return getattr(law, "exact_law", None) if found is None else found


def _is_sum_of_others(law: Law) -> bool:
    return isinstance(law, Combination) and not lists_branches(law)


def _factors(law: Composition | Power) -> tuple[Law, ...]:
    return law.laws if isinstance(law, Composition) else (law.law,) * law.exponent


def _scaled_defect(single: tuple[float, KernelMatrix], total: KernelMatrix) -> SymmetryDefect | None:
    weight, matrix = single
    raw = matrix.symmetry_defect()
    share = weight * float(np.linalg.norm(matrix.symmetric)) / (float(np.linalg.norm(total.symmetric)) or 1.0)
    return SymmetryDefect(share * float(raw), z_score=raw.z_score)
