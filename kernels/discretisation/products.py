"""Matrices of chains of laws through piecewise polynomials on adaptively refined panels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.assembly import one_blas_thread
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..bases.partitions import Panels
from ..bases.polynomials import Legendre
from ..laws.law import Combination, Law
from ..laws.structure import lists_branches
from ..matrices.matrix import KernelMatrix
from .method import Budget, computed, rounding

# Width and degree of the first panels; panels of width OSCILLATION / n resolve the n polynomials of a Legendre basis.
WIDEST, DEGREE, OSCILLATION = np.pi / 12.0, 9, 8.0
# Limit on the functions on all panels: a product of two matrices of this size takes about a second. A basis with more
# cells gets panels of LOWEST_DEGREE, the lowest degree at which the last two coefficients show their decay.
MOST_FUNCTIONS, LOWEST_DEGREE = 1600, 2
# Limit on the breakpoints of a factor among the first edges, and the distance below which edges are merged.
BREAKPOINTS, SAME_EDGE = 16, 1e-10
# Number of matrices of this size in memory at a time, and the limit on their memory.
MATRICES, MOST_GIGABYTES = 5, 4.0
# Ratio of the norm that a panel leaves out to the norm of its last two coefficients. Coefficients of a function that
# jumps on a panel fall like 1/k, so the ratio is about 2 for degree 9; the rest is a margin for worse singularities.
TAIL = 3.0
# Images under isometries are compared with their projections at these fractions of a panel, because breakpoints can be
# too dense to show in the last coefficients. The norm is multiplied by PROBED. With 4 angles 2 of 53 random
# pairs of teeth had errors up to twice the estimate, with 24 angles none.
PROBES, PROBED = (0.31 + 0.6180339887 * np.arange(24)) % 1.0, 2.0
# In each round, the panels with this fraction of the error are cut into PARTS parts, and all factors are recomputed.
MARKED, PARTS = 0.9, 4
# The sum over the polynomials of a Henyey-Greenstein law ends where g^l is below NEGLIGIBLE. Laws that need more
# polynomials than HIGHEST_DEGREE are treated like any other density.
NEGLIGIBLE, HIGHEST_DEGREE = 1e-17, 4096


# A law as a term of a factor: its weight, the law, its matrix on panels and the error of the matrix.
Term: TypeAlias = tuple[float, Law, Floats, float]
# The matrix of a law by the best method.
MatrixOf: TypeAlias = Callable[[Law, Basis, Budget], KernelMatrix]


def by_panels(factors: Sequence[Law], basis: Basis, budget: Budget, matrix_of: MatrixOf) -> KernelMatrix:
    """The matrix of a chain of laws, of which none needs rays, through panels."""
    symmetric, error = product_matrix(factors, basis, budget, matrix_of)
    how = "what panels leave out between the factors, from their last coefficients, plus the factors' errors"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


@dataclass(frozen=True)
class _Level:
    symmetric: Floats
    # Error on each panel from the projections between factors.
    truncated: Floats
    # Error of the factors' matrices.
    factors: float

    @property
    def error(self) -> float:
        return float(self.truncated.sum()) + self.factors


def product_matrix(factors: Sequence[Law], basis: Basis, budget: Budget, matrix_of: MatrixOf) -> tuple[Floats, float]:
    r"""<e_i, P_1 P_2 ... e_j> with each factor's matrix on panels, and an estimate of its Frobenius error.

    Let Q be the projection on the panels between two factors. Its error is <P_k* ... e_i, (1 - Q) P_{k+1} ... e_j>. On
    each panel it is at most the product of the norms that the panel leaves out of the two sides, so one smooth side is
    enough. These norms are estimated from the last coefficients on the panel, for isometries also from a few angles.
    Panels with large errors are cut.

    Parameters
    ----------
    factors : sequence of Law
        The factors in their order of application.
    basis : Basis
    budget : Budget
        The returned error exceeds its tolerance if the largest number of panels does not meet it.
    matrix_of : callable
        From law, basis and budget to the matrix of a term of a factor.
    """
    of_each = replace(budget, tolerance=budget.tolerance / (2.0 * len(factors)))
    edges = _first_edges([law for factor in factors for _, law in _terms(factor)], basis)
    best: _Level | None = None
    while True:
        level = _level(factors, basis, _panels(edges, basis), lambda law, panels: matrix_of(law, panels, of_each))
        if best is None or level.error < best.error:
            best = level
        if level.truncated.sum() <= max(0.5 * budget.tolerance, 0.1 * level.factors):
            return best.symmetric, best.error
        order = np.argsort(level.truncated)[::-1]
        marked = order[: 1 + int(np.searchsorted(np.cumsum(level.truncated[order]), MARKED * level.truncated.sum()))]
        cuts = edges[marked] + np.arange(1, PARTS)[:, None] / PARTS * (edges[marked + 1] - edges[marked])
        finer = np.union1d(edges, cuts)
        if (finer.size - 1) * (_panels(edges, basis).degree + 1) > MOST_FUNCTIONS:
            return best.symmetric, best.error
        edges = finer


def _panels(edges: Floats, basis: Basis) -> Panels:
    lowest, highest = LOWEST_DEGREE, DEGREE
    if isinstance(basis, Panels):
        # Two degrees more than the basis, so that the last two coefficients vanish if nothing is left out.
        lowest, highest = (most + basis.degree for most in (lowest, LOWEST_DEGREE))
        highest = max(highest, DEGREE)
    degree = int(np.clip(MOST_FUNCTIONS // (edges.size - 1) - 1, lowest, highest))
    gigabytes = 8e-9 * MATRICES * ((edges.size - 1) * (degree + 1)) ** 2
    if gigabytes > MOST_GIGABYTES:
        raise InputError(
            f"basis: a product of laws on the {edges.size - 1} panels that {basis!r} needs takes {gigabytes:.0f} GB; "
            "take fewer cells, or method='monte-carlo'"
        )
    return Panels(edges, degree)


def _level(
    chain: Sequence[Law], basis: Basis, panels: Panels, matrix_of: Callable[[Law, Basis], KernelMatrix]
) -> _Level:
    factors = {
        law: [(weight, term, *_on_panels(term, panels, matrix_of)) for weight, term in _terms(law)] for law in chain
    }
    angle, mass = SINE.quadrature(panels.edges, _nodes(basis, panels))
    ends = (local_values(basis, angle).T @ local_values(panels, angle).multiply(mass[:, None])).toarray().T
    with one_blas_thread():
        before, left = _passed_on(ends, [factors[law] for law in chain], panels, adjoint=True)
        _, right = _passed_on(ends, [factors[law] for law in reversed(chain)], panels, adjoint=False)
    # Pairs the functions on both sides of each position between factors.
    truncated = sum(one * other for one, other in zip(left, reversed(right), strict=True))
    errors = [weight * error for law in chain for weight, _, _, error in factors[law]]
    return _Level(before.T @ ends, np.asarray(truncated), float(sum(errors)))


def _passed_on(
    functions: Floats, factors: Sequence[Sequence[Term]], panels: Panels, *, adjoint: bool
) -> tuple[Floats, list[Floats]]:
    """The functions after all factors or their adjoints, and the norms that the panels leave out after each factor."""
    left_out = [TAIL * _last_two(functions, panels)]
    for terms in factors:
        whole = np.asarray(sum(weight * matrix for weight, _, matrix, _ in terms))
        image = (whole.T if adjoint else whole) @ functions
        missed = TAIL * _last_two(image, panels)
        for weight, law, matrix, _ in terms:
            if law.reversible and lists_branches(law):
                missed = np.maximum(missed, PROBED * weight * _probed(law, matrix, functions, panels))
        functions = image
        left_out.append(missed)
    return functions, left_out


def _last_two(functions: Floats, panels: Panels) -> Floats:
    """Norm on each panel of the last two coefficients of all functions, shape (size, n)."""
    last = functions.reshape(-1, panels.degree + 1, functions.shape[1])[:, -2:]
    return np.asarray(np.sqrt(np.sum(last * last, axis=(1, 2))))


def _probed(law: Law, matrix: Floats, functions: Floats, panels: Panels) -> Floats:
    """Norm on each panel of the difference of the law's images and their projections, from a few angles."""
    edges = panels.edges
    angle = (edges[:-1, None] + np.diff(edges)[:, None] * PROBES).ravel()
    image = matrix @ functions
    probability, outgoing = law.branches(angle)
    difference = -(local_values(panels, angle) @ image)
    for slot in range(outgoing.shape[1]):
        difference += probability[:, slot, None] * (local_values(panels, outgoing[:, slot]) @ functions)
    square = np.mean(np.sum(difference**2, axis=1).reshape(-1, PROBES.size), axis=1)
    return np.asarray(np.sqrt(square * SINE.mass(edges[:-1], edges[1:])))


def _terms(law: Law) -> Sequence[tuple[float, Law]]:
    return Combination.of(law).terms


def _on_panels(law: Law, panels: Panels, matrix_of: Callable[[Law, Basis], KernelMatrix]) -> tuple[Floats, float]:
    ratio = law.eigenvalue_ratio
    if ratio is not None and (degrees := _degrees_used(ratio)) <= HIGHEST_DEGREE:
        polynomials = Legendre(degrees)
        angle, mass = SINE.quadrature(panels.edges, _nodes(polynomials, panels))
        ends = local_values(panels, angle).T @ (mass[:, None] * polynomials.evaluate(angle))
        return np.asarray((ends * ratio ** np.arange(polynomials.n)) @ ends.T), 0.0
    matrix = matrix_of(law, panels)
    return matrix.symmetric, float(matrix.error)


def _degrees_used(g: float) -> int:
    """The number of polynomials P_l with a factor g^l that is not negligible; 1 for g = 0."""
    return 1 if abs(g) <= NEGLIGIBLE else 1 + int(np.ceil(np.log(NEGLIGIBLE) / np.log(abs(g))))


def _nodes(basis: Basis, panels: Panels) -> int:
    """Number of Gauss nodes on a panel for products of a basis function and a function of the panels."""
    widest = float(np.diff(panels.edges).max())
    return panels.nodes_per_interval + (int(np.ceil(0.5 * basis.size * widest)) if basis.is_polynomial else 0)


def _first_edges(laws: Sequence[Law], basis: Basis) -> Floats:
    """Edges of the basis and of the laws, at most WIDEST apart."""
    special = [basis.edges]
    for law in dict.fromkeys(laws):
        special.append(law.outgoing_breakpoints)
        jumps = law.breakpoints(BREAKPOINTS)[0]
        if law.angle_map is None:
            special.append(jumps)
        elif jumps.size <= BREAKPOINTS:
            special += [jumps, np.asarray(law.angle_map(basis.edges[1:-1]))]
    found = np.unique(np.clip(np.concatenate(special), 0.0, np.pi))
    found = found[np.append(True, np.diff(found) > SAME_EDGE)]
    found[-1] = np.pi
    widest = min(WIDEST, OSCILLATION / basis.size) if basis.is_polynomial else WIDEST
    return split(found, widest)


def split(edges: Floats, widest: float) -> Floats:
    """The edges and equally spaced ones between them, so that neighbours are at most ``widest`` apart.

    Examples
    --------
    >>> split(np.array([0.0, 1.0, 3.0]), 1.0).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    pieces = np.maximum(np.ceil(np.diff(edges) / widest), 1.0)
    parts = [np.linspace(edges[k], edges[k + 1], int(n), endpoint=False) for k, n in enumerate(pieces)]
    return np.append(np.concatenate(parts), edges[-1])


def local_values(basis: Basis, angle: Floats) -> Any:
    """Values of the functions of a basis, shape (angles, n), as a sparse matrix."""
    from scipy.sparse import csr_array

    rows = np.arange(angle.size)
    if basis.is_partition:
        cell = basis.index(angle)
        return csr_array((basis.normalisation[cell], (rows, cell)), shape=(angle.size, basis.size))
    if isinstance(basis, Panels):
        panel, values = basis.local(angle)
        width = basis.degree + 1
        columns = panel[:, None] * width + np.arange(width)
        owner = np.repeat(rows, width)
        return csr_array((values.ravel(), (owner, columns.ravel())), shape=(angle.size, basis.size))
    return csr_array(basis.evaluate(angle))
