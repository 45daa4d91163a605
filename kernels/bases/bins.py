"""Piecewise constant functions of the angle, the basis of histograms and of Ulam's method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, check_memory, frozen, whole_number
from .basis import Basis, checked_edges
from .measure import SINE, AngularMeasure, WeightName, measure_by_name

# Numbers of Gauss nodes that integrate a smooth function times the weight to rounding on cells of width up to NARROW
# and up to pi. The error is about (width / 4)^(2 nodes) / (2 nodes)!, below 1e-17 in both cases.
NODES_NARROW, NODES_WIDE, NARROW = 8, 20, 1.0


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Bins(Basis):
    r"""Normalised indicators of the bins between increasing angles from 0 to pi.

    Parameters
    ----------
    divisions : int or array_like
        The number of bins, which then have equal measure; or the edges, increasing from 0 to pi, in radians.
    weight : {"sin", "sin2"}
        The measure: ``"sin"`` for theta and sin(theta) d theta, ``"sin2"`` for psi and sin(psi)^2 d psi.

    Raises
    ------
    InputError
        If the number is not a whole number of at least 1, or the edges do not increase from 0 to pi.

    Notes
    -----
    For ``"sin"``, bins of equal measure have equal width in u = -cos(theta) (Rudzis 2022, section 1.2.2). For smooth
    kernels the eigenvalues of the Galerkin matrix on n such bins converge with order 2.

    Examples
    --------
    >>> bins = Bins(4)
    >>> bins.weights.round(14).tolist(), bins.index([0.1, 1.0, 1.6, 3.0]).tolist()
    ([0.25, 0.25, 0.25, 0.25], [0, 0, 2, 3])
    """

    order: ClassVar[int] = 2

    _edges: Floats
    _weights: Floats
    _measure: AngularMeasure
    _equal: bool

    def __init__(self, divisions: int | ArrayLike, weight: WeightName = "sin") -> None:
        measure = measure_by_name(weight)
        equal = not np.iterable(divisions)
        if equal:
            check_memory("bins", "the edges", whole_number("bins", divisions, 1))
        edges = _equal_edges(whole_number("bins", divisions, 1), measure) if equal else checked_edges(divisions)
        object.__setattr__(self, "_edges", frozen(edges))
        object.__setattr__(self, "_weights", frozen(measure.mass(edges[:-1], edges[1:])))
        object.__setattr__(self, "_measure", measure)
        object.__setattr__(self, "_equal", equal)

    @property
    def is_partition(self) -> bool:
        return True

    @property
    def measure(self) -> AngularMeasure:
        return self._measure

    @property
    def size(self) -> int:
        return self._weights.size

    @property
    def edges(self) -> Floats:
        return self._edges

    @property
    def weights(self) -> Floats:
        """Measures of the bins under the probability measure, shape (n,)."""
        return self._weights

    @property
    def normalisation(self) -> Floats:
        return np.asarray(1.0 / np.sqrt(self._weights))

    @property
    def nodes_per_interval(self) -> int:
        return NODES_NARROW if np.diff(self._edges).max() <= NARROW else NODES_WIDE

    @property
    def constant(self) -> Floats:
        return np.asarray(np.sqrt(self._weights))

    def key(self) -> tuple[object, ...]:
        return (self._measure.name, self._edges.tobytes())

    def evaluate(self, angle: ArrayLike) -> Floats:
        index = self.index(angle)
        values = np.zeros((*index.shape, self.size))
        np.put_along_axis(values, index[..., None], self.normalisation[index][..., None], axis=-1)
        return values

    def magnitudes(self) -> tuple[Floats, Floats]:
        return self.normalisation, np.full(self.size, np.inf)

    def derivative_norm(self) -> float:
        return 0.0

    def coarsened(self) -> tuple[Bins, Floats] | None:
        if self.size < 2:
            return None
        coarse, owner, entries = self.joined()
        restriction = np.zeros((coarse.size, self.size))
        restriction[owner, np.arange(self.size)] = entries
        return coarse, restriction

    def joined(self) -> tuple[Bins, NDArray[np.intp], Floats]:
        """`coarsened` of two bins or more without zeros: the row of the only entry of every column, and this entry."""
        if self._equal and self.size % 2 == 0:
            coarse = Bins(self.size // 2, self._measure.name)
        else:
            coarse = Bins(np.concatenate(([0.0], self._edges[2:-1:2], [np.pi])), self._measure.name)
        owner = np.minimum(np.arange(self.size) // 2, coarse.size - 1)
        return coarse, owner, np.sqrt(self._weights / coarse.weights[owner])

    def __repr__(self) -> str:
        weight = "" if self._measure == SINE else f", weight={self._measure.name!r}"
        return f"Bins({self.size}{weight})" if self._equal else f"Bins(<{self.size + 1} edges>{weight})"


def _equal_edges(n: int, measure: AngularMeasure) -> Floats:
    # The upper edges are computed from the lower ones by pi - x, so that J permutes the bins exactly.
    lower = measure.quantile(np.arange(n // 2 + 1) / n)
    if n % 2 == 0:
        lower[-1] = 0.5 * np.pi
    return np.concatenate((lower, np.pi - lower[: (n + 1) // 2][::-1]))
