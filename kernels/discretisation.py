"""The matrix of a law in a basis, by the method that suits the law."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ..checks import Floats, finite_number, generator, whole_number
from ..errors import AccuracyError, InputError
from .algebra import lists_branches
from .arc_quadrature import arc_matrix
from .basis import Basis
from .bins import Bins
from .branch_quadrature import branch_matrix
from .circular import CircularArcLaw
from .composition import Composition, Power
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
from .measure import SINE
from .product_quadrature import product_matrix
from .reflection import mirror_refinement, reflection_matrix
from .row_quadrature import MOST_FLIGHTS, is_affordable, row_matrix
from .sampling import DEFAULT_SAMPLES, RANDOMISATIONS, SamplingMethod, responder, sampled_array
from .specular_frame import SpecularFrame
from .symmetry import SymmetryDefect
from .table_quadrature import table_matrix
from .wall_law import WallLaw
from .weighted_sum import Combination

Method = Literal["auto", "exact", "quadrature", "qmc", "monte-carlo"]

# Rounding of an exact matrix: the edges of n cells carry a rounding error each, which moves a share of about n eps of
# a cell's measure; 1.2e-13 was measured where n eps is 1.1e-13.
ROUNDING = 8.0 * np.finfo(np.float64).eps
# Edges and offsets of isometries are rounded to about an ulp. That moves a share of about n eps of each of some n
# cells of a partition, and the n-th Legendre function, whose derivative has the norm n, by n eps: n^(3/2) eps in all.
DISPLACED = np.finfo(np.float64).eps
SEED_WITHOUT_RNG = 0
# Flights of adaptive rows that nobody asked for by name: a second or so; beyond them the shortfall is reported.
QUICK_FLIGHTS = 8_000_000
# Where `auto` may sample, so many rays tell how many the tolerance needs: the error of scrambled nets falls like their
# number to a power of about 3/4 where the integrand jumps across a curve, and is itself known to a factor 2 or so.
FIRST_RAYS, NET_ORDER, NET_MARGIN = 2**14, 0.75, 2.0
# Methods that a sum has if all its terms have them.
SUMMABLE: tuple[Method, ...] = ("exact", "quadrature", "qmc")


def discretise(
    law: Law,
    basis: Basis,
    method: Method = "auto",
    tolerance: float = 1e-8,
    samples: int | None = None,
    rng: np.random.Generator | None = None,
    *,
    symmetrise: bool = False,
) -> KernelMatrix:
    r"""The Galerkin matrix <e_i, P e_j> of a law P in a basis of L^2(sin theta d theta).

    Parameters
    ----------
    law : Law
        Any law; of a combination each term is done by its best method.
    basis : Basis
        Bins, Legendre or Panels for theta.
    method : {"auto", "exact", "quadrature", "qmc", "monte-carlo"}
        ``"exact"``: laws of isometries, to rounding, plus a bound for beams of a polygonal wall that were not
        resolved, or for kinks of a composition left out near grazing. ``"quadrature"``:
        Gauss rules, refined until two levels differ by the tolerance or the work exceeds about a second; the error
        is that difference. ``"qmc"``: rays from 8 independently scrambled Sobol sequences; the error is from their
        spread. ``"monte-carlo"``: independent rays; the error is from the variance of the counts. ``"auto"`` takes
        the first of these that the law has, except that quadrature in the entry point comes after ``"qmc"`` where it
        is slow: for traced walls of many pieces, by a prediction of its cost, and for driven laws without a wall. Of a
        traced wall a few rays are sampled first, and as many as the tolerance needs where ``samples`` are more; where
        quadrature falls short of the tolerance, all of them, and the more exact matrix is returned.
        ``KernelMatrix.method`` says what was used.
    tolerance : float
        Wanted Frobenius error of ``symmetric``. If it is not met the matrix says so: in its ``error`` and its repr.
    samples : int, optional
        Number of rays where rays are sampled, of ``"auto"`` the largest; 2**20 by default. ``"qmc"`` rounds up to 8
        times a power of two, for the quadrature of other driven laws it is the number of nodes.
    rng : numpy.random.Generator, optional
        Source of randomness; by default a fixed one, so that results are reproducible.
    symmetrise : bool
        For sampled matrices of reversible laws: count each ray both ways. The flux is then symmetric, and rows of
        ``array`` sum to 1 within the sampling error only.

    Returns
    -------
    KernelMatrix

    Raises
    ------
    InputError
        If the law does not have the method, the message says which it has; if an argument is not as described.
    AccuracyError
        If a bin received no ray, or more than 1e-4 of the rays did not escape from a wall.

    Notes
    -----
    A composition is discretised as the operator that it is: the result is the Galerkin matrix of the product, not
    the product of Galerkin matrices, which differs unless the basis is invariant.

    Examples
    --------
    >>> from asperity.kernels.bins import Bins
    >>> from asperity.kernels.ideal import maxwell
    >>> P = discretise(maxwell(0.5), Bins(2))
    >>> P.array.round(12).tolist(), P.method
    ([[0.25, 0.75], [0.75, 0.25]], 'quadrature + exact')
    """
    if not isinstance(law, Law):
        raise InputError(f"law: expected a law such as WallLaw(wall), got {law!r}")
    if not isinstance(basis, Basis):
        raise InputError(f"basis: expected a basis such as Bins(64), got {basis!r}")
    if basis.measure != SINE:
        raise InputError(f"basis: expected one for theta, with weight 'sin', got {basis!r}")
    if method not in get_args(Method):
        raise InputError(f"method: expected one of {', '.join(get_args(Method))}, got {method!r}")
    if finite_number("tolerance", tolerance) < 0.0:
        raise InputError(f"tolerance: expected a number of at least 0, got {tolerance!r}")
    number = DEFAULT_SAMPLES if samples is None else whole_number("samples", samples, 2 * RANDOMISATIONS)
    source = np.random.default_rng(SEED_WITHOUT_RNG) if rng is None else generator(rng)
    if symmetrise and not law.reversible:
        raise InputError(f"symmetrise: {law!r} is not known to be reversible, so its rays must not be turned round")
    maker = _Maker(basis, tolerance, number, source, symmetrise, patient=method == "quadrature")
    return replace(
        maker.make(law, method),
        law=repr(law),
        reversible=law.reversible,
        mirror_symmetric=law.mirror_symmetric,
        frame=law.frame,
        requested_tolerance=float(tolerance),
        metadata={"numpy": np.__version__},
    )


@dataclass(frozen=True)
class _Maker:
    """The arguments that stay the same while a law is taken apart."""

    basis: Basis
    tolerance: float
    samples: int
    rng: np.random.Generator
    symmetrise: bool
    patient: bool

    def make(self, law: Law, method: Method) -> KernelMatrix:
        """The matrix of a law; the facts of the whole law are put in by `discretise`."""
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
        if isinstance(law, WallLaw):
            few = self._few_rays(law)
            if few is not None:
                return few
            if methods[0] == "quadrature":
                return self._by_rows_or_rays(law)
        return self._made_by(law, methods[0])

    def _few_rays(self, law: WallLaw) -> KernelMatrix | None:
        """A sampled matrix of fewer rays than asked for, where these are enough for the tolerance."""
        if self.tolerance * self.samples < 1.0:
            # no order of nets comes to that: a look would be in vain
            return None
        # another stream, so that a look that finds them too few changes no result
        source, number = self.rng.spawn(1)[0], FIRST_RAYS
        while number < self.samples:
            try:
                found = replace(self, samples=number, rng=source)._sampled(law, "qmc")
            except AccuracyError:
                # a bin without rays, or rays that do not escape: these few are no measure
                return None
            if float(found.error) <= self.tolerance:
                return found
            needed = NET_MARGIN * number * (float(found.error) / self.tolerance) ** (1.0 / NET_ORDER)
            if needed > self.samples:
                return None
            number = max(2 * number, int(needed))
        return None

    def _by_rows_or_rays(self, law: WallLaw) -> KernelMatrix:
        """Adaptive rows, or rays where rows fall short of the tolerance and rays are more exact."""
        rows = self._quadrature(law)
        if float(rows.error) <= self.tolerance:
            return rows
        try:
            rays = self._sampled(law, "qmc")
        except AccuracyError:
            # too many rays do not escape; the rows have counted theirs in their error
            return rows
        return min(rows, rays, key=lambda matrix: float(matrix.error))

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
        return self._sampled(law, method)

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
        elif isinstance(law, WallLaw):
            most = MOST_FLIGHTS if self.patient else QUICK_FLIGHTS
            symmetric, error, rays = row_matrix(law.wall, self.basis, self.tolerance, most, patient=self.patient)
            how = (
                f"adaptive rows and panels, {rays} rays, predicted cheaper than sampling: Gauss against Kronrod, "
                "plus undecided entry points and twice the asymmetry"
            )
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

    def _sampled(self, law: Law, method: Method) -> KernelMatrix:
        chosen: SamplingMethod = "qmc" if method == "qmc" else "monte-carlo"
        array, used, lost = sampled_array(law, self.basis, chosen, self.samples, self.rng, self.symmetrise)
        how = (
            "variance of multinomial counts"
            if not array.replicates and chosen == "monte-carlo"
            else (f"spread of {RANDOMISATIONS} randomisations")
        )
        if lost:
            how += ", plus a bound for rays that did not escape"
        return replace(
            self._result(array.symmetric, chosen, array.error, "estimate", how),
            counts=array.counts,
            replicates=array.replicates,
            symmetrised=self.symmetrise,
            samples=used,
            unresolved=lost,
            raw_defect=array.raw_defect,
        )

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

    def _result(self, symmetric: Floats, method: str, error: float, kind: str, how: str) -> KernelMatrix:
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
