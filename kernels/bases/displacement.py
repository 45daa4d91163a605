"""The rounding of angles: by how much it changes Galerkin matrices of laws of isometries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from .basis import Basis

# Bound of the rounding error of an angle at which an integral is cut: edges, offsets of isometries and the angles that
# these map to edges are sums of a few numbers below pi.
CUT = np.pi * EPS
# Bound of the root mean square of the rounding errors of a node and its image, two sums each: 1.2 eps near pi.
NODE = 2.0 * EPS


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

    def add(
        self,
        incoming: Floats,
        outgoing: Floats,
        density: Floats,
        source: NDArray[np.int64],
        target: NDArray[np.int64],
    ) -> None:
        """Add pieces between two cuts: an angle inside each, its image, p sin(theta), and the intervals of the two."""
        change = self._cut * density * self._size(source, incoming) * self._size(target, outgoing)
        self._rows += np.bincount(source, weights=change, minlength=self._rows.size)

    def bound(self) -> float:
        """The bound, in the Frobenius norm."""
        return float(np.linalg.norm(self._rows))

    def _size(self, cell: NDArray[np.int64], angle: Floats) -> Floats:
        """A bound of the root of the sum of e_i^2 at the angles."""
        if self._basis.is_partition:
            return np.asarray(self._largest[cell])
        with np.errstate(divide="ignore"):
            return np.asarray(np.minimum(self._largest[cell], self._weighted[cell] / np.sqrt(np.abs(np.sin(angle)))))


def node_rounding(basis: Basis) -> float:
    """A bound of the change of a Galerkin matrix by the rounding of its quadrature nodes, in the Frobenius norm."""
    return NODE * basis.derivative_norm()
