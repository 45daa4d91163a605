"""Matrices of chains of isometries and Henyey-Greenstein scatterings, to rounding.

A scattering is diagonal in Legendre polynomials: HG(g) = sum over l of |P_l> g^l <P_l|. It therefore cuts a chain into
pieces of isometries, whose integrals against polynomials are exact. The only error is the truncation of the sum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from ...core.rounding import EPS
from ..bases.assembly import one_blas_thread
from ..bases.basis import Basis
from ..bases.legendre import DEGREES_PER_PANEL, DIGITS, Legendre
from ..bases.measure import AngularMeasure
from ..bases.panels import Panels
from ..laws.law import Law
from ..laws.phase_function import HenyeyGreensteinLaw
from ..laws.structure import lists_branches
from ..matrices.matrix import KernelMatrix
from .method import Budget, MethodName, computed

# The sum over l ends where g^l is below this.
NEGLIGIBLE = 1e-17
# Polynomials of higher degree cost more than a fine basis. The limit corresponds to |g| up to 0.96.
HIGHEST_DEGREE = 1024
# Limit on the values of functions in memory at a time.
CHUNK = 2**21

# A function that returns the matrix of a chain of isometries in a basis, and a bound on its Frobenius error.
IsometricMatrix = Callable[[Sequence[Law], Basis], tuple[Floats, float]]


class Diagonal:
    """Henyey-Greenstein scattering in Legendre polynomials, in which its matrix is diagonal."""

    name: MethodName = "exact"

    def accepts(self, law: Law, basis: Basis) -> bool:
        return isinstance(law, HenyeyGreensteinLaw) and isinstance(basis, Legendre)

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        diagonal = np.diag(cast(HenyeyGreensteinLaw, law).g ** np.arange(float(basis.size)))
        how = "eigenvalues g^l of the polynomials of degree l, to rounding"
        return computed(diagonal, basis, self.name, EPS * basis.size**0.5, how, "bound")


class JointBasis(Basis):
    """The functions of a basis followed by the Legendre polynomials of degree below n; not an orthonormal family."""

    def __init__(self, basis: Basis, degrees: int) -> None:
        self.first, self.polynomials = basis, Legendre(degrees)
        # Intervals on which one Gauss rule resolves the polynomials.
        self._edges = split(basis.edges, DEGREES_PER_PANEL * np.pi / degrees)

    @property
    def measure(self) -> AngularMeasure:
        return self.first.measure

    @property
    def size(self) -> int:
        return self.first.size + self.polynomials.n

    @property
    def edges(self) -> Floats:
        return self._edges

    @property
    def nodes_per_interval(self) -> int:
        widest = float(np.diff(self._edges).max())
        return self.first.nodes_per_interval + int(np.ceil(0.5 * self.polynomials.n * widest)) + DIGITS

    @property
    def constant(self) -> Floats:
        unit = np.zeros(self.size)
        unit[self.first.size] = 1.0
        return unit

    def key(self) -> tuple[object, ...]:
        return (self.first, self.polynomials.n)

    def evaluate(self, angle: ArrayLike) -> Floats:
        return np.concatenate((self.first.evaluate(angle), self.polynomials.evaluate(angle)), axis=-1)

    def magnitudes(self) -> tuple[Floats, Floats]:
        middle = 0.5 * (self._edges[1:] + self._edges[:-1])
        local, smooth = self.first.magnitudes(), self.polynomials.magnitudes()
        cells = self.first.index(middle)
        largest, weighted = (np.hypot(mine[cells], other[0]) for mine, other in zip(local, smooth, strict=True))
        return largest, weighted

    def derivative_norm(self) -> float:
        return float(np.hypot(self.first.derivative_norm(), self.polynomials.derivative_norm()))

    def coarsened(self) -> None:
        return None

    @property
    def local_part(self) -> Basis:
        return self.first

    @property
    def polynomials_besides(self) -> int:
        return self.polynomials.n

    def add_products(self, total: Floats, incoming: Floats, outgoing: Floats, weight: Floats) -> bool:
        """The same sum as `asperity.kernels.bases.assembly.add_products`, with sparse values of the local functions."""
        size = self.first.size
        step = max(1, CHUNK // self.polynomials.n)
        for start in range(0, incoming.size, step):
            part = slice(start, start + step)
            source, target = local_values(self.first, incoming[part]), local_values(self.first, outgoing[part])
            before = self.polynomials.evaluate(incoming[part])
            after = weight[part, None] * self.polynomials.evaluate(outgoing[part])
            total[:size, size:] += source.T @ after
            total[size:, :size] += (target.T @ (weight[part, None] * before)).T
            total[:size, :size] += (source.T @ target.multiply(weight[part, None]).tocsr()).toarray()
            with one_blas_thread():
                total[size:, size:] += before.T @ after
        return True


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


def degrees_used(law: HenyeyGreensteinLaw) -> int:
    """The number of polynomials P_l with a factor g^l that is not negligible; 1 for g = 0."""
    return 1 if abs(law.g) <= NEGLIGIBLE else 1 + int(np.ceil(np.log(NEGLIGIBLE) / np.log(abs(law.g))))


def is_scattered(laws: Sequence[Law]) -> bool:
    """Whether a chain consists of isometries and at least one scattering, with |g| up to about 0.96."""
    scatterings = [law for law in laws if isinstance(law, HenyeyGreensteinLaw)]
    near = any(degrees_used(law) > HIGHEST_DEGREE for law in scatterings)
    others = [law for law in laws if not isinstance(law, HenyeyGreensteinLaw)]
    return bool(scatterings) and not near and all(map(lists_branches, others))


def scattered_matrix(laws: Sequence[Law], basis: Basis, isometric: IsometricMatrix) -> tuple[Floats, float]:
    """<e_i, P_1 P_2 ... e_j> for a chain of scatterings and isometries, and a bound on its Frobenius error.

    Matrices of Markov operators in orthonormal families have norms of at most 1, so the errors of the pieces add up.

    Parameters
    ----------
    laws : sequence of Law
        At least one scattering, and laws of isometries.
    basis : Basis
    isometric : callable
        Returns the matrix of a chain of isometries, which may be empty, and its error.
    """
    pieces: list[tuple[Law, ...]] = [()]
    scatterings: list[HenyeyGreensteinLaw] = []
    for law in laws:
        if isinstance(law, HenyeyGreensteinLaw):
            scatterings.append(law)
            pieces.append(())
        else:
            pieces[-1] = (*pieces[-1], law)
    needed = [degrees_used(law) for law in scatterings]
    size = basis.size
    if isinstance(basis, Legendre):
        # A scattering at an end of the chain acts on the polynomials of the basis only.
        for slot, piece in ((0, pieces[0]), (-1, pieces[-1])):
            needed[slot] = needed[slot] if piece else size
    degrees = min(max(needed), HIGHEST_DEGREE)
    joint: Basis
    if isinstance(basis, Legendre):
        joint, inner = Legendre(max(degrees, size)), slice(0, degrees)
    else:
        joint, inner = JointBasis(basis, degrees), slice(size, size + degrees)
    matrices = {piece: isometric(piece, joint) for piece in dict.fromkeys(pieces)}
    product = matrices[pieces[0]][0][:size, inner]
    truncated = 0.0
    for slot, (law, wanted) in enumerate(zip(scatterings, needed, strict=True), start=1):
        columns = inner if slot < len(scatterings) else slice(0, size)
        product = (product * law.g ** np.arange(degrees)) @ matrices[pieces[slot]][0][inner, columns]
        truncated += abs(law.g) ** degrees * np.sqrt(size) if degrees < wanted else 0.0
    return product, float(truncated + sum(matrices[piece][1] for piece in pieces))
