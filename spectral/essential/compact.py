"""Laws that are integral operators plus isometries, as a matrix on panels with the norm of what it leaves out."""

from __future__ import annotations

from functools import lru_cache, reduce

import numpy as np
from numpy.polynomial.legendre import legvander

from ...core.checks import Floats
from ...core.long_runs import count_time
from ...core.rounding import EPS
from ...kernels import DensityLaw, KernelMatrix, Law, Panels
from ...kernels.bases.measure import SINE, gauss_on_intervals
from ...kernels.laws.density import VALUE_TIME
from ...kernels.laws.law import IsometryLaw
from ...kernels.laws.matrix_law import contains_reflection, with_beyond
from ...kernels.laws.structure import Rules, fold, holds_of_all
from ...kernels.matrices.matrix import frobenius_error
from ..eigenvalues.dense import symmetric_half

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
