"""Defects of kernels, which are distances from symmetric and stochastic kernels, and z-scores of sampled kernels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import slices

# Entries of a temporary array, where a square matrix is worked on some rows at a time.
BLOCK = 2**17
# Statistics with fewer degrees of freedom than this carry no information.
LEAST_FREEDOM = 1e-9
# In its tails the statistic of eight independent replicates follows Student's t. Its degrees of freedom, 3.4 d^0.27,
# were fitted to 40,000 trials with normal replicates of 1 to 1000 dimensions d. Up to z = 3 the upper tails are
# accurate to a quarter.
FREEDOM_AT_ONE, FREEDOM_POWER = 3.4, 0.27
SYMMETRY_NORM = "||(S - S^T)/2||_F / ||S||_F in an orthonormal basis"
STOCHASTIC_NORM_CELLS = "largest |sum over j of P[i, j] - 1|"
STOCHASTIC_NORM = "||P 1 - 1|| in L^2 of the invariant probability measure"


class Defect(float):
    """A defect as a float with its norm and, for sampled kernels, its z-score.

    Attributes
    ----------
    norm : str
        The norm, in words.
    z_score : float or None
        Number of standard deviations by which the defect exceeds the mean effect of sampling; None for exact kernels.

    Examples
    --------
    >>> defect = Defect(0.25, "relative Frobenius norm", 1.5)
    >>> defect < 0.5, defect.z_score
    (True, 1.5)
    """

    __slots__ = ("norm", "z_score")
    norm: str
    z_score: float | None

    def __new__(cls, value: float, norm: str, z_score: float | None = None) -> Self:
        self = super().__new__(cls, value)
        object.__setattr__(self, "norm", norm)
        object.__setattr__(self, "z_score", z_score)
        return self

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Defect is immutable; {name} cannot be set")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (float(self), self.norm, self.z_score)

    @property
    def value(self) -> float:
        """The number."""
        return float(self)

    def __repr__(self) -> str:
        z = "" if self.z_score is None else f", z_score={self.z_score:.3g}"
        return f"{type(self).__name__}({float(self):.3g}, {self.norm!r}{z})"


class SymmetryDefect(Defect):
    """The distance from reversibility: relative Frobenius norm of the antisymmetric part in an orthonormal basis."""

    __slots__ = ()

    def __new__(cls, value: float, norm: str = SYMMETRY_NORM, z_score: float | None = None) -> Self:
        return super().__new__(cls, value, norm, z_score)


def relative_asymmetry(symmetric: NDArray[Any], scale: Floats | None = None) -> float:
    """||(S - S^T)/2||_F / ||S||_F, which is 0 for reversible kernels; of the entries S_ij s_i s_j if s is given."""
    apart = whole = 0.0
    for rows in row_blocks(len(symmetric)):
        factor = 1.0 if scale is None else scale[rows, None] * scale
        ahead, back = factor * symmetric[rows], factor * symmetric[:, rows].T
        apart, whole = apart + float(np.sum((ahead - back) ** 2)), whole + float(np.sum(ahead**2))
    return math.sqrt(apart / whole) / 2.0 if whole > 0.0 else 0.0


def row_blocks(size: int) -> Iterator[slice]:
    """The rows of a square matrix, so many at a time that temporary arrays have at most `BLOCK` entries."""
    return slices(size, max(1, BLOCK // size))


def occupied_pairs(counts: NDArray[Any]) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """The cells (i, j), i < j, with a count at (i, j) or (j, i), block by block of rows."""
    for rows in row_blocks(len(counts)):
        source, target = np.nonzero(np.triu(counts[rows] + counts[:, rows].T, rows.start + 1))
        yield source + rows.start, target


def reversibility_z_score(counts: NDArray[np.int64]) -> float:
    r"""The z-score of the hypothesis that the law behind transition counts is reversible.

    Parameters
    ----------
    counts : ndarray of int64, shape (n, n)
        Raw counts C of independent pairs (incoming bin, outgoing bin), with incoming angles from the invariant measure.
        For other incoming angles C - C^T is meaningless; `estimate` then compares fluxes by `replicate_z_score`.

    Notes
    -----
    Given n = C_ij + C_ji, C_ij is binomial (n, 1/2) and independent for different pairs i < j. Therefore
    Z = (C_ij - C_ji)/sqrt(n) has E Z^2 = 1 and Var Z^2 = 2 - 2/n exactly, also for small counts; pairs with n = 1 carry
    no information. The sum of Z^2 over pairs is matched to a scaled chi-square by its two moments, and the cube root
    (Wilson-Hilferty) makes it normal.
    """
    statistic, mean, variance = 0.0, 0, 0.0
    for occupied in occupied_pairs(counts):
        forth, back = counts[occupied].astype(np.float64), counts.T[occupied].astype(np.float64)
        informative = forth + back >= 2.0
        pair, difference = (forth + back)[informative], (forth - back)[informative]
        statistic, mean = statistic + float(np.sum(difference**2 / pair)), mean + pair.size
        variance += float(np.sum(2.0 - 2.0 / pair))
    return _cube_root_score(statistic, mean, variance)


def defect_of_pairs(first: Floats, second: Floats, cells: int) -> SymmetryDefect:
    """The asymmetry of the counts of pairs of numbers from 0 to ``cells`` in cells of width 1, with its z-score."""
    row, column = (np.minimum(level.astype(np.int64), cells - 1) for level in (first, second))
    counts = np.bincount(row * cells + column, minlength=cells**2).reshape(cells, cells)
    return SymmetryDefect(relative_asymmetry(counts.astype(np.float64)), z_score=reversibility_z_score(counts))


def replicate_z_score(antisymmetric: Iterable[Sequence[Floats]]) -> float:
    """The z-score of the mean antisymmetric part from the parts A_r of several replicates, for dependent counts.

    The entries of all A_r come block by block.

    If the A_r are independent with mean 0, the inner products <A_r, A_s>, r < s, are uncorrelated with mean 0; their
    average is compared with its standard error. The fewer dimensions the A_r vary in, the heavier are the tails of this
    ratio. A Student distribution makes the ratio normal. Its degrees of freedom follow from the number of dimensions,
    (trace C)^2 / trace C^2 with C the covariance, estimated from the A_r. Replicates of one sequence are negatively
    correlated, which lowers the score of noise, so false alarms are not more frequent.
    """
    # the survival function of Student's t and its normal quantile; scipy.stats takes .4 s to import
    from scipy.special import ndtri, stdtr

    inner = gram = np.zeros(())
    for block in antisymmetric:
        flat = np.array([part.ravel() for part in block])
        centred = flat - flat.mean(axis=0)
        inner, gram = inner + flat @ flat.T, gram + centred @ centred.T
    pairs = np.triu_indices(len(inner), 1)
    products = inner[pairs]
    error = float(np.std(products, ddof=1)) / np.sqrt(products.size)
    if error <= 0.0:
        return 0.0
    dimensions = np.mean(np.diag(gram)) ** 2 / max(float(np.var(gram[pairs], ddof=1)), np.finfo(np.float64).tiny)
    freedom = FREEDOM_AT_ONE * max(float(dimensions), 1.0) ** FREEDOM_POWER
    freedom = min(freedom, products.size - 1.0)
    return -float(ndtri(stdtr(freedom, -np.mean(products) / error)))


def invariance_z_score(totals: NDArray[np.int64], weights: Floats) -> float:
    """The z-score of the hypothesis that incoming angles, counted in bins, were drawn from the invariant measure."""
    expected = float(totals.sum()) * weights
    # Pearson's statistic of a multinomial has mean n - 1 and variance 2 (n - 1) + (sum 1/w - n^2 - 2 n + 2)/N.
    freedom = weights.size - 1
    variance = 2.0 * freedom + (np.sum(1.0 / weights) - weights.size**2 - 2.0 * freedom) / max(float(totals.sum()), 1.0)
    return _cube_root_score(float(np.sum((totals - expected) ** 2 / expected)), freedom, float(variance))


def _cube_root_score(statistic: float, mean: float, variance: float) -> float:
    """Wilson-Hilferty score of a statistic near a chi-square with ``2 mean^2 / variance`` degrees of freedom."""
    if mean <= 0.0 or variance <= LEAST_FREEDOM:
        return 0.0
    ninth = variance / (9.0 * mean * mean)
    return float((np.cbrt(statistic / mean) - (1.0 - ninth)) / np.sqrt(ninth))
