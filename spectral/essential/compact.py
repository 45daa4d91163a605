"""Laws that are integral operators plus isometries: Hilbert-Schmidt norm, and a matrix on panels with the norm of what
it leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np
from numpy.polynomial.legendre import legvander

from ...core.checks import Floats, instance, positive_number
from ...core.estimates import ErrorKind, Estimate
from ...core.long_runs import count_time
from ...core.rounding import EPS
from ...kernels import DensityLaw, KernelMatrix, Law, Legendre, Panels, discretise
from ...kernels.bases.measure import SINE, gauss_on_intervals
from ...kernels.laws.density import VALUE_TIME
from ...kernels.laws.law import IsometryLaw
from ...kernels.laws.matrix_law import contains_reflection, with_beyond
from ...kernels.laws.structure import Rules, fold, holds_of_all
from ...kernels.matrices.matrix import frobenius_error
from ..eigenvalues.dense import symmetric_half
from .edge import essential_edge

# Degree on a panel; Gauss nodes by which densities are projected on it, and others at which they are compared with
# their projections.
DEGREE, KNOWN, SEEN = 13, 16, 17
# Two more points for the comparison, at this distance from the ends of a panel: a jump may lie between an end and the
# first node. Breakpoints and their mirror images have a rounding of a tenth of it.
AT_END = 1e-14
# First panels, and limits on their number and on the halvings of one.
FIRST_PANELS, MOST_PANELS, MOST_HALVINGS = 16, 128, 36
# Wanted norm of what the matrix leaves out.
GOAL = 1e-10
# Factor of the squares at the nodes: a jump may lie anywhere between two of them.
MARGIN = 2.0


@lru_cache(maxsize=8)
def compact_matrix(law: Law) -> KernelMatrix | None:
    r"""The matrix on panels of sums and products of densities and isometries, with an error that bounds eigenvalues.

    None for other laws.

    Notes
    -----
    Let M be the matrix of a density, and e the Hilbert-Schmidt norm of its kernel p(theta, theta') / nu(theta') less
    that of M, from values of the difference; a difference of the squares of two norms would lose half of the digits.
    Reversible laws have the norm 1, so the errors of their products add up. By Weyl's inequality every eigenvalue is
    within the sum e of one of the matrix or of those beyond the panels (``KernelMatrix.beyond``), whatever the kinks.
    """
    leaves: list[Law] = []

    def collected(leaf: Law) -> bool:
        leaves.append(leaf)
        return True

    holds_of_all(law, collected)
    densities = [leaf for leaf in dict.fromkeys(leaves) if isinstance(leaf, DensityLaw)]
    if not densities or not all(isinstance(leaf, (DensityLaw, IsometryLaw)) for leaf in leaves):
        return None
    mirrored = bool(law.mirror_symmetric) or contains_reflection(law)
    basis = Panels(_edges(densities, mirrored), DEGREE)
    found: dict[Law, tuple[Floats, float]] = {leaf: _projected(leaf, basis) for leaf in densities}
    # the error and the norm of each part
    rules: Rules[tuple[float, float]] = Rules(
        lambda leaf: (found[leaf][1], 1.0 if leaf.reversible else float(np.linalg.norm(found[leaf][0])))
        if isinstance(leaf, DensityLaw) else (0.0, 1.0),
        lambda terms: (sum(w * e for w, (e, _) in terms), sum(w * n for w, (_, n) in terms)),
        lambda parts: reduce(lambda a, b: (a[0] * b[1] + a[1] * b[0] + a[0] * b[0], a[1] * b[1]), parts, (0.0, 1.0)),
        lambda part: part,
    )  # fmt: skip
    # of a polynomial on a panel the mirror image is one on the mirrored panel
    signs = np.diag((-1.0) ** np.arange(DEGREE + 1))
    reflection = np.asarray(np.kron(np.eye(basis.size // (DEGREE + 1))[::-1], signs), dtype=np.float64)
    whole = with_beyond(law, reflection, lambda leaf: found[leaf][0])
    matrix = whole[:-2, :-2]
    lopsided = float(np.linalg.norm(matrix - reflection @ matrix @ reflection)) if law.mirror_symmetric else 0.0
    error = fold(law, rules)[0] + lopsided + basis.size * EPS
    how = f"Hilbert-Schmidt norm of what {basis.size} functions leave out, at points between"
    return KernelMatrix(
        matrix, basis, frobenius_error(error, "estimate", how), method="quadrature", law=repr(law),
        reversible=law.reversible, mirror_symmetric=law.mirror_symmetric, frame=law.frame,
        beyond=(whole[-2, -2], whole[-1, -1]),
    )  # fmt: skip


def _edges(densities: list[DensityLaw], mirrored: bool) -> Floats:
    """Edges between which polynomials are near the densities at some incoming angles, as far as MOST_PANELS allow."""
    marks = [density.outgoing_breakpoints for density in densities]
    edges = _joined(mirrored, np.linspace(0.0, np.pi, FIRST_PANELS + 1), *marks)
    finest = min(density.resolution for density in densities)
    low, high = edges[:-1], edges[1:]
    for _ in range(MOST_HALVINGS):
        parts = int(np.ceil(np.max(high - low) / finest))
        rest = np.sum([_misfit(density, low, high, parts) for density in densities], axis=0)
        worst = np.argsort(-rest)[: max(MOST_PANELS + 1 - edges.size, 0) // (1 + mirrored)]
        worst = worst[rest[worst] > GOAL**2 / MOST_PANELS]
        if not worst.size:
            break
        middle = 0.5 * (low + high)[worst]
        edges = _joined(mirrored, edges, middle)
        low, high = np.append(low[worst], middle), np.append(middle, high[worst])
    return edges


def _misfit(density: DensityLaw, low: Floats, high: Floats, parts: int) -> Floats:
    """The squared distances of a density from polynomials on each panel, at nodes in so many parts of the panel."""
    cut = np.linspace(0.0, 1.0, parts + 1)
    position, weight = gauss_on_intervals(cut[:-1], cut[1:], SEEN)
    polynomials = legvander(2.0 * position - 1.0, DEGREE)
    projection = polynomials @ ((2.0 * np.arange(DEGREE + 1) + 1.0)[:, None] * (weight[:, None] * polynomials).T)
    angle = low[:, None] + (high - low)[:, None] * position
    value = _kernel(density, density.probes[:, None, None], angle)
    mass = (high - low)[:, None] * weight * SINE.density(angle)
    return np.asarray((mass * (value - value @ projection.T) ** 2).sum(axis=2).mean(axis=0))


def _projected(density: DensityLaw, basis: Panels) -> tuple[Floats, float]:
    """The matrix of a density, and the Hilbert-Schmidt norm of what it leaves out."""
    low, high = basis.edges[:-1, None], basis.edges[1:, None]

    def at(position: Floats, weight: Floats) -> tuple[Floats, Floats, Floats]:
        """Values of the density, masses of the angles, and values of the functions of each panel."""
        angle = np.clip(low + (high - low) * position, low + AT_END, high - AT_END)
        mass = ((high - low) * weight * SINE.density(angle)).ravel()
        return _kernel(density, angle.reshape(-1, 1), angle.ravel()), mass, basis.local(angle)[1]

    unit = np.zeros(1), np.ones(1)
    value, mass, functions = at(*gauss_on_intervals(*unit, KNOWN))
    transposed = functions.transpose(0, 2, 1)
    matrix = _blocks(transposed, _blocks(transposed, mass[:, None] * value * mass).T)
    matrix = symmetric_half(matrix) if density.reversible else matrix
    position, weight = gauss_on_intervals(*unit, SEEN)
    ends = np.array([0.0, 1.0]), np.full(2, position[0])
    value, mass, functions = at(np.append(position, ends[0]), np.append(weight, ends[1]))
    rest = value - _blocks(functions, _blocks(functions, matrix).T)
    return matrix, float(np.sqrt(MARGIN * (mass @ (rest * rest) @ mass)))


def _blocks(blocks: Floats, array: Floats) -> Floats:
    """The product of a matrix of diagonal blocks, shape (blocks, rows, columns), and an array."""
    return np.asarray((blocks @ array.reshape(len(blocks), blocks.shape[2], -1)).reshape(-1, array.shape[1]))


def _kernel(density: DensityLaw, theta: Floats, outgoing: Floats) -> Floats:
    """The density with respect to the invariant measure."""
    count_time(VALUE_TIME * theta.size * outgoing.size)
    return np.asarray(density.density(theta, outgoing) / SINE.density(outgoing))


def _joined(mirrored: bool, *edges: Floats) -> Floats:
    """The edges in order, if ``mirrored`` with their mirror images and pi/2."""
    joint = np.concatenate(edges)
    if not mirrored:
        joint = np.sort(joint)
        return np.asarray(joint[np.append(np.diff(joint) > 4.0 * AT_END, True)])
    lower = np.unique(np.minimum(joint, np.pi - joint))
    lower = lower[np.diff(lower, append=0.5 * np.pi) > 4.0 * AT_END]
    return np.concatenate((lower, [0.5 * np.pi], np.pi - lower[::-1]))


# Size of the polynomial basis in which a lower bound of the norm is taken.
SIZE = 16
# Ends of the essential spectrum below this are taken as 0 for laws with a density.
UNSEEN = 1e-3
# Largest error of a norm, as a fraction of it; a larger one shows that the kernel may not be square-integrable.
LARGEST_ERROR = 0.1


@dataclass(frozen=True, repr=False)
class HilbertSchmidtNorm(Estimate):
    r"""The Hilbert-Schmidt norm of a law in L^2(sin theta d theta): of a reversible law (sum_l lambda_l^2)^(1/2).

    The value is inf, with error 0, for a law that is not compact. An infinite error means that the norm is not known;
    then the value is a lower bound.

    Attributes
    ----------
    compact : bool or None
        Whether the law is a compact operator, so that its spectrum consists of eigenvalues that tend to 0; None if it
        is not known.
    reasons : tuple of str
        Sentences that say why.
    """

    compact: bool | None
    reasons: tuple[str, ...]


def hilbert_schmidt_norm(law: Law, tolerance: float = 1e-6) -> HilbertSchmidtNorm:
    r"""Compute the norm (int int k^2 nu nu)^(1/2) of a law with kernel k, or state why there is none.

    Parameters
    ----------
    law : Law
    tolerance : float
        Wanted error of the norm.

    Returns
    -------
    HilbertSchmidtNorm

    Raises
    ------
    InputError
        If an argument is not as described.

    Notes
    -----
    A law that contains an isometry theta' = +-theta + c with positive probability, on a set of positive measure, is not
    compact: let f_n be the indicator functions of sets that shrink to a point, divided by their norms. They tend weakly
    to 0, but the norms of P f_n do not, because all parts of P f_n are non-negative. This holds for flat tops, for
    straight pieces that rays can meet alone, and for every polygonal wall. A deterministic law preserves norms. Grazing
    rays are the second obstacle, see `essential_edge`. The norm of a density is that of a matrix, within the
    distance of both. For curved walls, whose kernels can have singularities that are not square-integrable, the
    norm of the largest matrix is given as a lower bound.

    Source: Rudzis 2022, section 1.2.6 (R. Feres and H.-K. Zhang, Commun. Math. Phys. 313, 2012).

    Examples
    --------
    Henyey-Greenstein scattering has the eigenvalues g^l, so the norm is (1 - g^2)^(-1/2):

    >>> from asperity import geometry as geo, kernels as ker, spectral as spec
    >>> norm = spec.hilbert_schmidt_norm(ker.henyey_greenstein(0.6))
    >>> round(float(norm), 9), norm.compact
    (1.25, True)
    >>> spec.hilbert_schmidt_norm(ker.WallLaw(geo.rectangular_teeth(0.7))).value
    inf
    """
    instance("law", law, Law, "ker.lambertian()")
    wanted = positive_number("tolerance", tolerance)
    if _contains_involution(law):
        return _none("bound", ("a part of the law is deterministic, f -> f o T, and preserves norms",))
    edge = essential_edge(law)
    if edge.low > 0.0:
        found = f"the law is not compact: its essential spectrum reaches {edge.low:.6g}"
        return _none(edge.kind, (found, *edge.reasons))
    matrix = compact_matrix(law) if edge.high <= UNSEEN else None
    norm = 0.0 if matrix is None else float(np.linalg.norm(matrix.symmetric))
    if matrix is not None and float(matrix.error) <= LARGEST_ERROR * norm:
        reasons = ("the law has a density, and its distance from a matrix is known, so it is compact",)
        return HilbertSchmidtNorm(norm, float(matrix.error), "estimate", matrix.error.method, True, reasons)
    norm = float(np.linalg.norm(discretise(law, Legendre(SIZE), tolerance=0.1 * wanted).symmetric))
    reason = f"no theorem decides; polynomials of degree below {SIZE} give a lower bound"
    compact = True if edge.high == 0.0 and edge.kind == "bound" else None
    return HilbertSchmidtNorm(norm, math.inf, "estimate", "Galerkin matrix", compact, (*edge.reasons, reason))


def _none(kind: ErrorKind, reasons: tuple[str, ...]) -> HilbertSchmidtNorm:
    return HilbertSchmidtNorm(math.inf, 0.0, kind, "structure of the law", False, reasons)


def _contains_involution(law: Law) -> bool:
    """Whether a term of the law is an involution, or a product of involutions."""

    def of_any(terms: Sequence[tuple[float, bool]]) -> bool:
        return any(fact for _, fact in terms)

    return fold(law, Rules(lambda leaf: leaf.angle_map is not None, of_any, all, lambda fact: fact))
