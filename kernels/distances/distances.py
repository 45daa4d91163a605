"""Distances between laws: Wasserstein, conditional or joint, and the paper's pseudometric."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ...core.checks import positive_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ..discretisation.discretisation import discretise
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from .joint import joint_law_distance, joint_matrix_distance
from .pseudometric import moment_distance
from .resampling import check_comparable, noise_floor
from .rowwise import law_distance, matrix_distance
from .transport import wasserstein_order

Kind = Literal["rows", "sup", "joint", "pseudometric"]


@dataclass(frozen=True)
class Distance(Estimate):
    """A distance between two laws, with its error.

    Attributes
    ----------
    noise_floor : float or None
        For empirical matrices: the mean distance that samples of this size show if both laws are the same. A distance
        near it says nothing; `difference_test` decides. For joint distances it is that of the rows, which is not
        smaller. None where nothing was counted.
    """

    noise_floor: float | None = None

    def __str__(self) -> str:
        floor = "" if self.noise_floor is None else f", noise floor {self.noise_floor:.2g}"
        return super().__str__() + floor


def distance(
    first: Law | KernelMatrix,
    second: Law | KernelMatrix,
    order: float = 1,
    kind: Kind = "rows",
    tolerance: float = 1e-4,
) -> Distance:
    r"""The distance of two laws, or of two kernel matrices.

    Parameters
    ----------
    first, second : Law or KernelMatrix
        Of a law and a matrix, the law is discretised on the bins of the matrix.
    order : float
        p of the Wasserstein distance W_p, a finite number of at least 1. Angles are measured in radians.
    kind : {"rows", "sup", "joint", "pseudometric"}
        ``"rows"``: W_p(P(theta, .), Q(theta, .)), averaged over sin(theta)/2 d theta as its p-th power.
        ``"sup"``: its supremum over theta.
        ``"joint"``: W_p between the measures sin(theta)/2 d theta P(theta, d theta') on the square; not larger than
        ``"rows"``. ``"pseudometric"``: the paper's, see the notes; p plays no part in it.
    tolerance : float
        Wanted error between laws, for ``"rows"``, ``"sup"`` and ``"pseudometric"``; where it is not reached, ``error``
        says so.

    Returns
    -------
    Distance
        An Estimate with a ``noise_floor``.

    Raises
    ------
    InputError
        If the laws are in different frames, the matrices on different bins, or an argument is not as described.

    Notes
    -----
    *Laws.* Rows are exact where they consist of atoms; densities are resolved on cells; both these and the nodes in
    the incoming angle are refined until two levels agree. The difference of the levels is the error, an estimate.

    *Matrices* are kernels between the middle angles of their cells. By the triangle inequality the distance is wrong by
    no more than both matrices are; how far empirical ones are from their laws is resampled. The interval holds in about
    95 % of cases for a sample against its own law, and in more for two samples or laws that differ, since noise in
    rows that differ cancels, by an amount that the counts do not tell. The distance of matrices can be far below that
    of the laws if these vary within cells: two involutions may have the same matrix.

    *Joint* distances of matrices are exact up to 4 million pairs of occupied cells (160 MB); beyond, cells are merged,
    and the error says what that may have done. At orders of a few dozen and more, p-th powers of all but the longest
    ways are lost in rounding, and the result is the middle of a bracket. Laws are compared on 128 bins.

    *The pseudometric* is the sum over k, l >= 0 of 2^(-k-l-2) times the difference of the means of
    cos(k theta) cos(l theta') under the flux measures, with the rest of the sum in the error; it metrises their weak
    convergence. Source: Rudzis 2022, section 6.2.3, corrected: f(y, x) G(y, dx) nu(dy).

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> import numpy as np
    >>> round(float(distance(ker.specular(), ker.retroreflection())) - (np.pi - 2), 12)
    0.0
    >>> round(float(distance(ker.maxwell(0.75), ker.maxwell(0.25), tolerance=1e-3)), 3)    # pi/8
    0.393
    """
    if kind not in get_args(Kind):
        raise InputError(f"kind: expected one of {', '.join(get_args(Kind))}, got {kind!r}")
    power = wasserstein_order(order)
    positive_number("tolerance", tolerance)
    for law in (first, second):
        if not isinstance(law, (Law, KernelMatrix)):
            raise InputError(f"distance: expected laws or kernel matrices, got {law!r}")
    if first.frame != second.frame:
        raise InputError(
            f"distance: expected laws in the same frame, got {first.frame!r} and {second.frame!r}; use "
            "in_specular_frame() on one"
        )
    if kind == "pseudometric":
        return _labelled(moment_distance(first, second, tolerance))
    if isinstance(first, Law) and isinstance(second, Law):
        if kind == "joint":
            return _labelled(joint_law_distance(first, second, power))
        return _labelled(law_distance(first, second, power, kind == "sup", tolerance))
    return _between_matrices(*_on_same_bins(first, second, tolerance), power, kind)


def _on_same_bins(
    first: Law | KernelMatrix, second: Law | KernelMatrix, tolerance: float
) -> tuple[KernelMatrix, KernelMatrix]:
    if isinstance(first, Law):
        assert isinstance(second, KernelMatrix)  # two laws do not come here
        first = discretise(first, second.basis, tolerance=0.1 * tolerance)
    elif isinstance(second, Law):
        second = discretise(second, first.basis, tolerance=0.1 * tolerance)
    check_comparable(first, second)
    return first, second


def _between_matrices(first: KernelMatrix, second: KernelMatrix, order: float, kind: Kind) -> Distance:
    sup = kind == "sup"
    if kind == "joint":
        found = joint_matrix_distance(first, second, order)
    else:
        found = matrix_distance(first, second, order, sup)
    return Distance(found.value, found.error, found.kind, found.method, noise_floor(first, second, order, sup))


def _labelled(found: Estimate) -> Distance:
    return Distance(found.value, found.error, found.kind, found.method)
