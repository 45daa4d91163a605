"""Matrices of laws made of isometries, by quadrature between breakpoints or from their table: exact to rounding."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from ...core.rounding import EPS
from ..bases.angles import between_cuts, cell_among, clipped_inside, edges_inside
from ..bases.assembly import add_masses, add_products, largest_square_sum
from ..bases.basis import Basis
from ..bases.measure import gauss_on_intervals
from ..bases.partitions import Panels
from ..laws.isometry_table import IsometryTable
from ..laws.law import Law
from ..laws.structure import Rules, fold
from ..laws.sums import preimages
from ..matrices.matrix import KernelMatrix
from ..walls.rectangular import crevice_nodes, crevice_pieces, first_crossing
from .method import Budget, computed, rounding

# A probability linear in cot(theta), times sin(theta), is a combination of sin and cos. A Gauss rule with m nodes has
# an error of about (width/2)^(2m)/(2m)! for it. Probabilities of compositions are products of such terms, smooth on the
# scale of the distance to grazing. Pieces narrower than NARROW on both scales get 6 nodes: an error of 0.05^12 / 12!.
NARROW, NODES_NARROW, NODES_WIDE = 0.1, 6, 20
# Breakpoints that accumulate at grazing are listed until the omitted fraction is negligible or their use would take
# more than about a second.
FEWEST_BREAKPOINTS, BREAKPOINT_WORK, FUNCTION_WORK = 2**10, 2**20, 2**21
# Angles at which branches are counted.
PROBES = np.linspace(0.1, 3.0, 30)
# Number of branches that are computed before those of a chain merge.
BRANCHES_COMPUTED = Rules(
    lambda law: law.branches(PROBES)[0].shape[-1], lambda terms: sum(n for _, n in terms), math.prod, lambda n: n
)


def by_branches(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law that lists its isometries, by Gauss rules between their breakpoints."""
    symmetric, error = branch_matrix(law, basis, budget.tolerance)
    how = "Gauss rules between the breakpoints of isometries: rounding and omitted breakpoints"
    return bounded(symmetric, basis, error, how)


def branch_matrix(law: Law, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> for a law of isometries, and a bound on its Frobenius error.

    The interval (0, pi) is cut at the breakpoints of the law, the edges of the basis and the angles that a branch maps
    to edges. On each piece every integrand is smooth. Let m be the measure of angles near grazing whose breakpoints the
    law leaves out. There, both the integral and its approximation are integrals of e(theta) e(theta')^T over a measure
    of mass m, so they differ by at most 2 m sup |e|^2, with |e|^2 the sum of squares of the basis functions.
    """
    worst = 2.0 * largest_square_sum(basis)
    limit = FEWEST_BREAKPOINTS
    breakpoints, omitted = law.breakpoints(limit)
    branches = law.branches(PROBES)[0].shape[-1]
    most = BREAKPOINT_WORK // fold(law, BRANCHES_COMPUTED) ** 2
    if not basis.is_partition:
        most = min(most, FUNCTION_WORK // basis.size)
    while omitted * worst > tolerance and 2 * limit <= most:
        limit *= 2
        breakpoints, omitted = law.breakpoints(limit)
    edges = np.unique(np.concatenate((basis.edges, breakpoints)))
    sources = preimages(law.branches, np.concatenate(([0.0], breakpoints, [np.pi])), basis.edges)
    assert sources is not None  # `branches` raises an InputError instead
    edges = np.unique(np.concatenate((edges, sources)))
    total, displacement = np.zeros((basis.size, basis.size)), Displacement(basis)
    width, near = np.diff(edges), np.minimum(edges[1:], np.pi - edges[:-1])
    narrow = (width < NARROW) & (width < NARROW * near)
    order, order_narrow = NODES_WIDE, NODES_NARROW
    if not basis.is_partition:
        # On such short pieces the functions of the basis are as smooth as the probabilities.
        order = max(order, basis.nodes_per_interval)
        tame = width * basis.nodes_per_interval < np.diff(basis.edges).min()
        narrow, order_narrow = narrow & tame, NODES_NARROW + 2
    for chosen, nodes in ((narrow, order_narrow), (~narrow, order)):
        step = NUMBERS_AT_ONCE // (nodes * branches)
        _add_pieces(law, basis, edges[:-1][chosen], edges[1:][chosen], nodes, total, step)
    for middle in np.array_split(0.5 * (edges[1:] + edges[:-1]), 1 + edges.size * branches // NUMBERS_AT_ONCE):
        _add_cuts(law, basis, middle, displacement)
    return total, omitted * worst + rounding(basis) + displacement.bound()


def _add_cuts(law: Law, basis: Basis, middle: Floats, displacement: Displacement) -> None:
    probability, outgoing = law.branches(middle)
    for slot in range(outgoing.shape[-1]):
        displacement.add(middle, outgoing[:, slot], np.sin(middle) * probability[:, slot])


def _add_pieces(law: Law, basis: Basis, low: Floats, high: Floats, order: int, total: Floats, pieces: int) -> None:
    # Large steps, because every step adds whole matrices.
    for part in slices(low.size, max(pieces, 1)):
        angle, weight = gauss_on_intervals(low[part], high[part], order)
        mass = weight * basis.measure.density(angle)
        probability, outgoing = law.branches(angle)
        for slot in range(outgoing.shape[-1]):
            used = probability[:, slot] > 0.0
            add_products(total, basis, angle[used], outgoing[used, slot], (mass * probability[:, slot])[used])


# On a piece of width w, products of two basis functions and a sinusoid vary like exp(n w), with the stiffness n of
# `_nodes`. The error of a Gauss rule with m nodes, relative to the measure of the piece, is (n w / 2)^(2m) / (2m)!. It
# is 3e-15 or less for these pairs (n w, m); beyond, m = n w / 2 + MORE_NODES resolves the oscillation.
SHORT = ((1e-3, 2), (0.02, 3), (0.2, 5), (1.0, 8), (4.0, 14))
MORE_NODES = 18
# Shorter pieces get the number of nodes that a sinusoid needs on this width.
FEW = 0.1


def by_isometry_table(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law that has a table of isometries, by masses and Gauss rules on every piece of the table."""
    table = cast(IsometryTable, law.isometry_table())
    symmetric, error = table_matrix(table, basis)
    how = "masses and Gauss rules on every piece of the table of isometries, to rounding"
    found = bounded(symmetric, basis, error, how + (", plus unresolved beams" if table.unresolved else ""))
    return replace(found, unresolved=table.unresolved)


def bounded(symmetric: Floats, basis: Basis, error: float, how: str) -> KernelMatrix:
    """The exact matrix with the error bound ``error``."""
    # The distance of two matrices is at most the sum of their norms.
    furthest = float(np.linalg.norm(symmetric)) + float(np.sqrt(basis.size))
    return computed(symmetric, basis, "exact", min(error, furthest), how, "bound")


def table_matrix(table: IsometryTable, basis: Basis) -> tuple[Floats, float]:
    """<e_i, P e_j> of a table, and a bound on its Frobenius error.

    Every piece is cut at the edges and at the angles that it maps to edges. For partitions the mass between two cuts is
    elementary; for other bases Gauss rules integrate between the cuts. If a measure m of unresolved rays is
    retroreflected by convention, the matrix has an error of at most 2 m sup |e|^2, as in `branch_matrix`.
    """
    total, displacement = np.zeros((basis.size, basis.size)), Displacement(basis, table.offset_error)
    _add_table(table, basis, total, displacement)
    if basis.is_polynomial:
        # Polynomials are smooth, so only the ends of pieces are cuts.
        for end, density in ((table.low, table.start), (table.high, table.end)):
            displacement.add(end, table.images(end), 0.5 * density)
    moved = 2.0 * table.unresolved
    begin = first_crossing(basis)
    for crevice in table.crevices:
        listed = crevice_pieces(crevice.height_to_width, begin).scaled(crevice.fraction)
        _add_table(listed.in_specular_frame() if crevice.exchanged else listed, basis, total, displacement)
        theta, specular, retro, omitted = crevice_nodes(crevice.height_to_width, basis)
        moved += 4.0 * crevice.fraction * omitted
        if crevice.exchanged:
            specular, retro = retro, specular
        mirror = clipped_inside(np.pi - theta)
        incoming = np.concatenate([theta, theta, mirror, mirror])
        outgoing = np.concatenate([mirror, theta, theta, mirror])
        weight = crevice.fraction * np.concatenate([specular, retro, specular, retro])
        add_products(total, basis, incoming, outgoing, weight)
    if table.crevices:
        # The probabilities of a crevice are continuous, so that only the images of the basis's edges are cuts.
        add_mirrored_edges(basis, displacement)
    error = rounding(basis) + displacement.bound()
    if table.offset_error:
        # the images of nodes are displaced
        error += table.offset_error * basis.derivative_norm()
    return total, error + (moved * largest_square_sum(basis) if moved else 0.0)


def _add_table(table: IsometryTable, basis: Basis, total: Floats, displacement: Displacement) -> None:
    # Pieces of a table are cut into about as many parts as the basis has cells on them.
    step = max(NUMBERS_AT_ONCE // (2 * basis.edges.size), 1)
    for begin in range(0, table.low.size, step):
        piece, low, high = _cut(table, basis, np.arange(begin, min(begin + step, table.low.size)))
        middle = 0.5 * (low + high)
        density, image = table.density(middle, piece), table.images(middle, piece)
        if not basis.is_polynomial:
            displacement.add(middle, image, density)
        if basis.is_partition:
            # The integral of a sinusoid is its value in the middle times 2 sin(width/2).
            source, target = cell_among(basis.edges, middle), cell_among(basis.edges, image)
            add_masses(total, basis, source, target, density * np.sin(0.5 * (high - low)))
        else:
            _add_nodes(table, basis, piece, low, high, total)


def add_mirrored_edges(basis: Basis, displacement: Displacement) -> None:
    """Add the cuts of a mirror, whose images of the basis's edges are rounded; polynomials have no edges."""
    if basis.is_polynomial:
        return
    mirror = IsometryTable.flat(1.0)
    piece, low, high = _cut(mirror, basis, np.arange(mirror.low.size))
    middle = 0.5 * (low + high)
    displacement.add(middle, mirror.images(middle, piece), np.sin(middle))


def _cut(table: IsometryTable, basis: Basis, piece: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats, Floats]:
    """The parts of the pieces between the edges of the basis and the angles that they map to edges."""
    edges = basis.edges[1:-1]
    low, high = table.low[piece], table.high[piece]
    owner, cut = [piece, piece], [low, high]
    bounds = [(low, high, np.ones(piece.size), np.zeros(piece.size))]
    if not basis.is_polynomial:
        # Polynomials are smooth, so their images need no cuts.
        sign, offset = table.sign[piece], table.offset[piece]
        ends = sign * low + offset, sign * high + offset
        bounds.append((np.minimum(*ends), np.maximum(*ends), sign, offset))
    for left, right, sign, offset in bounds:
        owned, edge = edges_inside(edges, left, right)
        at = sign[owned] * (edge - offset[owned])
        owner.append(piece[owned])
        cut.append(np.clip(at, low[owned], high[owned]))
    return between_cuts(np.concatenate(owner), np.concatenate(cut))


def _add_nodes(
    table: IsometryTable, basis: Basis, piece: NDArray[np.int64], low: Floats, high: Floats, total: Floats
) -> None:
    number = _nodes(basis, high - low)
    for nodes in np.unique(number):
        chosen = np.nonzero(number == nodes)[0]
        step = max(NUMBERS_AT_ONCE // int(nodes), 1)
        for part in (chosen[some] for some in slices(chosen.size, step)):
            angle, weight = gauss_on_intervals(low[part], high[part], int(nodes))
            owner = np.repeat(piece[part], nodes)
            image = table.images(angle, owner)
            add_products(total, basis, angle, image, 0.5 * weight * table.density(angle, owner))


def _nodes(basis: Basis, width: Floats) -> NDArray[np.int64]:
    """Number of Gauss nodes for pieces of the given widths."""
    if basis.is_polynomial:
        return _nodes_for((basis.size + 1) * width)
    if isinstance(basis, Panels):
        # By Markov's inequality a polynomial of degree d on a panel of width W grows at most by exp(2 d^2 w / W). On
        # longer pieces the polynomial, of degree 2 p, adds p nodes to those of the sinusoid.
        stiffness = 2.0 * (2.0 * basis.degree) ** 2 / float(np.diff(basis.edges).min()) + 1.0
        short = stiffness * width <= SHORT[-1][0]
        return np.where(short, _nodes_for(stiffness * width), _nodes_for(np.maximum(width, FEW)) + basis.degree)
    return np.full(width.shape, basis.nodes_per_interval)


def _nodes_for(reach: Floats) -> NDArray[np.int64]:
    # Multiples of 8, because every different number of nodes costs a call.
    number = 8 * np.ceil((0.5 * reach + MORE_NODES) / 8.0).astype(np.int64)
    for limit, nodes in reversed(SHORT):
        number = np.where(reach <= limit, nodes, number)
    return np.asarray(number, dtype=np.int64)


# Bound of the rounding error of an angle at which an integral is cut: edges, offsets of isometries and the angles that
# these map to edges are sums of a few numbers below pi.
CUT = np.pi * EPS


class Displacement:
    r"""A bound of the change of a matrix <e_i, P e_j> by the rounding of the angles at which its integrals are cut.

    A cut that is displaced by h moves the mass h sin(theta)/2 p(theta) from one product e_i(theta) e_j(theta') to
    another. The changes of a row's interval are added; those of different intervals are orthogonal, so their squares
    are added. ``offset_error`` bounds the displacement by other causes than rounding.
    """

    def __init__(self, basis: Basis, offset_error: float = 0.0) -> None:
        self._basis, self._cut = basis, CUT + offset_error
        self._largest, self._weighted = basis.magnitudes()
        self._rows = np.zeros(self._largest.size)

    def add(self, incoming: Floats, outgoing: Floats, density: Floats) -> None:
        """Add pieces between two cuts: an angle inside each, its image, and p sin(theta)."""
        source, target = cell_among(self._basis.edges, incoming), cell_among(self._basis.edges, outgoing)
        change = self._cut * density * self._size(source, incoming) * self._size(target, outgoing)
        self._rows += np.bincount(source, weights=change, minlength=self._rows.size)

    def bound(self) -> float:
        """The bound, in the Frobenius norm."""
        return float(np.linalg.norm(self._rows))

    def _size(self, cell: NDArray[np.intp], angle: Floats) -> Floats:
        """A bound of the root of the sum of e_i^2 at the angles."""
        if self._basis.is_partition:
            return np.asarray(self._largest[cell])
        with np.errstate(divide="ignore"):
            return np.asarray(np.minimum(self._largest[cell], self._weighted[cell] / np.sqrt(np.abs(np.sin(angle)))))
