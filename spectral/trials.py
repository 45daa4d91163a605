"""Residuals of trial functions, for the law itself and not for its matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..checks import Floats
from ..kernels import Basis, DensityLaw, Law, Legendre, Panels
from ..kernels.angle_panels import GAUSS, KRONROD, NODES
from ..kernels.density import GAUSS_NODES, split_rows
from ..kernels.kernel_quadrature import GRAZING_EDGES
from ..kernels.law import AngleFunction
from ..kernels.measure import SINE, gauss_on_intervals
from ..kernels.panel_rows import function_rows
from ..kernels.weighted_sum import Combination
from ..rounding import EPS

# Squared residuals are wanted to this share of themselves, in at most MOST_ROWS rows of the law.
SHARE, MOST_ROWS, NARROWEST = 0.1, 900, 1e-9
# Functions of the basis times outgoing angles held at a time.
CHUNK_ROWS = 256
# Halves of (0, pi) overlap by no more.
HALF_ROUNDING = 1e-12
# Errors of rows of which nothing is asked.
ROW_TOLERANCE = 1e-8
# A Gauss rule with n nodes on a panel of width h follows cos(l theta) to rounding for l h up to about this times n.
NODES_PER_DEGREE = 1.2
# Nodes beyond those that the basis asks for, of the two rules that are compared.
MORE_NODES = (0, 8)


@dataclass(frozen=True)
class Residuals:
    """What quadrature over the incoming angle finds of orthonormal trial functions v_i and a self-adjoint law P.

    Attributes
    ----------
    quotients : array of shape (k,)
        <v_i, P v_i>.
    quotient_errors : array of shape (k,)
        Estimated errors of the quotients.
    norms : array of shape (k,)
        ||P v_i - rho_i v_i||, the quadrature's own error included.
    rows : int
        Angles at which the law was applied.
    """

    quotients: Floats
    quotient_errors: Floats
    norms: Floats
    rows: int

    def split(self, number: int) -> tuple[Residuals, Residuals]:
        """Those of the first functions, and of the others."""
        both = (
            (self.quotients[part], self.quotient_errors[part], self.norms[part])
            for part in (slice(None, number), slice(number, None))
        )
        first, others = (Residuals(*arrays, self.rows) for arrays in both)
        return first, others


def residuals(
    law: Law,
    basis: Basis,
    vectors: Floats,
    values: Floats,
    most_rows: int = MOST_ROWS,
    *,
    mirrored: bool = False,
    quotient_error: float = 0.0,
    leading: int | None = None,
) -> Residuals:
    """Rayleigh quotients and residuals of the functions with the coefficients ``vectors``, shape (n, k).

    ``values``, shape (k,), are the eigenvalues that they are thought to have. ||P v - rho v||^2 is integrated as it
    stands: as <P v, P v> - rho^2 it would lose half of its digits. Panels in the incoming angle are halved where Gauss
    and Kronrod differ most for the ``leading`` functions, by default all; their difference counts as error.
    ``mirrored`` says that each function is even or odd, and the law mirror-symmetric; an error of a quotient below
    ``quotient_error`` is good enough.
    """
    if isinstance(law, DensityLaw) and isinstance(basis, Legendre):
        return _smooth_residuals(law, basis, vectors, values)
    function = _TrialFunctions(law, basis, vectors, quotient_error)
    low, high = _first_panels(basis)
    if mirrored:
        inside = low < 0.5 * np.pi - HALF_ROUNDING
        low, high = low[inside], np.minimum(high[inside], 0.5 * np.pi)
    kept = np.zeros((2, 0))
    # integrals, the differences of the two rules, and what the errors of the rows do
    total, error, doubt = (np.zeros((0, 2, len(values))) for _ in range(3))
    rows = 0
    while low.size:
        fresh = _integrals(function, values, low, high, 2.0 if mirrored else 1.0)
        rows += low.size * len(NODES)
        kept = np.concatenate([kept, [low, high]], axis=1)
        total, error, doubt = (np.concatenate(both) for both in zip((total, error, doubt), fresh, strict=True))
        square = total[:, 1].sum(axis=0)
        # a Kato-Temple bound adds about the square to the quotient: the quotient's own error should be less
        wanted = np.stack(
            [
                np.maximum(SHARE * square + 4.0 * EPS, quotient_error),
                np.maximum(SHARE * square + (8.0 * EPS) ** 2, SHARE * quotient_error),
            ]
        )
        share = (error / wanted)[..., :leading].max(axis=(1, 2))
        affordable = max(most_rows - rows, 0) // (2 * len(NODES))
        worst = np.argsort(-share)[:affordable]
        worst = worst[(share[worst] * len(share) > 1.0) & (np.diff(kept[:, worst], axis=0)[0] > NARROWEST)]
        if np.all((error.sum(axis=0) <= wanted)[:, :leading]):
            break
        middle = kept[:, worst].mean(axis=0)
        low, high = np.append(kept[0, worst], middle), np.append(middle, kept[1, worst])
        rest = np.setdiff1d(np.arange(len(share)), worst)
        kept, total, error, doubt = kept[:, rest], total[rest], error[rest], doubt[rest]
    correction, square = total.sum(axis=0)
    correction_error, square_error = (error + doubt).sum(axis=0)
    return Residuals(values + correction, correction_error, np.sqrt(np.maximum(square, 0.0) + square_error), rows)


def _smooth_residuals(law: Law, basis: Basis, vectors: Floats, values: Floats) -> Residuals:
    """The same for polynomials and a density, whose images are smooth: two Gauss rules that follow them."""
    found, rows = [], 0
    for more in MORE_NODES:
        angle, weight = SINE.quadrature(basis.edges, basis.nodes_per_interval + more)
        rows += angle.size
        here = expansion(basis, vectors, angle)
        starts = range(0, angle.size, CHUNK_ROWS)
        parts = [
            images(law, lambda theta: expansion(basis, vectors, theta), angle[start : start + CHUNK_ROWS], basis)
            for start in starts
        ]
        rest = np.concatenate([image for image, _ in parts]) - here * values
        errors = np.concatenate([error for _, error in parts])
        found.append((weight @ (here * rest), weight @ (rest * rest)))
    (first, first_square), (second, second_square) = found
    norms = np.sqrt(np.maximum(first_square, second_square) + np.abs(first_square - second_square))
    # an error e of the images adds at most ||e|| to either, for the trial functions are unit vectors
    doubt = float(np.sqrt(weight @ errors**2))
    return Residuals(values + second, np.abs(second - first) + doubt, norms + doubt, rows)


def _first_panels(basis: Basis) -> tuple[Floats, Floats]:
    edges = np.unique(np.concatenate((basis.edges, GRAZING_EDGES, np.pi - GRAZING_EDGES)))
    return edges[:-1], edges[1:]


class _TrialFunctions:
    """Trial functions and what the law makes of them."""

    def __init__(self, law: Law, basis: Basis, vectors: Floats, row_tolerance: float) -> None:
        self.basis, self.vectors, self.law = basis, vectors, law
        self.row_tolerance = row_tolerance or ROW_TOLERANCE
        self.rows = function_rows(law, basis, vectors) if isinstance(basis, Panels) else None

    def __call__(self, theta: Floats) -> Floats:
        """Their values, shape (angles, k)."""
        return expansion(self.basis, self.vectors, theta)

    def images(self, theta: Floats) -> tuple[Floats, Floats]:
        """The values of P v, shape (angles, k), and their errors."""
        if self.rows is not None:
            found, errors = self.rows(theta, self.row_tolerance)
            return found, np.nan_to_num(errors)
        chunks = [theta[start : start + CHUNK_ROWS] for start in range(0, theta.size, CHUNK_ROWS)]
        parts = [images(self.law, self, chunk, self.basis) for chunk in chunks]
        return np.concatenate([found for found, _ in parts]), np.concatenate([errors for _, errors in parts])


def _integrals(
    function: _TrialFunctions, values: Floats, low: Floats, high: Floats, copies: float
) -> tuple[Floats, Floats, Floats]:
    """Integrals of v (P v - rho v) and of its square over each panel, with the differences of the two rules and what
    the errors of the rows do.

    An error e of a row adds e v to the first and 2 e (P v - rho v) + e^2 to the second.
    """
    half = 0.5 * (high - low)
    angle = (0.5 * (low + high))[:, None] + half[:, None] * NODES
    flat = angle.ravel()
    image, row_error = function.images(flat)
    here = function(flat)
    rest, doubt = image - here * values, row_error[:, None]
    shape = (*angle.shape, len(values))
    parts = np.stack([(here * rest).reshape(shape), (rest * rest).reshape(shape)], axis=2)
    doubts = np.stack([(np.abs(here) * doubt).reshape(shape), ((2.0 * np.abs(rest) + doubt) * doubt).reshape(shape)], 2)
    density = copies * half[:, None] * SINE.density(angle)
    return (
        np.einsum("pq,pqjk->pjk", density * KRONROD, parts),
        np.abs(np.einsum("pq,pqjk->pjk", density * (KRONROD - GAUSS), parts)),
        np.einsum("pq,pqjk->pjk", density * KRONROD, doubts),
    )


def images(law: Law, function: AngleFunction, theta: Floats, basis: Basis) -> tuple[Floats, Floats]:
    """P f at the angles theta for functions f of the basis, and estimated errors of the worst, shape (angles,).

    Rows of a density are cut at the edges of the basis and as fine as its functions need; the error is the difference
    of two Gauss rules.
    """
    if isinstance(law, Combination):
        terms = [(weight, images(term, function, theta, basis)) for weight, term in law.terms_checked()]
        values, errors = (sum(weight * one[place] for weight, one in terms) for place in (0, 1))
        return np.asarray(values), np.asarray(errors)
    if not isinstance(law, DensityLaw):
        return law.apply(function, theta), np.zeros(theta.size)
    edges = law.panels(theta)
    if isinstance(basis, Legendre):
        # a panel's Gauss rule follows polynomials in cos(theta) of a degree below its nodes over its width
        edges = split_rows(edges, 1 + int(np.pi * basis.size / (NODES_PER_DEGREE * GAUSS_NODES)))
    else:
        inner = np.broadcast_to(basis.edges, (theta.size, basis.edges.size))
        edges = np.sort(np.concatenate([edges, inner], axis=1), axis=1)
    finer, coarser = (
        _means(law, function, theta, edges, nodes) for nodes in (GAUSS_NODES + MORE_NODES[1], GAUSS_NODES)
    )
    return finer, np.asarray(np.abs(finer - coarser).reshape(theta.size, -1).max(axis=1, initial=0.0))


def _means(law: DensityLaw, function: AngleFunction, theta: Floats, edges: Floats, nodes: int) -> Floats:
    outgoing, weight = gauss_on_intervals(edges[:, :-1].ravel(), edges[:, 1:].ravel(), nodes)
    outgoing, weight = outgoing.reshape(theta.size, -1), weight.reshape(theta.size, -1)
    weight = weight * law.density(theta[:, None], outgoing)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("ij,ij...->i...", weight, function(outgoing)))


def expansion(basis: Basis, vectors: Floats, theta: Floats) -> Floats:
    """Values of the functions with the coefficients ``vectors``, shape ``theta.shape + (k,)``."""
    if not isinstance(basis, Panels):
        return np.asarray(basis.evaluate(theta) @ vectors)
    panel, values = basis.local(theta)
    coefficients = vectors.reshape(-1, basis.degree + 1, vectors.shape[1])
    return np.asarray(np.einsum("...d,...dk->...k", values, coefficients[panel]))
